// A small plot on a canvas: lines over time, a y axis with round figures, dashed limit lines.

import { decimate } from "/assets/history.js";

const LEFT_PX = 38;
const MOST_POINTS = 600;
const FONT = '11px -apple-system, "Segoe UI", Roboto, "Helvetica Neue", "Liberation Sans", Arial, sans-serif';

const palette = new Map();

/** A colour of the style sheet as the canvas can take it. */
function colour(name) {
  if (!palette.has(name)) {
    const probe = document.createElement("i");
    probe.style.color = `var(--${name})`;
    document.body.append(probe);
    palette.set(name, getComputedStyle(probe).color);
    probe.remove();
  }
  return palette.get(name);
}

/** Forget the colours: the theme has changed. */
export const forgetColours = () => palette.clear();

/** The smallest of 1, 2, 5 times a power of ten that is not below `value`. */
export function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  const share = value / power;
  const step = share <= 1.0001 ? 1 : share <= 2.0001 ? 2 : share <= 5.0001 ? 5 : 10;
  return step * power;
}

/** Fit the drawing surface to the element; returns the context and its size in CSS pixels. */
function surface(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = FONT;
  return { context, width, height };
}

/** Step of the time grid for a window in seconds. */
const timeStep = (window_s) => (window_s <= 10 ? 2 : window_s <= 20 ? 5 : 10);

export class Plot {
  /**
   * `spec`: lines, and floor (least top of the y axis) or span(low, high, marks) ([low, high]).
   * A line: key, word (colour), and where wanted a name at its end, dashed, and bounded: whether
   * `${key} lower` and `${key} upper` of the history are the bounds that it moves between.
   */
  constructor(canvas, spec) {
    this.canvas = canvas;
    this.spec = spec;
  }

  /**
   * Draw [end_s - window_s, end_s] of the history; `lines`: those of the spec that there are; `marks`:
   * [{value, label, kind}] with kind "limit" or "reference"; `cursor_s`: time under the pointer, or null.
   */
  draw({ history, end_s, window_s, cursor_s }, lines, marks) {
    const { context, width, height } = surface(this.canvas);
    if (width === 0) return;
    const from = history.place(end_s - window_s);
    const to = history.place(end_s + 1e-9);
    const [low, high] = this.#range(lines.map(({ key }) => history.columns[key]), from, to, marks);
    const area = { left: LEFT_PX, right: width - 1, top: 5, bottom: height - 5 };
    const x = (time) => area.right - ((end_s - time) / window_s) * (area.right - area.left);
    const y = (value) => area.bottom - ((value - low) / (high - low)) * (area.bottom - area.top);
    drawGrid(context, area, { window_s, low, high, y });
    for (const mark of marks) if (mark.value <= high) drawMark(context, area, mark, y(mark.value));
    const first = Math.max(history.start, from - 1);
    const traces = lines.map((line) => ({ line, places: decimate(history.columns[line.key], first, to, MOST_POINTS) }));
    inside(context, area, () => {
      for (const { line, places } of traces) if (line.bounded) drawBounds(context, history, line, places, x, y);
      for (const { line, places } of traces) drawTrace(context, history, line, places, x, y);
    });
    traces.forEach(({ line }, index) => nameTrace(context, area, line, y(history.columns[line.key][to - 1]), index));
    for (const mark of marks) labelMark(context, area, mark, mark.value <= high ? y(mark.value) : null);
    if (cursor_s !== null) drawCursor(context, area, x(cursor_s));
  }

  #range(columns, from, to, marks) {
    let high = -Infinity;
    let low = Infinity;
    for (const column of columns) {
      for (let place = from; place < to; place += 1) {
        if (column[place] > high) high = column[place];
        if (column[place] < low) low = column[place];
      }
    }
    const [floor, top] = high < low ? [0, 0] : [low, high];
    if (!this.spec.span) return [0, roundUp(Math.max(this.spec.floor, top * 1.05))];
    const [least, most] = this.spec.span(floor, top, marks);
    return [Math.min(least, floor), most];
  }
}

/** Draw within the area only. */
function inside(context, area, draw) {
  context.save();
  context.beginPath();
  context.rect(area.left, area.top - 2, area.right - area.left + 1, area.bottom - area.top + 4);
  context.clip();
  draw();
  context.restore();
}

/** Add a column to the present path; what is no number breaks the line. */
function follow(context, column, time, places, x, y) {
  let broken = true;
  for (const place of places) {
    if (Number.isNaN(column[place])) broken = true;
    else if (broken) {
      context.moveTo(x(time[place]), y(column[place]));
      broken = false;
    } else context.lineTo(x(time[place]), y(column[place]));
  }
}

function drawTrace(context, { columns, time }, { key, word, dashed }, places, x, y) {
  context.beginPath();
  follow(context, columns[key], time, places, x, y);
  context.strokeStyle = colour(word);
  context.lineWidth = 1.6;
  context.lineJoin = "round";
  context.setLineDash(dashed ? [5, 3] : []);
  context.stroke();
}

function drawBounds(context, { columns, time }, { key, word }, places, x, y) {
  context.strokeStyle = colour(word);
  context.lineWidth = 1;
  context.setLineDash([1.5, 2.5]);
  for (const side of ["lower", "upper"]) {
    context.beginPath();
    follow(context, columns[`${key} ${side}`], time, places, x, y);
    context.stroke();
  }
}

/** The name of a line at its end; lines that meet have their names side by side. */
function nameTrace(context, area, { name, word }, y, index) {
  if (!name || !Number.isFinite(y)) return;
  const place = [area.right - 3 - 12 * index, Math.min(area.bottom - 1, Math.max(area.top + 9, y - 2))];
  context.textAlign = "right";
  context.textBaseline = "bottom";
  halo(context, name, place, colour(word));
}

/** Text on a halo of the background. */
function halo(context, text, place, ink) {
  context.lineWidth = 3;
  context.lineJoin = "round";
  context.strokeStyle = colour("panel");
  context.strokeText(text, ...place);
  context.fillStyle = ink;
  context.fillText(text, ...place);
}

function drawGrid(context, area, { window_s, low, high, y }) {
  context.strokeStyle = colour("grid");
  context.lineWidth = 1;
  context.beginPath();
  for (let back = 0; back <= window_s; back += timeStep(window_s)) {
    const place = Math.round(area.right - (back / window_s) * (area.right - area.left)) + 0.5;
    context.moveTo(place, area.top);
    context.lineTo(place, area.bottom);
  }
  const ticks = [low, (low + high) / 2, high];
  for (const tick of ticks) {
    context.moveTo(area.left, Math.round(y(tick)) + 0.5);
    context.lineTo(area.right, Math.round(y(tick)) + 0.5);
  }
  context.stroke();
  context.fillStyle = colour("muted");
  context.textAlign = "right";
  context.textBaseline = "middle";
  const crowded = area.bottom - area.top < 40;
  for (const tick of crowded ? [low, high] : ticks) {
    const place = Math.min(area.bottom - 1, Math.max(area.top + 1, y(tick)));
    context.fillText(tickText(tick, high - low), area.left - 5, place);
  }
}

function tickText(value, span) {
  let places = 0;
  while (places < 5 && Math.abs(Number(value.toFixed(places)) - value) > 1e-6 * span) places += 1;
  return value.toFixed(places).replace("-", "\u2212");
}

function drawMark(context, area, { kind }, y) {
  const place = Math.round(y) + 0.5;
  context.save();
  context.strokeStyle = colour(kind === "limit" ? "limit" : "muted");
  context.lineWidth = 1;
  context.setLineDash(kind === "limit" ? [6, 3] : [1.5, 3]);
  context.beginPath();
  context.moveTo(area.left, place);
  context.lineTo(area.right, place);
  context.stroke();
  context.restore();
}

/** The label stands on its line, inside the area; one above the area has an arrow instead. */
function labelMark(context, area, { kind, label }, y) {
  const above = y !== null && y - 12 > area.top - 4;
  context.textAlign = "left";
  context.textBaseline = above ? "bottom" : "top";
  // A reference stands further in, where it cannot meet the label of a limit close by.
  const place = [area.left + (kind === "limit" ? 4 : 76), y === null ? area.top - 2 : above ? y - 1 : y + 2];
  halo(context, y === null ? `\u2191 ${label}` : label, place, colour(kind === "limit" ? "limit" : "muted"));
}

function drawCursor(context, area, x) {
  if (x < area.left || x > area.right) return;
  context.strokeStyle = colour("ink");
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(Math.round(x) + 0.5, area.top);
  context.lineTo(Math.round(x) + 0.5, area.bottom);
  context.stroke();
}

/** Time under a pointer at `offset_px` from the canvas's left edge. */
export function timeAt(canvas, offset_px, end_s, window_s) {
  const share = (canvas.clientWidth - 1 - offset_px) / (canvas.clientWidth - 1 - LEFT_PX);
  return end_s - Math.min(1, Math.max(0, share)) * window_s;
}

/** The time axis that all plots share: seconds before now. */
export function drawTimeAxis(canvas, window_s) {
  const { context, width, height } = surface(canvas);
  context.fillStyle = colour("muted");
  context.textBaseline = "middle";
  for (let back = window_s; back >= 0; back -= timeStep(window_s)) {
    const place = width - 1 - (back / window_s) * (width - 1 - LEFT_PX);
    context.textAlign = back === 0 ? "right" : "center";
    context.fillText(back === 0 ? "0" : `\u2212${back}`, place, height / 2);
  }
  context.textAlign = "left";
  context.fillText("s", 4, height / 2);
}
