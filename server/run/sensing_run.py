"""Shape and force sensing on the simulated rod, headless: a calibration, then measurements."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from hardware.rod.properties import RodProperties
from hardware.rod.rod import RodShape
from scenes.experiments.sensing import (
    FORCE_LEVELS,
    FREE_BENDS,
    LEVEL_PULLS_N,
    PAIRS,
    PRETENSION_N,
    PULL_RELEASE,
    PullStop,
)
from server.run.sensing_calibration import Calibrated, calibrate, read_stops
from server.run.sensing_methods import Methods
from server.run.sensing_options import SensingOptions
from server.run.sensing_rod import Stop, bend_of, drawn_properties, pressed, pulled_to, swept
from server.run.sensing_samples import SampleSet, fractions_of, sampled

Progress = Callable[[float], None]
Interrupted = Callable[[], bool]


class Case(NamedTuple):
    """One bend, level or stop of an experiment, and what came of it.

    Attributes:
        words: what it is.
        bend_deg: true bend of the tip.
        pull_n: pull beyond the pretension; of force levels beyond touching.
        samples: what was measured and estimated there.
    """

    words: str
    bend_deg: float
    pull_n: float
    samples: SampleSet


@dataclass
class SensingResult:
    """What came of a run.

    Attributes:
        properties: of the rod, which no estimator knew.
        calibrated: what they knew.
        programme: of the calibration sweep.
        cases: bend by bend, level by level or stop by stop.
        ended: ``completed`` or ``interrupted``.
    """

    properties: RodProperties
    calibrated: Calibrated
    programme: list[PullStop]
    cases: list[Case] = field(default_factory=list)
    ended: str = "completed"


class _Planned(NamedTuple):
    """Where the rod stands and what the estimators know of it."""

    words: str
    stop: Stop
    sliding: np.ndarray
    axis: np.ndarray | None
    pull: float


def run_sensing(
    options: SensingOptions, progress: Progress, interrupted: Interrupted
) -> SensingResult:
    """Draw a rod, calibrate it by a sweep of its own, and do the experiment.

    Args:
        options: what to run: ``pull-release``, ``shape-free`` or ``force-levels``.
        progress: called with the share done.
        interrupted: asked between measurements whether to stop.

    Raises:
        SweepUnusable: the sweep does not show stiffness and friction.
        BendNotReached: no pull bends the rod as far as the experiment wants.
        EstimateNotSettled: an estimate did not settle.
        ImpossiblePose: noise took a pose further than any bend goes.
    """
    rng = np.random.default_rng(options.seed)
    properties = drawn_properties(options.friction, rng)
    sweep = swept(properties)
    calibrated = calibrate(sweep, options.noise, rng)
    result = SensingResult(properties, calibrated, [stop for stop, _ in sweep])
    if options.experiment == PULL_RELEASE:
        plan, count = _stops_of(sweep, calibrated), 1
    elif options.experiment == FORCE_LEVELS:
        plan, count = _levels_of(properties, options, rng), options.samples
    else:
        plan, count = _bends_of(properties, options, rng), options.samples
    methods = Methods(calibrated, options.noise, fractions_of(plan[0].stop))
    for place, one in enumerate(plan, 1):
        samples = sampled(
            one.stop, one.sliding, one.axis, methods, options.noise, count, rng, interrupted
        )
        bend_deg = float(np.degrees(bend_of(one.stop.shape)))
        result.cases.append(Case(one.words, bend_deg, one.pull, samples))
        progress(place / len(plan))
        if interrupted():
            result.ended = "interrupted"
            break
    return result


def _stops_of(sweep: list[tuple[PullStop, RodShape]], calibrated: Calibrated) -> list[_Planned]:
    """Every stop of the sweep, measured once more with a pose."""
    return [
        _Planned(
            f"{PAIRS[stop.pair].words}, {'pulling' if stop.pulling else 'releasing'}",
            Stop(stop.tensions, shape),
            sliding,
            None,
            float(stop.tensions.max()) - PRETENSION_N,
        )
        for (stop, shape), sliding in zip(sweep, calibrated.readings.sliding, strict=True)
    ]


def _bends_of(
    properties: RodProperties, options: SensingOptions, rng: np.random.Generator
) -> list[_Planned]:
    """The free bends, each approached from the straight rod."""
    found = []
    for bend in FREE_BENDS:
        approach = pulled_to(properties, bend)
        sliding = _followed(approach.stops, options, rng)[-1]
        found.append(_Planned(bend.words(), approach.stops[-1], sliding, None, approach.pull))
    return found


def _levels_of(
    properties: RodProperties, options: SensingOptions, rng: np.random.Generator
) -> list[_Planned]:
    """The five levels, one after the other on the same platform."""
    levels = pressed(properties)
    sliding = _followed([*levels.way, *levels.levels], options, rng)[len(levels.way) :]
    return [
        _Planned(f"level {number}", stop, shares, levels.normal, pull)
        for number, (stop, shares, pull) in enumerate(
            zip(levels.levels, sliding, LEVEL_PULLS_N, strict=True), 1
        )
    ]


def _followed(stops: list[Stop], options: SensingOptions, rng: np.random.Generator) -> np.ndarray:
    """(n, 4) sliding shares as the estimator follows them along the stops."""
    tensions, shapes = [one.tensions for one in stops], [one.shape for one in stops]
    return read_stops(tensions, shapes, options.noise, rng).sliding
