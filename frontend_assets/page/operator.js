// Who drives: take, release and hand over control. One person drives, the others watch.

import { actUnder, call } from "/assets/api.js";
import { byId, onPress, setBlocked, setData, setHidden, setText } from "/assets/dom.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { REPLAY_WORDS } from "/assets/replay.js";
import { ROBOT } from "/assets/robots.js";

const KEY = "keyhole-operator";

export function startOperator() {
  const field = byId("operator-name");
  field.value = remembered();
  field.addEventListener("change", () => {
    field.value = field.value.trim() || remembered();
    remember(field.value);
  });
  onPress(byId("take-control"), take, refuse);
  onPress(byId("release-control"), release, refuse);
  onPress(byId("hand-over"), () => {}, refuse);
  byId("hand-over-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const to = byId("hand-over-to").value.trim();
    if (to && byId("hand-over").getAttribute("aria-disabled") !== "true") handOver(to);
  });
}

/** Whether somebody else drives who would have to be asked. */
let mustAsk = false;

async function take() {
  if (mustAsk) {
    askFor(myName());
    return;
  }
  const lease = await attempt(call("POST", `${ROBOT}/lease`, { operator: myName() }));
  if (lease) actUnder(lease.lease_id);
}

export const myName = () => byId("operator-name").value;

async function askFor(operator) {
  const asked = await attempt(call("POST", `${ROBOT}/lease/request`, { operator }).then(() => true));
  if (asked) tell("You asked for control. The operator sees it and answers.");
}

async function release() {
  await attempt(call("DELETE", `${ROBOT}/lease`));
  actUnder(null);
}

async function handOver(to) {
  const answer = await attempt(call("POST", `${ROBOT}/lease/hand-over`, { to }).then(() => true));
  if (!answer) return;
  byId("operator-popover").hidePopover();
  tell(`Control is offered to ${to}. Nothing moves until it is taken or withdrawn.`);
}

/** Why this page may not drive now, or "". */
export function whyNotDriving(state, up) {
  if (!up) return "No connection to the server.";
  if (state.replay) return REPLAY_WORDS;
  if (state.control !== "running") return `Control is ${state.control}.`;
  if (state.operator.you) return "";
  if (state.operator.name) return `${state.operator.name} drives. Ask for a hand over.`;
  return "Take control first.";
}

export function showOperator({ operator, replay }, up) {
  const { name, you, offered_to } = operator;
  mustAsk = Boolean(name) && !you && offered_to !== myName();
  const button = byId("take-control");
  setText(button, mustAsk ? "Ask for control" : "Take control");
  setData(button, "tip", mustAsk ? `Ask ${name} for control: only one person drives at a time (C)` : "Become the operator: only one person drives at a time (C)");
  const who = you ? `as ${name}` : name ? `${name} drives` : "No one drives";
  setText(byId("operator-role"), !up ? "Not connected" : you ? "You drive" : "Watching");
  setText(byId("operator-who"), up ? who : "");
  setData(byId("operator-who"), "tip", who);
  setHidden(byId("take-control"), you);
  setHidden(byId("release-control"), !you);
  button.classList.toggle("primary", !mustAsk);
  const offline = !up ? "No connection to the server." : replay ? REPLAY_WORDS : "";
  setBlocked(byId("take-control"), offline);
  setBlocked(byId("release-control"), offline);
  setBlocked(byId("hand-over"), offline || (you ? "" : "Only the one who drives can hand over."));
}

function remembered() {
  let name = null;
  try {
    name = localStorage.getItem(KEY);
  } catch {
    // Storage may be forbidden.
  }
  if (name) return name;
  // Two browsers must not have one name, or neither could hand over to the other.
  const fresh = `Operator ${1000 + Math.floor(Math.random() * 9000)}`;
  remember(fresh);
  return fresh;
}

function remember(name) {
  try {
    localStorage.setItem(KEY, name);
  } catch {
    // The name then lasts as long as the page.
  }
}
