"""What plots need of the sensing runs, as arrays by name."""

from __future__ import annotations

import io

import numpy as np

from scenes.experiments.sensing import PULL_RELEASE
from server.run.sensing_coverage import CoverageResult
from server.run.sensing_options import SensingOptions
from server.run.sensing_run import SensingResult
from server.run.sensing_tension import DIRECTIONS, pair_sweeps


def sensing_arrays(options: SensingOptions, result: SensingResult) -> dict[str, np.ndarray]:
    """Arrays of a run.

    For case ``i`` (a bend or a level): ``case{i}.fractions`` (n,), ``case{i}.true`` (n, 3) in m,
    and by method ``case{i}.shape.{method}`` (n, 3), of the first measurement, ``case{i}.off.`` and
    ``case{i}.turned.`` (n,), rms over the measurements in m and rad. Of ``pull-release``, for pair
    ``i``: ``pair{i}.bends``, ``.pulled``, ``.released``, ``.pulling``, ``.slides`` (n,), and
    ``.line.pulling``, ``.line.releasing`` (2, k), bends and tensions that the calibration gives.

    Args:
        options: what was run.
        result: what came of it.
    """
    found: dict[str, np.ndarray] = {}
    if options.experiment == PULL_RELEASE:
        for place, pair in enumerate(pair_sweeps(result)):
            for name in ("bends", "pulled", "released", "pulling", "slides"):
                found[f"pair{place}.{name}"] = np.asarray(getattr(pair, name))
            for name in DIRECTIONS:
                found[f"pair{place}.line.{name}"] = np.array(pair.lines[name])
        return found
    for place, case in enumerate(result.cases):
        own, samples = f"case{place}", case.samples
        found[f"{own}.fractions"] = samples.fractions
        found[f"{own}.true"] = samples.true.positions
        for method, shape in samples.shown.items():
            off, turned = samples.position_errors[method], samples.angle_errors[method]
            found[f"{own}.shape.{method}"] = shape.positions
            found[f"{own}.off.{method}"] = np.sqrt(np.mean(off**2, axis=0))
            found[f"{own}.turned.{method}"] = np.sqrt(np.mean(turned**2, axis=0))
    return found


def coverage_arrays(result: CoverageResult) -> dict[str, np.ndarray]:
    """The fields of a :class:`CoverageResult` with a row a trial."""
    return {
        name: np.array(getattr(result, name)) for name in ("true", "known", "errors", "covariances")
    } | {"nanoseconds": np.array(result.nanoseconds, dtype=float)}


def coverage_of(parts: list[dict[str, np.ndarray]]) -> CoverageResult:
    """All trials of several runs together, from their :func:`coverage_arrays`."""
    result = CoverageResult()
    for part in parts:
        result.true += part["true"].tolist()
        result.known += [(error, variance) for error, variance in part["known"].tolist()]
        result.errors += list(part["errors"])
        result.covariances += list(part["covariances"])
        result.nanoseconds += part["nanoseconds"].astype(int).tolist()
    return result


def packed(arrays: dict[str, np.ndarray]) -> bytes:
    """The arrays as a compressed ``.npz``; equal ones give equal bytes."""
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()
