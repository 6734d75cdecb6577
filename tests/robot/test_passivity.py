"""The guard at the stylus' port: a real mass and hand, a late wall, and the energy between them."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from robot.passivity import (
    APPARENT_KG,
    HAND_M_S2,
    READY_J,
    RISK_J,
    ZERO,
    PassivityGuard,
    Vector,
)

SUBSTEPS = 10
LIMIT_N = 0.88
WALL_DELAY_S = 0.02
ENCODER_M = 5.5e-5
RATES = (500, 1000)

Place = Callable[[float], float]
"""Where the hand wants to be, m, at a time, s; the wall is at 0."""


@dataclass(frozen=True)
class Held:
    """Stiffness N/m, damping N s/m and mass kg of stylus and hand together, and the first speed."""

    stiffness: float
    damping: float
    mass: float
    speed: float = 0.0


FIRM = Held(400.0, 3.0, APPARENT_KG + 0.1)
SOFT = Held(150.0, 3.0, APPARENT_KG + 0.05)
NEARLY_FREE = Held(5.0, 0.05, APPARENT_KG, 0.1)


@dataclass
class Felt:
    """What a hand went through.

    Attributes:
        returned: largest energy that came back beyond what had been put in, J, on true motion.
        place, force: (n,) at the samples, m and N.
    """

    returned: float
    place: np.ndarray
    force: np.ndarray


def feel(
    held: Held,
    goal: Place,
    wall: float,
    rate: int,
    *,
    guard: PassivityGuard | None,
    seconds: float = 3.0,
    link_s: float = 0.0,
    encoder: float = 0.0,
) -> Felt:
    """A wall at 0 that knows old places only; forces act up to ``link_s`` after their pose."""
    dt = 1.0 / rate
    step, delay = dt / SUBSTEPS, np.random.default_rng(1)
    place, speed, stored, worst, force = goal(0.0), held.speed, 0.0, 0.0, 0.0
    late = deque([place] * (round(WALL_DELAY_S * rate) + 1), maxlen=round(WALL_DELAY_S * rate) + 1)
    coming: deque[tuple[float, float]] = deque()
    places, forces = [], []
    for n in range(round(seconds * rate)):
        told = round(place / encoder) * encoder if encoder else place
        late.append(told)
        wanted = -wall * max(0.0, late[0])
        if guard is None:
            sent = max(wanted, -LIMIT_N)
        else:
            sent = guard.step((told, 0.0, 0.0), (wanted, 0.0, 0.0), dt)[0]
        coming.append((n * dt + link_s * delay.uniform(), sent))
        for k in range(SUBSTEPS):
            time = n * dt + k * step
            while coming and coming[0][0] <= time + 1e-12:
                force = coming.popleft()[1]
            pull = held.stiffness * (goal(time) - place) - held.damping * speed
            speed += step * (pull + force) / held.mass
            stored -= force * speed * step
            place += speed * step
            worst = min(worst, stored)
        places.append(place)
        forces.append(sent)
    return Felt(-worst, np.array(places), np.array(forces))


def pressing(speed: float, to: float, tremor: float = 0.0) -> Place:
    """From 8 mm before the wall to 0.5 mm before it at 20 mm/s, then slowly on."""

    def goal(time: float) -> float:
        near = -0.008 + min(0.0075, 0.02 * time)
        deep = min(max(0.0, speed * (time - 0.375)), to + 0.0005)
        return near + deep + tremor * math.sin(2.0 * math.pi * 9.0 * time)

    return goal


def bumping(time: float) -> float:
    """At 24 mm/s to 2 mm behind the wall, and stay."""
    return min(-0.01 + 0.024 * time, 0.002)


@pytest.mark.parametrize("held", [FIRM, SOFT, NEARLY_FREE])
@pytest.mark.parametrize("rate", RATES)
def test_a_late_wall_shakes_the_hand_without_a_guard(held: Held, rate: int) -> None:
    felt = feel(held, bumping, 300.0, rate, guard=None)
    assert np.ptp(felt.place[-rate // 2 :]) > 0.003
    assert felt.returned > 0.01


@pytest.mark.parametrize("held", [FIRM, SOFT, NEARLY_FREE])
@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("wall", [300.0, 600.0])
def test_with_it_nothing_grows_and_no_more_comes_back_than_was_put_in(
    held: Held, rate: int, wall: float
) -> None:
    felt = feel(held, bumping, wall, rate, guard=PassivityGuard(LIMIT_N), seconds=4.0)
    assert felt.returned <= RISK_J * (1.0 + 1e-6)
    assert np.abs(felt.force).max() <= LIMIT_N + 1e-12
    assert np.abs(felt.force).max() > 0.15, "it is felt"
    swings = [np.ptp(part) for part in np.split(felt.place, 4)]
    if held is NEARLY_FREE:
        assert all(np.diff(swings) < 0.0)
        assert swings[-1] < 0.1 * swings[0]
    else:
        assert swings[-1] < 2e-5


@pytest.mark.parametrize("rate", RATES)
@pytest.mark.parametrize("wall", [100.0, 300.0, 600.0])
def test_a_wall_that_is_pressed_slowly_is_felt_in_full(rate: int, wall: float) -> None:
    deep = 0.6 * (1.0 / wall + 1.0 / FIRM.stiffness)
    goal = pressing(0.003, deep)
    felt = feel(FIRM, goal, wall, rate, guard=PassivityGuard(LIMIT_N), seconds=0.6 + deep / 0.003)
    touched = felt.place > 0.3 * felt.place.max()
    slope = np.polyfit(felt.place[touched], -felt.force[touched], 1)[0]
    assert slope == pytest.approx(wall, rel=0.1)
    assert -felt.force[-1] / felt.place[-1] == pytest.approx(wall, rel=0.1)


@pytest.mark.parametrize("rate", RATES)
def test_it_is_felt_through_a_link_and_the_steps_of_an_encoder(rate: int) -> None:
    guard = PassivityGuard(LIMIT_N, delay_s=0.004, resolution=ENCODER_M)
    goal = pressing(0.003, 0.0035, tremor=3e-5)
    felt = feel(FIRM, goal, 300.0, rate, guard=guard, seconds=3.0, link_s=0.004, encoder=ENCODER_M)
    assert felt.returned <= RISK_J * (1.0 + 1e-6)
    rendered = -felt.force[-rate // 2 :].mean() / felt.place[-rate // 2 :].mean()
    assert rendered == pytest.approx(300.0, rel=0.1)
    # A step of the encoder is one of 17 mN in such a wall.
    assert np.abs(np.diff(felt.force)).max() < 0.08


def restless(rng: np.random.Generator, rate: int, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Speed and acceleration (n, 3) at samples of a hand that moves as wildly as it may."""
    speeds, accelerations = np.zeros((0, 3)), np.zeros((0, 3))
    speed = 0.05 * rng.normal(size=3)
    while len(speeds) < seconds * rate:
        acceleration = rng.normal(size=3)
        if rng.uniform() < 0.5 or np.linalg.norm(speed) > 0.2:
            acceleration = -speed
        acceleration *= HAND_M_S2 * rng.uniform() / np.linalg.norm(acceleration)
        for _ in range(rng.integers(1, 60)):
            speeds = np.vstack([speeds, speed])
            accelerations = np.vstack([accelerations, acceleration])
            speed = speed + acceleration / rate
    return speeds, accelerations


@pytest.mark.parametrize("delay_s", [0.0, 0.0015, 0.004])
@pytest.mark.parametrize("rate", RATES)
def test_no_more_energy_comes_back_than_was_put_in_however_the_hand_moves(
    delay_s: float, rate: int, rng: np.random.Generator
) -> None:
    """Forces that push the hand where it goes, or anywhere, late by less than the guard knows."""
    dt = 1.0 / rate
    given = taken = 0.0
    for trial in range(4):
        speeds, accelerations = restless(rng, rate, 1.0)
        guard, place = PassivityGuard(LIMIT_N, delay_s=delay_s), np.zeros(3)
        stored, acting, coming = 0.0, np.zeros(3), deque[tuple[float, np.ndarray]]()
        anywhere = rng.normal(size=3)
        for n, (speed, acceleration) in enumerate(zip(speeds, accelerations, strict=True)):
            along = speed / (np.linalg.norm(speed) + 1e-12)
            if n % 50 == 0:
                anywhere = rng.normal(size=3)
            against = -1.0 if trial % 2 == 0 and (n // 50) % 2 == 0 else 1.0
            wanted = anywhere if trial > 1 else against * along
            x, y, z = place.tolist()
            fx, fy, fz = wanted.tolist()
            force = np.array(guard.step((x, y, z), (fx, fy, fz), dt))
            assert np.linalg.norm(force) <= LIMIT_N + 1e-12
            coming.append((n * dt + delay_s * rng.uniform(), force))
            for k in range(SUBSTEPS):
                while coming and coming[0][0] <= n * dt + k * dt / SUBSTEPS + 1e-12:
                    acting = coming.popleft()[1]
                middle = speed + acceleration * dt * (k + 0.5) / SUBSTEPS
                moved = middle * dt / SUBSTEPS
                place = place + moved
                stored -= acting @ moved
                given, taken = given + max(0.0, acting @ moved), taken + max(0.0, -acting @ moved)
                assert stored >= -RISK_J * (1.0 + 1e-6)
    assert given > 1e-4, "it is no guard that lets nothing through"
    assert taken > 1e-4


def test_what_friction_took_does_not_come_back_as_a_push() -> None:
    guard = PassivityGuard(LIMIT_N)
    for n in range(500):
        guard.step((2e-4 * n, 0.0, 0.0), (-0.5, 0.0, 0.0), 0.002)
    assert guard.energy == pytest.approx(READY_J + 0.5 * 0.01, rel=0.01)
    guard.step((0.1, 0.0, 0.0), ZERO, 0.002)
    assert guard.energy <= READY_J


def test_where_nothing_is_touched_a_full_account_is_left_alone() -> None:
    guard, force = PassivityGuard(LIMIT_N), ZERO
    drags = []
    for n in range(1000):
        force = guard.step((2e-5 * n, 0.0, 0.0), ZERO, 0.002)
        drags.append(math.hypot(*force))
    assert max(drags) < 0.0051
    assert force == pytest.approx(ZERO, abs=1e-4)
    assert guard.energy == pytest.approx(READY_J, rel=0.05)


def test_what_is_no_place_or_another_place_begins_anew() -> None:
    guard = PassivityGuard(LIMIT_N)
    bad: tuple[Vector, ...] = ((math.nan, 0.0, 0.0), (math.inf, 0.0, 0.0), (1.0, 0.0, 0.0))
    for place in bad:
        for n in range(100):
            guard.step((1e-4 * n, 0.0, 0.0), (-0.5, 0.0, 0.0), 0.002)
        assert guard.energy > 1e-4
        assert guard.step(place, (-0.5, 0.0, 0.0), 0.002) == ZERO
        assert guard.energy == 0.0
    assert guard.step((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0), 0.002) == ZERO
    assert guard.step((0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.0) == ZERO
