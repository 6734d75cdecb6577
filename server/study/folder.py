"""The folder of a study: a JSON and a trace for each finished run, written whole or not at all."""

from __future__ import annotations

import hashlib
import io
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from robot.errors import KeyholeError
from server.study.work import Outcome


class StudyFolderError(KeyholeError):
    """The folder of a study cannot be used.

    Attributes:
        path: the folder.
    """

    code = "study_folder"

    def __init__(self, path: Path, detail: str) -> None:
        super().__init__(f"{path}: {detail}")
        self.path = path


class StudyFolder:
    """Finished runs by name. The JSON is written last: where it stands, the run is finished.

    Args:
        path: the folder; it is made where it does not exist.

    Raises:
        StudyFolderError: it cannot be made.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise StudyFolderError(path, f"cannot be made: {error.strerror}") from None

    def write(self, name: str, data: bytes) -> None:
        """Write a file in one act; raises :class:`StudyFolderError`."""
        target = self.path / name
        aside = self.path / f".{name}.{os.getpid()}"
        try:
            with open(aside, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(aside, target)
        except OSError as error:
            aside.unlink(missing_ok=True)
            raise StudyFolderError(target, f"cannot be written: {error.strerror}") from None

    def keep(self, name: str, outcome: Outcome) -> None:
        """Keep a finished run."""
        self.write(f"{name}.npz", outcome.trace)
        self.write(f"{name}.json", json.dumps(outcome.document, indent=2).encode() + b"\n")

    def document(self, name: str) -> dict[str, Any] | None:
        """The figures of a finished run; None if it is not there, not whole, or was changed."""
        try:
            document = json.loads((self.path / f"{name}.json").read_bytes())
            trace = (self.path / f"{name}.npz").read_bytes()
            whole = document["trace_sha256"] == hashlib.sha256(trace).hexdigest()
        except (OSError, ValueError, KeyError, TypeError):
            return None
        return document if whole else None

    def traces(self, name: str) -> dict[str, np.ndarray]:
        """``trace``, ``detail`` and ``errors`` of a finished run, a row every 20 ms."""
        data = (self.path / f"{name}.npz").read_bytes()
        with np.load(io.BytesIO(data), allow_pickle=False) as found:
            return {key: np.asarray(found[key], dtype=float) for key in found.files}
