"""The benchmarks measure what they say, with everything attached, in a short run."""

from __future__ import annotations

import pytest

from benchmarks import loop_lateness, sensing
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


def test_bench_sensing_finds_what_scipy_finds_and_is_faster() -> None:
    figures = sensing.measure(load(), 0.2)
    for name in ("estimate_us", "scipy_us", "paper_us"):
        assert 0.0 < figures[name]["p50"] <= figures[name]["p99"]
    assert figures["forces_apart_mn"] < 0.1
    assert figures["ratio_scipy_p50"] < 1.0
    assert (figures["estimates"], figures["turns"]) == (200, 10)
    assert figures["steps_max"] <= 10
