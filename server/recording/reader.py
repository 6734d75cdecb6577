"""Reads a recording, whole or cut off, chunk by chunk."""

from __future__ import annotations

import io
import json
import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema
from numpy.typing import NDArray
from pydantic import ValidationError

from robot.calibration import Calibration, CalibrationRefused, parse_calibration
from robot.configuration import Configuration
from robot.record_types import record_types_of
from robot.records import SCHEMA_VERSION, RecordTypes
from server.recording.channels import RECORDS
from server.recording.errors import (
    NotARecording,
    RecordingConfiguration,
    RecordingEmpty,
    RecordingUnreadable,
    RecordingVersion,
)
from server.recording.mcap_file import COMPRESSION, MAGIC
from server.recording.record_type import NUMPY, understand
from server.recording.writer import CALIBRATION, CONFIGURATION, METADATA

_PREFIX = struct.Struct("<BQ")
_CHUNK_HEAD = struct.Struct("<QQQII")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_LARGEST_CHUNK = 1 << 28
_OPCODES = frozenset(int(opcode) for opcode in Opcode)
_DESCRIPTIONS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.ATTACHMENT)


class ChunkPlace(NamedTuple):
    """Where a chunk stands, from when to when it reaches (ns), and how to check it."""

    offset: int
    length: int
    start_ns: int
    end_ns: int
    size: int
    crc: int
    compression: str


class Batch(NamedTuple):
    """Neighbouring records: their numbers (n,), times in ns (n,), and themselves (n,)."""

    sequence: NDArray[np.int64]
    time_ns: NDArray[np.int64]
    records: NDArray[Any]


class Recording:
    """A recording, open for reading.

    A file that was cut off reads like any other, up to its last whole chunk.

    Args:
        path: of the file.

    Attributes:
        path: of the file.
        metadata: versions, machine, start and plant, as the writer put them down.
        attachments: files in it (``configuration.json``, ``calibration.json``), by name.
        chunks: where its records are.
        types: of the recorded robot.
        cut: whether it ends without its summary.
        start_ns: time of the first record, ns since 1970; ``duration_s``: from it to the last.

    Raises:
        RecordingUnreadable: it cannot be opened or is damaged.
        NotARecording: it is something else.
        RecordingVersion: its records have another form.
        RecordingEmpty: it holds no ticks.
        RecordingConfiguration: its configuration is not one that this version knows.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        self.chunks: list[ChunkPlace] = []
        self.cut = True
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[str, Channel] = {}
        try:
            self._file: BinaryIO = self.path.open("rb")
        except OSError as error:
            detail = f"cannot be opened: {error.strerror}"
            raise RecordingUnreadable(self.path, detail) from None
        try:
            self._scan()
            self._check()
        except BaseException:
            self._file.close()
            raise

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # Finding what is there

    def _scan(self) -> None:
        """Go over the file's records, without reading what the chunks hold."""
        file = self._file
        try:
            size = os.fstat(file.fileno()).st_size
            magic = file.read(len(MAGIC))
        except OSError as error:
            detail = f"cannot be read: {error.strerror}"
            raise RecordingUnreadable(self.path, detail) from None
        if magic != MAGIC:
            raise NotARecording(self.path, "is not an MCAP file")
        place = len(MAGIC)
        while place + _PREFIX.size <= size:
            file.seek(place)
            opcode, length = _PREFIX.unpack(file.read(_PREFIX.size))
            place += _PREFIX.size
            if opcode not in _OPCODES or place + length > size:
                return
            if opcode == Opcode.DATA_END:
                self.cut = False
                return
            if opcode == Opcode.CHUNK:
                self._add_chunk(place)
            elif opcode in _DESCRIPTIONS:
                self._take(Opcode(opcode), file.read(length))
            place += length

    def _add_chunk(self, place: int) -> None:
        head = self._file.read(_CHUNK_HEAD.size)
        start_ns, end_ns, size, crc, name_length = _CHUNK_HEAD.unpack(head)
        name = self._file.read(min(name_length, 64))
        (length,) = struct.unpack("<Q", self._file.read(8))
        offset = place + _CHUNK_HEAD.size + name_length + 8
        compression = name.decode(errors="replace")
        self.chunks.append(ChunkPlace(offset, length, start_ns, end_ns, size, crc, compression))

    def _take(self, opcode: Opcode, content: bytes) -> None:
        stream = ReadDataStream(io.BytesIO(content))
        try:
            match opcode:
                case Opcode.SCHEMA:
                    schema = Schema.read(stream)
                    self._schemas[schema.id] = schema
                case Opcode.CHANNEL:
                    channel = Channel.read(stream)
                    self._channels[channel.topic] = channel
                case Opcode.METADATA:
                    found = Metadata.read(stream)
                    if found.name == METADATA:
                        self.metadata.update(found.metadata)
                case _:
                    attachment = Attachment.read(stream)
                    self.attachments[attachment.name] = attachment.data
        except (McapError, ValueError, struct.error) as error:
            detail = f"is damaged: its {opcode.name.lower()} cannot be read ({error})"
            raise RecordingUnreadable(self.path, detail) from None

    def _check(self) -> None:
        if "record_schema_version" not in self.metadata and RECORDS not in self._channels:
            detail = "is an MCAP file, but not one that keyhole recorded"
            raise NotARecording(self.path, detail)
        found = self.metadata.get("record_schema_version", "unknown")
        made_by = self.metadata.get("keyhole", "version not known")
        if found != str(SCHEMA_VERSION):
            raise RecordingVersion(self.path, found, SCHEMA_VERSION, made_by)
        if RECORDS not in self._channels:
            raise RecordingEmpty(self.path)
        self.types: RecordTypes = record_types_of(self.configuration())
        channel = self._channels[RECORDS]
        schema = self._schemas.get(channel.schema_id)
        try:
            same = schema is not None and schema.encoding == NUMPY
            same = same and schema is not None and understand(schema.data) == self.types.record
        except ValueError as error:
            detail = f"is damaged: {error}"
            raise RecordingUnreadable(self.path, detail) from None
        if not same:
            raise RecordingVersion(self.path, f"{found}, another form", SCHEMA_VERSION, made_by)
        self._channel = channel.id
        if self.cut and self.chunks and not self._is_whole(self.chunks[-1]):
            # The system may put a part of what was written last on the disk, and not the rest.
            self.chunks.pop()
        if not self.chunks:
            raise RecordingEmpty(self.path)
        self.start_ns = min(chunk.start_ns for chunk in self.chunks)
        self.end_ns = max(chunk.end_ns for chunk in self.chunks)

    def _is_whole(self, chunk: ChunkPlace) -> bool:
        try:
            self._content(chunk)
        except RecordingUnreadable:
            return False
        return True

    # What it holds

    @property
    def duration_s(self) -> float:
        """From the first record to the last, s."""
        return (self.end_ns - self.start_ns) * 1e-9

    def configuration(self) -> Configuration:
        """The configuration of the recorded robot.

        Raises:
            RecordingConfiguration: there is none that this version knows.
        """
        content = self.attachments.get(CONFIGURATION)
        if content is None:
            raise RecordingConfiguration(self.path, "holds no configuration")
        try:
            return Configuration.model_validate_json(content)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            key = ".".join(str(part) for part in first["loc"]) or "(the whole)"
            detail = f"its configuration is not one that this version knows: {key}: {first['msg']}"
            raise RecordingConfiguration(self.path, detail) from None

    def calibration(self) -> Calibration | None:
        """The calibration of the recorded robot, None where it had none.

        Raises:
            RecordingConfiguration: it is not one that this version knows.
        """
        content = self.attachments.get(CALIBRATION)
        if content is None:
            return None
        try:
            return parse_calibration(json.loads(content), CALIBRATION)
        except (ValueError, CalibrationRefused) as error:
            detail = f"its calibration is not one that this version knows: {error}"
            raise RecordingConfiguration(self.path, detail) from None

    def batches(self) -> Iterator[Batch]:
        """Every record, a chunk at a time.

        Raises:
            RecordingUnreadable: a chunk is damaged.
        """
        for chunk in self.chunks:
            batch = self.batch(chunk)
            if len(batch.records):
                yield batch

    def batch(self, chunk: ChunkPlace) -> Batch:
        """The records of one chunk.

        Raises:
            RecordingUnreadable: it is damaged.
        """
        content = self._content(chunk)
        found: list[bytes] = []
        heads: list[tuple[int, int]] = []
        place, size = 0, len(content)
        while place + _PREFIX.size <= size:
            opcode, length = _PREFIX.unpack_from(content, place)
            place += _PREFIX.size
            if opcode == Opcode.MESSAGE:
                channel, sequence, time_ns, _ = _MESSAGE_HEAD.unpack_from(content, place)
                if channel == self._channel:
                    heads.append((sequence, time_ns))
                    found.append(content[place + _MESSAGE_HEAD.size : place + length])
            place += length
        if any(len(one) != self.types.record.itemsize for one in found):
            raise RecordingUnreadable(self.path, f"is damaged: a record at byte {chunk.offset}")
        columns = np.array(heads, dtype=np.int64).reshape(-1, 2)
        # Writable and aligned: for other arrays the compiled functions would be compiled anew.
        records = np.empty(len(found), dtype=self.types.record)
        records.view(np.uint8)[:] = np.frombuffer(b"".join(found), dtype=np.uint8)
        return Batch(columns[:, 0], columns[:, 1], records)

    def _content(self, chunk: ChunkPlace) -> bytes:
        detail = f"is damaged between {self._place(chunk)}"
        if chunk.compression not in ("", COMPRESSION):
            detail = f"is compressed with {chunk.compression!r}, which keyhole does not write"
            raise RecordingUnreadable(self.path, detail)
        if chunk.size > _LARGEST_CHUNK:
            raise RecordingUnreadable(self.path, detail)
        try:
            self._file.seek(chunk.offset)
            content = self._file.read(chunk.length)
            if chunk.compression:
                decompressor = zstandard.ZstdDecompressor()
                content = decompressor.decompress(content, max_output_size=chunk.size)
        except OSError as error:
            detail = f"cannot be read: {error.strerror}"
            raise RecordingUnreadable(self.path, detail) from None
        except zstandard.ZstdError:
            raise RecordingUnreadable(self.path, detail) from None
        if len(content) != chunk.size or (chunk.crc and zlib.crc32(content) != chunk.crc):
            raise RecordingUnreadable(self.path, detail)
        return content

    def _place(self, chunk: ChunkPlace) -> str:
        first = self.chunks[0].start_ns
        start, end = (chunk.start_ns - first) * 1e-9, (chunk.end_ns - first) * 1e-9
        return f"{start:.2f} s and {end:.2f} s"
