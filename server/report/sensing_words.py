"""Who wins and by how much in the sensing experiments, in words made from the figures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scenes.experiments.sensing import FORCE_LEVELS, SHAPE_FREE
from server.report.sensing_results import SensingResults
from server.report.sensing_tasks import NOISY, QUIET
from server.run.figure_table import figure
from server.run.sensing_options import FRICTION

_ALIKE = 0.05
_COMPARED = ("constant_curvature.", "polynomial_curvature.", "")
"""Blocks of a document: of an arc, of the paper's shape, of ours."""


def mean_of(documents: Sequence[dict[str, Any]], place: str) -> float:
    """Mean of the figures at a dotted place of every document."""
    values = [figure(one, place) for one in documents]
    return sum(value for value in values if isinstance(value, float)) / len(values)


def noise_words(noise: tuple[float, float]) -> str:
    """Noise of a pose, for people."""
    return "none" if noise == (0.0, 0.0) else f"{noise[0]:g} mm, {noise[1]:g}°"


def free_words(results: SensingResults) -> str:
    """Whether constant curvature wins in free bending."""
    won = []
    for friction, words in (
        (0.0, "Without friction"),
        (FRICTION, f"With friction (μ = {FRICTION:g})"),
    ):
        documents = results.documents(SHAPE_FREE, NOISY, friction)
        if not documents:
            continue
        arc, polynomial, ours = (
            mean_of(documents, f"{block}shape_error_mm.rms") for block in _COMPARED
        )
        best = min(polynomial, ours)
        if arc < (1.0 - _ALIKE) * best:
            verdict = "constant curvature wins"
        elif arc > (1.0 + _ALIKE) * best:
            verdict = "constant curvature loses"
        else:
            verdict = "constant curvature is as good"
        won.append(
            f"{words} {verdict}: {arc:.3f} mm against {polynomial:.3f} mm of polynomial curvature "
            f"and {ours:.3f} mm of ours at {noise_words(NOISY)}"
        )
    return (
        ". ".join(won) + ". A segment that nothing touches, without friction, is an arc exactly: "
        "two unknowns carry less noise than more of them, at any noise, whatever the paper shows. "
        "Friction and contact make it no arc. Ours does not know that nothing touches; told so, "
        "it leaves the force out and uses the tensions for the shape."
    )


def contact_words(results: SensingResults) -> str:
    """How shapes in contact compare."""
    words = "The tip presses on a platform that faces its motion, which bends it to no arc."
    for noise in (QUIET, NOISY):
        documents = results.documents(FORCE_LEVELS, noise)
        if documents:
            arc, polynomial, ours = (
                mean_of(documents, f"{block}shape_error_mm.rms") for block in _COMPARED
            )
            words += (
                f" At {noise_words(noise)} constant curvature errs by {arc:.3f} mm, polynomial "
                f"curvature by {polynomial:.3f} mm ({arc / polynomial:.1f} times less), ours by "
                f"{ours:.3f} mm ({arc / ours:.1f} times less)."
            )
    return words


def arc_words(results: SensingResults) -> str:
    """How an arc's forces compare with those of the paper's shape, plainly."""
    said = []
    for noise in (QUIET, NOISY):
        documents = results.documents(FORCE_LEVELS, noise)
        if documents:
            arc, polynomial = (
                mean_of(documents, f"{block}force.axis_known.force_error_percent.rms")
                for block in _COMPARED[:2]
            )
            said.append(f"{arc:.1f} against {polynomial:.1f} % at {noise_words(noise)}")
    return (
        "an arc’s does not fall far behind the polynomial’s, if it does at all ("
        + "; ".join(said)
        + ", axis known, one sample): its shape is wrong, but it carries less noise."
    )
