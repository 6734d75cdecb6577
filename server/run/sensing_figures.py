"""The figures of shape and force sensing runs, as programs and people read them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from scenes.experiments.sensing import PULL_RELEASE
from server.run.sensing_coverage import (
    DIRECTIONS,
    CoverageResult,
    inside_axis_free,
    inside_axis_known,
    widths,
)
from server.run.sensing_options import MEAN_OF, READINGS, SensingOptions
from server.run.sensing_run import Case, SensingResult
from server.run.sensing_tension import pair_figures

POLYNOMIAL, CONSTANT = "polynomial_curvature", "constant_curvature"
WAYS = ("axis_known", "without_moment", "equation_43")
"""How paper 3's balance is closed."""


def spread(values: np.ndarray, factor: float = 1.0) -> dict[str, float]:
    """RMS, mean and largest of values that are not negative."""
    found = np.ravel(values) * factor
    return {
        "rms": float(np.sqrt(np.mean(found**2))),
        "mean": float(found.mean()),
        "max": float(found.max()),
    }


def _shape(cases: Sequence[Case], method: str) -> dict[str, Any]:
    """Errors of shape along the segment, over samples and cases."""
    off = np.concatenate([one.samples.position_errors[method].ravel() for one in cases])
    turned = np.concatenate([one.samples.angle_errors[method].ravel() for one in cases])
    return {
        "shape_error_mm": spread(off, 1e3),
        "angle_error_deg": spread(turned, 180.0 / math.pi),
    }


def _force(cases: Sequence[Case], name: str) -> dict[str, Any]:
    """Errors of a force over samples and cases; along the contact's axis where there is one."""
    vector = np.concatenate([one.samples.force_distance(name) for one in cases])
    found: dict[str, Any] = {"vector_error_n": spread(vector)}
    if any(one.samples.axis is None for one in cases):
        return found
    along = [one.samples.force_along(name) for one in cases]
    true = [float(np.linalg.norm(one.samples.true_force)) for one in cases]
    found["force_error_n"] = spread(np.abs(np.concatenate(along)))
    shares = [np.abs(errors) / force for errors, force in zip(along, true, strict=True)]
    found["force_error_percent"] = spread(np.concatenate(shares), 100.0)
    means = [one.samples.means_along(name) for one in cases]
    if all(len(errors) > 0 for errors in means):
        shares = [np.abs(errors) / force for errors, force in zip(means, true, strict=True)]
        found[f"mean_of_{MEAN_OF}"] = {
            "force_error_n": spread(np.abs(np.concatenate(means))),
            "force_error_percent": spread(np.concatenate(shares), 100.0),
        }
    return found


def _planar(cases: Sequence[Case], method: str) -> dict[str, Any]:
    """Paper 3's way with a polynomial or constant curvature: shape, and force in three ways."""
    ways = [way for way in WAYS if f"{method}_{way}" in cases[0].samples.forces]
    found = _shape(cases, method)
    found["force"] = {way: _force(cases, f"{method}_{way}") for way in ways}
    return found


def _common(options: SensingOptions) -> dict[str, Any]:
    noise = options.noise
    return {
        "experiment": options.experiment,
        "robot": "rod",
        "seed": options.seed,
        "friction": options.friction,
        "noise": {
            "position_mm": noise.position_mm,
            "angle_deg": noise.angle_deg,
            "tension_n": noise.tension_n,
            "length_mm": noise.length_mm,
        },
        "readings_a_stop": READINGS,
    }


def _times(nanoseconds: np.ndarray) -> dict[str, float]:
    return {f"p{share}": float(np.percentile(nanoseconds, share)) * 1e-3 for share in (50, 99)}


def _calibrated(result: SensingResult) -> dict[str, Any]:
    fit, true = result.calibrated.fit, result.properties
    off = fit.friction - true.friction
    return {
        "stiffness": fit.stiffness,
        "stiffness_unit": "N m^2",
        "stiffness_deviation_percent": 100.0 * fit.stiffness_deviation,
        "stiffness_error_percent": 100.0 * (fit.stiffness / true.bending_stiffness_n_m2 - 1.0),
        "friction": fit.friction,
        "friction_deviation_percent": 100.0 * fit.friction_deviation,
        "friction_error_percent": 100.0 * off / true.friction if true.friction > 0.0 else None,
        "coulomb_n": fit.coulomb,
        "residual_mm": 1e3 * fit.residual,
        "stops": int(np.count_nonzero(result.calibrated.used)),
    }


def sensing_document(options: SensingOptions, result: SensingResult) -> dict[str, Any]:
    """One run's figures as a JSON document; lengths in mm, angles in degrees, forces in N.

    Shape errors are distances along the segment over all samples, those at the top of ``ours``
    without knowing the contact. ``force_error_n`` and ``force_error_percent`` at the top are of
    ours with the contact's axis known, from one sample, along the axis, each level's in percent of
    its own force; in free bending they are of ours altogether, beside a force of zero.

    Args:
        options: what was run.
        result: what came of it.
    """
    cases = result.cases
    names = cases[0].samples.forces
    contact = "ours_axis_known" in names
    forces = {name.removeprefix("ours_"): _force(cases, name) for name in names if "ours" in name}
    top = forces["axis_known"] if contact else forces["axis_free"]
    document: dict[str, Any] = {
        **_common(options),
        "samples": len(cases[0].samples.nanoseconds) // 2,
        "ended": result.ended,
        "true": {
            "stiffness": result.properties.bending_stiffness_n_m2,
            "friction": result.properties.friction,
        },
        "calibrated": _calibrated(result),
        **_shape(cases, "ours"),
        "force_error_n": top["force_error_n"] if contact else top["vector_error_n"],
        "force_error_percent": top["force_error_percent"] if contact else {"rms": None},
        f"mean_of_{MEAN_OF}": top.get(f"mean_of_{MEAN_OF}"),
        "force": forces,
    }
    known = "axis_known" if contact else "no_contact"
    document[known] = _shape(cases, f"ours_{known}")
    document[POLYNOMIAL] = _planar(cases, "polynomial")
    document[CONSTANT] = _planar(cases, "constant")
    document[CONSTANT]["with_lengths"] = _shape(cases, "constant_with_lengths")
    if options.experiment == PULL_RELEASE:
        document["pairs"] = pair_figures(result)
    else:
        document["levels" if contact else "bends"] = [_row(one) for one in cases]
    document["estimate_us"] = _times(np.concatenate([one.samples.nanoseconds for one in cases]))
    return document


def _row(case: Case) -> dict[str, Any]:
    """One level or bend."""
    samples = case.samples
    row: dict[str, Any] = {
        "name": case.words,
        "bend_deg": case.bend_deg,
        "pull_n": case.pull_n,
        "shape_error_mm": {
            method: spread(errors, 1e3) for method, errors in samples.position_errors.items()
        },
    }
    if samples.axis is None:
        row["force_n"] = {name: spread(samples.force_distance(name)) for name in samples.forces}
        return row
    axis = samples.axis
    row["true_n"] = float(samples.true_force @ axis)
    row["force_n"] = {
        name: {
            "mean": float((found @ axis).mean()),
            "std": float((found @ axis).std()),
            "error_rms": float(np.sqrt(np.mean(samples.force_along(name) ** 2))),
        }
        for name, found in samples.forces.items()
    }
    row["inside_percent"] = {
        name.removeprefix("ours_"): 100.0 * float(samples.inside(name).mean())
        for name in samples.covariances
    }
    return row


def coverage_document(options: SensingOptions, result: CoverageResult) -> dict[str, Any]:
    """The figures of ``coverage``: shares inside of the 95 % regions and how wide these are."""
    known, free = widths(result)
    errors, _ = np.array(result.known).T
    off = np.array(result.errors)
    shares = np.abs(errors) / np.array(result.true)
    return {
        **_common(options),
        "trials": len(result.true),
        "ended": result.ended,
        "force_error_n": spread(np.abs(errors)),
        "force_error_percent": spread(shares, 100.0),
        "axis_known": {
            "inside": int(np.count_nonzero(inside_axis_known(result))),
            "inside_percent": 100.0 * float(inside_axis_known(result).mean()),
            "width_ratio": known,
        },
        "axis_free": {
            "inside": int(np.count_nonzero(inside_axis_free(result))),
            "inside_percent": 100.0 * float(inside_axis_free(result).mean()),
            "width_ratio": {
                name: float(value) for name, value in zip(DIRECTIONS, free, strict=True)
            },
            "width_ratio_max": float(free.max()),
            "error_n": {
                name: spread(np.abs(off[:, place])) for place, name in enumerate(DIRECTIONS)
            },
        },
        "estimate_us": _times(np.array(result.nanoseconds)),
    }
