// Numbers as people read them: a fixed count of digits, a true minus sign.

/** Three significant places or so, never exponents: 0.012, 1.24, 18.3, 240. */
export function figure(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  const places = size >= 99.95 ? 0 : size >= 9.995 ? 1 : size >= 0.9995 ? 2 : 3;
  return fixed(value, places);
}

/** As `figure`, with a digit more: for errors that matter below a micrometre. */
export const fine = (value) => (Math.abs(value) < 0.09995 ? fixed(value, 4) : figure(value));

export function fixed(value, places) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = value.toFixed(places);
  const isZero = Number(text) === 0;
  return isZero ? text.replace("-", "") : text.replace("-", "\u2212");
}

export const percent = (share) => `${Math.round(share * 100)} %`;

/** Seconds as a clock shows them: 0:07.3, 12:30.0. */
export function clock(seconds) {
  const tenths = Math.round(seconds * 10);
  const rest = (tenths % 600) / 10;
  return `${Math.floor(tenths / 600)}:${rest < 10 ? "0" : ""}${rest.toFixed(1)}`;
}

/** A reason as a sentence: capital first, full stop last. */
export function sentence(words) {
  const text = words.trim();
  if (text === "") return "";
  return text[0].toUpperCase() + text.slice(1) + (/[.!?]$/.test(text) ? "" : ".");
}
