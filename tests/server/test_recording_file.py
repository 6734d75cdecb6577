"""The file of a recording: every bit comes back, however it ends, and Foxglove can read it."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from robot.records import RECORD
from robot.sensing.faults import SensingFault
from server.configuration_file import load
from server.recording.channels import RATE_HZ, json_channels
from server.recording.errors import NotARecording, RecordingEmpty, RecordingNotWritten
from server.recording.reader import Recording
from server.recording.record_type import describe, understand
from server.recording.writer import CHUNK_S, RecordingWriter
from tests.server.recorded import CALIBRATION, Records, recorded_run, write

CHECK: dict[str, tuple[type, ...]] = {
    "number": (int, float),
    "string": (str,),
    "integer": (int,),
    "boolean": (bool,),
    "null": (type(None),),
}


def contents(path: Path) -> Records:
    with Recording(path) as recording:
        return np.concatenate([batch.records for batch in recording.batches()])


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the run."""
    path = tmp_path_factory.mktemp("recording") / "run.mcap"
    write(path, recorded_run())
    return path


def test_every_bit_comes_back(path: Path) -> None:
    assert contents(path).tobytes() == recorded_run().tobytes()


def test_every_bit_pattern_comes_back(tmp_path: Path, rng: np.random.Generator) -> None:
    # Also what no controller makes: NaN with a payload, negative zero, huge integers.
    noise = np.frombuffer(rng.bytes(300 * RECORD.itemsize), RECORD).copy()
    noise["header"]["time_ns"] = np.arange(300) * 2_000_000
    noise["outcome"]["state"]["safety"] = noise["outcome"]["state"]["reason"] = 0
    noise["outcome"]["state"]["leader_kind"] = noise["truth"]["source"] = 0
    noise["outcome"]["report"]["estimate_fault"] = 0
    with np.errstate(all="ignore"):
        write(tmp_path / "noise.mcap", noise)
    assert contents(tmp_path / "noise.mcap").tobytes() == noise.tobytes()


def test_records_are_copied_one_by_one(tmp_path: Path) -> None:
    memory = np.zeros(1, RECORD)
    with RecordingWriter(tmp_path / "run.mcap", load()) as writer:
        for record in recorded_run():
            memory[0] = record
            writer.append(memory)
    assert contents(tmp_path / "run.mcap").tobytes() == recorded_run().tobytes()


def test_the_type_is_understood_from_its_description() -> None:
    assert understand(describe(RECORD)) == RECORD
    for nonsense in (b"", b"{}", b"[1]", b'[["a"]]', b'[["a","nothing"]]'):
        with pytest.raises(ValueError, match=r".+"):
            understand(nonsense)


def test_the_file_tells_where_it_comes_from(path: Path) -> None:
    with Recording(path) as recording:
        assert recording.configuration() == load()
        assert recording.calibration() == CALIBRATION
        assert not recording.cut
        metadata = recording.metadata
        assert recording.duration_s == pytest.approx(599 * 0.002, abs=1e-6)
    assert metadata["configuration_hash"] == f"{load().hash64():016x}"
    assert metadata["plant"] == load().simulation.plant
    assert {"keyhole", "python", "numpy", "numba", "daqp", "pin", "machine", "processor"} <= set(
        metadata
    )


def test_the_formats_own_reader_reads_it(path: Path) -> None:
    with path.open("rb") as file:
        for _ in StreamReader(file, validate_crcs=True).records:
            pass
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        topics = {channel.topic: number for number, channel in summary.channels.items()}
        assert set(topics) == {
            "/records",
            "/gaps",
            *(one.topic for one in json_channels("instrument")),
        }
        counts = summary.statistics.channel_message_counts
        assert counts[topics["/records"]] == len(recorded_run())
        messages = [
            (channel.topic, message.log_time, message.sequence)
            for _, channel, message in reader.iter_messages()
        ]
    times = [time for _, time, _ in messages]
    assert times == sorted(times)
    numbers = [number for topic, _, number in messages if topic == "/records"]
    assert numbers == list(range(len(recorded_run())))


def fits(value: Any, schema: dict[str, Any]) -> bool:
    """Whether a value is what its JSON schema says; enough of the language for ours."""
    if "enum" in schema:
        return value in schema["enum"]
    kinds = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    if kinds == ["object"]:
        properties = schema["properties"]
        return value.keys() == properties.keys() and all(
            fits(value[name], part) for name, part in properties.items()
        )
    if kinds == ["array"]:
        long = schema["minItems"] <= len(value) <= schema["maxItems"]
        return long and all(fits(part, schema["items"]) for part in value)
    return any(isinstance(value, CHECK[kind]) for kind in kinds)


def test_plots_come_fifty_times_a_second_as_their_schemas_say(path: Path) -> None:
    step = round(load().control.rate_hz / RATE_HZ)
    truth = recorded_run()["truth"][::step]
    for one in json_channels("instrument"):
        with path.open("rb") as file:
            found = [
                (schema, json.loads(message.data))
                for schema, _, message in make_reader(file).iter_messages(topics=[one.topic])
            ]
        assert len(found) == len(truth)
        for schema, message in found:
            assert schema is not None
            assert schema.encoding == "jsonschema"
            assert fits(message, json.loads(schema.data)), message
        if one.topic == "/errors":
            told = [message["position_mm"] for _, message in found]
            assert told == pytest.approx(truth["position_error"] * 1e3, abs=1e-6)
        if one.topic == "/tip/true":
            told = [message["pose"]["position"]["z"] for _, message in found]
            assert told == truth["position"][:, 2].tolist()


def test_what_is_not_a_number_is_null(tmp_path: Path) -> None:
    records = recorded_run()[:1].copy()
    records["truth"]["position_error"] = np.nan
    write(tmp_path / "nan.mcap", records)
    with (tmp_path / "nan.mcap").open("rb") as file:
        ((_, _, message),) = make_reader(file).iter_messages(topics=["/errors"])
    assert json.loads(message.data)["position_mm"] is None


def test_an_estimate_is_told_where_there_is_one(tmp_path: Path) -> None:
    records = recorded_run()[:1].copy()
    report, tick_input = records["outcome"]["report"][0], records["input"][0]
    report["estimate_fault"], report["estimate_force"] = SensingFault.NONE, (0.1, 0.0, -0.2)
    report["estimate_wxyz"] = (1.0, 0.0, 0.0, 0.0)
    tick_input["tension_cells"], tick_input["measured_tension"] = 1, (1.0, np.nan, 2.0, 3.0)
    command = records["outcome"]["command"][0]
    command["tendon_mode"], command["tension"] = (0, 1, 0, 0), (3.0, 2.5, 3.0, 3.0)
    records["truth"]["contact_wrench"] = (0.11, 0.0, -0.2, 0.0, 0.0, 0.0)

    def told(name: str) -> dict[str, Any]:
        write(tmp_path / name, records)
        with (tmp_path / name).open("rb") as file:
            found = make_reader(file).iter_messages()
            return {channel.topic: message.data for _, channel, message in found}

    valid = told("valid.mcap")
    sensing = json.loads(valid["/sensing"])
    assert (sensing["valid"], sensing["fault"]) == (True, "none")
    assert (sensing["force_n"], sensing["true_force_n"]) == ([0.1, 0.0, -0.2], [0.11, 0.0, -0.2])
    assert json.loads(valid["/forces"])["tension_n"] == [1.0, None, 2.0, 3.0]
    assert json.loads(valid["/forces"])["tension_wanted_n"] == [None, 2.5, None, None]
    assert json.loads(valid["/tip/estimated"])["pose"]["orientation"]["w"] == 1.0

    report["estimate_fault"] = SensingFault.NO_TENSION_CELLS
    tick_input["tension_cells"] = 0
    missing = told("missing.mcap")
    sensing = json.loads(missing["/sensing"])
    assert (sensing["valid"], sensing["fault"]) == (False, "no_tension_cells")
    assert sensing["force_n"] == [None] * 3
    assert json.loads(missing["/forces"])["tension_n"] == [None] * 4
    assert json.loads(missing["/tip/estimated"])["pose"]["position"]["x"] is None


def test_chunks_are_short(path: Path) -> None:
    with Recording(path) as recording:
        lengths = [(chunk.end_ns - chunk.start_ns) * 1e-9 for chunk in recording.chunks]
    assert max(lengths) <= CHUNK_S


def test_what_was_flushed_can_be_read_while_the_file_is_open(tmp_path: Path) -> None:
    path, records = tmp_path / "open.mcap", recorded_run()
    writer = RecordingWriter(path, load())
    writer.append(records[:7])
    writer.flush()
    assert contents(path).tobytes() == records[:7].tobytes()
    writer.append(records[7:9])
    writer.close()
    writer.close()
    assert contents(path).tobytes() == records[:9].tobytes()


def test_a_file_that_ends_anywhere_holds_what_stands_before(
    path: Path, tmp_path: Path, rng: np.random.Generator
) -> None:
    whole, expected = path.read_bytes(), recorded_run()
    cut_path = tmp_path / "cut.mcap"
    lengths = {0, 1, 8, len(whole) - 1, len(whole) - 30}
    lengths |= set(rng.integers(0, len(whole), 60).tolist())
    held = []
    for length in sorted(lengths):
        cut_path.write_bytes(whole[:length])
        try:
            found = contents(cut_path)
        except (RecordingEmpty, NotARecording):
            found = expected[:0]
        assert found.tobytes() == expected[: len(found)].tobytes()
        held.append(len(found))
    assert held == sorted(held)
    assert held[-1] == len(expected)


def test_what_the_system_did_not_write_is_not_believed(path: Path, tmp_path: Path) -> None:
    # After a loss of power a file may have its length and not its contents.
    with Recording(path) as recording:
        last = recording.chunks[-1]
    content = bytearray(path.read_bytes()[: last.offset + last.length])
    content[last.offset + last.length // 2 :] = bytes(last.length - last.length // 2)
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(content)
    found = contents(torn)
    assert 0 < len(found) < len(recorded_run())
    assert found.tobytes() == recorded_run()[: len(found)].tobytes()


def test_missing_records_are_written_down(tmp_path: Path) -> None:
    path, records = tmp_path / "gap.mcap", recorded_run()
    with RecordingWriter(path, load()) as writer:
        writer.append(records[:100], 1000)
        writer.append(records[130:200], 1130)
        assert (writer.ticks, writer.gaps, writer.lost) == (170, 1, 30)
    with path.open("rb") as file:
        ((_, _, message),) = make_reader(file).iter_messages(topics=["/gaps"])
    assert json.loads(message.data) == {"missing": 30, "next_sequence": 1130}
    with Recording(path) as recording:
        numbers = np.concatenate([batch.sequence for batch in recording.batches()])
    assert numbers.tolist() == [*range(1000, 1100), *range(1130, 1200)]


def test_a_file_that_exists_is_not_written_over(tmp_path: Path) -> None:
    path = tmp_path / "mine.mcap"
    path.write_text("mine")
    with pytest.raises(RecordingNotWritten, match="exists already"):
        RecordingWriter(path, load())
    assert path.read_text() == "mine"


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingNotWritten, match="cannot be made"):
        RecordingWriter(tmp_path / "file" / "run.mcap", load())


FULL = """
import sys
import numpy as np
from server.configuration_file import load
from server.recording.errors import RecordingNotWritten
from server.recording.writer import RecordingWriter
try:
    with RecordingWriter(sys.argv[1], load()) as writer:
        writer.append(np.load(sys.argv[2]))
except RecordingNotWritten as error:
    print(error)
"""


def test_a_full_disk_ends_the_recording_and_leaves_what_was_written(tmp_path: Path) -> None:
    path, records = tmp_path / "full.mcap", tmp_path / "records.npy"
    np.save(records, recorded_run())

    def allow_little() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (120_000, 120_000))

    result = subprocess.run(
        [sys.executable, "-c", FULL, str(path), str(records)],
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=allow_little,
        cwd=Path(__file__).resolve().parents[2],
    )
    assert "writing stopped" in result.stdout, result.stderr
    found = contents(path)
    assert 0 < len(found) < len(recorded_run())
    assert found.tobytes() == recorded_run()[: len(found)].tobytes()
