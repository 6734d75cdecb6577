"""Verdicts in the page: the cell of one, and the table of a paper's claims."""

from __future__ import annotations

from collections.abc import Sequence

from server.report import markup
from server.report.claims import Claim
from server.report.markup import Cell


def verdict_cell(met: bool | None, yes: str, no: str) -> Cell:
    """``yes`` or ``no`` with a sign before it; a dash where it cannot be told."""
    if met is None:
        return Cell("–", "verdict open")
    return Cell(f"✓ {yes}" if met else f"✗ {no}", "verdict yes" if met else "verdict no")


def claims_section(anchor: str, title: str, found: Sequence[Claim], words: str) -> str:
    """All claims in a table.

    Args:
        anchor: of the section.
        title: of the section.
        found: the claims.
        words: after how many of them do not hold.
    """
    rows: list[list[Cell | str]] = [
        [claim.source, claim.words, claim.found,
         verdict_cell(claim.holds, "holds", "does not hold"), Cell(claim.rule, "small")]
        for claim in found
    ]  # fmt: skip
    fails = sum(claim.holds is False for claim in found)
    return markup.section(
        anchor,
        title,
        markup.paragraph(f"{fails} of {len(found)} do not hold here. {words}"),
        markup.card(markup.table(("where", "claim", "found", "verdict", "rule"), rows)),
    )
