// Geometry, colours and shading.
(() => {
  "use strict";
  const { Box, Cylinder, Geometry, Mesh, Program, Sphere, Transform, Vec3 } = OGL;

  // Okabe and Ito's colours, which the colour-blind tell apart; further robots are drawn in one colour each.
  const COLOURS = {
    link: "#7d8b99", rod: "#7d8b99", panel: "#0072b2", fuel: "#e69f00", inertia: "#7d8b99", joint: "#cc79a7",
    com: "#d55e00", trail: "#009e73",
  };
  const rgb = (hex) => [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);

  const LIT = {
    vertex: `#version 300 es
      in vec3 position; in vec3 normal;
      uniform mat4 modelViewMatrix, projectionMatrix; uniform mat3 normalMatrix;
      out vec3 n;
      void main() { n = normalMatrix * normal; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
    fragment: `#version 300 es
      precision mediump float;
      in vec3 n; uniform vec3 colour; uniform float alpha; out vec4 shade;
      void main() {
        vec3 u = normalize(gl_FrontFacing ? n : -n);
        float light = 0.45 + 0.4 * max(dot(u, normalize(vec3(0.3, 0.6, 0.8))), 0.0) + 0.2 * max(u.y, 0.0);
        shade = vec4(colour * light, alpha);
      }`,
  };
  const FLAT = {
    vertex: `#version 300 es
      in vec3 position; in vec3 tint; uniform mat4 modelViewMatrix, projectionMatrix; out vec3 c;
      void main() { c = tint; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
    fragment: `#version 300 es
      precision mediump float;
      in vec3 c; uniform float alpha; out vec4 shade;
      void main() { shade = vec4(c, alpha); }`,
  };

  /** Makes drawable things; programs and geometries are shared. */
  class Artist {
    constructor(gl) {
      this.gl = gl;
      this.programs = new Map();
      this.shapes = new Map();
    }
    once(map, key, make) {
      if (!map.has(key)) map.set(key, make());
      return map.get(key);
    }
    /** `through`: seen through everything, as the centre of mass inside a body. */
    lit(colour, alpha, through = false) {
      return this.once(this.programs, `${colour} ${alpha} ${through}`, () => new Program(this.gl, {
        ...LIT, transparent: alpha < 1 || through, cullFace: through ? this.gl.BACK : false, depthWrite: alpha === 1, depthTest: !through,
        uniforms: { colour: { value: new Vec3(...rgb(colour)) }, alpha: { value: alpha } },
      }));
    }
    flat(through = false) {
      return this.once(this.programs, `flat ${through}`, () => new Program(this.gl, {
        ...FLAT, cullFace: false, transparent: through, depthTest: !through, uniforms: { alpha: { value: 1 } },
      }));
    }
    /** A shape about its origin, as a node whose scale is its size. */
    shape(drawn, meshes, program) {
      const at = new Transform();
      at.position.set(...drawn.place.p);
      at.quaternion.set(...drawn.place.r);
      if (drawn.form === "axes") {
        this.axes(drawn.size).setParent(at);
        return at;
      }
      const mesh = new Mesh(this.gl, { geometry: this.geometry(drawn, meshes), program });
      if (drawn.form === "box") mesh.scale.set(...drawn.size);
      if (drawn.form === "sphere") mesh.scale.set(drawn.radius, drawn.radius, drawn.radius);
      if (drawn.form === "cylinder") {
        // Theirs is along y.
        mesh.rotation.x = Math.PI / 2;
        mesh.scale.set(drawn.radius, drawn.length, drawn.radius);
      }
      if (drawn.form === "mesh") mesh.scale.set(...drawn.scale);
      mesh.setParent(at);
      return at;
    }
    geometry(drawn, meshes) {
      const gl = this.gl;
      const key = drawn.form === "mesh" ? `mesh ${drawn.mesh}` : drawn.form;
      return this.once(this.shapes, key, () => {
        switch (drawn.form) {
          case "box": return new Box(gl);
          case "sphere": return new Sphere(gl, { radius: 1, widthSegments: 24, heightSegments: 16 });
          case "cylinder": return new Cylinder(gl, { radiusTop: 1, radiusBottom: 1, height: 1, radialSegments: 20 });
          case "mesh": return this.triangles(ffidReplay.corners(meshes[drawn.mesh]));
          default: throw new Error(`unknown form ${drawn.form}`);
        }
      });
    }
    /** Triangles with the normal of each at its corners. */
    triangles(position) {
      const normal = new Float32Array(position.length);
      for (let i = 0; i < position.length; i += 9) {
        const e = (k, c) => position[i + 3 * k + c] - position[i + c];
        const n = [0, 1, 2].map((c) => e(1, (c + 1) % 3) * e(2, (c + 2) % 3) - e(1, (c + 2) % 3) * e(2, (c + 1) % 3));
        const length = Math.hypot(...n) || 1;
        for (let k = 0; k < 9; k++) normal[i + k] = n[k % 3] / length;
      }
      return new Geometry(this.gl, { position: { size: 3, data: position }, normal: { size: 3, data: normal } });
    }
    /** Lines through points, in one colour or one for each point. */
    lines(points, tint, mode, through = false) {
      const geometry = new Geometry(this.gl, { position: { size: 3, data: points }, tint: { size: 3, data: tint } });
      return new Mesh(this.gl, { geometry, program: this.flat(through), mode, frustumCulled: false });
    }
    /** Axes x, y, z in vermilion, green and blue. */
    axes(size) {
      const points = new Float32Array([0, 0, 0, size, 0, 0, 0, 0, 0, 0, size, 0, 0, 0, 0, 0, 0, size]);
      const tint = new Float32Array(["#d55e00", "#009e73", "#0072b2"].flatMap((c) => [...rgb(c), ...rgb(c)]));
      return this.lines(points, tint, this.gl.LINES, true);
    }
    /** A line along a path. */
    path(points, colour) {
      const one = rgb(colour);
      return this.lines(points, Float32Array.from(points, (_, i) => one[i % 3]), this.gl.LINE_STRIP);
    }
    /** A square grid in the plane z = 0. */
    grid(half, step, colour) {
      const points = [];
      const n = Math.round(half / step);
      for (let i = -n; i <= n; i++) points.push(i * step, -n * step, 0, i * step, n * step, 0, -n * step, i * step, 0, n * step, i * step, 0);
      const one = rgb(colour);
      return this.lines(new Float32Array(points), Float32Array.from(points, (_, i) => one[i % 3]), this.gl.LINES);
    }
  }

  Object.assign(ffidReplay, { Artist, COLOURS });
})();
