"""The report's page: targets first, then claims, experiments, dexterity, and how it was made."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import NamedTuple

from hardware.physics.preset import PRESETS
from robot.configuration import Configuration
from server.report import markup
from server.report.claims import claims
from server.report.experiment_plots import lambda_plot, residual_plot
from server.report.experiment_sections import PARTS, experiments
from server.report.markup import Cell
from server.report.measures import PAPER_TABLE_5, DexterityRow, Table5, table_5
from server.report.results import Results
from server.report.sensing_results import SensingResults
from server.report.sensing_sections import LINKS as SENSING_LINKS
from server.report.sensing_sections import sensing_sections
from server.report.targets import Verdict, verdicts
from server.report.tube_results import TubeResults
from server.report.tube_sections import LINKS, tube_sections
from server.report.tube_tasks import RANDOM_SEED
from server.report.verdict_tables import claims_section, verdict_cell
from server.run.tube_run import PERIOD_S

REALTIME_AT_LEAST = 2.0
_CIRCLES = ("circle", "circle-infeasible")
_FIT = """<ul>
<li><strong>Fit.</strong> The preset <em>paper</em> is tuned so that the open-loop test of the
actuation (<code>arc --compensation gain</code>) errs as the authors’ hardware did: 3° in θ, 6° in
δ. That the first rows above come close is therefore no validation. Two printed numbers do not
determine a robot; others would fit them too.</li>
<li><strong>Measured.</strong> Everything else follows from that robot and the controller, which
does not know the robot’s parameters. Gain, friction and offset that it compensates come from a
bending sweep of the same simulated robot, through its sensors.</li>
<li><strong>Not comparable.</strong> The paper’s circle is a simulation without a robot of its own;
its square, silicon and ring boards are hardware led by a human. Ours is one simulated robot led by
recorded paths. A smaller figure of ours is not a better robot.</li>
</ul>"""


class _Parts(NamedTuple):
    """Which parts the page has."""

    instrument: bool
    tubes: bool
    sensing: bool

    def heading(self) -> str:
        """The page's."""
        if sum(self) > 1:
            return f"{('Two', 'Three')[sum(self) - 2]} papers’ experiments on simulated robots"
        if self.tubes:
            return "Concentric tubes"
        if self.sensing:
            return "Shape and force sensing"
        return "The paper’s experiments on a simulated robot"


@dataclass(frozen=True)
class Conditions:
    """Under what the report's runs were made.

    Attributes:
        plant: name of the plant.
        preset: name of the preset.
        seeds: all seeds.
        seconds: how much of each path was played; None for all of it.
        realtime_factor: plant time over wall time of one run alone; None if not measured.
        version: of Keyhole.
        program: mark of the program.
        command: that makes the report again.
        failures: runs that could not be made, in words.
    """

    plant: str
    preset: str
    seeds: Sequence[int]
    seconds: float | None
    realtime_factor: float | None
    version: str
    program: str
    command: str
    failures: Sequence[str] = ()


def page(
    results: Results | None,
    configuration: Configuration,
    conditions: Conditions,
    tubes: TubeResults | None = None,
    sensing: SensingResults | None = None,
) -> str:
    """The whole page as HTML; it refers to nothing outside itself.

    Args:
        results: runs of the instrument; None without its part.
        configuration: what they were made under.
        conditions: the rest of it.
        tubes: runs of the concentric-tube arms; None without their part.
        sensing: runs of shape and force sensing; None without their part.
    """
    there = _Parts(results is not None, tubes is not None, sensing is not None)
    parts = [_head(conditions, there)]
    if results is not None:
        parts.append(_instrument(results, configuration, conditions))
    if tubes is not None:
        parts.append(tube_sections(tubes, configuration))
    if sensing is not None:
        parts.append(sensing_sections(sensing))
    parts.append(_made(configuration, conditions, results is not None, tubes, sensing))
    style = "".join(
        (resources.files(package) / name).read_text(encoding="utf-8")
        for package, name in (
            ("frontend_assets", "page/tokens.css"),
            ("server", "report/report.css"),
        )
    )
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="color-scheme" content="light dark">'
        f"<title>Keyhole: {_title(conditions, there)}</title>"
        f"<style>{style}</style></head><body><main>{''.join(parts)}</main></body></html>\n"
    )


def _instrument(results: Results, configuration: Configuration, conditions: Conditions) -> str:
    """All sections of the instrument."""
    table = table_5(results, configuration)
    return "".join(
        (
            _targets(verdicts(results, conditions.seconds is None), conditions),
            _fit(conditions),
            claims_section(
                "claims",
                "The paper’s claims",
                claims(results, table),
                "Each is decided by the rule beside it, on medians over the seeds. A claim that "
                "fails on this robot may hold on another; one that holds may owe it to the fit.",
            ),
            experiments(results, configuration),
            _twists(results, configuration),
            _dexterity(table) if table is not None else "",
        )
    )


def _title(conditions: Conditions, there: _Parts) -> str:
    parts = []
    if there.instrument:
        parts.append(f"the paper’s experiments, {markup.text(conditions.preset)} preset")
    if there.tubes:
        parts.append("concentric tubes")
    if there.sensing:
        parts.append("shape and force sensing")
    return "; ".join(parts)


def _head(conditions: Conditions, there: _Parts) -> str:
    seeds = ", ".join(map(str, conditions.seeds))
    words = f"Keyhole {conditions.version}"
    if there.instrument:
        words += (
            f", {conditions.plant} plant, preset {conditions.preset}, seeds {seeds}. Errors are "
            "desired minus true"
        )
    parts = [
        f"<header><h1>{there.heading()}</h1>",
        markup.paragraph(f"{words}. Research software, not a medical device."),
    ]
    notes = []
    if there.instrument and conditions.seconds is not None:
        notes.append(
            f"Only the first {conditions.seconds:g} s of each path were played: the figures show "
            "that the report works, and no target counts as met."
        )
    if there.instrument and conditions.plant == "kinematic":
        notes.append("The kinematic plant is exact: errors are numerical noise, nothing touches.")
    notes += [f"Not run: {failure}" for failure in conditions.failures]
    parts += [markup.paragraph(one, "note") for one in notes]
    if there.instrument:
        links = [("targets", "Targets"), ("fit", "Fit or measured"), ("claims", "Claims")]
        links += [(f"experiment-{part.experiment}", part.experiment) for part in PARTS]
        links += [("twists", "Twists and λ"), ("dexterity", "Table 5")]
        parts.append(_nav("Instrument", links))
    if there.tubes:
        parts.append(_nav("Concentric tubes", LINKS))
    if there.sensing:
        parts.append(_nav("Shape and force", SENSING_LINKS))
    shared = ("", "", "Both", "All")[sum(there)]
    parts.append(_nav(shared, [("made", "How it was made")]))
    return "".join(parts) + "</header>"


def _nav(name: str, links: Sequence[tuple[str, str]]) -> str:
    before = f"<strong>{name}</strong>" if name else ""
    anchors = "".join(f'<a href="#{anchor}">{markup.text(words)}</a>' for anchor, words in links)
    return f"<nav>{before}{anchors}</nav>"


def _targets(found: Sequence[Verdict], conditions: Conditions) -> str:
    rows: list[list[Cell | str]] = []
    for verdict in found:
        bound = verdict.bound
        row: list[Cell | str] = []
        if bound is verdict.target.bounds[0]:
            words = f"run {verdict.target.setting.words()}"
            row.append(Cell(words, "", len(verdict.target.bounds)))
        paper = "–" if bound.paper is None else f"{markup.number(bound.paper)} {bound.unit}"
        ours = f"{markup.number(verdict.worst)} {bound.unit}" if verdict.seed is not None else "–"
        row += [
            bound.words,
            Cell(paper, "number"),
            Cell(bound.allowed(), "number"),
            Cell(ours, "number"),
            Cell("–" if verdict.seed is None else str(verdict.seed), "number"),
            verdict_cell(None if verdict.worst is None else verdict.met, "met", "not met"),
            verdict.remark,
        ]
        rows.append(row)
    factor = conditions.realtime_factor
    fast = None if factor is None else factor >= REALTIME_AT_LEAST
    rows.append(
        [
            "speed at 500 Hz, alone",
            "real-time factor",
            Cell("–", "number"),
            Cell(f"≥ {REALTIME_AT_LEAST:g}", "number"),
            Cell(markup.number(factor), "number"),
            Cell("–", "number"),
            verdict_cell(fast, "met", "not met"),
            "controller and plant together",
        ]
    )
    heads = ("command", "figure", "#paper", "#wanted", "#ours, worst", "#seed", "verdict", "")
    met = sum(verdict.met for verdict in found) + bool(fast)
    return markup.section(
        "targets",
        "Targets",
        markup.paragraph(
            f"{met} of {len(found) + 1} met. Each figure is the worst over {len(conditions.seeds)} "
            f"seed{'s' * (len(conditions.seeds) != 1)}; a target is met only if every seed is "
            "within it and played its path to the end."
        ),
        markup.card(markup.table(heads, rows)),
    )


def _fit(conditions: Conditions) -> str:
    preset = PRESETS[conditions.preset]
    rows = [
        [field.name, _written(getattr(preset, field.name))]
        for field in dataclasses.fields(preset)
        if field.name != "name"
    ]
    return markup.section(
        "fit",
        "What is fit, what is measured",
        _FIT,
        "<details class='card'><summary>The preset’s parameters</summary>"
        + markup.table(("parameter (SI, unit in the name)", "value"), rows)
        + "</details>",
    )


def _written(value: object) -> str:
    if isinstance(value, tuple):
        return ", ".join(_written(one) for one in value)
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _twists(results: Results, configuration: Configuration) -> str:
    reference = configuration.priority.lambda_reference
    plots = (
        markup.figure(
            residual_plot(results, _CIRCLES, "residuals"),
            "What each case could not do of the commanded twist; compare Fig. 11. On a path that "
            "can be followed, all cases can carry out the whole twist, and priorities hardly "
            "matter.",
        ),
        markup.figure(
            lambda_plot(results, _CIRCLES, reference, "lambda"),
            f"λ against its reference {reference:g}; compare Fig. 12.",
        ),
    )
    return markup.section(
        "twists",
        "Twist residuals and λ, cases 0, 1 and 2",
        f'<div class="card plots">{"".join(plots)}</div>',
    )


def _dexterity(table: Table5) -> str:
    rows: list[list[Cell | str]] = [
        [source, f"case {case}", *(Cell(f"{value:.3g}", "number") for value in _values(row))]
        for source, by_case in (
            ("paper, as printed", PAPER_TABLE_5),
            ("ours, raw", table.raw),
            ("ours, projected", table.projected),
        )
        for case, row in by_case.items()
    ]
    heads = ("", "case", "#κ⁻¹ linear", "#κ⁻¹ angular", "#m linear", "#m angular")
    return markup.section(
        "dexterity",
        "Table 5: dexterity on the ring board",
        markup.paragraph(
            "Means along the true path through the rings, all seeds. Raw measures take J_L and J_A "
            "as eqs. (111) to (113) print them: they depend on the case only through the posture, "
            "so they cannot show what a priority does. Projected ones take the Jacobian on the "
            "null space of the levels above, which is what a level really has."
        ),
        markup.card(markup.table(heads, rows)),
        markup.paragraph(
            "The manipulability of J_L carries the arm’s lengths (m³ in SI units), and the paper "
            "does not give its unit: only ratios between cases compare. Its percentages do not "
            "follow from its own table either: 0.71 against 0.60 is 18 %, not 13.5 %; 0.68 against "
            "0.58 is 17 %, not 10.8 %.",
            "small",
        ),
    )


def _values(row: DexterityRow) -> tuple[float, ...]:
    return row.inverse_linear, row.inverse_angular, row.linear, row.angular


def _made(
    configuration: Configuration,
    conditions: Conditions,
    instrument: bool,
    tubes: TubeResults | None,
    sensing: SensingResults | None,
) -> str:
    rows = [
        ["Keyhole", conditions.version],
        ["program", conditions.program],
        ["configuration", f"{configuration.hash64():016x}"],
    ]
    if instrument:
        rows += [
            ["plant, preset", f"{conditions.plant}, {conditions.preset}"],
            ["seeds", ", ".join(map(str, conditions.seeds))],
            [
                "controller",
                f"{configuration.priority.solver}, {configuration.control.rate_hz:g} Hz",
            ],
            ["tracker, where it is on", _tracker(configuration)],
        ]
    if tubes is not None:
        rows += [
            [
                "concentric tubes",
                f"random configurations with seed {RANDOM_SEED}; T = {PERIOD_S:g} s",
            ],
            ["their runs and measurements took", f"{tubes.seconds:.0f} s, without what was kept"],
        ]
    if sensing is not None:
        took = f"{sensing.seconds:.0f} s, without what was kept"
        rows.append(["shape and force sensing took", took])
    rows.append(["again", conditions.command])
    return markup.section(
        "made",
        "How it was made",
        markup.card(markup.table(("", ""), rows)),
        markup.paragraph(
            "The runs stand beside this page: figures as JSON, traces as .npz (a row every 20 ms), "
            "all figures in table.csv. Those of the concentric tubes stand in tubes/, their traces "
            "with a row every inner iteration; those of sensing in sensing/, with arrays by name.",
            "small",
        ),
    )


def _tracker(configuration: Configuration) -> str:
    tracker = configuration.tracker
    return (
        f"{tracker.rate_hz:g} Hz, {tracker.delay_ms:g} ms late, noise "
        f"{tracker.position_noise_mm:g} mm and {tracker.orientation_noise_deg:g}° on each axis"
    )
