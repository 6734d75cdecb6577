// The operator page: the stream brings states, every part shows its own share of the newest one.

import { concentricPage } from "/assets/concentric_page.js";
import { Devices } from "/assets/devices.js";
import { byId, setData, setText } from "/assets/dom.js";
import { Drawer } from "/assets/drawer.js";
import { Events } from "/assets/events.js";
import { HandOver } from "/assets/hand_over.js";
import { GamepadLeader } from "/assets/gamepad.js";
import { instrumentPage } from "/assets/instrument_page.js";
import { startKeys } from "/assets/keys.js";
import { Motion } from "/assets/motion.js";
import { refuse, showBanner, showLink, tell } from "/assets/notices.js";
import { Numbers } from "/assets/numbers.js";
import { showOperator, startOperator, whyNotDriving } from "/assets/operator.js";
import { Paths } from "/assets/paths.js";
import { RobotChoice } from "/assets/robot_choice.js";
import { DRIVEN } from "/assets/robots.js";
import { startScene } from "/assets/scene.js";
import { Recording } from "/assets/recording.js";
import { Replay } from "/assets/replay.js";
import { ACTUATIONS } from "/assets/sensing.js";
import { Settings } from "/assets/settings.js";
import { StateStream } from "/assets/stream.js";
import { startStylus } from "/assets/stylus.js";
import { switchTheme } from "/assets/theme.js";
import { startTooltips } from "/assets/tooltips.js";
import { showFacts, showSafety } from "/assets/topbar.js";
import { Traces } from "/assets/traces.js";

const SHOW_MS = 100;
const LATE_S = 1;
const LEADERS = { none: "none", gizmo: "gizmo", api_pose: "API, relative pose", api_target: "API, target pose", path: "path", stylus: "stylus", gamepad: "gamepad" };

const PAGES = { instrument: instrumentPage, concentric: concentricPage };

window.keyhole = { state: null };

const stream = new StateStream({ onState: take, onLink, onProblem, onNotice });
const motion = new Motion(stream, take);
const own = PAGES[DRIVEN.name]();
const settings = new Settings(own.choices);
const paths = new Paths(own.why);
const traces = new Traces(own.plots);
const numbers = new Numbers(own.tips, own.numbers);
const robots = new RobotChoice();
const recording = new Recording();
const replay = new Replay();
const devices = new Devices(take);
const handOver = new HandOver();
const events = new Events();
const drawer = new Drawer({ devices: () => devices.opened(), events: () => events.opened() }, () => events.closed());
const failed = new Set();
let shown = 0;
let urgent = "";

/** What must be on the page at once; the rest follows within 100 ms. */
const urgencyOf = ({ safety, operator, engaged, path, control, readiness }) =>
  [safety.state, safety.reason_code, ...Object.values(operator).slice(0, 2), engaged, path?.name, control, readiness.state,
    operator.offered_to, operator.asked_by].join();

function take(state) {
  if (state.robot !== DRIVEN.name) {
    location.reload();
    return;
  }
  if (isLate(state, window.keyhole.state)) return;
  window.keyhole.state = state;
  stream.driving = state.operator.you;
  if (state.time_s !== null) guarded("plots", () => traces.take(state));
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
  const parts = {
    safety: () => showSafety(state, stream.up),
    facts: () => showFacts(state, shown - stream.lastMessage),
    operator: () => showOperator(state, stream.up),
    banner: () => showBanner(state),
    motion: () => motion.show(state, blocked, stream.up),
    "hand-over": () => handOver.show(state, stream.up),
    recording: () => recording.show(state, stream.up),
    replay: () => replay.show(state, stream.up),
    settings: () => settings.show(state, blocked),
    paths: () => paths.show(state, blocked),
    devices: () => devices.show(state, blocked),
    robots: () => robots.show(state, stream.up),
    ...own.parts(state, blocked, paths),
    numbers: () => numbers.show(state),
    leader: () => showLeader(state),
  };
  for (const [name, act] of Object.entries(parts)) guarded(name, act);
}

/** A part that fails must not take the others with it: it is told once, here and in the server's log. */
function guarded(name, act) {
  try {
    act();
  } catch (error) {
    partFailed(name, error);
  }
}

function partFailed(name, error) {
  if (failed.has(name)) return;
  failed.add(name);
  const words = `${name}: ${error}`.slice(0, 300);
  tell(`A part of this page failed (${words}). The rest and the robot go on; reload the page.`, "error");
  stream.send({ type: "page-error", words });
}

// What draws at its own pace, such as the plots, fails outside of every part.
window.addEventListener("error", (event) => partFailed("drawing", event.message));

function showLeader({ leader, engaged, plant, preset, seed, actuation }) {
  setText(byId("leader"), LEADERS[leader] ?? leader);
  setText(byId("engaged"), engaged ? "· engaged" : "· not engaged");
  const robot = `${plant} robot${preset === null ? "" : `: ${preset}, seed ${seed}`}`;
  const drive = actuation ? `, tendons driven by ${ACTUATIONS[actuation]}` : "";
  setText(byId("plant"), `· ${robot}`);
  setData(byId("leader-words"), "tip", `Who leads the tip, and whether it follows. ${robot[0].toUpperCase()}${robot.slice(1)}${drive}`);
}

function onLink(change) {
  showLink(change, window.keyhole.state?.operator.you === true);
  if (change.up) {
    paths.load();
    own.load();
  }
  show();
}

/** Who drives is on the page already. */
function onProblem({ code, detail }) {
  if (code !== "not_the_operator") refuse(detail);
}

function onNotice({ kind, text }) {
  tell(text, kind === "info" ? "info" : "error");
}

// Not modal: the emergency stop beside it must stay within reach of the mouse.
const help = byId("help-dialog");
byId("help").addEventListener("click", () => (help.open ? help.close() : help.show()));
byId("help-close").addEventListener("click", () => help.close());
byId("theme").addEventListener("click", switchTheme);
byId("retry").addEventListener("click", () => stream.connect());

startTooltips();
startOperator();
startScene(() => stream.driving && stream.send({ type: "let-go" }));
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
