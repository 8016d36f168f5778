"use strict";
(() => {
  // Margins of a plot, px; AXIS is the bottom one where the time axis is.
  const [LEFT, RIGHT, TOP, AXIS] = [46, 8, 7, 20];
  const root = document.getElementById("plots");
  const timeLabel = document.getElementById("time");

  // ---- series: whole numbers become seconds and degrees ----
  const scaled = (numbers, unit) => numbers.map((n) => (n === null ? null : n * unit));
  const joints = JSON.parse(document.getElementById("series").textContent).map((joint) => {
    const curve = (key) => ({
      key,
      t: scaled(joint[key].t, 1e-4),
      v: scaled(joint[key].v, 1e-3),
    });
    const limit = (n) => (n === null ? null : n * 1e-3);
    return {
      name: joint.name,
      goal: curve("goal"),
      present: curve("present"),
      velocity: curve("velocity"),
      lower: limit(joint.lower),
      upper: limit(joint.upper),
      fastest: limit(joint.fastest),
    };
  });
  const ends = joints
    .flatMap((joint) => [joint.goal, joint.present, joint.velocity])
    .filter((curve) => curve.t.length > 0)
    .flatMap((curve) => [curve.t[0], curve.t[curve.t.length - 1]]);
  const start = ends.length ? ends.reduce((a, b) => Math.min(a, b)) : 0;
  const whole = [start, ends.length ? ends.reduce((a, b) => Math.max(a, b), start + 1e-3) : 1];
  let view = whole;
  let cursor = null;
  let dragFrom = null;
  let paperWidth = null;

  // ---- small mathematics ----
  const number = (value, digits) =>
    value
      .toFixed(digits)
      .replace(/^-(?=[0.]*$)/, "")
      .replace("-", "\u2212");
  const degrees = (value) => (value === null ? "\u2013" : number(value, 1) + "\u00b0");
  const extent = (curve) =>
    curve.v.reduce(
      ([low, high], v) => (v === null ? [low, high] : [Math.min(low, v), Math.max(high, v)]),
      [Infinity, -Infinity],
    );
  // Index of the first sample at or after t.
  const after = (curve, t) => {
    let [low, high] = [0, curve.t.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (curve.t[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  };
  // The value at a time, on the line between its neighbours; none in a gap or past the ends.
  const valueAt = (curve, t) => {
    const next = after(curve, t);
    if (next === curve.t.length) return null;
    if (curve.t[next] === t) return curve.v[next];
    if (next === 0) return null;
    const [t0, t1, v0, v1] = [curve.t[next - 1], curve.t[next], curve.v[next - 1], curve.v[next]];
    return v0 === null || v1 === null ? null : v0 + ((v1 - v0) * (t - t0)) / (t1 - t0);
  };
  // Round steps, in degrees the ones people know.
  const ticks = (low, high, count, steps) => {
    const rough = (high - low) / count;
    const step = steps.find((s) => s >= rough) ?? 10 ** Math.ceil(Math.log10(rough));
    const marks = [];
    for (let i = Math.ceil(low / step); i * step <= high; i += 1) marks.push(i * step);
    return { marks, digits: Math.max(0, -Math.floor(Math.log10(step) + 1e-9)) };
  };
  const DECIMAL = [-3, -2, -1, 0, 1, 2, 3, 4].flatMap((e) => [1, 2, 5].map((n) => n * 10 ** e));
  const ANGLES = [...DECIMAL.filter((n) => n <= 10), 15, 30, 45, 90, 180, 360, 720, 1440, 3600];

  // ---- shapes ----
  const line = (kind, x1, y1, x2, y2) =>
    `<line class="${kind}" x1="${x1}" y1="${y1}" x2="${x2}" y2="${y2}"/>`;
  const rectangle = (kind, x, y, width, height) =>
    `<rect class="${kind}" x="${x}" y="${y}" width="${width}" height="${height}"/>`;
  const label = (anchor, x, y, text) =>
    `<text text-anchor="${anchor}" x="${x}" y="${y}">${text}</text>`;

  // ---- a plot ----
  const visible = (curve) => {
    const from = Math.max(0, after(curve, view[0]) - 1);
    const to = Math.min(curve.t.length, after(curve, view[1]) + 1);
    return { ...curve, t: curve.t.slice(from, to), v: curve.v.slice(from, to) };
  };
  const range = (plot, curves) => {
    let [low, high] = curves
      .map(extent)
      .reduce((a, b) => [Math.min(a[0], b[0]), Math.max(a[1], b[1])]);
    if (low > high) [low, high] = [0, 0];
    const span = Math.max(high - low, plot.leastSpan);
    const middle = (low + high) / 2;
    [low, high] = [middle - span * 0.58, middle + span * 0.58];
    // A limit close by comes into the picture; one far away would flatten the curve, and is only
    // named in the words above the plot.
    for (const limit of plot.limits) {
      if (limit > high && limit < high + span * 0.6) high = limit + span * 0.06;
      if (limit < low && limit > low - span * 0.6) low = limit - span * 0.06;
    }
    return [low, high];
  };
  const path = (curve, x, y) => {
    let [text, dots, pen] = ["", "", false];
    curve.v.forEach((v, i) => {
      if (v === null) {
        pen = false;
        return;
      }
      const place = x(curve.t[i]).toFixed(1) + " " + y(v).toFixed(1);
      const alone = !pen && (i + 1 >= curve.v.length || curve.v[i + 1] === null);
      if (alone) dots += `M${place}h.01`;
      else text += (pen ? "L" : "M") + place;
      pen = true;
    });
    return `<path class="${curve.key}" d="${text}${dots}"/>`;
  };
  const gaps = (curve, x, height) => {
    const shapes = [];
    for (let i = 0; i < curve.v.length; i += 1) {
      const first = i;
      while (i < curve.v.length && curve.v[i] === null) i += 1;
      if (i === first) continue;
      const from = x(curve.t[Math.max(0, first - 1)]);
      const to = x(curve.t[Math.min(i, curve.t.length - 1)]);
      shapes.push(rectangle("gap", from, TOP, Math.max(1, to - from), height));
    }
    return shapes.join("");
  };

  const draw = (plot) => {
    const width = paperWidth ?? Math.max(200, plot.svg.clientWidth || 600);
    const right = width - RIGHT;
    const bottom = plot.height - plot.axis;
    plot.svg.setAttribute("viewBox", `0 0 ${width} ${plot.height}`);
    const curves = plot.curves.map(visible);
    const [low, high] = range(plot, curves);
    const x = (t) => LEFT + ((t - view[0]) / (view[1] - view[0])) * (right - LEFT);
    const y = (v) => bottom - ((v - low) / (high - low)) * (bottom - TOP);
    Object.assign(plot, { width, bottom, x, y });

    const across = ticks(view[0], view[1], Math.max(3, width / 90), DECIMAL);
    const up = ticks(low, high, plot.height / 28, ANGLES);
    const behind = [
      ...across.marks.map((t) => line("grid", x(t), TOP, x(t), bottom)),
      ...up.marks.map((v) => line("grid", LEFT, y(v), right, y(v))),
      ...up.marks.map((v) => label("end", LEFT - 5, y(v) + 4, number(v, up.digits))),
      `<g transform="translate(10 ${(TOP + bottom) / 2}) rotate(-90)">`,
      label("middle", 0, 0, plot.unit) + "</g>",
    ];
    if (plot.axis === AXIS) {
      const marks = across.marks.filter((t) => x(t) < right - 26);
      const time = (t) => label("middle", x(t), bottom + 14, number(t, across.digits));
      behind.push(...marks.map(time), label("end", right, bottom + 14, "s"));
    }
    const inside = [
      ...curves.filter((curve) => curve.key === "present").map((c) => gaps(c, x, bottom - TOP)),
      ...curves.map((curve) => path(curve, x, y)),
      ...plot.limits.map((limit) => line("limit", LEFT, y(limit), right, y(limit))),
    ];
    const area = [LEFT, TOP, right - LEFT, bottom - TOP];
    plot.svg.innerHTML = `
      <clipPath id="${plot.clip}">${rectangle("", ...area)}</clipPath>
      ${behind.join("")}
      <g clip-path="url(#${plot.clip})">${inside.join("")}</g>
      ${rectangle("border", ...area)}
      <g class="over"></g>`;
    plot.over = plot.svg.querySelector(".over");
  };

  const drawOver = (plot) => {
    const shapes = [];
    if (dragFrom !== null && cursor !== null) {
      const [a, b] = [plot.x(dragFrom), plot.x(cursor)].sort((p, q) => p - q);
      shapes.push(rectangle("selection", a, TOP, b - a, plot.bottom - TOP));
    }
    if (cursor !== null) {
      const x = plot.x(cursor);
      shapes.push(line("cursor", x, TOP, x, plot.bottom));
      for (const curve of plot.curves) {
        const value = valueAt(curve, cursor);
        if (value === null) continue;
        shapes.push(`<circle class="${curve.key}" cx="${x}" cy="${plot.y(value)}" r="3.5"/>`);
      }
    }
    plot.over.innerHTML = shapes.join("");
  };

  // ---- the words beside a plot; only numbers and fixed words go in as HTML ----
  const restingText = (joint) => {
    const [low, high] = extent(joint.goal);
    const [slow, fast] = extent(joint.velocity);
    const peak = Math.max(-slow, fast);
    const words = [];
    if (low <= high) words.push(`goal ${degrees(low)} to ${degrees(high)}`);
    if (Number.isFinite(peak)) {
      const share = joint.fastest ? ` (${number((100 * peak) / joint.fastest, 0)} % of limit)` : "";
      words.push(`peak ${number(peak, 0)} \u00b0/s${share}`);
    }
    return words.join(" \u00b7 ");
  };
  const limitText = (joint) => {
    const words = [];
    if (joint.lower !== null && joint.upper !== null) {
      words.push(`${number(joint.lower, 0)}\u00b0 to ${number(joint.upper, 0)}\u00b0`);
    }
    if (joint.fastest !== null) words.push(`${number(joint.fastest, 0)} \u00b0/s`);
    return words.length ? `limits ${words.join(", ")}` : "";
  };
  const cursorText = (joint) => {
    const [goal, present, velocity] = ["goal", "present", "velocity"].map((key) =>
      valueAt(joint[key], cursor),
    );
    const words = [`<b class="goal">goal ${degrees(goal)}</b>`];
    if (joint.present.t.length) {
      words.push(
        present === null
          ? '<b class="present">no reading</b>'
          : `<b class="present">present ${degrees(present)}</b>`,
      );
      if (goal !== null && present !== null) words.push(`error ${degrees(goal - present)}`);
    }
    if (velocity !== null) words.push(`<b class="velocity">${number(velocity, 1)} \u00b0/s</b>`);
    return words.join(" \u00b7 ");
  };

  // ---- the page ----
  const addPlot = (card, joint, kind, last) => {
    const position = kind === "position";
    const curves = position ? [joint.present, joint.goal] : [joint.velocity];
    const bounds = position
      ? [joint.lower, joint.upper]
      : [joint.fastest, joint.fastest === null ? null : -joint.fastest];
    card.insertAdjacentHTML("beforeend", '<svg role="img"></svg>');
    const svg = card.lastElementChild;
    const axis = last ? AXIS : TOP;
    const plot = {
      svg,
      clip: `clip${plots.length}`,
      curves,
      axis,
      limits: bounds.filter((limit) => limit !== null),
      height: (position ? 148 : 76) + axis,
      unit: position ? "deg" : "deg/s",
      leastSpan: position ? 2 : 5,
    };
    svg.setAttribute("height", plot.height);
    const quantity = position ? "position in degrees" : "goal velocity in degrees per second";
    svg.setAttribute("aria-label", `${joint.name}, ${quantity} over time: ${restingText(joint)}`);
    plots.push(plot);
  };
  const plots = [];
  const readouts = joints.map((joint) => {
    root.insertAdjacentHTML(
      "beforeend",
      '<section class="joint"><h2></h2><p class="limits"></p><p class="readout"></p></section>',
    );
    const card = root.lastElementChild;
    card.querySelector("h2").textContent = joint.name;
    card.querySelector(".limits").textContent = limitText(joint);
    const hasVelocity = joint.velocity.v.some((v) => v !== null);
    addPlot(card, joint, "position", !hasVelocity);
    if (hasVelocity) addPlot(card, joint, "velocity", true);
    return card.querySelector(".readout");
  });

  const showCursor = () => {
    timeLabel.textContent = cursor === null ? "" : `t = ${number(cursor, 3)} s`;
    plots.forEach(drawOver);
    joints.forEach((joint, i) => {
      readouts[i].innerHTML = cursor === null ? restingText(joint) : cursorText(joint);
    });
  };
  const drawAll = () => {
    plots.forEach(draw);
    showCursor();
  };
  let waiting = false;
  const soon = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      showCursor();
    });
  };
  const clamp = (t) => Math.min(view[1], Math.max(view[0], t));
  const timeUnder = (event) => {
    const plot = plots.find((one) => one.svg === event.target.closest?.("svg"));
    if (!plot) return null;
    const box = plot.svg.getBoundingClientRect();
    const px = ((event.clientX - box.left) * plot.width) / box.width;
    return clamp(view[0] + ((px - LEFT) / (plot.width - LEFT - RIGHT)) * (view[1] - view[0]));
  };
  const zoom = (next) => {
    view = next;
    dragFrom = null;
    cursor = cursor === null ? null : clamp(cursor);
    drawAll();
  };

  root.addEventListener("pointermove", (event) => {
    cursor = timeUnder(event) ?? (dragFrom === null ? null : cursor);
    soon();
  });
  root.addEventListener("pointerleave", () => {
    cursor = null;
    dragFrom = null;
    soon();
  });
  root.addEventListener("pointerdown", (event) => {
    if (event.button === 0) dragFrom = timeUnder(event);
  });
  root.addEventListener("pointerup", (event) => {
    const [from, to] = [dragFrom, timeUnder(event) ?? cursor];
    dragFrom = null;
    const wide = from !== null && to !== null && Math.abs(to - from) > (view[1] - view[0]) * 0.01;
    if (wide) zoom([Math.min(from, to), Math.max(from, to)]);
    else soon();
  });
  root.addEventListener("dblclick", () => zoom(whole));
  root.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (step) {
      const stride = ((view[1] - view[0]) / 100) * (event.shiftKey ? 10 : 1);
      cursor = cursor === null ? view[0] : clamp(cursor + step * stride);
      showCursor();
    } else if (event.key === "Escape") {
      cursor = null;
      zoom(whole);
    } else return;
    event.preventDefault();
  });
  // Half a sheet of paper at 96 px per inch, so that letters keep their size in print.
  addEventListener("beforeprint", () => {
    paperWidth = 340;
    cursor = null;
    drawAll();
  });
  addEventListener("afterprint", () => {
    paperWidth = null;
    drawAll();
  });
  new ResizeObserver(drawAll).observe(root);
  drawAll();
})();
