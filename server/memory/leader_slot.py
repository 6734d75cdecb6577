"""The mapped file of one leader's newest sample, as its writer has it."""

from __future__ import annotations

import contextlib
import math
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np

from robot.errors import InvalidPose
from robot.records import DriveMode, LeaderKind
from server.memory.link_records import LEADER_SLOT, leader_file
from server.memory.mapped import MappedReadError, MappedSlot

SMALLEST_QUATERNION = 1e-6


class LeaderSlot:
    """Publishes the samples of one leader; the newest counts. May be used from any thread.

    One process may write a leader's file. Opening it opens the clutch: whoever led before is gone.

    Args:
        directory: the run directory.
        kind: of the leader.

    Raises:
        MappedFileError: no console keeps its files there.
    """

    def __init__(self, directory: Path, kind: LeaderKind) -> None:
        self._kind = kind
        self._slot = MappedSlot(directory / leader_file(kind), LEADER_SLOT, writable=True)
        self._lock = threading.Lock()
        self._sample = np.zeros(1, dtype=LEADER_SLOT)
        with contextlib.suppress(MappedReadError):
            self._slot.read(self._sample)
        self._leader, self._stamp = self._sample[0]["leader"], self._sample["stamp_ns"]
        self._position, self._wxyz = self._leader["position"], self._leader["wxyz"]
        if self._slot.sequence:
            self.open_clutch()

    def open_clutch(self) -> None:
        """Publish the last sample again, disengaged."""
        with self._lock:
            self._leader["clutch"] = 0
            self._stamp[0] = time.monotonic_ns()
            self._slot.write(self._sample)

    def write(
        self,
        *,
        sequence: int,
        clutch: bool,
        position: Any,
        wxyz: Any,
        absolute: bool,
        smoothing_s: float,
        timeout_s: float,
        mode: DriveMode = DriveMode.BOTH,
        stamp_ns: int = 0,
    ) -> None:
        """Publish a sample; the one before is forgotten.

        Args:
            sequence: differs from that of the sample before.
            clutch: whether the leader is engaged.
            position: (3,) in m.
            wxyz: (4,) quaternion w, x, y, z; made to unit length.
            absolute: the pose is a tip pose in the base frame, not a motion relative to the
                clutch's anchor.
            smoothing_s: time constant over which coarse samples are interpolated; 0 for none.
            timeout_s: older than this, a sample with a closed clutch is stale.
            mode: what the leader drives.
            stamp_ns: when it was measured, the host's monotonic clock; 0 for now.

        Raises:
            InvalidPose: NaN, infinity, or a quaternion that is nearly zero; nothing is published.
        """
        x, y, z = position
        a, b, c, d = wxyz
        norm = math.sqrt(a * a + b * b + c * c + d * d)
        if not math.isfinite(x + y + z + norm):
            raise InvalidPose(f"leader {self._kind.name}", "the pose holds NaN or infinity")
        if norm < SMALLEST_QUATERNION:
            raise InvalidPose(f"leader {self._kind.name}", "the quaternion is zero")
        with self._lock:
            self._fill(sequence, clutch, absolute, smoothing_s, timeout_s, mode)
            self._position[:] = x, y, z
            self._wxyz[:] = a / norm, b / norm, c / norm, d / norm
            self._stamp[0] = stamp_ns or time.monotonic_ns()
            self._slot.write(self._sample)

    def write_invalid(self, sequence: int, timeout_s: float) -> None:
        """Tell control that an engaged leader has sent what is no pose: it pauses."""
        with self._lock:
            self._fill(sequence, True, False, 0.0, timeout_s, DriveMode.BOTH)
            self._position[:] = math.nan
            self._stamp[0] = time.monotonic_ns()
            self._slot.write(self._sample)

    def _fill(
        self,
        sequence: int,
        clutch: bool,
        absolute: bool,
        smoothing_s: float,
        timeout_s: float,
        mode: DriveMode,
    ) -> None:
        leader = self._leader
        leader["kind"], leader["sequence"] = int(self._kind), sequence
        leader["clutch"], leader["absolute"] = int(clutch), int(absolute)
        leader["mode"] = int(mode)
        leader["timeout_s"], leader["smoothing_s"] = timeout_s, smoothing_s

    def close(self) -> None:
        """Unmap the file."""
        self._slot.close()
