"""What of the commands goes to the arm: interpolated, near, inside limits, never too fast."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest

from hardware.arm.follower import CommandRing, Follower, Verdict

MS = 1_000_000
LOWER, UPPER = np.full(7, -2.0), np.full(7, 2.0)
STEP = np.full(7, 0.004)
NEAR, JUMP = 0.02, 0.1


def follower() -> Follower:
    return Follower(LOWER, UPPER, STEP, NEAR, JUMP)


def led(at: np.ndarray) -> tuple[Follower, np.ndarray]:
    """One that follows a command at rest where the arm stands, and what it gives out."""
    it, out = follower(), np.full(7, np.nan)
    it.put(0, at + 0.001)
    assert it.next(0, at, out) == Verdict.NONE_YET
    it.put(2 * MS, at)
    assert it.next(2 * MS, at, out) == Verdict.FOLLOWED
    np.testing.assert_array_equal(out, at)
    return it, out


def test_between_two_commands_lies_the_line_and_after_the_newest_it_stays(
    rng: np.random.Generator,
) -> None:
    ring, out = CommandRing(), np.empty(7)
    assert not ring.at(0, out)
    commands = rng.uniform(-1, 1, (40, 7))
    for tick, q in enumerate(commands):
        ring.put(tick * 2 * MS, q)
    for share in (0.0, 0.25, 0.5, 0.9):
        assert ring.at(round((35 + share) * 2 * MS), out)
        expected = commands[35] + share * (commands[36] - commands[35])
        np.testing.assert_allclose(out, expected, rtol=0, atol=1e-12)
    assert ring.at(1000 * MS, out)
    np.testing.assert_array_equal(out, commands[-1])


def test_a_reader_never_takes_half_of_a_command() -> None:
    ring, out, wrong = CommandRing(), np.empty(7), []
    done = threading.Event()

    def write() -> None:
        for number in range(20000):
            ring.put(number, np.full(7, float(number)))
        done.set()

    writer = threading.Thread(target=write)
    writer.start()
    while not done.is_set():
        if ring.at(1 << 62, out) and np.ptp(out) != 0.0:
            wrong.append(out.copy())
    writer.join()
    assert not wrong


def test_nothing_is_followed_until_the_command_changes(rng: np.random.Generator) -> None:
    it, out = follower(), np.empty(7)
    at = rng.uniform(-1, 1, 7)
    assert it.next(0, at, out) == Verdict.NONE_YET
    for tick in range(20):
        it.put(tick * 2 * MS, at)
        assert it.next(tick * 2 * MS, at, out) == Verdict.NONE_YET
    it.put(40 * MS, at + 1e-6)
    assert it.next(40 * MS, at, out) == Verdict.FOLLOWED


@pytest.mark.parametrize("far", [0.021, 0.5, math.nan, math.inf])
def test_a_first_command_far_from_where_the_arm_stands_is_refused(far: float) -> None:
    it, out = follower(), np.empty(7)
    at = np.zeros(7)
    it.put(0, at)
    it.next(0, at, out)
    wanted = at.copy()
    wanted[4] = far
    it.put(2 * MS, wanted)
    assert it.next(2 * MS, at, out) == Verdict.FAR
    assert not it.following


def test_no_step_is_longer_than_it_may_be_and_the_way_is_caught_up(
    rng: np.random.Generator,
) -> None:
    at = rng.uniform(-1, 1, 7)
    it, out = led(at)
    before = out.copy()
    it.put(4 * MS, at + 0.05)
    for tick in range(2, 20):
        assert it.next(tick * 4 * MS, at, out) == Verdict.FOLLOWED
        assert np.all(np.abs(out - before) <= STEP + 1e-12)
        before = out.copy()
    np.testing.assert_allclose(out, at + 0.05, rtol=0, atol=1e-12)


def test_a_jump_ends_following_until_commands_come_near_again() -> None:
    at = np.zeros(7)
    it, out = led(at)
    it.put(4 * MS, at + 0.3)
    assert it.next(10 * MS, at, out) == Verdict.JUMPED
    assert it.next(14 * MS, at, out) == Verdict.NONE_YET
    it.put(16 * MS, at + 0.2)
    assert it.next(18 * MS, at, out) == Verdict.FAR
    it.put(20 * MS, at + 0.01)
    assert it.next(22 * MS, at, out) == Verdict.FOLLOWED
    np.testing.assert_allclose(out, at + STEP, rtol=0, atol=1e-12)


@pytest.mark.parametrize("wrong", [2.001, math.nan])
def test_a_command_outside_of_the_limits_is_not_followed_and_the_last_one_stands(
    wrong: float,
) -> None:
    at = np.full(7, 1.99)
    it, out = led(at)
    it.put(4 * MS, np.array([*at[:6], wrong]))
    assert it.next(8 * MS, at, out) == Verdict.OUTSIDE
    assert it.following
    it.put(12 * MS, at - 0.001)
    assert it.next(16 * MS, at, out) == Verdict.FOLLOWED
    np.testing.assert_allclose(out, at - 0.001, rtol=0, atol=1e-12)


def test_after_a_stop_the_same_command_is_not_followed_again() -> None:
    at = np.zeros(7)
    it, out = led(at)
    it.stop()
    for tick in range(2, 30):
        it.put(tick * 2 * MS, at)
        assert it.next(tick * 2 * MS, at, out) == Verdict.NONE_YET
    it.put(60 * MS, at + 0.001)
    assert it.next(60 * MS, at, out) == Verdict.FOLLOWED
