// Rows of the numbers below the plots: a name, a bar between two bounds, a value.

import { make, setData, setHidden, setText } from "/assets/dom.js";
import { fixed } from "/assets/format.js";

export function title(words, unit) {
  const heading = make("h3", "", unit ? `${words}, ` : words);
  if (unit) heading.append(make("span", "unit", unit));
  return heading;
}

export function plainRow(words, id, tip) {
  const row = make("div", "row plain");
  row.append(make("span", "", words), make("span", "value", "–", { id }));
  row.dataset.tip = tip;
  return row;
}

/** `colour`: word of the mark on the bar. */
export function barRow(name, id, colour = "commanded") {
  const row = make("div", "row");
  const bar = make("span", "bar");
  const mark = make("i");
  mark.dataset.word = colour;
  bar.append(mark);
  row.append(make("span", "muted", name), bar, make("span", "value", "–", { id }));
  return row;
}

/** `range`: [low, high], or null where it is not known; nearer than `near` to one of them is marked. */
export function showBar(row, value, range, near, unit) {
  setText(row.lastChild, fixed(value, 1));
  const [, bar] = row.children;
  const known = range !== null && value !== null;
  setHidden(bar, !known);
  if (!known) return;
  const share = Math.min(1, Math.max(0, (value - range[0]) / (range[1] - range[0])));
  bar.firstChild.style.left = `${(share * 100).toFixed(1)}%`;
  row.classList.toggle("near", value - range[0] < near || range[1] - value < near);
  setData(row, "tip", `From ${fixed(range[0], 1)} to ${fixed(range[1], 1)} ${unit}`);
}
