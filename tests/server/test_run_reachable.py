"""``keyhole run`` on paths that can be followed: the figures that must be met."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.start import start_tip_rotation
from scenes.experiments import experiment
from scenes.path import Path
from tests.server import headless
from tests.server.headless import Run

CASES = ("0", "1", "2")
DT = 0.002


def followed(run: Run) -> None:
    """Position 0.01 mm, orientation 0.01 degrees, RCM 0.001 mm, and no limit violated."""
    assert run.document["ended"] == "completed"
    assert run.largest("position_mm") <= 0.01
    assert run.largest("orientation_deg") <= 0.01
    assert run.largest("rcm_mm") <= 0.001
    assert run.document["limits"] == {"violations": 0, "true_violations": 0, "held_back": {}}


@pytest.mark.parametrize("solver", ["hqp", "closed-form"])
@pytest.mark.parametrize("case", CASES)
def test_the_circle_is_followed(case: str, solver: str) -> None:
    run = headless.named("circle", case, solver)
    followed(run)
    assert run.document["steps"] == 10001


def fast_circle() -> Path:
    """The circle in 8 s."""
    samples = experiment("circle", headless.configuration()).path.samples.copy()
    samples[:, 0] *= 8.0 / 20.0
    return Path(samples, "circle in 8 s")


def test_polar_coordinates_and_the_augmented_form_follow_alike() -> None:
    first, *others = (
        headless.play(fast_circle(), "1", solver, coordinates)
        for solver, coordinates in (
            ("closed-form", "uv"),
            ("closed-form", "polar"),
            ("augmented", "uv"),
        )
    )
    for run in (first, *others):
        followed(run)
        np.testing.assert_allclose(run.joints, first.joints, rtol=0, atol=1e-8)


@pytest.mark.parametrize(("solver", "tolerance"), [("hqp", 1e-4), ("closed-form", 1e-8)])
def test_the_cases_move_the_joints_alike_where_all_can_be_met(
    solver: str, tolerance: float
) -> None:
    first, *others = (headless.named("circle", case, solver) for case in CASES)
    for other in others:
        np.testing.assert_allclose(other.joints, first.joints, rtol=0, atol=tolerance)
        np.testing.assert_allclose(other.uv, first.uv, rtol=0, atol=tolerance)


def test_pointing_follows_position_and_axis_and_lets_the_roll_go() -> None:
    run = headless.named("circle", "pointing")
    assert run.largest("position_mm") <= 0.01
    assert run.largest("rcm_mm") <= 0.001
    assert run.largest("orientation_deg") > 1.0
    trace = run.result.trace
    axes = [_tip_axis(trace[:, 14:18]), _tip_axis(trace[:, 21:25])]
    between = np.arccos(np.clip(np.sum(axes[0] * axes[1], axis=1), -1.0, 1.0))
    assert math.degrees(between.max()) <= 0.01


def _tip_axis(wxyz: np.ndarray) -> np.ndarray:
    """(n, 3) z axes of the quaternions (n, 4)."""
    w, x, y, z = wxyz.T
    return np.column_stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)])


@pytest.mark.parametrize("name", ["circle-yz", "square"])
def test_the_other_reachable_experiments_are_followed(name: str) -> None:
    followed(headless.named(name))


def bent_every_way() -> Path:
    """From straight, 25 degrees toward each of eight directions and back through straight."""
    start = start_tip_rotation(headless.straight_start())
    rows = []
    for time_s in np.linspace(0.0, 12.0, 601):
        ray, share = divmod(time_s / 1.5, 1.0)
        bend = math.radians(25.0) * math.sin(math.pi * share) ** 2
        direction = 0.25 * math.pi * ray
        turn = start @ [bend * math.cos(direction), bend * math.sin(direction), 0.0]
        rows.append([time_s, 0.005 * math.sin(math.pi * time_s / 6.0), 0.0, 0.0, *turn])
    return headless.path(rows, "every way")


@pytest.mark.parametrize(
    ("case", "solver"), [("0", "hqp"), ("1", "hqp"), ("2", "hqp"), ("1", "closed-form")]
)
def test_straight_is_an_ordinary_point(case: str, solver: str) -> None:
    run = headless.play(bent_every_way(), case, solver, under=headless.straight_start())
    followed(run)
    bend = np.hypot(*run.uv.T)
    assert bend[0] < 1e-3
    ways = np.round(np.arctan2(run.uv[:, 1], run.uv[:, 0])[bend > 0.2] / (0.25 * math.pi))
    assert len(set(ways % 8)) == 8
    # Back through straight between the rays, at a finite speed.
    assert np.sum((bend[1:-1] < bend[:-2]) & (bend[1:-1] <= bend[2:]) & (bend[1:-1] < 0.05)) >= 7
    assert np.abs(np.diff(run.uv, axis=0)).max() / DT < 1.5


def test_the_paper_s_law_alone_lags_by_what_the_notes_say() -> None:
    """Eqs. (97)-(101) without feed-forward: 0.4 mm on the circle of 20 s, 0.85 mm in 8 s."""
    paper = headless.changed("commands", feed_forward=False, speed_max_mm_s=30.0)
    slow = headless.play(experiment("circle", paper).path, under=paper)
    assert 0.3 < slow.largest("position_mm") < 0.5
    fast = headless.play(fast_circle(), under=paper)
    assert 0.75 < fast.largest("position_mm") < 0.95
    for run in (slow, fast):
        assert run.largest("rcm_mm") <= 0.001
        assert run.document["limits"]["violations"] == 0


def test_a_path_needs_nobody_at_the_hold_key() -> None:
    held = headless.changed("teleoperation", hold_to_move=True)
    run = headless.play(headless.path([[0, 0, 0, 0], [1, 0.005, 0, 0]], "short"), under=held)
    followed(run)
    moved = run.result.trace[-1, 11:14] - run.result.trace[0, 11:14]
    np.testing.assert_allclose(moved, [0.005, 0.0, 0.0], rtol=0, atol=1e-5)
