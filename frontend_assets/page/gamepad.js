// A gamepad as a leader: sticks are rates, a shoulder button that is held is the clutch. The server
// adds the rates up; this page only tells what the sticks say, and only while a button is held.

import { byId, setText } from "/assets/dom.js";

const POLL_MS = 16;
const [LEFT_SHOULDER, RIGHT_SHOULDER, LEFT_TRIGGER, RIGHT_TRIGGER] = [4, 5, 6, 7];
const [CROSS_LEFT, CROSS_RIGHT] = [14, 15];

export class GamepadLeader {
  /** `stream`: takes the samples; `refuse(reason)`: says why a press does nothing. */
  constructor(stream, refuse) {
    this.stream = stream;
    this.refuse = refuse;
    this.held = 0;
    this.ignored = false;
    setInterval(() => this.#poll(), POLL_MS);
    window.addEventListener("blur", () => setTimeout(() => document.hasFocus() || this.#letGo()));
    document.addEventListener("visibilitychange", () => document.hidden && this.#letGo());
  }

  #poll() {
    const pad = [...navigator.getGamepads()].find((one) => one?.connected && one.axes.length >= 4);
    // A gamepad that is gone while it leads falls silent, which pauses the robot.
    if (!pad) {
      this.#show("");
      this.held = 0;
      return;
    }
    const held = down(pad, LEFT_SHOULDER) + 2 * down(pad, RIGHT_SHOULDER);
    if (!held) {
      this.ignored = false;
      this.#release();
    } else if (!this.ignored) this.#lead(pad, held);
    this.#show(this.held ? "gamepad: moving while held" : "gamepad: hold a shoulder button to move");
  }

  #lead(pad, held) {
    if (!this.stream.driving) {
      this.#letGo();
      this.refuse("Take control first.");
      return;
    }
    if (this.stream.send({ type: "gamepad", axes: axesOf(pad), buttons: held })) this.held = held;
  }

  #release() {
    if (this.held) this.stream.send({ type: "gamepad", axes: [0, 0, 0, 0, 0, 0], buttons: 0 });
    this.held = 0;
  }

  /** Stop leading; what is held now must be let go before it counts again. */
  #letGo() {
    this.ignored = true;
    this.#release();
  }

  #show(words) {
    setText(byId("gamepad"), words && `· ${words}`);
  }
}

const down = (pad, index) => Number(pad.buttons[index]?.pressed === true);

const pressure = (pad, index) => pad.buttons[index]?.value ?? 0;

/** Right, up, toward the operator; then turns about those axes. Browsers count sticks downwards. */
function axesOf(pad) {
  const [x, y, yaw, pitch] = pad.axes;
  const toward = pressure(pad, LEFT_TRIGGER) - pressure(pad, RIGHT_TRIGGER);
  const roll = pressure(pad, CROSS_LEFT) - pressure(pad, CROSS_RIGHT);
  return [x, -y, toward, -pitch, -yaw, roll].map(bounded);
}

const bounded = (value) => (Number.isFinite(value) ? Math.min(Math.max(value, -1), 1) : 0);
