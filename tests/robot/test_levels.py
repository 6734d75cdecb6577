"""Levels as selections of rows, and the turn that makes the solver minimise what it should."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from robot.errors import UnknownName
from robot.priority.levels import (
    CASE_NAMES,
    PRESETS,
    ROW_SETS,
    Level,
    assemble,
    case_named,
    equalize,
    plan,
)
from robot.records import Case


@pytest.mark.parametrize("count", range(1, 10))
@pytest.mark.parametrize("spread", [0.0, 1.0, 4.0])
def test_equalize_turns_rows_to_equal_norms_and_keeps_every_residual(
    rng: np.random.Generator, count: int, spread: float
) -> None:
    for _ in range(30):
        scales = 10.0 ** rng.uniform(-spread, spread, size=(count, 1))
        before, wanted = rng.normal(size=(count, 10)) * scales, rng.normal(size=count)
        after, turned = before.copy(), wanted.copy()
        equalize(after, turned)
        size = float(np.linalg.norm(before))
        norms = np.linalg.norm(after, axis=1)
        np.testing.assert_allclose(norms, size / np.sqrt(count), rtol=1e-6)
        # The turn is orthogonal: all products of rows and targets are kept.
        tolerance = 1e-13 * size
        np.testing.assert_allclose(
            after.T @ after, before.T @ before, rtol=0, atol=tolerance * size
        )
        np.testing.assert_allclose(after.T @ turned, before.T @ wanted, rtol=0, atol=4 * tolerance)
        rates = rng.normal(size=10)
        assert np.linalg.norm(turned - after @ rates) == pytest.approx(
            np.linalg.norm(wanted - before @ rates), rel=1e-12
        )


@pytest.mark.parametrize("zero_rows", [1, 2, 3])
def test_equalize_survives_rows_of_zeros(rng: np.random.Generator, zero_rows: int) -> None:
    before, wanted = rng.normal(size=(3, 10)), rng.normal(size=3)
    before[:zero_rows] = 0.0
    after, turned = before.copy(), wanted.copy()
    equalize(after, turned)
    assert np.all(np.isfinite(after))
    np.testing.assert_allclose(after.T @ after, before.T @ before, rtol=0, atol=1e-13)
    np.testing.assert_allclose(after.T @ turned, before.T @ wanted, rtol=0, atol=1e-13)
    norms = np.linalg.norm(after, axis=1)
    np.testing.assert_allclose(norms, np.linalg.norm(before) / np.sqrt(3), atol=1e-7)


def test_equalize_leaves_equal_rows_alone(rng: np.random.Generator) -> None:
    matrix = np.linalg.qr(rng.normal(size=(10, 10)))[0][:3]
    wanted = rng.normal(size=3)
    after, turned = matrix.copy(), wanted.copy()
    equalize(after, turned)
    np.testing.assert_allclose(after, matrix, rtol=0, atol=1e-12)
    np.testing.assert_allclose(turned, wanted, rtol=0, atol=1e-12)


def test_the_presets_are_the_cases_below_the_rcm() -> None:
    rcm, linear, angular, pointing = [0, 1, 2], [3, 4, 5], [6, 7, 8], [6, 7]
    expected = {
        Case.BALANCED: [rcm, linear + angular],
        Case.LINEAR_FIRST: [rcm, linear, angular],
        Case.ANGULAR_FIRST: [rcm, angular, linear],
        Case.POINTING: [rcm, linear, pointing],
    }
    assert set(PRESETS) == set(Case)
    for case, levels in expected.items():
        resolved = plan(PRESETS[case], 0.1)
        found = [resolved.rows[span.start : span.stop].tolist() for span in resolved.spans()]
        assert found == levels


def test_only_a_level_that_mixes_units_is_weighed() -> None:
    for case in Case:
        resolved = plan(PRESETS[case], 0.25)
        expected = [
            0.25 if case == Case.BALANCED and 6 <= row <= 8 else 1.0 for row in resolved.rows
        ]
        assert resolved.weights.tolist() == expected


def test_single_directions_can_be_levels_of_their_own() -> None:
    resolved = plan((("rcm",), ("z",), ("pointing",), ("x", "y"), ("roll", "lambda")), 0.1)
    assert resolved.rows.tolist() == [0, 1, 2, 5, 6, 7, 3, 4, 8, 9]
    assert resolved.starts.tolist() == [0, 3, 4, 6, 8, 10]


@pytest.mark.parametrize("name", ["", "RCM", "linear ", "w", "angular,linear"])
def test_an_unknown_row_set_is_refused_with_the_known_ones(name: str) -> None:
    with pytest.raises(UnknownName) as caught:
        plan((("rcm",), (name,)), 0.1)
    assert caught.value.name == name
    assert set(caught.value.known) == set(ROW_SETS)


@pytest.mark.parametrize(
    "levels",
    [
        (("rcm",), ("rcm",)),
        (("linear", "x"),),
        (("linear",), ("y",)),
        (("angular",), ("roll",)),
        (("x", "x"),),
    ],
)
def test_a_row_that_is_selected_twice_is_refused(levels: tuple[Level, ...]) -> None:
    with pytest.raises(UnknownName):
        plan(levels, 0.1)


def test_cases_are_found_by_the_names_people_use() -> None:
    assert {name: case_named(name) for name in CASE_NAMES} == CASE_NAMES
    assert set(CASE_NAMES) == {"0", "1", "2", "pointing"}
    with pytest.raises(UnknownName) as caught:
        case_named("3")
    assert caught.value.known == ("0", "1", "2", "pointing")


def test_assemble_is_selecting_weighing_and_equalizing(rng: np.random.Generator) -> None:
    rows, targets = rng.normal(size=(10, 10)), rng.normal(size=10)
    for case, length in itertools.product(Case, (0.03, 1.0)):
        resolved = plan(PRESETS[case], length)
        matrix, target = np.empty((len(resolved.rows), 10)), np.empty(len(resolved.rows))
        assemble(rows, targets, resolved.rows, resolved.weights, resolved.starts, matrix, target)
        for span in resolved.spans():
            chosen = resolved.rows[span.start : span.stop]
            weights = resolved.weights[span.start : span.stop]
            plain, wanted = weights[:, None] * rows[chosen], weights * targets[chosen]
            part, right = matrix[span.start : span.stop], target[span.start : span.stop]
            np.testing.assert_allclose(part.T @ part, plain.T @ plain, rtol=0, atol=1e-11)
            np.testing.assert_allclose(part.T @ right, plain.T @ wanted, rtol=0, atol=1e-11)
            norms = np.linalg.norm(part, axis=1)
            np.testing.assert_allclose(norms, norms[0], rtol=1e-6)
