// What the page has for the two concentric-tube arms alone: method, plots, numbers, and what is told
// over the scene.

import { ConcentricNumbers } from "/assets/concentric_numbers.js";
import { byId, setData, setHidden, setText } from "/assets/dom.js";
import { figure, fixed, percent } from "/assets/format.js";

/** Shares of the limit above which B is said to be off its place, and multiples of the least
 * stability below which the tubes are said to be near snapping: as in the scene. */
const IN_PLACE = 0.25;
const NEAR_SNAPPING = 3;
const ARMS = ["A", "B"];
const MOST_TUBES = 6;
const LEAST_ROOM_MM = 5;

const CHOICES = [{ control: "radio", id: "method", where: "method", key: "method", read: (state) => state.method }];

const limitOf = (value, unit) => [{ value, label: `limit ${value}${unit}`, kind: "limit" }];

/** Each tube's translation between its bounds, as in the paper's figure 2. */
const translations = (arm) => ({
  key: `tubes-${ARMS[arm]}`,
  title: `Tubes ${ARMS[arm]}`,
  unit: "mm",
  share: 1.4,
  span: (low, high) => {
    const room = Math.max(LEAST_ROOM_MM, 0.15 * (high - low));
    return [Math.floor((low - room) / 5) * 5, Math.ceil((high + room) / 5) * 5];
  },
  text: (value) => fixed(value, 1),
  lines: Array.from({ length: MOST_TUBES }, (_, tube) => ({
    key: `tube-${ARMS[arm]}-${tube + 1}`,
    name: `${tube + 1}`,
    tip: `Tube ${tube + 1} of arm ${ARMS[arm]}, the innermost first: where its rear end stands behind the endoscope’s face`,
    word: `tube-${tube + 1}`,
    read: (state) => state.arms[arm].translations_mm[tube],
    bounds: [(state) => state.arms[arm].lower_mm[tube], (state) => state.arms[arm].upper_mm[tube]],
  })),
});

const PLOTS = [
  {
    key: "relative",
    title: "ε_AB: B beside A",
    unit: "mm",
    floor: 0.01,
    share: 0.8,
    text: figure,
    lines: [{ key: "relative", word: "source", read: (state) => state.errors.relative_mm }],
    marks: ({ relative_limit_mm }) => limitOf(relative_limit_mm, " mm"),
  },
  {
    key: "position",
    title: "ε_A: tip of A",
    unit: "mm",
    floor: 0.01,
    share: 0.8,
    text: figure,
    lines: [{ key: "position", word: "source", read: (state) => state.errors.position_mm }],
  },
  translations(0),
  translations(1),
  {
    key: "stability",
    title: "Stability",
    unit: "0–1",
    share: 0.8,
    span: (low, high) => [0, Math.max(1, high)],
    text: (value) => fixed(value, 2),
    lines: ARMS.map((name, arm) => ({
      key: `stability-${name}`,
      name,
      tip: `Stability determinant of arm ${name}: 1 is far from snapping, 0 is where its tubes snap`,
      word: "commanded",
      dashed: arm === 1,
      read: (state) => state.arms[arm].stability,
    })),
    marks: ({ stability_limit }) => limitOf(stability_limit, ""),
  },
];

const poseOfB = { desired: (state) => state.desired_b_mm, commanded: (state) => state.commanded_b.position_mm, true: (state) => state.true_b.position_mm };

/** The concentric-tube arms' share of the page. */
export function concentricPage() {
  return {
    choices: CHOICES,
    plots: PLOTS,
    tips: [
      { key: "tip", title: "Tip of A, mm", read: (state, word) => state[word]?.position_mm },
      { key: "tip-b", title: "Tip of B, mm", read: (state, word) => poseOfB[word]?.(state) },
    ],
    numbers: new ConcentricNumbers(),
    why: () => "",
    load: () => {},
    parts: (state) => ({ task: () => showTask(state) }),
  };
}

function showTask({ errors, relative_limit_mm, arms, stability_limit, task_scale, control }) {
  const known = control === "running" && errors.relative_mm !== null;
  setHidden(byId("task"), !known);
  if (!known) return;
  const off = errors.relative_mm > IN_PLACE * relative_limit_mm;
  setData(byId("in-place"), "level", errors.relative_mm > relative_limit_mm ? "over" : off ? "near" : "none");
  setText(byId("in-place-text"), off ? `B is ${figure(errors.relative_mm)} mm from its place` : "B in its place");
  const snapping = arms.filter(({ stability }) => stability < NEAR_SNAPPING * stability_limit);
  setData(byId("snapping"), "level", snapping.length ? "near" : "none");
  const names = snapping.map(({ name }) => name).join(" and ");
  setText(byId("snapping-text"), snapping.length ? `${names} near snapping: turn back` : "Far from snapping");
  const least = Math.min(task_scale.relative ?? 1, task_scale.tracking ?? 1);
  setHidden(byId("scaled"), least > 0.995);
  setText(byId("scaled"), `Slowed to ${percent(least)} by limits`);
}
