"""The run directory: private, locked, and cleaned up."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from server.configuration_file import load
from server.memory.run_directory import (
    AlreadyRunning,
    RunDirectory,
    RunDirectoryError,
    default_path,
)


def test_it_is_private_and_so_is_what_is_in_it(tmp_path: Path) -> None:
    directory = RunDirectory.take(tmp_path / "deep" / "run")
    directory.new_token()
    directory.write_configuration(load())
    directory.write_console({"pid": 1})
    assert directory.path.stat().st_mode & 0o777 == 0o700
    for entry in directory.path.iterdir():
        assert entry.stat().st_mode & 0o777 == 0o600
    directory.give_back()


def test_what_is_written_can_be_read_by_others(tmp_path: Path) -> None:
    directory = RunDirectory.take(tmp_path)
    token, configuration = directory.new_token(), load()
    directory.write_configuration(configuration)
    directory.write_console({"pid": 5, "host": "127.0.0.1"})
    other = RunDirectory(tmp_path)
    assert len(token) == 32
    assert other.token() == token
    assert other.configuration() == configuration
    assert other.configuration().hash64() == configuration.hash64()
    assert other.console() == {"pid": 5, "host": "127.0.0.1"}
    other.give_back()
    assert other.token() == token
    directory.give_back()


def test_only_one_can_have_it(tmp_path: Path) -> None:
    first = RunDirectory.take(tmp_path)
    with pytest.raises(AlreadyRunning, match="address unknown"):
        RunDirectory.take(tmp_path)
    first.write_console({"pid": 5, "address": "http://127.0.0.1:8000/"})
    with pytest.raises(AlreadyRunning, match=r"process 5, http://127\.0\.0\.1:8000/"):
        RunDirectory.take(tmp_path)
    first.give_back()
    RunDirectory.take(tmp_path).give_back()


def test_what_an_earlier_console_left_is_cleared(tmp_path: Path) -> None:
    (tmp_path / "token").write_text("old")
    (tmp_path / "record.slot").write_text("old")
    tmp_path.chmod(0o700)
    directory = RunDirectory.take(tmp_path)
    with pytest.raises(RunDirectoryError, match="is a console running there"):
        directory.token()
    assert [path.name for path in tmp_path.iterdir()] == ["console.lock"]
    directory.give_back()


def test_tokens_differ(tmp_path: Path) -> None:
    directory = RunDirectory.take(tmp_path)
    assert directory.new_token() != directory.new_token()
    directory.give_back()


def test_a_directory_that_others_can_look_into_is_refused(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    with pytest.raises(RunDirectoryError, match=f"chmod 700 {tmp_path}"):
        RunDirectory.take(tmp_path)


def test_a_link_or_a_file_in_its_place_is_refused(tmp_path: Path) -> None:
    target, link, file = tmp_path / "target", tmp_path / "link", tmp_path / "file"
    target.mkdir(mode=0o700)
    link.symlink_to(target)
    file.write_text("")
    with pytest.raises(RunDirectoryError, match="not a directory"):
        RunDirectory.take(link)
    with pytest.raises(RunDirectoryError):
        RunDirectory.take(file)
    with pytest.raises(RunDirectoryError):
        RunDirectory.take(file / "below")


def test_the_default_prefers_memory(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    assert default_path() == tmp_path / f"keyhole-{os.getuid()}"
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "none"))
    assert default_path().parent != tmp_path / "none"


def test_the_control_lock_is_held_by_one(tmp_path: Path) -> None:
    directory = RunDirectory(tmp_path)
    lock = directory.lock_control()
    assert lock is not None
    assert directory.lock_control() is None
    os.close(lock)
    again = directory.lock_control()
    assert again is not None
    os.close(again)
