"""What the state message tells of the tendons' drives. Pure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robot.configuration import Configuration
from robot.tension.feasibility import bending_stiffness, largest_co_contraction
from robot.tension.records import TendonControl, TendonMode
from server.web.state_message import rounded

CONTROLS = {control: control.name.lower() for control in TendonControl}
MODES = {mode: mode.name.lower() for mode in TendonMode}


def tendons_view(record: np.void, configuration: Configuration) -> dict[str, Any]:
    """What each tendon's drive holds, and how stiff the bend is by it.

    Args:
        record: of the instrument.
        configuration: of the robot.
    """
    tick_input, command = record["input"], record["outcome"]["command"]
    settings, modes = tick_input["settings"], command["tendon_mode"]
    control = TendonControl(int(settings["tendon_control"]))
    tensions = tick_input["measured_tension"]
    known = bool(tick_input["tension_cells"]) and bool(np.isfinite(tensions).all())
    stiffness = [math.nan, math.nan]
    if known:
        stiffness = list(np.diagonal(bending_stiffness(configuration, modes, tensions)))
    return {
        "control": CONTROLS[control],
        "co_contraction_n": rounded(settings["co_contraction"], 4),
        "largest_co_contraction_n": rounded(largest_co_contraction(configuration)[0], 4),
        "holds": [MODES[TendonMode(int(mode))] for mode in modes],
        "wanted_n": [
            rounded(tension, 3) if mode == TendonMode.TENSION else None
            for mode, tension in zip(modes, command["tension"], strict=True)
        ],
        "stiffness_mnm_rad": [rounded(1e3 * value, 3) for value in stiffness],
    }
