// The page: bands of the states, peers, what is wrong.

import { draw, shownBounds } from "./chart.js";
import { firstStep, History } from "./history.js";
import { keep, showEvent, showLevel, showPeers, showProblems } from "./peers.js";
import { Stream } from "./stream.js";

const SHOWN_AT_FIRST = 4;
const COLOURS = 8;
const $ = (id) => document.getElementById(id);
const page = { model: null, health: null, history: new History(), isLost: false, isHeld: false, dirty: false };
const isDark = matchMedia("(prefers-color-scheme: dark)");

// -- what there is to draw

async function loadModel() {
  try {
    const answer = await fetch("model");
    if (answer.ok) setModel(await answer.json());
  } catch {
    // the stream tells that the gateway is gone, and opens again
  }
}

function setModel(model) {
  const shape = (one) => one && JSON.stringify([one.mesh, one.states, one.units, one.estimators]);
  if (shape(model) === shape(page.model)) return;
  page.model = model;
  page.history = new History();
  document.title = `${model.mesh} · lsu-mesh`;
  $("mesh").textContent = model.mesh;
  const states = model.states.map((name, i) => ({ name, unit: model.units[i], index: i }));
  const estimators = model.estimators.map((one, i) => ({ ...one, colour: i % COLOURS }));
  showOptions($("estimators"), estimators, "estimator");
  showOptions($("states"), states, "state");
  showCharts();
}

function showOptions(parent, values, kind) {
  const saved = remembered(kind);
  parent.replaceChildren();
  values.forEach((value, i) => {
    const label = document.createElement("label");
    const box = document.createElement("input");
    box.type = "checkbox";
    box.name = kind;
    box.value = value.name;
    box.checked = saved ? saved.includes(value.name) : i < SHOWN_AT_FIRST;
    label.append(box);
    if (kind === "estimator") label.append(swatch(value.colour));
    label.append(value.name);
    if (value.kind) label.title = value.kind;
    parent.append(label);
  });
}

function swatch(colour) {
  const found = document.createElement("span");
  found.className = "swatch";
  found.dataset.colour = colour;
  found.style.background = `var(--series-${colour})`;
  return found;
}

function chosen(kind) {
  return [...document.querySelectorAll(`input[name=${kind}]:checked`)].map((box) => box.value);
}

// What was chosen before, if this browser keeps it.
function remembered(kind) {
  try {
    return JSON.parse(localStorage.getItem(`lsu ${page.model.mesh} ${kind}`));
  } catch {
    return null;
  }
}

function remember(kind) {
  try {
    localStorage.setItem(`lsu ${page.model.mesh} ${kind}`, JSON.stringify(chosen(kind)));
  } catch {
    // a browser that keeps nothing shows the first ones again
  }
}

// -- charts

function showCharts() {
  const wanted = chosen("state");
  const states = page.model.states.map((name, index) => ({ name, index, unit: page.model.units[index] }));
  keep($("charts"), states.filter((one) => wanted.includes(one.name)), (one) => one.name, newChart, () => {});
  page.dirty = true;
}

function newChart(state) {
  const figure = document.createElement("figure");
  figure.dataset.state = state.name;
  figure.dataset.index = state.index;
  figure.innerHTML =
    '<figcaption><h2></h2><div class="values"></div></figcaption><canvas role="img"></canvas>';
  const title = figure.querySelector("h2");
  title.textContent = state.name;
  if (state.unit) {
    const unit = document.createElement("span");
    unit.className = "unit";
    unit.textContent = ` in ${state.unit}`;
    title.append(unit);
  }
  resized.observe(figure.querySelector("canvas"));
  return figure;
}

const resized = new ResizeObserver(() => (page.dirty = true));

function render() {
  requestAnimationFrame(render);
  if (!page.dirty || !page.model) return;
  page.dirty = false;
  const styles = getComputedStyle(document.documentElement);
  const colour = (i) => styles.getPropertyValue(`--series-${i % COLOURS}`).trim();
  const names = chosen("estimator");
  const to = page.history.newestStep(names);
  const series = page.model.estimators
    .map((one, i) => ({ name: one.name, number: i, colour: colour(i), points: page.history.of(one.name) }))
    .filter((one) => names.includes(one.name));
  const from = firstStep(series, to, Number($("window").value));
  const style = { quiet: styles.getPropertyValue("--quiet"), grid: styles.getPropertyValue("--grid") };
  for (const figure of $("charts").children) {
    const state = Number(figure.dataset.index);
    const canvas = figure.querySelector("canvas");
    if (!page.isHeld) draw(canvas, { series, state, from, to, style });
    showValues(figure, series, state);
  }
}

// The numbers of the newest bands, for those who do not see the drawing and for copying.
function showValues(figure, series, state) {
  const withData = series.filter((one) => one.points.length);
  keep(figure.querySelector(".values"), withData, (one) => one.name, newValue, (line, one) => {
    const newest = one.points.at(-1);
    const bounds = shownBounds(newest.lower[state], newest.upper[state]);
    line.dataset.step = newest.step;
    line.querySelector("b").textContent = bounds;
    line.querySelector("i").textContent = newest.status === "ok" ? "" : ` ${newest.status}`;
    line.classList.toggle("faded", page.isLost || isGone(one.name));
  });
  const words = withData.map((one) => {
    const newest = one.points.at(-1);
    return `${one.name}: ${shownBounds(newest.lower[state], newest.upper[state])}`;
  });
  figure.querySelector("canvas").setAttribute("aria-label", `Bands of ${figure.dataset.state}. ${words.join("; ")}`);
}

function newValue(one) {
  const line = document.createElement("span");
  line.dataset.estimator = one.name;
  line.append(swatch(one.number % COLOURS), ` ${one.name} `, document.createElement("b"), document.createElement("i"));
  return line;
}

function isGone(name) {
  return page.health?.peers.some((peer) => peer.name === name && peer.level === "STALE");
}

// -- what comes

function hear(kind, value, id) {
  if (kind === "estimate") {
    page.history.add(value);
  } else if (kind === "event") {
    showEvent($("events"), value, id);
  } else {
    page.health = value;
    showHealth();
  }
  page.dirty = true;
}

function showHealth() {
  const health = page.health;
  if (health) {
    showLevel($("level"), page.isLost ? "UNKNOWN" : health.level);
    showPeers($("peers").tBodies[0], health.peers);
  }
  $("peers").classList.toggle("faded", page.isLost);
  showProblems($("problem-list"), health, page.isLost);
}

function tell(state) {
  const isLost = state === "lost";
  const words = { live: "live", lost: "lost the gateway, trying again", connecting: "connecting to the gateway" };
  if ($("connection").dataset.state !== state) {
    $("connection").dataset.state = state;
    $("connection").textContent = words[state];
  }
  if (page.isLost !== isLost) {
    page.isLost = isLost;
    showHealth();
    page.dirty = true;
  }
}

$("choices").addEventListener("change", (event) => {
  if (event.target.name) remember(event.target.name);
  if (page.model) showCharts();
});
$("choices").addEventListener("submit", (event) => event.preventDefault());
$("hold").addEventListener("click", () => {
  page.isHeld = !page.isHeld;
  $("hold").setAttribute("aria-pressed", String(page.isHeld));
  page.dirty = true;
});
isDark.addEventListener("change", () => (page.dirty = true));
loadModel();
new Stream("live", { hear, tell, opened: loadModel });
render();
