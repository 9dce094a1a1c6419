// A scene as a tree of transforms that follows coordinates.
(() => {
  "use strict";
  const { Mesh, Quat, Transform, Vec3 } = OGL;
  const { COLOURS } = ffidReplay;

  const aboutAxis = (q, v) => {
    const angle = Math.hypot(...v);
    const s = angle > 1e-12 ? Math.sin(angle / 2) / angle : 0.5;
    return q.set(v[0] * s, v[1] * s, v[2] * s, Math.cos(angle / 2));
  };

  class Robot {
    /** `ghost`: the colour of a further robot, which is half transparent. */
    constructor(artist, scene, meshes, ghost) {
      this.scene = scene;
      this.root = new Transform();
      this.base = new Transform();
      this.base.setParent(this.root);
      this.moving = [];
      this.byRole = {};
      this.motion = scene.motion ? new ffidReplay.Motion(scene) : null;
      const alphas = ghost ? { solid: 0.35, clear: 0.15 } : { solid: 1, clear: 0.25 };
      this.frames = scene.nodes.map((node) => ({ node, at: new Transform(), move: new Transform() }));
      for (const { node, at, move } of this.frames) {
        at.setParent(node.parent === undefined ? this.base : this.frames[node.parent].move);
        at.position.set(...node.place.p);
        at.quaternion.set(...node.place.r);
        move.setParent(at);
        if (node.moves) this.moving.push({ moves: node.moves, move });
        // A body without a surface of its own shows its box.
        const bare = !node.shapes.some((s) => ["link", "panel", "fuel"].includes(s.role));
        for (const s of node.shapes) {
          const box = s.role === "inertia";
          const alpha = box && !bare ? alphas.clear : alphas.solid;
          const colour = ghost && s.role !== "joint" ? ghost : COLOURS[s.role] || COLOURS.link;
          // Joints and fuel are inside of bodies, and are seen through them.
          const through = s.role === "joint" || s.role === "fuel";
          const drawn = artist.shape(s, meshes, artist.lit(colour, through ? 0.7 * alpha : alpha, through));
          drawn.setParent(move);
          const role = box && bare ? "link" : s.role;
          (this.byRole[role] ||= []).push(drawn);
        }
      }
      // Centre of mass: in the world.
      const marker = new Mesh(artist.gl, { geometry: artist.geometry({ form: "sphere" }), program: artist.lit(COLOURS.com, 1, true) });
      marker.setParent(this.root);
      const cloud = new Mesh(artist.gl, { geometry: artist.geometry({ form: "sphere" }), program: artist.lit(COLOURS.com, 0.3, true) });
      cloud.setParent(this.root);
      this.com = { marker, cloud };
      if (this.motion) {
        this.trail = artist.path(this.motion.trail(), COLOURS.trail);
        this.trail.setParent(this.root);
      }
      this.size = this.extent();
      const r = 0.012 * this.size;
      marker.scale.set(r, r, r);
    }
    /** Radius about the base that holds every node and its shapes at rest (m). */
    extent() {
      this.pose(ffidReplay.still(this.scene), { deflection: 1, ellipsoid: 1 });
      this.root.updateMatrixWorld();
      let far = 0.1;
      for (const { node, move } of this.frames) {
        for (const s of node.shapes) {
          const half = s.form === "box" ? 0.5 * Math.hypot(...s.size) : s.radius || 0;
          const p = new Vec3(...s.place.p).applyMatrix4(move.worldMatrix);
          far = Math.max(far, p.len() + half);
        }
      }
      return far;
    }
    show(role, visible) {
      for (const t of this.byRole[role] || []) t.visible = visible;
    }
    /** Moves everything; deflections from rest are multiplied by `deflection`, the axes of the ellipsoid by `ellipsoid`. */
    pose(state, { deflection, ellipsoid }) {
      const joints = this.scene.joints.length;
      const exaggerated = state.coordinates.map((x, i) => {
        const rest = this.scene.rest[i - joints];
        return i < joints ? x : rest + deflection * (x - rest);
      });
      this.base.position.set(...state.position);
      this.base.quaternion.set(...state.attitude).normalize();
      const position = ({ by, follows }) => (follows ? follows[0] * exaggerated[by] + follows[1] : exaggerated[by]);
      for (const { moves, move } of this.moving) {
        if (moves.kind === "turn") {
          const angle = position(moves);
          aboutAxis(move.quaternion, moves.axis.map((a) => a * angle));
        } else if (moves.kind === "slide") {
          move.position.set(...moves.axis.map((a) => a * position(moves)));
        } else {
          const sum = (rows) => [0, 1, 2].map((k) => rows.reduce((s, row, c) => {
            const i = moves.first + c;
            return s + row[k] * (exaggerated[i] - this.scene.rest[i - joints]);
          }, 0));
          move.position.set(...sum(moves.shift));
          aboutAxis(move.quaternion, sum(moves.turn));
        }
      }
      const { marker, cloud } = this.com;
      this.known = { com: !!state.com, cloud: !!state.covariance };
      if (state.com) marker.position.set(...state.com);
      if (state.com && state.covariance) {
        const { values, vectors } = ffidReplay.principal(state.covariance);
        // Columns of a rotation; a reflection is turned round.
        const det = vectors[0][0] * (vectors[1][1] * vectors[2][2] - vectors[1][2] * vectors[2][1])
          - vectors[0][1] * (vectors[1][0] * vectors[2][2] - vectors[1][2] * vectors[2][0])
          + vectors[0][2] * (vectors[1][0] * vectors[2][1] - vectors[1][1] * vectors[2][0]);
        const f = det < 0 ? -1 : 1;
        const m = [0, 1, 2].flatMap((c) => [0, 1, 2].map((r) => f * vectors[r][c]));
        const own = new Quat();
        own.fromMatrix3(m);
        const base = this.base.quaternion;
        const turned = new Quat(base.x, base.y, base.z, base.w).multiply(own);
        cloud.quaternion.set(turned.x, turned.y, turned.z, turned.w);
        cloud.position.set(...state.com);
        const least = 1e-4 * (this.size || 1);
        cloud.scale.set(...values.map((v) => Math.max(ellipsoid * Math.sqrt(Math.max(v, 0)), least)));
      }
      return this;
    }
  }

  Object.assign(ffidReplay, { Robot });
})();
