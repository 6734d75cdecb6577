"""The real launcher on a tiny project that needs no package: quick, and without a network."""

from __future__ import annotations

import importlib.util
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from server import set_up

ROOT = Path(__file__).resolve().parent.parent

PROJECT = """
[build-system]
requires = []
build-backend = "backend"
backend-path = ["."]

[project]
name = "tiny"
version = "1.0"
dependencies = [{dependencies}]
"""

# As little of a build backend as pip accepts for an editable installation.
BACKEND = """
import pathlib, zipfile

ABOUT = "Metadata-Version: 2.1\\nName: tiny\\nVersion: 1.0\\n"
WHEEL = "Wheel-Version: 1.0\\nRoot-Is-Purelib: true\\nTag: py3-none-any\\n"
SCRIPT = "[console_scripts]\\nkeyhole = server.program:main\\n"

def build_editable(directory, config_settings=None, metadata_directory=None):
    name = "tiny-1.0.dist-info"
    files = {
        "tiny.pth": str(pathlib.Path.cwd()),
        f"{name}/METADATA": ABOUT + NEEDS,
        f"{name}/WHEEL": WHEEL,
        f"{name}/entry_points.txt": SCRIPT,
    }
    files[f"{name}/RECORD"] = "".join(f"{path},,\\n" for path in [*files, f"{name}/RECORD"])
    with zipfile.ZipFile(pathlib.Path(directory) / "tiny-1.0-py3-none-any.whl", "w") as wheel:
        for path, text in files.items():
            wheel.writestr(path, text)
    return "tiny-1.0-py3-none-any.whl"
"""

PROGRAM = """
import os, sys

def main():
    print(os.getpid(), *sys.argv[1:], sep="|")
    return 7
"""


def _make_project(folder: Path, needs: str = "") -> Path:
    for name in ("server", "tests"):
        (folder / name).mkdir(parents=True)
    shutil.copy(ROOT / "keyhole", folder)
    shutil.copy(ROOT / "server" / "set_up.py", folder / "server")
    (folder / "server" / "program.py").write_text(PROGRAM)
    (folder / "tests" / "run_all.py").write_text("import sys; print('tests', *sys.argv[1:])")
    (folder / "backend.py").write_text(
        f"NEEDS = {f'Requires-Dist: {needs}' if needs else ''!r}\n{BACKEND}"
    )
    dependencies = f'"{needs}"' if needs else ""
    (folder / "pyproject.toml").write_text(PROJECT.format(dependencies=dependencies))
    (folder / "constraints.txt").write_text("")
    return folder


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A checkout whose path has a space, set up once for this file."""
    folder = _make_project(tmp_path_factory.mktemp("launcher") / "a checkout")
    result = _start(folder, "first", "use")
    assert result.returncode == 7, result.stderr
    yield folder
    shutil.rmtree(folder)


def _environment(**more: str) -> dict[str, str]:
    base = getattr(sys, "_base_executable", sys.executable)
    return {**os.environ, "PIP_NO_INDEX": "1", "KEYHOLE_PYTHON": base, **more}


def _start(folder: Path, *arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [folder / "keyhole", *arguments],
        cwd="/",
        env=_environment(**more),
        capture_output=True,
        text=True,
        check=False,
    )


def _background(folder: Path, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [folder / "keyhole", *arguments],
        env=_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def _leftovers(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir() if path.name.startswith((".venv.p", ".venv.o"))]


def _until_it_exists(path: Path) -> None:
    deadline = time.monotonic() + 30
    while not path.exists():
        assert time.monotonic() < deadline, f"{path} does not appear"
        time.sleep(0.01)


def _kill_when_it_sets_up(folder: Path) -> None:
    """Start it, and end it in the middle of making the environment."""
    process = _background(folder)
    try:
        _until_it_exists(folder / f".venv.partial-{process.pid}" / "bin" / "python")
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    assert len(_leftovers(folder)) == 1


def test_the_program_gets_its_arguments_and_replaces_the_launcher(project: Path) -> None:
    with _background(project, "run", "two words", "") as process:
        output, errors = process.communicate()
    assert output == f"{process.pid}|run|two words|\n"
    assert errors == ""
    assert process.returncode == 7


def test_the_environment_holds_the_same_program_and_names_its_final_place(project: Path) -> None:
    script = project / ".venv" / "bin" / "keyhole"
    result = subprocess.run([script, "x"], capture_output=True, text=True, check=False)
    assert result.stdout.endswith("|x\n")
    texts = [path for path in script.parent.iterdir() if not path.is_symlink()]
    assert not [path for path in texts if b".partial-" in path.read_bytes()]


def test_a_link_to_the_launcher_works(project: Path, tmp_path: Path) -> None:
    link = tmp_path / "keyhole"
    link.symlink_to(os.path.relpath(project / "keyhole", tmp_path))
    result = subprocess.run(
        [link, "y"], env=_environment(), capture_output=True, text=True, check=False
    )
    assert result.stdout.endswith("|y\n"), result.stderr


def test_a_warm_start_adds_less_than_0_3_s(project: Path) -> None:
    environment = _environment()
    del environment["KEYHOLE_PYTHON"]

    def fastest(program: Path) -> float:
        times = []
        for _ in range(5):
            began = time.perf_counter()
            subprocess.run([program], env=environment, capture_output=True, check=False)
            times.append(time.perf_counter() - began)
        return min(times)

    assert fastest(project / "keyhole") - fastest(project / ".venv" / "bin" / "keyhole") < 0.3


def test_what_is_outdated_is_set_up_anew(project: Path, tmp_path: Path) -> None:
    """Each reason by itself: without it nothing is set up."""
    home, pins = project / ".venv", project / "constraints.txt"
    for missing in ([home / set_up.STAMP], list((home / "bin").glob("python*"))):
        for path in missing:
            path.rename(tmp_path / path.name)
        _kill_when_it_sets_up(project)
        for path in missing:
            (tmp_path / path.name).rename(path)
        assert _start(project).stderr == ""
    before = pins.read_text()
    pins.write_text("# moved\n")
    _kill_when_it_sets_up(project)
    pins.write_text(before)
    assert _start(project).stderr == ""


def test_a_killed_set_up_is_repaired_by_the_next_for_which_a_second_waits(project: Path) -> None:
    for link in (project / ".venv" / "bin").glob("python*"):
        link.unlink()
    (project / "constraints.txt").write_text("# moved\n")
    _kill_when_it_sets_up(project)
    (project / ".venv.old-1").symlink_to("/nowhere")

    first = _background(project, "one")
    _until_it_exists(project / f".venv.partial-{first.pid}")
    second = _background(project, "two")

    outputs = [process.communicate() for process in (first, second)]
    assert [output.split("|")[-1] for output, _ in outputs] == ["one\n", "two\n"]
    assert "setting up .venv" in outputs[0][1]
    assert "waiting" in outputs[1][1]
    assert "setting up .venv" not in outputs[1][1]
    assert not _leftovers(project)


def test_an_unfinished_test_set_up_is_done_anew(project: Path) -> None:
    assert _start(project, "test", "-k", "x").stdout == "tests -k x\n"
    for name in (set_up.TESTS_STAMP, set_up.STAMP):
        assert (project / ".venv" / name).exists()
    (project / ".venv" / set_up.TESTS_STAMP).unlink()
    (project / ".venv" / set_up.TESTS_UNFINISHED).touch()

    result = _start(project, "test")

    assert "setting up .venv" in result.stderr
    assert result.stdout == "tests\n"
    assert not (project / ".venv" / set_up.TESTS_UNFINISHED).exists()


def test_a_failed_installation_ends_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    folder = _make_project(tmp_path / "failing", needs="no-such-package-for-keyhole")
    result = _start(folder)
    assert result.returncode == 1
    assert "no-such-package-for-keyhole" in result.stderr
    assert "Traceback" not in result.stderr
    last = result.stderr.splitlines()[-1]
    assert last.startswith("keyhole: installing the pinned packages failed")
    assert not (folder / ".venv").exists()


def test_without_a_python_the_command_that_installs_one_is_named(tmp_path: Path) -> None:
    old = tmp_path / "python3"
    old.write_text("#!/bin/sh\nexit 1\n")
    old.chmod(0o755)
    folder = _make_project(tmp_path / "bare")
    result = subprocess.run(
        ["/bin/sh", folder / "keyhole"],
        env={"PATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 1
    (line,) = result.stderr.splitlines()
    assert "Python 3.11 or newer was not found" in line
    assert "install python3" in line


def test_a_named_python_that_does_not_serve_is_refused(project: Path) -> None:
    result = _start(project, KEYHOLE_PYTHON="/bin/false")
    assert result.returncode == 1
    assert result.stderr == ("keyhole: KEYHOLE_PYTHON=/bin/false is not a Python 3.11 or newer\n")


def test_a_python_without_ensurepip_names_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    assert set_up.missing_part() is None
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")
    major, minor = sys.version_info[:2]
    assert f"apt-get install python{major}.{minor}-venv" in str(set_up.missing_part())
