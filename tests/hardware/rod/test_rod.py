"""The rod's statics against closed forms, an independent integration, and its symmetries."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from scipy.special import ellipeinc, ellipkinc

from hardware.rod.properties import RodProperties
from hardware.rod.rod import Rod, RodShape, solve_rod
from hardware.rod.shooting import RodNotSolved
from hardware.rod.tendons import TensionRefused, tensions_along
from robot.errors import ConfigurationError
from tests.hardware.rod.loads import pulling, stiffness_per_rad
from tests.hardware.rod.rucker_webster import (
    UP,
    spokes,
    stiffness,
    tendon_directions,
    tip_balance,
)

ROD = RodProperties()
LENGTH = ROD.length_m
NOTHING = np.zeros(3)
SLACK, HELD = np.zeros(4), np.zeros(4)


def random_load(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    force = rng.normal(size=3)
    return (
        rng.uniform(0.2, 3.0, 4),
        rng.uniform(-1.0, 1.0, 4),
        0.25 * force / np.linalg.norm(force),
        1e-3 * rng.normal(size=3),
    )


def tendon_forces(properties: RodProperties, tensions: np.ndarray, shape: RodShape) -> np.ndarray:
    """(n, 4, 3) what each tendon carries, segment base frame, N."""
    held = tensions_along(properties, tensions, shape.sliding, shape.bends)
    along = [tendon_directions(properties, curvature) for curvature in shape.curvatures]
    return np.asarray(held[:, :, None] * (np.array(along) @ shape.rotations.transpose(0, 2, 1)))


@pytest.mark.parametrize("direction", [0.0, 37.0, 90.0, 135.0, -72.5])
@pytest.mark.parametrize("bend", [0.0, 1e-6, 0.3, 1.0, 2.5])
def test_free_bending_without_friction_is_an_arc(direction: float, bend: float) -> None:
    delta = math.radians(direction)
    amplitude = bend * stiffness_per_rad(ROD)
    shape = solve_rod(ROD, pulling(amplitude, delta), HELD, NOTHING)
    towards = np.array([math.cos(delta), -math.sin(delta), 0.0])
    axis = np.array([math.sin(delta), math.cos(delta), 0.0])
    np.testing.assert_allclose(shape.curvatures, np.tile(bend / LENGTH * axis, (61, 1)), atol=1e-9)
    radius = LENGTH / bend if bend else math.inf
    for fraction, position, rotation in zip(
        shape.fractions, shape.positions, shape.rotations, strict=True
    ):
        angle = fraction * bend
        aside = radius * 2.0 * math.sin(0.5 * angle) ** 2 if bend else 0.0
        up = radius * math.sin(angle) if bend else fraction * LENGTH
        np.testing.assert_allclose(position, aside * towards + up * UP, atol=2e-9)
        turned = Rotation.from_rotvec(angle * axis).as_matrix()
        np.testing.assert_allclose(rotation, turned, atol=1e-7)
    azimuths = np.radians([0.0, 90.0, 180.0, 270.0])
    lengths = -ROD.pitch_radius_m * bend * np.cos(delta + azimuths)
    np.testing.assert_allclose(shape.lengths, lengths, atol=1e-15)


def test_a_newton_per_tendon_pair_bends_as_the_stiffness_says() -> None:
    assert stiffness_per_rad(ROD) == pytest.approx(3.41, abs=0.005)
    shape = solve_rod(ROD, np.array([0.3 + 3.41, 0.3, 0.3, 0.3]), HELD, NOTHING)
    assert shape.bends[-1] == pytest.approx(1.0, abs=1e-3)
    assert shape.tip_position[0] > 0.0


def test_a_small_force_bends_a_cantilever(rng: np.random.Generator) -> None:
    for _ in range(10):
        force = np.append(1e-5 * rng.normal(size=2), 0.0)
        shape = solve_rod(ROD, SLACK, HELD, force)
        expected = force * LENGTH**3 / (3.0 * ROD.bending_stiffness_n_m2)
        np.testing.assert_allclose(shape.tip_position[:2], expected[:2], rtol=1e-6)
        turn = Rotation.from_matrix(shape.tip_rotation).as_rotvec()
        slope = np.cross(UP, force) * LENGTH**2 / (2.0 * ROD.bending_stiffness_n_m2)
        np.testing.assert_allclose(turn, slope, rtol=1e-6, atol=1e-12)


def test_a_moment_on_the_tip_bends_a_circle(rng: np.random.Generator) -> None:
    for bend in (0.2, 1.5, 4.0):
        angle = rng.uniform(-math.pi, math.pi)
        axis = np.array([math.cos(angle), math.sin(angle), 0.0])
        moment = bend * ROD.bending_stiffness_n_m2 / LENGTH * axis
        shape = solve_rod(ROD, SLACK, HELD, NOTHING, moment)
        towards, radius = np.cross(axis, UP), LENGTH / bend
        expected = radius * (1.0 - math.cos(bend)) * towards + radius * math.sin(bend) * UP
        np.testing.assert_allclose(shape.tip_position, expected, atol=2e-8)


@pytest.mark.parametrize("tip_angle_deg", [10.0, 40.0, 70.0, 85.0])
def test_a_large_force_bends_the_elastica(tip_angle_deg: float) -> None:
    sine = math.sin(math.radians(tip_angle_deg))
    parameter = 0.5 * (1.0 + sine)
    start = math.asin(math.sqrt(0.5 / parameter))
    root = ellipkinc(0.5 * math.pi, parameter) - ellipkinc(start, parameter)
    arc = ellipeinc(0.5 * math.pi, parameter) - ellipeinc(start, parameter)
    force = root**2 * ROD.bending_stiffness_n_m2 / LENGTH**2
    for towards in (np.array([1.0, 0.0, 0.0]), np.array([-0.6, 0.8, 0.0])):
        shape = solve_rod(ROD, SLACK, HELD, force * towards)
        aside, up = LENGTH * (1.0 - 2.0 * arc / root), LENGTH * math.sqrt(2.0 * sine) / root
        np.testing.assert_allclose(shape.tip_position, aside * towards + up * UP, atol=1e-8)
        assert math.degrees(shape.bends[-1]) == pytest.approx(tip_angle_deg, abs=1e-4)


def test_an_independent_integration_ends_with_the_loads_on_the_tip(
    rng: np.random.Generator,
) -> None:
    for _ in range(4):
        tensions, sliding, force, moment = random_load(rng)
        shape = solve_rod(ROD, tensions, sliding, force, moment)
        assert np.abs(shape.curvatures[:, 2]).max() > 0.1  # torsion, in 1/m
        at_base = force - tensions @ tendon_directions(ROD, shape.curvatures[0])
        end = tip_balance(ROD, tensions, sliding, shape.curvatures[0], at_base)
        np.testing.assert_allclose(end.position, shape.tip_position, atol=1e-9)
        np.testing.assert_allclose(end.rotation, shape.tip_rotation, atol=1e-7)
        np.testing.assert_allclose(end.force, force, atol=1e-6)
        np.testing.assert_allclose(end.moment, moment, atol=1e-8)


def test_every_part_of_the_rod_is_in_balance(rng: np.random.Generator) -> None:
    """From any cut to the tip: what the cut carries balances the tip's wrench, tendons and all."""
    for _ in range(5):
        tensions, sliding, force, moment = random_load(rng)
        shape = solve_rod(ROD, tensions, sliding, force, moment)
        carried = tendon_forces(ROD, tensions, shape)
        arms = spokes(ROD) @ shape.rotations.transpose(0, 2, 1)
        inside = np.einsum("nij,nj->ni", shape.rotations @ stiffness(ROD), shape.curvatures)
        at_cut = inside + np.sum(np.cross(arms, carried), axis=1)
        outside = moment + np.cross(shape.tip_position - shape.positions, force)
        np.testing.assert_allclose(at_cut, outside, atol=1e-12)


def test_torsion_follows_the_force_across_the_bend() -> None:
    tensions, across = np.array([2.3, 0.3, 0.3, 0.3]), np.array([0.0, 1e-3, 0.0])
    arc = solve_rod(ROD, tensions, HELD, NOTHING)
    twisting = np.cross(arc.tip_position, across)[2]  # about the base's axis
    # The tendons, wound into helices, resist torsion too: by r^2 T over how long they are there.
    reach = 1.0 + np.cross(arc.curvatures[0], spokes(ROD))[:, 2]
    helices = ROD.pitch_radius_m**2 * np.sum(tensions / reach)
    assert helices == pytest.approx(0.08 * ROD.torsion_stiffness_n_m2, rel=0.1)
    for share in (0.5, 1.0, 2.0):
        properties = replace(ROD, torsion_stiffness_n_m2=share * ROD.torsion_stiffness_n_m2)
        twist = solve_rod(properties, tensions, HELD, across).curvatures[0, 2]
        expected = twisting / (properties.torsion_stiffness_n_m2 + helices)
        assert twist == pytest.approx(expected, rel=3e-3)
        back = solve_rod(properties, tensions, HELD, -across).curvatures[0, 2]
        assert back == pytest.approx(-twist, rel=3e-3)
        within = solve_rod(properties, tensions, HELD, np.array([1e-3, 0.0, 0.0]))
        np.testing.assert_allclose(within.curvatures[:, 2], 0.0, atol=1e-10)


def test_a_quarter_turn_of_everything_turns_the_answer(rng: np.random.Generator) -> None:
    turn = Rotation.from_rotvec([0.0, 0.0, math.pi / 2]).as_matrix()
    for _ in range(5):
        tensions, sliding, force, moment = random_load(rng)
        shape = solve_rod(ROD, tensions, sliding, force, moment)
        turned = solve_rod(
            ROD, np.roll(tensions, 1), np.roll(sliding, 1), turn @ force, turn @ moment
        )
        np.testing.assert_allclose(turned.positions, shape.positions @ turn.T, atol=1e-10)
        np.testing.assert_allclose(turned.rotations, turn @ shape.rotations @ turn.T, atol=1e-8)
        np.testing.assert_allclose(turned.lengths, np.roll(shape.lengths, 1), atol=1e-11)


def test_a_reflected_load_gives_the_reflected_shape(rng: np.random.Generator) -> None:
    mirror, swapped = np.diag([1.0, -1.0, 1.0]), [0, 3, 2, 1]
    for _ in range(5):
        tensions, sliding, force, moment = random_load(rng)
        shape = solve_rod(ROD, tensions, sliding, force, moment)
        other = solve_rod(
            ROD, tensions[swapped], sliding[swapped], mirror @ force, -mirror @ moment
        )
        np.testing.assert_allclose(other.positions, shape.positions @ mirror, atol=1e-10)
        np.testing.assert_allclose(other.curvatures[:, 2], -shape.curvatures[:, 2], atol=1e-6)


def test_cross_sections_stay_orthonormal_and_the_backbone_keeps_its_length(
    rng: np.random.Generator,
) -> None:
    for _ in range(5):
        shape = solve_rod(ROD, *random_load(rng))
        products = shape.rotations @ shape.rotations.transpose(0, 2, 1)
        np.testing.assert_allclose(products, np.tile(np.eye(3), (61, 1, 1)), atol=1e-14)
        np.testing.assert_allclose(np.linalg.det(shape.rotations), 1.0, atol=1e-14)
        chords = np.linalg.norm(np.diff(shape.positions, axis=0), axis=1)
        half = 0.5 * np.linalg.norm(shape.curvatures[1:] + shape.curvatures[:-1], axis=1)
        bends = half * LENGTH / 60
        np.testing.assert_allclose(np.sum(chords * (1.0 + bends**2 / 24.0)), LENGTH, rtol=1e-5)


def test_the_error_falls_with_the_fourth_power_of_the_steps(rng: np.random.Generator) -> None:
    load = random_load(rng)
    exact = solve_rod(ROD, *load, steps=480)
    errors = []
    for steps in (15, 30, 60):
        shape = solve_rod(ROD, *load, steps=steps)
        errors.append(float(np.linalg.norm(shape.tip_position - exact.tip_position)))
    assert errors[2] < 2e-9
    assert 10.0 < errors[0] / errors[1] < 25.0
    assert 10.0 < errors[1] / errors[2] < 25.0


def test_a_guess_saves_work_and_changes_nothing(rng: np.random.Generator) -> None:
    tensions, sliding, force, moment = random_load(rng)
    shape = solve_rod(ROD, tensions, sliding, force, moment)
    near = solve_rod(ROD, 1.05 * tensions, sliding, 1.1 * force, moment)
    straight = Rod(ROD).shape
    for guess in (shape, near, straight):
        again = solve_rod(ROD, tensions, sliding, force, moment, guess)
        np.testing.assert_allclose(again.positions, shape.positions, atol=1e-10)


def test_a_load_without_balance_is_refused() -> None:
    with pytest.raises(RodNotSolved, match="load it in smaller steps") as refusal:
        solve_rod(ROD, np.array([30.0, 0.0, 0.0, 0.0]), HELD, np.array([1e3, 0.0, -1e3]))
    assert refusal.value.code == "rod_not_solved"
    assert refusal.value.residual > 1e-10
    rod = Rod(ROD)
    before = rod.step(np.array([2.0, 0.3, 0.3, 0.3]))
    with pytest.raises(RodNotSolved):
        rod.step(np.array([30.0, 0.0, 0.0, 0.0]), np.array([1e3, 0.0, -1e3]))
    np.testing.assert_array_equal(rod.shape.positions, before.positions)
    after = rod.step(np.array([2.0, 0.3, 0.3, 0.3]))
    np.testing.assert_allclose(after.positions, before.positions, atol=1e-10)


@pytest.mark.parametrize("tensions", [[1.0, -0.1, 0.3, 0.3], [math.nan] * 4, [0.3] * 3])
def test_a_tendon_that_pushes_is_refused(tensions: list[float]) -> None:
    with pytest.raises(TensionRefused, match="0 or more"):
        solve_rod(ROD, np.array(tensions), HELD, NOTHING)
    with pytest.raises(TensionRefused):
        Rod(ROD).step(np.array(tensions))


def test_what_is_no_rod_is_refused() -> None:
    with pytest.raises(ConfigurationError, match="length_m"):
        RodProperties(length_m=0.0)
    with pytest.raises(ConfigurationError, match="friction"):
        RodProperties(friction=-0.1)
    with pytest.raises(ConfigurationError, match="torsion_stiffness_n_m2"):
        RodProperties(torsion_stiffness_n_m2=math.inf)
    assert RodProperties(friction=0.0).friction == 0.0
