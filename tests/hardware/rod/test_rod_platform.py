"""The rod against a compliant platform."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.rod.platform import Platform
from hardware.rod.properties import RodProperties
from hardware.rod.rod import Rod, RodShape, solve_rod
from robot.errors import ConfigurationError
from tests.hardware.rod.loads import pulling, stiffness_per_rad

DIRECTION = math.radians(135.0)
TOUCHING = math.radians(48.0)
FRICTIONS = (0.0, 0.15)


def in_the_way(shape: RodShape, stiffness_n_m: float = 2000.0) -> Platform:
    """A platform at the tip, across its way when the rod bends further."""
    ahead = np.array([math.cos(DIRECTION), -math.sin(DIRECTION), 0.0])
    normal = -shape.tip_rotation @ ahead
    x, y, z = shape.tip_position
    return Platform((x, y, z), (normal[0], normal[1], normal[2]), stiffness_n_m)


def at_the_platform(friction: float, stiffness_n_m: float = 2000.0) -> tuple[Rod, float]:
    """A rod bent to 48 deg that just touches, and the amplitude of its tensions."""
    properties = RodProperties(friction=friction)
    rod = Rod(properties)
    amplitude = 0.0
    while rod.shape.bends[-1] < TOUCHING:
        amplitude += 0.02 * stiffness_per_rad(properties)
        rod.step(pulling(amplitude, DIRECTION))
    rod.platform = in_the_way(rod.shape, stiffness_n_m)
    return rod, amplitude


@pytest.mark.parametrize("friction", FRICTIONS)
def test_five_levels_of_tension_press_with_a_third_of_a_newton(friction: float) -> None:
    rod, touching = at_the_platform(friction)
    platform = rod.platform
    assert platform is not None
    forces = []
    for more in np.linspace(0.35, 3.6, 5):
        shape = rod.step(pulling(touching + more, DIRECTION))
        forces.append(float(np.linalg.norm(shape.force)))
        np.testing.assert_allclose(shape.force, platform.force(shape.tip_position), atol=1e-6)
        np.testing.assert_allclose(shape.force / forces[-1], platform.direction, atol=1e-12)
        alone = solve_rod(
            rod.properties, pulling(touching + more, DIRECTION), shape.sliding, shape.force
        )
        np.testing.assert_allclose(alone.positions, shape.positions, atol=1e-9)
        assert 48.0 <= math.degrees(shape.bends[-1]) < 65.0
    assert forces == sorted(forces)
    assert forces[0] == pytest.approx(0.03, abs=0.01)
    assert forces[-1] == pytest.approx(0.33, abs=0.03)


def test_a_tip_in_contact_is_no_longer_an_arc() -> None:
    rod, touching = at_the_platform(0.0)
    bent = np.hypot(*rod.shape.curvatures[:, :2].T)
    assert np.ptp(bent) < 1e-6
    shape = rod.step(pulling(touching + 2.0, DIRECTION))
    bent = np.hypot(*shape.curvatures[:, :2].T)
    assert np.ptp(bent) > 5.0  # 1/m, of about 30
    assert abs(shape.curvatures[:, 2]).max() < 1e-6  # in its plane, so no torsion


def test_a_platform_aside_twists_the_rod() -> None:
    rod, touching = at_the_platform(0.15)
    facing = rod.platform
    assert facing is not None
    sideways = facing.direction + 0.5 * np.array([1.0, -1.0, 0.0])
    rod.platform = Platform(facing.point, (sideways[0], sideways[1], sideways[2]), 2000.0)
    shape = rod.step(pulling(touching + 1.5, DIRECTION))
    assert np.linalg.norm(shape.force) > 0.05
    assert np.abs(shape.curvatures[:, 2]).max() > 0.5


def test_a_platform_out_of_reach_does_nothing() -> None:
    rod, free = (
        Rod(RodProperties(), Platform((0.0, 0.0, -0.1), (0.0, 0.0, 1.0))),
        Rod(RodProperties()),
    )
    for amplitude in (0.5, 2.0, 1.0):
        shape, alone = (each.step(pulling(amplitude, DIRECTION)) for each in (rod, free))
        np.testing.assert_allclose(shape.positions, alone.positions, atol=1e-10)
        np.testing.assert_allclose(shape.force, 0.0, atol=1e-9)


def test_contact_begins_without_a_jump_and_ends_as_it_began() -> None:
    rod, touching = at_the_platform(0.0)
    amplitudes = touching + np.linspace(-0.2, 0.2, 41)
    forces = [np.linalg.norm(rod.step(pulling(each, DIRECTION)).force) for each in amplitudes]
    assert max(forces[:20]) < 1e-9
    assert min(forces[21:]) > 1e-4
    assert np.max(np.diff(forces)) < 2e-3
    back = [np.linalg.norm(rod.step(pulling(each, DIRECTION)).force) for each in amplitudes[::-1]]
    np.testing.assert_allclose(back[::-1], forces, atol=1e-8)


def test_a_stiffer_platform_gives_way_less() -> None:
    forces, depths = [], []
    for stiffness in (20.0, 200.0, 2000.0, 1e6):
        rod, touching = at_the_platform(0.15, stiffness)
        shape = rod.step(pulling(touching + 1.0, DIRECTION))
        assert rod.platform is not None
        depths.append(rod.platform.penetration(shape.tip_position))
        forces.append(float(np.linalg.norm(shape.force)))
    assert forces == sorted(forces)
    assert depths == sorted(depths, reverse=True)
    assert depths[-1] < 1e-6


@pytest.mark.parametrize("friction", FRICTIONS)
def test_a_loop_in_and_out_of_contact_costs_only_friction(friction: float) -> None:
    rod, touching = at_the_platform(friction)
    turns = np.linspace(0.0, 4.0 * math.pi, 401)
    done, before, held = 0.0, rod.shape, pulling(touching, DIRECTION)
    for count, turn in enumerate(turns):
        tensions = pulling(touching + 0.8 * math.sin(turn), DIRECTION + 0.1 * math.cos(turn))
        shape = rod.step(tensions)
        if count > 200:  # the second turn closes
            done -= 0.5 * (tensions + held) @ (shape.lengths - before.lengths)
        before, held = shape, tensions
    if friction == 0.0:
        assert abs(done) < 1e-7
    else:
        assert 1e-6 < done < 1e-3


def test_what_is_no_platform_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="normal"):
        Platform((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    with pytest.raises(ConfigurationError, match="point"):
        Platform((math.nan, 0.0, 0.0), (0.0, 0.0, 1.0))
    with pytest.raises(ConfigurationError, match="stiffness_n_m"):
        Platform((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.0)


def test_a_platform_pushes_along_its_normal_only() -> None:
    platform = Platform((0.0, 0.0, 0.01), (0.0, 3.0, 4.0), 100.0)
    np.testing.assert_allclose(platform.direction, [0.0, 0.6, 0.8])
    inside = np.array([0.5, 0.0, 0.0])
    assert platform.penetration(inside) == pytest.approx(0.008)
    np.testing.assert_allclose(platform.force(inside), [0.0, 0.48, 0.64])
    np.testing.assert_array_equal(platform.force(np.array([0.0, 0.0, 0.02])), 0.0)
