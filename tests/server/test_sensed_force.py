"""The sensed force along the axes of its uncertainty."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from robot.records import REPORT
from robot.sensing.faults import SensingFault
from server.sensed_force import HELD_S, NOT_OBSERVABLE, ForceAxes, KnownAxes, fault_of, force_axes

EXPECTED = 0.5


def turned(rng: np.random.Generator) -> NDArray[np.float64]:
    """A random rotation."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    q[:, 0] *= np.linalg.det(q)
    return np.asarray(q)


def test_the_axes_hold_force_and_covariance(rng: np.random.Generator) -> None:
    for _ in range(50):
        turn, deviations = turned(rng), np.sort(rng.uniform(0.001, 0.6, 3))
        covariance = turn @ np.diag(deviations**2) @ turn.T
        force = rng.normal(size=3)
        axes = force_axes(force, covariance, EXPECTED)
        assert axes.deviations == pytest.approx(deviations, rel=1e-6)
        assert (axes.components >= 0.0).all()
        assert axes.components @ axes.directions == pytest.approx(force)
        whole = axes.directions.T @ np.diag(axes.deviations**2) @ axes.directions
        assert whole == pytest.approx(covariance, abs=1e-9)
        assert axes.observable.tolist() == (deviations < NOT_OBSERVABLE * EXPECTED).tolist()
        size = float(np.linalg.norm(force))
        along = np.sqrt(force @ covariance @ force) / size
        assert axes.known(3) == pytest.approx((size, along))


def test_another_frame_turns_the_directions_only(rng: np.random.Generator) -> None:
    turn, own = turned(rng), turned(rng)
    covariance = own @ np.diag([1e-4, 4e-4, 0.09]) @ own.T
    force = rng.normal(size=3)
    here = force_axes(force, covariance, EXPECTED)
    there = force_axes(turn @ force, turn @ covariance @ turn.T, EXPECTED)
    assert there.components == pytest.approx(here.components)
    assert there.directions == pytest.approx(here.directions @ turn.T, abs=1e-9)


def test_what_is_not_observable_is_left_out_of_the_known_force() -> None:
    axes = force_axes(np.array([0.3, 0.4, 5.0]), np.diag([1e-4, 1e-4, 0.2]), EXPECTED)
    assert axes.observable.tolist() == [True, True, False]
    assert axes.known(2) == pytest.approx((0.5, 0.01))
    assert axes.known(0) == (0.0, 0.0)
    none = force_axes(np.zeros(3), np.diag([1e-4, 4e-4, 0.2]), EXPECTED)
    assert none.known(2) == pytest.approx((0.0, 0.02))


def test_a_direction_without_information_is_told_at_once_and_believed_again_later() -> None:
    def axes(count: int) -> ForceAxes:
        return ForceAxes(np.eye(3), np.zeros(3), np.ones(3), np.arange(3) < count)

    known = KnownAxes()
    assert known.count(10.0, axes(3)) == 3
    assert known.count(10.1, axes(2)) == 2
    assert known.count(10.2, axes(3)) == 2
    assert known.count(10.3, axes(2)) == 2
    assert known.count(10.2 + HELD_S, axes(3)) == 2
    assert known.count(10.4 + HELD_S, axes(3)) == 3
    known.count(10.5 + HELD_S, axes(1))
    assert known.count(3.0, axes(3)) == 3, "a replay that went back"


def test_an_estimate_that_is_no_number_is_none() -> None:
    report = np.zeros(1, REPORT)[0]
    assert fault_of(report) == SensingFault.NONE
    report["estimate_force"][1] = np.nan
    assert fault_of(report) == SensingFault.NOT_CONVERGED
    report["estimate_fault"] = SensingFault.TRACKER_LOST
    assert fault_of(report) == SensingFault.TRACKER_LOST
