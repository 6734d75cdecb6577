// The numbers below the plots: where the tips are, active limits in words, and the robot's own.

import { byId, make, setData, setHidden, setText } from "/assets/dom.js";
import { fixed } from "/assets/format.js";
import { title } from "/assets/number_bars.js";

const WORDS = [
  ["desired", "Desired"],
  ["commanded", "Commanded"],
  ["estimated", "Estimated"],
  ["true", "True"],
];

export class Numbers {
  /**
   * `tips`: {key, title, read(state, word)} of each tip that is shown, undefined of a word that it
   * does not have; `own`: shows the robot's own numbers in two columns.
   */
  constructor(tips, own) {
    this.tips = tips.map((tip) => ({ ...tip, rows: buildTip(tip) }));
    this.own = own;
    this.limits = make("div", "limits-words", "", { id: "limits", role: "group", "aria-label": "Active limits" });
    this.columns = make("div", "columns");
    byId("numbers").append(this.limits, this.columns);
  }

  show(state) {
    for (const tip of this.tips) showTip(tip, state);
    this.#showLimits(state.limits);
    this.own.show(state, this.columns);
  }

  #showLimits(limits) {
    const words = limits.join("\n");
    if (this.limits.dataset.words === words) return;
    this.limits.dataset.words = words;
    const tags = limits.length ? limits.map((limit) => make("span", "limit-tag", limit)) : [make("span", "", "none")];
    this.limits.replaceChildren(title("Active limits", ""), ...tags);
  }
}

function buildTip({ key, title: heading }) {
  const table = make("table", "tip");
  const head = table.createTHead().insertRow();
  for (const words of [heading, "x", "y", "z"]) head.append(make("th", "", words, { scope: "col" }));
  const rows = new Map();
  for (const [word, name] of WORDS) {
    const row = table.createTBody().insertRow();
    const cell = make("th", "", "", { scope: "row" });
    const swatch = make("i", "swatch");
    swatch.dataset.word = word;
    swatch.dataset.dashed = String(word === "estimated");
    const shown = make("span", "", name);
    cell.append(swatch, shown);
    row.append(cell);
    const cells = ["x", "y", "z"].map((axis) => make("td", "", "–", { id: `${key}-${word}-${axis}` }));
    row.append(...cells);
    rows.set(word, { row, cells, shown, swatch });
  }
  byId("numbers").append(table);
  return rows;
}

function showTip({ rows, read }, state) {
  for (const [word] of WORDS) {
    const { row, cells, shown, swatch } = rows.get(word);
    const position = read(state, word);
    setHidden(row, position === undefined);
    cells.forEach((cell, axis) => setText(cell, position ? fixed(position[axis], 2) : "–"));
    if (word !== "true") continue;
    // On hardware nothing is true; the errors are then against what is measured.
    setText(shown, state.errors.source === "measured" ? "Measured" : "True");
    setData(swatch, "word", state.errors.source);
  }
}
