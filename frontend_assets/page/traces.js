// The five plots of the monitor, their readings, the time window, freeze and the shared cursor.

import { byId, make, setText } from "/assets/dom.js";
import { figure, fine, fixed } from "/assets/format.js";
import { History } from "/assets/history.js";
import { Plot, drawTimeAxis, forgetColours, timeAt } from "/assets/plots.js";
import { onTheme } from "/assets/theme.js";

const LAMBDA = "λ at the trocar";

/** `floor`: least top of the y axis, so that numerical noise does not fill the plot. */
const TRACES = [
  { key: "position", title: "Position error", unit: "mm", floor: 0.01, text: figure },
  { key: "orientation", title: "Orientation error", unit: "deg", floor: 0.01, text: figure },
  { key: "rcm", title: "RCM error", unit: "mm", floor: 0.01, text: fine },
  { key: "lambda", title: LAMBDA, unit: "0–1", word: "commanded", span: () => [0, 1], text: (value) => fixed(value, 3), both: true },
  { key: "bend", title: "Bend", unit: "deg", word: "commanded", span: bendSpan, text: (value) => fixed(value, 1) },
];

/** Room above the limit, in steps of 30 degrees. */
function bendSpan(lines) {
  return [0, Math.ceil((lines[0].value * 1.1) / 30) * 30];
}

const DRAW_MS = 100;
const NEAR_S = 0.5;
const CURSOR_KEYS = { ArrowLeft: -0.1, ArrowRight: 0.1 };

export class Traces {
  constructor() {
    this.live = new History(TRACES.map(({ key }) => key));
    this.frozen = null;
    this.window_s = 20;
    this.cursor_s = null;
    this.state = null;
    this.drawn = 0;
    this.views = TRACES.map((spec) => this.#build(spec));
    this.axis = make("canvas", "plot-axis", "", { role: "img", "aria-label": "Time axis: seconds before now" });
    byId("plots").append(this.axis);
    for (const input of document.querySelectorAll('input[name="window"]')) {
      input.addEventListener("change", () => this.#setWindow(Number(input.value)));
    }
    byId("freeze").addEventListener("click", () => this.#freeze());
    onTheme(() => {
      forgetColours();
      this.draw();
    });
    new ResizeObserver(() => this.draw()).observe(byId("plots"));
  }

  #build(spec) {
    const root = make("div", "plot");
    const head = make("div", "plot-head");
    const title = make("span", "plot-title");
    const swatch = make("i", "swatch");
    swatch.dataset.word = spec.word ?? "true";
    title.append(swatch, `${spec.title} `, make("span", "unit", spec.unit));
    const now = make("span", "plot-now", "–", { id: `now-${spec.key}` });
    const peak = make("span", "plot-peak", "", { id: `max-${spec.key}` });
    head.append(title, peak, now);
    const canvas = make("canvas", "", "", { role: "img", tabindex: "0", id: `plot-${spec.key}` });
    canvas.setAttribute("aria-label", `${spec.title} in ${spec.unit} over time`);
    root.append(head, canvas);
    byId("plots").append(root);
    this.#startCursor(canvas);
    return { spec, swatch, now, peak, canvas, plot: new Plot(canvas, { word: "true", ...spec }) };
  }

  #startCursor(canvas) {
    const move = (time_s) => {
      this.cursor_s = time_s;
      this.draw();
    };
    canvas.addEventListener("pointermove", (event) => move(timeAt(canvas, event.offsetX, this.#end(), this.window_s)));
    canvas.addEventListener("pointerleave", () => move(null));
    canvas.addEventListener("blur", () => move(null));
    canvas.addEventListener("keydown", (event) => {
      if (!(event.key in CURSOR_KEYS)) return;
      event.preventDefault();
      const end = this.#end();
      const next = (this.cursor_s ?? end) + CURSOR_KEYS[event.key] * (this.window_s / 10);
      move(Math.min(end, Math.max(end - this.window_s, next)));
    });
  }

  #setWindow(window_s) {
    this.window_s = window_s;
    this.draw();
  }

  #freeze() {
    this.frozen = this.frozen ? null : this.live.copy();
    byId("freeze").setAttribute("aria-pressed", String(this.frozen !== null));
    setText(byId("freeze").firstElementChild, this.frozen ? "Frozen" : "Freeze");
    this.draw();
  }

  #end() {
    return (this.frozen ?? this.live).newest;
  }

  /** Remember a state; draws at most ten times a second. */
  take(state) {
    this.state = state;
    this.live.push(state.time_s, {
      position: state.errors.position_mm,
      orientation: state.errors.orientation_deg,
      rcm: state.errors.rcm_mm,
      lambda: state.lambda.value,
      bend: state.bend_deg,
    });
    if (performance.now() - this.drawn >= DRAW_MS) this.draw();
  }

  draw() {
    this.drawn = performance.now();
    if (this.state === null || document.hidden) return;
    const source = this.state.errors.source;
    const back_s = this.cursor_s === null ? null : this.#end() - this.cursor_s;
    setText(byId("error-source"), back_s === null ? `desired − ${source}` : `at −${fixed(back_s, 1)} s`);
    const view = { history: this.frozen ?? this.live, end_s: this.#end(), window_s: this.window_s, cursor_s: this.cursor_s };
    for (const { spec, swatch, now, peak, plot } of this.views) {
      if (!spec.word) {
        plot.spec.word = source;
        swatch.dataset.word = source;
      }
      plot.draw(view, this.#lines(spec.key));
      this.#read(spec, view, now, peak);
    }
    drawTimeAxis(this.axis, this.window_s);
  }

  #lines(key) {
    const { lambda, bend_limit_deg } = this.state;
    if (key === "bend") return [{ value: bend_limit_deg, label: `limit ${fixed(bend_limit_deg, 0)}°`, kind: "limit" }];
    if (key !== "lambda") return [];
    return [
      { value: lambda.max, label: `limit ${lambda.max}`, kind: "limit" },
      { value: lambda.min, label: `limit ${lambda.min}`, kind: "limit" },
      { value: lambda.reference, label: `reference ${lambda.reference}`, kind: "reference" },
    ];
  }

  /** The value now, or under the cursor, and the greatest (and least) of the window. */
  #read(spec, { history, end_s, window_s, cursor_s }, now, peak) {
    const column = history.columns[spec.key];
    const from = history.place(end_s - window_s);
    let high = -Infinity;
    let low = Infinity;
    for (let place = from; place < history.end; place += 1) {
      high = Math.max(high, Number.isNaN(column[place]) ? high : column[place]);
      low = Math.min(low, Number.isNaN(column[place]) ? low : column[place]);
    }
    setText(now, spec.text(column[placeOf(history, cursor_s)]));
    setText(peak, spec.both ? `${fixed(low, 2)} … ${fixed(high, 2)}` : `max ${spec.text(high)}`);
  }
}

/** Place of the sample under the cursor; beyond the history's ends there is none. */
function placeOf(history, cursor_s) {
  if (cursor_s === null) return history.end - 1;
  const place = history.place(cursor_s);
  return history.time[place] - cursor_s < NEAR_S ? place : -1;
}
