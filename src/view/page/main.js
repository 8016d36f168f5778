// ---- the page ----

const byId = id => document.getElementById(id);
const counted = (count, one) => `${count} ${one}${count === 1 ? "" : "s"}`;
const data = JSON.parse(byId("data").textContent);
const isLive = !!data.is_live;
const joints = data.joints && {
  clock: isLive ? growing() : clockOf(data.joints.clock),
  list: data.joints.joints.map(joint => (isLive ? { ...joint, goal: [], present: [], others: [] } : {
    ...joint, goal: joint.goal && decoded(joint.goal), present: joint.present && joint.present.count && decoded(joint.present),
  })),
};
const robot = data.robot && joints ? new Robot(data.robot, joints, isLive || data.can_edit) : null;
// Where two people are who come live nobody knows: they are drawn a metre apart.
const persons = [data.person, data.other].filter(Boolean).map((of, n) => (isLive ? new LivePerson(of, n) : new Person(of)));
const person = persons[0] || null;
// Angles of a person who comes live.
const angles = data.angles && { clock: growing(), list: data.angles.map(name => ({ name, present: [], others: [] })) };
const session = data.is_session ? new Session() : null;
const hearing = data.hears ? new Hearing() : null;
const ticking = isLive ? new LiveClock() : null;
const markers = data.markers ? new Markers(data.markers) : null;
const plates = data.plates ? new Plates(data.plates) : null;
let duration = Math.max(data.duration_s, 1e-3);
const view = { window: [0, duration], duration };
const stepClock = ticking ? ticking.clock : joints ? joints.clock : person ? person.clock : markers ? markers.clock : null;
const said = byId("said"), headInput = byId("head"), playButton = byId("play"), canvas = byId("scene");
let now = 0, playing = false, before = null, stale = true, frames = 0, slowest = 0;
// Key frames are made: what is drawn and played is their motion.
let editing = false, editor = null, held = null;
const isNow = () => isLive && !editing;
const pace = new Pace(isLive && isDrawnByProcessor());

const active = t => data.spans.filter(span => !span.before && span.start_s <= t + 1e-6 && t <= Math.max(span.end_s, span.start_s + 0.05));
const isWrong = t => new Set(active(t).flatMap(span => span.links || []));

// ---- in space ----
let stage = null;
const nothing = byId("nothing");
if (robot || person || markers) {
  try { stage = new Stage(canvas, { robot, persons, markers, plates, isWrong, spares: pace.spares }); } catch (error) {
    nothing.textContent = `This browser draws nothing in space (${error.message}): signals and times are below.`;
  }
} else { nothing.textContent = joints ? "Nothing is drawn in space: the robot's file does not say where its joints are." : ""; }
if (!stage) { nothing.hidden = false; canvas.hidden = true; byId("stage").classList.add("empty"); }

const check = (place, text, on, change) => {
  const label = document.createElement("label"), input = document.createElement("input");
  input.type = "checkbox"; input.checked = on;
  input.addEventListener("change", () => { change(input.checked); stale = true; });
  label.append(input, ` ${text}`);
  place.append(label);
};
if (stage) {
  for (const [part, name] of Object.entries(PARTS)) if (stage.has(part) && !(data.can_edit && ["contacts", "collisions"].includes(part))) check(byId("shown"), name, true, yes => stage.show(part, yes));
  if (robot && person) check(byId("shown"), "true size", false, yes => { stage.trueSize = yes; });
}

// ---- what can be chosen ----
const channels = channelsOf(data, joints, person, markers, isLive, angles, plates), chosen = new Set(), plots = [];
const quantities = [...new Set(channels.flatMap(channel => channel.plots.map(plot => plot.quantity)))];
const wanted = new Set(joints || angles ? ["angle", "velocity", "force"] : quantities);
const buttons = new Map();

function choose(n, yes = !chosen.has(n)) {
  if (yes) chosen.add(n); else chosen.delete(n);
  buttons.get(n).setAttribute("aria-pressed", String(yes));
  if (stage) stage.chosen = new Set([...chosen].map(index => channels[index].joint));
  document.documentElement.dataset.chosen = [...chosen].map(index => channels[index].name).join(" ");
  replot();
}

// A velocity that begins and ends at rest.
const atRest = values => { values[0] = values[values.length - 1] = 0; return values; };

// The curves of the joint that is turned.
function plotPose() {
  const joint = editor.joints.list[editor.chosen], { clock } = editor, place = byId("curve");
  const curve = values => [{ name: "goal", values, clock, scale: DEGREES }];
  const limit = joint.velocity_limit_rad_s * DEGREES;
  place.replaceChildren();
  plots.length = 0;
  plots.push(
    new Plot(place, joint, { quantity: "angle", unit: "\u00b0", curves: curve(() => joint.goal), bounds: joint.range_rad.map(end => end * DEGREES), least: 2 }, view),
    new Plot(place, joint, { quantity: "velocity", unit: "\u00b0/s", curves: curve(() => atRest(derived(joint.goal, clock, 1, 1))), bounds: limit ? [-limit, limit] : null, least: 5 }, view),
  );
  plots.forEach(plot => plot.draw());
}

// For so long there is something to see.
function lasts(time) {
  duration = Math.max(time, 1e-3);
  view.duration = duration; view.window = [0, duration]; headInput.max = duration;
  stale = true;
}

// Somebody turned a joint, or chose one.
function edited(of, isChoice) {
  if (!editing) return;
  if (stage) stage.chosen = new Set([of.chosen]);
  lasts(of.keys.duration);
  if (!isChoice) { playing && play(false); said.textContent = ""; go(of.keys.times()[of.keys.at]); }
  plotPose();
}

function edit(on) {
  editing = on;
  byId("poses").hidden = !on;
  byId("signals").hidden = on || !channels.length;
  byId("edit").setAttribute("aria-pressed", String(on));
  for (const id of ["speed", "loop"]) byId(id).parentElement.hidden = isNow();
  if (robot) robot.joints = on ? editor.joints : joints;
  if (on) { play(false); edited(editor); return; }
  byId("curve").replaceChildren();
  lasts(stepClock.time(stepClock.count - 1));
  if (stage) stage.chosen = new Set([...chosen].map(index => channels[index].joint));
  replot();
  play(isLive);
}

function replot() {
  if (editing) return;
  byId("plots").replaceChildren();
  plots.length = 0;
  for (const n of chosen) {
    for (const plot of channels[n].plots) if (wanted.has(plot.quantity)) plots.push(new Plot(byId("plots"), channels[n], plot, view));
  }
  plots.forEach(plot => plot.draw());
  stale = true;
}

// A quantity that can be looked at.
function offer(quantity) {
  check(document.querySelector(".quantities"), quantity, wanted.has(quantity), yes => { if (yes) wanted.add(quantity); else wanted.delete(quantity); replot(); });
}

// What is read of a joint for the first time can be looked at from now on.
function learn() {
  for (const { joint, plots: own } of channels) {
    if (joint === null || joint === undefined) continue;
    for (const { name, unit, clock, values } of joints.list[joint].others) {
      if (own.some(plot => plot.quantity === name)) continue;
      own.push({ quantity: name, unit, curves: [{ name, values, clock, scale: 1 }], least: 0.1 });
      if (!quantities.includes(name)) { quantities.push(name); offer(name); }
    }
  }
}

function buildChoice() {
  const place = byId("choice");
  if (!channels.length) { byId("signals").hidden = true; document.querySelector("main").classList.add("alone"); return; }
  // One of a kind, several, and which of them.
  const list = ([one, several], [does, many], which, open) => {
    const members = channels.map((channel, n) => n).filter(n => which(channels[n]));
    if (!members.length) return;
    const box = document.createElement("details"), summary = document.createElement("summary");
    box.open = open; summary.textContent = members.length === 1 ? `1 ${one}${does}` : `${members.length} ${several}${many}`;
    box.append(summary);
    for (const n of members) {
      const button = document.createElement("button");
      button.type = "button"; button.textContent = channels[n].name; button.className = channels[n].mended ? "chip mended" : "chip";
      button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", () => choose(n));
      buttons.set(n, button);
      box.append(button);
    }
    place.append(box);
  };
  const kind = joints ? ["joint", "joints"] : ["signal", "signals"], of = group => channel => channel.group === group;
  const moving = joints && !isLive ? [" that moves", " that move"] : ["", ""];
  list(markers ? ["labelled marker", "labelled markers"] : kind, moving, channel => channel.moves && !channel.group, true);
  list(["angle of the person", "angles of the person"], ["", ""], of("angle"), !joints);
  list(["force plate", "force plates"], ["", ""], of("plate"), true);
  const still = [" that never moves", " that never move"];
  if (markers) list(["point without a label", "points without a label"], ["", ""], channel => !channel.moves, false);
  else list(kind, still, channel => !channel.moves, false);
  if (quantities.length > 1) {
    const bar = document.createElement("div");
    bar.className = "quantities"; bar.setAttribute("role", "group"); bar.setAttribute("aria-label", "Quantities");
    place.append(bar);
    quantities.forEach(offer);
  }
}

// What somebody would look at first: the joint that travels furthest, a marker that was mended.
function firstChoice() {
  if (!channels.length) return null;
  const asked = new URLSearchParams(location.hash.slice(1)).get("joint");
  const named = channels.findIndex(channel => channel.name === asked);
  if (named >= 0) return named;
  if (!joints) return ["mended", "moves"].map(what => channels.findIndex(channel => channel[what])).find(at => at >= 0) ?? 0;
  const travel = channels.map(channel => { const [low, high] = channel.plots[0].curves.length ? extent(channel.plots[0].curves[0], [0, duration]) : [0, 0]; return high - low; });
  return travel.indexOf(Math.max(...travel));
}

// ---- time ----
const rows = [];
for (const span of data.spans) {
  let row = rows.find(known => known.name === span.row);
  if (!row) { row = { name: span.row, spans: [] }; rows.push(row); }
  row.spans.push(span);
}
const flags = (names, values, clock) => names.forEach((name, bit) => rows.push({ name, spans: [], times: runs(values, clock, sum => sum >> bit & 1) }));
if (robot && robot.soles.length && !isLive && !data.can_edit) flags(["left foot stands", "right foot stands"], robot.contacts, robot.clock);
if (person && person.contacts && !robot) flags(["left heel", "left toe", "right heel", "right toe"], person.contacts, person.clock);
const line = new Line(byId("line"), rows, view);
if (!rows.length) byId("line").hidden = true;

// Something happened while somebody looks on; each is told once, whatever was heard before.
const happened = { numbers: new Set(), runs: 0 };
function happen(number, { time_s: time, lasts_s: lasts, kind, row, label, links }) {
  if (happened.numbers.has(number)) return;
  happened.numbers.add(number);
  // Of another run, or before there was a clock.
  const span = { kind, row, label, start_s: time ?? 0, end_s: (time ?? 0) + lasts, before: time === null, links };
  data.spans.push(span);
  if (!span.before) lineOf(span);
  const box = byId("events"), list = box.querySelector("ol");
  if (kind !== "part") {
    list.prepend(eventItem(span));
    while (list.children.length > MOST_EVENTS) list.lastChild.remove();
    box.hidden = false; box.querySelector("summary").textContent = counted(list.children.length, "event");
    if (kind === "wrong") said.textContent = row === label ? label : `${row}: ${label}`;
  }
  redrawAll();
}

function lineOf(span) {
  let row = rows.find(known => known.name === span.row);
  if (!row) { row = { name: span.row, spans: [] }; rows.push(row); line.fit(); }
  row.spans.push(span);
  byId("line").hidden = false;
}

// Another run: what happened so far was before it.
function beginAnew() {
  data.spans.forEach(span => { span.before = true; });
  rows.length = 0;
  byId("line").hidden = true;
  for (const button of byId("events").querySelectorAll("button")) { button.disabled = true; button.textContent = button.textContent.replace(/^[\d.]+( to [\d.]+)? s: /, "before: "); }
}

const MOST_EVENTS = 500;

function eventItem(span) {
  const item = document.createElement("li"), button = document.createElement("button");
  button.type = "button"; button.className = `told ${span.kind}`;
  const end = span.end_s > span.start_s ? ` to ${span.end_s.toFixed(2)}` : "";
  const when = span.before ? "before" : `${span.start_s.toFixed(2)}${end} s`;
  button.textContent = `${when}: ${span.row === span.label ? "" : `${span.row}: `}${span.label}`;
  button.disabled = !!span.before;
  button.addEventListener("click", () => { play(false); go(span.start_s, true); });
  item.append(button);
  return item;
}

function buildEvents() {
  const told = data.spans.filter(span => span.kind !== "part" && span.kind !== "phase").slice(0, MOST_EVENTS);
  const box = byId("events");
  if (!told.length) { box.hidden = true; return; }
  box.querySelector("summary").textContent = counted(told.length, "event");
  box.querySelector("ol").append(...told.map(eventItem));
}

function words(t) {
  const parts = [`${t.toFixed(2)} s`];
  const feet = (values, clock, names) => {
    const sum = values[clock.at(t)], down = names.filter((_, bit) => sum >> bit & 1);
    parts.push(down.length ? `on the floor: ${down.join(", ")}` : "nothing on the floor");
  };
  if (isLive || editing) return parts.join("");
  if (robot && robot.soles.length) feet(robot.contacts, robot.clock, ["left foot", "right foot"]);
  else if (!robot && person && person.contacts) feet(person.contacts, person.clock, ["left heel", "left toe", "right heel", "right toe"]);
  for (const span of active(t)) parts.push(span.kind === "wrong" || span.kind === "doubt" ? `${span.row}: ${span.label}` : span.label);
  return [...new Set(parts)].join(" \u00b7 ");
}

function go(t, tells) {
  now = Math.max(0, Math.min(duration, t));
  stale = true;
  if (tells) {
    const heard = editing ? [] : [...chosen].slice(0, 3).map(n => channels[n].plots[0]).map((plot, k) => {
      const name = channels[[...chosen][k]].name;
      return `${name} ${plot.curves.map(curve => `${curve.name} ${(valuesOf(curve)[curve.clock.at(now)] * curve.scale).toFixed(1)} ${plot.unit}`).join(", ")}`;
    });
    said.textContent = [words(now), ...heard].join("; ");
  }
}

function play(on) {
  playing = on;
  before = null;
  if (on && now >= duration && !isNow()) now = 0;
  playButton.textContent = on ? "pause" : isNow() ? "now" : "play";
  if (!on) go(now, true);
  stale = true;
}

function step(by) {
  play(false);
  const clock = editing ? editor.clock : stepClock;
  if (!clock) return;
  go(clock.time(Math.max(0, Math.min(clock.count - 1, clock.at(now) + by))), true);
}

function zoomTo(from, to) {
  view.window = to - from > duration * 0.002 ? [Math.max(0, from), Math.min(duration, to)] : [0, duration];
  plots.forEach(plot => plot.draw());
  stale = true;
}

function redraw() {
  const began = performance.now();
  if (isNow() && playing) {
    view.window = [Math.max(0, duration - SEEN_S), Math.max(duration, SEEN_S)];
    for (const plot of plots) { plot.plot.curves.forEach(curve => { curve.made = null; }); plot.draw(); }
  }
  if (stage) { stage.put(now); stage.draw(); }
  plots.forEach(plot => plot.head(now));
  if (rows.length) line.head(now);
  headInput.value = now;
  headInput.setAttribute("aria-valuetext", `${now.toFixed(2)} s`);
  byId("clock").textContent = `${now.toFixed(2)} of ${duration.toFixed(2)} s`;
  byId("now").textContent = session ? "" : words(now);
  frames += 1;
  slowest = Math.max(slowest, performance.now() - began);
  const { dataset } = document.documentElement;
  dataset.time = now.toFixed(4); dataset.frames = frames; dataset.playing = playing;
}

function tick(stamp) {
  if (playing && isNow()) {
    if (now !== duration && pace.isDue(stamp)) { now = duration; stale = true; }
  } else if (playing) {
    if (before !== null) {
      let next = now + ((stamp - before) / 1000) * Number(byId("speed").value);
      if (next >= duration) { if (byId("loop").checked) next %= duration; else { next = duration; play(false); } }
      now = next;
    }
    before = stamp;
    stale = true;
  }
  if (session) session.run();
  if (stale) { stale = false; redraw(); }
  requestAnimationFrame(tick);
}

function redrawAll() {
  if (rows.length) headInput.style.cssText = `margin-left: ${line.left() - 8}px; width: calc(100% - ${line.left() - 8 + RIGHT - 8}px)`;
  plots.forEach(plot => plot.draw());
  if (rows.length) line.draw();
  stale = true;
}

// ---- hands ----
playButton.addEventListener("click", () => play(!playing));
byId("back").addEventListener("click", () => step(-1));
byId("forth").addEventListener("click", () => step(1));
headInput.max = duration;
if (isLive) {
  const source = new EventSource("frames"), stop = byId("stop"), state = byId("nothing");
  const tell = (what, words) => {
    document.documentElement.dataset.live = what;
    stop.disabled = what !== "on";
    if (stage) { state.textContent = words; state.hidden = !words; }
  };
  // What whoever wears sensors is to do is read from afar.
  const asked = told => (told.facts || []).find(([name]) => name === "to do")?.[1];
  const nobody = () => (robot || !person || person.clock.count ? "" : "Nobody is drawn before the sensors are calibrated.");
  tell("waiting", session || !robot ? "Nothing is told yet." : "Nothing moves yet.");
  source.addEventListener("message", event => {
    const told = JSON.parse(event.data);
    if (session) session.show(told.session);
    if (hearing) hearing.show(told.sensors || told.session?.sensors || [], told.facts);
    persons.forEach((one, n) => one.take(told.time_s, (told.persons || [])[n]));
    if (angles && told.angles_rad) taken(angles, { time_s: told.time_s, goal_rad: [], present_rad: told.angles_rad });
    if (joints && told.goal_rad.length && taken(joints, told)) learn();
    const isNew = ticking.take(told.time_s);
    if (ticking.runs > happened.runs) { happened.runs = ticking.runs; beginAnew(); }
    state.classList.toggle("asked", !!asked(told));
    tell("on", asked(told) ?? nobody());
    if (!isNew || editing) return;
    duration = Math.max(stepClock.time(stepClock.count - 1), 1e-3);
    view.duration = duration; headInput.max = duration;
    // What comes is drawn when its picture is due.
    if (!playing) stale = true;
  });
  source.addEventListener("happened", event => happen(Number(event.lastEventId), JSON.parse(event.data)));
  // The browser tries again by itself.
  source.addEventListener("error", () => { tell("off", "The program has ended, or does not answer: nothing new comes."); if (hearing) hearing.end(); });
  const stops = joints ? "stop the robot" : "stop";
  stop.textContent = stops;
  stop.hidden = !!session;
  stop.addEventListener("click", async () => {
    stop.textContent = "stopping";
    const heard = await fetch("stop", { method: "POST" }).then(answer => answer.ok, () => false);
    stop.textContent = heard ? "told to stop" : stops;
    if (!heard) said.textContent = "The program did not hear it: press Ctrl-C where it runs.";
  });
  for (const id of ["speed", "loop"]) byId(id).parentElement.hidden = true;
}
headInput.addEventListener("input", () => { playing && play(false); go(Number(headInput.value)); });
headInput.addEventListener("change", () => go(Number(headInput.value), true));
byId("follow").addEventListener("change", event => { if (stage) stage.follows = event.target.checked; stale = true; });

const onLine = event => { if (event.buttons) { playing && play(false); go(line.time(event.offsetX)); } };
byId("line").addEventListener("pointerdown", onLine);
byId("line").addEventListener("pointermove", onLine);

let dragFrom = null;
const plotUnder = event => plots.find(plot => plot.canvas === event.target);
byId("plots").addEventListener("pointerdown", event => { const plot = plotUnder(event); if (plot) dragFrom = plot.time(event.offsetX); });
byId("plots").addEventListener("pointerup", event => {
  const plot = plotUnder(event), from = dragFrom;
  dragFrom = null;
  if (!plot || from === null) return;
  const to = plot.time(event.offsetX);
  if (Math.abs(to - from) > (view.window[1] - view.window[0]) * 0.02) zoomTo(Math.min(from, to), Math.max(from, to));
  else { playing && play(false); go(to, true); }
});
byId("plots").addEventListener("dblclick", () => zoomTo(0, duration));

if (stage) {
  const touches = new Map();
  let moved = 0;
  canvas.addEventListener("pointerdown", event => { touches.set(event.pointerId, [event.clientX, event.clientY]); moved = 0; canvas.setPointerCapture(event.pointerId); hold(event); });
  canvas.addEventListener("pointermove", event => {
    const last = touches.get(event.pointerId);
    if (!last) return;
    if (held) { editor.pull(held, [event.offsetX, event.offsetY], event.shiftKey, place => stage.project(place)); return; }
    const [dx, dy] = [event.clientX - last[0], event.clientY - last[1]];
    if (touches.size === 2) {
      const other = [...touches].find(([id]) => id !== event.pointerId)[1];
      const apart = p => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      zoom(apart([event.clientX, event.clientY]) / apart(last));
    } else { orbit(-dx * 0.008, dy * 0.008); }
    moved += Math.abs(dx) + Math.abs(dy);
    touches.set(event.pointerId, [event.clientX, event.clientY]);
  });
  const ends = event => {
    if (held) { held = null; touches.delete(event.pointerId); return; }
    if (touches.delete(event.pointerId) && event.type === "pointerup" && moved < 6) {
      const found = stage.pick(event.offsetX, event.offsetY);
      const at = found === null ? -1 : channels.findIndex(channel => channel.joint === found);
      if (at >= 0) { choose(at); buttons.get(at).closest("details").open = true; }
    }
  };
  canvas.addEventListener("pointerup", ends);
  canvas.addEventListener("pointercancel", ends);
  canvas.addEventListener("wheel", event => { event.preventDefault(); zoom(Math.exp(-event.deltaY * 0.0012)); }, { passive: false });
  canvas.addEventListener("keydown", event => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.06], ArrowDown: [0, -0.06] }[event.key];
    if (turns) orbit(...turns);
    else if (event.key === "+" || event.key === "=") zoom(1.1);
    else if (event.key === "-") zoom(1 / 1.1);
    else return;
    event.preventDefault();
    event.stopPropagation();
  });
}
// A limb is taken in the hand: of the key frame that is changed.
function hold(event) {
  if (!editing || event.button) return;
  const { keys } = editor, t = keys.times()[keys.at];
  if (playing || now !== t) { playing && play(false); go(t); redraw(); }
  held = stage.grab(event.offsetX, event.offsetY);
  // The base stands where it stands: who drags it looks from elsewhere.
  if (held && held.link === 0) held = null;
}
function orbit(turn, tilt) { stage.turn += turn; stage.tilt = Math.max(-0.3, Math.min(1.5, stage.tilt + tilt)); stale = true; }
function zoom(by) { stage.zoom = Math.max(0.15, Math.min(12, stage.zoom * by)); stale = true; }

addEventListener("keydown", event => {
  if (event.ctrlKey || event.metaKey || event.altKey || /^(BUTTON|SELECT|SUMMARY)$/.test(event.target.tagName)) return;
  const keys = {
    " ": () => play(!playing), ",": () => step(-1), ".": () => step(1),
    // What comes while somebody looks on has a present, from which Home leaves and to which End goes back.
    Home: () => { if (isLive) play(false); go(0, true); }, End: () => (isNow() ? play(true) : go(duration, true)),
    f: () => byId("follow").click(), l: () => byId("loop").click(),
  };
  const speed = "123456".indexOf(event.key);
  if (speed >= 0 && event.key.length === 1) byId("speed").selectedIndex = speed;
  else if (keys[event.key] && !(event.target.type === "checkbox" && event.key === " ")) keys[event.key]();
  else return;
  event.preventDefault();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => { if (stage) stage.theme(); redrawAll(); });

buildChoice();
buildEvents();
const first = firstChoice();
if (first !== null) choose(first, true);
if (isLive) play(true);
if (data.can_edit) {
  editor = new Editor(robot, joints.list, edited);
  const take = byId("pose-take");
  take.hidden = !isLive;
  take.addEventListener("click", () => editor.take(joints.list.map(joint => joint.present.at(-1))));
  byId("edit").hidden = !isLive;
  byId("edit").addEventListener("click", () => edit(!editing));
  if (!isLive) edit(true);
}
// A fixed moment for whoever opens page.html#t=1.5
const asked = parseFloat(new URLSearchParams(location.hash.slice(1)).get("t"));
if (asked >= 0) go(asked, true);
new ResizeObserver(redrawAll).observe(document.querySelector("main"));
// For tests, and for whoever looks into a page: figures of what is drawn.
window.gaitway = {
  figures: () => ({ now, duration, playing, frames, slowest_ms: slowest, chosen: [...chosen].map(n => channels[n].name), channels: channels.length }),
  links: (t, which) => (robot ? robot.places(t, which).map(place => [...place.at, ...place.turn]) : []),
  centre: t => (robot ? robot.centre(robot.places(t, "present")) : person ? person.centre(t) : null),
  markers: t => (markers ? markers.points.map(point => markers.place(point.at, t)) : []),
  person: t => (person ? person.places(t) : []),
  sensors: t => (person ? person.sensors.map(sensor => ({ name: sensor.name, worn: person.worn(sensor, person.places(t), t) })) : []),
  // How many lines are drawn in space: limbs, axes, what connects joints.
  lines: () => (stage ? stage.scene.children.filter(of => of.visible && of.userData.radius).length : 0),
  arrows: t => (plates ? plates.list.map(plate => plates.arrow(plate, t)) : []),
  persons: t => persons.map(one => (one.clock.count ? one.places(t) : [])),
  poses: () => editor && {
    table: editor.keys.table(), times: editor.keys.times(), at: editor.keys.at, angles: editor.keys.frames.map(frame => frame.angles),
    rate: editor.clock.rate, motion: Object.fromEntries(editor.joints.list.map(joint => [joint.name, [...joint.goal]])),
  },
  // Where on the window a place of a link is.
  seen: (link, local) => { const { at, turn } = robot.places(now, "present")[link], box = canvas.getBoundingClientRect(); return stage.project(plus(at, turned(turn, local))).map((part, k) => part + (k ? box.top : box.left)); },
  // At which of these moments, ms, a picture of what comes would be drawn, sparingly or not; and how it is here.
  due: (spares, stamps) => { const one = new Pace(spares); return stamps.filter(at => one.isDue(at)); },
  spares: () => pace.spares,
  redraw,
};
requestAnimationFrame(tick);
