"""Runs of shape and force sensing as tables for the terminal."""

from __future__ import annotations

from typing import Any

from scenes.experiments.sensing import COVERAGE, FORCE_LEVELS, PULL_RELEASE
from server.run.sensing_figures import CONSTANT, POLYNOMIAL
from server.run.sensing_options import MEAN_OF


def printed_sensing(document: dict[str, Any]) -> str:
    """A run for the terminal."""
    noise = document["noise"]
    lines = [
        f"{document['experiment']}, seed {document['seed']}: {document['ended']}",
        f"  noise        pose {noise['position_mm']:g} mm, {noise['angle_deg']:g} deg; tension "
        f"{noise['tension_n']:g} N; tendon length {noise['length_mm']:g} mm",
    ]
    if document["experiment"] == COVERAGE:
        return "\n".join(lines + _coverage_lines(document))
    found = document["calibrated"]
    lines += [
        f"  calibrated   EI {found['stiffness']:.4g} N m^2 "
        f"({found['stiffness_error_percent']:+.2f} % off), friction {found['friction']:.4f} "
        f"(true {document['true']['friction']:.4f})",
        "  shape error, mm              rms     mean      max",
    ]
    lines += [_shape_line(words, block["shape_error_mm"]) for words, block in _shapes(document)]
    if document["experiment"] == FORCE_LEVELS:
        lines += _level_lines(document)
    elif document["experiment"] == PULL_RELEASE:
        lines += _pair_lines(document)
    else:
        force = document["force_error_n"]
        lines.append(f"  force where there is none: ours {force['rms']:.4f} N rms")
    times = document["estimate_us"]
    lines.append(f"  estimate     {times['p50']:.0f} us, 99 % within {times['p99']:.0f} us")
    return "\n".join(lines)


def _shapes(document: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    found = [("ours", document)]
    found += [
        (f"ours, {known.replace('_', ' ')}", document[known])
        for known in ("axis_known", "no_contact")
        if known in document
    ]
    return [
        *found,
        ("polynomial curvature", document[POLYNOMIAL]),
        ("constant curvature", document[CONSTANT]),
        ("constant, with lengths", document[CONSTANT]["with_lengths"]),
    ]


def _shape_line(words: str, error: dict[str, float]) -> str:
    return f"    {words:<22} {error['rms']:8.4f} {error['mean']:8.4f} {error['max']:8.4f}"


def _level_lines(document: dict[str, Any]) -> list[str]:
    lines = [f"  force error, %               one  mean of {MEAN_OF}   (N, one)"]
    blocks = [(f"ours, {way.replace('_', ' ')}", block) for way, block in document["force"].items()]
    for method, words in ((POLYNOMIAL, "polynomial"), (CONSTANT, "constant")):
        for way, block in document[method]["force"].items():
            blocks.append((f"{words}, {way.replace('_', ' ')}", block))
    for words, block in blocks:
        mean = block.get(f"mean_of_{MEAN_OF}")
        many = "       -" if mean is None else f"{mean['force_error_percent']['rms']:8.2f}"
        lines.append(
            f"    {words:<25} {block['force_error_percent']['rms']:8.2f} {many}   "
            f"{block['force_error_n']['rms']:8.4f}"
        )
    lines.append("  level    true N   ours N (axis known)   (axis free)   polynomial   constant")
    for row in document["levels"]:
        force = row["force_n"]
        names = (
            "ours_axis_known",
            "ours_axis_free",
            "polynomial_axis_known",
            "constant_axis_known",
        )
        values = "   ".join(
            f"{force[name]['mean']:.4f}+-{force[name]['std']:.4f}" for name in names
        )
        lines.append(f"    {row['name'][-1]}     {row['true_n']:.4f}   {values}")
    return lines


def _pair_lines(document: dict[str, Any]) -> list[str]:
    lines = ["  tension per bend, N/rad      pulling  releasing  of EI/(L r)     rms off the line"]
    for pair in document["pairs"]:
        slope, ratio = pair["slope_n_per_rad"], pair["ratio"]
        lines.append(
            f"    {pair['name']:<22} {slope['pulling']:9.3f} {slope['releasing']:10.3f}  "
            f"{ratio['pulling']:.3f}, {ratio['releasing']:.3f}  "
            f"{pair['off_line_n']['pulling']:8.3f} N, {pair['off_line_n']['releasing']:.3f} N"
        )
    return lines


def _coverage_lines(document: dict[str, Any]) -> list[str]:
    known, free = document["axis_known"], document["axis_free"]
    wide = ", ".join(f"{ratio:.2f} {name}" for name, ratio in free["width_ratio"].items())
    return [
        f"  axis known   {known['inside']} of {document['trials']} inside the 95 % interval, "
        f"{known['width_ratio']:.2f} times as wide as the errors",
        f"  axis free    {free['inside']} of {document['trials']} inside the 95 % ellipsoid; as "
        f"wide as the errors: {wide}",
    ]
