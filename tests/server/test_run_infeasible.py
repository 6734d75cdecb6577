"""``keyhole run circle-infeasible``: what each case gives up, against the offline optimum."""

from __future__ import annotations

import numpy as np
import pytest

from robot.records import Case
from scenes.experiments import experiment
from tests.server import headless

EVERY = 100
"""Ticks between two instants at which the offline solver is asked."""


@pytest.fixture(scope="module")
def optima() -> dict[str, np.ndarray]:
    """By case: rows of instant, best position error in mm, best orientation error in degrees."""
    found = {}
    for name, case in (
        ("0", Case.BALANCED),
        ("1", Case.LINEAR_FIRST),
        ("2", Case.ANGULAR_FIRST),
    ):
        rows = headless.optimum(headless.named("circle-infeasible", name), case, EVERY)
        rows[:, 1:] *= 1e3, 180.0 / np.pi
        found[name] = rows
    return found


def near(given_up: np.ndarray, best: np.ndarray, share: float) -> None:
    """At every instant within ``share`` of the optimum.

    Where next to nothing has to be given up, as the limit is met and left, within a hundredth of
    the most that ever has to be: closing in on the limit and taking back what was given up are
    themselves commands with a time constant.
    """
    much = best > 0.05 * best.max()
    assert 0.2 < much.mean() < 0.8
    np.testing.assert_allclose(given_up[much], best[much], rtol=share)
    np.testing.assert_allclose(given_up[~much], best[~much], rtol=0, atol=0.01 * best.max())
    assert given_up.max() == pytest.approx(best.max(), rel=share)


def errors(case: str, solver: str = "hqp") -> np.ndarray:
    """(steps, 3) mm, degrees, mm."""
    run = headless.named("circle-infeasible", case, solver)
    return run.result.errors * [1e3, 180.0 / np.pi, 1e3]


@pytest.mark.parametrize("case", ["0", "1", "2", "pointing"])
def test_every_case_keeps_trocar_and_limits_and_says_what_held_it_back(case: str) -> None:
    run = headless.named("circle-infeasible", case)
    assert run.document["ended"] == "completed"
    assert run.largest("rcm_mm") <= 0.005
    assert run.document["limits"]["violations"] == 0
    assert run.document["bend_deg"]["max"] <= 90.0
    held_back = run.document["limits"]["held_back"]
    assert set(held_back) == {"bend limit 90 deg"}
    assert 0.2 < held_back["bend limit 90 deg"] < 0.7


def test_case_1_keeps_the_position_and_gives_up_as_little_orientation_as_there_is(
    optima: dict[str, np.ndarray],
) -> None:
    run, best = headless.named("circle-infeasible", "1"), optima["1"]
    assert run.largest("position_mm") <= 0.05
    given_up = errors("1")[best[:, 0].astype(int), 1]
    assert best[:, 2].max() > 20.0
    near(given_up, best[:, 2], 0.03)
    assert run.final("orientation_deg") <= 0.05


def test_case_2_keeps_the_orientation_and_gives_up_as_little_position_as_there_is(
    optima: dict[str, np.ndarray],
) -> None:
    run, best = headless.named("circle-infeasible", "2"), optima["2"]
    assert run.largest("orientation_deg") <= 0.05
    given_up = errors("2")[best[:, 0].astype(int), 0]
    assert best[:, 1].max() > 50.0
    near(given_up, best[:, 1], 0.03)
    assert run.final("position_mm") <= 0.05


def test_case_0_lies_strictly_between_the_others_and_near_the_optimum_of_its_weights(
    optima: dict[str, np.ndarray],
) -> None:
    run, best = headless.named("circle-infeasible", "0"), optima["0"]
    first, second = (headless.named("circle-infeasible", case) for case in ("1", "2"))
    for what in ("position_mm", "orientation_deg"):
        low, high = sorted([first.largest(what), second.largest(what)])
        assert low * 1.05 + 0.05 < run.largest(what) < high * 0.95
    given_up = errors("0")[best[:, 0].astype(int)]
    near(given_up[:, 0], best[:, 1], 0.05)
    near(given_up[:, 1], best[:, 2], 0.05)
    assert run.final("position_mm") <= 0.05
    assert run.final("orientation_deg") <= 0.05


def test_no_instant_beats_the_offline_optimum(optima: dict[str, np.ndarray]) -> None:
    """Or it would be no optimum, and the comparisons above would mean nothing."""
    for case, column in (("1", 2), ("2", 1)):
        best = optima[case]
        given_up = errors(case)[best[:, 0].astype(int), column - 1]
        assert np.all(given_up >= best[:, column] * 0.98 - 0.3)


@pytest.mark.parametrize("case", ["0", "1", "2"])
def test_the_command_is_met_again_as_soon_as_it_can_be(case: str) -> None:
    """Before the bend limit and after it, nothing is given up."""
    found = errors(case)
    reachable = np.hypot(*headless.named("circle-infeasible", case).uv.T) < np.radians(85.0)
    assert 0.3 < reachable.mean() < 0.7
    assert found[reachable, 0].max() <= 0.05
    assert found[reachable, 1].max() <= 0.05


@pytest.mark.parametrize(
    ("length", "position_mm", "orientation_deg"), [(0.03, 2.2, 20.5), (1.0, 52.7, 0.4)]
)
def test_the_characteristic_length_moves_case_0_between_the_others(
    length: float, position_mm: float, orientation_deg: float
) -> None:
    """The longer it is, the more a radian weighs against a metre."""
    weighed = headless.changed("priority", characteristic_length_m=length)
    run = headless.play(experiment("circle-infeasible", weighed).path, "0", under=weighed)
    assert run.largest("position_mm") == pytest.approx(position_mm, rel=0.03)
    assert run.largest("orientation_deg") == pytest.approx(orientation_deg, rel=0.05, abs=0.05)
