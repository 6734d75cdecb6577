// The one WebSocket: state comes in; heartbeats, hold and renewals go out.
// It reconnects by itself, waiting 0.25 s at first and twice as long each time, up to 4 s.

import { call } from "/assets/api.js";
import { ROBOT } from "/assets/robots.js";

const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 4000;
const HEARTBEAT_MS = 250;
const RENEW_MS = 1000;
const SILENCE_MS = 2500;
const ASLEEP_MS = 1000;

export class StateStream {
  /**
   * `onState(message)` for every state; `onLink({up, reason, retryAt})` when the link changes;
   * `onProblem(problem)` for a message of ours that the server refused; `onNotice({kind, text})`
   * for what else the server tells.
   */
  constructor({ onState, onLink, onProblem, onNotice }) {
    this.onState = onState;
    this.onLink = onLink;
    this.onProblem = onProblem;
    this.onNotice = onNotice;
    this.socket = null;
    this.up = false;
    this.holding = false;
    this.driving = false;
    this.lastMessage = 0;
    this.lastBeat = 0;
    this.tick = null;
    this.wait = FIRST_WAIT_MS;
    this.timer = null;
    setInterval(() => this.#beat(), HEARTBEAT_MS);
    setInterval(() => this.#renew(), RENEW_MS);
  }

  connect() {
    clearTimeout(this.timer);
    this.socket?.close();
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}${ROBOT}/stream?rate_hz=30`);
    this.socket = socket;
    this.lastMessage = performance.now();
    this.tick = null;
    socket.onmessage = (event) => this.#take(socket, event.data);
    socket.onclose = () => this.#lost(socket);
  }

  /** Send a message; false when there is no connection to send it on. */
  send(message) {
    if (this.socket?.readyState !== WebSocket.OPEN) return false;
    this.socket.send(JSON.stringify(message));
    return true;
  }

  /** Tell the server whether hold-to-move is down; repeated with every heartbeat while down. */
  hold(down) {
    this.holding = down;
    this.send({ type: "hold", down });
  }

  #take(socket, data) {
    if (socket !== this.socket) return;
    this.lastMessage = performance.now();
    this.wait = FIRST_WAIT_MS;
    const message = JSON.parse(data);
    if (!this.up) {
      this.up = true;
      this.onLink({ up: true, reason: "", retryAt: 0 });
    }
    if (message.type === "problem") this.onProblem(message.problem);
    if (message.type === "notice") this.onNotice(message);
    if (message.type !== "state") return;
    this.tick = message.tick;
    this.onState(message);
  }

  #lost(socket) {
    if (socket !== this.socket) return;
    this.up = false;
    this.holding = false;
    const wait = this.wait;
    this.wait = Math.min(this.wait * 2, LONGEST_WAIT_MS);
    this.timer = setTimeout(() => this.connect(), wait);
    this.onLink({ up: false, reason: "", retryAt: Date.now() + wait });
    this.#explain(socket);
  }

  /** A closed socket does not say why: ask over HTTP whether this page is still let in. */
  async #explain(socket) {
    try {
      await call("GET", `${ROBOT}/state`);
    } catch (refusal) {
      // Someone has chosen another robot: this page is not its page.
      if (refusal.code === "robot_not_selected") return location.reload();
      const current = socket === this.socket && !this.up;
      const refused = refusal.status === 401 || refusal.status === 403;
      if (current && refused) this.onLink({ up: false, reason: refusal.message, retryAt: null });
    }
  }

  #beat() {
    const now = performance.now();
    // After a sleep of the whole page, silence says nothing about the server.
    const awake = now - this.lastBeat < ASLEEP_MS;
    this.lastBeat = now;
    if (awake && this.socket?.readyState === WebSocket.OPEN && now - this.lastMessage > SILENCE_MS) {
      const silent = this.socket;
      silent.onclose = null;
      silent.close();
      this.#lost(silent);
      return;
    }
    // The tick tells the server how far we are, so that it sends no backlog.
    this.send(this.tick === null ? { type: "heartbeat" } : { type: "heartbeat", tick: this.tick });
    if (this.holding) this.send({ type: "hold", down: true });
  }

  #renew() {
    if (this.driving && document.visibilityState === "visible") this.send({ type: "renew" });
  }
}
