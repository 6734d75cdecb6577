// What the page has for the instrument alone: its choices, plots and numbers, trocar and board.

import { call } from "/assets/api.js";
import { Boards } from "/assets/boards.js";
import { byId, setText, setUnusable } from "/assets/dom.js";
import { figure, fine, fixed } from "/assets/format.js";
import { InstrumentNumbers } from "/assets/instrument_numbers.js";
import { ROBOT } from "/assets/robots.js";
import { KnownForce, Sensing, trueForce } from "/assets/sensing.js";
import { picked } from "/assets/settings.js";
import { showTask } from "/assets/task.js";
import { Tendons } from "/assets/tendons.js";
import { Trocar } from "/assets/trocar.js";

const withCase = () => ({ case: picked("case") });

const CHOICES = [
  { control: "switch", id: "lock-rotation", where: "teleoperation", key: "lock_rotation", read: (state) => state.teleoperation.lock_rotation },
  { control: "radio", id: "alignment", where: "teleoperation", key: "alignment", read: (state) => state.teleoperation.alignment },
  { control: "radio", id: "case", where: "priority", key: "case", read: (state) => state.priority.case },
  { control: "list", id: "solver", where: "priority", key: "solver", beside: withCase, read: (state) => state.priority.solver },
  { control: "list", id: "coordinates", where: "priority", key: "coordinates", beside: withCase, read: (state) => state.priority.coordinates },
  { control: "list", id: "compensation", where: "compensation", key: "mode", read: (state) => state.compensation },
  { control: "list", id: "tendon-control", where: "tendons", key: "control", read: (state) => state.tendons.control },
  { control: "switch", id: "sensing", where: "sensing", key: "enabled", read: (state) => state.sensing.enabled },
  { control: "switch", id: "tracker", where: "compensation", key: "tracker", read: (state) => state.tracker.on },
];

const known = new KnownForce();

const PLOTS = [
  { key: "position", title: "Position error", unit: "mm", floor: 0.01, text: figure, lines: [{ key: "position", word: "source", read: (state) => state.errors.position_mm }] },
  { key: "orientation", title: "Orientation error", unit: "deg", floor: 0.01, text: figure, lines: [{ key: "orientation", word: "source", read: (state) => state.errors.orientation_deg }] },
  { key: "rcm", title: "RCM error", unit: "mm", floor: 0.01, text: fine, lines: [{ key: "rcm", word: "source", read: (state) => state.errors.rcm_mm }] },
  {
    key: "lambda",
    title: "λ at the trocar",
    unit: "0–1",
    span: () => [0, 1],
    text: (value) => fixed(value, 3),
    peak: (low, high) => `${fixed(low, 2)} … ${fixed(high, 2)}`,
    lines: [{ key: "lambda", word: "commanded", read: (state) => state.lambda.value }],
    marks: ({ lambda }) => [
      { value: lambda.max, label: `limit ${lambda.max}`, kind: "limit" },
      { value: lambda.min, label: `limit ${lambda.min}`, kind: "limit" },
      { value: lambda.reference, label: `reference ${lambda.reference}`, kind: "reference" },
    ],
  },
  {
    key: "bend",
    title: "Bend",
    unit: "deg",
    // Room above the limit, in steps of 30 degrees.
    span: (low, high, [limit]) => [0, Math.max(high, Math.ceil((limit.value * 1.1) / 30) * 30)],
    text: (value) => fixed(value, 1),
    lines: [{ key: "bend", word: "commanded", read: (state) => state.bend_deg }],
    marks: ({ bend_limit_deg }) => [{ value: bend_limit_deg, label: `limit ${fixed(bend_limit_deg, 0)}°`, kind: "limit" }],
  },
  {
    key: "force",
    title: "Contact force",
    unit: "N",
    floor: 0.1,
    text: (value) => fixed(value, 3),
    // Without tension cells nothing can be plotted; the group Sensing says so.
    present: (state) => state.sensing.cells,
    lines: [
      { key: "force-estimated", label: "est.", word: "estimated", dashed: true, tip: "Estimated, along the directions in which it is observable", read: (state) => known.of(state)?.force_n ?? null },
      { key: "force-true", label: "true", word: "true", tip: "True, of all contacts on the instrument together", read: (state) => trueForce(state) ?? undefined },
    ],
  },
];

/** A robot without tension cells has no estimate of its tip. */
function tipOf(state, word) {
  if (word !== "estimated") return state[word].position_mm;
  return state.sensing.cells ? state.sensing.tip.position_mm : undefined;
}

/** The instrument's share of the page. */
export function instrumentPage() {
  const boards = new Boards();
  const trocar = new Trocar();
  const sensing = new Sensing(known);
  const tendons = new Tendons();
  const numbers = new InstrumentNumbers();
  return {
    choices: CHOICES,
    plots: PLOTS,
    tips: [{ key: "tip", title: "Tip, mm", read: tipOf }],
    numbers,
    why: (needed, state) => boards.why(needed, state.board),
    load: () => {
      boards.load();
      configure(numbers);
    },
    parts: (state, blocked, paths) => ({
      "instrument settings": () => showSettings(state, blocked),
      boards: () => boards.show(state, blocked, paths.needed),
      trocar: () => trocar.show(state, blocked),
      sensing: () => sensing.show(state),
      tendons: () => tendons.show(state, blocked),
      task: () => showTask(state),
    }),
  };
}

function showSettings({ priority, tracker }, blocked) {
  if (!blocked && priority.solver === "hqp") setUnusable(byId("coordinates"), "The QP always uses u, v.");
  const seen = tracker.age_ms === null ? "No sample of a tracker" : `Newest sample ${fixed(tracker.age_ms, 0)} ms old`;
  const correction = `corrects by ${figure(tracker.correction_mm)} mm, ${figure(tracker.correction_deg)} deg`;
  setText(byId("tracker-words"), tracker.on ? `${seen}; ${correction}` : seen);
}

async function configure(numbers) {
  if (numbers.servoRange_deg !== null) return;
  try {
    numbers.servoRange_deg = (await call("GET", `${ROBOT}/configuration`)).module.servo_range_deg;
  } catch {
    // Without it only the servo bars are missing; asked for again with the next connection.
  }
}
