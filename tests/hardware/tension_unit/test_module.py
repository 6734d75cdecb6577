"""One module: energy, friction, backlash, what its sensors read, its modes; chirp and weights."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hardware.tension_unit.chirp import run_chirp
from hardware.tension_unit.module import (
    CURRENT,
    CYCLE_S,
    MODULES,
    POSITION,
    TORQUE,
    unit_constants,
)
from hardware.tension_unit.unit import SimulatedUnit
from hardware.tension_unit.weights import WEIGHTS_KG, hang_weights
from robot.sensing.torque_cell_calibration import STANDARD_GRAVITY, WeightsUnusable, fit_cell
from robot.tension_unit_design import TensionUnit
from server.configuration_file import load

RADIUS = 0.01


@pytest.fixture(scope="module")
def design() -> TensionUnit:
    return load().tension_unit


def quiet(design: TensionUnit, **more: float) -> TensionUnit:
    """Without noise of cells and currents."""
    return design.model_copy(update={"cell_noise_mnm": 0.0, "current_noise_ma": 0.0, **more})


class Unit(SimulatedUnit):
    """A unit that pulls tendons, or turns against springs."""

    def __init__(
        self, design: TensionUnit, rng: np.random.Generator, stiffness: float = 7500.0,
        pretension: float = 2.0, spring: float = 0.0,
    ) -> None:  # fmt: skip
        super().__init__(design, rng, stiffness, 0.03, pretension, spring)

    def go(self, seconds: float, wanted: np.ndarray, mode: int = POSITION) -> np.void:
        for _ in range(round(seconds / CYCLE_S)):
            self.cycle([mode] * MODULES, wanted)
        state: np.void = self.state[0]
        return state


def test_it_rests_where_it_is_put(design: TensionUnit, rng: np.random.Generator) -> None:
    unit = Unit(quiet(design), rng)
    state = unit.go(0.5, unit.zero)
    assert state["angle"] == pytest.approx(np.zeros(4), abs=3e-4)
    assert -state["cell"] / RADIUS == pytest.approx(np.full(4, 2.0), abs=0.03)


def test_energy_is_kept(design: TensionUnit, rng: np.random.Generator) -> None:
    """What the motor puts in is in the spring, in motion, or lost."""
    unit = Unit(quiet(design), rng, spring=1.0)
    c = unit.constants[0]
    for wanted in (0.05, -0.02, 0.03):
        state = unit.go(0.15, np.full(4, wanted))
        # What the gear's own spring holds counts as taken by the gear.
        stored = 0.5 * c["spring"] * state["angle"] ** 2
        moving = 0.5 * c["rotor"] * state["motor_speed"] ** 2
        moving += 0.5 * c["pulley"] * state["speed"] ** 2
        left = state["work"] - state["lost"] - stored - moving
        assert np.abs(left).max() < 0.01 * state["work"].max()
        assert (state["lost"] > 0.0).all()


def energy(unit: SimulatedUnit) -> np.ndarray:
    """(4,) J, in spring, gear and motion."""
    c, s = unit.constants[0], unit.state[0]
    twist = np.abs(s["motor"] / c["ratio"] - s["angle"]) - c["half_backlash"]
    stored = c["spring"] * s["angle"] ** 2 + c["gear_stiffness"] * np.maximum(twist, 0.0) ** 2
    moving = c["rotor"] * s["motor_speed"] ** 2 + c["pulley"] * s["speed"] ** 2
    return np.asarray(0.5 * (stored + moving))


def test_without_losses_a_swing_keeps_its_energy(
    design: TensionUnit, rng: np.random.Generator
) -> None:
    """A spring throws the motor to and fro; nothing but the gear's damping takes from it."""
    lossless = quiet(
        design, motor_friction_mnm=0.0, motor_viscosity_nnm_s=0.0, gear_efficiency=1.0,
        backlash_deg=0.0,
    )  # fmt: skip
    unit = Unit(lossless, rng, spring=1.0)
    c, s = unit.constants[0], unit.state[0]
    s["angle"], s["motor"] = 0.05, 0.05 * c["ratio"] * (1.0 + c["spring"] / c["gear_stiffness"])
    whole, turns = energy(unit), 0
    for _ in range(400):
        before = s["angle"][0]
        unit.go(CYCLE_S, np.zeros(4), CURRENT)
        turns += int(before * s["angle"][0] < 0.0)
        assert (energy(unit) < 1.005 * whole).all()
    assert (energy(unit) > 0.98 * whole).all()
    # As fast as spring and inertia say: two passages of the middle in each period.
    inertia = c["rotor"] * c["ratio"] ** 2 + c["pulley"]
    assert turns == pytest.approx(0.4 / math.pi * math.sqrt(c["spring"] / inertia), abs=1.0)


def test_winding_up_costs_what_spring_efficiency_and_friction_say(
    design: TensionUnit, rng: np.random.Generator
) -> None:
    """Slowly, so that inertia and drag do not count."""
    unit = Unit(quiet(design, backlash_deg=0.0), rng, spring=1.0)
    c, cycles = unit.constants[0], 2000
    for cycle in range(cycles):
        state = unit.go(CYCLE_S, np.full(4, 0.05 * (cycle + 1) / cycles))
    stored = 0.5 * state["load"] ** 2 * (1.0 / c["spring"] + 1.0 / c["gear_stiffness"])
    cost = stored / c["efficiency"] + c["friction"] * state["motor"]
    cost += c["viscosity"] * state["motor"] ** 2 / (cycles * CYCLE_S)
    assert state["work"] == pytest.approx(cost, rel=0.01)


def test_friction_holds_what_is_light_and_lets_go_of_what_is_heavy(
    design: TensionUnit, rng: np.random.Generator
) -> None:
    """Without a current; the gear's losses help to hold."""
    c = Unit(design, rng).constants[0]
    most = c["friction"] * c["ratio"] / c["efficiency"] / RADIUS
    for share in (0.9, 1.1):
        unit = Unit(quiet(design), rng, pretension=share * most)
        before = unit.state["motor"][0].copy()
        after = unit.go(0.5, np.zeros(4), CURRENT)["motor"]
        assert np.all((after == before) == (share < 1.0))
        assert (unit.true_tension < 1.001 * most).all()


@pytest.mark.parametrize("stiffness", [0.5, 200.0])
@pytest.mark.parametrize("pulley", [5.0, 10000.0])
@pytest.mark.parametrize("rotor", [0.05, 100.0])
@pytest.mark.parametrize("ratio", [1.0, 62.0, 1000.0])
@pytest.mark.parametrize("efficiency", [0.1, 1.0])
def test_the_gear_is_calm_whatever_the_configuration_permits(
    design: TensionUnit, rng: np.random.Generator, stiffness: float, pulley: float, rotor: float,
    ratio: float, efficiency: float,
) -> None:  # fmt: skip
    """Let go against a stiff spring with a twisted gear, no energy is made."""
    unit = Unit(
        quiet(
            design, gear_stiffness_nm_rad=stiffness, pulley_inertia_g_cm2=pulley,
            rotor_inertia_g_cm2=rotor, gear_ratio=ratio, gear_efficiency=efficiency,
            motor_friction_mnm=0.0,
        ),
        rng, spring=5.0,
    )  # fmt: skip
    unit.state["angle"] = 0.01
    whole = energy(unit)
    for _ in range(30):
        unit.go(CYCLE_S, np.zeros(4), CURRENT)
        assert (energy(unit) < 1.03 * whole).all()


@pytest.mark.parametrize("backlash_deg", [0.1, 0.5])
def test_the_backlash_is_as_wide_as_it_is_set(
    design: TensionUnit, rng: np.random.Generator, backlash_deg: float
) -> None:
    """Between pushing and pulling a spring the motor turns through the gap."""
    unit = Unit(quiet(design, backlash_deg=backlash_deg), rng, spring=0.5)
    gaps = []
    for wanted in (0.05, -0.05):
        state = unit.go(0.6, np.full(4, wanted))
        twist = state["motor"][0] / unit.constants["ratio"][0] - state["angle"][0]
        gaps.append(twist + state["load"][0] / unit.constants["gear_stiffness"][0])
    assert gaps[0] - gaps[1] == pytest.approx(math.radians(backlash_deg), rel=0.02)


def test_the_cell_reads_the_load_and_the_current_the_friction_too(
    design: TensionUnit, rng: np.random.Generator
) -> None:
    """At rest, come to from below and from above."""
    unit = Unit(quiet(design), rng, spring=1.0)
    c, by_current = unit.constants[0], []
    for begin in (0.03, 0.07):
        unit.go(0.5, np.full(4, begin))
        for wanted in np.linspace(begin, 0.05, 500):
            state = unit.go(CYCLE_S, np.full(4, wanted))
        assert state["cell"] == pytest.approx(-state["load"], abs=2e-4)
        by_current.append(c["torque_constant"] * c["ratio"] * state["current"] + state["load"])
    friction = c["friction"] * c["ratio"]
    assert (by_current[0] > 0.8 * friction).all()
    assert (by_current[1] < -0.8 * friction).all()
    load = 0.05 * c["spring"]
    assert (by_current[0] < 1.2 * (friction + load * (1.0 / c["efficiency"] - 1.0))).all()
    assert (by_current[1] > -1.2 * (friction + load * (1.0 - c["efficiency"]))).all()


def test_a_cell_has_steps(design: TensionUnit, rng: np.random.Generator) -> None:
    unit = Unit(design.model_copy(update={"cell_resolution_mnm": 0.5}), rng)
    readings = [unit.go(CYCLE_S, unit.zero)["cell"].copy() / 0.5e-3 for _ in range(100)]
    np.testing.assert_allclose(readings, np.rint(readings), atol=1e-9)
    assert len(np.unique(np.rint(readings))) > 5


@pytest.mark.parametrize("stiffness", [1000.0, 7500.0, 50000.0, 100000.0])
def test_torque_mode_comes_to_the_tension_that_is_wanted(
    design: TensionUnit, rng: np.random.Generator, stiffness: float
) -> None:
    """And stays there: through friction and backlash, without swinging, soft or stiff."""
    unit = Unit(design, rng, stiffness)
    unit.go(0.3, unit.zero)
    for before, tension in ((2.0, 4.0), (4.0, 1.0), (1.0, 10.0)):
        wanted, true = np.full(4, -tension * RADIUS), []
        for _ in range(2500):
            unit.go(CYCLE_S, wanted, TORQUE)
            true.append(unit.true_tension)
        settled, change = np.array(true[2000:]), tension - before
        assert settled.mean(axis=0) == pytest.approx(np.full(4, tension), abs=0.04)
        assert settled.std(axis=0).max() < 0.06
        # Past the goal no further than by this share of the way, and the noise.
        assert np.max(np.sign(change) * (np.array(true) - tension)) < 0.1 * abs(change) + 0.1


def test_the_current_does_not_jump_where_the_mode_changes(
    design: TensionUnit, rng: np.random.Generator
) -> None:
    unit = Unit(quiet(design), rng)
    before = unit.go(0.5, unit.zero)["current"].copy()
    held = unit.state["cell"][0].copy()
    after = unit.go(CYCLE_S, held, TORQUE)["current"].copy()
    assert after == pytest.approx(before, abs=2e-3)


def test_a_cell_ends_at_its_full_scale(design: TensionUnit, rng: np.random.Generator) -> None:
    unit = Unit(design, rng, stiffness=50000.0)
    state = unit.go(0.5, unit.zero - 0.3)
    assert np.abs(state["cell"]).max() <= design.cell_full_scale_nm
    assert np.abs(state["current"]).max() <= design.current_limit_a


def test_the_chirp_is_followed_and_the_cell_is_better_than_the_current(
    design: TensionUnit,
) -> None:
    chirp, again = run_chirp(design, 3), run_chirp(design, 3)
    assert np.array_equal(chirp.cell_nm, again.cell_nm)
    assert chirp.position_rms_rad < 0.02 * 0.052
    assert chirp.pulley_rms_rad < 0.1 * 0.052
    assert chirp.cell_rms_nm < 0.0025
    assert chirp.current_rms_nm > 10.0 * chirp.cell_rms_nm


def test_weights_take_offset_and_gain_out(design: TensionUnit) -> None:
    crooked = design.model_copy(update={"cell_offset_mnm": 10.0, "cell_gain_percent": 5.0})
    true = unit_constants(crooked, np.random.default_rng(5))[0]
    readings = hang_weights(crooked, 5)
    for i in range(MODULES):
        found = fit_cell(readings[:, i], np.array(WEIGHTS_KG), RADIUS, crooked.cell_full_scale_nm)
        assert found.offset_nm == pytest.approx(true["offset"][i], abs=1e-3)
        assert found.gain == pytest.approx(true["gain"][i], rel=0.01)
        assert found.residual_nm < 1e-3
        hung = -np.array(WEIGHTS_KG) * STANDARD_GRAVITY * RADIUS
        np.testing.assert_allclose(found.torque(readings[:, i]), hung, atol=2e-3)


def test_readings_that_calibrate_nothing_are_refused(design: TensionUnit) -> None:
    weights, readings = np.array([0.0, 0.5, 1.0]), np.array([0.0, -0.049, -0.098])
    with pytest.raises(WeightsUnusable, match="too few"):
        fit_cell(readings[:2], weights[:2], RADIUS, 0.7)
    with pytest.raises(WeightsUnusable, match="not a number"):
        fit_cell(np.array([0.0, np.nan, -0.1]), weights, RADIUS, 0.7)
    with pytest.raises(WeightsUnusable, match="end of"):
        fit_cell(np.array([0.0, -0.049, -0.7]), weights, RADIUS, 0.7)
    with pytest.raises(WeightsUnusable, match="too light"):
        fit_cell(0.01 * readings, 0.01 * weights, RADIUS, 0.7)
    with pytest.raises(WeightsUnusable, match="times"):
        fit_cell(0.1 * readings, weights, RADIUS, 0.7)
    assert fit_cell(readings, weights, RADIUS, 0.7).gain == pytest.approx(1.0, rel=0.01)
