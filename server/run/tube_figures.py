"""The figures of runs of the two concentric-tube arms, as programs and people read them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robot.concentric.control import REASONS, ControlStatus
from server.run.tube_run import TubeResult, TubeTask


def _spread(values: Sequence[float]) -> dict[str, float | None]:
    """RMS, standard deviation and maximum in mm of lengths in m."""
    if not values:
        return {"rms": None, "std": None, "max": None}
    found = 1e3 * np.array(values)
    return {
        "rms": float(np.sqrt(np.mean(found**2))),
        "std": float(found.std()),
        "max": float(found.max()),
    }


def tube_document(task: TubeTask, method: str, result: TubeResult) -> dict[str, Any]:
    """One run's figures as a JSON document; lengths in mm, times as named.

    ``relative_error_mm`` and ``tracking_error_mm`` are taken when each point is left, as the paper
    has them, ``max_any_iteration`` over every inner iteration.

    Args:
        task: what was run.
        method: name of the method.
        result: what came of it.
    """
    times = np.array(result.time_ns) * 1e-6
    travelled = 1e3 * result.travelled.reshape(2, -1)
    statuses = result.statuses
    return {
        "experiment": task.experiment,
        "robot": "concentric",
        "method": method,
        "configuration": task.configuration,
        "ended": result.ended,
        "iterations": len(result.relative),
        "converged_points": sum(result.reached),
        "points": len(task.offsets),
        "unreached_points": [n for n, reached in enumerate(result.reached, 1) if not reached],
        "relative_error_mm": {
            **_spread(result.point_relative),
            "max_any_iteration": 1e3 * max(result.relative, default=0.0),
        },
        "tracking_error_mm": {
            **_spread(result.point_tracking),
            "max_any_iteration": 1e3 * max(result.tracking, default=0.0),
        },
        "bound_violation_mm": 1e3 * result.bound_violation,
        "infeasible_qps": statuses.get(ControlStatus.INFEASIBLE, 0),
        "refused_iterations": {
            REASONS[status]: statuses[status]
            for status in sorted(statuses)
            if status not in (ControlStatus.SOLVED, ControlStatus.INFEASIBLE)
        },
        "peak_rotation_rad_s": result.peak_rotation,
        "peak_translation_mm_s": 1e3 * result.peak_translation,
        "translation_mm": {"a": travelled[0].tolist(), "b": travelled[1].tolist()},
        "translation_total_mm": float(travelled.sum()),
        "stability_min": result.stability,
        "task_scale_min": result.scale,
        "iteration_ms": {
            "median": float(np.median(times)) if len(times) else None,
            "p99": float(np.percentile(times, 99)) if len(times) else None,
        },
    }


def gathered(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Several starts of one method in one document.

    Iterations, errors when a point is left, translation and median time are means over the starts,
    as in the paper's Table 3; points, infeasible QPs and refusals are sums; ``max_any_iteration``,
    violations and peaks are the worst. ``maxima`` holds the largest value of each start's errors.

    Args:
        runs: documents of :func:`tube_document`, one a start; at least one.
    """
    first = runs[0]

    def every(*path: str) -> list[Any]:
        values = []
        for run in runs:
            value: Any = run
            for key in path:
                value = value[key]
            if value is not None:
                values.append(value)
        return values

    def mean(*path: str) -> float | None:
        values = every(*path)
        return float(np.mean(values)) if values else None

    errors = {
        name: {
            **{key: mean(name, key) for key in ("rms", "std", "max")},
            "max_any_iteration": max(every(name, "max_any_iteration")),
        }
        for name in ("relative_error_mm", "tracking_error_mm")
    }
    refused: dict[str, int] = {}
    for one in every("refused_iterations"):
        for reason, count in one.items():
            refused[reason] = refused.get(reason, 0) + count
    return {
        "experiment": first["experiment"],
        "robot": "concentric",
        "method": first["method"],
        "configuration": "all",
        "ended": next((e for e in every("ended") if e != "completed"), "completed"),
        "iterations": mean("iterations"),
        "converged_points": sum(every("converged_points")),
        "points": sum(every("points")),
        **errors,
        "maxima": {
            "iterations": max(every("iterations")),
            "relative_error_mm": max(every("relative_error_mm", "max"), default=None),
            "tracking_error_mm": max(every("tracking_error_mm", "max"), default=None),
        },
        "bound_violation_mm": max(every("bound_violation_mm")),
        "infeasible_qps": sum(every("infeasible_qps")),
        "refused_iterations": refused,
        "peak_rotation_rad_s": max(every("peak_rotation_rad_s")),
        "peak_translation_mm_s": max(every("peak_translation_mm_s")),
        "translation_total_mm": mean("translation_total_mm"),
        "stability_min": min(every("stability_min")),
        "task_scale_min": min(every("task_scale_min")),
        "iteration_ms": {
            "median": mean("iteration_ms", "median"),
            "p99": max(every("iteration_ms", "p99"), default=None),
        },
        "configurations": list(runs),
    }


_HEADS = (
    ("method", 16, ""),
    ("path", 16, ""),
    ("start", 6, ""),
    ("iter", 8, ".1f"),
    ("points", 12, ""),
    ("rel max", 9, ".3f"),
    ("rel any", 9, ".3f"),
    ("trk max", 9, ".3f"),
    ("out mm", 9, ".1e"),
    ("infeas", 7, "d"),
    ("rad/s", 7, ".2f"),
    ("mm/s", 7, ".2f"),
    ("mm moved", 9, ".0f"),
)


def printed(documents: Sequence[dict[str, Any]]) -> str:
    """A table for the terminal, a method and start a row."""
    lines = ["".join(f"{head:<{width}}" for head, width, _ in _HEADS)]
    for one in documents:
        values: tuple[Any, ...] = (
            one["method"],
            one["experiment"],
            one["configuration"],
            one["iterations"],
            f"{one['converged_points']}/{one['points']}",
            one["relative_error_mm"]["max"],
            one["relative_error_mm"]["max_any_iteration"],
            one["tracking_error_mm"]["max"],
            one["bound_violation_mm"],
            one["infeasible_qps"],
            one["peak_rotation_rad_s"],
            one["peak_translation_mm_s"],
            one["translation_total_mm"],
        )
        lines.append(
            "".join(
                f"{'-' if value is None else format(value, form):<{width}}"
                for value, (_, width, form) in zip(values, _HEADS, strict=True)
            ).rstrip()
        )
        if one["ended"] != "completed":
            lines.append(f"  {one['ended']}")
        lines += [f"  {reason}: {n} times" for reason, n in one["refused_iterations"].items()]
    return "\n".join(lines)
