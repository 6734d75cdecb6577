"""What a headless run is asked to do, and the configuration that it then runs under."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

from robot.configuration import Configuration
from robot.errors import UnknownName
from robot.priority.levels import CASE_NAMES
from robot.tension.feasibility import CONTROL_NAMES
from scenes.experiments import Experiment
from scenes.path import Path

PlantName = Literal["physics", "kinematic"]
PresetName = Literal["ideal", "paper", "harsh"]
ActuationName = Literal["servos", "tension-unit"]
CompensationName = Literal["off", "gain", "full"]
PLANTS: tuple[PlantName, ...] = get_args(PlantName)
PRESETS: tuple[PresetName, ...] = get_args(PresetName)
ACTUATIONS: tuple[ActuationName, ...] = get_args(ActuationName)
COMPENSATIONS: tuple[CompensationName, ...] = get_args(CompensationName)
SEED_MAX = 2**31 - 1


@dataclass(frozen=True)
class RunOptions:
    """What to run. What is None stays as the configuration has it.

    Attributes:
        experiment: its name, for the result.
        path: what the tip shall do.
        case: name of the priority case.
        solver: name of the solver.
        coordinates: name of the segment coordinates.
        plant: ``physics`` or ``kinematic``.
        preset: how good the simulated robot is.
        seed: draws what differs between robots of one preset.
        actuation: what drives the tendons; the tension unit measures their tension.
        board: what stands before the instrument.
        tracker: whether a tip tracker is there and used.
        compensation: how stretch and friction of the tendons are met.
        tendons: what their drives hold: ``position``, ``hybrid`` or ``tension``.
        co_contraction: tension that no tendon falls below in the last two, N.
        lock_arm: whether the arm stands still.
        realtime: whether the wall clock paces the run.
        from_start: whether the path begins at the configuration's start, as boards want it, rather
            than where the tip is.
        marks: times of the path that matter, s (see :class:`scenes.experiments.Experiment`).
    """

    experiment: str
    path: Path
    case: str
    solver: str
    coordinates: str
    plant: str | None = None
    preset: str | None = None
    seed: int | None = None
    actuation: str | None = None
    board: str | None = None
    tracker: bool | None = None
    compensation: str | None = None
    tendons: str | None = None
    co_contraction: float | None = None
    lock_arm: bool = False
    realtime: bool = False
    from_start: bool = False
    marks: tuple[float, ...] = ()

    def applied(self, configuration: Configuration) -> Configuration:
        """The configuration with these options in it."""
        simulation: dict[str, Any] = {
            "plant": self.plant,
            "preset": self.preset,
            "seed": self.seed,
            "actuation": self.actuation,
            "board": self.board,
        }
        priority = {"case": self.case, "solver": self.solver, "coordinates": self.coordinates}
        sections: dict[str, dict[str, Any]] = {
            "priority": priority,
            "simulation": simulation,
            "tracker": {"enabled": self.tracker},
            "compensation": {"mode": self.compensation},
            "tendons": {"control": self.tendons, "co_contraction_n": self.co_contraction},
        }
        update = {
            name: getattr(configuration, name).model_copy(
                update={key: value for key, value in values.items() if value is not None}
            )
            for name, values in sections.items()
        }
        return configuration.model_copy(update=update)


def check_names(options: RunOptions) -> None:
    """Raise :class:`robot.errors.UnknownName` for a name that does not exist."""
    for kind, name, known in (
        ("priority case", options.case, tuple(CASE_NAMES)),
        ("plant", options.plant, PLANTS),
        ("preset", options.preset, PRESETS),
        ("actuation", options.actuation, ACTUATIONS),
        ("compensation", options.compensation, COMPENSATIONS),
        ("tendon control", options.tendons, tuple(CONTROL_NAMES)),
    ):
        if name is not None and name not in known:
            raise UnknownName(kind, name, tuple(known))


def cut(path: Path, seconds: float | None) -> Path:
    """The path's first ``seconds`` (two samples at least), or all of it for None."""
    if seconds is None or seconds >= path.duration_s:
        return path
    count = max(2, int((path.samples[:, 0] <= seconds).sum()))
    return Path(path.samples[:count], path.name)


def options_for(
    experiment: Experiment, configuration: Configuration, case: str, **more: Any
) -> RunOptions:
    """Options that play an experiment on its own board, solver and coordinates as configured.

    Args:
        experiment: what to play.
        configuration: where solver and coordinates come from.
        case: name of the priority case.
        more: other fields of :class:`RunOptions`.
    """
    priority = configuration.priority
    fields: dict[str, Any] = {
        "path": experiment.path,
        "solver": priority.solver,
        "coordinates": priority.coordinates,
        "board": experiment.board,
        "lock_arm": experiment.lock_arm,
        "from_start": True,
        "marks": experiment.marks,
    }
    return RunOptions(experiment=experiment.name, case=case, **(fields | more))
