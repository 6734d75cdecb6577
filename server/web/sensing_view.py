"""What the state message tells of shape and force as they are sensed. Pure."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.records import ErrorSource
from robot.sensing.design import Sensing
from robot.sensing.faults import REASONS
from server.sensed_force import ForceAxes, fault_of, force_axes
from server.web.state_message import Surroundings, each, pose, rounded

_NO_FORCE = ForceAxes(*(np.empty((0, 3)), np.empty(0), np.empty(0), np.empty(0, bool)))


def measured_tension(tick_input: np.void) -> list[float | None]:
    """Tension of the four tendons, N; null of a robot that measures none, and of a dead cell."""
    if not tick_input["tension_cells"]:
        return [None] * len(tick_input["measured_tension"])
    return each(tick_input["measured_tension"], 3)


def sensing_view(record: np.void, around: Surroundings, section: Sensing) -> dict[str, Any]:
    """Shape and force as estimated, how well they are known, and the truth where it is known.

    Args:
        record: of the instrument.
        around: an estimate without a control process that runs is none.
        section: what the estimate was made with.
    """
    tick_input, report = record["input"], record["outcome"]["report"]
    fault = fault_of(report)
    code, (reason, action) = fault.name.lower(), REASONS[fault]
    if around.control != "running":
        code, action = f"control_{around.control}", "wait"
        reason = around.control_words or f"control is {around.control}"
    valid = code == "none"
    axes = _NO_FORCE
    if valid:
        force, covariance = report["estimate_force"], report["estimate_force_covariance"]
        axes = force_axes(force, covariance, section.force_expected_n)
    known = axes.known(3)
    return {
        "enabled": bool(tick_input["settings"]["sensing"]),
        "valid": valid,
        "fault": code,
        "reason": reason,
        "action": action,
        "force_n": _or_nulls(report["estimate_force"], valid),
        "magnitude_n": rounded(known[0], 4) if valid else None,
        "deviation_n": rounded(known[1], 4) if valid else None,
        "expected_n": section.force_expected_n,
        "axes": _axes(axes),
        "true_force_n": _or_nulls(record["truth"]["contact_wrench"][:3], _is_true(record, around)),
        "tip": _tip(report, valid),
        "cells": bool(tick_input["tension_cells"]),
        "tension_n": _or_nulls(report["estimate_tension"], valid, 3),
        "tension_full_scale_n": section.tension_full_scale_n,
    }


def _is_true(record: np.void, around: Surroundings) -> bool:
    """Whether the record tells the forces that truly act: the kinematic robot feels none."""
    return bool(record["truth"]["source"] == ErrorSource.TRUE) and around.plant == "physics"


def _or_nulls(values: NDArray[Any], known: bool, digits: int = 4) -> list[float | None]:
    return each(values, digits) if known else [None] * len(values)


def _tip(report: np.void, valid: bool) -> dict[str, Any]:
    nothing = {"position_mm": [None] * 3, "orientation_wxyz": [None] * 4}
    return pose(report["estimate_position"], report["estimate_wxyz"]) if valid else nothing


def _axes(axes: ForceAxes) -> list[dict[str, Any]]:
    """The best known first."""
    return [
        {
            "direction": each(direction, 4),
            "component_n": rounded(component, 4),
            "deviation_n": rounded(deviation, 4),
            "observable": bool(observable),
        }
        for direction, component, deviation, observable in zip(*axes, strict=True)
    ]
