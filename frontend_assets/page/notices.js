// What the page tells the person: short toasts, the banner of a fault, the lost connection.

import { byId, make, setData, setHidden, setText } from "/assets/dom.js";
import { sentence } from "/assets/format.js";

const SHOWN_MS = { info: 5000, error: 8000 };
const AT_MOST = 3;

/** Show a short message; the same message is not shown twice at once. */
export function tell(text, kind = "info") {
  const toasts = byId("toasts");
  for (const shown of toasts.children) {
    if (shown.dataset.text === text) shown.remove();
  }
  while (toasts.children.length >= AT_MOST) toasts.firstElementChild.remove();
  const toast = make("div", "toast", "", { role: kind === "error" ? "alert" : "status" });
  toast.dataset.kind = kind;
  toast.dataset.text = text;
  if (kind === "error") toast.append(symbol("icon-fault"));
  const close = make("button", "button small", "Close", { type: "button", "aria-label": "Close this message" });
  close.addEventListener("click", () => toast.remove());
  toast.append(make("p", "", text), close);
  toasts.append(toast);
  setTimeout(() => toast.remove(), SHOWN_MS[kind]);
}

export const refuse = (reason) => tell(reason, "error");

/** Run a request and show its refusal; resolves with the answer, or null when refused. */
export async function attempt(request) {
  try {
    return await request;
  } catch (refusal) {
    refuse(refusal.message);
    return null;
  }
}

/** The banner over the scene: a fault in full words, or a control process that is not running. */
export function showBanner(state) {
  const [title, text, kind] = bannerOf(state);
  setHidden(byId("banner"), title === "");
  setData(byId("banner"), "kind", kind);
  setText(byId("banner-title"), title);
  setText(byId("banner-text"), text);
}

function bannerOf({ safety, control }) {
  if (control !== "running") {
    const title = `Control is ${control}`;
    const reason = sentence(safety.reason);
    const words = [reason === `${title}.` ? "" : reason, sentence(safety.action)];
    return [title, words.join(" ").trim(), control === "starting" ? "notice" : "fault"];
  }
  if (safety.state === "FAULT") return [`Fault: ${safety.reason}`, sentence(safety.action), "fault"];
  return ["", "", "fault"];
}

const link = { up: true, reason: "", retryAt: 0, driving: false, starting: "" };
setInterval(countDown, 250);

/** Cover the scene while there is no connection. */
export function showLink(change, driving) {
  Object.assign(link, change);
  if (driving) link.driving = true;
  if (link.up) link.driving = false;
  document.body.dataset.link = link.up ? "up" : "lost";
  if (!link.starting) showLost();
}

/** Cover the scene while the console starts anew with the robot of that title; "" uncovers it. */
export function showStarting(title) {
  link.starting = title;
  setHidden(byId("retry"), title !== "");
  if (!title) return showLost();
  setHidden(byId("lost"), false);
  setText(byId("lost-title"), `Starting: ${title}`);
  setText(byId("lost-text"), "The console starts anew with this robot. It will be disabled, and nobody will drive it.");
  setText(byId("lost-next"), "Starting… this takes up to a minute");
}

function showLost() {
  setHidden(byId("lost"), link.up);
  setText(byId("lost-title"), link.reason ? "Not let in" : "Connection lost");
  const pause = link.driving ? "You were driving: the server pauses the robot by itself. " : "";
  const stop = "The emergency stop of this page does not reach the robot now.";
  setText(byId("lost-text"), link.reason || `Nothing on this page is current. ${pause}${stop}`);
  countDown();
}

function countDown() {
  if (link.up || link.starting || link.retryAt === null) return;
  const seconds = Math.max(0, Math.ceil((link.retryAt - Date.now()) / 1000));
  setText(byId("lost-next"), seconds > 0 ? `Trying again in ${seconds} s` : "Trying now…");
}

function symbol(id) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("class", "icon");
  svg.setAttribute("aria-hidden", "true");
  const use = document.createElementNS("http://www.w3.org/2000/svg", "use");
  use.setAttribute("href", `#${id}`);
  svg.append(use);
  return svg;
}
