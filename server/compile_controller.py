"""Compile the control path of both robots once, so that the first start is not the slow one."""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor

import numpy as np

from robot.concentric.concentric_robot import ConcentricRobot
from robot.concentric.control import ControlReport, PairControl
from robot.concentric.design import METHODS
from robot.concentric.pair import PairKinematics, start_of
from scenes.experiments import experiment
from server.configuration_file import load
from server.control.warm_up import warm_up_tubes
from server.run.headless import HeadlessRun
from server.run.options import options_for

_STEP_M = 1e-3


def main() -> None:
    """Run a few ticks of each robot; every compiled function is then in the cache."""
    with ProcessPoolExecutor(1) as beside:
        # Nothing in it is shared with the instrument, whose functions are compiled meanwhile.
        tubes = beside.submit(_compile_tubes)
        _compile_instrument()
        tubes.result()
    warm_up_tubes(ConcentricRobot(load()))


def _compile_instrument() -> None:
    configuration = load()
    run = HeadlessRun(
        configuration, options_for(experiment("circle", configuration), configuration, "1")
    )
    ticks = iter(range(3))
    run.execute(lambda _: None, lambda: next(ticks, None) is None)


def _compile_tubes() -> None:
    """The model of the tubes, and an iteration of each method, without the robot around them."""
    design = load().concentric
    count = len(design.tubes)
    now, after, report = PairKinematics(count), PairKinematics(count), ControlReport(count)
    for method in METHODS:
        control = PairControl(design, 1.0 / design.rate_hz, method, keeps_limits=True)
        now.q[:] = start_of(design.starts[0])
        control.pair.evaluate_cold(now)
        desired = now.position[0] + _STEP_M
        control.step(now, desired, now.relative, np.zeros(3), after, report)


if __name__ == "__main__":
    main()
