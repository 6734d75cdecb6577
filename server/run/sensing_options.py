"""What a run of shape and force sensing is asked to do."""

from __future__ import annotations

from dataclasses import dataclass

from hardware.rod.pose_noise import SensorNoise
from scenes.experiments.sensing import check_name

POSITION_NOISE_MM, ANGLE_NOISE_DEG = 0.1, 0.25
TENSION_NOISE_N = 0.02
"""Standard deviation of a tension: of a torque cell over the pulley radius, 0.2 mN m over 10 mm. A
cell that reads with 1.5 mN m at 1 kHz takes means over 60 ms for it."""
LENGTH_NOISE_MM = 0.01
"""Standard deviation of a tendon's length in the segment."""
FRICTION = 0.15
SEED = 1
SAMPLES = 100
TRIALS = 500
MEAN_OF = 20
"""How many samples a mean is taken of."""
READINGS = 10
"""Readings that are averaged at each stop of a programme, as the segment stands still there."""
SPREAD = 0.05
"""Relative standard deviation of a rod's stiffness and friction around the nominal ones."""
FRICTION_MAX, NOISE_MAX_MM, NOISE_MAX_DEG, TENSION_MAX_N = 0.4, 1.0, 2.0, 0.5
SAMPLES_MAX, TRIALS_MAX = 10_000, 100_000


@dataclass(frozen=True)
class SensingOptions:
    """What to run.

    Attributes:
        experiment: its name.
        position_mm: standard deviation of each coordinate of the measured tip.
        angle_deg: of its orientation about each axis.
        friction: nominal coefficient of the tendons in the disks.
        seed: draws the rod, its calibration and every measurement.
        samples: measurements of each bend or level.
        trials: of ``coverage``.
        tension_n: standard deviation of each measured tension.
    """

    experiment: str
    position_mm: float = POSITION_NOISE_MM
    angle_deg: float = ANGLE_NOISE_DEG
    friction: float = FRICTION
    seed: int = SEED
    samples: int = SAMPLES
    trials: int = TRIALS
    tension_n: float = TENSION_NOISE_N

    def __post_init__(self) -> None:
        """Refuse a name that does not exist."""
        check_name(self.experiment)

    @property
    def noise(self) -> SensorNoise:
        """Of every sensor."""
        return SensorNoise(self.position_mm, self.angle_deg, self.tension_n, LENGTH_NOISE_MM)
