// Over the scene: what the instrument touches, and what has been done on the board.

import { byId, setData, setHidden, setText } from "/assets/dom.js";
import { fixed, percent } from "/assets/format.js";

const NEAR = 0.75;

/** The smallest distance between arm, module, shaft and body wall. */
function showClearance({ distance_mm, between, limit_mm }) {
  const known = distance_mm !== null;
  setHidden(byId("clearance"), !known);
  if (!known) return;
  const level = distance_mm < limit_mm ? "over" : distance_mm < 2 * limit_mm ? "near" : "none";
  setData(byId("clearance"), "level", level);
  setText(byId("clearance-text"), `Clearance ${fixed(distance_mm, distance_mm < 99.5 ? 1 : 0)} mm`);
  setData(byId("clearance"), "tip", `Between ${between}. Below ${fixed(limit_mm, 1)} mm the motion pauses`);
}

export function showTask({ contact, clearance, rings, ball, control }) {
  const known = control === "running";
  setHidden(byId("task"), !known);
  if (!known) return;
  showClearance(clearance);
  const level = levelOf(contact);
  setData(byId("contact"), "level", level);
  setText(byId("contact-text"), wordsOf(contact, level));
  setHidden(byId("rings"), rings === null);
  if (rings) {
    const touched = rings.touched ? ` · ${rings.touched} touched` : "";
    setText(byId("rings"), `Rings ${rings.passed} of ${rings.total}${touched}`);
  }
  setHidden(byId("ball"), ball === null);
  if (ball) {
    setText(byId("ball-text"), `Ball ${percent(ball.progress ?? 0)} of the groove`);
    byId("ball-progress").value = ball.progress ?? 0;
  }
}

function levelOf({ count, force_n, limit_n }) {
  if (force_n > limit_n) return "over";
  if (force_n > NEAR * limit_n) return "near";
  return count > 0 || force_n > 0.005 ? "touch" : "none";
}

function wordsOf({ force_n, limit_n }, level) {
  const force = `${fixed(force_n, 2)} N`;
  if (level === "none") return "No contact";
  if (level === "touch") return `Contact ${force}`;
  const limit = `${fixed(limit_n, 1)} N`;
  return level === "near" ? `Contact ${force}, near the limit of ${limit}` : `Contact ${force}, above the limit of ${limit}`;
}
