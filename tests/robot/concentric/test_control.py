"""One iteration of control after the other: limits, refusals, replays, and the paper's figures."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.concentric.control import (
    REASONS,
    ControlReport,
    ControlStatus,
    PairControl,
)
from robot.concentric.design import METHODS, Concentric
from robot.concentric.pair import PairKinematics
from robot.concentric.proximal import Proximal
from tests.robot.concentric.pair_problem import TUBES, at, configurations, control, design

STILL = np.zeros(3)


class Drive:
    """A control, and where the arms stand."""

    def __init__(self, method: str, q: np.ndarray, period: float = 0.1) -> None:
        self.control = control(method, period)
        self.now, self.after = at(q), PairKinematics(TUBES)
        self.report = ControlReport(TUBES)
        self.relative, self.first = self.now.relative.copy(), self.now.position[0].copy()

    def step(self, desired: np.ndarray, feed_forward: np.ndarray = STILL) -> ControlStatus:
        status = self.control.step(
            self.now, desired, self.relative, feed_forward, self.after, self.report
        )
        self.now, self.after = self.after, self.now
        return status

    def bits(self) -> bytes:
        return b"".join(np.asarray(value).tobytes() for value in vars(self.now).values())


def wander(drive: Drive, rng: np.random.Generator, steps: int, reach: float) -> float:
    """Toward random places; the largest ‖ε_AB‖ of all steps, m."""
    worst, desired = 0.0, drive.first
    for step in range(steps):
        if step % 8 == 0:
            desired = drive.now.position[0] + rng.uniform(-reach, reach, 3)
        drive.step(desired)
        worst = max(worst, float(np.linalg.norm(drive.report.relative_after)))
    return worst


@pytest.mark.parametrize("period", [0.1, 0.01])
def test_hqp_keeps_every_limit_and_b_beside_a_wherever_a_is_sent(
    rng: np.random.Generator, period: float
) -> None:
    limits = Proximal(design())
    speed, touched = design().limits.rotation_speed_rad_s, 0
    for q in configurations():
        drive = Drive("hqp", q, period)
        for _ in range(3):
            before = drive.now.q.copy()
            assert wander(drive, rng, 8, 0.02) < 5e-5
            touched += drive.report.limits_active > 0
            rates = (drive.now.q - before) / (8.0 * period)
            assert np.abs(rates.reshape(4, TUBES)[1::2]).max() <= speed + 1e-12
            assert drive.report.peak_rotation <= speed
            assert drive.report.peak_translation <= limits.speed * (1.0 + 1e-9)
            assert 1e3 * drive.report.bound_violation < 1e-9
            for arm in range(2):
                beta = drive.now.q[6 * arm : 6 * arm + 3]
                assert 1e3 * limits.excess(beta) < 1e-9
    assert touched > 10


def test_hqp_against_the_limits_never_leaves_them(rng: np.random.Generator) -> None:
    """Sent out and back in for long: the tubes end pressed against each other."""
    held = 0
    for q in configurations()[:3]:
        drive = Drive("hqp", q)
        for direction in (rng.normal(size=3), -drive.first):
            desired = drive.now.position[0] + 0.15 * direction / np.linalg.norm(direction)
            for _ in range(60):
                drive.step(desired)
                assert 1e3 * drive.report.bound_violation < 1e-9
                assert np.linalg.norm(drive.report.relative_after) < 5e-5
                held += (drive.report.limits_active >> (2 * TUBES)) & (2 ** (2 * TUBES) - 1) > 0
    assert held > 30


@pytest.mark.parametrize("method", METHODS)
def test_a_replay_is_the_same_bit_for_bit(method: str) -> None:
    ends = []
    for _ in range(2):
        drive = Drive(method, configurations()[4])
        for step in range(12):
            drive.step(drive.first + 1e-3 * np.array([1.0, step, -0.5 * step]))
        ends.append(drive.bits() + drive.report.rates.tobytes())
    assert ends[0] == ends[1]


@pytest.mark.parametrize("method", METHODS)
def test_one_step_follows_from_configuration_and_torsion_alone(method: str) -> None:
    """What came before leaves nothing behind: a replay may begin anywhere."""
    drive, fresh = Drive(method, configurations()[5]), Drive(method, configurations()[5])
    desired = drive.first + 0.004
    for _ in range(5):
        drive.step(desired)
    fresh.now.q[:] = drive.now.q
    assert fresh.control.pair.evaluate(fresh.now, drive.now.torsion) == 0
    drive.step(desired)
    fresh.step(desired)
    assert fresh.bits() == drive.bits()


@pytest.mark.parametrize("method", METHODS)
def test_nothing_moves_where_nothing_is_wanted(method: str) -> None:
    for q in configurations()[:3]:
        drive = Drive(method, q)
        assert drive.step(drive.first) == ControlStatus.SOLVED
        np.testing.assert_allclose(drive.now.q, q, rtol=0, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_number_that_is_not_finite_moves_nothing(method: str, bad: float) -> None:
    drive = Drive(method, configurations()[0])
    before = drive.bits()
    desired = drive.first.copy()
    desired[1] = bad
    assert drive.step(desired) == ControlStatus.NOT_FINITE
    assert drive.bits() == before
    assert not drive.report.rates.any()
    assert drive.step(drive.first, np.array([0.0, bad, 0.0])) == ControlStatus.NOT_FINITE
    assert drive.step(drive.first) == ControlStatus.SOLVED


def with_margin(margin: float) -> Concentric:
    limits = design().limits.model_copy(update={"stability_margin": margin})
    return design().model_copy(update={"limits": limits})


def test_only_what_comes_nearer_to_snapping_is_refused(rng: np.random.Generator) -> None:
    """Under a margin above where the arms stand, every loss of stability is refused."""
    counts = dict.fromkeys((ControlStatus.SOLVED, ControlStatus.UNSTABLE), 0)
    for q in configurations()[3:] * 4:
        drive = Drive("hqp", q)
        drive.control = PairControl(with_margin(10.0), 0.1, "hqp")
        before, stood = drive.bits(), drive.now.stability.copy()
        desired = drive.first + rng.uniform(-0.002, 0.002, 3)
        status = drive.step(desired)
        counts[status] += 1
        if status == ControlStatus.UNSTABLE:
            assert drive.bits() == before
            assert not drive.report.rates.any()
            freely = Drive("hqp", q)
            assert freely.step(desired) == ControlStatus.SOLVED
            assert np.any(freely.now.stability < stood)
        else:
            assert np.all(drive.now.stability >= stood)
    assert min(counts.values()) >= 2


def test_infeasible_is_said_and_nothing_moves() -> None:
    drive = Drive("nspqp", configurations()[2])
    drive.relative[2] += 0.01
    before = drive.bits()
    assert drive.step(drive.first) == ControlStatus.INFEASIBLE
    assert drive.bits() == before


@pytest.mark.parametrize("method", ["snsqp", "hqp"])
def test_the_others_go_as_fast_as_the_tubes_can(method: str) -> None:
    drive = Drive(method, configurations()[2])
    drive.relative[2] += 0.01
    before = np.linalg.norm(drive.relative - drive.now.relative)
    assert drive.step(drive.first) == ControlStatus.SOLVED
    after = np.linalg.norm(drive.report.relative_after)
    assert before - 0.0011 < after < before - 0.0004
    assert (drive.report.scales[0] < 1.0) == (method == "snsqp")


def test_every_status_has_its_words() -> None:
    assert set(REASONS) == set(ControlStatus)


def test_feed_forward_takes_the_lag_out_of_following() -> None:
    velocity = np.array([0.002, 0.0, 0.001])
    lags = []
    for given in (STILL, velocity):
        drive = Drive("hqp", configurations()[6], 0.01)
        desired = drive.first.copy()
        for _ in range(100):
            desired = desired + 0.01 * velocity
            drive.step(desired - 0.01 * given, given)
        lags.append(np.linalg.norm(drive.now.position[0] - desired))
    assert lags[0] > 20.0 * lags[1]


def test_limits_that_hold_are_named_by_their_bits() -> None:
    drive = Drive("hqp", configurations()[0])
    desired = drive.first + np.array([0.0, 0.0, 0.05])
    drive.step(desired)
    fastest = np.abs(drive.report.rates.reshape(2, 2, TUBES)[:, 0].ravel()) > 0.00499999
    assert fastest.any()
    for place in range(2 * TUBES):
        assert drive.report.limits_active >> place & 1 == fastest[place]


@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_target_out_of_reach_is_met_with_rest_not_with_shaking(place: int) -> None:
    drive = Drive("hqp", configurations()[place], 0.01)
    away, rates = np.array([0.06, 0.0, 0.0]), []
    for step in range(1600):
        drive.step(drive.first + away * min(step / 1200.0, 1.0))
        if step >= 1500:
            rates.append(drive.report.rates.copy())
    assert np.linalg.norm(drive.report.tracking_after) > 0.01
    assert np.linalg.norm(drive.report.relative_after) < 5e-5
    changes = np.abs(np.diff(rates, axis=0)).reshape(-1, 4, TUBES)
    assert np.sqrt(np.mean(changes[:, 1::2] ** 2)) < 0.02  # rad/s from tick to tick; caps 0.5
    assert np.sqrt(np.mean(changes[:, ::2] ** 2)) < 2e-4  # m/s; the cap is 5e-3
