"""Findings for people and for programs."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Sequence

from server.doctor.finding import Finding, Level

_COLOURS = {Level.OK: "\033[32m", Level.WARN: "\033[33m", Level.FAIL: "\033[31m"}
_BOLD, _PLAIN = "\033[1m", "\033[0m"
_AREA, _MARGIN = 16, 23


def worst(findings: Sequence[Finding]) -> Level:
    """The worst level there is."""
    levels = {finding.level for finding in findings}
    return next((level for level in (Level.FAIL, Level.WARN) if level in levels), Level.OK)


def as_json(findings: Sequence[Finding]) -> str:
    """One object: ``findings``, ``worst``, and how many of each level in ``counts``."""
    counts = Counter(finding.level for finding in findings)
    return json.dumps(
        {
            "worst": worst(findings),
            "counts": {level: counts[level] for level in Level},
            "findings": [finding.as_dict() for finding in findings],
        },
        indent=2,
    )


def as_text(findings: Sequence[Finding], width: int, coloured: bool) -> str:
    """What a person reads: one line for what is well, three for what is not.

    Args:
        findings: in order.
        width: columns.
        coloured: whether the levels have a colour; they are words as well.
    """
    lines: list[str] = []
    for finding in findings:
        word = f"{finding.level:<4}"
        if coloured:
            word = f"{_COLOURS[finding.level]}{word}{_PLAIN}"
        head = f"  {word} {finding.area:<{_AREA}}"
        lines += _wrapped(head, finding.what, width)
        margin = " " * _MARGIN
        if finding.meaning:
            lines += _wrapped(margin, finding.meaning, width)
        if finding.advice:
            lines += _wrapped(f"{margin}→ ", finding.advice, width)
    return "\n".join([*lines, "", _summary(findings, coloured)])


def _wrapped(head: str, text: str, width: int) -> list[str]:
    plain = " " * (_MARGIN + (2 if head.endswith("→ ") else 0))
    wrapped = textwrap.wrap(
        text, max(width - len(plain), 30), break_long_words=False, break_on_hyphens=False
    )
    first, *others = wrapped or [""]
    return [head + first, *(plain + line for line in others)]


def _summary(findings: Sequence[Finding], coloured: bool) -> str:
    counts = Counter(finding.level for finding in findings)
    words = {
        Level.OK: "All is well.",
        Level.WARN: f"It works; {_things(counts[Level.WARN])} could be better.",
        Level.FAIL: f"{_things(counts[Level.FAIL]).capitalize()} must be put right first.",
    }[worst(findings)]
    return f"{_BOLD}{words}{_PLAIN}" if coloured else words


def _things(count: int) -> str:
    return "one thing" if count == 1 else f"{count} things"
