// The operator's choices: priority, teleoperation. The server's state decides what is shown;
// while a change is on its way, the control keeps what the person chose.

import { call, ROBOT } from "/assets/api.js";
import { byId, onPress, setBlocked, setText, setUnusable } from "/assets/dom.js";
import { figure, fixed } from "/assets/format.js";
import { refuse, tell } from "/assets/notices.js";
import { viewOrientation } from "/assets/scene.js";

const SETTLE_MS = 400;
const SLIDER_MS = 100;
const SLIDER_STEPS = 1000;
const KEY_FACTOR = 1.25;

const SWITCHES = { "hold-to-move": "hold_to_move", "lock-rotation": "lock_rotation", "lock-translation": "lock_translation" };

export class Settings {
  constructor() {
    this.busy = new Map();
    this.range = { min: 0.05, max: 2 };
    this.lastSlide = 0;
    this.slideTimer = null;
    for (const [id, key] of Object.entries(SWITCHES)) {
      byId(id).addEventListener("change", () => this.#put("teleoperation", key, byId(id).checked));
    }
    this.#onPick("alignment", "teleoperation");
    this.#onPick("case", "priority");
    for (const key of ["solver", "coordinates"]) {
      byId(key).addEventListener("change", () => this.#put("priority", key, byId(key).value));
    }
    byId("compensation").addEventListener("change", () => this.#put("compensation", "mode", byId("compensation").value));
    byId("tracker").addEventListener("change", () => this.#put("compensation", "tracker", byId("tracker").checked));
    byId("motion-scale").addEventListener("input", () => this.#slide());
    byId("motion-scale").addEventListener("dblclick", () => this.#setScale(1));
    onPress(byId("align-view"), () => this.#alignView(), refuse);
  }

  #onPick(name, where) {
    for (const input of document.querySelectorAll(`input[name="${name}"]`)) {
      input.addEventListener("change", () => this.#put(where, name, input.value));
    }
  }

  /** Priority is sent with its case always; the rest only when changed. */
  async #put(where, key, value) {
    const body = { [key]: value };
    if (where === "priority" && key !== "case") body.case = picked("case");
    this.busy.set(key, Infinity);
    try {
      await call("PUT", `${ROBOT}/${where}`, body);
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

  #showInstrument({ compensation, tracker }) {
    const list = byId("compensation");
    if (this.#isFree("mode") && document.activeElement !== list) list.value = compensation;
    if (this.#isFree("tracker")) byId("tracker").checked = tracker.on;
    const seen = tracker.age_ms === null ? "No sample of a tracker" : `Newest sample ${fixed(tracker.age_ms, 0)} ms old`;
    const correction = `corrects by ${figure(tracker.correction_mm)} mm, ${figure(tracker.correction_deg)} deg`;
    setText(byId("tracker-words"), tracker.on ? `${seen}; ${correction}` : seen);
  }

  show({ priority, teleoperation, compensation, tracker }, blocked) {
    for (const [id, key] of Object.entries(SWITCHES)) {
      if (this.#isFree(key)) byId(id).checked = teleoperation[key];
    }
    if (this.#isFree("alignment")) pick("alignment", teleoperation.alignment);
    if (this.#isFree("case")) pick("case", priority.case);
    for (const key of ["solver", "coordinates"]) {
      if (this.#isFree(key) && document.activeElement !== byId(key)) byId(key).value = priority[key];
    }
    this.#showRange(teleoperation);
    this.#showInstrument({ compensation, tracker });
    for (const input of document.querySelectorAll("input.drive, select.drive")) setUnusable(input, blocked);
    if (!blocked && priority.solver === "hqp") setUnusable(byId("coordinates"), "The QP always uses u, v.");
    setBlocked(byId("align-view"), blocked);
  }
}

const picked = (name) => document.querySelector(`input[name="${name}"]:checked`)?.value;

function pick(name, value) {
  for (const input of document.querySelectorAll(`input[name="${name}"]`)) {
    const wanted = input.value === value;
    if (input.checked !== wanted) input.checked = wanted;
  }
}
