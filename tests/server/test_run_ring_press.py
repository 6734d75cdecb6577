"""Pressed against a ring of the physics plant, the estimated force is the simulator's."""

from __future__ import annotations

from dataclasses import replace

import pytest

from scenes.experiments import experiment
from server.configuration_file import load
from server.run.figures import result_document
from server.run.headless import HeadlessRun
from server.run.options import cut, options_for


def test_contact_forces_on_a_ring_are_felt_within_a_fifth() -> None:
    configuration = load(None)
    press = experiment("ring-press", configuration)
    options = options_for(press, configuration, "1", actuation="tension-unit")
    # Four of the five levels; the last one would only take longer.
    options = replace(options, path=cut(options.path, press.marks[3] + 0.5))
    run = HeadlessRun(configuration, options)
    result = run.execute(lambda _: None, lambda: False)
    document = result_document(run.configuration, options, result)
    assert document["ended"] == "completed"
    felt = document["sensing"]
    assert felt["valid_percent"] > 99.0
    levels = felt["levels"]
    assert [level["true_n"] for level in levels] == pytest.approx(
        [0.11, 0.19, 0.28, 0.38], abs=0.05
    )
    for level in levels:
        assert level["estimated_n"] == pytest.approx(level["true_n"], rel=0.2), level
