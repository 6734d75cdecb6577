// The instrument's numbers: joints, servos, what each level of the priority leaves.

import { byId, make, setText } from "/assets/dom.js";
import { figure } from "/assets/format.js";
import { barRow, plainRow, showBar, title } from "/assets/number_bars.js";

const NEAR_DEG = 5;
const NOT_MET = "Part of the commanded twist that this level could not follow";
const RESIDUALS = [
  ["rcm_mm_s", "RCM, mm/s"],
  ["linear_mm_s", "Linear, mm/s"],
  ["angular_deg_s", "Angular, deg/s"],
];

export class InstrumentNumbers {
  constructor() {
    this.servoRange_deg = null;
    this.joints = null;
  }

  /** Rows are made once the count of joints is known. */
  #build({ joints_deg, servos_deg }, columns) {
    const left = make("div");
    left.append(title("Joints", "deg"));
    this.joints = joints_deg.map((_, index) => left.appendChild(barRow(`J${index + 1}`, `joint-${index + 1}`)));
    const right = make("div");
    right.append(title("Servos", "deg"));
    this.servos = servos_deg.map((_, index) => right.appendChild(barRow(`S${index + 1}`, `servo-${index + 1}`)));
    right.append(title("Not met", "per level"));
    right.append(...RESIDUALS.map(([key, words]) => plainRow(words, `residual-${key}`, NOT_MET)));
    columns.replaceChildren(left, right);
  }

  /** Show what `state` says in `columns`. */
  show(state, columns) {
    if (this.joints?.length !== state.joints_deg.length || this.servos.length !== state.servos_deg.length) {
      this.#build(state, columns);
    }
    state.joints_deg.forEach((value, index) => showBar(this.joints[index], value, state.joint_limits_deg[index], NEAR_DEG, "deg"));
    const range = this.servoRange_deg === null ? null : [-this.servoRange_deg, this.servoRange_deg];
    state.servos_deg.forEach((value, index) => showBar(this.servos[index], value, range, NEAR_DEG, "deg"));
    for (const [key] of RESIDUALS) setText(byId(`residual-${key}`), figure(state.residuals[key]));
  }
}
