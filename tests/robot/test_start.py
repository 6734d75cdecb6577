"""The posture in which the robot wakes up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.arm import Arm
from robot.configuration import Configuration, Start, Trocar
from robot.errors import UnreachableStart
from robot.parameters import parameters as compiled_parameters
from robot.priority.limits import violations
from robot.start import posture_cost, start_configuration, start_tip_rotation
from robot.urdf import urdf_text
from tests import own_kinematics


def found(configuration: Configuration) -> np.ndarray:
    arm = Arm(urdf_text(configuration))
    return start_configuration(configuration, arm, compiled_parameters(configuration))


def changed(
    configuration: Configuration,
    start: dict[str, object] | None = None,
    trocar: dict[str, object] | None = None,
) -> Configuration:
    return configuration.model_copy(
        update={
            "start": Start.model_validate({**configuration.start.model_dump(), **(start or {})}),
            "trocar": Trocar.model_validate(
                {**configuration.trocar.model_dump(), **(trocar or {})}
            ),
        }
    )


STARTS: tuple[dict[str, object], ...] = (
    {},
    {"bend_deg": 0.0},
    {"bend_deg": 35.0, "direction_deg": 130.0},
    {"lambda_along_shaft": 0.6},
    {"shaft_direction": (0.1, 0.2, -0.9), "bend_direction_up": (1.0, 0.0, 0.0)},
)


@pytest.mark.parametrize("start", STARTS)
def test_the_start_is_what_the_configuration_asks(
    configuration: Configuration, start: dict[str, object]
) -> None:
    asked = changed(configuration, start)
    x = found(asked)
    where = own_kinematics.pose_at(asked, x)
    shaft = where.shaft_end - where.shaft_base
    direction = np.array(asked.start.shaft_direction)
    trocar = np.array(asked.trocar.position_m)
    np.testing.assert_allclose(
        shaft / np.linalg.norm(shaft), direction / np.linalg.norm(direction), rtol=0, atol=1e-8
    )
    touched = where.shaft_base + asked.start.lambda_along_shaft * shaft
    np.testing.assert_allclose(touched, trocar, rtol=0, atol=1e-8)
    assert x[9] == asked.start.lambda_along_shaft
    assert math.degrees(math.hypot(x[7], x[8])) == pytest.approx(asked.start.bend_deg, abs=1e-9)
    if asked.start.bend_deg > 0.0:
        direction_deg = math.degrees(math.atan2(x[8], x[7]))
        assert direction_deg == pytest.approx(asked.start.direction_deg, abs=1e-9)
    assert violations(x, compiled_parameters(asked)) == 0
    np.testing.assert_allclose(start_tip_rotation(asked), where.rotation, rtol=0, atol=1e-7)


def test_the_segment_s_x_axis_is_as_near_to_up_as_the_shaft_allows(
    configuration: Configuration,
) -> None:
    """At delta = 0 the tip leans along x, so it leans upward as far as it can."""
    where = own_kinematics.pose_at(configuration, found(configuration))
    shaft = (where.shaft_end - where.shaft_base) / configuration.instrument.shaft_length_m
    up = np.array(configuration.start.bend_direction_up)
    lean = where.tip - where.shaft_end
    lean -= (lean @ shaft) * shaft
    up -= (up @ shaft) * shaft
    assert lean @ up == pytest.approx(np.linalg.norm(lean) * np.linalg.norm(up), rel=1e-6)


def test_the_same_configuration_wakes_up_the_same(configuration: Configuration) -> None:
    assert found(configuration).tobytes() == found(configuration).tobytes()


def test_the_posture_cannot_be_bettered_by_the_elbow_s_own_motion(
    configuration: Configuration,
) -> None:
    x, p = found(configuration), compiled_parameters(configuration)[0]
    arm = Arm(urdf_text(configuration))
    arm.update(np.ascontiguousarray(x[:7]))
    null = np.linalg.svd(arm.jacobian)[2][6]
    lower, upper = p["joint_lower"], p["joint_upper"]
    cost = posture_cost(x[:7], lower, upper)
    for step in (-0.05, 0.05):
        assert posture_cost(x[:7] + step * null, lower, upper) > cost


@pytest.mark.parametrize("position", [(1.9, 0.0, 0.1), (0.0, 0.0, 1.9), (0.4, 0.0, -1.5)])
def test_a_trocar_out_of_reach_is_refused_with_what_is_missing(
    configuration: Configuration, position: tuple[float, float, float]
) -> None:
    with pytest.raises(UnreachableStart) as caught:
        found(changed(configuration, trocar={"position_m": position}))
    missing = caught.value.position_error_m + caught.value.orientation_error_rad
    assert missing > 1e-3
    assert "cannot be reached" in str(caught.value)
    assert "\n" not in str(caught.value)
