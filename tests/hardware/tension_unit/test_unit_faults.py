"""What a broken module shows: its cell without a reading, flat or at its end; its tendon gone."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.tension_unit.module import MODULES, POSITION, TORQUE, UnitFault
from hardware.tension_unit.unit import SimulatedUnit
from server.configuration_file import load

DESIGN = load().tension_unit
OTHERS = [0, 1, 3]
BROKEN = 2


@pytest.fixture
def unit(rng: np.random.Generator) -> SimulatedUnit:
    return SimulatedUnit(DESIGN, rng, 7500.0, 0.03, 2.0)


def go(
    unit: SimulatedUnit, cycles: int, wanted: np.ndarray, mode: int = POSITION
) -> tuple[np.ndarray, np.ndarray]:
    """(cycles, 4) tensions as measured, and the true ones."""
    measured, true = [], []
    for _ in range(cycles):
        unit.cycle([mode] * MODULES, wanted)
        measured.append(unit.tension)
        true.append(unit.true_tension)
    return np.array(measured), np.array(true)


def test_what_each_fault_shows(unit: SimulatedUnit) -> None:
    healthy, _ = go(unit, 100, unit.zero)
    full_scale = DESIGN.cell_full_scale_nm / (1e-3 * DESIGN.pulley_radius_mm)
    shown = {}
    for fault in UnitFault:
        last = unit.tension[BROKEN]
        unit.break_module(BROKEN, fault)
        measured, true = go(unit, 200, unit.zero)
        shown[fault] = measured[100:, BROKEN]
        assert np.isfinite(measured[:, OTHERS]).all()
        np.testing.assert_allclose(measured[100:, OTHERS].mean(axis=0), 2.0, atol=0.06)
        if fault is UnitFault.CELL_FLAT:
            assert (measured[:, BROKEN] == last).all()
        if fault is UnitFault.TENDON_BROKEN:
            assert (true[:, BROKEN] == 0.0).all()
        else:
            np.testing.assert_allclose(true[100:, BROKEN], 2.0, atol=0.06)
        unit.break_module(BROKEN, UnitFault.NONE)
        go(unit, 300, unit.zero)
    noise = healthy[:, BROKEN].std()
    assert np.isnan(shown[UnitFault.CELL_MISSING]).all()
    assert (shown[UnitFault.CELL_SATURATED] == full_scale).all()
    assert abs(shown[UnitFault.TENDON_BROKEN].mean()) < noise
    assert shown[UnitFault.TENDON_BROKEN].std() == pytest.approx(noise, rel=0.4)
    assert shown[UnitFault.NONE].mean() == pytest.approx(2.0, abs=0.06)


def test_a_tendon_that_breaks_while_it_is_pulled_lets_its_motor_stand(unit: SimulatedUnit) -> None:
    wanted = unit.zero - 0.05
    go(unit, 300, wanted)
    unit.break_module(BROKEN, UnitFault.TENDON_BROKEN)
    measured, _ = go(unit, 300, wanted)
    np.testing.assert_allclose(unit.wound, 0.05, atol=1e-3)
    assert abs(measured[100:, BROKEN].mean()) < 0.05
    assert (measured[100:, OTHERS] > 4.0).all()


def test_without_a_reading_torque_mode_holds_the_motor(unit: SimulatedUnit) -> None:
    wanted = np.full(MODULES, -0.05)
    go(unit, 1000, wanted, TORQUE)
    before = unit.wound
    unit.break_module(BROKEN, UnitFault.CELL_MISSING)
    _, true = go(unit, 1000, 2.0 * wanted, TORQUE)
    assert unit.wound[BROKEN] == pytest.approx(before[BROKEN], abs=5e-3)
    np.testing.assert_allclose(true[-1, OTHERS], 10.0, atol=0.2)


def test_only_the_named_module_breaks_and_equal_seeds_repeat() -> None:
    runs = []
    for fault in (UnitFault.NONE, UnitFault.TENDON_BROKEN, UnitFault.TENDON_BROKEN):
        unit = SimulatedUnit(DESIGN, np.random.default_rng(4), 7500.0, 0.03, 2.0)
        unit.break_module(BROKEN, fault)
        runs.append(go(unit, 50, unit.zero)[0])
    np.testing.assert_array_equal(runs[0][:, OTHERS], runs[1][:, OTHERS])
    np.testing.assert_array_equal(runs[1], runs[2])
