"use strict";
const el = id => document.getElementById(id);
const SECONDS = 3;
/** Time without an update after which the page counts as stale, in ms. */
const STALE_AFTER = 1000;
/** Number of characters above which a prediction is set in a smaller font. */
const LONG = 24;
let view = null, traces = [], came = 0, pending = false, chosen = -1, low_ = 0, top_ = 0, whole = true, said = "", connected = true;

const percent = p => p > .9995 && p < 1 ? "> 99.9\u00a0%" : (100 * p).toFixed(1) + "\u00a0%";
const color = name => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const node = (tag, text, name) => { const made = document.createElement(tag); if (text !== undefined) made.textContent = text; if (name) made.className = name; return made; };
const set = (id, text) => { if (el(id).textContent !== text) el(id).textContent = text; };
const ago = ms => ms < 60000 ? Math.round(ms / 1000) + " s" : Math.round(ms / 60000) + " min";

// ---- Prediction, score, events, counters

/** Returns the number of readings of the current sweep in a belief. */
const seenOf = belief => belief.frames + (view.steps ? " of " + view.steps : "") + " readings";
function showAnswer() {
  const { belief, object } = view, answer = object.answer, partial = belief && belief.stage === "anytime";
  if (answer) {
    set("answer", answer.material === null ? "unknown material" : answer.material);
    el("answer").className = answer.material === null ? "unknown" : "";
    set("answer-title", "After " + object.sweeps + (object.sweeps === 1 ? " sweep" : " sweeps") + ", it feels like");
  } else if (belief && belief.posterior.length) {
    set("answer", belief.posterior[0][0] + "?");
    el("answer").className = partial ? "provisional" : "";
    set("answer-title", partial ? "Provisional: " + seenOf(belief) : "During the first sweep, it feels like");
  } else {
    set("answer", "waiting for a sweep");
    el("answer").className = "soft";
    set("answer-title", object.number > 1 ? "Next object" : "It feels like");
  }
  el("answer").classList.toggle("long", el("answer").textContent.length > LONG);
  const truth = el("truth");
  truth.className = object.right === null ? "" : object.right ? "right" : "wrong";
  set("truth", object.several ? "The commands since the last new object name several materials."
    : object.truth === null ? "" : object.right === null ? "It is " + object.truth + "."
    : (object.right ? "✓ Right" : "✗ Wrong") + ": it is " + object.truth + (object.taught ? "." : ", an untrained material."));
  if (belief) {
    const [name, p] = belief.posterior[0] || ["", 0], says = (belief.unknown ? "unknown, nearest " : "") + name + " " + percent(p);
    set("sweep", partial ? "Sweep " + (object.sweeps + 1) + ", " + seenOf(belief) + ", provisional: " + says : "Sweep " + object.sweeps + " alone: " + says);
    el("progress").value = view.steps ? belief.frames / view.steps : 0;
  } else { set("sweep", "Waiting for the finger to move."); el("progress").value = 0; }
  const fused = belief && belief.fused_sweeps > 0 && object.sweeps > 0, rows = !belief ? [] : fused ? belief.fused : belief.posterior;
  set("bars-title", fused ? "Probabilities, all complete sweeps of this object" : partial ? "Probabilities, provisional" : "Probabilities, this sweep");
  el("bars").className = partial && !fused ? "provisional" : "";
  showBars(rows);
  const text = !answer ? "" : "Object " + object.number + ", after " + object.sweeps + (object.sweeps === 1 ? " sweep: " : " sweeps: ") + el("answer").textContent + (object.truth && !object.several ? ". It is " + object.truth : "") + ".";
  if (text && text !== said) { said = text; el("said").textContent = text; }
}
function showBars(rows) {
  const others = view.materials - rows.length, left = Math.max(0, 1 - rows.reduce((sum, row) => sum + row[1], 0));
  const items = rows.map(([name, p]) => {
    const bar = node("li"), label = node("span", name), track = node("i"), fill = node("b");
    label.title = name; fill.style.width = 100 * p + "%"; track.append(fill);
    bar.append(label, node("span", percent(p)), track); return bar;
  });
  if (rows.length && others > 0) {
    const bar = node("li", undefined, "rest"); bar.append(node("span", others + (others === 1 ? " other" : " others")), node("span", percent(left))); items.push(bar);
  }
  if (!rows.length) items.push(node("li", view.materials ? "One of " + view.materials + (view.tells_unknown ? " materials, or none of them." : " materials.") : "No network yet.", "rest"));
  el("bars").replaceChildren(...items);
}
function showUnlike() {
  el("unlike").hidden = !view.unlike;
  set("unlike", view.unlike || "");
}
function showScore() {
  const { right, all, new_right, new_all, marks } = view.score, truth = view.object.truth !== null || all > 0;
  el("score-card").hidden = !truth; document.body.classList.toggle("unscored", !truth);
  set("score", all ? right + " of " + all : "–");
  set("score-note", all ? "right (" + Math.round(100 * right / all) + " %)" : "the first object is in progress");
  el("score-cycle").hidden = !view.note; set("score-cycle", view.note || "");
  set("score-taught", all > new_all ? (right - new_right) + " of " + (all - new_all) + " right" : "none yet");
  el("score-new-name").hidden = el("score-new").hidden = new_all === 0;
  set("score-new", view.tells_unknown ? new_right + " of " + new_all + " predicted unknown" : new_all + "; this network is not calibrated to detect unknown materials");
  const key = all + "/" + right;
  if (el("marks").dataset.key === key) return;
  el("marks").dataset.key = key;
  el("marks").replaceChildren(...marks.map(good => { const mark = node("li", good ? "✓" : "✗", good ? "right" : "wrong"); mark.setAttribute("aria-label", good ? "right" : "wrong"); return mark; }));
}
function showEvents() {
  const key = view.events.length ? view.events[0].at_ms + view.events[0].text : "";
  if (el("events").dataset.key === key && key) return;
  el("events").dataset.key = key;
  const items = view.events.map(event => {
    const item = node("li"), time = node("time", new Date(event.at_ms).toLocaleTimeString("en-GB"));
    const mark = event.right === null ? "" : event.right ? "✓ " : "✗ ";
    item.append(time, node("span", mark + event.text.replaceAll(" %", "\u00a0%"), event.right === null ? (event.text.startsWith("object") ? "object" : "") : "object " + (event.right ? "right" : "wrong"))); return item;
  });
  el("events").replaceChildren(...(items.length ? items : [node("li", "Nothing yet.", "soft")]));
}
/** Tooltips of the counters. */
const TOOLTIPS = {
  "missed deadlines": "Predictions after the deadline, which counts from a sweep's last reading: one reading period, or three with dropout masks, unless the table sets another. They are late, not wrong.",
  "longest processing delay, ms": "Maximum time from a reading's arrival to the end of its processing. Only predictions after a sweep's last reading have a deadline.",
  "sweeps rejected": "Sweeps that cannot be used; the event list gives the reason.",
};
function showCounters() {
  const shown = view.counters.filter(([name]) => view.tells_unknown || name !== "sweeps predicted unknown");
  const rows = shown.map(([name, n]) => [name, n.toLocaleString("en")]);
  if (view.belief) rows.push(["last reading to prediction, ms", (view.belief.latency_us / 1000).toFixed(2)]);
  if (view.model_version) rows.push(["network version", String(view.model_version)]);
  el("counters").replaceChildren(...rows.map(([name, n]) => { const pair = node("div"); if (TOOLTIPS[name]) pair.title = TOOLTIPS[name]; pair.append(node("dt", name), node("dd", n)); return pair; }));
}
function showAge() {
  const silent = performance.now() - came, lost = !connected || silent > STALE_AFTER, dead = view && !view.alive, old = lost || dead;
  document.body.classList.toggle("stale", Boolean(old));
  const silentSkin = view && !old && view.frames_per_s < .5;
  el("state").className = old || !view ? "dead" : silentSkin ? "waiting" : "alive";
  set("state", !view ? "connecting" : lost ? "connection lost, reconnecting" : dead ? "the classifier is silent" : silentSkin ? "waiting for a skin" : "live");
  document.body.classList.toggle("skinless", Boolean(silentSkin));
  set("skin-title", silentSkin ? "Skin, last readings: silent now" : "Skin, readings now");
  set("age", old && view ? "Stale: this prediction is " + ago(view.heard_ms + silent) + " old." : silentSkin && view.belief ? "No readings: this is the last prediction." : "");
  el("reset").disabled = Boolean(old) || !view;
  set("rate", view && !old && !silentSkin ? view.frames_per_s.toFixed(0) + " readings per second" : "");
}

// ---- Skin and traces

function context(canvas) {
  const scale = devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) { canvas.width = Math.round(width * scale); canvas.height = Math.round(height * scale); }
  const c = canvas.getContext("2d"); c.setTransform(scale, 0, 0, scale, 0, 0); c.clearRect(0, 0, width, height); return [c, width, height];
}
// Viridis colour map, five stops.
const STOPS = [[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]];
function heat(t) {
  const x = Math.min(Math.max(t, 0), 1) * (STOPS.length - 1), i = Math.min(Math.floor(x), STOPS.length - 2), f = x - i;
  return "rgb(" + STOPS[i].map((a, k) => Math.round(a + (STOPS[i + 1][k] - a) * f)).join() + ")";
}
/** Returns the number of rows and columns of the skin. */
const skin = () => { const n = view.frame.length, cols = view.cols || Math.ceil(Math.sqrt(n)) || 1; return [Math.ceil(n / cols) || 1, cols]; };
/** Returns the number of taxels per trace, and of rows and columns of traces. */
const layout = () => {
  const n = view.frame.length, lines = traces.length ? traces[0].length : n, together = Math.ceil(n / Math.max(lines, 1)) || 1;
  const [rows, columns] = skin();
  // A skin that is a long line is laid out as a square of traces.
  if (together === 1 && Math.max(rows, columns) <= 4 * Math.min(rows, columns)) return [1, rows, columns];
  const cols = Math.ceil(Math.sqrt(lines)); return [together, Math.ceil(lines / cols), cols];
};
function heatBox() {
  const [rows, cols] = skin(), w = el("heat").clientWidth, h = el("heat").clientHeight, side = Math.min(w / cols, h / rows);
  return { rows, cols, side, left: (w - side * cols) / 2, top: (h - side * rows) / 2 };
}
/** Returns the position of a reading on the scale, 0 to 1. */
const part = digit => (digit - low_) / (top_ - low_ || 1);
/** Formats a reading with decimals that match the scale. */
const number = digit => { const span = top_ - low_; return digit.toFixed(whole || span >= 100 ? 0 : span >= 10 ? 1 : 2); };
/** Sets the scale to round numbers around all readings so far; whole readings span at least 0 to 20. */
function chooseScale() {
  const { least, most } = view.range, step = 10 ** Math.floor(Math.log10(most - least || 1)) / 2;
  whole = view.range.whole;
  low_ = Math.floor(least / step) * step;
  top_ = Math.max(Math.ceil(most / step) * step, whole && low_ === 0 ? 20 : low_ + step);
  set("scale-low", number(low_)); set("scale-high", number(top_));
}
function drawHeat() {
  const [c] = context(el("heat")), { cols, side, left, top } = heatBox(), gap = side > 6 ? 1 : 0;
  c.textAlign = "center"; c.textBaseline = "middle"; c.font = Math.max(9, Math.min(18, Math.round(side / 3.4))) + "px system-ui";
  view.frame.forEach((digit, i) => {
    const x = left + i % cols * side, y = top + Math.floor(i / cols) * side;
    const share = part(digit);
    c.fillStyle = heat(share); c.fillRect(x + gap, y + gap, side - 2 * gap, side - 2 * gap);
    const text = number(digit);
    if (side >= 24 && c.measureText(text).width <= side - 4) { c.fillStyle = share > .6 ? "#000" : "#fff"; c.fillText(text, x + side / 2, y + side / 2); }
  });
  if (chosen >= 0) {
    c.strokeStyle = color("--pick"); c.lineWidth = Math.max(2, Math.min(4, side / 8));
    c.strokeRect(left + chosen % cols * side + 1, top + Math.floor(chosen / cols) * side + 1, side - 2, side - 2);
  }
}
function drawTraces() {
  const [c, w, h] = context(el("traces")), [together, rows, cols] = layout(), cw = w / cols, ch = h / rows;
  const kept = Math.max(2, Math.round(SECONDS * view.trace_hz)), mark = chosen < 0 ? -1 : Math.floor(chosen / together);
  const lines = traces.length ? traces[0].length : 0, main = color("--main"), pick = color("--pick"), line = color("--line");
  for (let k = 0; k < lines; k++) {
    const x0 = k % cols * cw + 3, y0 = Math.floor(k / cols) * ch + 3, iw = cw - 6, ih = ch - 6, on = k === mark;
    c.strokeStyle = on ? pick : line; c.lineWidth = on ? 2 : 1; c.strokeRect(x0, y0, iw, ih);
    c.strokeStyle = on ? pick : main; c.globalAlpha = mark < 0 || on ? 1 : .45; c.lineWidth = on ? 2 : 1.2; c.beginPath();
    const from = kept - traces.length;
    traces.forEach((row, i) => c.lineTo(x0 + iw * (from + i) / (kept - 1), y0 + ih - 2 - (ih - 4) * Math.min(Math.max(part(row[k]), 0), 1)));
    c.stroke(); c.globalAlpha = 1;
  }
}
const place = i => { const [, cols] = skin(); return "row " + (Math.floor(i / cols) + 1) + ", column " + (i % cols + 1); };
function showChosen() {
  if (chosen < 0 || !view || chosen >= view.frame.length) return set("chosen", "Point at a sensor, tap it, or select one with the arrow keys.");
  const [together] = layout(), k = Math.floor(chosen / together), values = traces.map(row => row[k]);
  set("chosen", "Sensor in " + place(chosen) + ": now " + number(view.frame[chosen]) + ", " + (together > 1 ? "mean of " + together + " neighbours " : "")
    + "in these 3 seconds " + number(Math.min(...values)) + " to " + number(Math.max(...values)) + ".");
}
function choose(i) { if (i !== chosen) { chosen = i; draw(); } }
function draw() { if (view && view.frame.length) { drawHeat(); drawTraces(); showChosen(); } }
function underHeat(event) {
  if (!view) return -1;
  const { rows, cols, side, left, top } = heatBox(), x = Math.floor((event.offsetX - left) / side), y = Math.floor((event.offsetY - top) / side);
  return x >= 0 && y >= 0 && x < cols && y < rows && y * cols + x < view.frame.length ? y * cols + x : -1;
}
function underTraces(event) {
  if (!view) return -1;
  const [together, rows, cols] = layout(), x = Math.floor(event.offsetX * cols / el("traces").clientWidth), y = Math.floor(event.offsetY * rows / el("traces").clientHeight);
  const i = (y * cols + x) * together; return x < cols && i >= 0 && i < view.frame.length ? i : -1;
}
for (const [id, under] of [["heat", underHeat], ["traces", underTraces]]) {
  el(id).addEventListener("pointermove", event => choose(under(event)));
  el(id).addEventListener("pointerdown", event => choose(under(event)));
  el(id).addEventListener("pointerleave", event => { if (event.pointerType === "mouse") choose(-1); });
}
el("heat").addEventListener("keydown", event => {
  if (!view) return;
  const [, cols] = skin(), step = { ArrowLeft: -1, ArrowRight: 1, ArrowUp: -cols, ArrowDown: cols }[event.key];
  if (event.key === "Escape") choose(-1);
  if (!step) return;
  event.preventDefault();
  const next = chosen < 0 ? 0 : chosen + step;
  if (next >= 0 && next < view.frame.length) choose(next);
  el("chosen-said").textContent = el("chosen").textContent;
});

// ---- Robot and balls

const SVG = "http://www.w3.org/2000/svg";
/** Number of past positions drawn behind a ball. */
const TRAIL = 24;
let trail = [];
const shape = (tag, name, attributes) => { const made = document.createElementNS(SVG, tag); made.setAttribute("class", name); for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value); return made; };
const chain = (points, name, width) => shape("polyline", name, { points: points.map(([x, z]) => x.toFixed(3) + "," + (-z).toFixed(3)).join(" "), "stroke-width": width });
const ball = ([x, z], name) => shape("circle", "ball " + name, { cx: x, cy: -z, r: .0425 });
function showStage() {
  const { stage } = view;
  el("stage-card").hidden = !stage; document.body.classList.toggle("staged", Boolean(stage));
  if (!stage) return;
  trail = stage.balls.length ? trail.concat(stage.balls).slice(-TRAIL) : [];
  const held = stage.holds === null || !stage.arms[stage.holds] ? [] : [stage.arms[stage.holds][3]];
  const metres = [0, 1, 2, 3, 4, 5].map(metre => { const text = shape("text", "", { x: metre, y: .2 }); text.textContent = metre + " m"; return text; });
  const body = stage.body.length ? [chain(stage.body.slice(0, 4), "body", .2), chain(stage.body.slice(3), "body", .16)] : [];
  el("stage").replaceChildren(shape("path", "floor", { d: "M-0.7 0H5.7" }), ...metres, ...body,
    ...stage.arms.map((arm, i) => chain(arm, i ? "arm" : "arm far", .09)),
    ...trail.slice(0, -stage.balls.length || undefined).map(place => ball(place, "was")), ...stage.balls.map(place => ball(place, "")), ...held.map(place => ball(place, "")));
  set("stage-about", "The robot " + stage.about + ".");
  set("stage-score", stage.caught + " of " + stage.thrown);
  set("stage-felt", stage.felt ? stage.right + " of " + stage.felt + " felt right" : "");
  set("stage-last", stage.last);
}

// ---- Views

function show() {
  chooseScale();
  set("trace-title", "The same sensors over the last " + SECONDS + " seconds, each from " + number(low_) + " to " + number(top_));
  document.body.style.setProperty("--shape", skin()[1] + " / " + skin()[0]);
  showStage(); showUnlike(); showAnswer(); showScore(); showEvents(); showCounters(); showAge(); draw();
}
const source = new EventSource("events");
source.onmessage = message => {
  const next = JSON.parse(message.data);
  if (!next.frame) return;
  view = next; came = performance.now(); connected = true;
  traces = traces.length && traces[0].length !== (view.trace[0] || traces[0]).length ? view.trace : traces.concat(view.trace);
  traces = traces.slice(-Math.max(2, Math.round(SECONDS * view.trace_hz)));
  if (!pending) { pending = true; requestAnimationFrame(() => { pending = false; show(); }); }
};
source.onerror = () => { connected = false; showAge(); };
setInterval(showAge, 500);
addEventListener("resize", draw);
el("reset").onclick = () => fetch("reset", { method: "POST", headers: { "x-tactnet": "1" } });
