"""The real recorder process: killed, stopped, restarted, and without a place to write to."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from robot.records import RECORD
from server.configuration_file import load
from server.memory.link_records import RECORD_RING_FILE, create_mapped_files
from server.memory.mapped import MappedRing
from server.memory.recording_link import RecordingLink, RecordingState
from server.memory.run_directory import RunDirectory
from server.recording.reader import Recording
from server.recording.verify import verify
from server.supervision.child_process import module_command, module_environment
from tests.server.console_process import eventually
from tests.server.recorded import CALIBRATION, Records, recorded_run

PATIENT_S = 60.0
RATE_HZ = load().control.rate_hz


class Publisher:
    """In place of control: publishes a run over and over into the ring, at the rate of the loop."""

    def __init__(self, folder: Path) -> None:
        # Not in the thread: its first call may have to compile the controller.
        recorded_run()
        self._ring = MappedRing(folder / RECORD_RING_FILE, RECORD, writable=True)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self.published = 0

    def push(self, count: int) -> None:
        """Publish the next records at once."""
        run = recorded_run()
        for _ in range(count):
            record = run[self.published % len(run)].copy()
            record["header"]["stamp_ns"] = time.monotonic_ns()
            self._ring.push(record)
            self.published += 1

    def _run(self) -> None:
        began, first = time.monotonic(), self.published
        while not self._stop.wait(0.01):
            due = first + round((time.monotonic() - began) * RATE_HZ)
            self.push(max(0, due - self.published))

    def __enter__(self) -> Publisher:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()


class Place:
    """A run directory without a console, in which recorders run."""

    def __init__(self, folder: Path, ring_seconds: float) -> None:
        self.folder = folder
        directory = RunDirectory(folder)
        directory.write_configuration(load())
        directory.write_calibration(CALIBRATION)
        create_mapped_files(folder, RATE_HZ, ring_seconds)
        self.link = RecordingLink(folder)
        self._processes: list[subprocess.Popen[bytes]] = []

    def recorder(self, *descriptors: int) -> subprocess.Popen[bytes]:
        """Start one, with the reading end of a lifeline if any; wait until it says it is there."""
        arguments = ["--run-directory", str(self.folder)]
        for descriptor in descriptors:
            arguments += ["--lifeline-fd", str(descriptor)]
        command = module_command("server.recording.recorder_process", arguments)
        process = subprocess.Popen(command, env=module_environment(), pass_fds=descriptors)
        self._processes.append(process)
        eventually(lambda: self.link.status().pid == process.pid, "the recorder runs", PATIENT_S)
        return process

    def start(self, path: Path) -> None:
        number = self.link.start(path)
        eventually(lambda: self.link.status().answered == number, "it has begun", PATIENT_S)

    def close(self) -> None:
        for process in self._processes:
            process.kill()
            process.wait()
        self.link.close()


@pytest.fixture
def place(tmp_path: Path) -> Iterator[Place]:
    (tmp_path / "run").mkdir()
    there = Place(tmp_path / "run", 20.0)
    yield there
    there.close()


def contents(path: Path) -> tuple[Records, list[int]]:
    with Recording(path) as recording:
        batches = list(recording.batches())
    records = np.concatenate([batch.records for batch in batches])
    return records, [number for batch in batches for number in batch.sequence.tolist()]


def are_those_published(records: Records, numbers: list[int]) -> bool:
    """Whether these are what the publisher published under these numbers, but for the stamps."""
    expected = recorded_run()[np.array(numbers) % len(recorded_run())].copy()
    expected["header"]["stamp_ns"] = records["header"]["stamp_ns"]
    return bool(expected.tobytes() == records.tobytes())


def test_a_recorder_killed_in_the_middle_loses_less_than_a_second(
    place: Place, tmp_path: Path
) -> None:
    path = tmp_path / "killed.mcap"
    recorder = place.recorder()
    with Publisher(place.folder) as publisher:
        place.start(path)
        eventually(lambda: place.link.status().ticks > 2.5 * RATE_HZ, "it records", PATIENT_S)
        recorder.kill()
        recorder.wait()
        published = publisher.published
        records, numbers = contents(path)
        lost = published - 1 - numbers[-1]
        assert lost < RATE_HZ
        assert numbers == list(range(numbers[0], numbers[-1] + 1))
        assert are_those_published(records, numbers)
        with Recording(path) as recording:
            assert recording.cut
            assert recording.calibration() == CALIBRATION
            result = verify(recording)
        assert result.differing == 0
        assert result.checked + len(result.restarts) == len(records) - 1

        # The next one goes on from the ring, so that both parts together lack nothing.
        place.recorder()
        eventually(lambda: place.link.status().ticks > RATE_HZ, "it goes on", PATIENT_S)
        number = place.link.stop()
        eventually(lambda: place.link.status().answered == number, "it has ended", PATIENT_S)
    status = place.link.status()
    assert status.path == tmp_path / "killed-2.mcap"
    assert (status.state, status.gaps) == (RecordingState.IDLE, 0)
    more, following = contents(status.path)
    assert following[0] == numbers[-1] + 1
    assert are_those_published(more, following)
    with Recording(status.path) as recording:
        assert not recording.cut
        assert recording.metadata["clock"] == "host"


def test_a_recorder_that_fell_behind_writes_down_what_is_missing(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    place = Place(tmp_path / "run", 1.0)
    try:
        recorder, publisher = place.recorder(), Publisher(place.folder)
        path = tmp_path / "slow.mcap"
        place.start(path)
        publisher.push(100)
        eventually(lambda: place.link.status().ticks == 100, "it records", PATIENT_S)
        recorder.send_signal(signal.SIGSTOP)
        publisher.push(1300)
        recorder.send_signal(signal.SIGCONT)
        eventually(lambda: place.link.status().ticks > 100, "it goes on", PATIENT_S)
        recorder.terminate()
        assert recorder.wait(PATIENT_S) == 0
        status = place.link.status()
        records, numbers = contents(path)
        missing = (numbers[-1] - numbers[0] + 1) - len(numbers)
        assert numbers[-1] == 1399
        assert missing == status.lost == 1300 - RATE_HZ
        assert status.gaps == 1
        assert are_those_published(records, numbers)
        with Recording(path) as recording:
            result = verify(recording)
        assert result.differing == 0
        assert any(f"{missing} records are missing" in told for told in result.restarts)
    finally:
        place.close()


def test_asked_before_the_first_tick_it_waits_and_has_every_tick(
    place: Place, tmp_path: Path
) -> None:
    path = tmp_path / "early.mcap"
    place.recorder()
    place.start(path)
    assert place.link.status().records
    assert not path.exists()
    # What control knows only now must be in the file.
    other = CALIBRATION.model_copy(update={"robot": "another"})
    RunDirectory(place.folder).write_calibration(other)
    Publisher(place.folder).push(40)
    eventually(lambda: place.link.status().ticks == 40, "it records", PATIENT_S)
    assert contents(path)[1] == list(range(40))
    with Recording(path) as recording:
        assert recording.calibration() == other


def test_without_a_supervisor_it_completes_the_file_and_ends(place: Place, tmp_path: Path) -> None:
    path = tmp_path / "orphan.mcap"
    reading, writing = os.pipe()
    recorder = place.recorder(reading)
    os.close(reading)
    place.start(path)
    Publisher(place.folder).push(30)
    os.close(writing)
    assert recorder.wait(PATIENT_S) == 0
    assert contents(path)[1] == list(range(30))
    with Recording(path) as recording:
        assert not recording.cut


def test_where_nothing_can_be_written_it_says_so_and_stays(place: Place, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    recorder, publisher = place.recorder(), Publisher(place.folder)
    publisher.push(1)
    place.start(tmp_path / "file" / "run.mcap")
    status = place.link.status()
    assert status.state == RecordingState.FAILED
    assert "cannot be made" in status.message
    assert not status.records
    # The next recording is not affected.
    place.start(tmp_path / "run.mcap")
    publisher.push(50)
    eventually(lambda: place.link.status().ticks == 50, "it records", PATIENT_S)
    assert place.link.status().message == ""
    assert recorder.poll() is None
    if os.geteuid() == 0:
        return
    (tmp_path / "closed").mkdir(mode=0o500)
    place.start(tmp_path / "closed" / "run.mcap")
    assert place.link.status().state == RecordingState.FAILED
