"""Devices over the API: read, homed, rebooted; not ready is not enabled; faults on request."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.devices import DEVICES, DeviceState
from hardware.faulty_plant import plant_faults
from robot.clearance import PART_NAMES, Part
from robot.records import RECORD, Readiness
from server.configuration_file import load
from server.web.device_schema import ClearancePart, DevicesPart, ReadinessPart
from server.web.devices_view import READINESS, clearance_view, devices_view, readiness_view
from tests.server.api_client import ApiClient


def test_a_simulated_robot_has_no_wires() -> None:
    view = devices_view(np.zeros(1, DEVICES), connected=False)
    assert view == {"simulated": True, "bus": None, "arm": None}
    DevicesPart.model_validate(view)


def test_a_bus_is_told_in_words_and_what_was_never_read_is_unknown() -> None:
    devices = np.zeros(1, DEVICES)
    bus = devices["bus"]
    bus["state"], bus["port"], bus["rate_hz"] = DeviceState.CONNECTED, b"/dev/ttyUSB0", 250.04
    servos = bus["servos"][0]
    servos["id"] = (101, 102, 103, 104)
    servos["answers"][:2] = 1
    servos["voltage_v"][:2], servos["temperature_c"][:2] = 12.0, 31.0
    servos["hardware_error"][1] = 32
    devices["arm"]["kind"], devices["arm"]["state"] = b"xarm", DeviceState.FAULT
    view = devices_view(devices, connected=True)
    part = DevicesPart.model_validate(view)
    assert part.bus is not None
    assert (part.bus.state, part.bus.port, part.bus.rate_hz) == ("connected", "/dev/ttyUSB0", 250.0)
    first, second, third, _ = part.bus.servos
    assert first.error is None
    assert second.error is not None
    assert "overload" in second.error
    assert "reboot" in second.error
    assert (third.answers, third.voltage_v, third.temperature_c) == (False, None, None)
    assert part.arm is not None
    assert part.arm.state == "fault"


@pytest.mark.parametrize("readiness", Readiness)
def test_every_readiness_says_what_to_do(readiness: Readiness) -> None:
    part = ReadinessPart.model_validate(readiness_view(int(readiness)))
    assert part.state == readiness.name.lower()
    assert (part.action == "") == (readiness == Readiness.READY)
    assert READINESS[readiness][0] == part.reason
    assert readiness_view(999)["state"] == "busy"


def test_the_clearance_names_the_pair() -> None:
    state = np.zeros(1, RECORD)["outcome"]["state"]
    state["clearance"], state["clearance_part"] = 0.0123, Part.MODULE_WALL
    part = ClearancePart.model_validate(clearance_view(state[0], 0.005))
    assert (part.distance_mm, part.limit_mm) == (12.3, 5.0)
    assert part.between == PART_NAMES[Part.MODULE_WALL]
    state["clearance"] = math.inf
    assert clearance_view(state[0], 0.005)["distance_mm"] is None
    state["clearance_part"] = Part.NONE
    assert clearance_view(state[0], 0.005)["between"] is None


def test_a_robot_that_is_not_ready_is_not_enabled(operator: ApiClient) -> None:
    operator.done("POST", "/faults", {"name": "bus-lost"})
    state = operator.until(lambda s: s["readiness"]["state"] == "not_connected", "it is told")
    assert state["safety"]["state"] == "DISABLED"
    problem = operator.refused("POST", "/enable")
    assert (problem["status"], problem["code"]) == (409, "devices_not_ready")
    assert problem["readiness"] == "not_connected"
    assert "Devices" in problem["detail"]
    operator.done("DELETE", "/faults")
    operator.until(lambda s: s["readiness"]["state"] == "ready", "it is mended")
    assert operator.done("POST", "/enable")["safety"]["state"] == "ENABLED"


def test_faults_are_listed_injected_and_cleared(driver: ApiClient, watcher: ApiClient) -> None:
    listed = {one["name"]: one["title"] for one in driver.http.get("/faults").json()}
    assert listed == {name: fault.title for name, fault in plant_faults(load()).items()}
    # There is no tension-feedback unit that could break.
    assert "tendon-broken" not in listed
    assert watcher.refused("POST", "/faults", {"name": "contact"})["code"] == "not_the_operator"
    assert driver.refused("POST", "/faults", {"name": "gremlins"})["status"] == 404
    driver.done("POST", "/faults", {"name": "servo-silent"})
    state = driver.until(lambda s: s["safety"]["state"] == "FAULT", "a fault")
    assert state["safety"]["reason_code"] == "servo_silent"
    active = [one["name"] for one in driver.http.get("/faults").json() if one["active"]]
    assert active == ["servo-silent"]
    driver.done("DELETE", "/faults")
    assert driver.state()["safety"]["state"] == "FAULT"
    assert not any(one["active"] for one in driver.http.get("/faults").json())


def test_what_moves_devices_is_for_the_operator_in_the_right_state(
    driver: ApiClient, watcher: ApiClient
) -> None:
    for path in ("/home", "/torque/release", "/torque/hold", "/devices/reboot"):
        assert watcher.refused("POST", path)["code"] == "not_the_operator"
    for path in ("/home", "/torque/hold", "/devices/reboot"):
        problem = driver.refused("POST", path)
        assert (problem["code"], problem["state"]) == ("not_ready", "ENABLED")
    driver.done("POST", "/pause")
    assert driver.refused("POST", "/home")["state"] == "PAUSED"
    driver.done("POST", "/torque/hold")
    driver.done("POST", "/torque/release")
    driver.until(lambda s: s["safety"]["state"] == "DISABLED", "a release disables")
    for path in ("/torque/hold", "/devices/reboot", "/home"):
        assert driver.done("POST", path)["safety"]["state"] == "DISABLED"
    assert watcher.done("GET", "/devices") == {"simulated": True, "bus": None, "arm": None}
