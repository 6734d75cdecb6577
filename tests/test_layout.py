"""What the repository promises about itself: who may import whom, names, pins, versions."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# The data flows one way; a folder may use itself and the folders named here.
MAY_USE = {
    "robot": set(),
    "scenes": {"robot"},
    "hardware": {"robot", "scenes"},
    "frontend_assets": {"robot"},
    "server": {"robot", "scenes", "hardware", "frontend_assets", "benchmarks"},
    "benchmarks": {"robot", "scenes", "hardware", "server"},
}

# Clocks, threads, sockets, files and the web stay out of robot/, so that a replay is exact.
IMPURE = {
    *("asyncio", "concurrent", "multiprocessing", "queue", "sched", "signal", "threading"),
    *("datetime", "time", "random", "secrets"),
    *("http", "httpx", "select", "selectors", "serial", "socket", "ssl", "urllib", "websockets"),
    *("fcntl", "glob", "importlib", "io", "mmap", "os", "pathlib", "shutil", "tempfile"),
    *("fastapi", "logging", "starlette", "subprocess", "uvicorn", "viser"),
}
# Compiled functions have to be cached somewhere; their results do not depend on it.
MAY_BE_IMPURE = {"robot/compiled.py"}

EMPTY_NAMES = {"base", "common", "helper", "helpers", "manager", "misc", "util", "utils"}


def _sources(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def _imported(path: Path) -> set[str]:
    """First words of all modules that the file imports, wherever in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.partition(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}:{node.lineno}: imports are absolute here"
            names.add(str(node.module).partition(".")[0])
    return names


def _calls_open(path: Path) -> bool:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    calls = (node.func for node in ast.walk(tree) if isinstance(node, ast.Call))
    return any(isinstance(function, ast.Name) and function.id == "open" for function in calls)


@pytest.mark.parametrize("folder", MAY_USE)
def test_data_flows_one_way(folder: str) -> None:
    foreign = ({*MAY_USE, "tests"} - {folder}) - MAY_USE[folder]
    wrong = {str(path.relative_to(ROOT)): _imported(path) & foreign for path in _sources(folder)}
    assert not {path: names for path, names in wrong.items() if names}


def test_the_robot_is_pure() -> None:
    paths = [path for path in _sources("robot") if str(path.relative_to(ROOT)) not in MAY_BE_IMPURE]
    assert paths
    assert not {path.name: names for path in paths if (names := _imported(path) & IMPURE)}
    assert not [path.name for path in paths if _calls_open(path)]


def test_every_file_is_named_for_what_it_holds() -> None:
    paths = [path for folder in (*MAY_USE, "tests") for path in _sources(folder)]
    assert not [
        path for path in paths if path.stem in EMPTY_NAMES or path.parent.name in EMPTY_NAMES
    ]


def test_files_and_functions_can_be_read_without_scrolling_far() -> None:
    too_long = []
    for path in (path for folder in (*MAY_USE, "tests") for path in _sources(folder)):
        text = path.read_text(encoding="utf-8")
        if text.count("\n") >= 450:
            too_long.append(str(path))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                assert node.end_lineno is not None
                if node.end_lineno - node.lineno >= 70:
                    too_long.append(f"{path}:{node.lineno} {node.name}")
    assert not too_long


def test_constraints_are_exact_versions_without_addresses() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if not line.startswith("#")]
    assert not [line for line in pins if not re.fullmatch(r"[a-z0-9.-]+==[\w.]+( ; .+)?", line)]
    assert pins == sorted(pins)


def test_everything_installed_is_pinned() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    wanted = [
        *project["build-system"]["requires"],
        *project["project"]["dependencies"],
        *project["project"]["optional-dependencies"]["test"],
    ]
    names = {re.split(r"[<>=!\[ ]", name)[0] for name in wanted}
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    assert not names - set(re.findall(r"^([a-z0-9.-]+)==", text, re.MULTILINE))


def test_the_changelog_knows_the_version() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = re.findall(r"^## \[(\d+\.\d+\.\d+)\]", changelog, re.MULTILINE)
    assert versions[0] == project["project"]["version"]
