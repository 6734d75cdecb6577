"""A short soak on simulated servos and stylus: the long one is ``keyhole soak``."""

from __future__ import annotations

import json

from server.configuration_file import load
from server.faults.soak import printed, run

SECONDS = 8.0


def test_nothing_is_lost_while_one_thing_after_the_other_breaks() -> None:
    document = run(SECONDS, seed=3, configuration=load())
    checks = document["checks"]
    assert checks.pop("drives_at_the_end"), document
    assert all(checks.values()), document
    assert document["faults_injected"] > 0
    assert {one["process"] for one in document["memory"]} >= {"control", "web", "leader"}
    json.dumps(document, allow_nan=False)
    assert "faults in" in printed(document)
