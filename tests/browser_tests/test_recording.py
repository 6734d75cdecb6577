"""Recording by the button, and the recording shown again with the time slider."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Browser, expect

from server.recording.reader import Recording
from server.recording.verify import verify
from tests.browser_tests.conftest import VIEWPORT, Complaints
from tests.browser_tests.console_page import SLOW_S, ConsolePage
from tests.browser_tests.test_page import layout_faults
from tests.server.console_process import ConsoleProcess, eventually
from tests.server.recorded import recorded_run, write


def test_the_button_records_a_session_that_verifies(
    operator: ConsolePage, console: ConsoleProcess
) -> None:
    page = operator.page
    operator.button("Start recording").click()
    stop = operator.button("Stop recording")
    expect(stop).to_have_attribute("aria-pressed", "true", timeout=SLOW_S * 1e3)
    eventually(lambda: operator.shown()["recording"], "the state says so", SLOW_S)
    expect(page.locator("#recording")).to_contain_text("● 0:0")

    def lead() -> None:
        with operator.pulling(0, 4.0):
            eventually(lambda: operator.leading()["engaged"], "the gizmo leads", SLOW_S)

    operator.despite_stalls(lead)
    path = Path(console.call("GET", "/api/v1/robots/instrument/recording")["file"])
    page.keyboard.press("l")
    eventually(lambda: not operator.shown()["recording"], "it has ended", SLOW_S)
    expect(operator.button("Start recording")).to_have_attribute("aria-pressed", "false")
    with Recording(path) as recording:
        assert not recording.cut
        result = verify(recording)
        assert any(
            batch.records["outcome"]["state"]["engaged"].any() for batch in recording.batches()
        )
    assert result.checked > 0
    assert result.differing == 0


@pytest.fixture
def replay(browser: Browser, tmp_path: Path) -> Iterator[ConsolePage]:
    """A console that shows the run of the tests, and its page."""
    path = tmp_path / "run.mcap"
    write(path, recorded_run())
    with ConsoleProcess(tmp_path, command=("replay", str(path))) as shown:
        shown.wait_until_running()
        context = browser.new_context(viewport=VIEWPORT)  # type: ignore[arg-type]
        complaints = Complaints(shown.base)
        complaints.watch(context)
        yield ConsolePage(context, shown)
        context.close()
    assert not complaints.found


def test_a_replay_follows_the_slider_and_moves_nothing(replay: ConsolePage) -> None:
    page, console = replay.page, replay.console
    expect(page.locator("#safety-state")).to_have_text("REPLAY", timeout=SLOW_S * 1e3)
    expect(page.locator("#watcher-note")).to_have_text("This is a replay: nothing moves.")
    page.set_viewport_size({"width": 1280, "height": 800})
    assert not layout_faults(page)
    for name in ("Enable", "Pause", "Play path", "Take control", "Start recording"):
        expect(page.get_by_role("button", name=name)).to_have_attribute("aria-disabled", "true")
    slider = page.get_by_role("slider", name="Time in the recording")
    for time_s, words in ((1.1, "0:01.1"), (0.4, "0:00.4")):
        slider.fill(str(time_s))
        eventually(lambda: console.state()["replay"]["time_s"] == time_s, "it is there", SLOW_S)  # noqa: B023
        record = recorded_run()[round(time_s / 0.002)]
        tip = f"{record['truth']['position'][0] * 1e3:.2f}"
        expect(page.locator("#tip-true-x")).to_have_text(tip, timeout=SLOW_S * 1e3)
        expect(slider).to_have_attribute("aria-valuetext", f"{words} / 0:01.2")
    page.keyboard.press("k")
    eventually(
        lambda: (
            console.state()["replay"]["time_s"] > 1.19 and not replay.shown()["replay"]["playing"]
        ),
        "it has played to the end",
        SLOW_S,
    )
    eventually(lambda: float(slider.input_value()) > 1.18, "the slider is there too", SLOW_S)
    page.keyboard.press("Escape")
    expect(page.get_by_role("alert").filter(has_text="nothing moves")).to_be_visible(
        timeout=SLOW_S * 1e3
    )
