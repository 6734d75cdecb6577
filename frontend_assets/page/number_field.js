// Fields into which a person types a number.

import { byId, setUnusable } from "/assets/dom.js";

/** The number in the field of that id; NaN where there is none. */
export function numberIn(id) {
  const words = byId(id).value.trim().replace(",", ".").replace("\u2212", "-");
  return words === "" ? NaN : Number(words);
}

/** What a person is typing, or has typed and not yet sent (`kept`), stays. */
export function showNumber(id, value, places, kept, blocked) {
  const field = byId(id);
  setUnusable(field, blocked);
  if (kept || document.activeElement === field || value === null) return;
  const words = value.toFixed(places);
  if (field.value !== words) field.value = words;
}
