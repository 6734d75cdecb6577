"""What can be wrong with a recording."""

from __future__ import annotations

from pathlib import Path

from robot.errors import KeyholeError


class RecordingError(KeyholeError):
    """Base class of all that concerns one recording.

    Attributes:
        path: the file.
    """

    code = "recording"

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(f"{path}: {detail}")
        self.path = path


class RecordingUnreadable(RecordingError):
    """The file cannot be opened, or is damaged where it must not be."""

    code = "recording_unreadable"


class NotARecording(RecordingError):
    """The file is something else."""

    code = "not_a_recording"


class RecordingVersion(RecordingError):
    """The recording holds records of another form than this version reads.

    Attributes:
        found: version of the records in the file.
        wanted: version of the records of this program.
    """

    code = "recording_version"

    def __init__(self, path: Path, found: str, wanted: int, made_by: str) -> None:
        super().__init__(
            path,
            f"holds records of version {found}, and this keyhole reads version {wanted}; "
            f"open it with the keyhole that made it ({made_by})",
        )
        self.found, self.wanted = found, wanted


class RecordingConfiguration(RecordingError):
    """The configuration or calibration in the recording is not one that this version knows."""

    code = "recording_configuration"


class RecordingEmpty(RecordingError):
    """The recording was cut off before its first tick was on the disk."""

    code = "recording_empty"

    def __init__(self, path: Path) -> None:
        super().__init__(path, "holds no ticks; it was cut off before the first were written")


class RecordingNotWritten(RecordingError):
    """The recording cannot be made, or not be continued; what was written before stays."""

    code = "recording_not_written"
