"""The figures of a headless run, as programs and people read them."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from robot.configuration import Configuration
from robot.rotations import logarithm, matrix_from_quaternion
from robot.segment import tip_rotation
from robot.sensing.faults import SensingFault
from scenes.boards.board import board
from server.run.headless import DETAIL_COLUMNS, RunResult
from server.run.options import RunOptions

_AROUND_MARK_S = 0.5
_FELT_N = 0.05
"""No force below this is compared with its estimate."""
_DETAIL = {name: place for place, name in enumerate(DETAIL_COLUMNS)}


def _summary(values: np.ndarray, factor: float) -> dict[str, float | None]:
    if len(values) == 0:
        return {"max": None, "rms": None, "final": None}
    return {
        "max": float(values.max() * factor),
        "rms": float(np.sqrt(np.mean(values**2)) * factor),
        "final": float(values[-1] * factor),
    }


def _largest(values: np.ndarray) -> float:
    return float(values.max()) if len(values) else 0.0


def result_document(
    configuration: Configuration, options: RunOptions, result: RunResult
) -> dict[str, Any]:
    """The run's figures as a JSON document; lengths in mm, angles in degrees, times as named.

    Args:
        configuration: the one in force, with the options in it (``HeadlessRun.configuration``).
        options: what was run.
        result: what came of it.
    """
    steps = len(result.trace)
    reference = configuration.priority.lambda_reference
    bend = np.degrees(0.5 * math.pi - result.trace[:, 8])
    lambdas = np.abs(result.trace[:, 10] - reference)
    ticks = result.tick_ns * 1e-3
    document: dict[str, Any] = {
        "experiment": options.experiment,
        "case": options.case,
        "solver": options.solver,
        "coordinates": options.coordinates,
        "plant": configuration.simulation.plant,
        "preset": configuration.simulation.preset,
        "seed": configuration.simulation.seed,
        "board": configuration.simulation.board,
        "tracker": configuration.tracker.enabled,
        "compensation": configuration.compensation.mode,
        "actuation": configuration.simulation.actuation,
        "tendons": {
            "control": configuration.tendons.control,
            "co_contraction_n": configuration.tendons.co_contraction_n,
        },
        "steps": steps,
        "dt_s": 1.0 / configuration.control.rate_hz,
        "duration_s": float(result.trace[-1, 0]) if steps else 0.0,
        "ended": result.ended,
        "errors": {
            "position_mm": _summary(result.errors[:, 0], 1e3),
            "orientation_deg": _summary(result.errors[:, 1], 180.0 / math.pi),
            "rcm_mm": _summary(result.errors[:, 2], 1e3),
        },
        "lambda": {
            "reference": reference,
            "max_abs_error": float(lambdas.max()) if steps else None,
        },
        "bend_deg": {"max": float(bend.max()) if steps else None},
        "limits": {
            "violations": result.violations,
            "true_violations": result.true_violations,
            "held_back": result.limits,
        },
        **_touched(configuration, result.detail),
        "sensing": _felt(options, result),
        "tick_us": {
            "p50": float(np.percentile(ticks, 50)) if steps else None,
            "p99": float(np.percentile(ticks, 99)) if steps else None,
        },
        "realtime_factor": result.realtime_factor,
        "configuration_hash": f"{configuration.hash64():016x}",
    }
    if options.lock_arm and steps:
        document["bend"] = _bend_errors(options, result)
    return document


def _touched(configuration: Configuration, detail: np.ndarray) -> dict[str, Any]:
    """What became of contacts, rings and ball."""
    contacts = detail[:, _DETAIL["contact_count"]] > 0.0
    began = int(np.count_nonzero(np.diff(contacts.astype(int), prepend=0) == 1))
    passed, touched = (
        int(_largest(detail[:, _DETAIL[name]])) for name in ("rings_passed", "rings_touched")
    )
    progress = detail[:, _DETAIL["ball_progress"]]
    return {
        "contact": {"count": began, "max_force_n": _largest(detail[:, _DETAIL["contact_force_n"]])},
        "rings": {
            "passed": passed.bit_count(),
            "touched": touched.bit_count(),
            "count": len(board(configuration.simulation.board, configuration).rings),
        },
        "ball": {"progress": float(progress[-1]) if len(progress) else 0.0},
    }


def _felt(options: RunOptions, result: RunResult) -> dict[str, Any]:
    """How the estimated contact force stands to the true one, at the marks of the experiment.

    At each mark both are averaged over a second around it; the axis is that of the true force.
    """
    valid = result.detail[:, _DETAIL["sensing_fault"]] == SensingFault.NONE
    first = _DETAIL["true_x_n"]
    true, estimated = result.detail[:, first : first + 3], result.detail[:, first + 3 : first + 6]
    levels = []
    for mark in options.marks:
        near = valid & (np.abs(result.trace[:, 0] - mark) < _AROUND_MARK_S)
        pushed = true[near].mean(axis=0) if near.any() else np.zeros(3)
        size = float(np.linalg.norm(pushed))
        if size < _FELT_N:
            continue
        on_axis = float(estimated[near].mean(axis=0) @ pushed) / size
        error = 100.0 * (on_axis / size - 1.0)
        levels.append({"true_n": size, "estimated_n": on_axis, "error_percent": error})
    return {
        "valid_percent": 100.0 * float(valid.mean()) if len(valid) else None,
        "levels": levels,
        "largest_error_percent": max((abs(one["error_percent"]) for one in levels), default=None),
    }


def desired_bend(detail: np.ndarray, desired_wxyz: np.ndarray) -> np.ndarray:
    """The segment's coordinates (n, 2), rad, that the desired orientation asks of a locked arm.

    Args:
        detail: (n, 21) rows with ``DETAIL_COLUMNS``; the first tells how the shaft is turned.
        desired_wxyz: (n, 4) desired tip orientations.
    """
    first = detail[0]
    commanded, local = np.empty((3, 3)), np.empty((3, 3))
    matrix_from_quaternion(np.ascontiguousarray(first[8:12]), commanded)
    tip_rotation(first[12], first[13], local)
    shaft = commanded @ local.T
    uv, turn, desired = np.empty((len(detail), 2)), np.empty(3), np.empty((3, 3))
    for row, wxyz in zip(uv, np.ascontiguousarray(desired_wxyz), strict=True):
        matrix_from_quaternion(wxyz, desired)
        logarithm(shaft.T @ desired, turn)
        row[:] = turn[1], turn[0]
    return uv


def bend_errors(
    true: np.ndarray, desired: np.ndarray, turning: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Errors of bend and of direction (n,), rad: desired minus true.

    While the bend moves its error counts along the direction that is desired, with its sign, so
    that passing through the straight segment is nothing special.

    Args:
        true: (n, 2) coordinates (u, v) of the segment, rad.
        desired: (n, 2) desired ones.
        turning: (n,) whether the direction is what moves; elsewhere its error is 0.
    """
    size = np.linalg.norm(desired, axis=1)
    unit = desired / np.maximum(size, 1e-9)[:, None]
    along = np.sum(true * unit, axis=1)
    across = true[:, 1] * unit[:, 0] - true[:, 0] * unit[:, 1]
    reached = np.where(turning, np.linalg.norm(true, axis=1), along)
    return size - reached, np.where(turning, -np.arctan2(across, along), 0.0)


def _bend_errors(options: RunOptions, result: RunResult) -> dict[str, Any]:
    phi, delta = 0.5 * math.pi - result.trace[:, 8], result.trace[:, 9]
    true = np.column_stack([phi * np.cos(delta), phi * np.sin(delta)])
    desired = desired_bend(result.detail, result.trace[:, 21:25])
    begins = options.marks[0] if options.marks else 0.0
    turning = result.trace[:, 0] >= begins
    theta, direction = np.degrees(bend_errors(true, desired, turning))
    return {
        "theta_deg": _extremes(theta),
        "direction_deg": _extremes(direction[turning]),
    }


def _extremes(values: np.ndarray) -> dict[str, float | None]:
    summary = _summary(np.abs(values), 1.0)
    return {"max": summary["max"], "rms": summary["rms"]}
