"""Paths are built beside the loop, the last one ordered wins, and damage ends nothing."""

from __future__ import annotations

import time

import numpy as np

from server.control_link import PathStart
from server.path_builder import BuiltPath, PathBuilder


def order(path_id: int, rows: int = 3) -> PathStart:
    samples = np.zeros((rows, 8))
    samples[:, 0], samples[:, 4] = np.arange(rows), 1.0
    return PathStart(samples, path_id)


def wait(builder: PathBuilder) -> BuiltPath:
    ends = time.monotonic() + 10.0
    while time.monotonic() < ends:
        built = builder.take()
        if built is not None:
            return built
        time.sleep(0.001)
    raise AssertionError("no path was built")


def test_a_path_is_given_once() -> None:
    builder = PathBuilder()
    builder.start(order(1))
    built = wait(builder)
    assert built.path is not None
    assert (built.path_id, built.path.duration_s) == (1, 2.0)
    assert not builder.is_waiting
    assert builder.take() is None


def test_the_last_one_ordered_wins() -> None:
    builder = PathBuilder()
    for path_id in range(1, 6):
        builder.start(order(path_id, rows=2000))
    assert wait(builder).path_id == 5


def test_a_cancelled_path_never_comes() -> None:
    builder = PathBuilder()
    builder.start(order(1))
    assert builder.is_waiting
    builder.cancel()
    time.sleep(0.05)
    assert builder.take() is None
    builder.start(order(2))
    assert wait(builder).path_id == 2


def test_damaged_samples_make_no_path() -> None:
    builder = PathBuilder()
    builder.start(PathStart(-order(1).samples, 1))
    assert wait(builder).path is None
    builder.start(order(2))
    assert wait(builder).path is not None
