// The plots of the monitor, their readings, the time window, freeze and the shared cursor.

import { byId, make, setData, setHidden, setText } from "/assets/dom.js";
import { fixed } from "/assets/format.js";
import { History } from "/assets/history.js";
import { Plot, drawTimeAxis, forgetColours, timeAt } from "/assets/plots.js";
import { onTheme } from "/assets/theme.js";

const DRAW_MS = 100;
const NEAR_S = 0.5;
const CURSOR_KEYS = { ArrowLeft: -0.1, ArrowRight: 0.1 };

export class Traces {
  /**
   * `plots`: key, title, unit, text(value), peak(low, high) where not the greatest, share (of the
   * usual height), marks(state), present(state) where it is not always there, and what a Plot takes.
   * Of each line beside: read(state); bounds: [read, read]; tip; label, its name where it has none at its
   * end. A line's word may be "source": that
   * which errors are measured against.
   */
  constructor(plots) {
    const lines = plots.flatMap((plot) => plot.lines);
    this.reads = lines.flatMap(readsOf);
    this.live = new History(this.reads.map(([key]) => key));
    this.frozen = null;
    this.window_s = 20;
    this.cursor_s = null;
    this.state = null;
    this.drawn = 0;
    this.views = plots.map((spec) => this.#build(spec));
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
    title.append(`${spec.title} `, make("span", "unit", spec.unit));
    const single = spec.lines.length === 1;
    const peak = make("span", "plot-peak", "", { id: `max-${spec.key}` });
    const lines = spec.lines.map((line) => {
      const swatch = make("i", "swatch");
      setData(swatch, "dashed", String(line.dashed === true));
      const now = make("span", "plot-now", "–", { id: `now-${line.key}` });
      const reading = make("span", "plot-reading");
      if (single) title.prepend(swatch);
      else reading.append(swatch, `${line.label ?? line.name} `);
      reading.append(now);
      if (line.tip) reading.dataset.tip = line.tip;
      return { line: { ...line, bounded: line.bounds !== undefined }, swatch, now, reading };
    });
    head.append(title, ...(single ? [peak] : []), ...lines.map(({ reading }) => reading));
    const canvas = make("canvas", "", "", { role: "img", tabindex: "0", id: `plot-${spec.key}` });
    canvas.style.setProperty("--share", spec.share ?? 1);
    canvas.setAttribute("aria-label", `${spec.title} in ${spec.unit} over time`);
    root.append(head, canvas);
    byId("plots").append(root);
    this.#startCursor(canvas);
    return { spec, root, lines, peak, canvas, plot: new Plot(canvas, spec) };
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
    this.live.push(state.time_s, Object.fromEntries(this.reads.map(([key, read]) => [key, read(state)])));
    if (performance.now() - this.drawn >= DRAW_MS) this.draw();
  }

  draw() {
    this.drawn = performance.now();
    if (this.state === null || document.hidden) return;
    const source = this.state.errors.source;
    const back_s = this.cursor_s === null ? null : this.#end() - this.cursor_s;
    setText(byId("error-source"), back_s === null ? `desired − ${source}` : `at −${fixed(back_s, 1)} s`);
    const view = { history: this.frozen ?? this.live, end_s: this.#end(), window_s: this.window_s, cursor_s: this.cursor_s };
    for (const { spec, lines, peak, plot } of this.#shown()) {
      const present = lines.filter(({ line }) => line.read(this.state) !== undefined);
      const coloured = present.map(({ line }) => ({ ...line, word: line.word === "source" ? source : line.word }));
      plot.draw(view, coloured, spec.marks?.(this.state) ?? []);
      present.forEach(({ swatch }, index) => setData(swatch, "word", coloured[index].word));
      for (const one of lines) {
        setHidden(one.reading, !present.includes(one));
        this.#read(spec, one, view, peak);
      }
    }
    drawTimeAxis(this.axis, this.window_s);
  }

  /** The plots that there are in the present state; the others are hidden. */
  #shown() {
    const shown = this.views.filter(({ spec }) => spec.present?.(this.state) ?? true);
    for (const view of this.views) setHidden(view.root, !shown.includes(view));
    byId("plots").style.setProperty("--plots", shown.length);
    return shown;
  }

  /** The value now, or under the cursor, and the greatest (and least) of the window. */
  #read(spec, { line, now }, { history, end_s, window_s, cursor_s }, peak) {
    const column = history.columns[line.key];
    setText(now, spec.text(column[placeOf(history, cursor_s)]));
    if (spec.lines.length > 1) return;
    let high = -Infinity;
    let low = Infinity;
    for (let place = history.place(end_s - window_s); place < history.end; place += 1) {
      high = Math.max(high, Number.isNaN(column[place]) ? high : column[place]);
      low = Math.min(low, Number.isNaN(column[place]) ? low : column[place]);
    }
    setText(peak, spec.peak ? spec.peak(low, high) : `max ${spec.text(high)}`);
  }
}

/** What is remembered of a line: [key, read] of the line, and of its bounds. */
function readsOf({ key, read, bounds }) {
  const ends = bounds ? [[`${key} lower`, bounds[0]], [`${key} upper`, bounds[1]]] : [];
  return [[key, read], ...ends];
}

/** Place of the sample under the cursor; beyond the history's ends there is none. */
function placeOf(history, cursor_s) {
  if (cursor_s === null) return history.end - 1;
  const place = history.place(cursor_s);
  return history.time[place] - cursor_s < NEAR_S ? place : -1;
}
