// Panels below the scene, one open at a time. The scene gives way; nothing is covered.

import { byId, setHidden } from "/assets/dom.js";

export class Drawer {
  /** `opened`: for each pane by name, called when it opens; `closed`: when none is open. */
  constructor(opened, closed) {
    this.names = Object.keys(opened);
    this.opened = opened;
    this.closed = closed;
    this.open = "";
    for (const name of this.names) {
      byId(`show-${name}`).addEventListener("click", () => this.toggle(name));
    }
  }

  toggle(name) {
    this.open = this.open === name ? "" : name;
    for (const one of this.names) {
      setHidden(byId(`${one}-pane`), one !== this.open);
      byId(`show-${one}`).setAttribute("aria-expanded", String(one === this.open));
    }
    if (this.open === "") this.closed();
    else this.opened[this.open]();
  }
}
