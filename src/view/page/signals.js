// ---- signals: curves over time ----

const DEGREES = 180 / Math.PI;
const LEFT = 58, RIGHT = 10, TOP = 8, BOTTOM = 20;

// What can be looked at: a channel for each joint, marker or force, with its plots.
function channelsOf(data, joints, person, markers, isLive, angles, forces) {
  const channels = [];
  if (joints) {
    joints.list.forEach((joint, n) => {
      const clock = joints.clock, plots = [], bounds = joint.range_rad && joint.range_rad.map(end => end * DEGREES);
      const curve = (name, values, of = clock) => ({ name, values, clock: of, scale: DEGREES });
      const angles = ["goal", "present"].filter(name => joint[name]).map(name => curve(name, joint[name]));
      plots.push({ quantity: "angle", unit: "\u00b0", curves: angles, bounds, least: 2 });
      if (joint.goal && joint.present) {
        const off = () => joint.goal.map((goal, i) => goal - joint.present[i]);
        plots.push({ quantity: "difference", unit: "\u00b0", curves: [curve("goal - present", off)], least: 0.5 });
      }
      const slopes = (which, reach) => angles.map(of => curve(of.name, () => derived(joint[of.name], clock, which, reach)));
      const limit = value => (value ? [-value * DEGREES, value * DEGREES] : null);
      plots.push({ quantity: "velocity", unit: "\u00b0/s", curves: slopes(1, 3), bounds: limit(joint.velocity_limit_rad_s), least: 5 });
      plots.push({ quantity: "acceleration", unit: "\u00b0/s\u00b2", curves: slopes(2, 6), bounds: limit(joint.acceleration_limit_rad_s2), least: 50 });
      for (const { name, unit, clock: own, values } of joint.others || []) {
        const when = clockOf(own);
        plots.push({ quantity: name, unit, curves: [{ name, values: decoded(values), clock: when, scale: 1 }], least: 0.1 });
      }
      const moves = isLive || angles.some(({ values }) => {
        let [low, high] = [Infinity, -Infinity];
        for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
        return high - low > 0.01;
      });
      channels.push({ name: joint.name, joint: n, moves, plots });
    });
  }
  if (angles) {
    angles.list.forEach(angle => {
      const curves = [{ name: "present", values: angle.present, clock: angles.clock, scale: DEGREES }];
      const slope = [{ name: "present", values: () => derived(angle.present, angles.clock, 1, 3), clock: angles.clock, scale: DEGREES }];
      const plots = [{ quantity: "angle", unit: "\u00b0", curves, least: 2 }, { quantity: "velocity", unit: "\u00b0/s", curves: slope, least: 5 }];
      channels.push({ name: angle.name, joint: null, group: "angle", moves: true, plots });
    });
  }
  if (forces) {
    for (const plate of forces.list) {
      const plots = ["force x", "force y", "force up"].map((quantity, k) => ({
        quantity, unit: "N", curves: [{ name: "present", values: plate.force[k], clock: forces.clock, scale: 1 }], least: 20,
      }));
      channels.push({ name: plate.name, joint: null, group: "plate", moves: true, plots: plots.reverse() });
    }
  }
  if (person && person.force) {
    const curves = [{ name: "present", values: person.force, clock: person.clock, scale: 1 }];
    channels.push({ name: "force of the floor", moves: true, plots: [{ quantity: "force", unit: "body weights", curves, least: 1.5, zero: true }] });
  }
  if (markers) {
    markers.points.forEach((point, n) => {
      const plots = ["x", "y", "z"].map((axis, k) => {
        const curves = [{ name: "present", values: point.at[k], clock: markers.clock, scale: 1e3 }];
        if (point.before) curves.unshift({ name: "before", values: point.before[k], clock: markers.clock, scale: 1e3 });
        return { quantity: axis, unit: "mm", curves, least: 5 };
      });
      channels.push({ name: point.name, joint: n, moves: point.labelled, plots, mended: !!point.before });
    });
  }
  return channels;
}

const valuesOf = curve => (typeof curve.values === "function" ? (curve.made ||= curve.values()) : curve.values);

// Least and greatest value of a curve over a time.
function extent(curve, [from, to]) {
  const values = valuesOf(curve), [first, last] = [curve.clock.at(from), curve.clock.at(to)];
  let low = Infinity, high = -Infinity;
  for (let i = first; i <= last; i++) {
    if (values[i] < low) low = values[i];
    if (values[i] > high) high = values[i];
  }
  return [low * curve.scale, high * curve.scale];
}

function niceStep(span, most) {
  const rough = span / most, power = 10 ** Math.floor(Math.log10(rough));
  return [1, 2, 5, 10].find(step => step * power >= rough) * power;
}

function sized(canvas) {
  const ratio = Math.min(2, window.devicePixelRatio || 1), [width, height] = [canvas.clientWidth, canvas.clientHeight];
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  return [pen, width, height];
}

class Plot {
  constructor(place, channel, plot, view) {
    Object.assign(this, { channel, plot, view });
    this.card = document.createElement("figure");
    this.caption = document.createElement("figcaption");
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.card.append(this.caption, this.canvas);
    place.append(this.card);
    this.sheet = document.createElement("canvas");
  }

  ink(name) { return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(); }

  x(t) { const [from, to] = this.view.window; return LEFT + (this.canvas.clientWidth - LEFT - RIGHT) * (t - from) / (to - from); }

  time(x) { const [from, to] = this.view.window; return from + (to - from) * (x - LEFT) / (this.canvas.clientWidth - LEFT - RIGHT); }

  // All but the play head, kept until the window or the size changes.
  draw() {
    const [pen, width, height] = sized(this.canvas), { plot, view } = this;
    const parts = plot.curves.map(curve => extent(curve, view.window));
    let low = Math.min(...parts.map(part => part[0])), high = Math.max(...parts.map(part => part[1]));
    if (!(low <= high)) [low, high] = [0, 0];
    if (plot.zero) low = Math.min(low, 0);
    const spare = Math.max(plot.least - (high - low), 0.1 * (high - low)) / 2;
    this.low = low - spare; this.high = high + spare;
    const bottom = height - BOTTOM, y = v => bottom - (bottom - TOP) * (v - this.low) / (this.high - this.low);
    this.y = y;
    pen.font = "11px system-ui, sans-serif"; pen.textBaseline = "middle"; pen.lineWidth = 1;
    pen.strokeStyle = this.ink("grid"); pen.fillStyle = this.ink("faint"); pen.textAlign = "right";
    const step = niceStep(this.high - this.low, 4);
    for (let v = Math.ceil(this.low / step) * step; v <= this.high; v += step) {
      pen.beginPath(); pen.moveTo(LEFT, y(v)); pen.lineTo(width - RIGHT, y(v)); pen.stroke();
      pen.fillText(String(Number(v.toPrecision(6))), LEFT - 6, y(v));
    }
    pen.textAlign = "center";
    const [from, to] = view.window, tick = niceStep(to - from, Math.max(2, width / 90));
    for (let t = Math.ceil(from / tick) * tick; t <= to + 1e-9; t += tick) pen.fillText(`${Number(t.toPrecision(6))} s`, Math.min(width - RIGHT - 10, this.x(t)), height - 9);
    pen.save();
    pen.beginPath(); pen.rect(LEFT, TOP, width - LEFT - RIGHT, bottom - TOP); pen.clip();
    for (const bound of plot.bounds || []) {
      pen.setLineDash([5, 4]); pen.strokeStyle = this.ink("wrong");
      pen.beginPath(); pen.moveTo(LEFT, y(bound)); pen.lineTo(width, y(bound)); pen.stroke();
    }
    pen.setLineDash([]);
    plot.curves.forEach(curve => this.curve(pen, curve, width));
    pen.restore();
    const sheet = this.sheet, ratio = this.canvas.width / Math.max(1, width);
    sheet.width = this.canvas.width; sheet.height = this.canvas.height;
    sheet.getContext("2d").drawImage(this.canvas, 0, 0);
    this.ratio = ratio;
    this.describe();
  }

  // Every pixel column from the least to the greatest value that falls into it: no peak is lost.
  curve(pen, curve, width) {
    const values = valuesOf(curve), { clock, scale } = curve, [from, to] = this.view.window;
    const first = Math.max(0, clock.at(from) - 1), last = Math.min(values.length - 1, clock.at(to) + 1);
    pen.strokeStyle = this.ink(curve.name === "goal" ? "goal" : curve.name === "before" ? "wrong" : "present");
    pen.lineWidth = 1.5; pen.lineJoin = "round";
    pen.beginPath();
    let open = false;
    const dense = last - first > 3 * width;
    let column = null, low = 0, high = 0, lastValue = 0;
    const flush = () => {
      if (column === null) return;
      if (!open) pen.moveTo(column, this.y(low)); else pen.lineTo(column, this.y(low));
      pen.lineTo(column, this.y(high)); pen.lineTo(column, this.y(lastValue));
      open = true; column = null;
    };
    for (let i = first; i <= last; i++) {
      const value = values[i] * scale;
      if (Number.isNaN(value)) { flush(); open = false; continue; }
      const x = this.x(clock.time(i));
      if (dense) {
        const at = Math.round(x);
        if (at !== column) { flush(); column = at; low = high = value; }
        low = Math.min(low, value); high = Math.max(high, value); lastValue = value;
      } else if (open) { pen.lineTo(x, this.y(value)); } else { pen.moveTo(x, this.y(value)); open = true; }
    }
    flush();
    pen.stroke();
  }

  head(t) {
    const pen = this.canvas.getContext("2d"), { width, height } = this.canvas;
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.drawImage(this.sheet, 0, 0);
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    const x = this.x(t);
    if (x < LEFT) return;
    pen.strokeStyle = this.ink("ink"); pen.lineWidth = 1;
    pen.beginPath(); pen.moveTo(x, TOP); pen.lineTo(x, height / this.ratio - BOTTOM); pen.stroke();
    for (const curve of this.plot.curves) {
      const value = valuesOf(curve)[curve.clock.at(t)] * curve.scale;
      if (Number.isNaN(value)) continue;
      pen.fillStyle = this.ink(curve.name === "goal" ? "goal" : curve.name === "before" ? "wrong" : "present");
      pen.beginPath(); pen.arc(x, this.y(value), 3, 0, 7); pen.fill();
    }
    this.caption.replaceChildren(this.words(t));
  }

  words(t) {
    const { channel, plot } = this, out = document.createDocumentFragment(), name = document.createElement("b");
    name.textContent = `${channel.name} \u00b7 ${plot.quantity}`;
    out.append(name);
    for (const curve of plot.curves) {
      const value = valuesOf(curve)[curve.clock.at(t)] * curve.scale, word = document.createElement("span");
      word.className = curve.name === "goal" ? "goal" : curve.name === "before" ? "before" : "present";
      const label = plot.curves.length > 1 ? `${curve.name} ` : "";
      word.textContent = Number.isNaN(value) ? `${label}no reading` : `${label}${value.toFixed(Math.abs(value) < 10 ? 2 : 1)} ${plot.unit}`;
      out.append(" ", word);
    }
    return out;
  }

  describe() {
    const { channel, plot } = this;
    const parts = plot.curves.map(curve => { const [low, high] = extent(curve, this.view.window); return `${curve.name} from ${low.toFixed(1)} to ${high.toFixed(1)} ${plot.unit}`; });
    this.canvas.setAttribute("aria-label", `${channel.name}, ${plot.quantity} over time: ${parts.join(", ")}`);
  }
}

// The line of time: what took how long, and what of the feet stood.
const KINDS = { part: "part", event: "event", phase: "phase", mended: "mended", doubt: "doubt", wrong: "wrong" };

class Line {
  constructor(canvas, rows, view) {
    Object.assign(this, { canvas, rows, view });
    this.fit();
  }

  // A scale of seconds stands below the rows.
  fit() { this.canvas.style.height = `${this.rows.length * 17 + 22}px`; }

  left() { return this.canvas.clientWidth < 560 ? 92 : 150; }

  x(t) { return this.left() + (this.canvas.clientWidth - this.left() - RIGHT) * t / this.view.duration; }

  time(x) { return this.view.duration * (x - this.left()) / (this.canvas.clientWidth - this.left() - RIGHT); }

  draw() {
    const [pen, width] = sized(this.canvas), style = getComputedStyle(document.documentElement);
    const ink = name => style.getPropertyValue(`--${name}`).trim();
    pen.font = "11px system-ui, sans-serif"; pen.textBaseline = "middle";
    this.rows.forEach((row, n) => {
      const y = 4 + n * 17;
      pen.fillStyle = ink("faint"); pen.textAlign = "right";
      pen.fillText(row.name, this.left() - 8, y + 8, this.left() - 12);
      pen.fillStyle = ink("grid"); pen.fillRect(this.left(), y + 15, width - this.left() - RIGHT, 1);
      pen.textAlign = "left";
      for (const span of row.spans) {
        const a = this.x(span.start_s), b = Math.max(a + 2, this.x(Math.min(span.end_s, this.view.duration)));
        pen.fillStyle = ink(KINDS[span.kind]); pen.fillRect(a, y + 1, Math.max(2, b - a - 1), 13);
        if (span.kind !== "wrong" && b - a > 34) {
          pen.save(); pen.beginPath(); pen.rect(a, y, b - a, 16); pen.clip();
          pen.fillStyle = ink(`${KINDS[span.kind]}-ink`) || ink("ink"); pen.fillText(span.label, a + 4, y + 8); pen.restore();
        }
      }
      for (const [from, to] of row.times || []) { pen.fillStyle = ink("good"); pen.fillRect(this.x(from), y + 3, Math.max(1, this.x(to) - this.x(from)), 9); }
    });
    const below = this.rows.length * 17 + 13, tick = niceStep(this.view.duration, Math.max(2, (width - this.left()) / 90));
    pen.fillStyle = ink("faint"); pen.textAlign = "center";
    for (let t = 0; t <= this.view.duration + 1e-9; t += tick) {
      pen.fillRect(this.x(t), below - 9, 1, 3);
      pen.fillText(`${Number(t.toPrecision(6))} s`, Math.min(width - RIGHT - 10, this.x(t)), below);
    }
    this.sheet = this.sheet || document.createElement("canvas");
    this.sheet.width = this.canvas.width; this.sheet.height = this.canvas.height;
    this.sheet.getContext("2d").drawImage(this.canvas, 0, 0);
    this.ratio = this.canvas.width / Math.max(1, width);
  }

  head(t) {
    const pen = this.canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, this.canvas.width, this.canvas.height);
    if (this.sheet) pen.drawImage(this.sheet, 0, 0);
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.fillStyle = getComputedStyle(document.documentElement).getPropertyValue("--ink").trim();
    pen.fillRect(this.x(t) - 0.75, 0, 1.5, this.canvas.clientHeight);
  }
}

// When a flag is set: from, to, one after the other.
function runs(values, clock, isSet) {
  const out = [];
  for (let i = 0; i < values.length; i++) {
    if (!isSet(values[i])) continue;
    const from = i;
    while (i + 1 < values.length && isSet(values[i + 1])) i += 1;
    out.push([clock.time(from), clock.time(Math.min(values.length - 1, i + 1))]);
  }
  return out;
}
