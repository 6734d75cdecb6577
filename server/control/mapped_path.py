"""A path as a file, so that the control process maps its spline instead of computing it.

Building a spline of many samples takes longer than a tick, and a thread that builds it inside the
control process can be put aside by the system while it holds the interpreter: the loop would then
wait for a browser. So the web process builds it, and what is left to do is to map a file.
"""

from __future__ import annotations

import mmap
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import NDArray

from scenes.path import Path

_COMPONENTS = 7
_ORDER = 4
_WORD_BYTES = 8


class MappedPath(Path):
    """A path whose spline stands in a file that :meth:`file_bytes` made.

    Its ``samples`` are empty; only :meth:`at`, ``name`` and ``duration_s`` serve.

    Args:
        file: the file.
        rows: how many samples the path was made of.
        name: for people.

    Raises:
        OSError: the file cannot be opened.
        ValueError: it is shorter than ``rows`` samples need.
    """

    def __init__(self, file: FilePath, rows: int, name: str) -> None:
        size = (rows + _ORDER * (rows - 1) * _COMPONENTS) * _WORD_BYTES
        with file.open("rb") as opened:
            # Private copies of the pages are writable: for read-only arrays the compiled
            # functions would be compiled anew.
            content = mmap.mmap(opened.fileno(), size, access=mmap.ACCESS_COPY)
        numbers: NDArray[np.float64] = np.frombuffer(content, dtype=np.float64)
        self.name = name
        self.samples = np.empty((0, _COMPONENTS + 1))
        self._breaks = numbers[:rows]
        self._coefficients = numbers[rows:].reshape(_ORDER, rows - 1, _COMPONENTS)
        self.duration_s = float(self._breaks[-1])

    @staticmethod
    def rows_in(size: int) -> int:
        """Of how many samples the path in a file of ``size`` bytes was made."""
        return (size // _WORD_BYTES + _ORDER * _COMPONENTS) // (1 + _ORDER * _COMPONENTS)

    @staticmethod
    def file_bytes(samples: NDArray[np.float64]) -> bytes:
        """Contents of the file for a path of (n, 8) ``samples``; see :class:`scenes.path.Path`."""
        path = Path(samples, "")
        return path._breaks.tobytes() + path._coefficients.tobytes()
