// One tooltip for the page, from data-tip, and data-why where a control cannot be used now.
// It shows on hover after a moment and on keyboard focus at once.

import { byId, make } from "/assets/dom.js";

const DELAY_MS = 450;
const GAP_PX = 8;

let owner = null;
let timer = null;

export function startTooltips() {
  document.addEventListener("pointerover", (event) => aim(event.target, DELAY_MS));
  document.addEventListener("pointerdown", hide);
  document.addEventListener("focusin", (event) => {
    if (event.target.matches(":focus-visible")) aim(event.target, 0);
  });
  document.addEventListener("focusout", hide);
  document.documentElement.addEventListener("pointerleave", hide);
  for (const element of document.querySelectorAll("[data-tip]")) describe(element);
}

/** Give assistive technology the same words. */
function describe(element) {
  const control = element.matches("button, select, input") ? element : element.querySelector("input, select");
  control?.setAttribute("aria-description", element.dataset.tip);
}

function aim(target, delay) {
  const found = target.closest?.("[data-tip]") ?? null;
  if (found === owner) return;
  hide();
  owner = found;
  if (owner) timer = setTimeout(() => show(owner), delay);
}

function hide() {
  clearTimeout(timer);
  owner = null;
  byId("tooltip").hidden = true;
}

function show(element) {
  const tooltip = byId("tooltip");
  tooltip.replaceChildren(element.dataset.tip);
  if (element.dataset.why) tooltip.append(make("strong", "", `Not now: ${element.dataset.why}`));
  // An element of the top layer hides what is outside of it.
  (element.closest("dialog, [popover]") ?? document.body).append(tooltip);
  tooltip.hidden = false;
  const around = element.getBoundingClientRect();
  const own = tooltip.getBoundingClientRect();
  const below = around.bottom + GAP_PX + own.height < innerHeight;
  const top = below ? around.bottom + GAP_PX : around.top - GAP_PX - own.height;
  const left = Math.min(around.left, innerWidth - own.width - GAP_PX);
  tooltip.style.transform = `translate(${Math.max(GAP_PX, left)}px, ${Math.max(GAP_PX, top)}px)`;
}
