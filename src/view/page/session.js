// ---- a session: what the operator is to do now, and how it goes ----

// Whoever wears the sensors, as they come.
class LivePerson extends Person {
  constructor(data) {
    super(data);
    this.clock = growing();
    this.points = data.points.map(() => [[], [], []]);
    this.centres = null;
  }

  centre() { return null; }

  // Takes where everything is at a time; false if that is nothing new.
  take(time, places) {
    const { times } = this.clock;
    if (places.length !== this.points.length || time <= times[times.length - 1]) return false;
    times.push(time);
    this.points.forEach((point, n) => point.forEach((axis, k) => axis.push(places[n][k])));
    if (times[0] < time - 1.25 * KEPT_S) {
      const old = times.findIndex(t => t >= time - KEPT_S);
      for (const values of [times, ...this.points.flat()]) values.splice(0, old);
    }
    return true;
  }
}

class Session {
  constructor() {
    this.told = null;
    document.querySelector("main").classList.add("led");
    for (const id of ["session", "sensing"]) byId(id).hidden = false;
    byId("time").hidden = true;
    document.querySelector(".hint").hidden = true;
  }

  // What has not changed is not said again to who hears the page.
  put(id, text) {
    const place = byId(id);
    if (place.textContent !== text) place.textContent = text;
    place.hidden = !text;
  }

  show(told) {
    this.told = told;
    const { instruction, asked, remark, holds, recorded_s: recorded, trial, next, verdict, sensors } = told;
    this.put("do", instruction);
    this.put("asked", asked);
    this.put("remark", remark);
    const now = performance.now();
    this.until = holds ? now + 1000 * holds.left_s : null;
    this.lasts = holds ? 1000 * holds.lasts_s : null;
    this.since = recorded === null ? null : now - 1000 * recorded;
    const done = trial ? trial.good + trial.marked_good : 0;
    this.put("repetition", trial ? `${Math.min(done + 1, trial.wanted)} of ${trial.wanted}${done >= trial.wanted ? ", all done" : ""}` : "");
    byId("repetition").closest("div").hidden = !trial;
    const marked = trial && recorded !== null ? `; in this trial ${trial.marked_good} good, ${trial.marked_bad} bad` : "";
    this.put("place", trial ? `${trial.action}, ${trial.subjects}; action ${trial.number} of ${trial.total}; ${trial.good} kept${marked}` : "");
    this.put("verdict", verdict ? verdict.words : "nothing yet");
    byId("verdict").className = verdict ? (verdict.kept ? "kept" : "again") : "";
    const list = next.join("\n");
    if (this.list !== list) {
      this.list = list;
      byId("next").replaceChildren(...next.map(text => { const item = document.createElement("li"); item.textContent = text; return item; }));
    }
    this.sensors(sensors);
    this.run();
    const { dataset } = document.documentElement;
    dataset.instruction = instruction; dataset.asked = asked;
  }

  sensors(sensors) {
    const body = byId("sensors").tBodies[0];
    while (body.rows.length > sensors.length) body.deleteRow(-1);
    sensors.forEach((sensor, n) => {
      const row = body.rows[n] || body.insertRow();
      const lost = sensor.samples ? (100 * sensor.missed) / (sensor.samples + sensor.missed) : 0;
      const cells = [sensor.name, `${sensor.rate_hz.toFixed(0)} of ${sensor.usual_rate_hz.toFixed(0)}`,
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
    this.put("silent", silent.length ? `Not heard: ${silent.map(sensor => sensor.name).join(", ")}` : "");
  }

  // The clocks run between what is told.
  run() {
    const now = performance.now(), place = byId("count");
    place.hidden = this.until === null && this.since === null;
    if (place.hidden) return;
    const left = this.until === null ? null : Math.max(0, this.until - now);
    byId("left").textContent = left === null ? `recorded for ${((now - this.since) / 1000).toFixed(1)} s` : `${(left / 1000).toFixed(1)} s`;
    const bar = byId("gone");
    bar.hidden = left === null;
    if (left !== null) bar.value = this.lasts > 0 ? 1 - left / this.lasts : 1;
  }
}
