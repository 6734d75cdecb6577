// Small acts on elements, each without touching the page when nothing changes.

export const byId = (id) => document.getElementById(id);

export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

export function setData(element, name, value) {
  if (element.dataset[name] !== value) element.dataset[name] = value;
}

export function setHidden(element, hidden) {
  if (element.hidden !== hidden) element.hidden = hidden;
}

/** New element with a class, text and attributes. */
export function make(tag, className = "", text = "", attributes = {}) {
  const element = document.createElement(tag);
  if (className) element.className = className;
  if (text) element.textContent = text;
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  return element;
}

/**
 * Block a button with a reason in words, or free it with "".
 * It stays focusable (aria-disabled), so that a keyboard can reach the reason.
 */
export function setBlocked(button, reason) {
  const blocked = reason !== "";
  if ((button.getAttribute("aria-disabled") === "true") !== blocked) {
    if (blocked) button.setAttribute("aria-disabled", "true");
    else button.removeAttribute("aria-disabled");
  }
  setData(button, "why", reason);
}

export const isBlocked = (button) => button.getAttribute("aria-disabled") === "true";

/** Disable a form control with a reason; its label carries the reason for the tooltip. */
export function setUnusable(input, reason) {
  const unusable = reason !== "";
  if (input.disabled !== unusable) input.disabled = unusable;
  setData(input.closest("[data-tip]") ?? input, "why", reason);
}

/** Call `act` on a press; a blocked button tells why through `refuse` instead. */
export function onPress(button, act, refuse) {
  button.addEventListener("click", () => {
    if (isBlocked(button)) refuse(button.dataset.why);
    else act();
  });
}
