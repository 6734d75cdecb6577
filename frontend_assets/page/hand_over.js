// Control goes from one person to another in sight of both: asked for, offered, taken, or declined.

import { call } from "/assets/api.js";
import { byId, setHidden, setText } from "/assets/dom.js";
import { attempt } from "/assets/notices.js";
import { myName } from "/assets/operator.js";
import { ROBOT } from "/assets/robots.js";

export class HandOver {
  constructor() {
    this.yes = null;
    this.no = null;
    byId("hand-over-yes").addEventListener("click", () => this.yes?.());
    byId("hand-over-no").addEventListener("click", () => this.no?.());
  }

  show({ operator, replay }, up) {
    const bar = up && !replay ? barOf(operator) : null;
    setHidden(byId("hand-over-bar"), bar === null);
    this.yes = bar?.yes ?? null;
    this.no = bar?.no ?? null;
    if (bar === null) return;
    setText(byId("hand-over-title"), bar.title);
    setText(byId("hand-over-text"), bar.text);
    for (const [id, words] of [["hand-over-yes", bar.yesWords], ["hand-over-no", bar.noWords]]) {
      setHidden(byId(id), !words);
      setText(byId(id), words ?? "");
    }
  }
}

function barOf({ name, you, offered_to, asked_by }) {
  if (you && offered_to) {
    return {
      title: `Control is offered to ${offered_to}`,
      text: "The robot is paused and cannot be enabled until it is taken or withdrawn.",
      noWords: "Withdraw",
      no: () => send("DELETE", "lease/hand-over"),
    };
  }
  if (you && asked_by) {
    return {
      title: `${asked_by} asks for control`,
      text: "If you hand over, the robot pauses first.",
      yesWords: "Hand over",
      yes: () => send("POST", "lease/hand-over", { to: asked_by }),
      noWords: "Decline",
      no: () => send("DELETE", "lease/request"),
    };
  }
  if (!you && offered_to === myName()) {
    return {
      title: `${name} offers you control`,
      text: "The robot is paused. You enable it when you are ready.",
      yesWords: "Take over",
      yes: () => byId("take-control").click(),
    };
  }
  if (!you && asked_by && asked_by === myName()) {
    return {
      title: `You asked ${name} for control`,
      text: "It is forgotten after a minute without an answer.",
      noWords: "Ask no longer",
      no: () => send("DELETE", "lease/request"),
    };
  }
  return null;
}

const send = (method, path, body) => attempt(call(method, `${ROBOT}/${path}`, body));
