// Safety requests and hold-to-move.

import { call } from "/assets/api.js";
import { byId, onPress, setBlocked, setData, setText } from "/assets/dom.js";
import { sentence } from "/assets/format.js";
import { attempt, refuse } from "/assets/notices.js";
import { REPLAY_WORDS } from "/assets/replay.js";
import { ROBOT } from "/assets/robots.js";

const REQUESTS = ["enable", "pause", "disable", "reset"];

/** Where a request has no sense, and why. A missing entry means that it may be asked for. */
const SENSELESS = {
  enable: { ENABLED: "The robot is enabled already.", FAULT: "Reset the fault first." },
  pause: {
    DISABLED: "Nothing moves: the robot is disabled.",
    PAUSED: "The robot is paused already.",
    FAULT: "Nothing moves: the robot is in a fault.",
  },
  disable: { DISABLED: "The robot is disabled already.", FAULT: "Reset the fault first." },
  reset: {
    DISABLED: "There is no fault to reset.",
    ENABLED: "There is no fault to reset.",
    PAUSED: "There is no fault to reset.",
  },
};

/** What a person most likely wants to press next. */
const NEXT = { DISABLED: "enable", PAUSED: "enable", FAULT: "reset" };

/** What stands against enabling beside the state and who drives, or "". */
function whyNotEnabled({ readiness, operator }) {
  if (operator.offered_to) return `Control is offered to ${operator.offered_to}: withdraw the offer first.`;
  return readiness.state === "ready" ? "" : wordsOf(readiness);
}

const wordsOf = ({ reason, action }) => `${sentence(reason)} ${sentence(action)}`.trim();

function showReadiness(readiness, known) {
  const ready = readiness.state === "ready";
  setData(byId("readiness"), "level", !known ? "none" : ready ? "ok" : readiness.state === "busy" ? "busy" : "warn");
  setText(byId("readiness-words"), !known ? "Devices: not known" : ready ? "Devices ready" : wordsOf(readiness));
}

export class Motion {
  /** `stream`: the WebSocket, which is faster than a request; `take(state)`: newest state. */
  constructor(stream, take) {
    this.stream = stream;
    this.take = take;
    this.holdBlocked = "No connection to the server.";
    for (const name of REQUESTS) onPress(byId(name), () => this.#ask(name), refuse);
    this.#startStop(byId("emergency-stop"));
    this.#startHold(byId("hold"));
  }

  async #ask(name) {
    const state = await attempt(call("POST", `${ROBOT}/${name}`));
    if (state?.type === "state") this.take(state);
  }

  /** It stops when the button goes down; the click that ends the same press is not a second one. */
  #startStop(button) {
    let down = false;
    button.addEventListener("pointerdown", (event) => {
      down = event.button === 0;
      if (down) this.stop();
    });
    button.addEventListener("click", () => {
      if (!down) this.stop();
      down = false;
    });
  }

  /** Both ways at once: whichever arrives first stops the robot; a second stop does no harm. */
  async stop() {
    this.stream.send({ type: "emergency-stop" });
    try {
      const state = await call("POST", `${ROBOT}/emergency-stop`);
      if (state?.type === "state") this.take(state);
    } catch (refusal) {
      if (refusal.code === "only_a_replay") refuse(REPLAY_WORDS);
      else refuse(`Emergency stop not confirmed: ${refusal.message} Use the stop on the machine.`);
    }
  }

  #startHold(button) {
    button.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      if (this.holdBlocked) refuse(this.holdBlocked);
      else {
        button.setPointerCapture(event.pointerId);
        this.hold(true);
      }
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      button.addEventListener(end, () => this.hold(false));
    }
    button.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  hold(down) {
    if (down === this.stream.holding) return;
    if (down && this.holdBlocked) return;
    this.stream.hold(down);
    this.#showHold(down);
  }

  #showHold(down) {
    byId("hold").setAttribute("aria-pressed", String(down));
    setText(byId("hold-text"), down ? "Moving while held" : "Move while held");
  }

  /** `blocked`: why this page may not drive, or "". */
  show(state, blocked, up) {
    const name = state.safety.state;
    showReadiness(state.readiness, up && !state.replay);
    for (const request of REQUESTS) {
      const open = request === "pause" && up && !state.replay;
      const senseless = SENSELESS[request][name] ?? "";
      const unready = request === "enable" && !blocked ? whyNotEnabled(state) : "";
      setBlocked(byId(request), senseless || (open ? "" : blocked) || unready);
      byId(request).classList.toggle("next", NEXT[name] === request && !blocked && !unready);
    }
    this.#showHoldable(state, blocked);
    setText(byId("watcher-note"), blocked);
    setData(byId("watcher-note"), "why", blocked);
  }

  #showHoldable(state, blocked) {
    const off = state.teleoperation.hold_to_move ? "" : "Hold-to-move is off: an enabled robot follows the leader.";
    this.holdBlocked = blocked || off;
    if (this.holdBlocked && this.stream.holding) this.hold(false);
    setBlocked(byId("hold"), this.holdBlocked);
    this.#showHold(this.stream.holding);
  }
}
