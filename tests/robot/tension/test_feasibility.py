"""What a robot's tendons can be asked for, and the refusals of everything else."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from robot.configuration import Configuration, parse
from robot.errors import ConfigurationError
from robot.tension.feasibility import (
    LEAST_STIFFNESS,
    CoContractionRefused,
    TensionsNotMeasured,
    bending_stiffness,
    check_configured,
    check_tendons,
    largest_co_contraction,
    measures_tension,
)
from robot.tension.records import TendonMode
from server.configuration_file import load

T, P = TendonMode.TENSION, TendonMode.POSITION


def changed(section: str, **values: Any) -> Configuration:
    under = load(None)
    return under.model_copy(update={section: getattr(under, section).model_copy(update=values)})


def test_lengths_stiffen_the_bend_and_tensions_soften_it() -> None:
    configuration = load(None)

    def along_u(modes: list[TendonMode], tension: float) -> float:
        found = bending_stiffness(configuration, np.array(modes), np.full(4, tension))
        assert found[0, 1] == found[1, 0] == 0.0
        return float(found[0, 0])

    backbone = configuration.sensing.bending_stiffness_n_m2 / 0.03
    tendon = configuration.sensing.tendon_stiffness_n_m * 0.0018**2
    assert along_u([T] * 4, 0.0) == pytest.approx(backbone)
    assert along_u([P, P, T, T], 0.0) == pytest.approx(backbone + tendon)
    assert along_u([P] * 4, 0.0) == pytest.approx(backbone + 2.0 * tendon)
    assert along_u([T] * 4, 3.0) < along_u([T] * 4, 0.0)


def test_the_largest_co_contraction_leaves_the_backbone_its_share() -> None:
    configuration = load(None)
    largest, why = largest_co_contraction(configuration)
    modes = np.full(4, T)
    left = bending_stiffness(configuration, modes, np.full(4, largest))
    assert np.diagonal(left) == pytest.approx(
        LEAST_STIFFNESS * bending_stiffness(configuration, modes, np.zeros(4))[0, 0]
    )
    assert "backbone" in why
    check_tendons(configuration, "hybrid", largest - 0.01, cells=True)
    with pytest.raises(CoContractionRefused, match=r"at most 8.44 N") as refused:
        check_tendons(configuration, "tension", 9.0, cells=True)
    assert refused.value.wanted == 9.0
    assert refused.value.largest == pytest.approx(largest)
    # Where lengths alone are held it is no matter.
    check_tendons(configuration, "position", 9.0, cells=True)


def test_a_low_limit_leaves_half_for_bending() -> None:
    largest, why = largest_co_contraction(changed("tendons", tension_limit_n=8.0))
    assert largest == 4.0
    assert "half" in why


def test_tensions_that_nothing_measures_are_refused() -> None:
    with pytest.raises(TensionsNotMeasured, match="--actuation tension-unit") as refused:
        check_configured(changed("tendons", control="hybrid"))
    assert refused.value.control == "hybrid"
    assert not measures_tension(load(None))
    unit = changed("simulation", actuation="tension-unit")
    assert measures_tension(unit)
    check_configured(unit)
    held = unit.model_copy(
        update={"tendons": unit.tendons.model_copy(update={"control": "tension"})}
    )
    check_configured(held)
    exact = held.simulation.model_copy(update={"plant": "kinematic"})
    with pytest.raises(TensionsNotMeasured):
        check_configured(held.model_copy(update={"simulation": exact}))


def test_a_file_cannot_ask_for_more_than_half_of_the_limit() -> None:
    table = load(None).model_dump()
    table["tendons"] = {**table["tendons"], "co_contraction_n": 20.0, "tension_limit_n": 30.0}
    with pytest.raises(ConfigurationError, match="half of tension_limit_n"):
        parse(table, "own.toml")
