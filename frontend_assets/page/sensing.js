// Sensing: whether there is an estimate and why not, the contact force and how well it is known, and
// the tension of the tendons.

import { byId, make, setData, setText } from "/assets/dom.js";
import { fixed, sentence } from "/assets/format.js";
import { fillRow, fullBar, showFill, title } from "/assets/number_bars.js";
import { heldWords } from "/assets/tendons.js";

/** What drives the tendons. */
export const ACTUATIONS = { servos: "servos", "tension-unit": "a tension unit" };

const HELD_S = 2;
const SWITCH_TIP = "Estimate shape and contact force from the tip’s pose and the tensions of the tendons (Y). Nothing moves by it";
const FORCE_TIP =
  "Force of whatever the tip touches, in newtons, with one standard deviation along its own direction. In the scene: 50 mm a newton, the ellipsoid is two standard deviations";

/**
 * The force along the directions in which it is observable. A direction that was not observable
 * counts as such for two seconds, so that nothing flickers with the noise of the estimate.
 */
export class KnownForce {
  #count = 3;
  #until_s = -Infinity;
  #state = null;
  #found = null;

  /** {force_n, deviation_n, unknown: axes that are not observable} of a state; null without an estimate. */
  of(state) {
    if (state !== this.#state) {
      this.#state = state;
      this.#found = state.sensing.valid ? this.#along(state) : null;
    }
    return this.#found;
  }

  #along({ time_s, sensing: { axes } }) {
    const observable = axes.filter((axis) => axis.observable).length;
    const holds = time_s >= this.#until_s - HELD_S && time_s < this.#until_s;
    if (observable <= this.#count || !holds) {
      this.#count = observable;
      this.#until_s = time_s + HELD_S;
    }
    const known = axes.slice(0, this.#count);
    const force_n = Math.hypot(...known.map(({ component_n }) => component_n));
    const spread = Math.hypot(...known.map(({ component_n, deviation_n }) => component_n * deviation_n));
    const widest = Math.max(0, ...known.map(({ deviation_n }) => deviation_n));
    return { force_n, deviation_n: force_n < 1e-9 ? widest : spread / force_n, unknown: axes.slice(this.#count) };
  }
}

/** The force that truly acts, or null where nobody knows it. */
export const trueForce = ({ sensing: { true_force_n } }) => (true_force_n.includes(null) ? null : Math.hypot(...true_force_n));

export class Sensing {
  /** `known`: a KnownForce. Puts its group before the other numbers. */
  constructor(known) {
    this.known = known;
    const root = make("section", "sensing", "", { id: "sensing-group", "aria-label": "Sensing" });
    const head = make("div", "sensing-head");
    this.lamp = make("p", "readiness", "", { id: "sensing-state", role: "status" });
    this.lamp.dataset.tip = "Whether shape and force can be estimated now, and why not";
    this.words = make("span", "", "–");
    this.lamp.append(make("i", "lamp"), this.words);
    const label = make("label", "switch");
    label.dataset.tip = SWITCH_TIP;
    label.append(make("input", "drive", "", { type: "checkbox", role: "switch", id: "sensing", "aria-label": "Sensing", "aria-keyshortcuts": "Y" }), make("kbd", "", "Y"));
    head.append(title("Sensing", ""), this.lamp, label);
    this.force = make("p", "sensing-force");
    this.force.dataset.tip = FORCE_TIP;
    const swatch = make("i", "swatch");
    setData(swatch, "word", "estimated");
    setData(swatch, "dashed", "true");
    this.value = make("strong", "", "–", { id: "force" });
    this.spread = make("span", "", "", { id: "force-deviation" });
    this.aside = make("span", "sensing-aside", "", { id: "force-aside" });
    this.force.append(swatch, make("span", "", "Force"), this.value, this.spread, this.aside);
    this.full_n = 0;
    this.range = make("span", "unit");
    const heading = title("Tendons", "N");
    heading.append(this.range);
    const tendons = make("div", "tendons");
    this.tension = [1, 2, 3, 4].map((number) => tendons.appendChild(fillRow(`T${number}`, `tension-${number}`)));
    root.append(head, this.force, heading, tendons);
    byId("numbers").append(root);
  }

  show(state) {
    this.#showForce(state);
    this.#showTension(state);
  }

  #showForce(state) {
    const { valid, enabled, fault, reason, action } = state.sensing;
    const found = this.known.of(state);
    setData(this.lamp, "level", valid ? "ok" : enabled && fault !== "no_tension_cells" ? "warn" : "none");
    setText(this.words, valid ? "Valid" : sentence(reason));
    setText(this.value, found === null ? "–" : fixed(found.force_n, 3));
    setText(this.spread, found === null ? "N" : `± ${fixed(found.deviation_n, 3)} N`);
    setText(this.aside, found === null ? sentence(action) : wordsOf(found.unknown));
    setData(this.aside, "tip", found === null ? sentence(action) : tipOf(found.unknown));
  }

  #showTension({ tension_n, sensing, tendons, actuation }) {
    this.full_n = fullBar(this.full_n, Math.min(sensing.tension_full_scale_n, Math.max(...tension_n, ...sensing.tension_n)));
    const range = sensing.cells ? `, 0 to ${this.full_n}` : "";
    setText(this.range, actuation ? `${range}, by ${ACTUATIONS[actuation]}` : range);
    const why = sensing.cells ? "Its cell gives no reading" : "Nothing on this robot measures it";
    tension_n.forEach((value, index) => {
      const told = { estimated: sensing.tension_n[index], wanted: tendons.wanted_n[index], held: heldWords(tendons, index) };
      showFill(this.tension[index], value, told, this.full_n, sensing.tension_full_scale_n, "N", why);
    });
  }
}

/** Where nothing is known of the force. */
function tipOf(unknown) {
  if (unknown.length === 0) return "The force is observable in every direction";
  const axes = unknown.map(({ direction, deviation_n }) => `(${direction.map((part) => fixed(part, 2)).join(", ")}), ± ${fixed(deviation_n, 2)} N`);
  return `Along ${axes.join("; ")}, base frame, hardly more is known of the force than was expected beforehand. It is left out of the figure; in the scene a broken grey line shows this axis`;
}

/** What is left out of the force, in words. */
function wordsOf(unknown) {
  if (unknown.length === 0) return "";
  if (unknown.length === 3) return "not observable";
  return unknown.length === 1 ? "one axis not observable" : "two axes not observable";
}
