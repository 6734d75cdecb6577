// What the drives of the tendons hold, how tight they are, and how stiff the bend is by it.

import { call } from "/assets/api.js";
import { byId, setText, setUnusable } from "/assets/dom.js";
import { fixed } from "/assets/format.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { numberIn, showNumber } from "/assets/number_field.js";
import { ROBOT } from "/assets/robots.js";

const NO_CELLS = "This robot measures no tension: start it with --actuation tension-unit.";
const BY_LENGTH = "Only where tensions are held: choose another control of the tendons.";

export class Tendons {
  constructor() {
    byId("co-contraction").addEventListener("change", () => this.#tighten(numberIn("co-contraction")));
  }

  async #tighten(value) {
    if (Number.isNaN(value)) refuse("Enter the co-contraction as a number, in N.");
    else if (await attempt(call("PUT", `${ROBOT}/tendons`, { co_contraction_n: value }))) {
      tell(`No tendon falls below ${fixed(value, 1)} N any more.`);
    }
  }

  show({ tendons, sensing }, blocked) {
    if (!blocked && !sensing.cells) setUnusable(byId("tendon-control"), NO_CELLS);
    const why = blocked || (sensing.cells ? "" : NO_CELLS) || (tendons.control === "position" ? BY_LENGTH : "");
    showNumber("co-contraction", tendons.co_contraction_n, 1, false, why);
    const [u, v] = tendons.stiffness_mnm_rad;
    const known = u !== null && v !== null;
    setText(byId("tendon-words"), known ? `Bending stiffness ${fixed(u, 1)} (u), ${fixed(v, 1)} (v) mN m/rad` : "No tension is measured");
  }
}

/** What the drive of the tendon of that index holds, in words. */
export function heldWords({ holds, wanted_n }, index) {
  if (holds[index] === "position") return "It holds its length";
  return wanted_n[index] === null ? "It holds its tension" : `It holds its tension at ${fixed(wanted_n[index], 2)} N`;
}
