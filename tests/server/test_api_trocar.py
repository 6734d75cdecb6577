"""Trocar, withdrawal, boards, compensation, sensing over the API, on a console of their own."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from tests.configured import LATE_TICKS, configured
from tests.server.api_client import JSON, ApiClient
from tests.server.console_process import ConsoleProcess

CONFIGURED = [400.0, 0.0, 120.0]


@pytest.fixture(scope="module")
def nearly_out(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ConsoleProcess]:
    """A console whose instrument wakes up a little bent and almost drawn out."""
    folder = tmp_path_factory.mktemp("trocar")
    nearly = {"bend_deg = 60.0": "bend_deg = 8.0", "shaft = 0.4 ": "shaft = 0.9 "}
    options = (*configured(folder, nearly, LATE_TICKS), "--plant", "kinematic", "--board", "none")
    with ConsoleProcess(folder, *options) as running:
        running.wait_until_running()
        yield running


@pytest.fixture
def operator(nearly_out: ConsoleProcess) -> Iterator[ApiClient]:
    """Holds the lease of a disabled robot with the trocar as configured."""
    client = ApiClient(nearly_out)
    client.take_when_free()
    yield client
    client.take_when_free()
    client.call("POST", "/disable")
    client.done("POST", "/trocar", {"method": "configuration"})
    client.done("PUT", "/trocar/breathing", {"amplitude_mm": 0.0, "period_s": 4.0})
    client.done("DELETE", "/lease")
    client.close()


def test_the_trocar_is_where_it_was_configured(operator: ApiClient) -> None:
    found = operator.done("GET", "/trocar")
    assert found["registered_mm"] == found["position_mm"] == CONFIGURED
    assert (found["method"], found["inserted"]) == ("configuration", True)
    assert found["distance_mm"] < 1e-3
    assert found["lambda"] == pytest.approx(0.9, abs=0.05)


def test_a_place_that_is_entered_is_taken_and_the_robot_enabled_there(operator: ApiClient) -> None:
    place = [400.0, 3.0, 120.0]
    found = operator.done("POST", "/trocar", {"method": "enter", "position_mm": place})
    assert found["registered_mm"] == place
    assert (found["method"], found["inserted"]) == ("enter", True)
    assert found["distance_mm"] == pytest.approx(3.0, abs=0.01)
    operator.done("POST", "/enable")
    operator.until(lambda s: s["errors"]["rcm_mm"] < 1e-3, "the shaft is led there")
    assert operator.state()["trocar"]["method"] == "enter"
    refused = operator.refused("POST", "/trocar", {"method": "configuration"})
    assert (refused["code"], refused["state"]) == ("not_ready", "ENABLED")
    operator.done("POST", "/pause")
    operator.done("POST", "/trocar", {"method": "configuration"})
    operator.done("POST", "/enable")
    operator.until(lambda s: s["errors"]["rcm_mm"] < 1e-3, "the shaft is led back")


def test_a_trocar_that_the_shaft_misses_keeps_the_robot_from_being_enabled(
    operator: ApiClient,
) -> None:
    operator.done("POST", "/trocar", {"method": "enter", "position_mm": [400.0, 20.0, 120.0]})
    refused = operator.refused("POST", "/enable")
    assert (refused["status"], refused["code"]) == (409, "not_inserted")
    assert refused["distance_mm"] == pytest.approx(20.0, abs=0.1)
    assert "20.0 mm" in refused["detail"]
    assert operator.state()["safety"]["state"] == "DISABLED"


def test_touching_takes_the_tip_for_the_trocar_until_it_is_inserted(operator: ApiClient) -> None:
    tip = operator.state()["commanded"]["position_mm"]
    found = operator.done("POST", "/trocar", {"method": "touch"})
    assert found["registered_mm"] == pytest.approx(tip, abs=1e-3)
    assert (found["method"], found["inserted"]) == ("touch", False)
    assert found["lambda"] > 1.0
    assert operator.refused("POST", "/enable")["code"] == "not_inserted"


@pytest.mark.parametrize(
    ("body", "code"),
    [
        ({"method": "enter", "position_mm": [400.0, 60.0, 120.0]}, "trocar_refused"),
        ({"method": "enter", "position_mm": [700.0, 0.0, -280.0]}, "trocar_refused"),
        ({"method": "enter"}, "invalid_request"),
        ({"method": "touch", "position_mm": CONFIGURED}, "invalid_request"),
        ({"method": "guess"}, "invalid_request"),
        ({"method": "enter", "position_mm": [float("nan"), 0.0, 0.0]}, "invalid_request"),
    ],
)
def test_a_place_that_makes_no_sense_is_refused(operator: ApiClient, body: JSON, code: str) -> None:
    refused = operator.refused("POST", "/trocar", body)
    assert (refused["status"], refused["code"]) == (422, code)
    assert operator.done("GET", "/trocar")["registered_mm"] == CONFIGURED


def test_the_trocar_breathes_and_the_shaft_with_it(operator: ApiClient) -> None:
    operator.done("POST", "/enable")
    answer = operator.done("PUT", "/trocar/breathing", {"amplitude_mm": 2.0, "period_s": 1.0})
    assert (answer["breathing_amplitude_mm"], answer["breathing_period_s"]) == (2.0, 1.0)
    state = operator.until(lambda s: s["trocar_mm"][2] > 121.0, "the trocar moves")
    assert state["errors"]["rcm_mm"] < 1e-3
    assert state["trocar"]["breathing_amplitude_mm"] == 2.0
    operator.done("PUT", "/trocar/breathing", {"amplitude_mm": 0.0})
    operator.until(lambda s: s["trocar_mm"] == CONFIGURED, "it ends with the breath")


@pytest.mark.parametrize("body", [{"amplitude_mm": 11.0}, {"period_s": 0.2}, {"period_s": "1"}])
def test_breath_that_nobody_has_is_refused(operator: ApiClient, body: JSON) -> None:
    assert operator.refused("PUT", "/trocar/breathing", body)["code"] == "invalid_request"


def test_withdrawal(operator: ApiClient) -> None:
    assert operator.refused("POST", "/withdraw")["code"] == "not_ready"
    operator.done("PUT", "/teleoperation", {"lock_rotation": True, "lock_translation": True})
    operator.done("PUT", "/priority", {"solver": "augmented"})
    # The shaft is still on its way to the trocar when the withdrawal is asked for.
    operator.done("POST", "/trocar", {"method": "enter", "position_mm": [400.0, 2.0, 120.0]})
    operator.done("POST", "/enable")
    state = operator.done("POST", "/withdraw")
    assert state["path"]["name"] == "withdrawal"
    assert not state["teleoperation"]["lock_rotation"]
    assert not state["teleoperation"]["lock_translation"]
    assert state["priority"]["solver"] == "hqp"
    state = operator.until(lambda s: s["path"] is None, "it is out", 30.0)
    assert state["safety"]["state"] == "ENABLED"
    assert state["lambda"]["value"] == pytest.approx(0.949, abs=1e-3)
    assert state["bend_deg"] < 0.01
    assert state["errors"]["rcm_mm"] < 0.01
    tip, trocar = np.array(state["true"]["position_mm"]), np.array(state["trocar_mm"])
    assert np.linalg.norm(tip - trocar) == pytest.approx(0.051 * 230.0 + 30.0, abs=0.1)


def test_boards_are_changed_while_nothing_may_move(operator: ApiClient) -> None:
    listed = operator.call("GET", "/boards").json()
    assert [one["name"] for one in listed if one["present"]] == ["none"]
    assert operator.state()["rings"] is None
    state = operator.done("PUT", "/board", {"name": "ring-board"})
    assert state["board"] == "ring-board"
    assert state["rings"]["total"] >= 6
    assert operator.refused("PUT", "/board", {"name": "billiards"})["code"] == "unknown_name"
    operator.done("POST", "/enable")
    refused = operator.refused("PUT", "/board", {"name": "none"})
    assert (refused["code"], refused["state"]) == ("not_ready", "ENABLED")
    refused = operator.refused("POST", "/path", {"experiment": "silicon-arc"})
    assert (refused["status"], refused["code"]) == (409, "board_needed")
    assert (refused["needed"], refused["present"]) == ("silicon-arc", "ring-board")
    operator.done("POST", "/disable")
    assert operator.done("PUT", "/board", {"name": "none"})["board"] == "none"


def test_compensation_and_tracker_are_chosen_apart(operator: ApiClient) -> None:
    state = operator.done("PUT", "/compensation", {"mode": "gain", "tracker": True})
    assert (state["compensation"], state["tracker"]["on"]) == ("gain", True)
    state = operator.done("PUT", "/compensation", {"tracker": False})
    assert (state["compensation"], state["tracker"]["on"]) == ("gain", False)
    assert operator.refused("PUT", "/compensation", {"mode": "most"})["code"] == "invalid_request"


def test_sensing_is_switched_and_says_why_it_senses_nothing(operator: ApiClient) -> None:
    state = operator.done("PUT", "/sensing", {"enabled": False})
    assert (state["sensing"]["enabled"], state["sensing"]["fault"]) == (False, "off")
    state = operator.done("PUT", "/sensing", {"enabled": True})
    found = operator.done("GET", "/sensing")
    assert found == state["sensing"]
    assert (found["enabled"], found["valid"]) == (True, False)
    # The kinematic robot has no tension cells.
    assert (found["fault"], found["cells"]) == ("no_tension_cells", False)
    assert found["action"]
    assert state["tension_n"] == [None] * 4
    for body in ({}, {"enabled": 1}, {"enabled": True, "more": 1}):
        assert operator.refused("PUT", "/sensing", body)["code"] == "invalid_request"


def test_tendons_hold_tensions_only_where_they_are_measured(operator: ApiClient) -> None:
    state = operator.done("PUT", "/tendons", {"control": "position", "co_contraction_n": 4.5})
    assert (state["tendons"]["control"], state["tendons"]["co_contraction_n"]) == ("position", 4.5)
    assert (
        operator.done("PUT", "/tendons", {"co_contraction_n": 2.0})["tendons"]["holds"]
        == ["position"] * 4
    )
    for control in ("hybrid", "tension"):
        refusal = operator.refused("PUT", "/tendons", {"control": control})
        assert (refusal["code"], refusal["status"]) == ("tensions_not_measured", 409)
        assert "--actuation tension-unit" in refusal["detail"]
    for body in ({"control": "soft"}, {"co_contraction_n": 0.0}, {"co_contraction_n": "2"}):
        assert operator.refused("PUT", "/tendons", body)["code"] == "invalid_request"
    state = operator.done("GET", "/state")["tendons"]
    assert (state["control"], state["co_contraction_n"]) == ("position", 2.0)
    assert (state["wanted_n"], state["stiffness_mnm_rad"]) == ([None] * 4, [None] * 2)


@pytest.mark.parametrize(
    ("method", "path", "body"),
    [
        ("POST", "/trocar", {"method": "touch"}),
        ("PUT", "/trocar/breathing", {"amplitude_mm": 1.0}),
        ("POST", "/withdraw", None),
        ("PUT", "/board", {"name": "none"}),
        ("PUT", "/compensation", {"mode": "off"}),
        ("PUT", "/sensing", {"enabled": False}),
        ("PUT", "/tendons", {"control": "position"}),
    ],
)
def test_only_the_operator_may(
    nearly_out: ConsoleProcess, method: str, path: str, body: JSON | None
) -> None:
    watcher = ApiClient(nearly_out)
    assert watcher.refused(method, path, body)["code"] == "not_the_operator"
    watcher.close()
