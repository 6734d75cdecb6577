"""The unit as a whole: its four modules, what they pull on, their noise, and what is broken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hardware.tension_unit.module import (
    CYCLE_S,
    MODULES,
    STATE,
    UnitFault,
    drive_unit,
    rest,
    unit_constants,
)
from robot.tension_unit_design import TensionUnit


class SimulatedUnit:
    """Four modules at rest under their load, teeth in contact.

    Args:
        design: the table ``[tension_unit]``.
        generator: draws offsets, gains and noise.
        tendon_stiffness: of each tendon or of all, N/m.
        tendon_length: of the straight segment, m.
        pretension: N.
        spring: on every pulley, N m/rad, where there are no tendons.

    Attributes:
        constants: (1,) ``module.CONSTANTS``.
        state: (1,) ``module.STATE``.
        zero: (4,) angles of the pulleys by the encoders at rest, rad.
    """

    def __init__(
        self,
        design: TensionUnit,
        generator: np.random.Generator,
        tendon_stiffness: np.ndarray | float = 0.0,
        tendon_length: np.ndarray | float = 0.0,
        pretension: np.ndarray | float = 0.0,
        spring: float = 0.0,
    ) -> None:
        self.constants = unit_constants(
            design, generator, tendon_stiffness, tendon_length, pretension, spring
        )
        self.state = np.zeros(1, STATE)
        rest(self.state, self.constants, np.zeros(MODULES))
        self.zero = self.state["wanted"][0].copy()
        self._straight = self.constants["tendon_length"][0].copy()
        self._generator = generator

    def break_module(self, module: int, fault: UnitFault) -> None:
        """Break ``module`` (0 to 3) from the next cycle on; ``UnitFault.NONE`` mends it."""
        self.state["fault"][0, module] = fault

    def cycle(
        self, modes: Sequence[int], wanted: np.ndarray, length: np.ndarray | None = None
    ) -> None:
        """Let one cycle of 1 ms pass.

        Args:
            modes: (4,) ``POSITION``, ``TORQUE`` or ``CURRENT``.
            wanted: (4,) rad or N m, see ``module.drive_unit``; negative winds up.
            length: (4,) of the routed tendons in m, as an instrument's shape has them; None for the
                straight segment's.
        """
        noise = self._generator.normal(size=(2, MODULES))
        routed = self._straight if length is None else length
        drive_unit(self.state, self.constants, np.asarray(modes), wanted, routed, CYCLE_S, noise)

    @property
    def tension(self) -> np.ndarray:
        """(4,) N, by the cells; T = torque / r (paper 3, II-B). NaN without a reading."""
        return np.asarray(-self.state["cell"][0] / self.constants["radius"][0])

    @property
    def true_tension(self) -> np.ndarray:
        """(4,) N, what the loads pull with."""
        return np.asarray(self.state["load"][0] / self.constants["radius"][0])

    @property
    def wound(self) -> np.ndarray:
        """(4,) rad from rest by the encoders, positive where a tendon is wound up."""
        return np.asarray(self.zero - self.state["seen"][0] / self.constants["ratio"][0])

    @property
    def winding_speed(self) -> np.ndarray:
        """(4,) rad/s by the encoders, positive where a tendon is wound up."""
        return np.asarray(-self.state["seen_speed"][0] / self.constants["ratio"][0])
