// Servo bus and arm: how they are, and what can be asked of them.

import { call } from "/assets/api.js";
import { byId, make, onPress, setBlocked, setData, setHidden, setText, setUnusable } from "/assets/dom.js";
import { fixed, sentence } from "/assets/format.js";
import { attempt, refuse, tell } from "/assets/notices.js";
import { ROBOT } from "/assets/robots.js";

const STATES = {
  simulated: "Simulated",
  searching: "Searching",
  preparing: "Preparing",
  connected: "Connected",
  homing: "Homing",
  fault: "▲ Fault",
};
const HOT_C = 60;
const HEAVY_PERCENT = 50;

const BUS_FACTS = [
  ["Servo bus", (bus) => STATES[bus.state], "State of the instrument module's servo bus"],
  ["Port", (bus) => bus.port || "–", "Serial port, and its bits per second"],
  ["Cycles", (bus) => `${fixed(bus.rate_hz, 0)} Hz`, "Goals written and positions read back, per second"],
  ["p99", (bus) => `${fixed(bus.cycle_p99_ms, 2)} ms`, "Time of a cycle that 99 of 100 stay below"],
  ["Missed", (bus) => `${bus.missed}`, "Cycles in which a servo did not answer; two in a row are a fault"],
  ["CPU", (bus) => `${fixed(bus.cpu_percent, 1)} %`, "Share of one core that the bus takes"],
  ["Homed", (bus) => (bus.state === "homing" ? `${fixed(bus.homing_progress * 100, 0)} %` : bus.homed ? "Yes" : "No"), "Whether the tendons' zero is known"],
];
const ARM_FACTS = [
  ["Arm", (arm) => `${STATES[arm.state]}${arm.state === "simulated" ? "" : `, ${arm.kind}`}`, "State of the arm that carries the module"],
  ["Address", (arm) => arm.address || "–", "Of the arm's controller"],
  ["Rate", (arm) => `${fixed(arm.rate_hz, 0)} Hz`, "Joint commands per second"],
  ["Age", (arm) => `${fixed(arm.age_ms, 0)} ms`, "Age of the arm's last report"],
  ["Codes", (arm) => `${arm.error} / ${arm.warning}`, "Error and warning of the arm's controller; 0 for none"],
];

export class Devices {
  /** `take(state)`: newest state. */
  constructor(take) {
    this.take = take;
    this.rows = [];
    this.asked = false;
    this.simulated = false;
    onPress(byId("home"), () => this.#ask("POST", "home", "The instrument is being homed."), refuse);
    onPress(byId("take-hold"), () => this.#ask("POST", "torque/hold", "The servos hold where they stand."), refuse);
    onPress(byId("reboot"), () => this.#ask("POST", "devices/reboot", "The servos start anew; home them afterwards."), refuse);
    this.#startRelease();
    onPress(byId("fault-inject"), () => this.#ask("POST", "faults", `Injected: ${chosen()}`, { name: byId("fault").value }), refuse);
    onPress(byId("fault-mend"), () => this.#ask("DELETE", "faults", "The simulated robot is mended."), refuse);
  }

  async #ask(method, path, words, body) {
    const state = await attempt(call(method, `${ROBOT}/${path}`, body));
    if (!state) return;
    tell(words);
    if (state.type === "state") this.take(state);
  }

  /** Not modal: the emergency stop must stay within reach of the mouse. */
  #startRelease() {
    const dialog = byId("release-dialog");
    onPress(byId("release-torque"), () => {
      if (!dialog.open) dialog.show();
      byId("release-no").focus();
    }, refuse);
    byId("release-no").addEventListener("click", () => dialog.close());
    onPress(byId("release-yes"), () => {
      dialog.close();
      this.#ask("POST", "torque/release", "The torque is released.");
    }, refuse);
  }

  opened() {
    if (!this.asked && this.simulated) this.#loadFaults();
  }

  async #loadFaults() {
    this.asked = true;
    const faults = await attempt(call("GET", `${ROBOT}/faults`));
    if (!faults) return;
    byId("fault").replaceChildren(...faults.map(({ name, title }) => make("option", "", title, { value: name })));
  }

  show({ devices, safety, readiness, replay }, blocked) {
    const { bus, arm, simulated } = devices;
    this.simulated = simulated && !replay;
    this.#showActs(devices, safety.state, readiness.state, blocked);
    if (byId("devices-pane").hidden) return;
    if (this.simulated) this.opened();
    const none = bus ? "" : simulated ? "All of the robot is simulated: there is no servo bus and nothing to home." : "The servo bus tells nothing yet.";
    setText(byId("devices-none"), none);
    setHidden(byId("devices-none"), none === "");
    setHidden(byId("servos"), !bus);
    showFacts(byId("bus-facts"), BUS_FACTS, bus);
    showFacts(byId("arm-facts"), ARM_FACTS, arm);
    if (bus) this.#showServos(bus.servos);
    const messages = [bus, arm].map((device) => [device?.message, device?.state === "fault" || device?.state === "searching"]);
    showFaults([...messages, ...(bus?.servos ?? []).map((servo) => [servo.error, true])]);
  }

  #showServos(servos) {
    const body = byId("servos").tBodies[0];
    while (this.rows.length < servos.length) this.rows.push(servoRow(body));
    servos.forEach((servo, index) => showServo(this.rows[index], servo));
  }

  #showActs({ bus, simulated }, safety, readiness, blocked) {
    const nothing = simulated ? "The robot is simulated: it has no servos." : bus ? "" : "There is no servo bus.";
    const gone = readiness === "not_connected" ? "A device is not connected." : "";
    const moving = safety === "ENABLED" ? "Pause or disable the robot first." : "";
    const fault = safety === "FAULT" ? "Reset the fault first." : "";
    const asleep = safety === "DISABLED" ? "" : "Disable the robot first: homing moves the servos.";
    const busy = readiness === "busy" ? "The servos are being prepared or homed." : "";
    const held = bus?.servos.every((servo) => servo.torque) ? "The servos hold already." : "";
    setBlocked(byId("home"), nothing || blocked || gone || fault || asleep || busy);
    setBlocked(byId("take-hold"), nothing || blocked || gone || moving || held);
    setBlocked(byId("reboot"), nothing || blocked || gone || moving);
    setBlocked(byId("release-torque"), nothing || blocked);
    setBlocked(byId("release-yes"), nothing || blocked);
    setHidden(byId("fault-menu"), !this.simulated);
    for (const id of ["fault-inject", "fault-mend"]) setBlocked(byId(id), blocked);
    setUnusable(byId("fault"), blocked);
  }
}

const chosen = () => byId("fault").selectedOptions[0]?.textContent ?? "";

function showFacts(list, facts, source) {
  setHidden(list, !source);
  if (!source) return;
  if (!list.childElementCount) {
    for (const [name] of facts) {
      const row = make("div", "device-fact");
      row.append(make("dt", "", name), make("dd"));
      list.append(row);
    }
  }
  facts.forEach(([, words, tip], index) => {
    const value = words(source);
    setText(list.children[index].lastChild, value);
    setData(list.children[index], "tip", `${tip}: ${value}`);
    // Of what is simulated there is nothing else to tell.
    setHidden(list.children[index], index > 0 && source.state === "simulated");
  });
  setData(list, "level", source.state === "fault" ? "bad" : source.state === "connected" || source.state === "simulated" ? "" : "warn");
}

function servoRow(body) {
  const row = body.insertRow();
  row.append(make("th", "", "", { scope: "row" }));
  const load = row.insertCell();
  const bar = make("span", "load");
  bar.append(make("i"));
  load.append(bar, make("span", "load-number"));
  for (let column = 0; column < 4; column += 1) row.insertCell();
  return row;
}

function showServo(row, servo) {
  const [name, load, angle, temperature, voltage, words] = row.cells;
  setText(name, String(servo.id));
  const share = Math.max(-1, Math.min(1, (servo.load_percent ?? 0) / 100));
  const width = `${(Math.abs(share) * 50).toFixed(1)}%`;
  const left = `${((share < 0 ? 0.5 + share / 2 : 0.5) * 100).toFixed(1)}%`;
  const mark = load.firstChild.firstChild;
  if (mark.style.width !== width) mark.style.width = width;
  if (mark.style.left !== left) mark.style.left = left;
  setText(load.lastChild, fixed(servo.load_percent, 0));
  setData(load, "level", Math.abs(servo.load_percent ?? 0) > HEAVY_PERCENT ? "warn" : "");
  setText(angle, fixed(servo.position_deg, 1));
  setText(temperature, fixed(servo.temperature_c, 0));
  setData(temperature, "level", (servo.temperature_c ?? 0) > HOT_C ? "warn" : "");
  setText(voltage, fixed(servo.voltage_v, 1));
  const state = !servo.answers ? "▲ Silent" : servo.error ? "▲ Fault" : servo.torque ? "Holds" : "Torque off";
  setText(words, state);
  setData(words, "level", !servo.answers || servo.error ? "bad" : servo.torque ? "" : "warn");
  setData(row, "tip", `Servo ${servo.id}, firmware ${servo.firmware ?? "not known"}, last answer ${fixed(servo.age_ms, 0)} ms ago${servo.error ? `. ${sentence(servo.error)}` : ""}`);
}

/** What devices report, [words, whether it is grave]; nothing where there is nothing to tell. */
function showFaults(messages) {
  const told = new Map(messages.filter(([words]) => words).map(([words, grave]) => [sentence(words), grave]));
  const list = byId("device-faults");
  setHidden(list, told.size === 0);
  const known = JSON.stringify([...told]);
  if (list.dataset.words === known) return;
  list.dataset.words = known;
  list.replaceChildren(...[...told].map(([words, grave]) => make("li", grave ? "grave" : "", words)));
}
