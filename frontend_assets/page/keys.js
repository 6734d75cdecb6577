// The keyboard. W, A, S, D, Q, E and the arrows belong to the scene's camera, so no shortcut is there.

import { byId, make } from "/assets/dom.js";
import { DRIVEN } from "/assets/robots.js";
import { sceneWindow } from "/assets/scene.js";

/**
 * `press`: the control that the key presses; `robot`: the only one that has it. Every shortcut is
 * listed in the help.
 */
const ALL_KEYS = [
  { key: "Escape", show: "Esc", words: "Emergency stop, also while typing" },
  { key: " ", show: "Space", words: "Move while held (hold-to-move)" },
  { key: "c", show: "C", words: "Take or release control", press: ["take-control", "release-control"] },
  { key: "g", show: "G", words: "Enable (go)", press: ["enable"] },
  { key: "p", show: "P", words: "Pause", press: ["pause"] },
  { key: "x", show: "X", words: "Disable", press: ["disable"] },
  { key: "r", show: "R", words: "Reset a fault", press: ["reset"] },
  { key: "h", show: "H", words: "Hold-to-move on or off", press: ["hold-to-move"] },
  { key: "1", robot: "instrument", show: "1 2 3 4", words: "Balanced, linear first, angular first, pointing", pick: ["case", "0"] },
  { key: "2", robot: "instrument", pick: ["case", "1"] },
  { key: "3", robot: "instrument", pick: ["case", "2"] },
  { key: "4", robot: "instrument", pick: ["case", "pointing"] },
  { key: "1", robot: "concentric", show: "1 2 3 4 5", words: "Concentric tubes: NSPWLN, NSPWLN repaired, NSPQP, SNSQP, HQP", pick: ["method", "nspwln"] },
  { key: "2", robot: "concentric", pick: ["method", "nspwln-repaired"] },
  { key: "3", robot: "concentric", pick: ["method", "nspqp"] },
  { key: "4", robot: "concentric", pick: ["method", "snsqp"] },
  { key: "5", robot: "concentric", pick: ["method", "hqp"] },
  { key: "[", show: "[ ]", words: "Motion scale down, up" },
  { key: "]" },
  { key: "o", robot: "instrument", show: "O", words: "Lock rotation", press: ["lock-rotation"] },
  { key: "t", show: "T", words: "Lock translation", press: ["lock-translation"] },
  { key: "m", robot: "instrument", show: "M", words: "Alignment relative or matched", other: "alignment" },
  { key: "v", show: "V", words: "Align with view", press: ["align-view"] },
  { key: "k", show: "K", words: "Play or stop the path; play or pause a replay", press: ["replay-play", "stop-path", "play"] },
  { key: "l", show: "L", words: "Start or stop recording", press: ["record"] },
  { key: "b", robot: "instrument", show: "B", words: "Straighten and withdraw", press: ["withdraw"] },
  { key: "i", show: "I", words: "Devices: open or close", press: ["show-devices"] },
  { key: "j", show: "J", words: "Events: open or close", press: ["show-events"] },
  { key: "y", robot: "instrument", show: "Y", words: "Sensing on or off", press: ["sensing"] },
  { key: "u", show: "U", words: "Choose the robot", open: "robot" },
  { key: "f", show: "F", words: "Freeze the plots", press: ["freeze"] },
  { key: "z", show: "Z", words: "Time window of the plots", other: "window" },
  { key: "n", show: "N", words: "Light or dark", press: ["theme"] },
  { key: "?", show: "?", words: "This help", press: ["help"] },
];
const KEYS = ALL_KEYS.filter(({ robot }) => !robot || robot === DRIVEN.name);

/**
 * Listen on the page and in the scene.
 * `acts`: stop(), hold(down), scale(direction), refuse(reason), holdsToMove() -> bool.
 */
export function startKeys(acts) {
  const listeners = { down: (event) => down(event, acts), up: (event) => up(event, acts) };
  listen(window, listeners);
  const release = () => setTimeout(() => document.hasFocus() || acts.hold(false));
  window.addEventListener("blur", release);
  document.addEventListener("visibilitychange", () => document.hidden && acts.hold(false));
  const known = new WeakSet();
  const attach = () => {
    const inner = sceneWindow();
    if (!inner || known.has(inner.document)) return;
    known.add(inner.document);
    listen(inner, listeners);
    inner.addEventListener("blur", release);
  };
  byId("scene").addEventListener("load", attach);
  // The scene may replace its document before it has loaded; its keys must work by then.
  setInterval(attach, 250);
  fillHelp();
}

function listen(target, { down, up }) {
  target.addEventListener("keydown", down, { capture: true });
  target.addEventListener("keyup", up, { capture: true });
}

function down(event, acts) {
  if (event.key === "Escape") {
    if (!event.repeat) acts.stop();
    return;
  }
  if (event.ctrlKey || event.metaKey || event.altKey || isText(event.target)) return;
  if (event.key === " ") {
    if (!acts.holdsToMove()) return;
    event.preventDefault();
    if (!event.repeat) acts.hold(true);
    return;
  }
  // A list takes letters to find its entries.
  if (event.target?.tagName === "SELECT") return;
  const shortcut = KEYS.find((entry) => entry.key === event.key.toLowerCase());
  if (!shortcut) return;
  event.preventDefault();
  event.stopPropagation();
  if (shortcut.key === "[" || shortcut.key === "]") acts.scale(shortcut.key === "]" ? 1 : -1);
  else if (!event.repeat) run(shortcut, acts);
}

function up(event, acts) {
  if (event.key !== " ") return;
  // A button under focus must not take the release for a press.
  if (acts.holdsToMove() && !isText(event.target)) event.preventDefault();
  acts.hold(false);
}

function run({ press, pick, other, open }, acts) {
  let control;
  if (open) control = byId(open);
  else if (press) control = press.map(byId).find((element) => isUsable(element)) ?? byId(press.at(-1));
  else if (pick) control = document.querySelector(`input[name="${pick[0]}"][value="${pick[1]}"]`);
  else control = nextOf(other);
  if (control.disabled) acts.refuse(control.closest("[data-tip]").dataset.why);
  else if (open) control.focus();
  else control.click();
}

const isUsable = (element) => !element.hidden && element.getAttribute("aria-disabled") !== "true";

function nextOf(name) {
  const all = [...document.querySelectorAll(`input[name="${name}"]`)];
  return all[(all.findIndex((input) => input.checked) + 1) % all.length];
}

/** True where keys belong to a text field; a checkbox or a slider takes no letters. */
function isText(target) {
  const kind = target?.tagName;
  if (kind === "INPUT") return !["checkbox", "radio", "range", "file", "button"].includes(target.type);
  return kind === "TEXTAREA" || target?.isContentEditable === true;
}

function fillHelp() {
  const body = byId("keys-table").tBodies[0];
  for (const { show, words } of KEYS.filter((entry) => entry.show)) {
    const row = body.insertRow();
    const cell = row.insertCell();
    for (const part of show.split(" ")) cell.append(make("kbd", "", part), " ");
    row.insertCell().textContent = words;
  }
}
