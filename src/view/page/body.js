// ---- bodies: where links are, what soles span ----

const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const plus = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

// A vector turned by a quaternion w, x, y, z.
function turned(q, v) {
  const u = [q[1], q[2], q[3]], c = cross(u, v).map(x => 2 * x), d = cross(u, c);
  return [v[0] + q[0] * c[0] + d[0], v[1] + q[0] * c[1] + d[1], v[2] + q[0] * c[2] + d[2]];
}

const times = (a, b) => [
  a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
  a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
  a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
  a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
];

// Of the box around points.
function corners(axes) {
  const ends = axes.map(values => values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]));
  return Array.from({ length: 8 }, (_, n) => ends.map((end, axis) => end[(n >> axis) & 1]));
}

class Robot {
  // One that is `free` may be turned in any way; if it has soles, it stands where the lowest is on the floor, for lack of a better word.
  constructor(data, joints, free) {
    Object.assign(this, { free, grounded: free && data.soles.length > 0, name: data.name, links: data.links, couplings: data.couplings, soles: data.soles });
    this.clock = clockOf(data.clock);
    this.at = data.at.map(decoded);
    this.turn = data.turn.map(decoded);
    this.contacts = decoded(data.contacts);
    this.joints = joints;
    for (const link of this.links) if (link.mesh) link.corners = corners(link.mesh.points.map(decoded));
    this.mass = this.links.reduce((sum, link) => sum + link.mass_kg, 0);
  }

  base(t) {
    const where = between(this.clock, t), q = this.turn.map(part => mixed(part, where));
    const length = Math.hypot(...q) || 1;
    return { at: this.at.map(part => mixed(part, where)), turn: q.map(part => part / length) };
  }

  // Places of all links at a time; `which` is "goal" or "present".
  places(t, which) {
    const where = between(this.joints.clock, t);
    return this.placed(this.joints.list.map(joint => {
      const values = joint[which] || joint.goal || joint.present;
      const angle = values ? mixed(values, where) : 0;
      return (Number.isNaN(angle) && joint.goal ? mixed(joint.goal, where) : angle) || 0;
    }), t);
  }

  // The same with these angles, of which joint n carries link n + 1.
  placed(turns, t) {
    const angles = new Array(this.links.length).fill(0);
    turns.forEach((angle, n) => { angles[n + 1] = angle; });
    for (const { link, of, offset_rad: offset } of this.couplings) {
      angles[link] = of.reduce((sum, [other, ratio]) => sum + ratio * angles[other], offset);
    }
    const base = this.base(t), places = [];
    this.links.forEach((link, n) => {
      const on = link.parent === null ? base : places[link.parent];
      const at = plus(on.at, turned(on.turn, link.origin_m)), half = angles[n] / 2, s = Math.sin(half);
      const own = [Math.cos(half), link.axis[0] * s, link.axis[1] * s, link.axis[2] * s];
      places.push({ at, turn: times(on.turn, own) });
    });
    if (this.grounded) {
      const corners = this.soles.flatMap(([link, sole]) => sole.map(corner => plus(places[link].at, turned(places[link].turn, corner))[2]));
      const low = Math.min(...corners);
      for (const place of places) place.at = [place.at[0], place.at[1], place.at[2] - low];
    }
    return places;
  }

  centre(places) {
    let sum = [0, 0, 0];
    this.links.forEach((link, n) => {
      const at = plus(places[n].at, turned(places[n].turn, link.centre_m));
      sum = sum.map((part, axis) => part + link.mass_kg * at[axis]);
    });
    return this.mass > 0 ? sum.map(part => part / this.mass) : null;
  }

  // Corners of soles less than 5 mm above the floor.
  support(places) {
    const down = this.soles.flatMap(([link, corners]) => corners
      .map(corner => plus(places[link].at, turned(places[link].turn, corner)))
      .filter(corner => corner[2] < 0.005));
    return hull(down);
  }

  // How far it reaches when it is stretched out.
  reach() {
    const far = [];
    this.links.forEach((link, n) => { far[n] = link.parent === null ? 0 : far[link.parent] + Math.hypot(...link.origin_m); });
    return Math.max(...far);
  }

  // From the lowest to the highest of its shapes; of joints without any how far they reach in any direction.
  height(places) {
    const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
    const reach = (at, around) => at.forEach((part, axis) => {
      low[axis] = Math.min(low[axis], part - around); high[axis] = Math.max(high[axis], part + around);
    });
    const bare = !this.links.some(link => link.shapes.length);
    this.links.forEach((link, n) => {
      if (bare) reach(places[n].at, 0.01);
      for (const corner of link.corners || []) reach(plus(places[n].at, turned(places[n].turn, corner)), 0);
      for (const shape of link.shapes) {
        const ends = shape.from_m ? [shape.from_m, shape.to_m] : [shape.centre_m];
        const around = shape.from_m ? shape.radius_m : Math.min(...shape.half_m);
        for (const end of ends) reach(plus(places[n].at, turned(places[n].turn, end)), around);
      }
    });
    return bare ? Math.max(...high.map((part, axis) => part - low[axis])) : high[2] - low[2];
  }
}

// The convex hull on the floor (A. M. Andrew, Information Processing Letters 9, 1979).
function hull(points) {
  const sorted = points.map(p => [p[0], p[1]]).sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  if (sorted.length < 3) return sorted;
  const turnsLeft = (o, a, b) => (a[0] - o[0]) * (b[1] - o[1]) - (a[1] - o[1]) * (b[0] - o[0]) > 0;
  const half = list => {
    const out = [];
    for (const p of list) {
      while (out.length > 1 && !turnsLeft(out[out.length - 2], out[out.length - 1], p)) out.pop();
      out.push(p);
    }
    out.pop();
    return out;
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

class Person {
  constructor(data) {
    Object.assign(this, { lines: data.lines, head: data.head, soles: data.soles, stature: data.stature_m });
    this.clock = clockOf(data.clock);
    this.points = data.points.map(point => point.map(decoded));
    this.centres = data.centre.map(decoded);
    this.contacts = data.contacts && decoded(data.contacts);
    this.force = data.force && decoded(data.force);
    this.sensors = (data.sensors || []).map(({ name, between, turn }) => ({ name, between, turn: turn.map(decoded) }));
    if (data.support) {
      const counts = decoded(data.support.counts);
      this.corners = [decoded(data.support.x), decoded(data.support.y)];
      this.begins = new Int32Array(counts.length + 1);
      counts.forEach((count, i) => { this.begins[i + 1] = this.begins[i] + count; });
    }
  }

  places(t) {
    const where = between(this.clock, t);
    return this.points.map(point => point.map(axis => mixed(axis, where)));
  }

  centre(t) {
    const where = between(this.clock, t);
    return this.centres.map(axis => mixed(axis, where));
  }

  // Where a sensor is drawn, and how it is turned; null while it says nothing.
  worn({ between: ends, turn }, places, t) {
    const i = this.clock.at(t), q = turn.map(part => part[i]), length = Math.hypot(...q);
    if (!(length > 0.5)) return null;
    const [a, b] = ends.map(n => places[n]);
    return { at: a.map((part, axis) => (part + b[axis]) / 2), turn: q.map(part => part / length) };
  }

  // A tipped foot may touch with an edge alone, which is not told as a contact.
  support(t) {
    const i = this.clock.at(t), out = [];
    if (!this.corners || !this.contacts[i]) return out;
    for (let n = this.begins[i]; n < this.begins[i + 1]; n++) out.push([this.corners[0][n], this.corners[1][n]]);
    return out;
  }
}

// Less is noise of most plates, N: gait laboratories usually begin there.
const LEAST_FORCE_N = 20;
// So long an arrow is drawn for a force, m/N: a person's weight is about as long as a leg.
const ARROW_M_N = 1 / 800;

class Plates {
  constructor(data) {
    this.clock = clockOf(data.clock);
    this.list = data.plates.map(({ name, corners_m, force, at }) => ({ name, corners: corners_m, force: force.map(decoded), at: at.map(decoded) }));
  }

  // From where to where the arrow of a plate goes; null while nobody presses.
  arrow(plate, t) {
    const i = this.clock.at(t), from = plate.at.map(axis => axis[i]), force = plate.force.map(axis => axis[i]);
    // A floor does not pull: what goes down is an amplifier at its end.
    if (!(force[2] >= LEAST_FORCE_N)) return null;
    return from.some(Number.isNaN) ? null : [from, plus(from, force.map(part => part * ARROW_M_N))];
  }
}

class Markers {
  constructor(data) {
    this.clock = clockOf(data.clock);
    this.points = data.points.map(({ name, labelled, at, before }) => ({
      name, labelled, at: at.map(decoded), before: before && before.map(decoded),
    }));
  }

  // Not between samples: a gap is a gap.
  place(series, t) {
    const i = this.clock.at(t);
    return series.map(axis => axis[i]);
  }
}
