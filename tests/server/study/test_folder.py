"""The folder of a study: what is not whole does not count; names tell everything that matters."""

from __future__ import annotations

import dataclasses
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.run.headless import RunResult
from server.study.folder import StudyFolder, StudyFolderError
from server.study.program_mark import program_mark
from server.study.task import Sweep, Task
from server.study.work import Outcome, Work, packed_trace, perform
from tests.server import headless

TASK = Task("circle", "1", "kinematic", "paper", 1, False, "full", 0.1)


def outcome() -> Outcome:
    trace = b"trace"
    return Outcome({"ended": "completed", "trace_sha256": hashlib.sha256(trace).hexdigest()}, trace)


def test_what_is_kept_is_found_again(tmp_path: Path) -> None:
    folder = StudyFolder(tmp_path / "deep" / "study")
    folder.keep("one", outcome())
    assert StudyFolder(folder.path).document("one") == outcome().document
    assert folder.document("two") is None
    assert sorted(path.name for path in folder.path.iterdir()) == ["one.json", "one.npz"]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("one.json", b""),
        ("one.json", b'{"ended": "comple'),
        ("one.json", b"[]"),
        ("one.json", b"{}"),
        ("one.json", b"\xff\xfe"),
        ("one.npz", b""),
        ("one.npz", b"trac"),
        ("one.npz", None),
        ("one.json", None),
    ],
)
def test_what_is_not_whole_does_not_count(tmp_path: Path, name: str, content: bytes | None) -> None:
    folder = StudyFolder(tmp_path)
    folder.keep("one", outcome())
    if content is None:
        (tmp_path / name).unlink()
    else:
        (tmp_path / name).write_bytes(content)
    assert folder.document("one") is None


def test_a_folder_that_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StudyFolderError, match="cannot be made"):
        StudyFolder(tmp_path / "file" / "study")


@pytest.mark.parametrize(
    "change",
    [
        {"experiment": "square"},
        {"case": "2"},
        {"plant": "physics"},
        {"preset": "harsh"},
        {"seed": 2},
        {"tracker": True},
        {"compensation": "gain"},
        {"seconds": None},
        {"seconds": 0.2},
    ],
)
def test_every_option_changes_the_name(change: dict[str, Any]) -> None:
    configuration = headless.configuration()
    other = dataclasses.replace(TASK, **change)
    assert other.name(configuration, None) != TASK.name(configuration, None)


def test_configuration_and_calibration_change_the_name() -> None:
    configuration = headless.configuration()
    names = {
        TASK.name(configuration, None),
        TASK.name(configuration, "{}"),
        TASK.name(headless.changed("limits", bend_deg=80.0), None),
    }
    assert len(names) == 3
    assert TASK.name(configuration, None) in names
    assert all("/" not in name for name in names)


def test_a_sweep_is_every_combination_once() -> None:
    configuration = headless.configuration()
    sweep = Sweep(
        ["circle", "arc"], None, ["kinematic"], ["paper", "harsh"], [1, 2], [False], ["full"]
    )
    tasks = sweep.tasks(configuration)
    assert len(tasks) == len(set(tasks)) == (3 + 1) * 2 * 2
    chosen = dataclasses.replace(sweep, cases=["pointing"]).tasks(configuration)
    assert {task.case for task in chosen} == {"pointing"}


def test_another_program_s_task_is_not_done() -> None:
    text = headless.configuration().model_dump_json()
    found = perform(Work(TASK, "name", text, None, "another"))
    assert found.document is None
    assert "not the same" in found.failure
    given_up = perform(Work(TASK, "name", text, None, program_mark()), lambda: True)
    assert given_up == Outcome(None)


def test_the_packed_trace_is_of_every_20_ms_and_equal_for_equal_runs(tmp_path: Path) -> None:
    result = headless.play(headless.path([[0, 0, 0, 0], [0.2, 0.001, 0, 0]], "short")).result
    assert isinstance(result, RunResult)
    data = packed_trace(result, 0.002)
    assert data == packed_trace(result, 0.002)
    folder = StudyFolder(tmp_path)
    folder.write("one.npz", data)
    found = folder.traces("one")
    np.testing.assert_allclose(found["trace"], result.trace[::10], rtol=1e-6, atol=1e-7)
    assert len(found["errors"]) == len(found["detail"]) == 11
