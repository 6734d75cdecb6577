"""Records in mapped files: one writer, any number of readers, and nobody ever waits.

A mapped file is a header and a circle of entries. Each entry carries its sequence number and a
CRC32 over that number and the payload. The writer fills the entry that no reader of the newest
record looks at, and only then moves the header's count forward. So a reader always finds a whole
record, even while the writer is stopped or killed in the middle of the next one; a reader that is
overtaken sees it by the sequence number or the CRC and takes the newer record.

Plain files are mapped rather than Python's ``SharedMemory``, which removes the memory when an
attached reader is killed. Place them on a memory file system: on a disk, writing back dirty pages
stalls the writer.
"""

from __future__ import annotations

import contextlib
import mmap
import os
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robot.errors import KeyholeError

Records = NDArray[Any]

_MAGIC = int.from_bytes(b"KEYHOLE1", "little")
_HEADER_BYTES = 64
_MAGIC_AT, _SIGNATURE_AT, _SIZE_AT, _CAPACITY_AT, _COUNT_AT = range(5)
_LINE = 64
_PREFIX_BYTES = 16
_ATTEMPTS = 64


class MappedReadError(KeyholeError):
    """Nothing whole could be read from a mapped file.

    Attributes:
        path: the mapped file.
        detail: why.
    """

    code = "mapped_read"

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(f"{path.name}: {detail}")
        self.path, self.detail = path, detail


class MappedFileError(KeyholeError):
    """A mapped file cannot be created, opened, or does not hold what the caller expects.

    Attributes:
        path: the mapped file.
        detail: why.
    """

    code = "mapped_file"

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(f"{path}: {detail}")
        self.path, self.detail = path, detail


def _signature(dtype: np.dtype[Any]) -> int:
    return zlib.crc32(repr(dtype.descr).encode())


def _stride(dtype: np.dtype[Any]) -> int:
    return -(-(_PREFIX_BYTES + dtype.itemsize) // _LINE) * _LINE


def _create(path: Path, dtype: np.dtype[Any], capacity: int) -> None:
    """Make the file whole under another name, then move it into place."""
    size = _HEADER_BYTES + capacity * _stride(dtype)
    unfinished = path.with_name(path.name + ".new")
    descriptor = os.open(unfinished, os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_CLOEXEC, 0o600)
    try:
        if hasattr(os, "posix_fallocate"):
            # A sparse file would end a writer with SIGBUS on the day its file system is full.
            os.posix_fallocate(descriptor, 0, size)
        else:
            os.ftruncate(descriptor, size)
        header = np.zeros(_HEADER_BYTES // 8, dtype=np.uint64)
        header[_MAGIC_AT], header[_SIGNATURE_AT] = _MAGIC, _signature(dtype)
        header[_SIZE_AT], header[_CAPACITY_AT] = dtype.itemsize, capacity
        os.pwrite(descriptor, header.tobytes(), 0)
    except OSError as error:
        with contextlib.suppress(OSError):
            os.unlink(unfinished)
        detail = f"{size / 1e6:.1f} MB cannot be reserved ({error.strerror})"
        raise MappedFileError(path, detail) from None
    finally:
        os.close(descriptor)
    os.replace(unfinished, path)


class _MappedEntries:
    """The circle of entries that the slot and the ring share."""

    def __init__(
        self, path: Path | str, dtype: np.dtype[Any], capacity: int, create: bool, writable: bool
    ) -> None:
        self.path, self.dtype = Path(path), dtype
        if create:
            _create(self.path, dtype, capacity)
        writable = writable or create
        self._map = self._open(writable)
        if len(self._map) % 8:
            raise MappedFileError(self.path, "is not a file of such records")
        self._words = memoryview(self._map).cast("Q")
        self._check()
        self._capacity = self._words[_CAPACITY_AT]
        self._stride = _stride(dtype)
        self._entries = np.frombuffer(self._map, dtype=np.uint8, offset=_HEADER_BYTES).reshape(
            self._capacity, self._stride
        )
        self._payloads = self._entries[:, _PREFIX_BYTES : _PREFIX_BYTES + dtype.itemsize]

    def _open(self, writable: bool) -> mmap.mmap:
        try:
            flags = os.O_RDWR if writable else os.O_RDONLY
            descriptor = os.open(self.path, flags | os.O_CLOEXEC)
        except OSError as error:
            raise MappedFileError(self.path, error.strerror or "cannot be opened") from None
        try:
            access = mmap.ACCESS_WRITE if writable else mmap.ACCESS_READ
            return mmap.mmap(descriptor, 0, access=access)
        except (OSError, ValueError):
            raise MappedFileError(self.path, "cannot be mapped") from None
        finally:
            os.close(descriptor)

    def _check(self) -> None:
        words = self._words
        wrong = len(words) * 8 < _HEADER_BYTES or words[_MAGIC_AT] != _MAGIC
        if wrong or words[_SIZE_AT] != self.dtype.itemsize:
            raise MappedFileError(self.path, "is not a file of such records")
        if words[_SIGNATURE_AT] != _signature(self.dtype):
            raise MappedFileError(self.path, "holds records of another type")
        if len(words) * 8 < _HEADER_BYTES + words[_CAPACITY_AT] * _stride(self.dtype):
            raise MappedFileError(self.path, "is too short")

    @property
    def sequence(self) -> int:
        """How many records were written since the file was made."""
        return self._words[_COUNT_AT]

    def _push(self, record: Records) -> int:
        """Write a record, shape () or (1,), as the next one; returns its number, from 1."""
        sequence = self._words[_COUNT_AT] + 1
        place = sequence % self._capacity
        word = (_HEADER_BYTES + place * self._stride) // 8
        payload = record.reshape(1).view(np.uint8)
        self._words[word] = 0
        self._payloads[place] = payload
        self._words[word + 1] = zlib.crc32(payload.data, sequence & 0xFFFFFFFF)
        self._words[word] = sequence
        self._words[_COUNT_AT] = sequence
        return sequence

    def close(self) -> None:
        """Unmap the file. The object cannot be used afterwards; closing twice is harmless."""
        self._words.release()
        del self._entries, self._payloads
        self._entries = self._payloads = np.empty((0, 0), dtype=np.uint8)
        with contextlib.suppress(BufferError):
            self._map.close()


class MappedSlot(_MappedEntries):
    """The newest record of one writer.

    Args:
        path: the mapped file.
        dtype: the record's numpy type; a file of another type is refused.
        create: make the file (replacing one that exists) and open it for writing.
        writable: open a file that exists for writing. One process may write, no more.

    Raises:
        MappedFileError: the file cannot be made or opened, or holds something else.
    """

    def __init__(
        self,
        path: Path | str,
        dtype: np.dtype[Any],
        *,
        create: bool = False,
        writable: bool = False,
    ) -> None:
        super().__init__(path, dtype, 2, create, writable)

    def write(self, record: Records) -> int:
        """Publish a record, shape () or (1,); returns how many were published. Never waits."""
        return self._push(record)

    def read(self, out: Records | None = None) -> Records:
        """The newest whole record, shape (1,), copied into ``out`` where it is given.

        Raises:
            MappedReadError: nothing was written yet, or no whole record was met in a bounded
                number of attempts. ``out`` is then undefined.
        """
        record = np.empty(1, dtype=self.dtype) if out is None else out
        target = record.view(np.uint8)
        words = self._words
        for _ in range(_ATTEMPTS):
            sequence = words[_COUNT_AT]
            if sequence == 0:
                raise MappedReadError(self.path, "nothing was written yet")
            place = sequence % 2
            word = (_HEADER_BYTES + place * self._stride) // 8
            crc = words[word + 1]
            target[:] = self._payloads[place]
            if words[word] == sequence and zlib.crc32(target.data, sequence & 0xFFFFFFFF) == crc:
                return record
        raise MappedReadError(self.path, f"no whole record in {_ATTEMPTS} attempts")


class MappedRing(_MappedEntries):
    """The last ``capacity`` records of one writer, numbered from 0, with gaps made visible.

    Args:
        path: the mapped file.
        dtype: the record's numpy type; a file of another type is refused.
        capacity: how many records can be read back. Only used with ``create``; a ring that exists
            knows its own.
        create: make the file (replacing one that exists) and open it for writing.
        writable: open a file that exists for writing. One process may write, no more.

    Raises:
        MappedFileError: the file cannot be made or opened, or holds something else.
    """

    def __init__(
        self,
        path: Path | str,
        dtype: np.dtype[Any],
        capacity: int = 0,
        *,
        create: bool = False,
        writable: bool = False,
    ) -> None:
        # One entry more than can be read: the one that is being written.
        super().__init__(path, dtype, capacity + 1, create, writable)

    @property
    def capacity(self) -> int:
        """How many records can be read back."""
        return self._capacity - 1

    def push(self, record: Records) -> int:
        """Append a record, shape () or (1,); returns its number, from 0. Never waits."""
        return self._push(record) - 1

    def read_since(self, sequence: int, limit: int | None = None) -> tuple[Records, int, bool]:
        """Every record from number ``sequence`` on that is still there, oldest first.

        Args:
            sequence: number of the first record wanted; what the last call gave as the next.
            limit: at most so many records; None for all there are.

        Returns:
            The records, shape (n,); the number to ask for next; and whether records were lost
            between ``sequence`` and the first one returned (or, where none is returned, the next).
        """
        head = self.sequence
        first = min(max(sequence, head - self.capacity, 0), head)
        count = head - first if limit is None else min(head - first, limit)
        places = (np.arange(first, first + count) + 1) % self._capacity
        entries = self._entries[places]
        spoilt = self._spoilt(entries, first)
        payload = entries[spoilt:, _PREFIX_BYTES : _PREFIX_BYTES + self.dtype.itemsize]
        records = np.ascontiguousarray(payload).reshape(-1).view(self.dtype)
        return records, first + count, first != sequence or spoilt > 0

    def _spoilt(self, entries: NDArray[np.uint8], first: int) -> int:
        """How many copied entries to leave out at the front because the writer overtook them.

        Only the oldest can have been overtaken while they were copied, so everything up to the
        last one that is not whole is left out.
        """
        spoilt = 0
        size = self.dtype.itemsize
        for index, entry in enumerate(entries):
            number, crc = entry[:_PREFIX_BYTES].view(np.uint64)
            expected = first + index + 1
            payload = entry[_PREFIX_BYTES : _PREFIX_BYTES + size]
            if number != expected or zlib.crc32(payload.data, expected & 0xFFFFFFFF) != crc:
                spoilt = index + 1
        return spoilt
