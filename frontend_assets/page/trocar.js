// The trocar: registered by touch or by numbers, its breathing, and the way out of it.

import { call } from "/assets/api.js";
import { byId, onPress, setBlocked, setText } from "/assets/dom.js";
import { fixed } from "/assets/format.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { numberIn, showNumber } from "/assets/number_field.js";
import { ROBOT } from "/assets/robots.js";

const AXES = ["x", "y", "z"];
const HOW = { configuration: "As configured", touch: "Touched by the tip", enter: "Entered" };
const BREATHING = { "breathing-amplitude": "amplitude_mm", "breathing-period": "period_s" };
const WITHDRAWAL_MS = 8000;

export class Trocar {
  constructor() {
    this.edited = false;
    for (const axis of AXES) {
      byId(`trocar-${axis}`).addEventListener("input", () => (this.edited = true));
    }
    onPress(byId("trocar-touch"), () => this.#register({ method: "touch" }), refuse);
    onPress(byId("trocar-configured"), () => this.#register({ method: "configuration" }), refuse);
    onPress(byId("trocar-enter"), () => this.#enter(), refuse);
    byId("trocar-form").addEventListener("submit", (event) => {
      event.preventDefault();
      byId("trocar-enter").click();
    });
    for (const [id, key] of Object.entries(BREATHING)) {
      byId(id).addEventListener("change", () => this.#breathe(key, numberIn(id)));
    }
    onPress(byId("withdraw"), () => this.#withdraw(), refuse);
  }

  #enter() {
    const position_mm = AXES.map((axis) => numberIn(`trocar-${axis}`));
    if (position_mm.some(Number.isNaN)) refuse("Enter x, y and z as numbers, in mm.");
    else this.#register({ method: "enter", position_mm });
  }

  async #register(body) {
    const trocar = await attempt(call("POST", `${ROBOT}/trocar`, body));
    if (!trocar) return;
    this.edited = false;
    const where = `${fixed(trocar.distance_mm, 1)} mm from the shaft’s axis, λ = ${fixed(trocar.lambda, 2)}`;
    if (trocar.inserted) tell(`The trocar is registered: ${where}.`);
    else refuse(`The shaft does not go through this trocar (${where}). Insert it before you enable.`);
  }

  async #breathe(key, value) {
    if (Number.isNaN(value)) refuse("Enter a number.");
    else if (await attempt(call("PUT", `${ROBOT}/trocar/breathing`, { [key]: value }))) {
      tell("The trocar breathes like that with its next breath.");
    }
  }

  async #withdraw() {
    await attempt(call("POST", `${ROBOT}/withdraw`, {}, WITHDRAWAL_MS));
  }

  show({ trocar, trocar_mm, errors, safety }, blocked) {
    const moves = safety.state === "ENABLED" ? "Pause or disable the robot first." : "";
    const fault = safety.state === "FAULT" ? "Reset the fault first." : "";
    const why = blocked || moves || fault;
    for (const id of ["trocar-touch", "trocar-enter", "trocar-configured"]) setBlocked(byId(id), why);
    AXES.forEach((axis, index) => showNumber(`trocar-${axis}`, trocar_mm[index], 2, this.edited, blocked));
    showNumber("breathing-amplitude", trocar.breathing_amplitude_mm, 1, false, blocked);
    showNumber("breathing-period", trocar.breathing_period_s, 1, false, blocked);
    const off = errors.rcm_mm === null ? "" : `, ${fixed(errors.rcm_mm, 2)} mm from the shaft`;
    setText(byId("trocar-words"), `${HOW[trocar.method]}${off}`);
    const asleep = safety.state === "ENABLED" ? "" : "Enable the robot first.";
    setBlocked(byId("withdraw"), blocked || asleep);
  }
}
