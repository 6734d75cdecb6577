"""Forces from shape and tensions, against equilibria found without any of the code under test."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad_vec

from robot.sensing.polynomial_curvature import (
    HILBERT,
    bend_at,
    tendon_jacobian,
)
from robot.sensing.virtual_work import (
    Balance,
    ForceNotObservable,
    SegmentModel,
    TendonLoad,
    balance,
    force_along,
    force_without_moment,
    tendon_forces_on_shape,
    wrench_with_prior,
)
from tests.robot.sensing.planar_equilibrium import (
    LENGTH,
    PITCH_RADIUS,
    STIFFNESS,
    Loads,
    at_rest,
    bending_tensions,
)

SEGMENT = SegmentModel(LENGTH, PITCH_RADIUS, STIFFNESS)


def random_force(rng: np.random.Generator, size: float) -> np.ndarray:
    direction = rng.normal(size=3)
    return np.asarray(size * direction / np.linalg.norm(direction))


def random_loads(rng: np.random.Generator, friction: float = 0.0) -> Loads:
    bend, delta = math.radians(rng.uniform(30, 75)), rng.uniform(-math.pi, math.pi)
    tensions = bending_tensions(bend, delta)
    sliding = np.where(tensions > 0.3, 1.0, -1.0) if friction else np.zeros(4)
    coulomb = 0.05 if friction else 0.0
    return Loads(tensions, random_force(rng, rng.uniform(0.03, 0.2)), sliding, friction, coulomb)


def load_of(loads: Loads) -> TendonLoad:
    return TendonLoad(loads.tensions, loads.sliding, loads.friction, loads.coulomb)


def by_tendons(shape: np.ndarray, load: TendonLoad) -> np.ndarray:
    out = np.empty(4)
    tendon_forces_on_shape(
        shape, PITCH_RADIUS, load.tensions, load.sliding, (load.friction, load.coulomb), out
    )
    return out


@pytest.mark.parametrize("friction", [0.0, 0.15])
def test_a_tip_force_is_found_with_its_sign(friction: float, rng: np.random.Generator) -> None:
    for _ in range(12):
        loads = random_loads(rng, friction)
        size = float(np.linalg.norm(loads.force))
        given = balance(at_rest(loads), SEGMENT, load_of(loads))
        free = force_without_moment(given)
        np.testing.assert_allclose(free.force, loads.force, rtol=0, atol=0.01 * size)
        assert not free.moment.any()
        along = force_along(given, -loads.force)
        np.testing.assert_allclose(along.force, loads.force, rtol=0, atol=0.002 * size)
        assert np.abs(along.unexplained).max() < 1e-6


def test_friction_that_is_not_modelled_looks_like_a_force(rng: np.random.Generator) -> None:
    loads = random_loads(rng, 0.15)
    given = balance(at_rest(loads), SEGMENT, TendonLoad(loads.tensions))
    found = force_along(given, loads.force).force
    assert np.linalg.norm(found - loads.force) > 0.1 * np.linalg.norm(loads.force)


def test_without_friction_it_is_the_jacobian_of_the_tendons(rng: np.random.Generator) -> None:
    columns = np.empty((4, 4))
    for _ in range(50):
        shape, tensions = rng.normal(size=4), rng.uniform(0.0, 5.0, 4)
        tendon_jacobian(shape, PITCH_RADIUS, columns)
        # Sliding shares say nothing where nothing rubs.
        load = TendonLoad(tensions, rng.uniform(-1.0, 1.0, 4))
        np.testing.assert_allclose(
            by_tendons(shape, load), -columns.T @ tensions, rtol=0, atol=1e-15
        )


def test_friction_is_integrated_also_through_inflections(rng: np.random.Generator) -> None:
    """Curvatures that change their sign never, once and twice, and one that touches zero."""
    mu, coulomb = 0.3, 0.05
    shapes = [rng.normal(size=4) * [1.0, 2.0, 2.0, 2.0] for _ in range(10)]
    shapes += [np.array([0.3, -2.0, 2.0, 0.4]), np.array([0.5, -2.0, 2.0, 0.4])]
    shapes += [np.array([0.5, -1.0, 0.0, 1.0]), np.array([0.0, 0.0, 0.0, 0.2])]
    for shape in shapes:
        tensions, sliding = rng.uniform(0.5, 4.0, 4), rng.uniform(-1.0, 1.0, 4)
        roots = np.roots(shape[2::-1])
        turns = sorted(float(s.real) for s in roots if s.imag == 0.0 and 0.0 < s.real < 1.0)

        def bent(s: float, m: np.ndarray = shape, turns: list[float] = turns) -> float:
            ends = [0.0, *(turn for turn in turns if turn < s), s]
            return float(np.abs(np.diff([bend_at(m, end) for end in ends])).sum())

        expected = np.zeros(4)
        for i, (tau, f) in enumerate(zip(tensions, sliding, strict=True)):
            angle = shape[3] + 0.5 * math.pi * i

            def tension(s: float, tau: float = tau, f: float = f) -> float:
                return float((tau - f * coulomb) * math.exp(-f * mu * bent(s)))

            powers = quad_vec(lambda s: tension(s) * s ** np.arange(3), 0, 1, points=turns)[0]
            expected[:3] += PITCH_RADIUS * math.cos(angle) * powers
            # kappa is what the three powers make of m.
            expected[3] -= PITCH_RADIUS * math.sin(angle) * (shape[:3] @ powers)
        load = TendonLoad(tensions, sliding, mu, coulomb)
        np.testing.assert_allclose(by_tendons(shape, load), expected, rtol=0, atol=1e-12)


def test_43_balances_and_echoes_its_prior_in_two_components(rng: np.random.Generator) -> None:
    for _ in range(20):
        loads, prior = random_loads(rng), rng.normal(size=6)
        given = balance(at_rest(loads), SEGMENT, load_of(loads))
        found = wrench_with_prior(given, prior)
        wrench = np.append(found.force, found.moment)
        np.testing.assert_allclose(
            given.jacobian.T @ wrench, given.missing, rtol=0, atol=1e-9 * np.abs(prior).max()
        )
        rows = given.jacobian.T
        printed = np.linalg.pinv(rows) @ given.missing
        printed += (np.eye(6) - np.linalg.pinv(rows) @ rows) @ prior
        np.testing.assert_allclose(wrench, printed, rtol=0, atol=1e-9 * np.abs(printed).max())
        hidden = np.linalg.svd(rows)[2][4:]
        np.testing.assert_allclose(hidden @ wrench, hidden @ prior, rtol=0, atol=1e-9)
        # With the truth as the prior, the truth comes out: eta of (44) is F0.
        truth = np.append(loads.force, np.zeros(3))
        found = wrench_with_prior(given, truth)
        np.testing.assert_allclose(found.force, loads.force, rtol=0, atol=2e-3)


def test_43_sees_two_components_of_the_wrench_out_of_the_plane_only_as_one() -> None:
    """In the bending plane nothing is hidden; out of it one equation stands for three unknowns."""
    delta = 0.4
    shape = np.array([0.25 * math.pi, 0.0, 0.0, delta])
    given = balance(shape, SEGMENT, TendonLoad(np.full(4, 0.3)))
    hidden = np.linalg.svd(given.jacobian.T)[2][4:]
    lean, normal = (
        np.array([math.cos(delta), -math.sin(delta), 0.0]),
        np.array([math.sin(delta), math.cos(delta), 0.0]),
    )
    for direction in (
        [*lean, 0, 0, 0],
        [0, 0, 1, 0, 0, 0],
        [0, 0, 0, *normal],
    ):
        np.testing.assert_allclose(hidden @ np.array(direction), 0.0, rtol=0, atol=1e-12)


def test_43_lets_force_and_moment_trade_against_each_other() -> None:
    """What noise of 0.1 mm and 0.25 deg leaves of m without a prior moves (43) by a newton."""
    loads = Loads(bending_tensions(math.radians(50), 0.4), np.array([-0.15, 0.05, -0.05]))
    given = balance(at_rest(loads), SEGMENT, load_of(loads))
    # The noise over the weakest gain of the pose, 0.0015, along its direction.
    weak = 2.0 * np.array([1 / 6, -1.0, 1.0])
    off = np.append(STIFFNESS / LENGTH * HILBERT @ weak, 0.0)
    wrong = Balance(given.jacobian, given.missing + off, LENGTH)
    by_axis = force_along(wrong, loads.force).force - loads.force
    literal = wrench_with_prior(wrong).force - wrench_with_prior(given).force
    assert np.linalg.norm(literal) > 1.0
    assert np.linalg.norm(by_axis) < 2e-3


def test_a_point_contact_is_seen_least_near_the_tip_s_axis() -> None:
    """Gains over the length at 45 deg: 0.52, 0.37 and 0.013."""
    shape = np.array([0.25 * math.pi, 0.0, 0.0, 0.4])
    given = balance(shape, SEGMENT, TendonLoad(np.full(4, 0.3)))
    found = force_without_moment(given)
    np.testing.assert_allclose(found.gains / LENGTH, [0.525, 0.373, 0.01295], rtol=2e-3)
    weakest = np.linalg.svd(given.jacobian[:3].T)[2][2]
    plane = np.array([math.sin(0.4), math.cos(0.4), 0.0])
    assert abs(weakest @ plane) < 1e-9
    tip_axis = np.array([math.sin(shape[0]) * math.cos(0.4), -math.sin(shape[0]) * math.sin(0.4),
                         math.cos(shape[0])])  # fmt: skip
    assert abs(weakest @ tip_axis) > 0.9


def test_a_force_along_a_straight_segment_is_refused_by_name() -> None:
    given = balance(np.zeros(4), SEGMENT, TendonLoad(np.full(4, 0.3)))
    with pytest.raises(ForceNotObservable, match="hardly changes this shape") as refusal:
        force_along(given, np.array([0.0, 0.0, 1.0]))
    assert refusal.value.code == "force_not_observable"
    assert refusal.value.lever_m == 0.0
    np.testing.assert_array_equal(refusal.value.axis, [0.0, 0.0, 1.0])
    # Without an axis, what cannot be seen is taken as zero.
    assert np.isfinite(force_without_moment(given).force).all()
    assert np.isfinite(wrench_with_prior(given).force).all()


def test_what_each_misprint_makes_of_a_force(rng: np.random.Generator) -> None:
    """0.150 N hold a segment back at 45 deg: the print finds -1.5, 0.8 and 0.3 N."""
    delta = rng.uniform(-math.pi, math.pi)
    lean = np.array([math.cos(delta), -math.sin(delta), 0.0])
    back = math.radians(210.0)
    axis = math.cos(back) * lean + math.sin(back) * np.array([0.0, 0.0, 1.0])
    tensions = bending_tensions(3.3293463 * PITCH_RADIUS * LENGTH / STIFFNESS, delta)
    shape = at_rest(Loads(tensions, 0.150 * axis))
    assert math.degrees(bend_at(shape, 1.0)) == pytest.approx(45.0, abs=0.1)
    load = TendonLoad(tensions)
    given, pulling = balance(shape, SEGMENT, load), by_tendons(shape, load)
    elastic = given.missing + pulling
    table = np.array([[1, 1 / 4, 1 / 3], [1 / 4, 1 / 3, 1 / 8], [1 / 3, 1 / 8, 1 / 5]])
    printed_42 = np.append(STIFFNESS / LENGTH * table @ shape[:3], 0.0)

    def found(missing: np.ndarray) -> float:
        return float(force_along(given._replace(missing=missing), axis).force @ axis)

    assert found(given.missing) == pytest.approx(0.150, rel=2e-3)
    assert found(elastic + pulling) == pytest.approx(-1.50, abs=0.03)
    assert found(LENGTH**2 * elastic - pulling) == pytest.approx(0.82, abs=0.02)
    assert found(printed_42 - pulling) == pytest.approx(0.31, abs=0.02)
