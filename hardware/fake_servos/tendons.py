"""What four servos pull on: tendons that can be slack or stretch, and a segment that bends.

Turning a spool toward larger angles pays its tendon out. A tendon pulls only when it is taut, with
its stretch times its stiffness; two that pull against each other bend the segment until they, its
own stiffness and the stop of its disks are in balance. Mass and friction of the tendons are left
out. Signs and places of the tendons as in ``robot/tendons.py``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_BACKBONE_MODULUS_PA = 60e9
_BACKBONE_DIAMETER_M = 0.4e-3
_TENDON_STIFFNESS_N_M = 7554.0
"""EA / L of a 0.23 mm NiTi wire of 0.33 m."""
_STOP_RAD = math.radians(110.0)
"""Where the disks touch; the bend goes hardly any further."""
_STOP_STIFFNESS_NM_RAD = 5.0
_SETTLED = 1e-12


@dataclass(frozen=True)
class SegmentShape:
    """Dimensions of what the servos pull on, SI.

    Attributes:
        pitch_radius_m: from the backbone to a tendon.
        pulley_radius_m: of a spool.
        length_m: of the segment.
        tendon_stiffness_n_m: of one tendon, spool to tip.
    """

    pitch_radius_m: float = 0.0018
    pulley_radius_m: float = 0.0054
    length_m: float = 0.030
    tendon_stiffness_n_m: float = _TENDON_STIFFNESS_N_M

    @property
    def bending_stiffness_nm_rad(self) -> float:
        """Of the backbone alone."""
        area_moment = math.pi * _BACKBONE_DIAMETER_M**4 / 64.0
        return _BACKBONE_MODULUS_PA * area_moment / self.length_m


class Segment:
    """Balance of one segment under its four tendons.

    Attributes:
        u: bend in rad toward the first tendon.
        v: bend in rad toward the fourth tendon.
        tensions_n: four, never negative.
    """

    def __init__(self, shape: SegmentShape) -> None:
        self.shape = shape
        self.u = 0.0
        self.v = 0.0
        self.tensions_n = [0.0] * 4

    def settle(self, spools_rad: list[float], slack_m: list[float]) -> None:
        """Find the balance for these spools.

        Args:
            spools_rad: four angles; larger ones pay out.
            slack_m: of each tendon while its spool is at 0 and the segment is straight.
        """
        radius = self.shape.pulley_radius_m
        loose = [radius * spool + slack for spool, slack in zip(spools_rad, slack_m, strict=True)]
        self.u = self._bend(self.u, loose[0], loose[2])
        self.v = self._bend(self.v, loose[3], loose[1])
        pitch, stiffness = self.shape.pitch_radius_m, self.shape.tendon_stiffness_n_m
        shorter = (pitch * self.u, -pitch * self.v, -pitch * self.u, pitch * self.v)
        self.tensions_n = [
            stiffness * max(0.0, -loosened - short)
            for loosened, short in zip(loose, shorter, strict=True)
        ]

    def _bend(self, start: float, toward: float, away: float) -> float:
        """Bend in one plane between a tendon that bends ``toward`` + and one that bends ``away``.

        The moment falls monotonically with the bend and has few corners, so Newton's steps end.
        """
        pitch, stiffness = self.shape.pitch_radius_m, self.shape.tendon_stiffness_n_m
        own = self.shape.bending_stiffness_nm_rad
        bend = start
        for _ in range(12):
            moment, slope = -own * bend, own
            stretch = -toward - pitch * bend
            if stretch > 0.0:
                moment += stiffness * pitch * stretch
                slope += stiffness * pitch**2
            stretch = -away + pitch * bend
            if stretch > 0.0:
                moment -= stiffness * pitch * stretch
                slope += stiffness * pitch**2
            if abs(bend) > _STOP_RAD:
                moment -= _STOP_STIFFNESS_NM_RAD * (bend - math.copysign(_STOP_RAD, bend))
                slope += _STOP_STIFFNESS_NM_RAD
            change = moment / slope
            bend += change
            if abs(change) < _SETTLED:
                break
        return bend
