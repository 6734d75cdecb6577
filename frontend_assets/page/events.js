// The audit log's newest entries: what happened, by whom, and what was refused.

import { call } from "/assets/api.js";
import { byId, make } from "/assets/dom.js";
import { attempt } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";

const ASK_MS = 1500;
const SHOWN = 80;
const GRAVE = new Set(["refused", "process_ended", "process_hung", "emergency_stop", "scene_failed", "page_failed", "audit_lost", "records_lost"]);

export class Events {
  constructor() {
    this.timer = null;
    this.newest = "";
    this.asking = false;
  }

  opened() {
    clearInterval(this.timer);
    this.timer = setInterval(() => this.#ask(true), ASK_MS);
    this.#ask(false);
  }

  closed() {
    clearInterval(this.timer);
    this.timer = null;
  }

  async #ask(quietly) {
    if (byId("events-pane").hidden) this.closed();
    if (this.asking || document.hidden) return;
    this.asking = true;
    const request = call("GET", `${ROBOT}/audit?last=${SHOWN}`);
    const entries = await (quietly ? request.catch(() => null) : attempt(request));
    this.asking = false;
    if (entries) this.#show(entries);
  }

  #show(entries) {
    const last = entries.at(-1);
    const newest = last ? `${last.monotonic_ns} ${last.source} ${entries.length}` : "";
    if (newest === this.newest && byId("events").childElementCount) return;
    this.newest = newest;
    const rows = entries.reverse().map(rowOf);
    byId("events").replaceChildren(...(rows.length ? rows : [make("li", "muted", "Nothing has been noted yet.")]));
  }
}

function rowOf({ time, event, text, source, state, alike }) {
  const row = make("li");
  const grave = GRAVE.has(event) || state === "FAULT";
  if (grave) row.dataset.level = "grave";
  const moment = new Date(time);
  const clock = make("time", "", moment.toLocaleTimeString([], { hour12: false }), { datetime: time });
  clock.dataset.tip = `${moment.toLocaleString()}, noted by ${source}`;
  const more = alike ? ` (and ${alike} alike before)` : "";
  row.append(clock, make("span", "", `${grave ? "▲ " : ""}${text}${more}`));
  return row;
}
