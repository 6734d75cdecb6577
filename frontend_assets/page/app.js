// The operator page: the stream brings states, every part shows its own share of the newest one.

import { call, ROBOT } from "/assets/api.js";
import { Boards } from "/assets/boards.js";
import { byId, setText } from "/assets/dom.js";
import { GamepadLeader } from "/assets/gamepad.js";
import { startKeys } from "/assets/keys.js";
import { Motion } from "/assets/motion.js";
import { refuse, showBanner, showLink } from "/assets/notices.js";
import { Numbers } from "/assets/numbers.js";
import { showOperator, startOperator, whyNotDriving } from "/assets/operator.js";
import { Paths } from "/assets/paths.js";
import { startScene } from "/assets/scene.js";
import { Recording } from "/assets/recording.js";
import { Replay } from "/assets/replay.js";
import { Settings } from "/assets/settings.js";
import { StateStream } from "/assets/stream.js";
import { startStylus } from "/assets/stylus.js";
import { showTask } from "/assets/task.js";
import { switchTheme } from "/assets/theme.js";
import { startTooltips } from "/assets/tooltips.js";
import { showFacts, showSafety } from "/assets/topbar.js";
import { Traces } from "/assets/traces.js";
import { Trocar } from "/assets/trocar.js";

const SHOW_MS = 100;
const LATE_S = 1;
const LEADERS = { none: "none", gizmo: "gizmo", api_pose: "API, relative pose", api_target: "API, target pose", path: "path", stylus: "stylus", gamepad: "gamepad" };

window.keyhole = { state: null };

const stream = new StateStream({ onState: take, onLink, onProblem });
const motion = new Motion(stream, take);
const settings = new Settings();
const boards = new Boards();
const paths = new Paths(boards);
const trocar = new Trocar();
const traces = new Traces();
const numbers = new Numbers();
const recording = new Recording();
const replay = new Replay();
let shown = 0;
let urgent = "";
let configured = false;

/** What must be on the page at once; the rest follows within 100 ms. */
const urgencyOf = ({ safety, operator, engaged, path, control }) =>
  [safety.state, safety.reason_code, operator.name, operator.you, engaged, path?.name, control].join();

function take(state) {
  if (isLate(state, window.keyhole.state)) return;
  window.keyhole.state = state;
  stream.driving = state.operator.you;
  if (state.time_s !== null) traces.take(state);
  const urgency = urgencyOf(state);
  if (urgency !== urgent || performance.now() - shown >= SHOW_MS) show();
  urgent = urgency;
}

/** The answer to a request can overtake a state that is on its way in the stream. */
const isLate = (state, newest) =>
  newest !== null && !state.replay && state.time_s < newest.time_s && newest.time_s - state.time_s < LATE_S;

function show() {
  const state = window.keyhole.state;
  if (state === null) return;
  shown = performance.now();
  const blocked = whyNotDriving(state, stream.up);
  showSafety(state, stream.up);
  showFacts(state, shown - stream.lastMessage);
  showOperator(state, stream.up);
  recording.show(state, stream.up);
  replay.show(state, stream.up);
  showBanner(state);
  settings.show(state, blocked);
  motion.show(state, blocked, stream.up);
  paths.show(state, blocked);
  boards.show(state, blocked, paths.needed);
  trocar.show(state, blocked);
  showTask(state);
  numbers.show(state);
  showLeader(state);
}

function showLeader({ leader, engaged, plant, preset, seed }) {
  setText(byId("leader"), LEADERS[leader] ?? leader);
  setText(byId("engaged"), engaged ? "· engaged" : "· not engaged");
  setText(byId("plant"), `· ${plant} robot${preset === null ? "" : `: ${preset}, seed ${seed}`}`);
}

function onLink(change) {
  showLink(change, window.keyhole.state?.operator.you === true);
  if (change.up) {
    paths.load();
    boards.load();
    configure();
  }
  show();
}

/** Who drives is on the page already. */
function onProblem({ code, detail }) {
  if (code !== "not_the_operator") refuse(detail);
}

async function configure() {
  if (configured) return;
  try {
    const configuration = await call("GET", `${ROBOT}/configuration`);
    numbers.servoRange_deg = configuration.module?.servo_range_deg ?? null;
    configured = true;
  } catch {
    // Without it only the servo bars are missing; asked for again with the next connection.
  }
}

// Not modal: the emergency stop beside it must stay within reach of the mouse.
const help = byId("help-dialog");
byId("help").addEventListener("click", () => (help.open ? help.close() : help.show()));
byId("help-close").addEventListener("click", () => help.close());
byId("theme").addEventListener("click", switchTheme);
byId("retry").addEventListener("click", () => stream.connect());

startTooltips();
startOperator();
startScene();
startKeys({
  stop: () => motion.stop(),
  hold: (down) => motion.hold(down),
  scale: (direction) => settings.step(direction),
  holdsToMove: () => window.keyhole.state?.teleoperation.hold_to_move === true,
  refuse,
});
new GamepadLeader(stream, refuse);
startStylus(() => stream.up && !window.keyhole.state?.replay);
stream.connect();
// A silent link must show its age although no message arrives.
setInterval(() => performance.now() - shown > 2 * SHOW_MS && show(), 2 * SHOW_MS);
