// A recording shown in place of a robot: play, pause, time and speed. Everyone sees the same.

import { call } from "/assets/api.js";
import { byId, onPress, setBlocked, setData, setHidden, setText } from "/assets/dom.js";
import { clock } from "/assets/format.js";
import { attempt, refuse } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";

const STEP_S = 0.01;
const SETTLE_MS = 400;

export const REPLAY_WORDS = "This is a replay: nothing moves.";

export class Replay {
  constructor() {
    this.state = null;
    this.wanted = null;
    this.sending = false;
    this.touched = -Infinity;
    onPress(byId("replay-play"), () => this.#ask({ playing: !this.state.playing }), refuse);
    byId("replay-time").addEventListener("input", () => this.#seek());
    byId("replay-speed").addEventListener("change", () => this.#ask({ speed: Number(byId("replay-speed").value) }));
  }

  #ask(change) {
    return attempt(call("PUT", `${ROBOT}/replay`, change));
  }

  /** While the slider moves, one request is under way and only the newest place waits. */
  async #seek() {
    this.touched = performance.now();
    this.wanted = Number(byId("replay-time").value);
    this.#showTime(this.wanted);
    if (this.sending) return;
    this.sending = true;
    while (this.wanted !== null) {
      const time_s = this.wanted;
      this.wanted = null;
      await this.#ask({ time_s });
    }
    this.sending = false;
  }

  show({ replay }, up) {
    this.state = replay;
    const shown = replay !== null && replay !== undefined;
    setHidden(byId("replay"), !shown);
    setHidden(byId("replay-play"), !shown);
    setData(document.body, "replay", shown ? "true" : "");
    if (!shown) return;
    setBlocked(byId("replay-play"), up ? "" : "No connection to the server.");
    byId("replay-play").setAttribute("aria-label", replay.playing ? "Pause replay" : "Play replay");
    const icon = replay.playing ? "#icon-paused" : "#icon-play";
    if (byId("replay-icon").getAttribute("href") !== icon) byId("replay-icon").setAttribute("href", icon);
    const slider = byId("replay-time");
    if (slider.max !== String(replay.duration_s)) slider.max = replay.duration_s;
    slider.step = STEP_S;
    const cut = replay.cut ? ", cut off" : "";
    setText(byId("replay-file"), replay.file);
    setData(byId("replay-file"), "tip", `${replay.file}, recorded ${replay.started.replace("T", " ").replace("+00:00", " UTC")}${cut}`);
    const speed = byId("replay-speed");
    if (document.activeElement !== speed) speed.value = String(replay.speed);
    // A hand on the slider is right until the server has followed it.
    if (this.sending || performance.now() - this.touched < SETTLE_MS) return;
    slider.value = replay.time_s;
    this.#showTime(replay.time_s);
  }

  #showTime(time_s) {
    const words = `${clock(time_s)} / ${clock(this.state?.duration_s ?? 0)}`;
    setText(byId("replay-clock"), words);
    byId("replay-time").setAttribute("aria-valuetext", words);
  }
}
