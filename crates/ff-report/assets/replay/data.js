// Data of a replay: numbers unpacked, motions interpolated.
(() => {
  "use strict";
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));

  /** Single-precision numbers of `packed::singles`. */
  const singles = (text) => new Float32Array(bytes(text).buffer);

  /** Corners of a mesh (its own unit) from whole numbers of 16 bits over the box about it. */
  const corners = (mesh) => {
    const steps = new Uint16Array(bytes(mesh.data).buffer);
    return Float32Array.from(steps, (s, i) => mesh.low[i % 3] + (s / 65535) * mesh.size[i % 3]);
  };

  /** A motion that can be asked for any time: `at(t)` gives base pose, coordinates, centre of mass and its covariance. */
  class Motion {
    constructor(scene) {
      const m = scene.motion;
      this.step = m.step_s;
      this.frames = m.frames;
      this.columns = m.columns;
      this.numbers = singles(m.data);
      this.coordinates = scene.joints.length + scene.coordinates.length;
      this.ellipsoids = m.ellipsoids;
      this.duration = (m.frames - 1) * m.step_s;
    }
    at(t) {
      const x = Math.min(Math.max(t / this.step, 0), this.frames - 1);
      const i = Math.min(Math.floor(x), Math.max(this.frames - 2, 0));
      const u = x - i;
      const a = this.numbers.subarray(i * this.columns, (i + 1) * this.columns);
      const j = Math.min(i + 1, this.frames - 1);
      const b = this.numbers.subarray(j * this.columns, (j + 1) * this.columns);
      // Quaternions of both signs are the same attitude.
      const same = a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6] < 0 ? -1 : 1;
      const mix = (k) => a[k] + u * ((k > 2 && k < 7 ? same : 1) * b[k] - a[k]);
      const slice = (from, n) => Array.from({ length: n }, (_, k) => mix(from + k));
      return {
        position: slice(0, 3),
        attitude: slice(3, 4),
        coordinates: slice(7, this.coordinates),
        com: slice(7 + this.coordinates, 3),
        covariance: this.covariance(x),
      };
    }
    covariance(frame) {
      const e = this.ellipsoids;
      if (!e) return null;
      let k = e.at.findIndex((f) => f >= frame);
      if (k < 0) k = e.at.length - 1;
      const before = Math.max(k - 1, 0);
      const span = e.at[k] - e.at[before];
      const u = span > 0 ? (frame - e.at[before]) / span : 0;
      return e.covariance_m2[k].map((x, i) => e.covariance_m2[before][i] * (1 - u) + x * u);
    }
    /** Places of the base, for its trail. */
    trail() {
      const out = new Float32Array(3 * this.frames);
      for (let i = 0; i < this.frames; i++) out.set(this.numbers.subarray(i * this.columns, i * this.columns + 3), 3 * i);
      return out;
    }
  }

  /**
   * A mode at time `t`: a decaying oscillation of amplitude `size` in passive coordinates (rad or m), which begins anew when a tenth is
   * left. Velocities of base and coordinates add up for small motions, and so do these displacements.
   */
  const ring = (scene, mode, t, size) => {
    const w = 2 * Math.PI * mode.frequency_hz;
    const z = Math.min(mode.damping_ratio, 1);
    const period = 1 / mode.frequency_hz;
    const length = period * Math.max(3, Math.min(40, Math.ceil(Math.log(10) / (z * w * period + 1e-9))));
    const s = t % length;
    const wave = size * Math.exp(-z * w * s) * Math.cos(w * Math.sqrt(1 - z * z) * s);
    const half = mode.base.slice(3).map((x) => 0.5 * x * wave);
    return {
      position: mode.base.slice(0, 3).map((x) => x * wave),
      attitude: [...half, Math.sqrt(Math.max(0, 1 - half.reduce((sum, x) => sum + x * x, 0)))],
      coordinates: [...scene.pose, ...scene.rest.map((r, i) => r + mode.passive[i] * wave)],
      com: null,
      covariance: null,
    };
  };

  /** A robot at rest in its pose. */
  const still = (scene) => ({
    position: [0, 0, 0],
    attitude: [0, 0, 0, 1],
    coordinates: [...scene.pose, ...scene.rest],
    com: scene.com_m,
    covariance: scene.com_covariance_m2 || null,
  });

  /** Eigenvalues and unit eigenvectors (as columns) of a symmetric 3 x 3 matrix `xx xy xz yy yz zz` by Jacobi's rotations. */
  const principal = ([xx, xy, xz, yy, yz, zz]) => {
    const a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
    const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
    for (let sweep = 0; sweep < 12; sweep++) {
      for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
        if (a[p][q] === 0) continue;
        const angle = 0.5 * Math.atan2(2 * a[p][q], a[q][q] - a[p][p]);
        const c = Math.cos(angle), s = Math.sin(angle);
        for (let k = 0; k < 3; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
        for (let k = 0; k < 3; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
        for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
      }
    }
    return { values: [a[0][0], a[1][1], a[2][2]], vectors: v };
  };

  globalThis.ffidReplay = { Motion, corners, principal, ring, singles, still };
})();
