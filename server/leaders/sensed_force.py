"""The contact force that the instrument senses, on the hand that leads it.

The estimate of the tick (force of the environment on the tip, base frame) is turned into the
stylus' frame, scaled, and goes through the passivity guard at the stylus' port. What is rendered is
what is known: along the axes of its covariance a component fades where its standard deviation comes
near its size, and one that was hardly learned about is left out. While the estimate is not valid
the force fades to zero.
"""

from __future__ import annotations

import math

import numpy as np

from robot.configuration import Configuration, Stylus
from robot.passivity import PassivityGuard
from robot.sensing.faults import SensingFault
from server.leaders.control_view import ControlView
from server.leaders.force import SpringForce
from server.leaders.led_stylus import NO_FORCE, Force, LedStylus, StylusForce

FADE_S = 0.1
"""How long the force takes to fade, and to come back."""
_SMOOTHING_S = 0.02
_LARGEST_STEP_S = 0.05
_SURE = 2.0
"""A component this many standard deviations large, or less, is not rendered."""
_LEARNED = 0.5
"""An axis whose standard deviation is this share of what was expected beforehand is left out."""


def make_force(configuration: Configuration, view: ControlView) -> StylusForce:
    """What ``[stylus] force_source`` asks for."""
    stylus = configuration.stylus
    has_estimate = "estimate_force" in (view.record["outcome"]["report"].dtype.names or ())
    if stylus.force_source == "sensed" and has_estimate:
        return SensedForce(stylus, view, configuration.sensing.force_expected_n)
    return SpringForce(stylus, view)


def known_part(force: np.ndarray, covariance: np.ndarray, expected: float) -> np.ndarray:
    """What of a force is known well enough to be felt, (3,) N.

    Args:
        force: (3,) N.
        covariance: (3, 3) N^2.
        expected: standard deviation of the forces that were expected beforehand, N.
    """
    values, axes = np.linalg.eigh(covariance)
    deviations = np.sqrt(np.maximum(values, 0.0))
    along = axes.T @ force
    sure = 1.0 - (_SURE * deviations / np.maximum(np.abs(along), 1e-12)) ** 2
    share = np.where(deviations < _LEARNED * expected, np.maximum(sure, 0.0), 0.0)
    return np.asarray(axes @ (share * along))


class SensedForce:
    """Computes the force of one stylus.

    Args:
        configuration: the section ``[stylus]``.
        view: of the control process, of a robot that senses.
        expected: standard deviation of the forces that the estimate expects beforehand, N.
    """

    def __init__(self, configuration: Stylus, view: ControlView, expected: float) -> None:
        self._scale, self._expected = configuration.force_scale, expected
        self._guard = PassivityGuard(
            configuration.force_limit_n,
            configuration.force_damping_n_s_m,
            configuration.force_delay_ms * 1e-3,
            configuration.pose_resolution_mm * 1e-3,
        )
        # After such a silence the force has been taken away, which the guard does not see.
        self._longest_s = min(_LARGEST_STEP_S, configuration.timeout_ms * 1e-3)
        self._led = LedStylus(view)
        report = self._led.outcome["report"]
        self._force, self._covariance = (
            report["estimate_force"],
            report["estimate_force_covariance"],
        )
        self._fault = view.record["outcome"]["report"]["estimate_fault"]
        self._smoothed, self._validity, self._then_ns = np.zeros(3), 0.0, 0

    @property
    def is_engaged(self) -> bool:
        """Whether the stylus leads, as of the view's last update."""
        return self._led.is_engaged

    @property
    def held_back(self) -> float:
        """Share of the force that the guard took away at last."""
        return self._guard.held_back

    def at(self, position: Force, now_ns: int) -> Force:
        """The force in N, in the stylus' frame, on a stylus at ``position`` (m, the same frame)."""
        share = self._led.onset(now_ns)
        dt = (now_ns - self._then_ns) * 1e-9
        self._then_ns = now_ns
        if not self.is_engaged or not 0.0 < dt < self._longest_s:
            self._guard.reset()
            self._smoothed[:], self._validity = 0.0, 0.0
            return NO_FORCE
        self._follow(dt)
        if self._validity == 0.0:
            self._guard.reset()
            return NO_FORCE
        x, y, z = (
            share * self._validity * self._scale * (self._led.turn.T @ self._smoothed)
        ).tolist()
        return self._guard.step(position, (x, y, z), dt)

    def _follow(self, dt: float) -> None:
        """Smooth the known part of the estimate; without one, let what is there fade."""
        valid = self._fault[0] == SensingFault.NONE
        if valid:
            known = known_part(self._force, self._covariance, self._expected)
            if np.isfinite(known).all():
                self._smoothed += (1.0 - math.exp(-dt / _SMOOTHING_S)) * (known - self._smoothed)
        step = dt / FADE_S
        self._validity = (
            min(1.0, self._validity + step) if valid else max(0.0, self._validity - step)
        )
