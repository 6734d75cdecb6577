"""What the actuators do to the degrees of freedom: by virtual work, and how many are redundant."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.tendons import tendon_lengths
from robot.tension.structures import (
    Structure,
    StructureRefused,
    four_rods,
    four_tendons,
    three_tendons,
    three_tendons_and_rod,
)

RADIUS = 1.8e-3


def test_four_tendons_are_those_of_the_console() -> None:
    lengths = np.empty((2, 4))
    tendon_lengths(1.0, 0.0, RADIUS, lengths[0])
    tendon_lengths(0.0, 1.0, RADIUS, lengths[1])
    structure = four_tendons(RADIUS)
    np.testing.assert_allclose(structure.matrix, -lengths, atol=1e-18)
    stated = RADIUS * np.array([[1, 0, -1, 0], [0, -1, 0, 1]])
    np.testing.assert_array_equal(structure.matrix, stated)


def test_three_tendons_change_their_lengths_as_their_azimuths_say(
    rng: np.random.Generator,
) -> None:
    theta, delta = rng.uniform(0.1, 1.5), rng.uniform(-math.pi, math.pi)
    bend = theta * np.array([math.cos(delta), math.sin(delta)])
    for index, change in enumerate(-three_tendons(RADIUS).matrix.T @ bend):
        azimuth = index * 2.0 * math.pi / 3.0
        assert change == pytest.approx(-RADIUS * theta * math.cos(delta + azimuth), abs=1e-15)


@pytest.mark.parametrize(
    ("structure", "freedoms", "actuators", "redundancy"),
    [
        (four_tendons(RADIUS), 2, 4, 2),
        (three_tendons(RADIUS), 2, 3, 1),
        (three_tendons_and_rod(RADIUS, 1.5e-3), 3, 4, 1),
        (four_rods(RADIUS), 4, 4, 0),
    ],
    ids=lambda value: value.name if isinstance(value, Structure) else str(value),
)
def test_redundancy(structure: Structure, freedoms: int, actuators: int, redundancy: int) -> None:
    assert structure.matrix.shape == (freedoms, actuators)
    assert (structure.rank, structure.redundancy) == (freedoms, redundancy)
    null = structure.null_space()
    assert null.shape == (actuators, redundancy)
    np.testing.assert_allclose(structure.matrix @ null, 0.0, atol=1e-17)
    np.testing.assert_allclose(null.T @ null, np.eye(redundancy), atol=1e-14)


def test_what_three_tendons_share_is_equal_and_the_rod_has_no_part_in_it() -> None:
    null = three_tendons_and_rod(RADIUS, 1.5e-3).null_space()[:, 0]
    np.testing.assert_allclose(np.abs(null), np.array([1, 1, 1, 0]) / math.sqrt(3.0), atol=1e-14)


def test_distal_rods_load_both_segments() -> None:
    matrix = four_rods(RADIUS).matrix
    np.testing.assert_array_equal(matrix[:2, 2:], matrix[2:, 2:])
    assert not matrix[2:, :2].any()


def test_dependent_rows_do_not_count() -> None:
    rows = np.array([[1.0, -1.0], [2.0, -2.0]])
    structure = Structure("pair", rows, np.array([True, True]), ("a", "b"), ("1", "2"))
    assert (structure.rank, structure.redundancy) == (1, 1)


def test_a_structure_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        four_tendons(RADIUS).matrix[0, 0] = 0.0


@pytest.mark.parametrize(
    ("matrix", "pull_only", "message"),
    [
        (np.array([[1.0, np.nan]]), np.array([True, True]), "finite"),
        (np.ones((2, 2)), np.array([True, True]), "names"),
        (np.ones((1, 2)), np.array([True]), "pull_only"),
    ],
)
def test_senseless_structures_are_refused(
    matrix: np.ndarray, pull_only: np.ndarray, message: str
) -> None:
    with pytest.raises(StructureRefused, match=message) as caught:
        Structure("wrong", matrix, pull_only, ("u",), ("1", "2"))
    assert (caught.value.structure, caught.value.code) == ("wrong", "structure_refused")
