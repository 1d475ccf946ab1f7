// Draws the bands of one state on a canvas: lower to upper bound, and the point.

import { runs } from "./history.js";

const LEFT = 62;
const BOTTOM = 24;
const TOP = 8;
const RIGHT = 10;

export function draw(canvas, { series, state, from, to, style }) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width || !height) return;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  pen.clearRect(0, 0, width, height);
  const parts = series.map((one) => ({ ...one, runs: runs(one.points, from, to) }));
  const range = extent(parts, state);
  const x = (step) => LEFT + ((step - from) / Math.max(1, to - from)) * (width - LEFT - RIGHT);
  const y = (value) => TOP + ((range.high - value) / (range.high - range.low)) * (height - TOP - BOTTOM);
  drawAxes(pen, { x, y, from, to, range, width, height, style });
  pen.save();
  pen.beginPath();
  pen.rect(LEFT, TOP, width - LEFT - RIGHT, height - TOP - BOTTOM);
  pen.clip();
  for (const part of parts) for (const run of part.runs) drawRun(pen, run, { x, y, state, colour: part.colour });
  pen.restore();
}

function extent(parts, state) {
  let low = Infinity;
  let high = -Infinity;
  for (const part of parts)
    for (const run of part.runs)
      for (const one of run) {
        low = Math.min(low, one.lower[state], one.point[state]);
        high = Math.max(high, one.upper[state], one.point[state]);
      }
  if (!(low <= high)) return { low: -1, high: 1 };
  const room = 0.06 * (high - low) || Math.max(1e-9, 0.05 * Math.abs(high));
  return { low: low - room, high: high + room };
}

function drawRun(pen, run, { x, y, state, colour }) {
  if (run.length === 1) run = [run[0], { ...run[0], step: run[0].step + 1 }];
  pen.beginPath();
  run.forEach((one, i) => pen[i ? "lineTo" : "moveTo"](x(one.step), y(one.upper[state])));
  for (const one of [...run].reverse()) pen.lineTo(x(one.step), y(one.lower[state]));
  pen.closePath();
  pen.fillStyle = colour;
  pen.globalAlpha = 0.16;
  pen.fill();
  pen.globalAlpha = 1;
  pen.strokeStyle = colour;
  for (const [values, thickness] of [["lower", 1], ["upper", 1], ["point", 1.75]]) {
    pen.lineWidth = thickness;
    pen.beginPath();
    run.forEach((one, i) => pen[i ? "lineTo" : "moveTo"](x(one.step), y(one[values][state])));
    pen.stroke();
  }
}

function drawAxes(pen, { x, y, from, to, range, width, height, style }) {
  pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  pen.lineWidth = 1;
  pen.fillStyle = style.quiet;
  pen.strokeStyle = style.grid;
  pen.textAlign = "right";
  pen.textBaseline = "middle";
  for (const value of ticks(range.low, range.high, 4)) {
    line(pen, LEFT, y(value), width - RIGHT, y(value));
    pen.fillText(shown(value), LEFT - 6, y(value));
  }
  pen.textBaseline = "top";
  for (const step of ticks(from, to, Math.max(2, Math.floor(width / 130)))) {
    const at = x(step);
    line(pen, at, TOP, at, height - BOTTOM);
    pen.textAlign = at > width - 45 ? "right" : "center";
    pen.fillText(step.toLocaleString("en"), Math.min(at, width - RIGHT), height - BOTTOM + 6);
  }
}

function line(pen, x0, y0, x1, y1) {
  pen.beginPath();
  pen.moveTo(x0, y0);
  pen.lineTo(x1, y1);
  pen.stroke();
}

// About `count` round numbers in a range.
export function ticks(low, high, count) {
  const raw = (high - low) / count;
  const size = 10 ** Math.floor(Math.log10(raw));
  const step = size * ([1, 2, 5, 10].find((one) => one * size >= raw) ?? 10);
  const found = [];
  for (let k = Math.ceil(low / step); k * step <= high; k++) found.push(k * step);
  return found;
}

export function shown(value) {
  if (value === 0) return "0";
  const text = Math.abs(value) >= 1e5 || Math.abs(value) < 1e-3 ? value.toExponential(2) : String(+value.toPrecision(4));
  return text.replace("-", "−");
}

// Bounds in few digits, rounded outward: what is shown holds the band.
export function shownBounds(lower, upper) {
  const width = upper - lower || Math.abs(upper) || 1;
  const places = Math.min(12, Math.max(0, 2 - Math.floor(Math.log10(width))));
  const scale = 10 ** places;
  if (Math.max(Math.abs(lower), Math.abs(upper)) * scale > 1e15) return `${lower} … ${upper}`;
  const text = (value) => value.toFixed(places).replace("-", "−");
  return `${text(Math.floor(lower * scale) / scale)} … ${text(Math.ceil(upper * scale) / scale)}`;
}
