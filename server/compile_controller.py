"""Compile the control path once, so that the first start is not the slow one."""

from __future__ import annotations

from robot.concentric.concentric_robot import ConcentricRobot
from scenes.experiments import experiment
from server.configuration_file import load
from server.control.warm_up import warm_up_tubes
from server.run.headless import HeadlessRun
from server.run.options import options_for


def main() -> None:
    """Run a few ticks; every compiled function is then in the cache."""
    configuration = load()
    run = HeadlessRun(
        configuration, options_for(experiment("circle", configuration), configuration, "1")
    )
    ticks = iter(range(3))
    run.execute(lambda _: None, lambda: next(ticks, None) is None)
    warm_up_tubes(ConcentricRobot(configuration))


if __name__ == "__main__":
    main()
