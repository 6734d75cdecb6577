// One line about the stylus, where there is one: its rate, or what is amiss.

import { call } from "/assets/api.js";
import { byId, setData, setText } from "/assets/dom.js";
import { ROBOT } from "/assets/robots.js";

const ASK_MS = 1000;

export function startStylus(isUp) {
  setInterval(async () => {
    if (!isUp() || document.hidden) return;
    try {
      show((await call("GET", `${ROBOT}/leaders`)).stylus);
    } catch {
      setText(byId("stylus"), "");
    }
  }, ASK_MS);
}

function show(stylus) {
  // A console without a stylus says nothing of one.
  if (!stylus || (stylus.source === "websocket" && !stylus.connected)) {
    setText(byId("stylus"), "");
    return;
  }
  const words = stylus.message || `${Math.round(stylus.rate_hz)} Hz`;
  setText(byId("stylus"), `· stylus: ${words}`);
  const { counts } = stylus;
  const bad = Object.entries(counts).filter(([name, count]) => name !== "samples" && count > 0);
  const told = bad.map(([name, count]) => `${name.replaceAll("_", " ")} ${count}`).join(", ");
  setData(byId("stylus"), "tip", `${stylus.url}. Refused: ${told || "nothing"}`);
}
