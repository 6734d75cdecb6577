"""``keyhole run`` on the boards and of the arc: reachable, and nothing is in the way."""

from __future__ import annotations

import functools

import numpy as np
import pytest

from scenes.boards.board import board
from scenes.boards.clearance import distances, instrument_axis
from scenes.experiments import experiment
from server.run.figures import result_document
from server.run.headless import HeadlessRun
from server.run.options import options_for
from tests import own_kinematics
from tests.server import headless
from tests.server.headless import Run

EVERY = 100
"""Of the ticks one is looked at: 0.2 s."""
CLEAR_OF = {"square": 0.0035, "silicon-sine": 0.0015, "silicon-arc": 0.001, "ring-board": 0.0013}
"""What is left at least between instrument and board, m; in a ring 1.75 mm is all there is."""


@functools.cache
def run(name: str, case: str) -> Run:
    """An experiment on its board and the kinematic plant."""
    under = headless.configuration()
    options = options_for(experiment(name, under), under, case, plant="kinematic")
    one = HeadlessRun(under, options)
    result = one.execute(lambda _: None, lambda: False)
    return Run(result, result_document(one.configuration, options, result))


@pytest.mark.parametrize("case", ["1", "2"])
@pytest.mark.parametrize("name", ["silicon-sine", "silicon-arc", "ring-board"])
def test_the_boards_can_be_worked_on(name: str, case: str) -> None:
    one = run(name, case)
    assert one.document["ended"] == "completed"
    assert one.largest("position_mm") <= 0.01
    assert one.largest("orientation_deg") <= 0.01
    assert one.largest("rcm_mm") <= 0.001
    assert one.document["limits"] == {"violations": 0, "true_violations": 0, "held_back": {}}
    assert one.document["bend_deg"]["max"] < 80.0


@pytest.mark.parametrize("name", ["arc", "arc-stylus"])
def test_the_segment_alone_follows_the_arc(name: str) -> None:
    one = run(name, "0")
    assert one.document["ended"] == "completed"
    assert one.largest("position_mm") <= 0.01
    assert one.largest("orientation_deg") <= 0.01
    assert one.document["limits"]["violations"] == 0
    np.testing.assert_allclose(one.joints, one.joints[:1].repeat(len(one.joints), 0), atol=1e-12)


def axis_at(row: np.ndarray) -> np.ndarray:
    """The instrument's axis (n, 3) at a row of the trace, by the tests' own kinematics."""
    under = headless.configuration()
    where = own_kinematics.pose(under, row[1:8], row[8], row[9])
    _, bend = own_kinematics.segment(row[8], row[9], under.instrument.segment_length_m)
    phi = 0.5 * np.pi - row[8]
    uv = phi * np.array([np.cos(row[9]), np.sin(row[9])])
    return instrument_axis(
        under.instrument, where.shaft_base, where.shaft_end, where.rotation @ bend.T, uv
    )


@pytest.mark.parametrize("name", CLEAR_OF)
def test_the_instrument_touches_nothing_on_its_way(name: str) -> None:
    under = headless.configuration()
    one = run(name, "1") if name != "square" else headless.named("square")
    radius = 0.5 * under.instrument.disk_diameter_m
    solids = board(experiment(name, under).board, under).solids
    for row in one.result.trace[::EVERY]:
        axis = axis_at(row)
        nearest = min(distances(solid, axis).min() for solid in solids)
        assert nearest - radius > CLEAR_OF[name], f"at {row[0]:.2f} s"


@pytest.mark.parametrize("name", ["circle", "circle-yz"])
@pytest.mark.parametrize("other", ["pegboard", "silicon-sine", "silicon-arc", "ring-board"])
def test_what_needs_no_board_may_be_played_before_any(name: str, other: str) -> None:
    under = headless.configuration()
    assert not experiment(name, under).needs_room
    radius = 0.5 * under.instrument.disk_diameter_m
    solids = board(other, under).solids
    for row in headless.named(name).result.trace[:: 5 * EVERY]:
        axis = axis_at(row)
        assert min(distances(solid, axis).min() for solid in solids) - radius > 0.001
