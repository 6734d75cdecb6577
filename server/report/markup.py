"""Small pieces of the page: tables, cards, figures. Whatever is text is escaped."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import NamedTuple


class Cell(NamedTuple):
    """A cell of a table.

    Attributes:
        text: what stands in it.
        kind: a class of the style sheet, or empty.
        rows: how many rows it spans.
    """

    text: str
    kind: str = ""
    rows: int = 1


def text(words: str) -> str:
    """Words, escaped."""
    return html.escape(words)


def paragraph(words: str, kind: str = "") -> str:
    """A paragraph."""
    return f"<p{_kind(kind)}>{text(words)}</p>"


def table(head: Sequence[str], rows: Iterable[Sequence[Cell | str]]) -> str:
    """A table; a head that begins with ``#`` is of numbers and stands on the right."""
    heads = "".join(
        f'<th scope="col"{_kind("number" if one.startswith("#") else "")}>'
        f"{text(one.removeprefix('#'))}</th>"
        for one in head
    )
    body = "".join(f"<tr>{''.join(_cell(cell) for cell in row)}</tr>" for row in rows)
    return (
        f'<div class="table"><table><thead><tr>{heads}</tr></thead>'
        f"<tbody>{body}</tbody></table></div>"
    )


def _cell(cell: Cell | str) -> str:
    one = Cell(cell) if isinstance(cell, str) else cell
    span = f' rowspan="{one.rows}"' if one.rows > 1 else ""
    return f"<td{_kind(one.kind)}{span}>{text(one.text)}</td>"


def _kind(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


def figure(svg: str, caption: str) -> str:
    """A plot with its caption; empty without a plot."""
    if not svg:
        return ""
    return f"<figure>{svg}<figcaption>{text(caption)}</figcaption></figure>"


def number(value: float | None, digits: int = 3) -> str:
    """A number with ``digits`` significant digits, or a dash."""
    return "–" if value is None else f"{value:.{digits}g}"


def section(anchor: str, title: str, *parts: str) -> str:
    """A section with a heading that can be linked to."""
    return f'<section id="{anchor}"><h2>{text(title)}</h2>{"".join(parts)}</section>'


def card(*parts: str) -> str:
    """A box."""
    return f'<div class="card">{"".join(parts)}</div>'
