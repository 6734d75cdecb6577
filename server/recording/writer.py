"""Writes a recording: every record without loss, and beside them what people plot."""

from __future__ import annotations

import struct
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from robot.configuration import Configuration
from robot.record_types import record_types_of
from robot.records import SCHEMA_VERSION
from server.recording.channels import (
    GAP_SCHEMA,
    GAPS,
    RATE_HZ,
    RECORDS,
    json_channels,
    message_bytes,
    schema_bytes,
)
from server.recording.machine import machine, versions
from server.recording.mcap_file import McapFile
from server.recording.record_type import NUMPY, describe
from server.version import version

RECORDING_VERSION = 1
"""Version of the file's layout: topics, metadata and attachments."""

METADATA = "keyhole"
CONFIGURATION = "configuration.json"
CALIBRATION = "calibration.json"

CHUNK_S = 0.25
_SYNCHRONISE_S = 2.0
_MESSAGE_OPCODE = 5
_HEAD = struct.Struct("<BQHIQQ")
_OPCODE_AND_LENGTH = 9


def _message(record: np.dtype[Any]) -> np.dtype[Any]:
    """A record as one MCAP message: packed, without padding."""
    return np.dtype(
        [
            ("opcode", "<u1"),
            ("length", "<u8"),
            ("channel", "<u2"),
            ("sequence", "<u4"),
            ("log_time", "<u8"),
            ("publish_time", "<u8"),
            ("record", record),
        ]
    )


class RecordingWriter:
    """One recording, from its first record to its last.

    A headless run uses it so::

        with RecordingWriter(path, configuration, calibration) as writer:
            while ...:
                loop.step()
                writer.append(loop.record)

    ``append`` copies what it is given, so that the loop's own record may be handed over after
    every step. What was appended is on its way to the disk a quarter of a second of ticks later;
    ``close`` (or the end of the ``with`` block, also after an error) writes the rest and the
    summary. The initial state need not be given: the first record holds it.

    Args:
        path: of the file, by custom ``*.mcap``; it must not exist. Its folder is made.
        configuration: what the recorded robot was built from, as in force (options of a run
            included).
        calibration: what it was calibrated with; None without.
        clock: ``plant`` counts times from now by the plant's own clock, as for a run that goes as
            fast as it can; ``host`` takes the times at which the records were published.
        plant: name of the plant, and board: of what stands before it, where they are not those of
            the configuration.

    Attributes:
        size: bytes written so far.
        ticks: records written or waiting to be.
        gaps: how often records are missing; ``lost``: how many are.
        duration_s: from the first record to the newest.

    Raises:
        RecordingNotWritten: the file cannot be made; later, from ``append``, ``flush`` and
            ``close``: not be continued. What was written before stays readable.
    """

    def __init__(
        self,
        path: Path | str,
        configuration: Configuration,
        calibration: BaseModel | None = None,
        *,
        clock: Literal["plant", "host"] = "plant",
        plant: str = "",
        board: str = "",
    ) -> None:
        rate_hz = configuration.rate_hz
        self._types = record_types_of(configuration)
        self._channels = json_channels(self._types.robot)
        message = _message(self._types.record)
        self.path = Path(path)
        self.ticks = self.gaps = self.lost = 0
        self._started_ns = time.time_ns()
        self._clock = clock
        self._offset_ns: int | None = None
        self._first_ns = self._last_ns = 0
        self._next_sequence: int | None = None
        self._every = max(1, round(rate_hz / RATE_HZ))
        self._pending = np.zeros(max(1, round(rate_hz * CHUNK_S)), message)
        self._pending["opcode"] = _MESSAGE_OPCODE
        self._pending["length"] = message.itemsize - _OPCODE_AND_LENGTH
        self._waiting = 0
        self._extra: list[bytes] = []
        self._extra_times: dict[int, list[tuple[int, int]]] = {}
        self._extra_size = 0
        self._synchronised = time.monotonic()
        self._closed = False
        self._file = McapFile(self.path, f"keyhole {version()}")
        simulation = configuration.simulation
        names = {"plant": plant or simulation.plant, "board": board or simulation.board}
        self._describe(configuration, calibration, names)

    def _describe(
        self, configuration: Configuration, calibration: BaseModel | None, names: dict[str, str]
    ) -> None:
        file, now_ns = self._file, self._started_ns
        file.add_metadata(
            METADATA,
            {
                "recording_version": str(RECORDING_VERSION),
                "record_schema_version": str(SCHEMA_VERSION),
                "robot": self._types.robot,
                **names,
                "configuration_hash": f"{configuration.hash64():016x}",
                "started": datetime.fromtimestamp(now_ns * 1e-9, UTC).isoformat(),
                "clock": self._clock,
                **versions(),
                **machine(),
            },
        )
        attached = {CONFIGURATION: configuration, CALIBRATION: calibration}
        for name, model in attached.items():
            if model is not None:
                content = model.model_dump_json(indent=1).encode()
                file.add_attachment(name, "application/json", content, now_ns)
        record_schema = ("keyhole.Record", NUMPY, describe(self._types.record))
        self._pending["channel"] = file.add_channel(RECORDS, NUMPY, record_schema)
        self._json = []
        for one in self._channels:
            schema = (one.schema_name, "jsonschema", schema_bytes(one.schema))
            self._json.append((file.add_channel(one.topic, "json", schema), one))
        gap_schema = ("keyhole.Gap", "jsonschema", schema_bytes(GAP_SCHEMA))
        self._gap_channel = file.add_channel(GAPS, "json", gap_schema)

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._file.size

    @property
    def duration_s(self) -> float:
        """From the first record to the newest, s."""
        return (self._last_ns - self._first_ns) * 1e-9

    def append(self, records: NDArray[Any], sequence: int | None = None) -> None:
        """Take records in, shape (n,) or (), of the robot's type, oldest first.

        Args:
            records: they are copied.
            sequence: number of the first one in the ring it comes from; a jump against the last
                one is written down as a gap. None: it follows the last one.
        """
        if len(records.reshape(-1)) == 0:
            return
        expected = self._next_sequence
        if sequence is None:
            sequence = 0 if expected is None else expected
        if expected is not None and sequence != expected:
            self._add_gap(sequence, sequence - expected)
        for record in records.reshape(-1):
            self._take(record, sequence)
            sequence += 1
        self._next_sequence = sequence

    def _take(self, record: np.void, sequence: int) -> None:
        time_ns = self._time_of(record)
        message = self._pending[self._waiting]
        message["sequence"] = sequence & 0xFFFFFFFF
        message["log_time"] = message["publish_time"] = time_ns
        message["record"] = record
        if self.ticks == 0:
            self._first_ns = time_ns
        self._last_ns = time_ns
        if self.ticks % self._every == 0:
            for channel, one in self._json:
                self._add_json(channel, sequence, time_ns, one.message(record, time_ns))
        self.ticks += 1
        self._waiting += 1
        if self._waiting == len(self._pending):
            self.flush()

    def _time_of(self, record: np.void) -> int:
        header = record["header"]
        own_ns = int(header["stamp_ns"] if self._clock == "host" else header["time_ns"])
        if self._offset_ns is None:
            here_ns = time.monotonic_ns() if self._clock == "host" else own_ns
            self._offset_ns = self._started_ns - here_ns
        # A clock that runs back would make a file in which nothing can be found by its time.
        return max(own_ns + self._offset_ns, self._last_ns)

    def _add_gap(self, sequence: int, missing: int) -> None:
        self.gaps += 1
        self.lost += max(0, missing)
        message = {"missing": missing, "next_sequence": sequence}
        self._add_json(self._gap_channel, sequence, self._last_ns, message)

    def _add_json(self, channel: int, sequence: int, time_ns: int, message: dict[str, Any]) -> None:
        data = message_bytes(message)
        head = _HEAD.pack(
            _MESSAGE_OPCODE,
            _HEAD.size - _OPCODE_AND_LENGTH + len(data),
            channel,
            sequence & 0xFFFFFFFF,
            time_ns,
            time_ns,
        )
        self._extra_times.setdefault(channel, []).append((time_ns, self._extra_size))
        self._extra.append(head + data)
        self._extra_size += len(head) + len(data)

    def flush(self) -> None:
        """Write what waits as a chunk; called often enough, a cut file lacks no more than that."""
        waiting, self._waiting = self._waiting, 0
        extra, self._extra = self._extra, []
        extra_times, self._extra_times, self._extra_size = self._extra_times, {}, 0
        if waiting:
            messages = self._pending[:waiting]
            size = messages.nbytes
            places = range(0, size, messages.dtype.itemsize)
            times = {
                int(messages["channel"][0]): list(
                    zip(messages["log_time"].tolist(), places, strict=True)
                )
            }
            for channel, entries in extra_times.items():
                times[channel] = [(stamp, size + place) for stamp, place in entries]
            self._file.add_chunk(messages.tobytes() + b"".join(extra), times)
        if time.monotonic() - self._synchronised > _SYNCHRONISE_S:
            self._file.synchronise()
            self._synchronised = time.monotonic()

    def close(self) -> None:
        """Write the rest and the summary, and close the file; closing twice is harmless."""
        if self._closed:
            return
        self._closed = True
        try:
            self.flush()
            self._file.close()
        finally:
            self._file.abandon()

    def abandon(self) -> None:
        """Close the file as it is, after it could not be continued."""
        self._closed = True
        self._file.abandon()

    def __enter__(self) -> RecordingWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
