"""Median and 99th percentile: what every measurement of time here tells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def percentiles(nanoseconds: Sequence[int] | np.ndarray) -> dict[str, float]:
    """Median and 99th percentile in microseconds."""
    values = np.asarray(nanoseconds) * 1e-3
    return {"p50": float(np.percentile(values, 50)), "p99": float(np.percentile(values, 99))}
