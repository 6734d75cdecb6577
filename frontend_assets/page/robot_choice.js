// Choosing the robot that the console drives: one at a time, only while the present one is disabled.

import { byId, make, setUnusable } from "/assets/dom.js";
import { refuse, showStarting } from "/assets/notices.js";
import { DRIVEN, ROBOTS, listRobots, selectRobot } from "/assets/robots.js";

const ASK_MS = 500;
const PATIENCE_MS = 120_000;

/** Why nothing may be chosen now, or "". */
function whyNot({ safety, operator, replay, control }, up) {
  if (!up) return "No connection to the server.";
  if (replay) return "This is a replay: there is no robot.";
  if (!operator.you) return operator.name ? `${operator.name} drives.` : "Take control first.";
  // Control that is down moves nothing, and may be down because of its robot.
  if (control !== "running" || safety.state === "DISABLED") return "";
  return safety.state === "FAULT" ? "Reset the fault first." : "Disable the robot first.";
}

export class RobotChoice {
  constructor() {
    this.starting = false;
    const list = byId("robot");
    for (const { name, title } of ROBOTS) list.append(make("option", "", title, { value: name }));
    list.value = DRIVEN.name;
    list.closest("[data-tip]").dataset.tip = `Driven now: ${DRIVEN.title}. Another robot can be chosen while this one is disabled (U)`;
    list.addEventListener("change", () => this.#choose(list.value));
  }

  async #choose(name) {
    this.starting = true;
    try {
      await selectRobot(name);
    } catch (refusal) {
      this.#stay(refusal.message);
      return;
    }
    const { title } = ROBOTS.find((robot) => robot.name === name);
    showStarting(title);
    await this.#await(name, title);
  }

  /** The server is away for a while meanwhile, which says nothing. */
  async #await(name, title) {
    const ends = performance.now() + PATIENCE_MS;
    while (performance.now() < ends) {
      await new Promise((resolve) => setTimeout(resolve, ASK_MS));
      const robots = await listRobots().catch(() => []);
      if (robots.some((robot) => robot.selected && robot.name === name)) {
        location.reload();
        return;
      }
    }
    showStarting("");
    this.#stay(`The console did not start “${title}”. Read what keyhole printed.`);
  }

  #stay(reason) {
    this.starting = false;
    byId("robot").value = DRIVEN.name;
    refuse(reason);
  }

  show(state, up) {
    setUnusable(byId("robot"), this.starting ? "Another robot is being started." : whyNot(state, up));
  }
}
