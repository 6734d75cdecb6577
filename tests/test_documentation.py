"""What the documentation says, held against the program."""

from __future__ import annotations

import ast
import importlib
import re
import shlex
import tomllib
from pathlib import Path
from typing import Any

import pytest
from starlette.routing import WebSocketRoute

from robot.configuration import Configuration
from robot.robots import TITLES
from robot.safety import REASONS, TRANSITIONS
from server.command_line import COMMANDS, _parser
from server.configuration_file import load
from server.memory.link import WebLink
from server.memory.link_records import create_mapped_files
from server.web import api_stylus, refusals, stream
from server.web.access import Access
from server.web.api_robot import robot_path
from server.web.app import create_app
from server.web.concentric_message import ConcentricMessages
from server.web.instrument_message import InstrumentMessages
from server.web.state_schema import ConcentricState, StateMessage

ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")])
FOLDERS = "robot|hardware|scenes|server|frontend_assets|benchmarks|tests|docs"


def _text(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def _cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split(" |")]


def _rows(name: str, *header: str) -> list[list[str]]:
    """Rows of every table in the document whose columns have these names."""
    lines, rows = _text(name).splitlines(), []
    for place, line in enumerate(lines):
        if line.startswith("|") and _cells(line) == list(header):
            for row in lines[place + 2 :]:
                if not row.startswith("|"):
                    break
                rows.append(_cells(row))
    assert rows, f"{name} has no table with the columns {header}"
    assert all(len(row) == len(header) for row in rows)
    return rows


def _value(cell: str) -> Any:
    return tomllib.loads(f"value = {cell.strip('`')}")["value"]


def _blocks(name: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", _text(name), re.MULTILINE | re.DOTALL)


def _allowed(schema: dict[str, Any]) -> str:
    """What a value may be, in the words of the document."""
    if "const" in schema:
        return str(schema["const"])
    if "enum" in schema:
        return ", ".join(str(one) for one in schema["enum"])
    if "prefixItems" in schema:
        (each,) = {_allowed(item) for item in schema["prefixItems"]}
        words = f"{len(schema['prefixItems'])} numbers"
        return words if each == "any" else f"{words}, each {each}"
    if schema["type"] in ("boolean", "string"):
        return {"boolean": "true, false", "string": "text"}[schema["type"]]
    bounds = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    words = " and ".join(
        f"{sign} {schema[key]:.12g}" for key, sign in bounds.items() if key in schema
    )
    return ("whole, " if schema["type"] == "integer" else "") + (words or "any")


def _leaves(schema: dict[str, Any], root: dict[str, Any], prefix: str) -> dict[str, str]:
    """Dotted key and allowed value of everything below a table."""
    leaves: dict[str, str] = {}
    for name, part in schema["properties"].items():
        table = part["items"] if part.get("type") == "array" and "items" in part else part
        if "$ref" in table:
            inner = root["$defs"][table["$ref"].rpartition("/")[2]]
            leaves |= _leaves(inner, root, f"{prefix}{name}.")
        else:
            leaves[prefix + name] = _allowed(part)
    return leaves


ROBOT = robot_path("instrument")
CONFIGURATION = ("key", "unit", "default", "allowed", "meaning")


def test_every_key_of_the_configuration_is_listed_with_its_range() -> None:
    schema = Configuration.model_json_schema()
    listed = {row[0].strip("`"): row[3] for row in _rows("docs/configuration.md", *CONFIGURATION)}
    assert listed == _leaves(schema, schema, "")


def test_the_defaults_shown_are_those_of_the_file() -> None:
    file = tomllib.loads(_text("robot/keyhole.toml"))
    for key, _, default, _, _ in _rows("docs/configuration.md", *CONFIGURATION):
        if default != "below":
            found: Any = file
            for part in key.strip("`").split("."):
                found = found[part]
            assert _value(default) == found, key
    listed = {"arm": ("joints", "links"), "concentric": ("tubes", "starts")}
    for table, part in ((table, part) for table, parts in listed.items() for part in parts):
        header = tuple(file[table][part][0])
        rows = _rows("docs/configuration.md", *header)
        assert [[_value(cell) for cell in row] for row in rows] == [
            list(entry.values()) for entry in file[table][part]
        ]


def test_the_transition_table_is_the_robots() -> None:
    assert _rows("docs/safety.md", "state", "event", "next", "reason") == [
        [row.state.name, row.event.name, row.next.name, REASONS[row.event][0]]
        for row in TRANSITIONS
    ]


def test_operators_find_every_reason() -> None:
    header = ("state", "reason on the page", "what has happened", "what to do")
    listed = {(row[0], row[1]) for row in _rows("docs/operators.md", *header)}
    reached = {(row.next.name, REASONS[row.event][0]) for row in TRANSITIONS}
    refused = [*InstrumentMessages.REFUSED.values(), *ConcentricMessages.REFUSED.values()]
    known = reached | {("ENABLED", reason) for reason, _ in refused}
    assert listed == known | {("DISABLED", "started")}


def test_operators_find_every_key() -> None:
    keys = re.findall(r'show: "([^"]+)", words: "([^"]+)"', _text("frontend_assets/page/keys.js"))
    assert len(keys) > 15
    listed = [
        (row[0].replace("`", ""), row[1])
        for row in _rows("docs/operators.md", "key", "what it does")
    ]
    assert listed == keys


def test_links_and_pictures_exist() -> None:
    missing = []
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        found = re.findall(r"\]\(([^)\s]+)\)", text)
        found += re.findall(r'(?:src|srcset|href)="([^"]+)"', text)
        for target in found:
            path, _, anchor = target.partition("#")
            aim = document.parent / path if path else document
            if re.match(r"[a-z]+:", target):
                continue
            if not aim.exists() or (anchor and anchor not in _anchors(aim)):
                missing.append(f"{document.name}: {target}")
    assert not missing


def _anchors(document: Path) -> set[str]:
    headings = re.findall(r"^#+ (.+)$", document.read_text(encoding="utf-8"), re.MULTILINE)
    return {
        re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in headings
    }


def test_files_and_tests_that_are_named_exist() -> None:
    missing = []
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        for path, name in re.findall(rf"`((?:{FOLDERS})/[\w./*]*\w)(?:::(\w+))?`", text):
            files = list(ROOT.glob(path))
            if not files or (name and f"def {name}(" not in files[0].read_text(encoding="utf-8")):
                missing.append(f"{document.name}: {path} {name}")
    assert not missing


def test_the_interface_is_described_as_it_is(tmp_path: Path) -> None:
    create_mapped_files(tmp_path, rate_hz=500.0, ring_seconds=0.01)
    link = WebLink(tmp_path)
    access = Access("token", "127.0.0.1")
    apps = [
        create_app(load().model_copy(update={"robot": robot}), link, access) for robot in TITLES
    ]
    link.close()
    known = {
        (method.upper(), path.replace(robot_path("concentric"), ROBOT))
        for app in apps
        for path, operations in app.openapi()["paths"].items()
        for method in operations
    }
    known |= {
        ("WS", ROBOT + route.path)
        for route in (*stream.router.routes, *api_stylus.router.routes)
        if isinstance(route, WebSocketRoute)
    }
    listed = set()
    for method, path, _, _ in _rows("docs/labs.md", "method", "path", "who", "what"):
        name = path.strip("`")
        listed.add((method, name if name.startswith("/") else f"{ROBOT}/{name}"))
    assert listed == known
    paths = {path for _, path in known} | {"/api/v1", ROBOT}
    for document in DOCUMENTS:
        text = document.read_text(encoding="utf-8")
        assert set(re.findall(r"/api/v1[\w/-]*(?<![/-])", text)) <= paths, document.name


def test_every_field_of_the_state_is_described() -> None:
    listed: list[str] = []
    for names, _ in _rows("docs/labs.md", "field", "what"):
        listed += re.findall(r"`(\w+)`", names)
    assert listed
    told = {
        field.alias or name
        for schema in (StateMessage, ConcentricState)
        for name, field in schema.model_fields.items()
    }
    assert sorted(listed) == sorted(told)


def test_every_refusal_is_described() -> None:
    listed = {
        row[0].strip("`"): int(row[1]) for row in _rows("docs/labs.md", "code", "status", "when")
    }
    own = [
        one
        for one in vars(refusals).values()
        if isinstance(one, type) and issubclass(one, refusals.WebRefusal)
    ]
    assert {
        one.code: one.status for one in own if one is not refusals.WebRefusal
    }.items() <= listed.items()


def _commands() -> list[str]:
    lines = []
    for document in DOCUMENTS:
        for block in _blocks(str(document.relative_to(ROOT)), "sh"):
            lines += re.findall(r"^(?:\.venv/bin/)?keyhole (.*)$", block, re.MULTILINE)
    return sorted(set(lines))


@pytest.mark.parametrize("command", _commands())
def test_commands_are_understood(command: str) -> None:
    modules = {name: importlib.import_module(module) for name, module in COMMANDS.items()}
    _parser(modules).parse_args(shlex.split(command, comments=True))


@pytest.mark.parametrize("document", [path.name for path in (ROOT / "docs").glob("*.md")])
def test_examples_are_python(document: str) -> None:
    for block in _blocks(f"docs/{document}", "python"):
        ast.parse(block)
