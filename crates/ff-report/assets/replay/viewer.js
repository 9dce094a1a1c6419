// The view of a replay: controls, camera, the loop that draws.
(() => {
  "use strict";
  const { Camera, Orbit, Renderer, Transform, Vec3 } = OGL;
  const { Artist, Robot, ring, still } = ffidReplay;

  // Amplitude of a mode on the screen: largest rotation (rad) of a hinge, or shift relative to the size of the robot.
  const SWING = 0.15;
  // Part of the window that the robot fills.
  const IN_SIGHT = 0.9;
  const BACK = { light: [0.96, 0.97, 0.98], dark: [0.09, 0.11, 0.14] };

  /** Whether this machine draws WebGL by its processor. */
  function byProcessor() {
    const gl = document.createElement("canvas").getContext("webgl");
    if (!gl) return false;
    let name = gl.getParameter(gl.RENDERER);
    // Some browsers tell the name only so.
    const info = name === "WebKit WebGL" && gl.getExtension("WEBGL_debug_renderer_info");
    if (info) name = gl.getParameter(info.UNMASKED_RENDERER_WEBGL);
    gl.getExtension("WEBGL_lose_context")?.loseContext();
    return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
  }

  class Viewer {
    constructor(box, data) {
      this.box = box;
      this.data = data;
      this.canvas = box.querySelector("canvas");
      const software = byProcessor(), dpr = Math.min(window.devicePixelRatio || 1, 2);
      // Pixels of the screen for one of the page. The processor draws smooth edges at half the rate: there, pictures that move do
      // without, and those that stand still are drawn finer instead.
      this.fine = { still: software ? Math.max(dpr, 1.5) : dpr, moving: software ? 1 : dpr };
      const renderer = new Renderer({ canvas: this.canvas, dpr: this.fine.still, antialias: !software, preserveDrawingBuffer: true });
      const gl = renderer.gl;
      if (!gl) throw new Error("no WebGL");
      this.renderer = renderer;
      this.artist = new Artist(gl);
      this.world = new Transform();
      // The world has z up, the camera y.
      this.world.rotation.x = -Math.PI / 2;
      // The first is drawn in the colours of its parts, every further one in that of its entry in the key.
      const ghosts = [undefined, ...[...this.box.querySelectorAll("[data-ghost]")].map((chip) => chip.dataset.ghost)];
      this.robots = data.scenes.map((s, k) => new Robot(this.artist, s, data.meshes, ghosts[k]));
      this.size = Math.max(...this.robots.map((r) => r.size));
      this.robots.forEach((r) => r.root.setParent(this.world));
      const step = 10 ** Math.floor(Math.log10(this.size));
      const half = Math.ceil((2 * this.size) / step) * step;
      this.grids = [this.artist.grid(half, step, "#c9d1d9"), this.artist.grid(half, step, "#30363d")];
      this.grids.forEach((g) => { g.setParent(this.world); g.position.z = -1.05 * this.size; });
      this.gridStep = step;
      this.camera = new Camera(gl, { fov: 40, near: 0.01 * this.size, far: 60 * this.size });
      this.orbit = new Orbit(this.camera, { element: this.canvas, minDistance: 0.2 * this.size, maxDistance: 20 * this.size });
      this.time = 0;
      this.playing = false;
      this.drawn = 0;
      this.labels = [];
      this.controls();
      this.view = "corner";
      // Where the user has put the camera it stays.
      for (const turned of ["mousedown", "touchstart", "wheel"]) this.canvas.addEventListener(turned, () => { this.view = null; }, { passive: true });
      // A canvas of another size is black until it is drawn, and the next tick comes after this frame has been shown.
      new ResizeObserver(() => {
        this.resize();
        this.draw();
      }).observe(this.canvas.parentElement);
      this.resize();
      const dark = window.matchMedia("(prefers-color-scheme: dark)");
      const scheme = () => {
        gl.clearColor(...(dark.matches ? BACK.dark : BACK.light), 1);
        this.grids[0].visible = !dark.matches;
        this.grids[1].visible = dark.matches;
        this.dirty = true;
      };
      dark.addEventListener("change", scheme);
      scheme();
      let last = performance.now();
      const loop = (now) => {
        const elapsed = Math.min((now - last) / 1000, 0.25);
        last = now;
        this.tick(elapsed);
        requestAnimationFrame(loop);
      };
      requestAnimationFrame(loop);
    }
    control(name) {
      return this.box.querySelector(`[data-control="${name}"]`);
    }
    controls() {
      const scene = this.data.scenes[0];
      const what = this.control("what");
      const option = (value, text) => what.append(Object.assign(document.createElement("option"), { value, textContent: text }));
      if (this.robots.some((r) => r.motion)) option("motion", "motion");
      scene.modes.forEach((m, i) => {
        const hz = m.frequency_hz.toPrecision(4), percent = (100 * m.damping_ratio).toPrecision(2);
        option(`${i}`, `mode ${i + 1}: ${hz} Hz, damping ${percent} %`);
      });
      if (!what.options.length) option("still", "pose");
      const redraw = () => { this.dirty = true; };
      what.addEventListener("input", () => {
        this.seek(0);
        this.range();
        if (this.view) this.look(this.view);
      });
      this.control("play").addEventListener("click", () => this.play(!this.playing));
      this.control("time").addEventListener("input", (e) => { this.play(false); this.seek(Number(e.target.value)); });
      for (const name of ["deflection", "ellipsoid", "beside", "names", "boxes", "sensors", "trail", "com"]) {
        this.control(name)?.addEventListener("input", redraw);
      }
      this.control("beside").addEventListener("input", () => {
        this.draw();
        if (this.view) this.look(this.view);
      });
      this.box.querySelectorAll("[data-view]").forEach((b) => b.addEventListener("click", () => this.look(b.dataset.view)));
      this.canvas.addEventListener("keydown", (e) => this.key(e));
      // What has nothing to act on is not offered, and what is not drawn has no place in the key.
      const motion = this.robots.some((r) => r.motion), clouds = this.data.scenes.some((s) => s.com_covariance_m2);
      const has = (...roles) => this.robots.some((r) => roles.some((role) => r.byRole[role]));
      const offer = (names, needed) => names.forEach((name) => { (this.control(name).closest("label") || this.control(name)).hidden = !needed; });
      offer(["beside"], this.robots.length > 1);
      offer(["ellipsoid"], clouds);
      offer(["play", "time", "clock", "speed", "what"], what.value !== "still");
      offer(["deflection", "deflection-value"], scene.coordinates.length > 0);
      offer(["trail"], motion);
      const drawn = { panel: has("panel"), fuel: has("fuel"), joint: has("joint"), trail: motion };
      for (const [name, shown] of Object.entries(drawn)) this.box.querySelector(`[data-key="${name}"]`).hidden = !shown;
      for (const robot of this.robots) {
        for (const { node, at } of robot.frames) {
          // Links of appendages and their mounts share a name.
          if (/[\[(]/.test(node.name)) continue;
          const span = Object.assign(document.createElement("span"), { textContent: node.name });
          this.box.querySelector(".labels").append(span);
          this.labels.push({ span, at, robot });
        }
      }
      this.range();
    }
    /** Seconds that can be played. */
    duration() {
      const what = this.control("what").value;
      if (what === "motion") return Math.max(...this.robots.map((r) => (r.motion ? r.motion.duration : 0)));
      if (what === "still") return 0;
      const mode = this.data.scenes[0].modes[Number(what)];
      return Math.max(10, 8 / mode.frequency_hz);
    }
    range() {
      const time = this.control("time");
      const duration = this.duration();
      time.max = duration;
      time.step = duration / 2000 || 1;
      const idle = duration === 0;
      time.disabled = idle;
      this.control("play").disabled = idle;
      this.dirty = true;
    }
    play(on) {
      if (on && this.time >= this.duration()) this.time = 0;
      this.playing = on && this.duration() > 0;
      const button = this.control("play");
      button.textContent = this.playing ? "Pause" : "Play";
      button.setAttribute("aria-pressed", String(this.playing));
      this.scale();
    }
    seek(t) {
      this.time = Math.min(Math.max(t, 0), this.duration());
      this.dirty = true;
    }
    key(e) {
      const step = this.duration() / 100;
      const acts = {
        " ": () => this.play(!this.playing),
        ArrowLeft: () => this.seek(this.time - step),
        ArrowRight: () => this.seek(this.time + step),
        Home: () => this.seek(0),
        End: () => this.seek(this.duration()),
        1: () => this.look("corner"), 2: () => this.look("front"), 3: () => this.look("side"), 4: () => this.look("top"),
      };
      if (!acts[e.key]) return;
      e.preventDefault();
      acts[e.key]();
    }
    /** Places the camera where the whole of the robot is in the window. */
    look(from) {
      this.view = from;
      const places = { corner: [0.62, 0.42, 0.66], front: [1, 0.02, 0], side: [0, 0.02, 1], top: [0.001, 1, 0] };
      const [x, y, z] = this.data.scenes[0].com_m;
      const target = new Vec3(x, z, -y), out = new Vec3(...places[from]).normalize();
      const right = new Vec3(0, 1, 0).cross(out).normalize(), up = out.clone().cross(right);
      const high = IN_SIGHT * Math.tan((0.5 * this.camera.fov * Math.PI) / 180), wide = high * this.camera.aspect;
      const far = this.outline().map((p) => {
        p.sub(target);
        return p.dot(out) + Math.max(Math.abs(p.dot(right)) / wide, Math.abs(p.dot(up)) / high);
      });
      const d = Math.max(0.5 * this.size, ...far);
      this.orbit.target.copy(target);
      this.camera.position.copy(target.add(out.scale(d)));
      this.orbit.forcePosition();
      this.dirty = true;
    }
    /** Where a robot is when it is shown: along its motion, or in its pose. */
    places(robot) {
      if (this.control("what").value !== "motion" || !robot.motion) return [still(robot.scene)];
      return [0, 0.2, 0.4, 0.6, 0.8, 1].map((part) => robot.motion.at(part * robot.motion.duration));
    }
    /** Corners of the boxes around everything that is drawn of the robots, wherever they are shown. */
    outline() {
      const corners = [];
      for (const robot of this.robots) for (const state of this.places(robot)) {
        robot.pose(state, { deflection: 1, ellipsoid: 1 });
        this.world.updateMatrixWorld();
        robot.root.traverse((node) => {
          if (!node.geometry || [robot.trail, robot.com.marker, robot.com.cloud].includes(node)) return;
          if (!node.geometry.bounds || !Number.isFinite(node.geometry.bounds.min.x)) node.geometry.computeBoundingBox();
          const { min, max } = node.geometry.bounds;
          for (const x of [min.x, max.x]) for (const y of [min.y, max.y]) for (const z of [min.z, max.z]) {
            corners.push(new Vec3(x, y, z).applyMatrix4(node.worldMatrix));
          }
        });
      }
      return corners;
    }
    /** Gives the picture as many pixels as it is to have. */
    scale() {
      const { clientWidth: w, clientHeight: h } = this.canvas.parentElement;
      this.renderer.dpr = this.playing ? this.fine.moving : this.fine.still;
      if (w && h) this.renderer.setSize(w, h);
      this.dirty = true;
    }
    resize() {
      const { clientWidth: w, clientHeight: h } = this.canvas.parentElement;
      if (!w || !h) return;
      this.scale();
      this.camera.perspective({ aspect: w / h, fov: 40 });
      if (this.view) this.look(this.view);
      this.dirty = true;
    }
    state(robot, what) {
      if (what === "motion") return robot.motion ? robot.motion.at(this.time) : still(robot.scene);
      const mode = what === "still" ? null : robot.scene.modes[Number(what)];
      if (!mode) return still(robot.scene);
      // A mode over shifts moves by metres, one over hinges by radians.
      const shifts = robot.scene.nodes.some((n) => n.moves && n.moves.kind === "sway");
      return ring(robot.scene, mode, this.time, SWING * (shifts ? 0.3 * robot.size : 1));
    }
    tick(elapsed) {
      if (this.playing) {
        this.time += elapsed * Number(this.control("speed").value);
        if (this.time >= this.duration()) {
          this.time = this.control("what").value === "motion" ? this.duration() : 0;
          if (this.control("what").value === "motion") this.play(false);
        }
        this.dirty = true;
      }
      const before = this.camera.position.clone();
      this.orbit.update();
      if (before.distance(this.camera.position) > 1e-6 * this.size) this.dirty = true;
      if (this.dirty) this.draw();
      this.dirty = false;
    }
    draw() {
      const value = (name) => Number(this.control(name).value);
      const checked = (name) => this.control(name).checked;
      const what = this.control("what").value;
      const beside = this.control("beside").value;
      const scales = { deflection: what === "motion" ? value("deflection") : Math.min(value("deflection"), 5), ellipsoid: value("ellipsoid") };
      this.robots.forEach((robot, k) => {
        const state = this.state(robot, what);
        robot.pose(state, scales);
        // Side by side: along y of the world, away from the first.
        robot.root.position.y = beside === "side" ? (k - (this.robots.length - 1) / 2) * 2.2 * this.size : 0;
        robot.root.visible = beside === "first" ? k === 0 : beside === "second" ? k > 0 : true;
        robot.show("inertia", checked("boxes"));
        for (const role of ["joint", "gyro", "mount"]) robot.show(role, checked("sensors"));
        robot.com.marker.visible = checked("com") && robot.known.com;
        robot.com.cloud.visible = checked("com") && robot.known.com && robot.known.cloud;
        if (robot.trail) {
          robot.trail.visible = checked("trail") && what === "motion";
          robot.trail.geometry.setDrawRange(0, Math.max(2, Math.floor(this.time / robot.motion.step) + 1));
        }
      });
      this.renderer.render({ scene: this.world, camera: this.camera });
      this.drawn += 1;
      const time = this.control("time");
      if (document.activeElement !== time || this.playing) time.value = this.time;
      this.control("clock").textContent = `${this.time.toFixed(2)} s`;
      this.control("deflection-value").textContent = `\u00d7${scales.deflection}`;
      this.control("ellipsoid-value").textContent = `\u00d7${scales.ellipsoid}`;
      this.control("grid").textContent = `${this.gridStep} m`;
      this.name(checked("names"));
    }
    name(visible) {
      const { clientWidth: w, clientHeight: h } = this.canvas.parentElement;
      for (const { span, at, robot } of this.labels) {
        span.hidden = !visible || !robot.root.visible;
        if (span.hidden) continue;
        const p = new Vec3(at.worldMatrix[12], at.worldMatrix[13], at.worldMatrix[14]);
        this.camera.project(p);
        span.hidden = Math.abs(p.x) > 1 || Math.abs(p.y) > 1 || p.z > 1;
        span.style.transform = `translate(${(0.5 + 0.5 * p.x) * w}px, ${(0.5 - 0.5 * p.y) * h}px)`;
      }
    }
  }

  document.querySelectorAll(".replay").forEach((box) => {
    try {
      box.viewer = new Viewer(box, JSON.parse(box.querySelector("script").textContent));
      box.classList.add("live");
    } catch (e) {
      // The tables below say the same; a machine without WebGL is told why there is no picture.
      box.querySelector(".failed").textContent = `No 3-D view: ${e.message}.`;
    }
  });
})();
