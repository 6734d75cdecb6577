"""Simulated concentric-tube arms: motors that lag, encoders that round, tubes that differ.

The model of the tubes is the controller's, but not its numbers: each tube of either arm has its own
curvature and stiffness, and the arms stand where the motors are, not where they are commanded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from hardware.plant import Actuator, Measurement, PlantSpec
from hardware.wireless import Wireless
from robot.concentric.design import Concentric, TubeDesign
from robot.concentric.kinematics import SOLVED
from robot.concentric.pair import ArmPair, PairKinematics
from robot.configuration import Configuration
from robot.records import TRACKER, ErrorSource
from robot.rotations import quaternion_from_matrix
from robot.safety import Event
from scenes.boards.board import Board


@dataclass(frozen=True)
class TubePreset:
    """How good the simulated arms are.

    Attributes:
        lag_s: time constant of every motor.
        translation_step_m: resolution of the encoders of translations.
        rotation_step_rad: and of rotations.
        curvature_spread: relative standard deviation of each tube's precurvature.
        stiffness_spread: and of its Young's modulus.
    """

    lag_s: float
    translation_step_m: float
    rotation_step_rad: float
    curvature_spread: float
    stiffness_spread: float


EXACT = TubePreset(0.0, 0.0, 0.0, 0.0, 0.0)
TUBE_PRESETS = {
    "ideal": TubePreset(0.005, 0.0, 0.0, 0.0, 0.0),
    "paper": TubePreset(0.02, 1e-6, math.radians(0.01), 0.0, 0.0),
    "harsh": TubePreset(0.04, 1e-5, math.radians(0.1), 0.01, 0.02),
}
"""The paper's arms are the controller's model; ``harsh`` ones are not."""


def _drawn(tubes: tuple[TubeDesign, ...], preset: TubePreset, seed: int) -> list[TubeDesign]:
    """One arm's tubes as they came out of the oven."""
    generator = np.random.default_rng(seed)
    made = []
    for tube in tubes:
        bent, stiff = 1.0 + generator.standard_normal(2) * (
            preset.curvature_spread, preset.stiffness_spread,
        )  # fmt: skip
        changed = {
            "curvature_per_m": tube.curvature_per_m * float(bent),
            "youngs_modulus_gpa": tube.youngs_modulus_gpa * float(stiff),
        }
        made.append(tube.model_copy(update=changed))
    return made


class _Arms:
    """Both arms with tubes of their own: where they stand for the motors' positions."""

    def __init__(self, design: Concentric, preset: TubePreset, seed: int) -> None:
        designs = [
            design.model_copy(update={"tubes": tuple(_drawn(design.tubes, preset, 2 * seed + arm))})
            for arm in range(2)
        ]
        # One pair a tube set; of each, one arm is the one that there is.
        self._pairs = [ArmPair(one) for one in designs]
        self._found = [PairKinematics(len(design.tubes)) for _ in range(2)]
        self.position, self.rotation = np.zeros((2, 3)), np.zeros((2, 3, 3))
        self.torsion = np.zeros(2 * len(design.tubes))

    def wake_at(self, q: np.ndarray) -> bool:
        """Stand at ``q`` (4n,) as tubes put together untwisted do; False where none do."""
        for pair, found in zip(self._pairs, self._found, strict=True):
            found.q[:] = q
            if pair.evaluate_cold(found) != SOLVED:
                return False
        return self.stand_at(q)

    def stand_at(self, q: np.ndarray) -> bool:
        """Follow the arms to ``q`` (4n,); a branch that ends snaps to another one.

        Returns:
            False where no solution is found at all.
        """
        n = len(self.torsion) // 2
        for arm, (pair, found) in enumerate(zip(self._pairs, self._found, strict=True)):
            found.q[:] = q
            if pair.evaluate(found, found.torsion.copy()) != SOLVED:
                if pair.evaluate_cold(found) != SOLVED:
                    return False
            self.position[arm], self.rotation[arm] = found.position[arm], found.rotation[arm]
            self.torsion[n * arm : n * (arm + 1)] = found.torsion[n * arm : n * (arm + 1)]
        return True


class TubePlant(Wireless):
    """Two simulated concentric-tube arms; the same seed gives the same arms."""

    def __init__(self, configuration: Configuration, q: np.ndarray) -> None:
        """Stand at ``q`` (4n,), both arms, m and rad."""
        design, simulation = configuration.concentric, configuration.simulation
        exact = simulation.plant == "kinematic"
        self._preset = EXACT if exact else TUBE_PRESETS[simulation.preset]
        self._tubes = len(design.tubes)
        self._period_s = 1.0 / design.rate_hz
        self.spec = PlantSpec(
            "kinematic" if exact else "tubes",
            self._actuators(),
            round(1e9 * self._period_s),
            True,
        )
        self._q, self._goal, self._measured = q.copy(), q.copy(), q.copy()
        self._step = np.where(
            self._is_rotation(), self._preset.rotation_step_rad, self._preset.translation_step_m
        )
        lag = self._preset.lag_s
        self._share = 1.0 if lag <= 0.0 else 1.0 - math.exp(-self._period_s / lag)
        self._arms = _Arms(design, self._preset, simulation.seed)
        self._stands = self._arms.wake_at(self._q)
        self._encode()

    def _actuators(self) -> tuple[Actuator, ...]:
        kinds = (("translation", "m"), ("rotation", "rad"))
        return tuple(
            Actuator(f"{arm}_{kind}{tube}", unit)
            for arm in "ab"
            for kind, unit in kinds
            for tube in range(1, self._tubes + 1)
        )

    def _is_rotation(self) -> np.ndarray:
        return np.tile(np.repeat([False, True], self._tubes), 2)

    def _encode(self) -> None:
        """What the encoders say."""
        step = self._step
        rounded = np.where(step > 0.0, np.round(self._q / np.where(step > 0.0, step, 1.0)), 0.0)
        self._measured[:] = np.where(step > 0.0, rounded * step, self._q)

    def read(self) -> Measurement:
        """Where the encoders say that the motors are."""
        return Measurement(
            self._measured,
            np.zeros(0),
            np.zeros(0),
            np.zeros((), TRACKER),
            np.zeros(0),
            event=0 if self._stands else int(Event.SIMULATION_FAILED),
        )

    def write(self, command: np.ndarray) -> None:
        """Take a (1,) command of the concentric-tube arms."""
        self._goal[:] = command["q"][0]

    def advance(self) -> int:
        """Let the motors follow for a tick, and the arms the motors."""
        if self._stands:
            self._q += self._share * (self._goal - self._q)
            self._encode()
            self._stands = self._arms.stand_at(self._q)
        return self.spec.tick_ns

    def hold(self) -> None:
        """Stay where the motors are."""
        self._goal[:] = self._q

    def release(self) -> None:
        """The motors' gears hold by themselves: the same as holding."""
        self.hold()

    def close(self) -> None:
        """There are no devices to give back."""

    def change_board(self, board: Board) -> None:
        """No board stands before these arms."""

    def register_trocar(self, position: np.ndarray) -> None:
        """There is no trocar."""

    def truth(self, truth: np.ndarray) -> bool:
        """Both arms as they stand."""
        arms, record = self._arms, truth[0]
        record["source"] = ErrorSource.TRUE
        record["q"], record["torsion"] = self._q, arms.torsion
        record["position"], record["position_b"] = arms.position
        quaternion_from_matrix(arms.rotation[0], record["wxyz"])
        quaternion_from_matrix(arms.rotation[1], record["wxyz_b"])
        return True
