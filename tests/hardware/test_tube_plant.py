"""Simulated concentric-tube arms: they stand where motors are, follow late, and differ by seed."""

from __future__ import annotations

import numpy as np
import pytest

from hardware.faulty_plant import TUBE_FAULTS, FaultyPlant
from hardware.tube_plant import TUBE_PRESETS, TubePlant
from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.records import concentric_types
from robot.configuration import Configuration
from robot.safety import Event
from tests.robot.concentric.tube_drive import concentric

TYPES = concentric_types(3)


def configured(preset: str, plant: str = "physics", seed: int = 1) -> Configuration:
    configuration = concentric()
    update = {"preset": preset, "plant": plant, "seed": seed}
    simulation = configuration.simulation.model_copy(update=update)
    return configuration.model_copy(update={"simulation": simulation})


@pytest.fixture(scope="module")
def start() -> np.ndarray:
    return np.asarray(ConcentricRobot(concentric()).initial_state()["q"][0])


def tell(plant: TubePlant | FaultyPlant, q: np.ndarray) -> None:
    command = np.zeros(1, TYPES.outcome["command"])
    command["q"] = q
    plant.write(command)


def truth_of(plant: TubePlant) -> np.void:
    truth = np.zeros(1, TYPES.truth)
    assert plant.truth(truth)
    found: np.void = truth[0]
    return found


def test_exact_arms_stand_at_once_where_they_are_told(start: np.ndarray) -> None:
    plant = TubePlant(configured("paper", "kinematic"), start)
    goal = start + 1e-3
    tell(plant, goal)
    assert plant.advance() == 10_000_000
    assert np.array_equal(plant.read().q, goal)
    assert plant.spec.name == "kinematic"
    assert np.array_equal(truth_of(plant)["q"], goal)


def test_motors_lag_by_their_time_constant(start: np.ndarray) -> None:
    plant = TubePlant(configured("paper"), start)
    goal = start.copy()
    goal[0] += 0.004
    tell(plant, goal)
    for _ in range(2):  # 20 ms: one time constant
        plant.advance()
    way = (truth_of(plant)["q"][0] - start[0]) / 0.004
    assert way == pytest.approx(1.0 - np.exp(-1.0), abs=1e-9)


def test_encoders_round(start: np.ndarray) -> None:
    preset = TUBE_PRESETS["paper"]
    plant = TubePlant(configured("paper"), start)
    tell(plant, start + 1.234567e-5)
    plant.advance()
    measured, there = plant.read().q, truth_of(plant)["q"]
    steps = measured[:3] / preset.translation_step_m
    assert np.allclose(steps, np.round(steps), atol=1e-6)
    assert np.abs(measured[:3] - there[:3]).max() <= 0.5 * preset.translation_step_m + 1e-15
    assert np.abs(measured[3:6] - there[3:6]).max() <= 0.5 * preset.rotation_step_rad + 1e-12


def test_arms_as_in_the_paper_are_the_controllers_model(start: np.ndarray) -> None:
    state = ConcentricRobot(concentric()).initial_state()[0]
    truth = truth_of(TubePlant(configured("paper"), start))
    assert np.allclose(truth["position"], state["tip_position"], atol=1e-12)
    assert np.allclose(truth["position_b"], state["position_b"], atol=1e-12)


def test_harsh_arms_are_not_and_differ_by_seed_only(start: np.ndarray) -> None:
    state = ConcentricRobot(concentric()).initial_state()[0]
    first, same, other = (
        truth_of(TubePlant(configured("harsh", seed=seed), start)) for seed in (1, 1, 2)
    )
    assert first.tobytes() == same.tobytes()
    assert 1e-5 < np.linalg.norm(first["position"] - state["tip_position"]) < 0.02
    assert np.linalg.norm(first["position"] - other["position"]) > 1e-5
    # The two arms are not made of the same tubes either.
    apart = first["position_b"] - first["position"]
    assert np.linalg.norm(apart - (state["position_b"] - state["tip_position"])) > 1e-5


def test_holding_forgets_what_was_told(start: np.ndarray) -> None:
    plant = TubePlant(configured("paper"), start)
    tell(plant, start + 1e-3)
    plant.advance()
    plant.hold()
    there = truth_of(plant)["q"].copy()
    plant.advance()
    assert np.array_equal(truth_of(plant)["q"], there)


def test_where_no_tubes_can_be_the_simulation_says_so_and_stands(start: np.ndarray) -> None:
    plant = TubePlant(configured("paper", "kinematic"), start)
    beyond = start.copy()
    beyond[0] = 0.05  # a rear end before the face: no such tube
    tell(plant, beyond)
    plant.advance()
    assert plant.read().event == Event.SIMULATION_FAILED
    before = truth_of(plant)["position"].copy()
    tell(plant, start)
    plant.advance()
    assert np.array_equal(truth_of(plant)["position"], before)


@pytest.mark.parametrize("name", TUBE_FAULTS)
def test_every_fault_can_be_injected_and_cleared(start: np.ndarray, name: str) -> None:
    inner = TubePlant(configured("paper"), start)
    plant = FaultyPlant(inner, TUBE_FAULTS)
    plant.inject(name)
    assert plant.active == name
    plant.clear()
    assert plant.read() is not None
    assert np.array_equal(plant.read().q, inner.read().q)


def test_a_stuck_tube_stays(start: np.ndarray) -> None:
    plant = FaultyPlant(TubePlant(configured("paper", "kinematic"), start), TUBE_FAULTS)
    plant.inject("tube-stuck")
    tell(plant, start + 1e-3)
    plant.advance()
    moved = plant.read().q - start
    assert moved[0] == 0.0
    assert np.allclose(moved[1:], 1e-3)
