"""An MCAP file that is written chunk by chunk, so that it can be read whenever it is cut off.

The library's own writer decides by itself, by size, when a chunk is complete. A recording has to
be on the disk after a fraction of a second however little there is, so the file is put together
here from the library's records. Schemas, channels, metadata and attachments stand before the first
chunk: they are there however short the file is.
"""

from __future__ import annotations

import contextlib
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from server.recording.errors import RecordingNotWritten

MAGIC = b"\x89MCAP0\r\n"
COMPRESSION = "zstd"

MessageTimes = Mapping[int, Sequence[tuple[int, int]]]
"""Time in ns and place in the chunk's data of every message, by channel."""


def _bytes_of(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    content: bytes = builder.end()  # type: ignore[no-untyped-call]
    return content


class McapFile:
    """A new MCAP file.

    Args:
        path: of the file; it must not exist.
        library: who writes, for the header.

    Attributes:
        size: bytes written.

    Raises:
        RecordingNotWritten: it cannot be made.
    """

    def __init__(self, path: Path, library: str) -> None:
        self.path, self.size = path, 0
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._attachments: list[AttachmentIndex] = []
        self._metadata: list[MetadataIndex] = []
        self._chunks: list[ChunkIndex] = []
        self._counts: dict[int, int] = {}
        self._compressor = zstandard.ZstdCompressor(level=1, write_content_size=True)
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except (OSError, ValueError) as error:
            raise RecordingNotWritten(path, f"cannot be made: {_words(error)}") from None
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
            self._descriptor = os.open(path, flags, 0o644)
        except FileExistsError:
            detail = "exists already; choose another name or move it away"
            raise RecordingNotWritten(path, detail) from None
        except (OSError, ValueError) as error:
            raise RecordingNotWritten(path, f"cannot be made: {_words(error)}") from None
        self._write(MAGIC + _bytes_of(Header(profile="", library=library)))

    def add_channel(self, topic: str, encoding: str, schema: tuple[str, str, bytes]) -> int:
        """Add a channel with its schema (name, encoding, data); returns the channel's number."""
        number = len(self._channels) + 1
        name, schema_encoding, data = schema
        self._schemas.append(Schema(number, data, schema_encoding, name))
        self._channels.append(Channel(number, topic, encoding, {}, number))
        self._write(_bytes_of(self._schemas[-1], self._channels[-1]))
        return number

    def add_metadata(self, name: str, values: dict[str, str]) -> None:
        """Add named words."""
        content = _bytes_of(Metadata(name, values))
        self._metadata.append(MetadataIndex(self.size, len(content), name))
        self._write(content)

    def add_attachment(self, name: str, media_type: str, data: bytes, time_ns: int) -> None:
        """Add a file."""
        content = _bytes_of(Attachment(time_ns, time_ns, name, media_type, data))
        self._attachments.append(
            AttachmentIndex(self.size, len(content), time_ns, time_ns, len(data), name, media_type)
        )
        self._write(content)

    def add_chunk(self, data: bytes, messages: MessageTimes) -> None:
        """Add a chunk of whole messages, with their index, in one write.

        Args:
            data: the messages as MCAP has them.
            messages: when and where each is; at least one.

        Raises:
            RecordingNotWritten: it cannot be written; the file ends with the chunk before.
        """
        times = [time for entries in messages.values() for time, _ in entries]
        chunk = Chunk(
            compression=COMPRESSION,
            data=self._compressor.compress(data),
            message_end_time=max(times),
            message_start_time=min(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        content, offsets = _bytes_of(chunk), {}
        length = len(content)
        for channel, entries in messages.items():
            offsets[channel] = self.size + len(content)
            content += _bytes_of(MessageIndex(channel, list(entries)))
        index = ChunkIndex(
            chunk_length=length,
            chunk_start_offset=self.size,
            compression=COMPRESSION,
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=len(content) - length,
            message_index_offsets=offsets,
            message_start_time=chunk.message_start_time,
            uncompressed_size=len(data),
        )
        self._write(content)
        self._chunks.append(index)
        for channel, entries in messages.items():
            self._counts[channel] = self._counts.get(channel, 0) + len(entries)

    def synchronise(self) -> None:
        """Have the system put on the disk what was written."""
        with contextlib.suppress(OSError):
            os.fsync(self._descriptor)

    def close(self) -> None:
        """Write the summary and close the file.

        Raises:
            RecordingNotWritten: there is no room for the summary; the file can be read without.
        """
        try:
            self._write(_bytes_of(DataEnd(0)))
            self._write(self._summary())
            self.synchronise()
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Close the file as it is."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
        self._descriptor = -1

    def _summary(self) -> bytes:
        statistics = Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunks),
            message_count=sum(self._counts.values()),
            message_end_time=max((chunk.message_end_time for chunk in self._chunks), default=0),
            message_start_time=min((chunk.message_start_time for chunk in self._chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )
        groups: list[tuple[Opcode, Sequence[McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, self._chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        content, offsets = b"", b""
        for opcode, records in groups:
            if not records:
                continue
            group = _bytes_of(*records)
            offsets += _bytes_of(SummaryOffset(opcode, self.size + len(content), len(group)))
            content += group
        footer = Footer(self.size, self.size + len(content), 0)
        # The checksum covers the summary and the footer up to itself.
        before = content + offsets + _bytes_of(footer)[:-4]
        footer.summary_crc = zlib.crc32(before)
        return content + offsets + _bytes_of(footer) + MAGIC

    def _write(self, content: bytes) -> None:
        rest = memoryview(content)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._descriptor, self.size)
            raise RecordingNotWritten(self.path, f"writing stopped: {_words(error)}") from None
        self.size += len(content)


def _words(error: Exception) -> str:
    words = error.strerror if isinstance(error, OSError) else str(error)
    return f"{words}; free space or choose another folder"
