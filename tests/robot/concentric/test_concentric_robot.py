"""The concentric-tube arms as a robot: safety, leading A, B's place, limits, and being pure."""

from __future__ import annotations

import numpy as np
import pytest

from robot.concentric.concentric_robot import ConcentricRobot, UnsolvedStart, describe_limits
from robot.concentric.control import ControlStatus
from robot.concentric.design import METHODS
from robot.concentric.proximal import Proximal
from robot.concentric.tubes import TubeOutOfBounds
from robot.records import LeaderKind, Refusal, Request, Safety
from robot.safety import Event
from tests.robot.concentric.tube_drive import TubeDrive, concentric

AWAY = np.array([-0.002, 0.0015, 0.001])


@pytest.fixture(scope="module")
def robot() -> ConcentricRobot:
    return ConcentricRobot(concentric())


@pytest.fixture
def drive(robot: ConcentricRobot) -> TubeDrive:
    """Disabled at the first start."""
    return TubeDrive(robot)


def reason(drive: TubeDrive) -> Event:
    return Event(int(drive.state["reason"][0]))


def test_it_wakes_up_disabled_at_its_start_and_does_not_move(drive: TubeDrive) -> None:
    design = drive.robot.configuration.concentric
    start = drive.q
    assert np.allclose(start[:3] * 1e3, design.starts[0].translations_a_mm)
    assert np.allclose(np.rad2deg(start[9:]), design.starts[0].rotations_b_deg)
    drive.lead_to(drive.tip + AWAY)
    for _ in range(3):
        outcome = drive.tick()
    assert drive.safety == Safety.DISABLED
    assert np.array_equal(drive.q, start)
    assert outcome["command"]["moving"] == 0


@pytest.mark.parametrize("method", METHODS)
def test_a_goes_to_its_target_and_b_goes_with_it(robot: ConcentricRobot, method: str) -> None:
    drive = TubeDrive(robot, method)
    drive.enable()
    goal = drive.tip + AWAY
    place = drive.state["position_b"][0] - drive.tip
    limits = Proximal(robot.configuration.concentric)
    drive.lead_to(goal)
    worst_mm = 0.0
    for _ in range(400):
        outcome = drive.tick()
        assert drive.safety == Safety.ENABLED
        off = drive.state["position_b"][0] - drive.tip - place
        worst_mm = max(worst_mm, 1e3 * float(np.linalg.norm(off)))
        assert max(limits.excess(drive.q[:3]), limits.excess(drive.q[6:9])) < 1e-12
        assert np.abs(outcome["report"]["q_dot"].reshape(2, 2, 3)[:, 1]).max() <= 0.5 + 1e-9
    # The printed form of NSPWLN is no projection and leaves an error of its own.
    allowed_mm, left_mm = (1.5, 1.0) if method == "nspwln" else (0.1, 0.02)
    assert worst_mm < allowed_mm
    assert 1e3 * np.linalg.norm(goal - drive.tip) < left_mm


def test_a_robot_made_anew_goes_on_from_any_state_to_the_same_bit(robot: ConcentricRobot) -> None:
    drive = TubeDrive(robot)
    drive.enable()
    drive.lead_to(drive.tip + 3.0 * AWAY)
    before = [drive.state.copy()]
    outcomes = []
    for _ in range(40):
        outcomes.append(drive.tick().tobytes())
        before.append(drive.state.copy())
    again = TubeDrive(ConcentricRobot(robot.configuration))
    again.input[:] = drive.input
    for place in (39, 3, 20):
        again.state = before[place]
        assert again.tick().tobytes() == outcomes[place]


def test_a_hand_that_stops_stops_the_arms(drive: TubeDrive) -> None:
    drive.enable()
    drive.lead_to(drive.tip + AWAY)
    for _ in range(20):
        drive.tick()
    drive.input["leader"]["clutch"] = 0
    there = drive.q
    outcome = drive.tick()
    assert np.array_equal(drive.q, there)
    assert outcome["command"]["moving"] == 0
    assert drive.safety == Safety.ENABLED


def test_a_leader_that_goes_silent_pauses(drive: TubeDrive) -> None:
    drive.enable()
    drive.lead_to(drive.tip + AWAY)
    drive.tick()
    drive.input["leader"]["age_s"] = 0.2
    there = drive.q
    drive.tick()
    assert (drive.safety, reason(drive)) == (Safety.PAUSED, Event.LEADER_STALE)
    assert np.array_equal(drive.q, there)


def test_the_emergency_stop_stops_and_only_reset_leads_out(drive: TubeDrive) -> None:
    drive.enable()
    drive.lead_to(drive.tip + AWAY)
    drive.tick()
    there = drive.q
    drive.tick(Request.EMERGENCY_STOP)
    drive.tick(Request.ENABLE)
    assert drive.safety == Safety.FAULT
    assert np.array_equal(drive.q, there)
    drive.tick(Request.RESET)
    assert reason(drive) == Event.RESET


@pytest.mark.parametrize(
    ("axis", "off"), [(0, 0.0021), (3, np.deg2rad(5.1)), (8, -0.0021), (11, -np.deg2rad(5.1))]
)
def test_a_tube_that_does_not_follow_is_a_fault(drive: TubeDrive, axis: int, off: float) -> None:
    drive.enable()
    drive.obedient = False
    drive.input["measured_q"][0, axis] += 0.9 * off
    drive.tick()
    assert drive.safety == Safety.ENABLED
    drive.input["measured_q"][0, axis] += 0.2 * off
    drive.tick()
    assert (drive.safety, reason(drive)) == (Safety.FAULT, Event.TRACKING_ERROR)


def test_a_measurement_that_is_no_number_is_a_fault(drive: TubeDrive) -> None:
    drive.enable()
    drive.obedient = False
    drive.input["measured_q"][0, 7] = np.nan
    there = drive.q
    drive.tick()
    assert (drive.safety, reason(drive)) == (Safety.FAULT, Event.MEASUREMENT_LOST)
    assert np.array_equal(drive.q, there)


def test_enabling_takes_the_measured_tubes_and_bs_place_as_they_are(drive: TubeDrive) -> None:
    measured = drive.q + 1e-3 * np.array([1, 0, 0, 5, 3, 1, 0, 0, 1, 2, 2, 9], dtype=float)
    drive.obedient = False
    drive.input["measured_q"] = measured
    drive.tick(Request.ENABLE)
    assert np.array_equal(drive.q, measured)
    apart = drive.state["position_b"][0] - drive.tip
    assert np.allclose(drive.state["relative_position"][0], apart, atol=1e-15)


def test_b_that_lost_its_place_pauses_and_may_be_led_back(drive: TubeDrive) -> None:
    drive.enable()
    drive.state["relative_position"][0, 0] += 0.0025
    drive.tick()
    assert (drive.safety, reason(drive)) == (Safety.PAUSED, Event.RELATIVE_ERROR)
    drive.enable()
    drive.lead_to(drive.tip + 0.1 * AWAY)
    for _ in range(300):
        drive.tick()
    assert drive.safety == Safety.ENABLED
    assert drive.outcome[0]["report"]["relative_error"] < 1e-4
    assert drive.state["relative_allowance"][0] == pytest.approx(0.002)


def test_a_target_behind_the_face_or_outside_the_workspace_is_kept_out(drive: TubeDrive) -> None:
    drive.enable()
    drive.lead_to(np.array([0.03, -0.03, -0.05]), LeaderKind.PATH)
    drive.tick()
    assert drive.outcome[0]["report"]["target_refused"] == Refusal.OUTSIDE_WORKSPACE
    assert drive.state["target_position"][0, 2] == pytest.approx(0.005)


def test_a_target_far_away_is_refused(drive: TubeDrive) -> None:
    drive.enable()
    there = drive.q
    drive.lead_to(drive.tip + np.array([0.0, 0.0, -0.2]))
    drive.tick()
    assert drive.outcome[0]["report"]["target_refused"] == Refusal.TARGET_TOO_FAR
    assert np.array_equal(drive.q, there)


def test_what_leads_toward_snapping_pauses_and_the_way_back_is_open() -> None:
    # A margin above where the arms stand: every step that lowers the determinant is one too many.
    design = concentric().concentric
    apart, turned = (-300.0, -200.0, -100.0), (150.0, 0.0, 0.0)
    twisted = design.starts[0].model_copy(
        update={
            "translations_a_mm": apart,
            "translations_b_mm": apart,
            "rotations_a_deg": turned,
            "rotations_b_deg": turned,
        }
    )
    robot = ConcentricRobot(concentric({"stability_margin": 10.0}, starts=(twisted,)))
    drive = TubeDrive(robot, "nspqp")
    start = drive.tip
    paused, moved = 0, 0
    for direction in (*np.eye(3), *-np.eye(3)):
        drive.enable()
        before = drive.outcome[0]["report"]["stability"].copy()
        there = drive.q
        drive.lead_to(start + 0.02 * direction)
        for _ in range(50):
            outcome = drive.tick()
            assert np.all(outcome["report"]["stability"] >= before)
            if drive.safety != Safety.ENABLED:
                assert (drive.safety, reason(drive)) == (Safety.PAUSED, Event.NEAR_SNAPPING)
                paused += 1
                break
        moved += not np.array_equal(drive.q, there)
        drive.input["leader"]["clutch"] = 0
        drive.tick()
    assert paused > 0
    assert moved > 0


@pytest.mark.parametrize("method", ["nspqp", "hqp"])
def test_arms_led_into_the_fold_pause_and_never_jump(method: str) -> None:
    """Turned by hand to just before the fold at 207 degrees, then led further: no margin helps."""
    robot = ConcentricRobot(concentric({"stability_margin": 0.0, "motor_spacing_mm": 0.0}))
    drive = TubeDrive(robot, method)
    drive.obedient = False
    q = np.tile([-0.385, -0.266, -0.149, 0.0, 0.0, 0.0], 2)
    for degrees in (0.0, 60.0, 120.0, 160.0, 180.0, 195.0, 203.0, 206.0, 206.9):
        q[[3, 9]] = np.deg2rad(degrees)
        drive.input["measured_q"] = q
        drive.tick(Request.DISABLE)
        drive.tick(Request.ENABLE)
    assert 0.0 < drive.outcome[0]["report"]["stability"].min() < 0.2
    drive.obedient = True
    further = robot._now.jacobian[0, :3, 3].copy()
    drive.lead_to(drive.tip + 0.02 * further / np.linalg.norm(further))
    for _ in range(400):
        before = drive.tip
        outcome = drive.tick()
        assert np.linalg.norm(drive.tip - before) < 1e-3
        assert np.all(outcome["report"]["stability"] > 0.0)
        if drive.safety != Safety.ENABLED:
            break
    assert (drive.safety, reason(drive)) == (Safety.PAUSED, Event.NEAR_SNAPPING)


def test_a_start_outside_of_what_tubes_can_be_is_refused_by_name() -> None:
    design = concentric().concentric
    outside = design.starts[0].model_copy(update={"translations_a_mm": (-100.0, -120.0, -50.0)})
    with pytest.raises(TubeOutOfBounds, match="tube 2"):
        ConcentricRobot(concentric(starts=(outside,)))


def test_a_start_that_cannot_be_solved_says_which() -> None:
    assert "start 3" in str(UnsolvedStart(3))


def test_limits_are_told_in_words() -> None:
    bits = 1 << 0 | 1 << (6 + 4) | 1 << (12 + 5)
    words = describe_limits(bits, int(ControlStatus.INFEASIBLE), 3)
    assert words[:3] == [
        "arm A, tube 1 at its fastest translation",
        "arm B, tube 2 held by its end or a neighbour",
        "arm B, tube 3 at its fastest turn",
    ]
    assert len(words) == 4
    assert describe_limits(0, int(ControlStatus.SOLVED), 3) == []
