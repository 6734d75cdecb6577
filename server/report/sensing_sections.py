"""The report's part on shape and force sensing, section by section."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from scenes.experiments.sensing import (
    CHIRP,
    CONTACT_BEND,
    FIGURE_LEVEL,
    FORCE_LEVELS,
    FREE_BENDS,
    PULL_RELEASE,
    SHAPE_FREE,
)
from server.report import markup
from server.report.markup import Cell
from server.report.sensing_plots import (
    CONTACT_METHODS,
    FREE_METHODS,
    chirp_plot,
    force_plot,
    shape_plot,
    tension_plot,
)
from server.report.sensing_results import SensingResults
from server.report.sensing_targets import SensingVerdict, sensing_verdicts
from server.report.sensing_tasks import NOISES, NOISY, QUIET, TENSIONS_N
from server.report.sensing_words import (
    arc_words,
    contact_words,
    free_words,
    mean_of,
    noise_words,
)
from server.report.verdict_tables import verdict_cell
from server.run.figure_table import figure
from server.run.sensing_options import FRICTION, LENGTH_NOISE_MM, TENSION_NOISE_N

LINKS = (
    ("sensing-targets", "Targets"),
    ("sensing-chirp", "Fig. 6: a module"),
    ("sensing-tension", "Fig. 7: tension"),
    ("sensing-free", "Figs. 9, 10: free bending"),
    ("sensing-contact", "Fig. 11: in contact"),
    ("sensing-force", "Fig. 12: force"),
    ("sensing-coverage", "Uncertainty"),
)
"""Anchors of the sections and what they are called."""
_SHAPES = (
    ("constant_curvature", "constant curvature, pose"),
    ("polynomial_curvature", "polynomial curvature (paper 3), pose"),
    ("", "ours, pose, lengths and tensions"),
    ("no_contact", "ours, told that nothing touches"),
    ("axis_known", "ours, contact axis known"),
    ("constant_curvature.with_lengths", "constant curvature, pose and lengths"),
)


def sensing_sections(results: SensingResults) -> str:
    """All of them, one after the other."""
    return "".join(
        (
            _head(results),
            _targets(sensing_verdicts(results)),
            _chirp(results),
            _tension(results),
            _free(results),
            _contact(results),
            _force(results),
            _coverage(results),
        )
    )


def _head(results: SensingResults) -> str:
    parts = [
        '<header id="sensing"><h1>Shape and force of a tendon-driven segment</h1>',
        markup.paragraph(
            "Paper 3 (Zhang, Chen & Wang): shape and contact force from the tip’s pose and the "
            "tendons’ tensions. The truth here is a simulated rod with friction, torsion and "
            "contact that shares nothing with the estimators; the paper’s was an instrument before "
            "a camera and a load cell, and it prints no numbers beside its plots, so only shapes "
            "of curves compare. Every seed is a rod of its own (stiffness and friction drawn "
            "within 5 %), calibrated by a noisy pull-release sweep of its own; no estimator "
            f"knows the true values. Besides the pose, tensions have {TENSION_NOISE_N:g} N and "
            f"tendon lengths {LENGTH_NOISE_MM:g} mm of noise."
        ),
    ]
    if not results.whole:
        words = "Only a few samples and trials of one seed were made: no target counts as met."
        parts.append(markup.paragraph(words, "note"))
    return "".join(parts) + "</header>"


def _targets(found: list[SensingVerdict]) -> str:
    rows: list[list[Cell | str]] = []
    for place, verdict in enumerate(found):
        row: list[Cell | str] = []
        if place == 0 or found[place - 1].what != verdict.what:
            row.append(Cell(verdict.what, "", sum(one.what == verdict.what for one in found)))
        ours = (
            "–" if verdict.worst is None else f"{markup.number(verdict.worst)} {verdict.bound.unit}"
        )
        row += [
            verdict.bound.words,
            Cell(verdict.bound.allowed(), "number"),
            Cell(ours, "number"),
            Cell("–" if verdict.seed is None else str(verdict.seed), "number"),
            verdict_cell(verdict.met, "met", "not met"),
            verdict.remark,
        ]
        rows.append(row)
    met = sum(verdict.met is True for verdict in found)
    return markup.section(
        "sensing-targets",
        "Targets of sensing",
        markup.paragraph(
            f"{met} of {len(found)} met, each by its worst seed. Shape errors are distances along "
            "the segment over all samples, of the estimate that knows nothing of the contact, as "
            "on the console. Forces are along the contact’s axis, in percent of each level’s own "
            "force, with the calibrated stiffness and friction."
        ),
        markup.card(
            markup.table(
                ("what", "figure", "#wanted", "#ours, worst", "#seed", "verdict", ""), rows
            )
        ),
    )


def _chirp(results: SensingResults) -> str:
    plot = markup.figure(
        chirp_plot(results, "sensing-chirp"),
        "Above: position of motor and pulley; below: torque on the springs, true and as cell and "
        "current tell it. Compare Fig. 6.",
    )
    documents = results.documents(CHIRP)
    if not plot or not documents:
        return ""
    one = documents[0]
    found = [
        ("motor, off the command", f"{1e3 * one['position_error_rad']['rms']:.2f} mrad"),
        ("pulley, off the command", f"{1e3 * one['pulley_error_rad']['rms']:.2f} mrad"),
    ]
    for band, lag in one["lag_deg"].items():
        found.append((f"motor lags, {band}", f"{lag:+.1f}°".replace("-", "−")))
    for name, error in one["torque_error_mnm"].items():
        found.append((f"torque from the {name}, off the true one", f"{error['rms']:.1f} mN m"))
    rows: list[list[Cell | str]] = [[words, Cell(value, "number")] for words, value in found]
    return markup.section(
        "sensing-chirp",
        "Fig. 6: one module of the tension unit follows a chirp",
        markup.paragraph(
            f"±{one['amplitude_rad']:g} rad from {one['frequency_hz']['from']:g} to "
            f"{one['frequency_hz']['to']:g} Hz against springs. Torque from the motor’s current "
            "contains the friction and inertia of motor and gear, turns them over with every "
            f"change of direction, and errs {one['current_over_cell']:.0f} times as much as the "
            "cell behind the gear. Motor, gear and springs are assumptions (their data are not "
            "printed), so figures show the effect, not the size that the paper’s module has."
        ),
        f'<div class="card plots">{plot}</div>',
        markup.card(markup.table(("rms", "#"), rows)),
    )


def _tension(results: SensingResults) -> str:
    plot = markup.figure(
        tension_plot(results, "sensing-tension"),
        "Above: both tendons of each pair, stop by stop. Below: the pulled tendon over the bend "
        "that the tendon lengths show, pulling (△) and releasing (▽), and the calibration’s "
        "lines; hollow marks are stops at which the pair turns around, which no line holds for.",
    )
    documents = results.documents(PULL_RELEASE)
    if not plot or not documents:
        return ""
    rows: list[list[Cell | str]] = []
    for pair in documents[0]["pairs"]:
        texts = (
            *(f"{pair['slope_n_per_rad'][name]:.2f}" for name in ("pulling", "releasing")),
            *(f"{pair['ratio'][name]:.3f}" for name in ("pulling", "releasing")),
            f"{max(pair['off_line_n'].values()):.3f}",
        )
        rows.append([pair["name"], *(Cell(text, "number") for text in texts)])
    heads = (
        *("pair", "#pulling, N/rad", "#releasing, N/rad", "#pulling, of EI/(L r)"),
        *("#releasing, of EI/(L r)", "#rms off a straight line, N"),
    )
    return markup.section(
        "sensing-tension",
        "Fig. 7: tension of pulled and released tendons",
        markup.paragraph(
            "Tension rises linearly with bend, as the paper says of its hardware; with friction it "
            "rises more steeply than it falls (1.087 and 0.911 of EI/(L r) at μ = 0.15), and "
            "between them lies the hysteresis that a calibration tells friction by. The paper’s "
            "panel (d) is captioned “pull cable 4, release cable 1”; opposite to 4 is 2."
        ),
        f'<div class="card plots">{plot}</div>',
        markup.card(markup.table(heads, rows)),
    )


def _free(results: SensingResults) -> str:
    plots = []
    for friction in (0.0, FRICTION):
        arrays = results.arrays(SHAPE_FREE, QUIET, friction)
        for case, bend in enumerate(FREE_BENDS):
            key = f"sensing-free-{case}-{'smooth' if friction == 0.0 else 'rough'}"
            words = "without friction" if friction == 0.0 else f"with friction, μ = {friction:g}"
            plots.append(
                markup.figure(
                    shape_plot(arrays, case, bend, FREE_METHODS, key),
                    f"{bend.words()}, {words}, pose noise {noise_words(QUIET)}; compare Fig. "
                    f"{9 + case}. Shapes of one sample, errors rms over all.",
                )
            )
    if not any(plots):
        return ""
    smooth, rough = (results.documents(SHAPE_FREE, None, one) for one in (0.0, FRICTION))
    return markup.section(
        "sensing-free",
        "Figs. 9 and 10: shapes in free bending",
        markup.paragraph(free_words(results)),
        markup.card(
            "<h3>Without friction: shape error, rms, mm</h3>",
            _shape_table(smooth),
            f"<h3>With friction, μ = {FRICTION:g}</h3>",
            _shape_table(rough),
        ),
        f'<div class="card plots">{"".join(plots)}</div>',
    )


def _shape_table(documents: Sequence[dict[str, Any]]) -> str:
    """Mean of the rms over the seeds: a row a method, a column a noise."""
    rows: list[list[Cell | str]] = []
    for block, words in _SHAPES:
        place = f"{block}.shape_error_mm.rms".removeprefix(".")
        row: list[Cell | str] = [words]
        for noise in NOISES:
            own = [
                one
                for one in documents
                if (one["noise"]["position_mm"], one["noise"]["angle_deg"]) == noise
            ]
            there = bool(own) and figure(own[0], place) is not None
            row.append(Cell(f"{mean_of(own, place):.3f}" if there else "–", "number"))
        if any(isinstance(cell, Cell) and cell.text != "–" for cell in row):
            rows.append(row)
    return markup.table(("method", *(f"#{noise_words(noise)}" for noise in NOISES)), rows)


def _contact(results: SensingResults) -> str:
    plots = [
        markup.figure(
            shape_plot(
                results.arrays(FORCE_LEVELS, noise, FRICTION),
                *(FIGURE_LEVEL, CONTACT_BEND, CONTACT_METHODS, f"sensing-contact-{place}"),
            ),
            f"Level {FIGURE_LEVEL + 1}, {CONTACT_BEND.words()}, pose noise {noise_words(noise)}; "
            "compare Fig. 11.",
        )
        for place, noise in enumerate((QUIET, NOISY))
    ]
    if not any(plots):
        return ""
    return markup.section(
        "sensing-contact",
        "Fig. 11: shapes in contact",
        markup.paragraph(contact_words(results)),
        f'<div class="card plots">{"".join(plots)}</div>',
        markup.card(
            "<h3>Shape error over all five levels, rms, mm</h3>",
            _shape_table(results.documents(FORCE_LEVELS)),
        ),
    )


_FORCE_ROWS = (
    ("force.axis_known", "ours, axis known"),
    ("force.axis_free", "ours, axis free"),
    ("polynomial_curvature.force.axis_known", "polynomial, no moment, axis known"),
    ("polynomial_curvature.force.without_moment", "polynomial, no moment, axis free"),
    ("polynomial_curvature.force.equation_43", "polynomial, eq. (43) with a moment"),
    ("constant_curvature.force.axis_known", "constant, no moment, axis known"),
    ("constant_curvature.force.without_moment", "constant, no moment, axis free"),
    ("constant_curvature.force.equation_43", "constant, eq. (43) with a moment"),
)


def _force(results: SensingResults) -> str:
    plots = [
        markup.figure(
            force_plot(results, noise, f"sensing-force-{place}"),
            f"Pose noise {noise_words(noise)}, seed 1; compare Fig. 12. Marks are means over the "
            "samples, bars one standard deviation of a single sample; all of them along the "
            "platform’s normal, which is what its load cell measures.",
        )
        for place, noise in enumerate((QUIET, NOISY))
    ]
    if not any(plots):
        return ""
    rows: list[list[Cell | str]] = []
    for block, words in _FORCE_ROWS:
        row: list[Cell | str] = [words]
        for noise in (QUIET, NOISY):
            own = results.documents(FORCE_LEVELS, noise)
            for place in (
                *("force_error_percent.rms", "mean_of_20.force_error_percent.rms"),
                "vector_error_n.rms",
            ):
                there = bool(own) and figure(own[0], f"{block}.{place}") is not None
                value = mean_of(own, f"{block}.{place}") if there else None
                row.append(Cell(markup.number(value), "number"))
        rows.append(row)
    noises = (noise_words(QUIET), noise_words(NOISY))
    heads = ["force along the normal", *(f"#{words}: {what}" for words in noises for what in (
        "one sample, %", "mean of 20, %", "whole vector, N"))]  # fmt: skip
    return markup.section(
        "sensing-force",
        "Fig. 12: contact forces",
        markup.paragraph(
            "Eq. (43) taken as printed lets force and moment trade against each other; from an arc "
            "it finds no force at all. Without a moment the component along the normal is found by "
            "every method, and "
            + arc_words(results)
            + " What none finds without knowing the axis is the force in the bending plane across "
            "the normal (whole vector): tip pose and tensions hardly show it, and the covariance "
            "of ours says so. Means over the seeds."
        ),
        f'<div class="card plots">{"".join(plots)}</div>',
        markup.card(markup.table(heads, rows)),
        _tension_noise(results),
    )


def _tension_noise(results: SensingResults) -> str:
    """What the tensions' noise costs, seed 1."""
    rows: list[list[Cell | str]] = []
    for tension in sorted((*TENSIONS_N, TENSION_NOISE_N)):
        own = results.documents(FORCE_LEVELS, NOISY, FRICTION, tension)[:1]
        if not own:
            continue
        values = [
            figure(own[0], place)
            for place in (
                *("force_error_percent.rms", "mean_of_20.force_error_percent.rms"),
                "polynomial_curvature.force.axis_known.force_error_percent.rms",
                *("shape_error_mm.rms", "axis_known.shape_error_mm.rms"),
            )
        ]
        numbers = [value if isinstance(value, float) else None for value in values]
        cells = [Cell(markup.number(value), "number") for value in numbers]
        rows.append([f"{tension:g} N", *cells])
    heads = (
        *("noise of a tension", "#force, axis known, one sample, %", "#mean of 20, %"),
        *("#the paper’s, axis known, one sample, %", "#shape, mm", "#shape, axis known, mm"),
    )
    return markup.card(
        f"<h3>What the tensions’ noise costs, pose noise {noise_words(NOISY)}, seed 1</h3>",
        markup.table(heads, rows),
        markup.paragraph(
            "Once the axis is known the pose hardly matters, and the tensions decide. 0.02 N is a "
            "cell of 1.5 mN m, read at 1 kHz over a pulley of 10 mm, averaged over 60 ms; 0.15 N "
            "is a single reading of it.",
            "small",
        ),
    )


def _coverage(results: SensingResults) -> str:
    covered = results.coverage()
    if covered is None:
        return ""
    free, known = covered["axis_free"], covered["axis_known"]
    rows: list[list[Cell | str]] = [
        [
            "along the known axis",
            Cell(f"{known['inside']}/{covered['trials']}", "number"),
            Cell(f"{known['width_ratio']:.2f}", "number"),
            Cell(f"{1e3 * covered['force_error_n']['rms']:.1f}", "number"),
        ]
    ]
    for place, (name, ratio) in enumerate(free["width_ratio"].items()):
        row: list[Cell | str] = [f"axis free, {name}"]
        if place == 0:
            inside = f"{free['inside']}/{covered['trials']}"
            row.append(Cell(inside, "number", len(free["width_ratio"])))
        row += [
            Cell(f"{ratio:.2f}", "number"),
            Cell(f"{1e3 * free['error_n'][name]['rms']:.1f}", "number"),
        ]
        rows.append(row)
    noise = covered["noise"]
    heads = ("force", "#true one inside the 95 % region", "#width over the errors’ spread")
    return markup.section(
        "sensing-coverage",
        "What the covariance is worth",
        markup.paragraph(
            f"{covered['trials']} trials at {noise['position_mm']:g} mm, {noise['angle_deg']:g}°, "
            "each with a calibration of its own, over the five levels. A region is worth something "
            "if it holds the truth as often as it says and is not wider than need be: a width of 1 "
            "is the errors’ own spread."
        ),
        markup.card(markup.table((*heads, "#error, rms, mN"), rows)),
    )
