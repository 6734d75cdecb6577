"""Torque cells that cannot be believed: what is missing, at its end, or stays as it is."""

from __future__ import annotations

import math

import numpy as np
import pytest

from robot.parameters import parameters
from robot.records import INPUT, STATE
from robot.tension.cells import cells_read, follow_cells, is_flat
from server.configuration_file import load

DT = 0.002
FLAT_S = 0.06
PARAMETERS = parameters(load(None))


class Cells:
    """What four cells read, tick by tick."""

    def __init__(self) -> None:
        self.state, self.input = np.zeros(1, STATE), np.zeros(1, INPUT)
        self.input["tension_cells"] = 1

    def read(self, *tensions: float, dt: float = DT) -> bool:
        """One tick; whether the readings can be believed."""
        self.input["measured_tension"], self.input["dt_s"] = tensions, dt
        follow_cells(self.state[0], self.input[0])
        return bool(cells_read(self.state[0], self.input[0], PARAMETERS[0]))

    def flat(self, flat_s: float = FLAT_S) -> list[bool]:
        return [bool(is_flat(self.state[0], cell, flat_s)) for cell in range(4)]


def test_the_configuration_watches_for_60_ms() -> None:
    assert PARAMETERS["cell_flat"][0] == FLAT_S


def test_noise_of_the_last_bit_is_enough_and_one_cell_that_stays_is_found(
    rng: np.random.Generator,
) -> None:
    cells = Cells()
    for _ in range(200):
        assert cells.read(*(2.0 + np.spacing(2.0) * rng.permutation(4)))
    ticks = 0
    while cells.read(*(2.0 + 0.2 * rng.normal(size=3)), 1.7):
        ticks += 1
    assert ticks * DT == pytest.approx(FLAT_S, abs=1.5 * DT)
    assert cells.flat() == [False, False, False, True]
    assert cells.flat(0.0) == [False] * 4
    assert cells.read(2.0, 2.1, 2.2, 1.7 + 1e-9)
    assert cells.flat() == [False] * 4


def test_a_late_tick_has_seen_no_more_readings() -> None:
    cells = Cells()
    cells.read(1.0, 1.0, 1.0, 1.0)
    assert cells.read(1.0, 1.0, 1.0, 1.0, dt=0.5)
    assert cells.flat() == [False] * 4


@pytest.mark.parametrize("reading", [math.nan, math.inf, 70.0, 71.0])
def test_what_is_missing_or_at_its_end_is_not_believed(reading: float) -> None:
    cells = Cells()
    for k in range(50):
        assert not cells.read(1.0 + k, 1.0 + k, reading, 1.0 + k)
    # What is missing is not flat: the words to the operator differ.
    assert cells.flat() == [False, False, not math.isnan(reading), False]


def test_a_robot_without_cells_reads_nothing() -> None:
    cells = Cells()
    cells.input["tension_cells"] = 0
    assert not cells.read(1.0, 2.0, 3.0, 4.0)


@pytest.mark.parametrize(("noise", "resolution"), [(0.0, 0.0), (0.0, 0.02), (0.02, 0.02)])
def test_a_cell_without_noise_may_stay_as_it_is(noise: float, resolution: float) -> None:
    unit = load(None).tension_unit
    quiet = {"cell_noise_mnm": noise, "cell_resolution_mnm": resolution}
    assert unit.cell_flat_s == FLAT_S
    assert unit.model_copy(update=quiet).cell_flat_s == 0.0
