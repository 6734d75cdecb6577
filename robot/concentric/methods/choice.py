"""The methods by their names in the configuration."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from robot.concentric.design import METHODS
from robot.concentric.methods.hqp import Hqp
from robot.concentric.methods.nspqp import Nspqp
from robot.concentric.methods.nspwln import PrintedNspwln, RepairedNspwln
from robot.concentric.methods.rate_problem import RateProblem, Solution
from robot.concentric.methods.snsqp import Snsqp
from robot.errors import UnknownName


class Method(Protocol):
    """A way to resolve the redundancy.

    Attributes:
        name: as in the configuration.
        corrects: whether what a step is off by curvature is taken back within the sample.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def corrects(self) -> bool: ...  # noqa: D102

    def solve(self, problem: RateProblem) -> Solution:
        """Fill ``problem.rates`` (and ``problem.scales``) for what else the problem holds."""
        ...


_MAKERS: dict[str, Callable[[RateProblem], Method]] = {
    "nspwln": lambda _: PrintedNspwln(),
    "nspwln-repaired": lambda _: RepairedNspwln(),
    "nspqp": lambda problem: Nspqp(problem.tubes),
    "snsqp": lambda problem: Snsqp(problem.tubes),
    "hqp": Hqp,
}


def method_named(name: str, problem: RateProblem) -> Method:
    """The method called ``name``, for problems of this size; raises ``UnknownName``."""
    if name not in _MAKERS:
        raise UnknownName("method", name, METHODS)
    return _MAKERS[name](problem)
