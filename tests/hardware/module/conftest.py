"""One module with its simulated servos for all tests that leave them usable."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from robot.records import Readiness
from tests.hardware.module.bench import Bench, bench


@pytest.fixture(scope="package")
def shared() -> Iterator[Bench]:
    with bench() as made:
        made.until(lambda reading: reading.readiness == Readiness.NOT_HOMED)
        yield made


@pytest.fixture
def homed(shared: Bench) -> Bench:
    """Homed, without faults, at rest."""
    shared.ready()
    return shared
