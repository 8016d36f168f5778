"use strict";
const MOTION = JSON.parse(document.getElementById("motion").textContent);
const { rate_hz: RATE, count: COUNT, points_mm: POINTS, centre_mm: CENTRES } = MOTION;
const FORCES = MOTION.force_body_weights, CONTACTS = MOTION.contacts;
const PARTS = ["left heel", "left toe", "right heel", "right toe"];
const COLOURS = ["#555", "#1f5fbf", "#c0392b"], CARRIES = "#1a9850";
const poses = CENTRES.length / 3;
const view = document.getElementById("view"), pen = view.getContext("2d");
const curve = document.getElementById("curve"), chart = curve.getContext("2d");
const slider = document.getElementById("at"), button = document.getElementById("play");
const said = document.getElementById("said");
slider.max = poses - 1;
// From ahead and from the right, a little from above: the body comes towards whoever watches.
let turn = 0.75 * Math.PI, tilt = 0.15, zoom = 1, playing = true, time = 0, before = null;

// The camera keeps level with the middle of the whole motion and follows the pelvis over the floor.
const AWAY = 4 * MOTION.ball_mm;
let eye = null;

function look(width, height, x, y) {
  const [s, c, st, ct] = [Math.sin(turn), Math.cos(turn), Math.sin(tilt), Math.cos(tilt)];
  eye = {
    x, y, right: [s, -c, 0], up: [c * st, s * st, ct], ahead: [c * ct, s * ct, -st],
    scale: zoom * 0.47 * Math.min(width, height) * Math.sqrt(AWAY ** 2 - MOTION.ball_mm ** 2) / MOTION.ball_mm,
    middle: [width / 2, height / 2],
  };
}

// Where a place is in the picture, and how far away.
function seen(x, y, z) {
  const p = [x - eye.x, y - eye.y, z - MOTION.middle_mm];
  const along = axis => axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2];
  const depth = AWAY + along(eye.ahead);
  return [eye.middle[0] + eye.scale * along(eye.right) / depth, eye.middle[1] - eye.scale * along(eye.up) / depth, depth];
}

function path(places, closed) {
  pen.beginPath();
  places.forEach(([x, y], i) => i ? pen.lineTo(x, y) : pen.moveTo(x, y));
  if (closed) { pen.closePath(); }
}

function dot(place, radius, colour) {
  pen.fillStyle = colour;
  pen.beginPath(); pen.arc(place[0], place[1], radius, 0, 7); pen.fill();
}

// Squares of half a metre, which tell how fast the body goes.
function drawFloor() {
  const reach = 0.6 * AWAY;
  let side = 500;
  while (reach / side > 30) { side *= 2; }
  const [fromX, fromY] = [eye.x, eye.y].map(at => Math.floor((at - reach) / side));
  const squares = Math.ceil(2 * reach / side);
  for (let i = fromX; i <= fromX + squares; i++) {
    for (let j = fromY; j <= fromY + squares; j++) {
      const off = Math.hypot((i + 0.5) * side - eye.x, (j + 0.5) * side - eye.y) / reach;
      if (off >= 1) { continue; }
      const grey = (i + j) % 2 ? 200 : 222;
      pen.fillStyle = `rgba(${grey}, ${grey + 4}, ${grey + 8}, ${1 - off * off})`;
      path([[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(([a, b]) => seen(a * side, b * side, 0)), true);
      pen.fill();
    }
  }
}

// What the soles on the floor span, and the centre of mass with the place on the floor under it.
function drawBalance(pose) {
  // A tipped foot may touch with an edge alone, which is not told as a contact.
  const corners = CONTACTS[pose] ? MOTION.support_mm[pose] : [], places = [];
  for (let i = 0; i < corners.length; i += 2) { places.push(seen(corners[i], corners[i + 1], 0)); }
  path(places, true);
  pen.fillStyle = "rgba(26, 152, 80, 0.35)"; pen.fill();
  pen.strokeStyle = CARRIES; pen.lineWidth = 1.5; pen.stroke();
  const [x, y] = CENTRES.slice(3 * pose, 3 * pose + 2);
  pen.strokeStyle = "#222"; pen.lineWidth = 2;
  for (const [a, b] of [[60, 0], [0, 60]]) { path([seen(x - a, y - b, 0), seen(x + a, y + b, 0)]); pen.stroke(); }
}

function drawCentre(pose) {
  const [x, y, z] = CENTRES.slice(3 * pose, 3 * pose + 3), at = seen(x, y, z), radius = 8;
  pen.setLineDash([4, 4]); pen.strokeStyle = "#222"; pen.lineWidth = 1.5;
  path([at, seen(x, y, 0)]); pen.stroke();
  pen.setLineDash([]);
  dot(at, radius, "#fff");
  pen.fillStyle = "#222";
  for (const from of [0, Math.PI]) {
    pen.beginPath(); pen.moveTo(at[0], at[1]); pen.arc(at[0], at[1], radius, from, from + Math.PI / 2); pen.fill();
  }
  pen.beginPath(); pen.arc(at[0], at[1], radius, 0, 7); pen.stroke();
}

function drawBody(pose) {
  const base = 3 * COUNT * pose;
  const point = i => seen(POINTS[base + 3 * i], POINTS[base + 3 * i + 1], POINTS[base + 3 * i + 2]);
  const lines = MOTION.lines.flatMap((lines, side) => lines.map(([a, b]) => [point(a), point(b), COLOURS[side]]));
  lines.sort((a, b) => b[0][2] + b[1][2] - a[0][2] - a[1][2]);
  pen.lineCap = "round";
  for (const [a, b, colour] of lines) {
    pen.strokeStyle = colour; pen.lineWidth = Math.max(2, 0.03 * eye.scale * MOTION.middle_mm / AWAY);
    path([a, b]); pen.stroke();
  }
  const [neck, top] = MOTION.head.map(point), middle = [0, 1].map(i => neck[i] + 0.6 * (top[i] - neck[i]));
  pen.strokeStyle = COLOURS[0]; path([neck, middle]); pen.stroke();
  dot(middle, 0.4 * Math.hypot(top[0] - neck[0], top[1] - neck[1]), COLOURS[0]);
  MOTION.soles.forEach((sole, bit) => {
    if (CONTACTS[pose] >> bit & 1) { dot(point(sole), 7, "#fff"); dot(point(sole), 5, CARRIES); }
  });
}

// The force over time, and when which part of a foot is on the floor; kept until the size changes.
let kept = null;
const LEFT = 74, ROW = 9;

function chartOf(width, height, ratio) {
  const sheet = document.createElement("canvas"), ink = sheet.getContext("2d");
  sheet.width = width * ratio; sheet.height = height * ratio;
  ink.scale(ratio, ratio);
  ink.font = "11px sans-serif"; ink.textAlign = "right"; ink.textBaseline = "middle";
  const at = pose => LEFT + (width - LEFT - 8) * pose / Math.max(1, poses - 1);
  const low = height - 4 * ROW - 14, most = FORCES.reduce((a, b) => Math.max(a, b), 1.2);
  const up = force => low - (low - 8) * Math.max(0, force) / most;
  for (let force = 0; force <= most && FORCES.length; force += most > 6 ? 5 : 1) {
    ink.strokeStyle = "#ddd"; ink.beginPath(); ink.moveTo(LEFT, up(force)); ink.lineTo(width - 8, up(force)); ink.stroke();
    ink.fillStyle = "#777"; ink.fillText(force === 1 ? "1 weight" : force, LEFT - 6, up(force));
  }
  ink.strokeStyle = "#222"; ink.lineWidth = 1.5; ink.beginPath();
  FORCES.forEach((force, pose) => ink.lineTo(at(pose), up(force)));
  ink.stroke();
  PARTS.forEach((part, bit) => {
    const y = height - (4 - bit) * ROW + ROW / 2 - 3;
    ink.fillStyle = "#777"; ink.fillText(part, LEFT - 6, y);
    ink.fillStyle = COLOURS[bit < 2 ? 1 : 2];
    CONTACTS.forEach((on, pose) => {
      if (on >> bit & 1) { ink.fillRect(at(pose - 0.5), y - 3, at(pose + 0.5) - at(pose - 0.5) + 0.3, 6); }
    });
  });
  return { sheet, at };
}

function sized(canvas, ink) {
  const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; kept = null; }
  ink.setTransform(ratio, 0, 0, ratio, 0, 0);
  ink.clearRect(0, 0, width, height);
  return [width, height, ratio];
}

function words(pose) {
  const down = PARTS.filter((_, bit) => CONTACTS[pose] >> bit & 1);
  const feet = !CONTACTS.length ? "feet were not captured" : down.length ? "on the floor: " + down.join(", ") : "no sole on the floor";
  const force = FORCES.length ? `the floor pushes with ${FORCES[pose].toFixed(2).replace("-0.00", "0.00")} body weights; ` : "";
  return `${(pose / RATE).toFixed(2)} s: ${force}${feet}`;
}

function draw() {
  const pose = Math.min(poses - 1, Math.floor(time * RATE)), base = 3 * COUNT * pose;
  const [width, height] = sized(view, pen);
  look(width, height, POINTS[base], POINTS[base + 1]);
  drawFloor();
  drawBalance(pose);
  drawBody(pose);
  drawCentre(pose);
  const [across, high, ratio] = sized(curve, chart);
  kept = kept || chartOf(across, high, ratio);
  chart.drawImage(kept.sheet, 0, 0, across, high);
  chart.strokeStyle = CARRIES; chart.lineWidth = 2;
  chart.beginPath(); chart.moveTo(kept.at(pose), 0); chart.lineTo(kept.at(pose), high); chart.stroke();
  slider.value = pose;
  said.textContent = words(pose);
}

function tick(now) {
  if (before !== null && playing) { time = (time + (now - before) / 1000) % (poses / RATE); }
  before = now;
  draw();
  requestAnimationFrame(tick);
}

function play(on) { playing = on; button.textContent = on ? "pause" : "play"; }
function go(pose) { play(false); time = Math.max(0, Math.min(poses - 1, pose)) / RATE + 1e-6; }

button.onclick = () => play(!playing);
slider.oninput = () => go(Number(slider.value));
curve.onpointerdown = curve.onpointermove = e => {
  if (e.buttons) { go(Math.round((e.offsetX - LEFT) / (curve.clientWidth - LEFT - 8) * (poses - 1))); }
};
view.onpointermove = e => {
  if (e.buttons) { turn -= e.movementX * 0.01; tilt = Math.max(-0.2, Math.min(1.5, tilt + e.movementY * 0.01)); }
};
view.onwheel = e => { e.preventDefault(); zoom = Math.max(0.2, Math.min(5, zoom * Math.exp(-e.deltaY * 0.001))); };
// A fixed moment for whoever opens page.html#t=1.5
const asked = /t=([0-9.]+)/.exec(location.hash);
if (asked) { go(Math.floor(parseFloat(asked[1]) * RATE)); }
requestAnimationFrame(tick);
