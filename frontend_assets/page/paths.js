// Paths: play an experiment or a CSV file, see its progress, stop it.

import { call } from "/assets/api.js";
import { byId, make, onPress, setBlocked, setData, setText } from "/assets/dom.js";
import { percent } from "/assets/format.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";

const LARGEST_BYTES = 20e6;

export class Paths {
  /** `why(board, state)`: why an experiment made for that board cannot be played now, or "". */
  constructor(why) {
    this.why = why;
    this.titles = new Map();
    this.boardOf = new Map();
    this.chosen = false;
    this.blocked = "";
    onPress(byId("play"), () => this.#play({ experiment: byId("experiment").value }), refuse);
    onPress(byId("stop-path"), () => attempt(call("DELETE", `${ROBOT}/path`)), refuse);
    byId("csv").addEventListener("change", () => this.#playFile(byId("csv").files[0]));
    byId("experiment").addEventListener("change", () => {
      this.chosen = true;
      this.#describe();
    });
    this.#startDrop();
    this.load();
  }

  /** Fill the list of experiments; tried again when the connection comes back. */
  async load() {
    if (this.titles.size > 0) return;
    let experiments = [];
    try {
      experiments = await call("GET", `${ROBOT}/experiments`);
    } catch {
      return;
    }
    if (this.titles.size > 0) return;
    for (const { name, title, board } of experiments) {
      this.titles.set(name, title);
      this.boardOf.set(name, board);
      byId("experiment").append(make("option", "", title, { value: name }));
    }
    this.#describe();
  }

  /** A long title is cut short in the list; the tooltip has it whole. */
  #describe() {
    const list = byId("experiment");
    setData(list, "tip", `Path to be played from the present pose: ${this.titles.get(list.value)}`);
  }

  /** Board of the experiment that is chosen. */
  get needed() {
    return this.boardOf.get(byId("experiment").value) ?? null;
  }

  async #play(path) {
    const answer = await attempt(call("POST", `${ROBOT}/path`, path).then(() => true));
    return answer === true;
  }

  async #playFile(file) {
    byId("csv").value = "";
    if (!file) return;
    if (this.blocked) return refuse(this.blocked);
    if (file.size > LARGEST_BYTES) return refuse(`${file.name} is larger than ${LARGEST_BYTES / 1e6} MB.`);
    const name = file.name.slice(0, 80);
    if (await this.#play({ csv: await file.text(), name })) tell(`Playing ${file.name}.`);
  }

  #startDrop() {
    // A file dropped beside the target must not replace the page.
    for (const name of ["dragover", "drop"]) window.addEventListener(name, (event) => event.preventDefault());
    const drop = byId("drop");
    drop.addEventListener("dragover", () => setData(drop, "over", "true"));
    for (const name of ["dragleave", "drop"]) drop.addEventListener(name, () => setData(drop, "over", ""));
    byId("path-group").addEventListener("drop", (event) => {
      event.preventDefault();
      this.#playFile(event.dataTransfer.files[0]);
    });
  }

  /** At first, an experiment that can be played as things stand. */
  #choose(state) {
    if (this.chosen || this.titles.size === 0) return;
    this.chosen = true;
    const fitting = [...this.boardOf.keys()].find((name) => this.why(this.boardOf.get(name), state) === "");
    if (fitting !== undefined) byId("experiment").value = fitting;
    this.#describe();
  }

  show(state, blocked) {
    const { path, safety, control } = state;
    if (control === "running") this.#choose(state);
    const asleep = safety.state === "ENABLED" ? "" : "Enable the robot first.";
    const running = path ? "A path is playing. Stop it first." : "";
    this.blocked = blocked || asleep || running;
    const listed = this.titles.size ? "" : "No experiments were listed.";
    setBlocked(byId("play"), this.why(this.needed, state) || this.blocked || listed);
    setBlocked(byId("stop-path"), blocked || (path ? "" : "No path is playing."));
    byId("path-progress").value = path?.progress ?? 0;
    const name = this.titles.get(path?.name) ?? path?.name ?? "Path";
    setText(byId("path-text"), path ? `${percent(path.progress ?? 0)} ${name}` : "No path");
    setData(byId("path-text"), "tip", path ? name : "No path is playing");
  }
}
