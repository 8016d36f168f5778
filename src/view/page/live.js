// ---- live: what comes while somebody looks on ----

// So much is kept, and so much of it is seen in a plot, s.
const KEPT_S = 120, SEEN_S = 10;

// A clock whose samples come one after the other.
function growing() {
  const times = [];
  return {
    times,
    get count() { return times.length; },
    get rate() { return times.length > 1 ? (times.length - 1) / Math.max(1e-9, times[times.length - 1] - times[0]) : 0; },
    time: i => times[Math.max(0, Math.min(times.length - 1, i))] ?? 0,
    at: t => {
      let low = 0, high = Math.max(0, times.length - 1);
      while (low < high) {
        const middle = (low + high + 1) >> 1;
        if (times[middle] <= t + 1e-6) low = middle; else high = middle - 1;
      }
      return low;
    },
  };
}

// Where the processor draws, it may be the one that moves the robot: so long passes there between two pictures of what comes, ms.
const SPARING_MS = 100;

// When a picture of what comes is drawn.
class Pace {
  constructor(spares) { this.spares = spares; this.last = -Infinity; }

  isDue(stamp) {
    if (this.spares && stamp - this.last < SPARING_MS) return false;
    this.last = stamp;
    return true;
  }
}

// The time that goes on, whatever is told: false if it did not. A clock that begins anew is another run.
class LiveClock {
  constructor() { this.clock = growing(); this.runs = 0; }

  take(time) {
    const { times } = this.clock, last = times[times.length - 1];
    if (time === last) return false;
    if (time < last) { times.length = 0; this.runs += 1; }
    times.push(time);
    if (times[0] < time - 1.25 * KEPT_S) times.splice(0, times.findIndex(t => t >= time - KEPT_S));
    return true;
  }
}

// Takes a frame into series that grow; false if it says nothing new. A clock that begins anew is another run.
function taken(joints, frame) {
  const { times } = joints.clock, last = times[times.length - 1];
  if (frame.time_s === last) return false;
  // What is kept together: times, and all that was read at them.
  const kept = [[times, joints.list.flatMap(joint => [joint.goal, joint.present].filter(Boolean))]];
  for (const joint of joints.list) for (const { clock, values } of joint.others) kept.push([clock.times, [values]]);
  const forget = first => kept.forEach(([when, series]) => {
    const at = when.findIndex(t => t >= first), count = at < 0 ? when.length : at;
    [when, ...series].forEach(values => values.splice(0, count));
  });
  if (frame.time_s < last) forget(Infinity);
  times.push(frame.time_s);
  joints.list.forEach((joint, n) => {
    if (joint.goal) joint.goal.push(frame.goal_rad[n] ?? NaN);
    joint.present.push(frame.present_rad[n] ?? NaN);
    // What is read in turn has a time of its own where it was read, and is no gap in between.
    for (const { name, unit, values: read } of frame.others || []) {
      if (read[n] === null) continue;
      let known = joint.others.find(other => other.name === name);
      if (!known) joint.others.push(known = { name, unit, clock: growing(), values: [] });
      known.clock.times.push(frame.time_s);
      known.values.push(read[n]);
    }
  });
  if (times[0] < frame.time_s - 1.25 * KEPT_S) forget(frame.time_s - KEPT_S);
  return true;
}

// Whoever wears the sensors, as they come; one who is `aside` stands beside the other.
class LivePerson extends Person {
  constructor(data, aside) {
    super(data);
    this.clock = growing();
    this.points = data.points.map(() => [[], [], []]);
    this.centres = null;
    this.sensors.forEach(sensor => { sensor.turn = [[], [], [], []]; });
    this.aside = aside;
  }

  centre() { return null; }

  // Takes where everything is at a time; false if that is nothing new.
  take(time, now) {
    const { times } = this.clock, places = now?.places_m;
    if (!places || places.length !== this.points.length || time === times[times.length - 1]) return false;
    const all = [times, ...this.points.flat(), ...this.sensors.flatMap(sensor => sensor.turn)];
    if (time < times[times.length - 1]) for (const values of all) values.length = 0;
    times.push(time);
    this.points.forEach((point, n) => point.forEach((axis, k) => axis.push(places[n][k] - (k === 1 ? this.aside : 0))));
    this.sensors.forEach(({ turn }, n) => turn.forEach((part, k) => part.push(now.sensors?.[n]?.[k] ?? NaN)));
    if (times[0] < time - 1.25 * KEPT_S) {
      const old = times.findIndex(t => t >= time - KEPT_S);
      for (const values of all) values.splice(0, old);
    }
    return true;
  }
}

// How sensors are heard, and what else there is to know.
class Hearing {
  constructor() { byId("sensing").hidden = false; this.told = []; }

  show(sensors, facts) {
    const body = byId("sensors").tBodies[0];
    byId("sensors").hidden = !sensors.length;
    while (body.rows.length > sensors.length) body.deleteRow(-1);
    sensors.forEach((sensor, n) => {
      const row = body.rows[n] || body.insertRow();
      const lost = sensor.samples ? (100 * sensor.missed) / (sensor.samples + sensor.missed) : 0;
      const usual = sensor.usual_rate_hz ? ` of ${sensor.usual_rate_hz.toFixed(0)}` : "";
      const cells = [sensor.name, `${sensor.rate_hz.toFixed(0)}${usual}`,
        `${sensor.missed}${sensor.missed ? ` (${lost.toFixed(lost < 1 ? 1 : 0)} %)` : ""}`, sensor.silent || "speaks"];
      cells.forEach((text, k) => {
        const cell = row.cells[k] || row.appendChild(document.createElement(k ? "td" : "th"));
        if (!k) cell.scope = "row";
        if (cell.textContent !== text) cell.textContent = text;
      });
      row.className = sensor.silent ? "silent" : "";
    });
    const silent = sensors.filter(sensor => sensor.silent);
    // For how long is in the table; who hears the page is told once.
    put("silent", silent.length ? `Not heard: ${silent.map(sensor => sensor.name).join(", ")}` : "");
    put("known", (facts || []).map(([name, words]) => `${name}: ${words}`).join(" \u00b7 "));
    this.told = sensors;
  }

  // Nobody tells any more: that they spoke is no news of now.
  end() { this.show(this.told.map(sensor => ({ ...sensor, rate_hz: 0, silent: sensor.silent || "the program has ended" }))); }
}

// What has not changed is not said again to who hears the page.
function put(id, text) {
  const place = byId(id);
  if (place.textContent !== text) place.textContent = text;
  place.hidden = !text;
}
