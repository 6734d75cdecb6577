"""A hand with a stylus that follows the arc test: makes ``arc_stylus.csv``.

No person held a stylus for that file. It is computed by the usual model of a hand that follows a
target: overlapping movements of minimum jerk, each aimed at where the target will be when it ends
and missing a little in proportion to its length, with a physiological tremor of 8 to 11 Hz on top.

    python -m scenes.experiments.stylus_model FILE.toml > scenes/experiments/arc_stylus.csv
"""

from __future__ import annotations

import math
import sys
import tomllib

import numpy as np

from robot.configuration import Configuration, parse
from scenes.experiments.bending import DURATION_S, sweep
from scenes.experiments.timing import minimum_jerk

HEADER = "time_s,u_deg,v_deg"

_RATE_HZ = 40.0
_EVERY_S, _LASTING_S = 0.3, 0.8
"""A movement begins this often and lasts this long."""
_MISSES = 0.05
"""Of a movement's length, standard deviation in each direction."""
_TREMOR_RAD = math.radians(0.15)
_TREMOR_HZ = (8.3, 9.7, 10.9)
_QUIET_S = 0.5
"""The hand holds still at the start; tremor comes up over this time."""
_SEED = 52


def recording(configuration: Configuration) -> np.ndarray:
    """Rows (n, 3) of time in s, u and v in rad, as the hand asks for them."""
    generator = np.random.default_rng(_SEED)
    instants = np.arange(round(DURATION_S * _RATE_HZ) + 1) / _RATE_HZ
    target = sweep(configuration, np.array([0.0]))[0]
    uv = np.tile(target, (len(instants), 1))
    for begin in np.arange(0.0, DURATION_S - _LASTING_S, _EVERY_S):
        seen = sweep(configuration, np.array([begin + _LASTING_S]))[0]
        step = seen - target
        missed = np.linalg.norm(step) * _MISSES * generator.standard_normal(2)
        uv += minimum_jerk((instants - begin) / _LASTING_S)[:, None] * (step + missed)
        target = seen + missed
    phases = generator.uniform(0.0, 2.0 * math.pi, (2, len(_TREMOR_HZ)))
    for axis in range(2):
        waves = [
            np.sin(2.0 * math.pi * hertz * instants + phase)
            for hertz, phase in zip(_TREMOR_HZ, phases[axis], strict=True)
        ]
        uv[:, axis] += _TREMOR_RAD * minimum_jerk(instants / _QUIET_S) * np.mean(waves, axis=0)
    return np.column_stack([instants, uv])


def csv_text(rows: np.ndarray) -> str:
    """The rows as the file holds them, in degrees."""
    lines = [
        "# A synthetic recording: computed by scenes/experiments/stylus_model.py, not a person's.",
        "# Bend of the segment that the stylus asks for, in the start's plane of bending.",
        HEADER,
    ]
    angles = np.column_stack([rows[:, 0], np.degrees(rows[:, 1:])])
    lines += [f"{t:.3f},{u:z.3f},{v:z.3f}" for t, u, v in angles]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        settings = parse(tomllib.load(file), sys.argv[1])
    sys.stdout.write(csv_text(recording(settings)))
