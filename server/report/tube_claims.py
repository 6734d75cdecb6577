"""What Paper 2 (Alsaka, Cinquin & Chikhaoui 2024) claims, and whether our figures bear it out."""

from __future__ import annotations

from typing import Any

from scenes.experiments.tubes import NEAR_INFEASIBLE
from server.report.claims import DIFFERENT, Claim
from server.report.tube_results import TubeResults
from server.report.tube_tasks import LABELS, LINES, PATHS

PRINTED = ("nspwln", "nspqp", "snsqp")
"""The methods of the paper."""
_QPS = ("nspqp", "snsqp")
_TWICE = 1.7
_LEFT_MM = 1e-3
"""Bounds left by less than this are kept."""
_SPEED_ALLOWED = 1.001


Documents = dict[tuple[str, str], dict[str, Any]]
"""A document of all starts by path and method."""


def tube_claims(results: TubeResults, speed_mm_s: float) -> list[Claim]:
    """All claims for which there are figures.

    Args:
        results: the finished runs.
        speed_mm_s: V_max of a tube's translation.
    """
    both: Documents = {}
    for path in PATHS:
        for method in (*PRINTED, "nspwln-repaired", "hqp"):
            document = results.all_starts(path, method)
            if document is None:
                return []
            both[path, method] = document
    found = [_converge(both), _twice(both), _lowest(both), _leaves(both), _keeps(both)]
    found += scaling_claims(results)
    return [*found, _least(both), _trade_off(both, speed_mm_s)]


def _converge(both: Documents) -> Claim:
    missed = sum(both[at]["points"] - both[at]["converged_points"] for at in both)
    total = sum(one["points"] for one in both.values())
    return Claim(
        "section 3",
        "All methods converge within the threshold (0.88 mm) at every point.",
        f"{total - missed} of {total} points, repaired NSPWLN and HQP included",
        missed == 0,
        "no point is left before it is reached",
    )


def _twice(both: Documents) -> Claim:
    def ratio(path: str, method: str) -> float:
        others = [both[path, one]["iterations"] for one in _QPS]
        return float(both[path, method]["iterations"] / (sum(others) / len(others)))

    return Claim(
        "section 3, Table 3",
        "NSPWLN needs almost twice as many iterations as the others.",
        "; ".join(
            f"{path}: {ratio(path, 'nspwln'):.2f} times as printed, "
            f"{ratio(path, 'nspwln-repaired'):.2f} times repaired"
            for path in PATHS
        )
        + ". It is the printed inverse that takes them, not the weighted norm",
        all(ratio(path, "nspwln") >= _TWICE for path in PATHS),
        f"as printed, at least {_TWICE:g} times the mean of NSPQP and SNSQP on both paths",
    )


def _lowest(both: Documents) -> Claim:
    def rms(path: str, method: str) -> float:
        return float(both[path, method]["relative_error_mm"]["rms"])

    return Claim(
        "section 3, Table 3",
        "NSPQP and SNSQP keep the relative position better than NSPWLN.",
        "; ".join(
            f"{path}: " + ", ".join(f"{LABELS[one]} {rms(path, one):.3f}" for one in PRINTED)
            for path in PATHS
        )
        + " mm rms. Repaired, NSPWLN has "
        + " and ".join(f"{rms(path, 'nspwln-repaired'):.3f}" for path in PATHS),
        all(rms(path, one) < (1.0 - DIFFERENT) * rms(path, "nspwln")
            for path in PATHS for one in _QPS),
        f"rms when a point is left at least {100 * DIFFERENT:.0f} % lower, both on both paths",
    )  # fmt: skip


def _violations(both: Documents, method: str) -> tuple[int, int, float]:
    """Runs that leave the bounds, all runs, and how far at most in mm."""
    runs = [one for path in PATHS for one in both[path, method]["configurations"]]
    out = [float(one["bound_violation_mm"]) for one in runs]
    return sum(one > _LEFT_MM for one in out), len(out), max(out)


def _leaves(both: Documents) -> Claim:
    count, total, worst = _violations(both, "nspwln")
    again, _, other = _violations(both, "nspwln-repaired")
    return Claim(
        "section 3, Fig. 2",
        "NSPWLN fails to respect the actuation limit in one case.",
        f"in {count} of {total} runs, by up to {worst:.1f} mm; repaired in {again}, by up to "
        f"{other:.1f} mm",
        count > 0,
        f"a bound is left by more than {_LEFT_MM:g} mm in any iteration of at least one run",
    )


def _keeps(both: Documents) -> Claim:
    words, holds = [], True
    for method in (*_QPS, "hqp"):
        count, total, worst = _violations(both, method)
        words.append(f"{LABELS[method]} leaves them in {count} of {total} runs, by up to "
                     f"{worst:.2g} mm" if count else f"{LABELS[method]} in none")  # fmt: skip
        holds = holds and (count == 0 or method == "hqp")
    return Claim(
        "sections 2.2, 3 and 4",
        "NSPQP and SNSQP keep the actuation limits.",
        "; ".join(words)
        + ". Their boxes are drawn anew at each step, and the neighbour that a bound hangs on "
        "moves V_max·T = 0.5 mm meanwhile",
        holds,
        f"no bound is left by more than {_LEFT_MM:g} mm in any iteration of any run",
    )


def scaling_claims(results: TubeResults) -> list[Claim]:
    """Whether SNSQP finishes where NSPQP stalls; empty without figures."""
    one, other = (results.all_starts(NEAR_INFEASIBLE, method) for method in _QPS)
    if one is None or other is None:
        return []
    pairs = list(zip(one["configurations"], other["configurations"], strict=True))
    stalls = [(a, b) for a, b in pairs if a["converged_points"] < a["points"]]
    finishes = [(a, b) for a, b in stalls if b["converged_points"] == b["points"]]
    if not stalls:
        words = "NSPQP stalls from no start"
    else:
        words = (
            f"NSPQP stalls from {_starts(stalls)} ({_points(stalls, 0)} points, "
            f"{sum(a['infeasible_qps'] for a, _ in stalls)} infeasible QPs); SNSQP reaches "
            f"{_points(stalls, 1)} there"
        )
    worst = max((b for _, b in pairs), key=lambda b: b["relative_error_mm"]["max_any_iteration"])
    words += (
        f". But SNSQP swings ε_AB to {worst['relative_error_mm']['max_any_iteration']:.0f} mm and "
        f"tubes to {worst['peak_rotation_rad_s']:.0f} rad/s from start {worst['configuration']}"
    )
    return [
        Claim(
            "sections 3 and 4",
            "Where a task is nearly infeasible, task scaling lets SNSQP finish and NSPQP fails.",
            words,
            bool(stalls) and len(finishes) == len(stalls),
            "there are starts from which NSPQP misses points, and SNSQP misses none from these",
        ),
        *_lines(results),
    ]


def _lines(results: TubeResults) -> list[Claim]:
    """Whether scaling brings SNSQP further toward places that cannot be reached."""
    one, other = (
        [run["converged_points"] for line in LINES for run in results.documents(line, method)]
        for method in _QPS
    )
    if not one or len(one) != len(other):
        return []
    pairs = list(zip(one, other, strict=True))
    further = sum(b > a for a, b in pairs)
    less = sum(b < a for a, b in pairs)
    return [
        Claim(
            "sections 3 and 4",
            "It also lets SNSQP go on where A comes near the end of its workspace.",
            f"of {len(pairs)} straight lines outward SNSQP gets further than NSPQP on {further}, "
            f"less far on {less}; mean way {sum(other) / len(other):.1f} against "
            f"{sum(one) / len(one):.1f} mm",
            further > less and sum(other) > (1.0 + DIFFERENT) * sum(one),
            f"further on more lines than less far, and at least {100 * DIFFERENT:.0f} % further in "
            "the mean",
        )
    ]


def _starts(pairs: list[tuple[dict[str, Any], dict[str, Any]]]) -> str:
    names = [a["configuration"] for a, _ in pairs]
    return f"start{'s' * (len(names) > 1)} {' and '.join(names)}"


def _points(pairs: list[tuple[dict[str, Any], dict[str, Any]]], which: int) -> str:
    reached = sum(pair[which]["converged_points"] for pair in pairs)
    return f"{reached} of {sum(pair[which]['points'] for pair in pairs)}"


def _translation(both: Documents, path: str, method: str) -> float:
    return float(both[path, method]["translation_total_mm"])


def _least(both: Documents) -> Claim:
    shown = (*PRINTED, "hqp")
    return Claim(
        "section 4",
        "Where tubes shall translate little, NSPWLN is preferable.",
        "; ".join(
            f"{path}: "
            + ", ".join(f"{LABELS[one]} {_translation(both, path, one):.0f}" for one in shown)
            for path in PATHS
        )
        + f" mm in all tubes. But it left the bounds in {_violations(both, 'nspwln')[0]} runs, "
        f"HQP in {_violations(both, 'hqp')[0]}",
        all(
            _translation(both, path, "nspwln") < (1.0 - DIFFERENT) * _translation(both, path, one)
            for path in PATHS for one in _QPS
        ),
        f"at least {100 * DIFFERENT:.0f} % below NSPQP and SNSQP on both paths",
    )  # fmt: skip


def _trade_off(both: Documents, speed_mm_s: float) -> Claim:
    def does_both(method: str) -> bool:
        return all(
            both[path, method]["peak_translation_mm_s"] <= _SPEED_ALLOWED * speed_mm_s
            and _translation(both, path, method)
            < 0.5 * min(_translation(both, path, one) for one in _QPS)
            for path in PATHS
        )

    def peak(method: str) -> float:
        return max(float(both[path, method]["peak_translation_mm_s"]) for path in PATHS)

    return Claim(
        "section 4",
        "Little translation and controlled speed exclude each other.",
        f"Peak speed: NSPWLN {peak('nspwln'):.1f}, NSPQP {peak('nspqp'):.1f}, SNSQP "
        f"{peak('snsqp'):.1f}, HQP {peak('hqp'):.1f} mm/s. "
        + (
            "It is so among the paper’s methods; HQP has both"
            if does_both("hqp") and not any(map(does_both, PRINTED))
            else "It is so among all methods"
            if not any(map(does_both, (*PRINTED, "hqp")))
            else "One of the paper’s methods has both"
        ),
        not any(map(does_both, (*PRINTED, "hqp"))),
        f"no method stays within {speed_mm_s:g} mm/s and below half the translation of NSPQP and "
        "SNSQP on both paths",
    )
