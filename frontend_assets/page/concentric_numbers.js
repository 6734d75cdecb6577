// The numbers of the two concentric-tube arms: translations between their bounds, rotations, and how
// much of each task was carried out.

import { byId, make, setText } from "/assets/dom.js";
import { fixed, percent } from "/assets/format.js";
import { barRow, plainRow, showBar, title } from "/assets/number_bars.js";

const NEAR_MM = 1;
const SCALES = [
  ["relative", "B beside A", "Share of the way back to B’s place that the method carried out; SNSQP scales tasks, others do not"],
  ["tracking", "A’s tip", "Share of the motion of A’s tip that the method carried out; SNSQP scales tasks, others do not"],
];

export class ConcentricNumbers {
  constructor() {
    this.arms = null;
  }

  #build(arms, columns) {
    this.arms = arms.map(({ name, translations_mm }) => {
      const column = make("div");
      const add = (row) => column.appendChild(row);
      const each = (make_row) => translations_mm.map((_, index) => add(make_row(index + 1)));
      add(title(`Tubes of ${name}`, "mm"));
      const translations = each((tube) => barRow(`${tube}`, `translation-${name}-${tube}`, `tube-${tube}`));
      add(title("Turned", "deg"));
      const rotations = each((tube) => plainRow(`${tube}`, `rotation-${name}-${tube}`, `Rotation of tube ${tube} of arm ${name} at its rear end`));
      return { column, translations, rotations };
    });
    this.arms[0].column.append(title("Carried out", ""), plainRow(SCALES[0][1], `scale-${SCALES[0][0]}`, SCALES[0][2]));
    this.arms[1].column.append(title("Carried out", ""), plainRow(SCALES[1][1], `scale-${SCALES[1][0]}`, SCALES[1][2]));
    columns.replaceChildren(...this.arms.map(({ column }) => column));
  }

  /** Show what `state` says in `columns`. */
  show({ arms, task_scale }, columns) {
    if (this.arms?.length !== arms.length || this.arms[0].translations.length !== arms[0].translations_mm.length) {
      this.#build(arms, columns);
    }
    arms.forEach(({ translations_mm, lower_mm, upper_mm, rotations_deg }, arm) => {
      const { translations, rotations } = this.arms[arm];
      translations.forEach((row, tube) => showBar(row, translations_mm[tube], boundsOf(lower_mm[tube], upper_mm[tube]), NEAR_MM, "mm"));
      rotations.forEach((row, tube) => setText(row.lastChild, fixed(rotations_deg[tube], 1)));
    });
    for (const [key] of SCALES) setText(byId(`scale-${key}`), task_scale[key] === null ? "–" : percent(task_scale[key]));
  }
}

const boundsOf = (lower, upper) => (lower === null || upper === null ? null : [lower, upper]);
