"""What the paper claims, and whether our figures bear it out; decided by rule, not by taste."""

from __future__ import annotations

from dataclasses import dataclass

from server.report.measures import (
    Table5,
    accuracy,
    lambda_error,
    residuals,
)
from server.report.results import Results, Setting

DIFFERENT = 0.05
"""Figures that differ by less than this share are alike."""
_NOTHING_MM_S, _NOTHING_DEG_S = 1e-2, 1e-2


@dataclass(frozen=True)
class Claim:
    """One claim.

    Attributes:
        source: where it stands in the paper.
        words: what it says.
        found: our figures.
        holds: whether they bear it out; None where they cannot tell.
        rule: what decided.
    """

    source: str
    words: str
    found: str
    holds: bool | None
    rule: str


def _less(one: float, other: float) -> bool:
    return one < (1.0 - DIFFERENT) * other


def claims(results: Results, table: Table5 | None) -> list[Claim]:
    """All claims for which there are figures."""
    found: list[Claim] = []
    for experiment in ("circle", "circle-infeasible"):
        found += _twists(results, experiment)
    found += _lambda(results)
    found += _planes(results)
    found += _trade(results, "silicon-arc", "section 5.4, silicon board")
    found += _trade(results, "ring-board", "section 5.4, ring board")
    found += _five_percent(results)
    if table is not None:
        found += _dexterity(table)
    return found


def _twists(results: Results, experiment: str) -> list[Claim]:
    by_case = residuals(results, experiment)
    if by_case is None:
        return []
    linear = {case: values[0] for case, values in by_case.items()}
    angular = {case: values[1] for case, values in by_case.items()}
    where = "" if experiment == "circle" else " (on a path that cannot be followed)"
    claims_found = []
    for what, values, best, unit, nothing in (
        ("linear", linear, "1", "mm/s", _NOTHING_MM_S),
        ("angular", angular, "2", "°/s", _NOTHING_DEG_S),
    ):
        others = [values[case] for case in "012" if case != best]
        alike = max(values.values()) < nothing
        claims_found.append(
            Claim(
                f"Fig. 11, {experiment}",
                f"Case {best} has the lowest {what} twist error{where}.",
                f"below {nothing:g} {unit} in every case: all carry out the whole twist"
                if alike
                else _three(values, unit),
                not alike and all(_less(values[best], other) for other in others),
                f"at least {100 * DIFFERENT:.0f} % below both others; rms residual",
            )
        )
    better = all(_less(values[case], values["0"]) for values in (linear, angular) for case in "12")
    claims_found.append(
        Claim(
            f"Fig. 11, {experiment}",
            f"Cases 1 and 2 both have lower twist errors than case 0{where}.",
            "as in the two rows above",
            better,
            "both errors of both cases below those of case 0",
        )
    )
    return claims_found


def _three(values: dict[str, float], unit: str) -> str:
    return ", ".join(f"case {case}: {value:.3g} {unit}" for case, value in values.items())


def _lambda(results: Results) -> list[Claim]:
    found = []
    for experiment in ("circle", "circle-infeasible"):
        values = lambda_error(results, experiment)
        if values is None:
            continue
        spread = max(values.values()) - min(values.values())
        found.append(
            Claim(
                f"Fig. 12, {experiment}",
                "All three cases keep λ almost equally close to λ₀ = 0.4.",
                "largest |λ − λ₀|: "
                + ", ".join(f"case {case}: {value:.3f}" for case, value in values.items()),
                spread < 2.0 * DIFFERENT * max(values.values()),
                f"largest and smallest within {200 * DIFFERENT:.0f} %",
            )
        )
    return found


def _planes(results: Results) -> list[Claim]:
    flat = accuracy(results, Setting("circle", "0", True), "max")
    upright = accuracy(results, Setting("circle-yz", "0", True), "max")
    if flat is None or upright is None:
        return []
    return [
        Claim(
            "section 5.3, Fig. 10a",
            "The circle in the y-z plane errs less (under 1 mm against 2.8 mm).",
            f"x-y plane {flat[0]:.2f} mm, y-z plane {upright[0]:.2f} mm, both with the tracker",
            _less(upright[0], flat[0]),
            f"at least {100 * DIFFERENT:.0f} % lower",
        )
    ]


def _trade(results: Results, experiment: str, source: str) -> list[Claim]:
    first = accuracy(results, Setting(experiment, "1", True), "max")
    second = accuracy(results, Setting(experiment, "2", True), "max")
    if first is None or second is None:
        return []
    return [
        Claim(
            source,
            f"{experiment}: case 2 errs less in orientation and more in position than case 1.",
            f"case 1: {first[0]:.2f} mm, {first[1]:.2f}°; "
            f"case 2: {second[0]:.2f} mm, {second[1]:.2f}°",
            _less(second[1], first[1]) and _less(first[0], second[0]),
            f"both by at least {100 * DIFFERENT:.0f} %",
        )
    ]


def _five_percent(results: Results) -> list[Claim]:
    found = {case: accuracy(results, Setting("ring-board", case, True), "rms") for case in "012"}
    zero, one, two = found["0"], found["1"], found["2"]
    if zero is None or one is None or two is None:
        return []
    better = all(_less(case[what], zero[what]) for case in (one, two) for what in (0, 1))
    return [
        Claim(
            "section 5.4, ring board",
            "Cases 1 and 2 do both linear and angular tasks at least 5 % more accurately than "
            "case 0.",
            ", ".join(
                f"case {case}: {values[0]:.3f} mm, {values[1]:.3f}°"
                for case, values in found.items()
                if values is not None
            )
            + " rms",
            better,
            "both errors of both cases at least 5 % below those of case 0",
        )
    ]


def _dexterity(table: Table5) -> list[Claim]:
    found = []
    for kind, rows in (("raw", table.raw), ("projected", table.projected)):
        for case, what in (("1", "linear"), ("2", "angular")):
            inverse = {one: getattr(row, f"inverse_{what}") for one, row in rows.items()}
            product = {one: getattr(row, what) for one, row in rows.items()}
            highest = all(
                _less(values[other], values[case])
                for values in (inverse, product)
                for other in "012"
                if other != case
            )
            share = inverse[case] / inverse["0"] - 1.0, product[case] / product["0"] - 1.0
            found.append(
                Claim(
                    f"Table 5, {kind} measures",
                    f"Case {case} has the highest inverse condition number and manipulability of "
                    f"the {what} task.",
                    f"against case 0: κ⁻¹ {100 * share[0]:+.1f} %, m {100 * share[1]:+.1f} %",
                    highest,
                    f"both at least {100 * DIFFERENT:.0f} % above the other cases",
                )
            )
    return found
