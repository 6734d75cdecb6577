"""The safety table by enumeration, and what it means for motion."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from robot.instrument_robot import InstrumentRobot
from robot.records import OUTCOME, Readiness, Request, Safety
from robot.safety import (
    MEASUREMENT_TIMEOUT_S,
    REASONS,
    REFUSALS,
    TRANSITIONS,
    Event,
    RequestRefused,
    apply_event,
    check_request,
    printed_table,
    successor,
)
from tests.robot.drive import Drive, random_x, stood_still

D, E, P, F = Safety.DISABLED, Safety.ENABLED, Safety.PAUSED, Safety.FAULT

# Written down once more, by event: state before -> state after. What is missing changes nothing.
EXPECTED: dict[Event, dict[Safety, Safety]] = {
    Event.NOTHING: {},
    Event.ENABLE: {D: E, E: E, P: E},
    Event.DISABLE: {D: D, E: D, P: D},
    Event.PAUSE: {E: P, P: P},
    Event.RESET: {F: D},
    Event.EMERGENCY_STOP: {D: F, E: F, P: F, F: F},
    Event.OPERATOR_LOST: {E: P},
    Event.LEADER_STALE: {E: P},
    Event.LEADER_JUMP: {E: P},
    Event.LEADER_INVALID: {E: P},
    Event.MEASUREMENT_LOST: {E: F, P: F},
    Event.TRACKING_ERROR: {E: F, P: F},
    Event.SOLVER_FAILED: {E: F},
    Event.CONTROL_FAILED: {D: F, E: F, P: F, F: F},
    Event.CONTACT_FORCE: {E: P},
    Event.SIMULATION_FAILED: {D: F, E: F, P: F},
    Event.BUS_LOST: {E: P, P: P},
    Event.SERVO_SILENT: {D: F, E: F, P: F},
    Event.SERVO_FAULT: {D: F, E: F, P: F},
    Event.ARM_LOST: {E: P, P: P},
    Event.ARM_FAULT: {D: F, E: F, P: F},
    Event.DEVICES_BACK: {P: P},
    Event.CLEARANCE: {E: P},
    Event.TROCAR_LEFT: {E: F},
    Event.CONTROL_LATE: {E: P},
    Event.NEAR_SNAPPING: {E: P},
    Event.RELATIVE_ERROR: {E: P},
    Event.TENSION_UNKNOWN: {E: P},
    Event.TENDON_RUNS: {E: F, P: F},
}
EVERYTHING = list(itertools.product(Safety, Event))


def standing_in(robot: InstrumentRobot, safety: Safety) -> Drive:
    drive = Drive(robot)
    drive.state["safety"] = safety
    return drive


def driving(robot: InstrumentRobot) -> Drive:
    """A robot in motion: the leader has moved and the tip is on its way."""
    drive = Drive(robot)
    drive.engage(np.zeros(3))
    drive.lead(np.array([0.0, 0.004, 0.002]))
    assert drive.tick()["command"]["moving"] == 1
    return drive


@pytest.mark.parametrize(("state", "event"), EVERYTHING)
def test_every_state_and_event(state: Safety, event: Event) -> None:
    outcome = np.zeros(1, OUTCOME)
    outcome["state"]["safety"], outcome["state"]["reason"] = state, 99
    before = outcome.tobytes()
    following = EXPECTED[event].get(state)
    assert successor(state, event) == following
    assert apply_event(outcome, int(event)) == (following is not None)
    if following is None:
        assert outcome.tobytes() == before
    else:
        assert outcome["state"]["safety"][0] == following
        assert outcome["state"]["reason"][0] == event


@pytest.mark.parametrize(("state", "request_"), list(itertools.product(Safety, Request)))
def test_every_request_in_a_tick(robot: InstrumentRobot, state: Safety, request_: Request) -> None:
    drive = standing_in(robot, state)
    outcome = drive.tick(request_)
    assert drive.safety == EXPECTED[Event(request_)].get(state, state)
    assert stood_still(outcome, drive.x)


def test_only_reset_leaves_a_fault_and_it_leads_to_disabled() -> None:
    leaving = [row for row in TRANSITIONS if row.state == F and row.next != F]
    assert [(row.event, row.next) for row in leaving] == [(Event.RESET, D)]


def test_only_enable_leads_to_motion_and_never_out_of_a_fault() -> None:
    entering = [row for row in TRANSITIONS if row.next == E]
    assert {row.event for row in entering} == {Event.ENABLE}
    assert {row.state for row in entering} == {D, E, P}


def test_the_table_has_no_two_rows_for_the_same_case() -> None:
    assert len({(row.state, row.event) for row in TRANSITIONS}) == len(TRANSITIONS)


def test_requests_are_events_of_the_same_name() -> None:
    for request_ in list(Request)[1:]:
        assert Event(request_).name == request_.name


@pytest.mark.parametrize(("state", "request_"), list(itertools.product(Safety, list(Request)[1:])))
def test_a_refused_request_says_why(state: Safety, request_: Request) -> None:
    if successor(state, Event(request_)) is not None:
        check_request(state, request_)
        return
    with pytest.raises(RequestRefused) as caught:
        check_request(state, request_)
    assert (caught.value.state, caught.value.request) == (state, request_)
    assert state.name in str(caught.value) or str(caught.value) in REFUSALS.values()


def test_people_find_every_row_and_every_reason() -> None:
    lines = printed_table().splitlines()
    assert len(lines) == 1 + len(TRANSITIONS)
    for row, line in zip(TRANSITIONS, lines[1:], strict=True):
        assert line.split()[:3] == [row.state.name, row.event.name, row.next.name]
        assert line.endswith(REASONS[row.event][0])
    assert set(REASONS) == set(Event)
    assert all(reason for reason, _ in REASONS.values())
    assert all(action for event, (_, action) in REASONS.items() if event != Event.ENABLE)


@pytest.mark.parametrize("state", list(Safety))
def test_an_emergency_stop_is_zero_motion_in_the_same_tick(
    robot: InstrumentRobot, state: Safety
) -> None:
    drive = driving(robot)
    drive.state["safety"] = state
    x = drive.x
    assert stood_still(drive.tick(Request.EMERGENCY_STOP), x)
    assert drive.safety == F
    for _ in range(3):
        drive.lead(np.array([0.0, 0.006, 0.002]))
        assert stood_still(drive.tick(), x)


@pytest.mark.parametrize("request_", [Request.PAUSE, Request.DISABLE, Request.OPERATOR_LOST])
def test_whatever_ends_driving_is_zero_motion_in_the_same_tick(
    robot: InstrumentRobot, request_: Request
) -> None:
    drive = driving(robot)
    x = drive.x
    assert stood_still(drive.tick(request_), x)
    assert drive.state["engaged"][0] == 0
    position, rotation = drive.desired
    np.testing.assert_array_equal(position, drive.state["tip_position"][0])
    np.testing.assert_array_equal(rotation, drive.state["tip_rotation"][0])


def test_enabling_takes_over_the_measured_joints(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    """A robot that was moved by hand must not jump back."""
    for _ in range(20):
        drive, moved = Drive(robot), random_x(robot, rng)
        drive.obedient = False
        drive.measure(moved)
        outcome = drive.tick(Request.ENABLE)
        assert drive.safety == E
        assert outcome["command"]["moving"] == 0
        np.testing.assert_array_equal(outcome["command"]["q"], moved[:7])
        np.testing.assert_allclose(drive.x[7:9], moved[7:9], rtol=0, atol=1e-15)
        np.testing.assert_array_equal(
            outcome["report"]["desired_position"], outcome["report"]["commanded_position"]
        )


def test_lambda_is_where_the_trocar_really_is_when_enabling(
    robot: InstrumentRobot, rng: np.random.Generator
) -> None:
    drive = Drive(robot)
    drive.state["x"][0, 9] = 0.9
    drive.enable()
    assert drive.x[9] == pytest.approx(robot.configuration.start.lambda_along_shaft, abs=1e-9)


@pytest.mark.parametrize("state", [E, P])
@pytest.mark.parametrize("joint", range(7))
def test_a_robot_that_does_not_follow_is_a_fault(
    robot: InstrumentRobot, state: Safety, joint: int
) -> None:
    tolerance = robot.configuration.limits.tracking_error_rad
    for sign in (-1.0, 1.0):
        for share, expected in ((0.999, state), (1.001, F)):
            drive = standing_in(robot, state)
            drive.obedient = False
            away = drive.x
            away[joint] += sign * share * tolerance
            drive.measure(away)
            assert stood_still(drive.tick(), drive.x)
            assert drive.safety == expected


@pytest.mark.parametrize("value", [np.nan, np.inf])
@pytest.mark.parametrize("state", [D, E, P])
@pytest.mark.parametrize(("field", "size"), [("measured_q", 7), ("measured_servo", 4)])
def test_a_measurement_that_is_no_number_is_a_fault_and_never_a_command(
    robot: InstrumentRobot, state: Safety, field: str, size: int, value: float
) -> None:
    for place in range(size):
        drive = driving(robot)
        drive.state["safety"] = state
        drive.obedient = False
        drive.measure(drive.x)
        drive.input[field][0, place] = value
        x = drive.x
        request_ = Request.ENABLE if state == D else Request.NONE
        assert stood_still(drive.tick(request_), x)
        assert drive.safety == F
        assert drive.state["reason"][0] == Event.MEASUREMENT_LOST


@pytest.mark.parametrize("lost", ["invalid", "late", "not a number"])
@pytest.mark.parametrize(("state", "following"), [(D, D), (E, F), (P, F), (F, F)])
def test_lost_measurements_are_a_fault_unless_disabled(
    robot: InstrumentRobot, state: Safety, following: Safety, lost: str
) -> None:
    drive = driving(robot)
    drive.state["safety"] = state
    x = drive.x
    if lost == "invalid":
        drive.input["measured_valid"] = 0
    else:
        late = 1.001 * MEASUREMENT_TIMEOUT_S
        drive.input["measured_age_s"] = late if lost == "late" else np.nan
    assert stood_still(drive.tick(), x)
    assert drive.safety == following


def test_enabling_without_measurements_ends_in_a_fault(drive: Drive) -> None:
    drive.input["measured_valid"] = 0
    x = drive.x
    assert stood_still(drive.tick(Request.ENABLE), x)
    assert drive.safety == F


def test_after_a_fault_there_is_no_motion_before_reset_enable_and_a_new_engagement(
    robot: InstrumentRobot,
) -> None:
    drive = driving(robot)
    drive.tick(Request.EMERGENCY_STOP)
    x = drive.x
    for request_ in (Request.ENABLE, Request.RESET):
        assert stood_still(drive.tick(request_), x)
    outcome = drive.tick(Request.ENABLE)
    assert drive.safety == E
    assert outcome["command"]["moving"] == 0
    np.testing.assert_array_equal(outcome["command"]["q"], x[:7])
    before, _ = drive.desired
    drive.let_go()
    drive.tick()
    drive.lead(np.array([0.2, 0.2, 0.2]))
    drive.tick()
    np.testing.assert_allclose(drive.desired[0], before, rtol=0, atol=1e-15)


def test_too_much_contact_force_pauses(robot: InstrumentRobot) -> None:
    limit = robot.configuration.limits.contact_force_n
    drive = driving(robot)
    drive.input["measured_contact"] = 0.99 * limit
    assert drive.tick()["command"]["moving"] == 1
    drive.input["measured_contact"] = 1.01 * limit
    assert drive.tick()["command"]["moving"] == 0
    assert drive.safety == P
    assert drive.state["reason"][0] == Event.CONTACT_FORCE


def test_a_contact_force_that_is_no_number_pauses(robot: InstrumentRobot) -> None:
    drive = driving(robot)
    drive.input["measured_contact"] = np.nan
    drive.tick()
    assert drive.safety == P


def test_who_enables_in_contact_may_move_away_but_not_press_harder(robot: InstrumentRobot) -> None:
    limit = robot.configuration.limits.contact_force_n
    drive = driving(robot)
    drive.input["measured_contact"] = 2.0 * limit
    drive.tick()
    drive.tick(Request.ENABLE)
    assert drive.safety == E
    assert drive.tick()["command"]["moving"] == 1
    drive.input["measured_contact"] = 2.6 * limit
    drive.tick()
    assert drive.safety == P
    drive.tick(Request.ENABLE)
    drive.input["measured_contact"] = 0.5 * limit
    drive.tick()
    drive.input["measured_contact"] = 1.5 * limit
    drive.tick()
    assert drive.safety == P


@pytest.mark.parametrize(("state", "following"), [(D, F), (E, F), (P, F), (F, F)])
def test_a_simulation_that_broke_down_is_a_fault(
    robot: InstrumentRobot, state: Safety, following: Safety
) -> None:
    drive = driving(robot)
    drive.state["safety"] = state
    drive.input["plant_event"] = int(Event.SIMULATION_FAILED)
    x = drive.x
    assert stood_still(drive.tick(), x)
    assert drive.safety == following


LOST = (Event.BUS_LOST, Event.ARM_LOST)
DEVICE_FAULTS = (Event.SERVO_SILENT, Event.SERVO_FAULT, Event.ARM_FAULT)


@pytest.mark.parametrize("event", LOST)
def test_a_device_that_is_gone_pauses_and_its_return_moves_nothing(
    robot: InstrumentRobot, event: Event
) -> None:
    drive = driving(robot)
    x = drive.x
    drive.input["plant_event"], drive.input["readiness"] = event, Readiness.NOT_CONNECTED
    assert stood_still(drive.tick(), x)
    assert (drive.safety, drive.state["reason"][0]) == (P, event)
    assert stood_still(drive.tick(Request.ENABLE), x)
    assert drive.safety == P
    drive.input["plant_event"], drive.input["readiness"] = 0, Readiness.READY
    for _ in range(10):
        assert stood_still(drive.tick(), x)
    assert (drive.safety, drive.state["reason"][0]) == (P, Event.DEVICES_BACK)
    drive.tick(Request.ENABLE)
    assert drive.safety == E


def test_who_goes_on_after_a_loss_begins_where_the_devices_stopped(robot: InstrumentRobot) -> None:
    drive = driving(robot)
    drive.input["plant_event"], drive.input["readiness"] = Event.BUS_LOST, Readiness.NOT_CONNECTED
    drive.tick()
    drive.input["plant_event"], drive.input["readiness"] = 0, Readiness.READY
    drive.tick()
    stopped = drive.x
    stopped[7:9] += 0.05
    drive.obedient = False
    drive.measure(stopped)
    drive.let_go()
    drive.tick(Request.ENABLE)
    assert drive.safety == E
    np.testing.assert_allclose(drive.x[:7], stopped[:7], rtol=0, atol=1e-12)
    np.testing.assert_allclose(drive.x[7:9], stopped[7:9], rtol=0, atol=1e-6)


@pytest.mark.parametrize("event", DEVICE_FAULTS)
def test_a_fault_of_a_device_cannot_be_reset_while_it_lasts(
    robot: InstrumentRobot, event: Event
) -> None:
    drive = driving(robot)
    drive.input["plant_event"] = event
    drive.tick()
    assert (drive.safety, drive.state["reason"][0]) == (F, event)
    drive.tick(Request.RESET)
    assert drive.safety == F
    drive.input["plant_event"] = 0
    drive.tick()
    assert drive.safety == F
    drive.tick(Request.RESET)
    assert drive.safety == D


@pytest.mark.parametrize("readiness", list(Readiness)[1:])
@pytest.mark.parametrize("state", [D, P])
def test_what_is_not_ready_is_not_enabled(
    robot: InstrumentRobot, state: Safety, readiness: Readiness
) -> None:
    drive = standing_in(robot, state)
    drive.input["readiness"] = readiness
    assert stood_still(drive.tick(Request.ENABLE), drive.x)
    assert drive.safety == state


@pytest.mark.parametrize("late_s", [0.101, np.nan, np.inf])
def test_a_tick_that_is_much_too_late_pauses(robot: InstrumentRobot, late_s: float) -> None:
    drive = driving(robot)
    drive.input["late_s"] = 0.09
    drive.tick()
    assert drive.safety == E
    drive.input["late_s"] = late_s
    drive.tick()
    assert (drive.safety, drive.state["reason"][0]) == (P, Event.CONTROL_LATE)


@pytest.mark.parametrize("servo", range(4))
def test_a_servo_that_does_not_follow_is_a_fault(robot: InstrumentRobot, servo: int) -> None:
    limit = np.deg2rad(robot.configuration.limits.servo_tracking_error_deg)
    drive = driving(robot)
    drive.obedient = False
    drive.input["measured_servo"][0, servo] += 0.9 * limit
    drive.tick()
    assert drive.safety == E
    drive.input["measured_servo"][0, servo] += 0.3 * limit
    drive.tick()
    assert (drive.safety, drive.state["reason"][0]) == (F, Event.TRACKING_ERROR)
