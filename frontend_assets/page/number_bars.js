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

/** A row whose bar is filled from zero on, with marks for what is estimated and what is wanted. */
export function fillRow(name, id) {
  const row = barRow(name, id, "estimated");
  row.children[1].prepend(make("b"));
  row.children[1].append(make("u"), make("s"));
  return row;
}

/** The bar's end for a value: 5, 10, 20, 50 …; it stays unless the value goes beyond or far below it. */
export function fullBar(now, value) {
  const power = 10 ** Math.floor(Math.log10(Math.max(value, 0.5)));
  const wanted = Math.max(5, [1, 2, 5, 10].map((step) => step * power).find((step) => step >= value));
  return wanted > now || value < 0.35 * now ? wanted : now;
}

/**
 * `value`: null where not known, and `why`; `told`: {estimated, wanted: null where there is none,
 * held: words}; `full`: end of the bar; `limit`: end of the range, marked where the bar holds it.
 */
export function showFill(row, value, { estimated, wanted, held }, full, limit, unit, why) {
  setText(row.lastChild, fixed(value, 2));
  const [, bar] = row.children;
  const [fill, mark, end, goal] = bar.children;
  setHidden(bar, value === null);
  const words = estimated === null ? "" : `, estimated ${fixed(estimated, 2)} ${unit}`;
  setData(row, "tip", value === null ? why : `Measured ${fixed(value, 2)} ${unit}${words}. ${held}. The bar ends at ${full} ${unit}, the cell’s range at ${limit} ${unit}`);
  row.classList.toggle("near", value !== null && value > 0.9 * limit);
  if (value === null) return;
  const share = (part) => `${(Math.min(1, Math.max(0, part / full)) * 100).toFixed(1)}%`;
  fill.style.width = share(value);
  setHidden(mark, estimated === null);
  mark.style.left = share(estimated ?? 0);
  setHidden(goal, wanted === null);
  goal.style.left = share(wanted ?? 0);
  setHidden(end, limit > full);
  end.style.left = share(limit);
}
