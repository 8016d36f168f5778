// ---- stage: what is drawn in space ----

const PARTS = {
  robot: "robot", meshes: "its meshes", goal: "goal", person: "person", markers: "markers", before: "before", mass: "centre of mass",
  support: "support", contacts: "contacts", collisions: "touching links", forces: "force plates", sensors: "sensors",
};

// Whether pictures are drawn by the processor, for want of a graphics card.
function isDrawnByProcessor() {
  const gl = document.createElement("canvas").getContext("webgl2"), names = gl?.getExtension("WEBGL_debug_renderer_info");
  const name = gl ? String(gl.getParameter(names ? names.UNMASKED_RENDERER_WEBGL : gl.RENDERER)) : "";
  gl?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}

class Stage {
  // `spares`: less is drawn, for the sake of whatever else the processor does.
  constructor(canvas, { robot, persons, markers, plates, isWrong, spares }) {
    const person = persons[0] || null;
    Object.assign(this, { canvas, robot, person, persons, markers, plates, isWrong });
    this.turn = robot && person ? -0.3 : -0.8; this.tilt = 0.2; this.zoom = 1; this.follows = true; this.chosen = new Set();
    this.shown = {};
    this.gl = new THREE.WebGLRenderer({ canvas, antialias: !spares });
    this.gl.setPixelRatio(spares ? 1 : Math.min(2, window.devicePixelRatio || 1));
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(38, 1, 0.01, 200);
    this.camera.up.set(0, 0, 1);
    this.sky = new THREE.HemisphereLight(0xffffff, 0x888888, 2.2);
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(2, -3, 5);
    this.scene.add(this.sky, sun);
    this.material = colour => new THREE.MeshLambertMaterial({ color: colour });
    this.ink = {
      robot: this.material(0), chosen: this.material(0), wrong: this.material(0), mass: this.material(0),
      marker: this.material(0), bare: this.material(0), mended: this.material(0), contact: this.material(0), force: this.material(0), axes: [0xd0342c, 0x2e8b57, 0x2f6fd6].map(colour => this.material(colour)),
      goal: new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.28, depthWrite: false }),
      before: new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.35, depthWrite: false }),
      support: new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.35, side: THREE.DoubleSide, depthWrite: false }),
      sides: [this.material(0), this.material(0), this.material(0)],
      line: new THREE.LineBasicMaterial(),
      light: new THREE.MeshBasicMaterial(), dark: new THREE.MeshBasicMaterial(),
    };
    this.size();
    this.floor();
    if (robot) this.addRobot();
    this.figures = persons.map((one, n) => this.addPerson(one, n));
    if (markers) this.addMarkers();
    this.arrows = plates ? plates.list.map(plate => this.addPlate(plate)) : [];
    this.balls = Array.from({ length: 16 }, () => this.ball(this.ink.contact, this.scale * 0.018));
    this.centres = [0, 1, 2].map(() => this.addCentre());
    this.supports = [0, 1, 2].map(() => this.addSupport());
    this.theme();
  }

  has(part) {
    const { robot, person, markers } = this;
    switch (part) {
      case "robot": return !!robot;
      case "meshes": return !!robot && robot.links.some(link => link.mesh);
      case "collisions": return !!robot && robot.links.some(link => link.shapes.length);
      case "goal": return !!robot && robot.joints.list.some(joint => joint.goal && joint.present);
      case "person": return !!person;
      case "sensors": return this.persons.some(one => one.sensors.length);
      case "forces": return !!this.plates;
      case "markers": return !!markers;
      case "before": return !!markers && markers.points.some(point => point.before);
      case "mass": return !!(person && person.centres) || !!(robot && robot.mass > 0);
      case "support": return !!(person && person.corners) || !!(robot && robot.soles.length);
      default: return !!(person && person.contacts) || !!(robot && robot.soles.length);
    }
  }

  // How large things are: floor squares, lines, the camera's distance.
  size() {
    const { robot, person, markers } = this;
    this.middle = [0, 0, 0];
    if (robot) {
      // The tallest it is in a score of moments: it may begin in a crouch.
      const end = robot.joints.clock.time(robot.joints.clock.count - 1);
      const heights = Array.from({ length: 20 }, (_, n) => robot.height(robot.places((n * end) / 19, "present")));
      if (robot.grounded) heights.push(robot.height(robot.placed(robot.joints.list.map(() => 0), 0)));
      else if (robot.free) heights.push(robot.reach());
      this.scale = Math.max(...heights);
      return;
    }
    if (person) { this.scale = person.stature; return; }
    let [low, high, sum, count] = [Infinity, -Infinity, [0, 0], 0];
    for (const { at } of markers ? markers.points : []) {
      for (let i = 0; i < at[2].length; i += 1 + (at[2].length >> 6)) {
        if (Number.isNaN(at[2][i])) continue;
        low = Math.min(low, at[2][i]); high = Math.max(high, at[2][i]);
        sum = [sum[0] + at[0][i], sum[1] + at[1][i]]; count += 1;
      }
    }
    this.scale = high > low ? Math.max(0.2, Math.min(20, high - Math.min(0, low))) : 1;
  }

  floor() {
    // Squares of half a metre, or of a tenth under a small robot, tell how fast the body goes.
    this.square = this.scale > 0.9 ? 0.5 : this.scale > 0.2 ? 0.1 : 0.05;
    const count = 40, half = count / 2, dark = [], light = [];
    for (let i = -half; i < half; i++) {
      for (let j = -half; j < half; j++) {
        const [x, y, s] = [i * this.square, j * this.square, this.square];
        ((i + j) & 1 ? dark : light).push(x, y, 0, x + s, y, 0, x + s, y + s, 0, x, y, 0, x + s, y + s, 0, x, y + s, 0);
      }
    }
    this.ground = new THREE.Group();
    for (const [places, ink] of [[dark, this.ink.dark], [light, this.ink.light]]) {
      const shape = new THREE.BufferGeometry();
      shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(places), 3));
      this.ground.add(new THREE.Mesh(shape, ink));
    }
    this.ground.position.z = -0.002 * this.scale;
    this.scene.add(this.ground);
  }

  ball(ink, radius) {
    const ball = new THREE.Mesh(new THREE.SphereGeometry(radius, 16, 12), ink);
    ball.visible = false;
    this.scene.add(ball);
    return ball;
  }

  shapesOf(link, ink) {
    const group = new THREE.Group();
    for (const shape of link.shapes) {
      let mesh;
      if (shape.from_m) {
        const [a, b] = [new THREE.Vector3(...shape.from_m), new THREE.Vector3(...shape.to_m)];
        const length = a.distanceTo(b);
        mesh = new THREE.Mesh(new THREE.CapsuleGeometry(shape.radius_m, length, 6, 14), ink);
        mesh.position.copy(a).add(b).multiplyScalar(0.5);
        if (length > 1e-9) mesh.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), b.sub(a).normalize());
      } else {
        mesh = new THREE.Mesh(new THREE.BoxGeometry(...shape.half_m.map(half => 2 * half)), ink);
        mesh.position.set(...shape.centre_m);
        const [w, x, y, z] = shape.turn;
        mesh.quaternion.set(x, y, z, w);
      }
      group.add(mesh);
    }
    const shapes = group.children.slice();
    if (link.mesh) {
      const shape = new THREE.BufferGeometry();
      const [x, y, z] = link.mesh.points.map(decoded), [a, b, c] = link.mesh.triangles.map(decoded);
      shape.setAttribute("position", new THREE.BufferAttribute(Float32Array.from({ length: 3 * x.length }, (_, i) => [x, y, z][i % 3][(i / 3) | 0]), 3));
      shape.setIndex(Array.from({ length: 3 * a.length }, (_, i) => [a, b, c][i % 3][(i / 3) | 0]));
      // Each triangle is lit on its own: edges stay edges.
      const flat = shape.toNonIndexed();
      flat.computeVertexNormals();
      group.add(new THREE.Mesh(flat, ink));
      group.userData.shapes = shapes;
    }
    return group;
  }

  // Links that have a mesh show it, or the shapes that are held against one another.
  showMeshes() {
    const yes = this.isShown("meshes");
    for (const { userData: { shapes }, children } of [...this.bodies, ...this.ghosts]) {
      if (shapes) for (const child of children) child.visible = shapes.includes(child) !== yes;
    }
  }

  addRobot() {
    const bare = !this.robot.links.some(link => link.shapes.length);
    const all = ink => this.robot.links.map((link, n) => {
      const group = this.shapesOf(link, ink);
      if (bare) group.add(new THREE.Mesh(new THREE.SphereGeometry(0.03 * this.scale, 16, 12), ink));
      group.userData.link = n;
      this.scene.add(group);
      return group;
    });
    this.bodies = all(this.ink.robot);
    this.ghosts = this.has("goal") ? all(this.ink.goal) : [];
    this.showMeshes();
    // Links without a shape: what connects joints is drawn as lines.
    this.bones = this.robot.links.map((link, n) => {
      if (link.parent === null) return null;
      if (this.robot.links[link.parent].shapes.length) return null;
      const rod = this.rod(this.ink.robot, bare ? 0.018 : 0.006);
      rod.userData.link = link.parent;
      return rod;
    });
  }

  rod(ink, share) {
    const rod = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 10), ink);
    rod.userData.radius = share;
    this.scene.add(rod);
    return rod;
  }

  lay(rod, a, b, scale) {
    const from = new THREE.Vector3(...a), to = new THREE.Vector3(...b), length = from.distanceTo(to);
    rod.visible = length > 1e-6;
    if (!rod.visible) return;
    const radius = rod.userData.radius * scale;
    rod.position.copy(from).add(to).multiplyScalar(0.5);
    rod.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), to.sub(from).divideScalar(length));
    rod.scale.set(radius, length, radius);
  }

  addPerson(person, number) {
    const rods = person.lines.map((lines, side) => lines.map(() => this.rod(this.ink.sides[side], 0.015)));
    const knots = person.points.map(() => this.ball(this.ink.sides[0], 1));
    // Axes of a sensor: X red, Y green, Z blue, as everybody draws them.
    const axes = person.sensors.map(() => this.ink.axes.map(ink => this.rod(ink, 0.006)));
    return { person, number, rods, knots, axes, headBall: this.ball(this.ink.sides[0], 1) };
  }

  addMarkers() {
    const count = this.markers.points.length, shape = new THREE.SphereGeometry(0.007 * Math.max(0.5, Math.min(2, this.scale)), 12, 8);
    this.dots = this.markers.points.map(point => {
      const ink = !point.labelled ? this.ink.bare : point.before ? this.ink.mended : this.ink.marker;
      const dots = [new THREE.Mesh(shape, ink), point.before && new THREE.Mesh(shape, this.ink.before)];
      dots.forEach(dot => dot && this.scene.add(dot));
      return dots;
    });
    const lines = new THREE.BufferGeometry();
    lines.setAttribute("position", new THREE.BufferAttribute(new Float32Array(count * 2 * 3 * 24), 3));
    this.trails = new THREE.LineSegments(lines, this.ink.line);
    this.trails.frustumCulled = false;
    this.scene.add(this.trails);
  }

  addPlate({ corners }) {
    const shape = new THREE.BufferGeometry(), [a, b, c, d] = corners;
    shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array([a, b, b, c, c, d, d, a].flat()), 3));
    const edge = new THREE.LineSegments(shape, this.ink.line);
    this.scene.add(edge);
    return { edge, rod: this.rod(this.ink.force, 0.01), tip: this.ball(this.ink.force, 0.018 * this.scale) };
  }

  addCentre() {
    const ball = this.ball(this.ink.mass, 0.02 * this.scale), shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
    const line = new THREE.Line(shape, this.ink.line);
    line.frustumCulled = false;
    this.scene.add(line);
    return { ball, line };
  }

  addSupport() {
    const shape = new THREE.BufferGeometry();
    shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(3 * 3 * 64), 3));
    const mesh = new THREE.Mesh(shape, this.ink.support);
    mesh.frustumCulled = false;
    this.scene.add(mesh);
    return mesh;
  }

  theme() {
    const style = getComputedStyle(document.documentElement);
    const colour = name => new THREE.Color(style.getPropertyValue(`--${name}`).trim());
    this.scene.background = colour("sky");
    const names = { robot: "robot", chosen: "chosen", wrong: "wrong", mass: "mass", marker: "marker", bare: "faint",
      mended: "mended", contact: "good", force: "chosen", goal: "goal", before: "wrong", support: "good", line: "faint", light: "floor-a", dark: "floor-b" };
    for (const [part, name] of Object.entries(names)) this.ink[part].color.copy(colour(name));
    ["middle", "left", "right"].forEach((side, n) => this.ink.sides[n].color.copy(colour(side)));
  }

  show(part, yes) {
    this.shown[part] = yes;
    if (part === "meshes") this.showMeshes();
  }
  isShown(part) { return this.shown[part] !== false && this.has(part); }

  // Puts everything where it is at a time.
  put(t) {
    const { robot, person, markers } = this;
    let focus = [0, 0, this.scale / 2];
    this.balls.forEach(ball => { ball.visible = false; });
    const contacts = this.balls.slice();
    const touch = place => {
      const ball = contacts.pop();
      if (ball && this.isShown("contacts")) { ball.visible = true; ball.position.set(...place); }
    };
    let base = null;
    if (robot) {
      const places = robot.places(t, "present"), wrong = this.isShown("collisions") ? this.isWrong(t) : new Set();
      this.pose(this.bodies, places, this.isShown("robot"), n =>
        wrong.has(n) ? this.ink.wrong : this.chosen.has(n - 1) ? this.ink.chosen : this.ink.robot);
      if (this.ghosts.length) {
        const goals = robot.places(t, "goal");
        this.pose(this.ghosts, goals, this.isShown("goal"), () => this.ink.goal);
        // Where goal and present are one, a ghost would only tint the link.
        this.ghosts.forEach((ghost, n) => {
          const off = Math.hypot(...goals[n].at.map((part, axis) => part - places[n].at[axis]));
          const along = Math.abs(goals[n].turn.reduce((sum, part, k) => sum + part * places[n].turn[k], 0));
          if (off < 0.003 && along > 0.9998) ghost.visible = false;
        });
      }
      this.bones.forEach((bone, n) => {
        if (!bone) return;
        this.lay(bone, places[robot.links[n].parent].at, places[n].at, this.scale);
        bone.visible = bone.visible && this.isShown("robot");
      });
      base = places[0].at;
      focus = [base[0], base[1], this.scale / 2];
      this.mass(0, robot.centre(places));
      const corners = robot.support(places);
      this.area(0, corners);
      const stands = robot.contacts[robot.clock.at(t)];
      robot.soles.forEach(([link, sole]) => {
        const middle = sole.reduce((sum, corner) => plus(sum, corner), [0, 0, 0]).map(part => part / sole.length);
        const at = plus(places[link].at, turned(places[link].turn, middle));
        const side = robot.soles.length > 1 ? (at[1] > places[0].at[1] ? 1 : 2) : 3;
        if (stands & side && at[2] < 0.02) touch([at[0], at[1], Math.max(0, at[2])]);
      });
    }
    if (person) {
      const at = this.figures.map(figure => this.putPerson(figure, t, base)).filter(Boolean);
      if (at.length) focus = at.reduce((sum, place) => plus(sum, place), [0, 0, 0]).map(part => part / at.length);
      // How far apart two are is room that is needed.
      this.apart = at.length > 1 ? Math.hypot(at[0][0] - at[1][0], at[0][1] - at[1][1]) : 0;
    }
    if (markers) {
      const at = this.putMarkers(t);
      if (!robot && !person && at) focus = [at[0], at[1], this.scale / 2];
    }
    this.arrows.forEach(({ edge, rod, tip }, n) => {
      const visible = this.isShown("forces"), arrow = this.plates.arrow(this.plates.list[n], t);
      edge.visible = visible;
      tip.visible = rod.visible = visible && !!arrow;
      if (!rod.visible) return;
      this.lay(rod, ...arrow, this.scale);
      tip.position.set(...arrow[1]);
    });
    if (this.follows || !this.target) this.target = focus;
  }

  pose(groups, places, visible, inkOf) {
    groups.forEach((group, n) => {
      const { at, turn } = places[n], ink = inkOf(n);
      group.visible = visible;
      group.position.set(...at);
      group.quaternion.set(turn[1], turn[2], turn[3], turn[0]);
      for (const mesh of group.children) mesh.material = ink;
    });
  }

  mass(n, centre) {
    const { ball, line } = this.centres[n], visible = !!centre && this.isShown("mass");
    ball.visible = line.visible = visible;
    if (!visible) return;
    ball.position.set(...centre);
    line.geometry.attributes.position.array.set([...centre, centre[0], centre[1], 0]);
    line.geometry.attributes.position.needsUpdate = true;
  }

  area(n, corners) {
    const mesh = this.supports[n], places = mesh.geometry.attributes.position.array;
    mesh.visible = corners.length > 2 && this.isShown("support");
    const triangles = Math.min(64, Math.max(0, corners.length - 2));
    for (let i = 0; i < triangles; i++) {
      [corners[0], corners[i + 1], corners[i + 2]].forEach(([x, y], k) => places.set([x, y, 0.001], 9 * i + 3 * k));
    }
    mesh.geometry.setDrawRange(0, 3 * triangles);
    mesh.geometry.attributes.position.needsUpdate = true;
  }

  putPerson({ person, number, rods, knots, axes, headBall }, t, base) {
    const visible = this.isShown("person");
    if (!person.clock.count) {
      for (const part of [...rods.flat(), ...knots, ...axes.flat(), headBall]) part.visible = false;
      return null;
    }
    let places = person.places(t), centre = person.centre(t), corners = person.support(t), scale = person.stature;
    if (base) {
      // Beside the robot, as tall as it, and where it goes.
      const k = this.trueSize ? 1 : this.scale / person.stature, root = places[0];
      const beside = [base[0], base[1] - 0.5 * (this.scale + k * person.stature)];
      const moved = p => [(p[0] - root[0]) * k + beside[0], (p[1] - root[1]) * k + beside[1], (p[2] || 0) * k];
      places = places.map(moved); centre = centre && moved(centre); corners = corners.map(moved); scale *= k;
    }
    person.lines.forEach((lines, side) => lines.forEach(([a, b], n) => {
      this.lay(rods[side][n], places[a], places[b], scale);
      rods[side][n].visible = visible;
    }));
    knots.forEach((ball, n) => {
      ball.visible = visible && !person.head.includes(n);
      ball.position.set(...places[n]);
      ball.scale.setScalar(0.017 * scale);
    });
    const [neck, top] = person.head.map(n => places[n]);
    headBall.visible = visible;
    headBall.position.set(...neck.map((part, axis) => part + 0.6 * (top[axis] - part)));
    headBall.scale.setScalar(0.4 * Math.hypot(...top.map((part, axis) => part - neck[axis])) || 0.01);
    person.sensors.forEach((sensor, n) => {
      const worn = visible && this.isShown("sensors") ? person.worn(sensor, places, t) : null;
      axes[n].forEach((rod, k) => {
        rod.visible = false;
        const tip = [0, 0, 0];
        tip[k] = 0.055 * scale;
        if (worn) this.lay(rod, worn.at, plus(worn.at, turned(worn.turn, tip)), scale);
      });
    });
    this.mass(1 + number, visible ? centre : null);
    this.area(1 + number, visible ? corners : []);
    const stands = person.contacts ? person.contacts[person.clock.at(t)] : 0;
    person.soles.forEach((sole, bit) => {
      if (stands >> bit & 1 && visible && this.isShown("contacts")) {
        const ball = this.balls[4 * number + bit];
        ball.visible = true;
        ball.position.set(...places[sole]);
      }
    });
    return base ? [base[0], base[1] - this.scale / 2, this.scale / 2] : [places[0][0], places[0][1], this.scale / 2];
  }

  putMarkers(t) {
    const { markers } = this, trail = this.trails.geometry.attributes.position;
    let sum = [0, 0], count = 0, used = 0;
    const now = markers.clock.at(t), back = Math.max(1, Math.round((markers.clock.rate || 1) * 0.02));
    markers.points.forEach((point, n) => {
      const [dot, ghost] = this.dots[n], at = markers.place(point.at, t);
      dot.visible = !Number.isNaN(at[0]) && this.isShown("markers");
      dot.scale.setScalar(this.chosen.has(n) ? 2.2 : 1);
      if (!Number.isNaN(at[0])) { dot.position.set(...at); sum = [sum[0] + at[0], sum[1] + at[1]]; count += 1; }
      if (ghost) {
        const was = markers.place(point.before, t);
        ghost.visible = this.isShown("before") && !Number.isNaN(was[0]) && Math.hypot(...was.map((x, k) => x - at[k])) > 1e-3;
        ghost.scale.setScalar(1.4);
        if (ghost.visible) ghost.position.set(...was);
      }
      for (let k = 0; k < 16 && dot.visible; k++) {
        const [a, b] = [now - k * back, now - (k + 1) * back];
        if (b < 0 || Number.isNaN(point.at[0][a]) || Number.isNaN(point.at[0][b])) continue;
        trail.array.set(point.at.map(axis => axis[a]), 3 * used++);
        trail.array.set(point.at.map(axis => axis[b]), 3 * used++);
      }
    });
    this.trails.geometry.setDrawRange(0, used);
    this.trails.visible = this.isShown("markers");
    trail.needsUpdate = true;
    if (count) this.lastMiddle = sum.map(part => part / count);
    return this.lastMiddle;
  }

  draw() {
    const { canvas, camera } = this, [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width || !height) return;
    const ratio = this.gl.getPixelRatio();
    if (canvas.width !== Math.floor(width * ratio) || canvas.height !== Math.floor(height * ratio)) {
      this.gl.setSize(width, height, false);
    }
    camera.aspect = width / height;
    const room = (this.apart || 0) + this.scale * (this.robot && this.person ? (this.trueSize ? 1.2 + 1.2 * this.person.stature / this.scale : 2.2) : 1.25);
    const fit = Math.max(this.scale * 1.25, room / Math.min(2.2, camera.aspect)) / (2 * Math.tan(camera.fov * Math.PI / 360));
    const away = 1.15 * fit / this.zoom, [x, y, z] = this.target;
    const [c, s] = [Math.cos(this.tilt), Math.sin(this.tilt)];
    camera.position.set(x + away * c * Math.cos(this.turn), y + away * c * Math.sin(this.turn), z + away * s);
    camera.near = away / 100; camera.far = away * 60;
    camera.lookAt(x, y, z);
    camera.updateProjectionMatrix();
    const snapped = value => Math.round(value / (2 * this.square)) * 2 * this.square;
    this.ground.position.x = snapped(x); this.ground.position.y = snapped(y);
    this.gl.render(this.scene, camera);
  }

  // What of the robot is under a place of the canvas: its link, and the place in the link's axes.
  grab(x, y) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight], ray = new THREE.Raycaster();
    ray.setFromCamera(new THREE.Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.camera);
    const hit = ray.intersectObjects([...this.bodies, ...this.bones.filter(Boolean)], true).find(({ object }) => object.visible);
    if (!hit) return null;
    const link = hit.object.userData.link ?? hit.object.parent.userData.link;
    return { link, local: this.bodies[link].worldToLocal(hit.point.clone()).toArray() };
  }

  // Where on the canvas a place is.
  project(place) {
    const { x, y } = new THREE.Vector3(...place).project(this.camera);
    return [(x + 1) / 2 * this.canvas.clientWidth, (1 - y) / 2 * this.canvas.clientHeight];
  }

  // The joint whose link is under a place of the canvas, or the marker next to it.
  pick(x, y) {
    const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
    const at = new THREE.Vector2((2 * x) / width - 1, 1 - (2 * y) / height);
    if (this.robot) {
      const ray = new THREE.Raycaster();
      ray.setFromCamera(at, this.camera);
      const hit = ray.intersectObjects(this.bodies, true).find(({ object }) => object.visible);
      return hit ? hit.object.parent.userData.link - 1 : null;
    }
    if (!this.markers) return null;
    let best = null, nearest = 14;
    this.dots.forEach(([dot], n) => {
      if (!dot.visible) return;
      const p = dot.position.clone().project(this.camera);
      const off = Math.hypot((p.x - at.x) * width / 2, (p.y - at.y) * height / 2);
      if (off < nearest) { nearest = off; best = n; }
    });
    return best;
  }
}
