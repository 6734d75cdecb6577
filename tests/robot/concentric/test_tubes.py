"""The tubes' values in SI, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.concentric.design import Concentric, TubeDesign
from robot.concentric.tubes import (
    InvalidTubeConfiguration,
    MeaninglessTubes,
    TubeOutOfBounds,
    check_configuration,
    tube_array,
)
from robot.configuration import Configuration
from tests.robot.concentric.arm_solution import DESIGNS, FOUR_TUBES, configuration

THREE = FOUR_TUBES[:3]


@pytest.fixture(scope="module")
def concentric(configuration: Configuration) -> Concentric:
    return configuration.concentric


def test_stiffness_and_lengths_of_table_1(concentric: Concentric) -> None:
    tubes = tube_array(concentric.tubes)
    newton_square_mm = tubes["bending_stiffness"] * 1e6
    np.testing.assert_allclose(newton_square_mm, [7226.6, 10278.3, 16881.7], rtol=0, atol=0.05)
    np.testing.assert_allclose(tubes["bending_stiffness"] / tubes["torsional_stiffness"], 1.6)
    np.testing.assert_allclose(tubes["length"], [0.437, 0.317, 0.199])
    np.testing.assert_allclose(tubes["straight_length"], [0.387, 0.267, 0.149])
    np.testing.assert_array_equal(tubes["curvature"], [10.0, 5.0, 7.0])


def test_tubes_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        tube_array(DESIGNS)["length"][0] = 1.0


def test_the_starts_are_inside_the_bounds(concentric: Concentric) -> None:
    for start in concentric.starts:
        for translations, rotations in (
            (start.translations_a_mm, start.rotations_a_deg),
            (start.translations_b_mm, start.rotations_b_deg),
        ):
            check_configuration(configuration(translations, rotations), THREE)


@pytest.mark.parametrize(
    ("translations", "number", "bound", "message"),
    [
        ([-437.2, -80, -50], 1, -437.0, "tube 1 at -437.200 mm is below -437.000 mm"),
        ([0.2, 0, 0], 1, 0.0, "tube 1 at 0.200 mm is above 0.000 mm"),
        ([-50, -80, -20], 2, -50.0, "rear end meets that of tube 1"),
        ([-200, -79.9, -20], 2, -80.0, "tip meets that of tube 1"),
        ([-200, -150, -155], 3, -150.0, "tube 3 at -155.000 mm is below -150.000 mm"),
        ([-200, -150, -31], 3, -32.0, "tip meets that of tube 2"),
        ([-437, -317.5, -199], 2, -317.0, "its tip is at the channel's exit"),
    ],
)
def test_a_tube_outside_is_named(
    translations: list[float], number: int, bound: float, message: str
) -> None:
    with pytest.raises(TubeOutOfBounds, match=message) as refusal:
        check_configuration(configuration(translations, [0, 0, 0]), THREE)
    assert refusal.value.number == number
    assert refusal.value.bound_mm == pytest.approx(bound)
    assert refusal.value.translation_mm == pytest.approx(translations[number - 1])
    assert f"move it back to {bound:.3f} mm" in str(refusal.value)


def test_configurations_of_another_size_or_without_numbers() -> None:
    with pytest.raises(InvalidTubeConfiguration, match=r"shape is \(4,\).*give 3 translations"):
        check_configuration(np.zeros(4), THREE)
    q = configuration([-100, -80, -50], [0, 0, 0])
    q[4] = math.nan
    with pytest.raises(InvalidTubeConfiguration, match="value 5 is not finite") as refusal:
        check_configuration(q, THREE)
    assert refusal.value.tube_count == 3


def test_meaningless_tubes() -> None:
    with pytest.raises(MeaninglessTubes, match="the tubes: there are 0, the model takes 1 to 6"):
        tube_array([])
    with pytest.raises(MeaninglessTubes, match="there are 7"):
        tube_array(DESIGNS[:1] * 7)
    with pytest.raises(MeaninglessTubes, match=r"tube 1: 437 mm long, no longer than tube 2") as it:
        tube_array([DESIGNS[0], DESIGNS[0]])
    assert it.value.number == 1
    solid = TubeDesign.model_construct(
        **{**DESIGNS[0].model_dump(), "inner_diameter_mm": DESIGNS[0].outer_diameter_mm}
    )
    with pytest.raises(MeaninglessTubes, match="tube 1: it needs a wall"):
        tube_array([solid])


@pytest.mark.parametrize("translations", [[-437, -317, -199], [0, 0, 0], [-200, -80, -80]])
def test_the_bounds_themselves_are_inside(translations: list[float]) -> None:
    check_configuration(configuration(translations, [0, 0, 0]), THREE)
