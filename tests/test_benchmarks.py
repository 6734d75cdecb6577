"""The loop benchmark measures what it says, with everything attached, in a short run."""

from __future__ import annotations

import pytest

from benchmarks import loop_lateness
from server.configuration_file import load


def test_bench_loop_compares_the_loops(monkeypatch: pytest.MonkeyPatch, chromium: str) -> None:
    monkeypatch.setenv("KEYHOLE_CHROMIUM", chromium)
    monkeypatch.setattr(loop_lateness, "ROUNDS", 1)
    monkeypatch.setattr(loop_lateness, "CLIENTS", 5)
    figures = loop_lateness.measure(load(), 1.0)
    for condition in ("idle", "loaded"):
        for loop in ("reference", "console"):
            found = figures[condition][loop]
            assert 0.0 <= found["p50"] <= found["p99"] <= found["p99_9"] <= found["max"]
            assert found["ticks"] + found["lost_ticks"] == pytest.approx(500, abs=60)
    assert figures["load"]["clients"] == 5
    assert figures["load"]["browser"].startswith("chromium")
    assert figures["load"]["messages_per_client_per_s"] > 0
