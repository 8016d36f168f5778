// ---- poses: key frames of a robot, made here and downloaded ----

// Rows of a table that are further apart than half a second are key frames for `play` (src/actionlet/key_frames.rs, whose
// twin this is), and so many angles are made of them at most.
const LEAST_S = 0.6, USUAL_S = 1, MOST_ANGLES = 5e5, EVEN_HZ = 100;
// So far from the ends of its range a joint is kept, rad: a spline through an end may pass it by a hair.
const HAIR = 1e-4;
// Of a joint's limits of velocity and acceleration so much is used: splines swing a little.
const SHARE = 0.95;

// How much of the way from one key frame to the next is behind a part of the time: a half sine of velocity, at rest at both ends.
const progressed = part => part - Math.sin(2 * Math.PI * part) / (2 * Math.PI);

class KeyFrames {
  // Joints have a name, a range and limits; `start` is the pose of the first key frame, rad.
  constructor(list, start) {
    this.list = list;
    this.frames = [{ after: 0, angles: start.map((angle, n) => this.kept(n, angle)) }];
    this.at = 0;
    this.past = [];
  }

  kept(n, angle) {
    const [low, high] = this.list[n].range_rad, hair = Math.min(HAIR, (high - low) / 2);
    return Math.max(low + hair, Math.min(high - hair, angle));
  }

  get frame() { return this.frames[this.at]; }

  // What a joint needs from one key frame to the next, s: velocity and acceleration of a half sine have their peaks at 2 and 2 pi times the mean.
  needed(index) {
    let [least, name] = [LEAST_S, null];
    if (!index) return [0, null];
    const [from, to] = [this.frames[index - 1].angles, this.frames[index].angles];
    this.list.forEach(({ name: joint, velocity_limit_rad_s: v, acceleration_limit_rad_s2: a }, n) => {
      const way = Math.abs(to[n] - from[n]) / SHARE;
      const time = Math.max(v > 0 ? (2 * way) / v : 0, a > 0 ? Math.sqrt((2 * Math.PI * way) / a) : 0);
      // Rounded up to a tenth, as it is shown.
      if (Math.ceil(time * 10 - 1e-9) / 10 > least) [least, name] = [Math.ceil(time * 10 - 1e-9) / 10, joint];
    });
    return [least, name];
  }

  times() {
    let time = 0;
    return this.frames.map((frame, n) => { time += n ? Math.max(frame.after, this.needed(n)[0]) : 0; return Math.round(time * 1000) / 1000; });
  }

  get duration() { return this.times().at(-1); }

  // All joints at even times, as `play` makes them.
  motion() {
    const times = this.times(), end = times.at(-1), count = Math.ceil(end * EVEN_HZ);
    const step = count ? end / count : 1, all = this.list.map(() => new Float64Array(count + 1));
    let before = 0;
    for (let i = 0; i <= count; i++) {
      const t = i * step;
      while (before + 2 < times.length && times[before + 1] <= t) before += 1;
      const [from, to] = [this.frames[before], this.frames[Math.min(before + 1, times.length - 1)]];
      const gap = times[Math.min(before + 1, times.length - 1)] - times[before];
      const share = gap > 0 ? progressed(Math.max(0, Math.min(1, (t - times[before]) / gap))) : 0;
      all.forEach((values, n) => { values[i] = from.angles[n] + (to.angles[n] - from.angles[n]) * share; });
    }
    return { count: count + 1, rate: 1 / step, all };
  }

  // Why it is no motion yet; empty: it is one.
  refused() {
    if (this.frames.length < 2) return "Two key frames make a motion.";
    const most = MOST_ANGLES / this.list.length / EVEN_HZ;
    return this.duration > most ? `Longer than ${Math.floor(most)} s: make two tables of it.` : "";
  }

  table() {
    const times = this.times();
    const rows = this.frames.map((frame, n) => [times[n].toFixed(3), ...frame.angles.map(angle => angle.toFixed(6))]);
    return [["time_s", ...this.list.map(joint => `${joint.name}_rad`)], ...rows].map(row => `${row.join(",")}\n`).join("");
  }

  // Keeps what was, to go back to it.
  keep() {
    this.past.push(JSON.stringify([this.frames, this.at]));
    if (this.past.length > 200) this.past.shift();
  }

  undo() {
    const last = this.past.pop();
    if (last) [this.frames, this.at] = JSON.parse(last);
  }

  turn(n, angle) { this.frame.angles[n] = this.kept(n, angle); }

  add(angles = this.frame.angles) {
    this.frames.splice(this.at + 1, 0, { after: USUAL_S, angles: angles.map((angle, n) => this.kept(n, angle)) });
    this.at += 1;
    return this;
  }

  remove() {
    if (this.frames.length < 2) return;
    this.frames.splice(this.at, 1);
    this.at = Math.max(0, this.at - 1);
    this.frames[0].after = 0;
  }

  // The pose changes places with its neighbour; times stay where they are.
  move(by) {
    const other = this.frames[this.at + by];
    if (!other) return;
    [other.angles, this.frame.angles] = [this.frame.angles, other.angles];
    this.at += by;
  }
}

// What is on the page for them.
class Editor {
  constructor(robot, list, changed) {
    const all = list.map(joint => ({ ...joint, range_rad: joint.range_rad && joint.range_rad.every(Number.isFinite) ? joint.range_rad : [-Math.PI, Math.PI] }));
    this.keys = new KeyFrames(all, all.map(joint => joint.initial_rad ?? 0));
    Object.assign(this, { robot, list: all, changed, chosen: 0, rows: [], name: robot ? robot.name : "robot" });
    // Samples of the motion, as the robot and the curves read them.
    this.clock = { count: 1, rate: EVEN_HZ, time: i => i / this.clock.rate, at: t => Math.max(0, Math.min(this.clock.count - 1, Math.floor(t * this.clock.rate + 1e-6))) };
    this.joints = { clock: this.clock, list: all.map(joint => ({ ...joint, goal: new Float64Array(1), present: null })) };
    this.build();
    this.fill();
  }

  build() {
    const place = byId("turns");
    this.list.forEach((joint, n) => {
      const row = document.createElement("div"), name = document.createElement("label"), slider = document.createElement("input"), number = document.createElement("input");
      const [low, high] = joint.range_rad.map(end => end * DEGREES);
      Object.assign(slider, { type: "range", id: `turn-${n}`, min: low, max: high, step: "any" });
      // Whole steps of a tenth inside the range; the ends themselves are reached by the slider.
      Object.assign(number, { type: "number", min: Math.ceil(low * 10) / 10, max: Math.floor(high * 10) / 10, step: 0.1 });
      number.setAttribute("aria-label", `${joint.name}, degrees, ${low.toFixed(1)} to ${high.toFixed(1)}`);
      name.htmlFor = slider.id; name.textContent = joint.name;
      const ends = document.createElement("span");
      ends.className = "ends"; ends.textContent = `${low.toFixed(0)}\u00b0 to ${high.toFixed(0)}\u00b0`;
      const turn = value => { if (Number.isFinite(value)) this.change(`turn ${n}`, keys => keys.turn(n, value / DEGREES), n); };
      slider.addEventListener("input", () => turn(Number(slider.value)));
      number.addEventListener("change", () => turn(number.valueAsNumber));
      // Arrow keys of a slider without steps would go a hundredth of the range.
      slider.addEventListener("keydown", event => {
        const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1, PageDown: -10, PageUp: 10 }[event.key];
        if (by) { turn(this.keys.frame.angles[n] * DEGREES + by * (event.shiftKey ? 0.1 : 1)); event.preventDefault(); }
        event.stopPropagation();
      });
      row.addEventListener("focusin", () => this.choose(n));
      row.append(name, slider, number, ends);
      place.append(row);
      this.rows.push({ row, slider, number });
    });
    const on = (id, what) => byId(id).addEventListener("click", () => this.change(id, what));
    on("pose-add", keys => keys.add());
    on("pose-delete", keys => keys.remove());
    on("pose-earlier", keys => keys.move(-1));
    on("pose-later", keys => keys.move(1));
    byId("pose-undo").addEventListener("click", () => { this.keys.undo(); this.last = null; this.fill(); this.changed(this); });
    byId("pose-after").addEventListener("change", event => {
      const after = event.target.valueAsNumber;
      if (Number.isFinite(after)) this.change("after", keys => { keys.frame.after = Math.max(LEAST_S, Math.min(3600, Math.round(after * 1000) / 1000)); });
      else this.show();
    });
    byId("pose-download").addEventListener("click", () => this.download());
    byId("poses").addEventListener("keydown", event => {
      // What is typed into a number is no key of the page.
      if (event.target.tagName === "INPUT") event.stopPropagation();
      if ((event.ctrlKey || event.metaKey) && event.key === "z" && event.target.type !== "number") { byId("pose-undo").click(); event.preventDefault(); }
    });
  }

  // Changes something that can be undone; what goes on, as a slider that is drawn, is one change.
  change(what, how, joint = this.chosen) {
    const now = performance.now();
    if (what !== this.last || now - this.when > 1000 || !what.startsWith("turn")) this.keys.keep();
    [this.last, this.when] = [what, now];
    how(this.keys);
    this.chosen = joint;
    this.fill();
    this.changed(this);
  }

  choose(n) {
    if (n === this.chosen) return;
    this.chosen = n;
    this.changed(this, true);
  }

  // A limb is drawn to a place of the picture: its joints turn as little as does it (damped least squares), or one alone.
  pull({ link, local }, target, alone, project) {
    if (!this.robot) return;
    const angles = this.keys.frame.angles.slice(), chain = [];
    for (let at = link; at !== null && at > 0; at = this.robot.links[at].parent) {
      if (at <= this.list.length) chain.push(at - 1);
      if (alone && chain.length) break;
    }
    const place = () => { const { at, turn } = this.robot.placed(angles, 0)[link]; return project(plus(at, turned(turn, local))); };
    for (let round = 0; round < 4; round++) {
      const here = place(), off = [target[0] - here[0], target[1] - here[1]];
      if (Math.hypot(...off) < 0.5) break;
      const slopes = chain.map(n => {
        const was = angles[n], step = 1e-3;
        angles[n] = was + step;
        const there = place();
        angles[n] = was;
        return [(there[0] - here[0]) / step, (there[1] - here[1]) / step];
      });
      const damped = 30 ** 2, sum = (a, b) => slopes.reduce((all, slope) => all + slope[a] * slope[b], 0);
      const [xx, xy, yy] = [sum(0, 0) + damped, sum(0, 1), sum(1, 1) + damped], below = xx * yy - xy * xy;
      const [fx, fy] = [(yy * off[0] - xy * off[1]) / below, (xx * off[1] - xy * off[0]) / below];
      chain.forEach((n, k) => {
        const by = Math.max(-0.15, Math.min(0.15, slopes[k][0] * fx + slopes[k][1] * fy));
        angles[n] = this.keys.kept(n, angles[n] + by);
      });
    }
    if (chain.length) this.change("turned by hand", keys => { keys.frame.angles = angles; }, chain[0]);
  }

  // The robot as it is now, as a key frame: the first that nobody has touched, or one more.
  take(present) {
    const known = this.keys.frame.angles.map((angle, n) => (Number.isFinite(present[n]) ? present[n] : angle));
    this.change("taken", keys => {
      if (keys.past.length > 1) keys.add(known);
      else keys.frame.angles = known.map((angle, n) => keys.kept(n, angle));
    });
  }

  // Samples of the motion anew, and all that shows it.
  fill() {
    const { count, rate, all } = this.keys.motion();
    Object.assign(this.clock, { count, rate });
    this.joints.list.forEach((joint, n) => { joint.goal = all[n]; });
    this.show();
  }

  show() {
    const { keys } = this, times = keys.times(), place = byId("frames");
    while (place.children.length > times.length) place.lastChild.remove();
    times.forEach((time, n) => {
      let button = place.children[n];
      if (!button) {
        button = document.createElement("button");
        button.type = "button"; button.className = "chip";
        button.addEventListener("click", () => { keys.at = n; this.last = null; this.show(); this.changed(this); });
        place.append(button);
      }
      button.textContent = `${n + 1}: ${Number(time.toFixed(3))} s`;
      button.setAttribute("aria-pressed", String(n === keys.at));
    });
    this.rows.forEach(({ row, slider, number }, n) => {
      const angle = keys.frame.angles[n] * DEGREES;
      slider.value = angle;
      slider.setAttribute("aria-valuetext", `${angle.toFixed(1)} degrees`);
      if (document.activeElement !== number || number.valueAsNumber !== angle) number.value = angle.toFixed(1);
      row.className = n === this.chosen ? "chosen" : "";
    });
    const after = byId("pose-after"), [least, joint] = keys.needed(keys.at);
    after.disabled = keys.at === 0;
    after.value = keys.at ? Math.max(keys.frame.after, least) : 0;
    byId("pose-delete").disabled = times.length < 2;
    byId("pose-earlier").disabled = keys.at === 0;
    byId("pose-later").disabled = keys.at === times.length - 1;
    byId("pose-undo").disabled = !keys.past.length;
    const refused = keys.refused();
    byId("pose-download").disabled = !!refused;
    const slow = joint && keys.frame.after < least ? `${joint} needs ${least.toFixed(1)} s from key frame ${keys.at} to ${keys.at + 1}.` : "";
    const text = [slow, refused].filter(Boolean).join(" ") || `${counted(times.length, "key frame")} in ${Number(times.at(-1).toFixed(3))} s.`;
    const said = byId("pose-said");
    if (said.textContent !== text) said.textContent = text;
  }

  download() {
    const link = document.createElement("a"), url = URL.createObjectURL(new Blob([this.keys.table()], { type: "text/csv" }));
    Object.assign(link, { href: url, download: `${this.name}-key-frames.csv` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(url), 10000);
  }
}
