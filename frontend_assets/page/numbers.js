// The numbers below the plots: poses, limits in words, joints, servos, what each level leaves.

import { byId, make, setData, setHidden, setText } from "/assets/dom.js";
import { figure, fixed } from "/assets/format.js";

const NEAR_DEG = 5;
const POSES = [
  ["desired", "Desired"],
  ["commanded", "Commanded"],
  ["true", "True"],
];
const RESIDUALS = [
  ["rcm_mm_s", "RCM, mm/s"],
  ["linear_mm_s", "Linear, mm/s"],
  ["angular_deg_s", "Angular, deg/s"],
];

export class Numbers {
  constructor() {
    this.servoRange_deg = null;
    this.#buildTip();
    this.limits = make("div", "limits-words", "", { id: "limits", role: "group", "aria-label": "Active limits" });
    this.columns = make("div", "columns");
    byId("numbers").append(this.limits, this.columns);
    this.joints = null;
  }

  #buildTip() {
    const table = make("table", "tip");
    const head = table.createTHead().insertRow();
    for (const words of ["Tip, mm", "x", "y", "z"]) head.append(make("th", "", words, { scope: "col" }));
    this.tip = new Map();
    for (const [key, title] of POSES) {
      const row = table.createTBody().insertRow();
      const name = make("th", "", "", { scope: "row" });
      const swatch = make("i", "swatch");
      swatch.dataset.word = key;
      const word = make("span", "", title);
      name.append(swatch, word);
      row.append(name);
      const cells = ["x", "y", "z"].map((axis) => make("td", "", "–", { id: `tip-${key}-${axis}` }));
      row.append(...cells);
      this.tip.set(key, { cells, word, swatch });
    }
    byId("numbers").append(table);
  }

  /** Rows are made once the count of joints is known. */
  #buildColumns({ joints_deg, servos_deg }) {
    const left = make("div");
    left.append(title("Joints", "deg"));
    this.joints = joints_deg.map((_, index) => left.appendChild(barRow(`J${index + 1}`, `joint-${index + 1}`)));
    const right = make("div");
    right.append(title("Servos", "deg"));
    this.servos = servos_deg.map((_, index) => right.appendChild(barRow(`S${index + 1}`, `servo-${index + 1}`)));
    right.append(title("Tendons", "N"));
    const tendons = right.appendChild(make("div", "tendons"));
    tendons.dataset.tip = "Tension of tendons 1 to 4, at the servos";
    this.tension = servos_deg.map((_, index) => tendons.appendChild(make("span", "", "–", { id: `tension-${index + 1}` })));
    right.append(title("Not met", "per level"));
    this.residuals = RESIDUALS.map(([key, words]) => {
      const row = make("div", "row plain");
      row.append(make("span", "", words), make("span", "value", "–", { id: `residual-${key}` }));
      row.dataset.tip = "Part of the commanded twist that this level could not follow";
      return right.appendChild(row);
    });
    this.columns.replaceChildren(left, right);
  }

  show(state) {
    if (this.joints?.length !== state.joints_deg.length || this.servos.length !== state.servos_deg.length) {
      this.#buildColumns(state);
    }
    this.#showTip(state);
    this.#showLimits(state.limits);
    state.joints_deg.forEach((value, index) => showBar(this.joints[index], value, state.joint_limits_deg[index]));
    const range = this.servoRange_deg === null ? null : [-this.servoRange_deg, this.servoRange_deg];
    state.servos_deg.forEach((value, index) => showBar(this.servos[index], value, range));
    state.tension_n.forEach((value, index) => setText(this.tension[index], fixed(value, 2)));
    RESIDUALS.forEach(([key], index) => setText(this.residuals[index].lastChild, figure(state.residuals[key])));
  }

  #showTip(state) {
    for (const [key] of POSES) {
      const { cells, word, swatch } = this.tip.get(key);
      const position = state[key]?.position_mm;
      cells.forEach((cell, axis) => setText(cell, position ? fixed(position[axis], 2) : "–"));
      if (key !== "true") continue;
      // On hardware nothing is true; the errors are then against what is measured.
      setText(word, state.errors.source === "measured" ? "Measured" : "True");
      setData(swatch, "word", state.errors.source);
    }
  }

  #showLimits(limits) {
    const words = limits.join("\n");
    if (this.limits.dataset.words === words) return;
    this.limits.dataset.words = words;
    const tags = limits.length ? limits.map((limit) => make("span", "limit-tag", limit)) : [make("span", "", "none")];
    this.limits.replaceChildren(title("Active limits", ""), ...tags);
  }
}

function title(words, unit) {
  const heading = make("h3", "", unit ? `${words}, ` : words);
  if (unit) heading.append(make("span", "unit", unit));
  return heading;
}

function barRow(name, id) {
  const row = make("div", "row");
  const bar = make("span", "bar");
  bar.append(make("i"));
  row.append(make("span", "muted", name), bar, make("span", "value", "–", { id }));
  return row;
}

/** `range`: [low, high] in degrees, or null where it is not known. */
function showBar(row, value, range) {
  setText(row.lastChild, fixed(value, 1));
  const [, bar] = row.children;
  const known = range !== null && value !== null;
  setHidden(bar, !known);
  if (!known) return;
  const share = Math.min(1, Math.max(0, (value - range[0]) / (range[1] - range[0])));
  bar.firstChild.style.left = `${(share * 100).toFixed(1)}%`;
  row.classList.toggle("near", value - range[0] < NEAR_DEG || range[1] - value < NEAR_DEG);
  setData(row, "tip", `From ${fixed(range[0], 1)} to ${fixed(range[1], 1)} deg`);
}
