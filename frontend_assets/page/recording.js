// The button that starts and stops a recording, and what is known of the present one.

import { call } from "/assets/api.js";
import { byId, onPress, setBlocked, setData, setText } from "/assets/dom.js";
import { clock } from "/assets/format.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";

const ASK_MS = 1000;

export class Recording {
  constructor() {
    this.on = false;
    this.known = null;
    onPress(byId("record"), () => this.#press(), refuse);
    setInterval(() => this.on && this.#ask(), ASK_MS);
  }

  async #press() {
    const method = this.on ? "DELETE" : "POST";
    const answer = await attempt(call(method, `${ROBOT}/recording`, this.on ? undefined : {}));
    if (!answer) return;
    this.known = answer;
    tell(answer.recording ? `Recording into ${answer.file}` : `Recorded ${clock(answer.duration_s)} into ${answer.file}`);
  }

  async #ask() {
    try {
      this.known = await call("GET", `${ROBOT}/recording`);
    } catch {
      // The state still tells whether it records; the rest is asked for again.
    }
  }

  /** It has ended: find out whether by itself. */
  async #ended() {
    await this.#ask();
    if (this.known?.problem && !this.known.recording) refuse(`Recording ended: ${this.known.problem}`);
  }

  show({ recording, replay }, up) {
    if (this.on && !recording) this.#ended();
    this.on = recording;
    const button = byId("record");
    const offline = up ? "" : "No connection to the server.";
    setBlocked(button, offline || (replay ? "This is a replay of a recording." : ""));
    setText(byId("recording"), recording ? `● ${clock(this.known?.duration_s ?? 0)}` : "Off");
    button.setAttribute("aria-pressed", String(recording));
    button.setAttribute("aria-label", recording ? "Stop recording" : "Start recording");
    const lost = recording && this.known?.lost_ticks > 0;
    setData(byId("fact-recording"), "level", lost ? "warn" : "");
    setData(button, "tip", this.#words(recording));
  }

  #words(recording) {
    if (!recording) return "Write every tick down in a new file (L)";
    if (!this.known?.file) return "Every tick is written down. Press to stop (L)";
    const { file, size_mb, gaps, lost_ticks } = this.known;
    const missing = gaps ? `${lost_ticks} ticks are missing in ${gaps} gaps` : "no gaps";
    return `${file}: ${size_mb.toFixed(1)} MB, ${missing}. Press to stop (L)`;
  }
}
