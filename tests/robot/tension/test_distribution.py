"""Least tensions against general solvers, and the refusal where there are none."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog, lsq_linear, minimize

from robot.tension.distribution import (
    BoundsRefused,
    TensionInfeasible,
    least_tension,
    nearest_feasible,
)
from robot.tension.structures import (
    Structure,
    four_rods,
    four_tendons,
    three_tendons,
    three_tendons_and_rod,
)

RADIUS = 1.8e-3
STRUCTURES = (
    four_tendons(RADIUS),
    three_tendons(RADIUS),
    three_tendons_and_rod(RADIUS, 1.5e-3),
    four_rods(RADIUS),
)
every_structure = pytest.mark.parametrize("structure", STRUCTURES, ids=lambda s: s.name)


def _bounds(structure: Structure) -> tuple[np.ndarray, np.ndarray]:
    return np.where(structure.pull_only, 0.5, -20.0), np.full(len(structure.actuators), 20.0)


@every_structure
def test_the_force_is_exact_and_the_bounds_are_kept(
    structure: Structure, rng: np.random.Generator
) -> None:
    lower, upper = _bounds(structure)
    for _ in range(200):
        wanted = structure.matrix @ rng.uniform(lower, upper)
        tensions = least_tension(structure, wanted, lower, upper)
        np.testing.assert_allclose(structure.matrix @ tensions, wanted, atol=1e-12, rtol=0.0)
        assert (tensions >= lower).all()
        assert (tensions <= upper).all()


@every_structure
@pytest.mark.parametrize("common", [0.0, 6.0])
def test_no_feasible_tensions_are_nearer(
    structure: Structure, common: float, rng: np.random.Generator
) -> None:
    """KKT of a convex problem: the step toward any other feasible point does not descend."""
    lower, upper = _bounds(structure)
    for _ in range(20):
        other = rng.uniform(lower, upper)
        wanted = structure.matrix @ other
        tensions = least_tension(structure, wanted, lower, upper, common)
        assert (tensions - common) @ (other - tensions) >= -1e-7
        # ... nor toward the feasible point that descends most.
        best = linprog(
            tensions - common,
            A_eq=structure.matrix / RADIUS,
            b_eq=wanted / RADIUS,
            bounds=np.column_stack([lower, upper]),
        )
        assert (tensions - common) @ (best.x - tensions) >= -1e-5


@pytest.mark.parametrize("count", [3, 4, 6])
def test_as_slsqp_on_random_structures(count: int, rng: np.random.Generator) -> None:
    for _ in range(10):
        matrix = rng.normal(size=(2, count))
        names = tuple(map(str, range(count)))
        structure = Structure("random", matrix, np.ones(count, dtype=bool), ("a", "b"), names)
        lower, upper = rng.uniform(0.0, 1.0, count), rng.uniform(2.0, 5.0, count)
        wanted, common = matrix @ rng.uniform(lower, upper), rng.uniform(0.0, 4.0, count)
        found = minimize(
            lambda t, c=common: ((t - c) ** 2).sum(),
            0.5 * (lower + upper),
            jac=lambda t, c=common: 2.0 * (t - c),
            bounds=np.column_stack([lower, upper]),
            constraints={
                "type": "eq",
                "fun": lambda t, a=matrix, w=wanted: a @ t - w,
                "jac": lambda t, a=matrix: a,
            },
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 500},
        )
        tensions = least_tension(structure, wanted, lower, upper, common)
        np.testing.assert_allclose(tensions, found.x, atol=1e-5)


def test_without_active_bounds_it_is_the_pseudo_inverse(rng: np.random.Generator) -> None:
    structure = four_tendons(RADIUS)
    free = Structure("rods", structure.matrix, np.zeros(4, dtype=bool), ("u", "v"), tuple("1234"))
    wanted = rng.normal(scale=0.01, size=2)
    no_bound = np.full(4, np.inf)
    tensions = least_tension(free, wanted, -no_bound, no_bound)
    np.testing.assert_allclose(tensions, np.linalg.pinv(free.matrix) @ wanted, atol=1e-12)


def test_of_an_opposed_pair_one_rests_on_its_lower_bound() -> None:
    wanted = np.array([0.009, -0.0018])
    tensions = least_tension(four_tendons(RADIUS), wanted, np.full(4, 0.3), np.full(4, 70.0))
    np.testing.assert_allclose(tensions, [5.3, 1.3, 0.3, 0.3], atol=1e-12)


def test_what_pulls_only_never_pushes() -> None:
    tensions = least_tension(
        four_tendons(RADIUS), np.array([0.009, 0.0]), np.full(4, -9.0), np.full(4, 70.0)
    )
    np.testing.assert_allclose(tensions, [5.0, 0.0, 0.0, 0.0], atol=1e-12)


@every_structure
def test_too_much_is_refused_with_the_nearest(
    structure: Structure, rng: np.random.Generator
) -> None:
    lower, upper = _bounds(structure)
    for _ in range(20):
        wanted = rng.normal(size=len(structure.freedoms))
        with pytest.raises(TensionInfeasible) as caught:
            least_tension(structure, wanted, lower, upper)
        error = caught.value
        best = lsq_linear(structure.matrix * 1e3, wanted * 1e3, (lower, upper), tol=1e-13)
        np.testing.assert_allclose(error.nearest, structure.matrix @ best.x, atol=1e-7)
        np.testing.assert_array_equal(error.wanted, wanted)
        np.testing.assert_allclose(structure.matrix @ error.tensions, error.nearest, atol=1e-15)
        assert error.code == "tension_infeasible"
        assert any(limit.split(" at its ")[0] in structure.actuators for limit in error.limits)
        # The nearest one can be asked for.
        again = least_tension(structure, error.nearest, lower, upper)
        np.testing.assert_allclose(structure.matrix @ again, error.nearest, atol=1e-9)


def test_the_message_says_what_limits() -> None:
    with pytest.raises(TensionInfeasible) as caught:
        least_tension(four_tendons(RADIUS), np.array([1.0, 0.0]), np.full(4, 0.5), np.full(4, 20.0))
    assert caught.value.limits == (
        "tendon 1 at its upper bound 20 N",
        "tendon 3 at its lower bound 0.5 N",
    )
    assert "u 1 (nearest 0.0351)" in str(caught.value)
    assert "ask for less" in str(caught.value)


def test_a_feasible_force_is_its_own_nearest(rng: np.random.Generator) -> None:
    structure = four_tendons(RADIUS)
    lower, upper = _bounds(structure)
    wanted = structure.matrix @ rng.uniform(lower, upper)
    nearest, tensions, limits = nearest_feasible(structure, wanted, lower, upper)
    np.testing.assert_allclose(nearest, wanted, atol=1e-12)
    np.testing.assert_allclose(tensions, least_tension(structure, wanted, lower, upper), atol=1e-6)
    assert not limits


def test_what_no_actuator_can_do_is_infeasible() -> None:
    rows = np.array([[1.0, -1.0], [0.0, 0.0]])
    pair = Structure("pair", rows, np.array([True, True]), ("a", "b"), ("1", "2"))
    with pytest.raises(TensionInfeasible, match="do not act that way") as caught:
        least_tension(pair, np.array([1.0, 1.0]), np.zeros(2), np.full(2, 9.0))
    np.testing.assert_allclose(caught.value.nearest, [1.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        least_tension(pair, np.array([1.0, 0.0]), np.zeros(2), np.full(2, 9.0)), [1.0, 0.0]
    )


def test_actuators_that_are_fixed_are_worked_around() -> None:
    lower, upper = np.array([2.0, 0.0, 0.0, 3.0]), np.array([2.0, 9.0, 9.0, 3.0])
    wanted = RADIUS * np.array([-3.0, 1.0])
    tensions = least_tension(four_tendons(RADIUS), wanted, lower, upper)
    np.testing.assert_allclose(tensions, [2.0, 2.0, 5.0, 3.0], atol=1e-12)


@pytest.mark.parametrize(
    ("lower", "upper", "wanted", "what"),
    [
        (np.zeros(3), np.ones(4), np.zeros(2), "lower"),
        (np.zeros(4), np.array([1.0, np.nan, 1.0, 1.0]), np.zeros(2), "upper"),
        (np.full(4, 2.0), np.ones(4), np.zeros(2), "lower"),
        (np.zeros(4), np.ones(4), np.array([np.nan, 0.0]), "wanted"),
        (np.zeros(4), np.ones(4), np.zeros(3), "wanted"),
    ],
)
def test_senseless_arguments_are_refused(
    lower: np.ndarray, upper: np.ndarray, wanted: np.ndarray, what: str
) -> None:
    with pytest.raises(BoundsRefused) as caught:
        least_tension(four_tendons(RADIUS), wanted, lower, upper)
    assert (caught.value.what, caught.value.code) == (what, "tension_bounds")
