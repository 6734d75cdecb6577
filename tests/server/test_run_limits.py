"""``keyhole run`` on paths that cannot be followed: as far as it goes, bounded, and it says why."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

from robot.configuration import Configuration
from scenes.path import Path
from tests import own_kinematics
from tests.server import headless
from tests.server.headless import Run

CASES = ("0", "1", "2", "pointing")
DT = 0.002
SHAFT = np.array([0.6, 0.0, -0.8])


def there_and_back(reach: list[float], name: str) -> Path:
    """Straight to a point, a rest, and back."""
    return headless.path([[0, 0, 0, 0], [6, *reach], [7, *reach], [13, 0, 0, 0]], name)


def roll() -> Path:
    """A long turn about the shaft and back, further than the wrist can go."""
    rows = []
    for time_s in np.linspace(0.0, 24.0, 241):
        angle = math.radians(200.0) * (1.0 - math.cos(2.0 * math.pi * time_s / 24.0))
        rows.append([time_s, 0.0, 0.0, 0.0, *(angle * SHAFT)])
    return headless.path(rows, "roll")


PATHS = {
    "beyond reach": there_and_back([0.22, 0.0, 0.0], "beyond reach"),
    "sideways": there_and_back([0.0, 0.22, 0.0], "sideways"),
    "behind the trocar": headless.path(
        [
            [0, 0, 0, 0],
            [3, -0.109, 0, 0.122],
            [6, -0.2, 0, 0.25],
            [6.5, -0.2, 0, 0.25],
            [12, 0, 0, 0],
        ],
        "behind the trocar",
    ),
    "roll": roll(),
}
INSERTED = "shaft fully inserted (lambda at its lower limit)"
WITHDRAWN = "shaft fully withdrawn to the trocar (lambda at its upper limit)"
EVERY_PATH = pytest.mark.parametrize("name", PATHS)
EVERY_CASE = pytest.mark.parametrize("case", CASES)


@functools.cache
def unguarded() -> Configuration:
    """Nothing but the limits of joints, bend and lambda ends these motions."""
    return headless.changed(
        "limits",
        clearance_mm=-1000.0,
        workspace_min_m=(-9.0, -9.0, -9.0),
        workspace_max_m=(9.0, 9.0, 9.0),
    )


@functools.cache
def played(name: str, case: str, solver: str = "hqp") -> Run:
    return headless.play(PATHS[name], case, solver, under=unguarded())


def in_bounds(run: Run) -> None:
    assert run.document["ended"] == "completed"
    assert run.document["limits"]["violations"] == 0
    assert run.largest("rcm_mm") <= 0.01
    assert np.all(np.isfinite(run.result.trace))
    # The tip never leaves the ball that shaft and segment can reach from the trocar.
    away = np.linalg.norm(run.result.trace[:, 11:14] - run.result.trace[:, 25:28], axis=1)
    assert away.max() <= 0.260


@EVERY_PATH
@EVERY_CASE
def test_no_limit_is_violated_and_the_trocar_is_kept(name: str, case: str) -> None:
    in_bounds(played(name, case))


@EVERY_PATH
@EVERY_CASE
def test_nothing_shakes(name: str, case: str) -> None:
    """Without damping, the bend shakes with 2700 rad/s^2 beyond reach."""
    run = played(name, case)
    for coordinates, bound in ((run.uv, 150.0), (run.joints, 60.0)):
        accelerations = np.diff(coordinates, n=2, axis=0) / DT**2
        assert np.sqrt(np.mean(accelerations**2)) < bound


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("beyond reach", INSERTED),
        ("sideways", INSERTED),
        ("behind the trocar", WITHDRAWN),
    ],
)
@EVERY_CASE
def test_the_reason_is_named(name: str, words: str, case: str) -> None:
    assert played(name, case).document["limits"]["held_back"][words] > 0.05


@pytest.mark.parametrize("case", CASES[:3])
def test_a_joint_that_stands_in_the_way_is_named_with_its_limit(case: str) -> None:
    run = played("roll", case)
    named = [
        words for words in run.document["limits"]["held_back"] if "at its upper limit" in words
    ]
    assert named
    for words in named:
        joint = int(words.split()[1])
        degrees = math.degrees(headless.configuration().arm.joints[joint - 1].upper_rad) - 1.0
        assert words == f"joint {joint} at its upper limit ({degrees:.1f} deg)"
        reached = np.degrees(run.joints[:, joint - 1].max())
        assert degrees - 0.7 < reached <= degrees + 1e-9


def test_pointing_rolls_on_where_roll_is_nobody_s_wish() -> None:
    """It needs no joint limit: roll is released, position and axis are kept."""
    run = played("roll", "pointing")
    assert run.document["limits"]["held_back"] == {}
    assert run.largest("position_mm") <= 0.05


@pytest.mark.parametrize("name", ["beyond reach", "sideways"])
@pytest.mark.parametrize("case", ["1", "pointing"])
def test_beyond_reach_the_tip_goes_all_the_way_that_shaft_and_segment_allow(
    name: str, case: str
) -> None:
    """Straight from the trocar to the target, the shaft inserted to its limit."""
    run = played(name, case)
    instrument, limits = headless.configuration().instrument, headless.configuration().limits
    longest = (
        1.0 - limits.lambda_min - 1e-4
    ) * instrument.shaft_length_m + instrument.segment_length_m
    index = round(6.9 / DT)
    row = run.result.trace[index]
    expected = np.linalg.norm(row[18:21] - row[25:28]) - longest
    missing = run.result.errors[index, 0]
    assert expected > 0.02
    assert missing == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("name", ["beyond reach", "sideways"])
def test_case_2_keeps_the_orientation_even_then(name: str) -> None:
    run = played(name, "2")
    assert run.largest("orientation_deg") <= 0.05
    assert run.largest("position_mm") > played(name, "1").largest("position_mm")


@pytest.mark.parametrize("name", ["beyond reach", "sideways", "roll"])
@pytest.mark.parametrize("case", CASES[:3])
def test_it_is_back_where_the_path_ends(name: str, case: str) -> None:
    run = played(name, case)
    assert run.final("position_mm") <= 0.05
    assert run.final("orientation_deg") <= 0.05


@pytest.mark.parametrize(
    ("name", "solver"),
    [
        ("sideways", "closed-form"),
        ("behind the trocar", "closed-form"),
        ("beyond reach", "augmented"),
    ],
)
def test_the_closed_forms_stay_inside_too(name: str, solver: str) -> None:
    in_bounds(played(name, "1", solver))


@EVERY_CASE
def test_the_tip_follows_again_after_a_long_way_outside(case: str) -> None:
    """The last second of the way back is followed, not merely its end reached."""
    run = played("sideways", case)
    assert run.result.errors[-500:, 0].max() * 1e3 <= 0.1


def test_the_shaft_itself_passes_the_trocar_all_the_way() -> None:
    """By other kinematics than the program's, at its worst path."""
    run = played("behind the trocar", "1")
    for row in run.result.trace[::25]:
        where = own_kinematics.pose(headless.configuration(), row[1:8], row[8], row[9])
        off = own_kinematics.distance_from_axis(row[25:28], where.shaft_base, where.shaft_end)
        assert off <= 0.01e-3
        shaft = where.shaft_end - where.shaft_base
        along = (row[25:28] - where.shaft_base) @ shaft / (shaft @ shaft)
        assert 0.05 <= along <= 0.95
