"""The simulated tip tracker: rate, delay, noise, age, repeatability."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hardware.physics.tracker import TipTracker
from robot.configuration import Tracker
from server.configuration_file import load

TICK_NS = 2_000_000


def tracker(seed: int = 1, **changed: float) -> TipTracker:
    values = {**load().tracker.model_dump(), **changed}
    return TipTracker(Tracker.model_validate(values), np.random.default_rng(seed))


def exact(**changed: float) -> TipTracker:
    return tracker(1, position_noise_mm=0.0, orientation_noise_deg=0.0, **changed)


def watch(one: TipTracker, ticks: int) -> list[np.ndarray]:
    """What it says after every tick of a tip that moves along x by 1 m/s."""
    seen = []
    for tick in range(ticks):
        time_ns = tick * TICK_NS
        one.look(time_ns, np.array([time_ns * 1e-9, 0.2, 0.3]), np.eye(3))
        seen.append(one.newest.copy())
    return seen


@pytest.mark.parametrize("rate_hz", [25.0, 40.0, 120.0, 500.0])
def test_it_samples_at_its_rate(rate_hz: float) -> None:
    seconds = 4.0
    seen = watch(exact(rate_hz=rate_hz, delay_ms=0.0), round(seconds / 0.002))
    assert seen[-1]["sequence"] == pytest.approx(rate_hz * seconds, abs=1)
    steps = np.diff([int(one["sequence"]) for one in seen])
    assert set(steps.tolist()) <= {0, 1}


def test_a_rate_above_the_ticks_gives_a_sample_a_tick() -> None:
    seen = watch(exact(rate_hz=1000.0, delay_ms=0.0), 50)
    assert [int(one["sequence"]) for one in seen] == list(range(1, 51))


@pytest.mark.parametrize("delay_ms", [0.0, 7.0, 20.0, 130.0])
def test_a_sample_comes_out_late_and_says_how_old_it_is(delay_ms: float) -> None:
    seen = watch(exact(delay_ms=delay_ms), 500)
    silent = [one for one in seen if one["sequence"] == 0]
    assert len(silent) == math.ceil(delay_ms * 1e6 / TICK_NS)
    for tick, one in enumerate(seen):
        if one["sequence"] == 0:
            continue
        taken_s = float(one["position"][0])
        assert one["age_s"] == pytest.approx(tick * 0.002 - taken_s, abs=1e-12)
        assert one["age_s"] >= delay_ms * 1e-3 - 1e-12


def test_the_age_grows_between_samples_and_falls_back_with_a_new_one() -> None:
    seen = [one for one in watch(exact(), 500) if one["sequence"] > 0]
    for before, now in itertools.pairwise(seen):
        if now["sequence"] == before["sequence"]:
            assert now["age_s"] == pytest.approx(before["age_s"] + 0.002, abs=1e-12)
            assert now["position"].tobytes() == before["position"].tobytes()
        else:
            assert now["age_s"] < before["age_s"]


def test_the_noise_is_as_configured() -> None:
    one = tracker(rate_hz=500.0, delay_ms=0.0, position_noise_mm=0.2, orientation_noise_deg=0.3)
    turn = Rotation.from_rotvec([0.4, -0.2, 0.9])
    places, turns = [], []
    for tick in range(4000):
        one.look(tick * TICK_NS, np.array([0.1, 0.2, 0.3]), turn.as_matrix())
        places.append(one.newest["position"].copy())
        seen = Rotation.from_quat(one.newest["wxyz"][[1, 2, 3, 0]])
        turns.append((seen * turn.inv()).as_rotvec(degrees=True))
    off = (np.array(places) - [0.1, 0.2, 0.3]) * 1e3
    np.testing.assert_allclose(off.std(axis=0), 0.2, rtol=0.06)
    np.testing.assert_allclose(np.array(turns).std(axis=0), 0.3, rtol=0.06)
    np.testing.assert_allclose(off.mean(axis=0), 0.0, rtol=0, atol=0.02)
    assert np.abs(np.corrcoef(off[:-1, 0], off[1:, 0])[0, 1]) < 0.06


def test_it_is_repeatable_from_its_seed() -> None:
    first, second, other = (watch(tracker(seed), 300) for seed in (3, 3, 4))
    assert [one.tobytes() for one in first] == [one.tobytes() for one in second]
    assert [one.tobytes() for one in first] != [one.tobytes() for one in other]
