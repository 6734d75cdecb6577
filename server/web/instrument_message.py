"""What the state message tells of the instrument beside what all robots share. Pure."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.configuration import Configuration
from robot.parameters import parameters
from robot.priority.levels import CASE_NAMES
from robot.priority.limits import describe
from robot.records import LAMBDA, Case, Compensation, Coordinates, Solver
from robot.sensing.faults import SensingFault
from robot.tension.feasibility import CONTROL_NAMES
from scenes.boards.board import BOARD_NAMES, board
from server.web.devices_view import clearance_view
from server.web.sensing_view import measured_tension, sensing_view
from server.web.state_message import (
    StateMessages,
    Surroundings,
    degrees,
    error_source,
    millimetres,
    rounded,
)
from server.web.tendons_view import tendons_view

CASES = {case: name for name, case in CASE_NAMES.items()}
SOLVERS = {solver: solver.name.lower().replace("_", "-") for solver in Solver}
COORDINATES = {coordinates: coordinates.name.lower() for coordinates in Coordinates}
COMPENSATIONS = {mode: mode.name.lower() for mode in Compensation}


class InstrumentMessages(StateMessages):
    """Makes state messages of the instrument.

    Args:
        configuration: of the robot whose records come.
    """

    CONFIGURED = (
        *StateMessages.CONFIGURED,
        *("priority", "bend_limit_deg", "joint_limits_deg", "compensation", "tracker", "sensing"),
        *("tendons", "actuation"),
    )

    def __init__(self, configuration: Configuration) -> None:
        super().__init__(configuration)
        self._unknown["outcome"]["report"]["estimate_fault"] = SensingFault.OFF
        self._parameters = parameters(configuration)
        self._limits = configuration.limits
        self._boards: dict[str, tuple[int, bool]] = {}
        lower, upper = self._parameters["joint_lower"][0], self._parameters["joint_upper"][0]
        self._joint_limits = [
            list(pair) for pair in zip(degrees(lower), degrees(upper), strict=True)
        ]

    def _set_configured(self, settings: NDArray[Any]) -> None:
        priority = self._configuration.priority
        settings["case"] = CASE_NAMES[priority.case]
        settings["solver"] = next(s for s, name in SOLVERS.items() if name == priority.solver)
        settings["coordinates"] = Coordinates[priority.coordinates.upper()]
        settings["compensation"] = Compensation[self._configuration.compensation.mode.upper()]
        settings["use_tracker"] = self._configuration.tracker.enabled
        settings["sensing"] = self._configuration.sensing.enabled
        settings["tendon_control"] = CONTROL_NAMES[self._configuration.tendons.control]
        settings["co_contraction"] = self._configuration.tendons.co_contraction_n

    def load(self) -> None:
        """Find out about every board."""
        for name in BOARD_NAMES:
            self._board(name)

    def _board(self, name: str) -> tuple[int, bool]:
        """How many rings the board of that name has, and whether it has a ball."""
        if name not in BOARD_NAMES:
            return 0, False
        if name not in self._boards:
            found = board(name, self._configuration)
            self._boards[name] = len(found.rings), found.ball is not None
        return self._boards[name]

    def _own(self, record: np.void, around: Surroundings) -> dict[str, Any]:
        tick_input, truth = record["input"], record["truth"]
        state, report = record["outcome"]["state"], record["outcome"]["report"]
        return {
            "priority": _priority(tick_input["settings"]),
            "errors": {
                "position_mm": rounded(truth["position_error"] * 1e3, 6),
                "orientation_deg": rounded(math.degrees(truth["orientation_error"]), 6),
                "rcm_mm": rounded(truth["rcm_error"] * 1e3, 6),
                "source": error_source(truth),
            },
            **self._configuration_of(record),
            "trocar_mm": millimetres(tick_input["trocar_position"]),
            "trocar": _trocar(around),
            "clearance": clearance_view(state, self._limits.clearance_mm * 1e-3),
            "compensation": COMPENSATIONS[
                Compensation(int(tick_input["settings"]["compensation"]))
            ],
            "tracker": _tracker(tick_input, state),
            "tension_n": measured_tension(tick_input),
            "sensing": sensing_view(record, around, self._configuration.sensing),
            "tendons": tendons_view(record, self._configuration),
            "actuation": self._configuration.simulation.actuation
            if around.plant == "physics"
            else None,
            "board": around.board,
            **self._touched(record, around.board),
            "residuals": {
                "rcm_mm_s": rounded(report["residual_rcm"] * 1e3, 4),
                "linear_mm_s": rounded(report["residual_linear"] * 1e3, 4),
                "angular_deg_s": rounded(math.degrees(report["residual_angular"]), 4),
            },
            "limits": describe(int(report["limits_active"]), report["x"], self._parameters),
        }

    def _touched(self, record: np.void, name: str) -> dict[str, Any]:
        """Contact, and what has been done on the board of that name."""
        truth, tick_input = record["truth"], record["input"]
        allowed = max(self._limits.contact_force_n, record["outcome"]["state"]["contact_allowance"])
        rings, has_ball = self._board(name)
        return {
            "contact": {
                "count": int(truth["contact_count"]),
                "force_n": rounded(tick_input["measured_contact"], 4),
                "limit_n": rounded(allowed, 4),
            },
            "rings": {
                "passed": int(truth["rings_passed"]).bit_count(),
                "touched": int(truth["rings_touched"]).bit_count(),
                "total": rings,
            }
            if rings
            else None,
            "ball": {"progress": rounded(truth["ball_progress"], 4)} if has_ball else None,
        }

    def _configuration_of(self, record: np.void) -> dict[str, Any]:
        """Joints, bend and lambda as commanded, with their limits."""
        command, report = record["outcome"]["command"], record["outcome"]["report"]
        x = report["x"]
        return {
            "lambda": {
                "value": rounded(x[LAMBDA], 6),
                "reference": rounded(record["input"]["settings"]["lambda_reference"], 6),
                "min": self._limits.lambda_min,
                "max": self._limits.lambda_max,
            },
            "bend_deg": rounded(90.0 - math.degrees(report["theta"]), 5),
            "bend_limit_deg": self._limits.bend_deg,
            "direction_deg": rounded(math.degrees(report["delta"]), 5),
            "joints_deg": degrees(x[:7]),
            "joint_limits_deg": self._joint_limits,
            "servos_deg": degrees(command["servo"]),
        }


def _trocar(around: Surroundings) -> dict[str, Any]:
    breathing = around.breathing
    return {
        "method": around.trocar_source,
        "breathing_amplitude_mm": rounded(breathing.amplitude_m * 1e3, 6),
        "breathing_period_s": rounded(breathing.period_s, 6),
    }


def _tracker(tick_input: np.void, state: np.void) -> dict[str, Any]:
    """Whether the tracker is listened to, and by how much the tip is corrected for it."""
    position, rotation = state["correction_position"], state["correction_rotation"]
    seen = tick_input["tracker"]["sequence"] > 0
    return {
        "on": bool(tick_input["settings"]["use_tracker"]),
        "age_ms": rounded(tick_input["tracker"]["age_s"] * 1e3, 3) if seen else None,
        "correction_mm": rounded(float(np.linalg.norm(position)) * 1e3, 4),
        "correction_deg": rounded(math.degrees(float(np.linalg.norm(rotation))), 4),
    }


def _priority(settings: np.void) -> dict[str, str]:
    return {
        "case": CASES[Case(int(settings["case"]))],
        "solver": SOLVERS[Solver(int(settings["solver"]))],
        "coordinates": COORDINATES[Coordinates(int(settings["coordinates"]))],
    }
