// The top bar's left half: safety state in words, and how healthy the loop is.

import { byId, setData, setText } from "/assets/dom.js";
import { figure, fixed, sentence } from "/assets/format.js";
import { REPLAY_WORDS } from "/assets/replay.js";

const ICONS = { ENABLED: "enabled", PAUSED: "paused", DISABLED: "disabled", FAULT: "fault" };
const STALE_MS = 100;
const DEAD_MS = 500;

export function showSafety({ safety, control, replay }, up) {
  const known = up && control === "running" && !replay;
  const state = known ? safety.state : "NONE";
  setData(byId("safety"), "state", state);
  setText(byId("safety-state"), known ? safety.state : up && replay ? "REPLAY" : up ? `CONTROL ${control.toUpperCase()}` : "NO CONNECTION");
  const icon = `#icon-${ICONS[state] ?? "link"}`;
  if (byId("safety-icon").getAttribute("href") !== icon) byId("safety-icon").setAttribute("href", icon);
  const reason = sentence(safety.reason);
  const action = sentence(safety.action);
  setText(byId("safety-reason"), up && replay ? `Recorded: ${safety.state}. ${reason}` : up ? reason : `Last known: ${safety.state}. ${reason}`);
  setText(byId("safety-action"), up && replay ? REPLAY_WORDS : up ? action : "");
  // What is cut short on a narrow screen is whole in the tooltip.
  setData(byId("safety-words"), "tip", [reason, action].filter(Boolean).join(" "));
}

/** `silence_ms`: time since the last message, which counts as age too. */
export function showFacts({ age_ms, loop }, silence_ms) {
  const age = age_ms === null ? null : age_ms + (silence_ms > STALE_MS ? silence_ms : 0);
  setText(byId("age"), age >= 10000 ? "> 9999" : fixed(age, age < 10 ? 1 : 0));
  setData(byId("fact-age"), "level", age > DEAD_MS ? "bad" : age > STALE_MS ? "warn" : "");
  setText(byId("rate"), fixed(loop.rate_hz, 0));
  setText(byId("overruns"), fixed(loop.overruns, 0));
  const factor = loop.real_time_factor;
  const slow = factor !== null && factor < 0.98;
  setText(byId("realtime"), slow ? `×${factor.toFixed(2)}` : loop.realtime === "" ? "–" : /^off/.test(loop.realtime) ? "Off" : "On");
  setData(byId("fact-realtime"), "level", slow ? "warn" : "");
  setData(byId("fact-realtime"), "tip",
    `Scheduling: ${loop.realtime || "not known"}. Simulated time runs at ${figure(factor)} × real time`);
  setData(byId("fact-rate"), "tip",
    `Rate of the control loop. The last tick began ${figure(loop.lateness_us)} µs late and took ${figure(loop.tick_us)} µs`);
}
