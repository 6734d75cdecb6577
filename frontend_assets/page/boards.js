// The board before the instrument: which stands there, and putting another in its place.

import { call } from "/assets/api.js";
import { byId, make, onPress, setBlocked, setData, setHidden, setText, setUnusable } from "/assets/dom.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";

const CHANGE_MS = 8000;

export class Boards {
  constructor() {
    this.titles = new Map();
    this.needed = null;
    this.changing = false;
    byId("board").addEventListener("change", () => this.#change(byId("board").value));
    onPress(byId("board-switch"), () => this.#change(this.needed), refuse);
  }

  /** Fill the list; tried again when the connection comes back. */
  async load() {
    if (this.titles.size > 0) return;
    let boards = [];
    try {
      boards = await call("GET", `${ROBOT}/boards`);
    } catch {
      return;
    }
    if (this.titles.size > 0) return;
    for (const { name, title } of boards) {
      this.titles.set(name, title);
      byId("board").append(make("option", "", title, { value: name }));
    }
  }

  title(name) {
    return this.titles.get(name) ?? name;
  }

  /** Why an experiment on the board `needed` cannot start while `present` stands there, or "". */
  why(needed, present) {
    if (needed === null || needed === present) return "";
    if (needed === "none") return "This experiment needs room. Disable the robot and take the board away.";
    return `This experiment is made for “${this.title(needed)}”. Disable the robot and put it there.`;
  }

  async #change(name) {
    this.changing = true;
    const done = await attempt(call("PUT", `${ROBOT}/board`, { name }, CHANGE_MS).then(() => true));
    this.changing = false;
    if (done) tell(name === "none" ? "The board is taken away." : `In front of the robot now: ${this.title(name)}.`);
  }

  /** `needed`: the board of the experiment that is chosen. */
  show({ board, safety }, blocked, needed) {
    this.needed = needed;
    const asleep = safety.state === "DISABLED" ? "" : "Only while the robot is disabled.";
    const why = blocked || asleep;
    const list = byId("board");
    if (!this.changing && document.activeElement !== list && list.value !== board) list.value = board;
    setUnusable(list, why);
    setData(list, "tip", `Board in front of the robot: ${this.title(board)}`);
    const other = this.why(needed, board) !== "";
    setHidden(byId("board-offer"), !other);
    const made = needed === "none" ? "Needs room: no board" : `Made for “${this.title(needed)}”`;
    if (other) setText(byId("board-needed"), made);
    setText(byId("board-switch"), needed === "none" ? "Take it away" : "Put it there");
    setBlocked(byId("board-switch"), why);
  }
}
