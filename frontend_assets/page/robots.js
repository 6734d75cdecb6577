// Which robots there are, and the one that this console drives; found before the page starts. What
// is on the page for another robot (data-robot) is taken off it.

import { call } from "/assets/api.js";

const LIST = "/api/v1/robots";
const AGAIN_MS = 500;

export const listRobots = () => call("GET", LIST);

/** Ask for another robot to be driven; the console starts anew with it. */
export const selectRobot = (name) => call("POST", `${LIST}/${name}/select`);

async function firstList() {
  for (;;) {
    try {
      return await listRobots();
    } catch (refusal) {
      // Who is not let in is told so by the stream, which needs some path to ask for.
      if (refusal.status === 401 || refusal.status === 403) return [{ name: "instrument", title: "", selected: true }];
      await new Promise((resolve) => setTimeout(resolve, AGAIN_MS));
    }
  }
}

export const ROBOTS = await firstList();
export const DRIVEN = ROBOTS.find(({ selected }) => selected) ?? ROBOTS[0];
/** Path of everything that belongs to the robot that is driven. */
export const ROBOT = `${LIST}/${DRIVEN.name}`;

for (const part of document.querySelectorAll("[data-robot]")) {
  if (part.dataset.robot !== DRIVEN.name) part.remove();
}
document.body.dataset.driven = DRIVEN.name;
