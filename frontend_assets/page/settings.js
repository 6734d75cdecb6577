// The operator's choices. The server's state decides what is shown; while a change is on its way, the
// control keeps what the person chose.

import { call } from "/assets/api.js";
import { byId, onPress, setBlocked, setText, setUnusable } from "/assets/dom.js";
import { refuse, tell } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";
import { viewOrientation } from "/assets/scene.js";

const SETTLE_MS = 400;
const SLIDER_MS = 100;
const SLIDER_STEPS = 1000;
const KEY_FACTOR = 1.25;

/**
 * What every robot lets its operator choose. `control`: "switch" or "list" with that `id`, or "radio"
 * with that name; `where`, `key`: where it is put; `read(state)`: what is in force; `beside()`: what
 * has to be put with it.
 */
const SHARED = [
  { control: "switch", id: "hold-to-move", where: "teleoperation", key: "hold_to_move", read: (state) => state.teleoperation.hold_to_move },
  { control: "switch", id: "lock-translation", where: "teleoperation", key: "lock_translation", read: (state) => state.teleoperation.lock_translation },
];

export class Settings {
  /** `own`: choices that only this robot has, in the form of those above. */
  constructor(own) {
    this.choices = [...SHARED, ...own];
    this.busy = new Map();
    this.range = { min: 0.05, max: 2 };
    this.lastSlide = 0;
    this.slideTimer = null;
    for (const choice of this.choices) this.#listen(choice);
    byId("motion-scale").addEventListener("input", () => this.#slide());
    byId("motion-scale").addEventListener("dblclick", () => this.#setScale(1));
    onPress(byId("align-view"), () => this.#alignView(), refuse);
  }

  #listen({ control, id, where, key, beside }) {
    for (const input of inputsOf(control, id)) {
      input.addEventListener("change", () => {
        const value = control === "switch" ? input.checked : input.value;
        this.#put(where, key, value, beside?.() ?? {});
      });
    }
  }

  async #put(where, key, value, beside = {}) {
    this.busy.set(key, Infinity);
    try {
      await call("PUT", `${ROBOT}/${where}`, { ...beside, [key]: value });
      this.busy.set(key, performance.now() + SETTLE_MS);
      return true;
    } catch (refusal) {
      this.busy.delete(key);
      refuse(refusal.message);
      return false;
    }
  }

  async #alignView() {
    const view = viewOrientation();
    if (view === null) refuse("The scene has no camera yet. Wait until it is shown.");
    else if (await this.#put("teleoperation", "view_wxyz", view)) tell("Leader motion now follows the view.");
  }

  /** Step the motion scale by a key. */
  step(direction) {
    const slider = byId("motion-scale");
    if (slider.disabled) refuse(slider.closest("[data-tip]").dataset.why);
    else this.#setScale(this.#scale() * KEY_FACTOR ** direction);
  }

  #setScale(scale) {
    byId("motion-scale").value = String(this.#position(scale));
    this.#slide();
  }

  #slide() {
    this.busy.set("motion_scale", Infinity);
    this.#showScale(this.#scale());
    clearTimeout(this.slideTimer);
    const wait = Math.max(0, this.lastSlide + SLIDER_MS - performance.now());
    this.slideTimer = setTimeout(() => {
      this.lastSlide = performance.now();
      this.#put("teleoperation", "motion_scale", Number(this.#scale().toPrecision(3)));
    }, wait);
  }

  #scale() {
    const share = Number(byId("motion-scale").value) / SLIDER_STEPS;
    return this.range.min * (this.range.max / this.range.min) ** share;
  }

  #position(scale) {
    const share = Math.log(scale / this.range.min) / Math.log(this.range.max / this.range.min);
    return Math.round(SLIDER_STEPS * Math.min(1, Math.max(0, share)));
  }

  #showScale(scale) {
    const words = `${scale.toFixed(2)} ×`;
    setText(byId("motion-scale-value"), words);
    byId("motion-scale").setAttribute("aria-valuetext", words);
  }

  #isFree(key) {
    return !(this.busy.get(key) > performance.now());
  }

  #showRange({ motion_scale, motion_scale_min, motion_scale_max }) {
    if (motion_scale === null) return;
    this.range = { min: motion_scale_min, max: motion_scale_max };
    setText(byId("motion-scale-min"), `${motion_scale_min} ×`);
    setText(byId("motion-scale-max"), `${motion_scale_max} ×`);
    if (!this.#isFree("motion_scale")) return;
    byId("motion-scale").value = String(this.#position(motion_scale));
    this.#showScale(motion_scale);
  }

  show(state, blocked) {
    for (const { control, id, key, read } of this.choices) {
      if (this.#isFree(key)) pick(control, id, read(state));
    }
    this.#showRange(state.teleoperation);
    for (const input of document.querySelectorAll("input.drive, select.drive")) setUnusable(input, blocked);
    setBlocked(byId("align-view"), blocked);
  }
}

const inputsOf = (control, id) =>
  control === "radio" ? [...document.querySelectorAll(`input[name="${id}"]`)] : [byId(id)];

/** What is chosen among the radio buttons of that name. */
export const picked = (name) => document.querySelector(`input[name="${name}"]:checked`)?.value;

function pick(control, id, value) {
  for (const input of inputsOf(control, id)) {
    if (control === "list") {
      // A list that is open in front of a person is not changed under their hands.
      if (document.activeElement !== input && input.value !== value) input.value = value;
    } else {
      const wanted = control === "switch" ? value : input.value === value;
      if (input.checked !== wanted) input.checked = wanted;
    }
  }
}
