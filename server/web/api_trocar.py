"""The trocar: where it is, how it breathes, and the way out of it."""

from __future__ import annotations

from typing import Any

import numpy as np
from fastapi import APIRouter
from numpy.typing import NDArray
from starlette.responses import Response

from robot.configuration import Configuration
from robot.records import Solver
from robot.rotations import matrix_from_quaternion
from robot.segment import tip_rotation
from scenes.trocar_motion import Breathing
from scenes.withdrawal import Withdrawal
from server.memory.link_records import TrocarSource
from server.web.api_models import BreathingChange, TrocarEntry, TrocarRegistration
from server.web.api_robot import STATE
from server.web.control_requests import check_enabled, check_free
from server.web.services import Operator, Services, ServicesHere

router = APIRouter(tags=["trocar"])

_METRES = 1e-3
_LOCKS = ("lock_rotation", "lock_translation", "lock_arm")


def _entry(services: Services) -> TrocarEntry:
    record = services.source.fresh_record()
    status, stand = services.link.status(), services.trocar.stand(record)
    source, breathing = status["trocar_source"], status["breathing"]
    return TrocarEntry(
        position_mm=_millimetres(record["input"]["trocar_position"][0]),
        registered_mm=_millimetres(status["trocar_registered"]),
        method=source.name.lower(),
        distance_mm=round(stand.distance_m * 1e3, 4),
        **{"lambda": round(stand.lambda_along_shaft, 6)},
        inserted=services.trocar.is_inserted(stand),
        breathing_amplitude_mm=round(breathing.amplitude_m * 1e3, 6),
        breathing_period_s=breathing.period_s,
    )


def _millimetres(position: NDArray[np.float64]) -> list[float]:
    return [round(float(part) * 1e3, 4) for part in position]


@router.get("/trocar", summary="Where the trocar is, and how the shaft stands to it")
async def trocar(services: ServicesHere) -> TrocarEntry:
    """Distance and lambda are those of the shaft as the controller would take it over now."""
    return _entry(services)


@router.post("/trocar", summary="Register the trocar")
async def register(
    body: TrocarRegistration, services: ServicesHere, caller: Operator
) -> TrocarEntry:
    """Touch it with the tip, enter its position, or take the configured one. Not while ENABLED.

    A place that is entered must lie within 50 mm of the shaft's axis and between the limits of
    lambda. The robot can then be enabled once the shaft goes through it, to within 5 mm.
    """
    record = services.source.fresh_record()
    source = TrocarSource[body.method.upper()]
    if source == TrocarSource.TOUCH:
        place = services.trocar.tip(record)
    elif body.position_mm is not None:
        place = np.array(body.position_mm) * _METRES
    else:
        place = np.array(services.configuration.trocar.position_m)
    if source != TrocarSource.TOUCH:
        services.trocar.check_entered(record, place)
    await services.requests.register_trocar(source, place)
    return _entry(services)


@router.put("/trocar/breathing", summary="Let the trocar breathe")
async def breathing(body: BreathingChange, services: ServicesHere, caller: Operator) -> TrocarEntry:
    """In force with the next breath; an amplitude of 0 lets the present one end."""
    present = services.link.status()["breathing"]
    amplitude_m, period_s = present.amplitude_m, present.period_s
    if body.amplitude_mm is not None:
        amplitude_m = body.amplitude_mm * _METRES
    if body.period_s is not None:
        period_s = body.period_s
    await services.requests.breathe(Breathing(amplitude_m, period_s))
    return _entry(services)


def withdrawal_of(record: NDArray[Any], configuration: Configuration) -> Withdrawal:
    """The way out from where the (1,) ``record`` says that the instrument is commanded to be."""
    report = record["outcome"]["report"][0]
    u, v, along = report["x"][7:]
    tip, bend = np.empty((3, 3)), np.empty((3, 3))
    matrix_from_quaternion(report["commanded_wxyz"], tip)
    tip_rotation(u, v, bend)
    instrument = configuration.instrument
    return Withdrawal(
        tip @ bend.T,
        (float(u), float(v)),
        float(along),
        instrument.shaft_length_m,
        instrument.segment_length_m,
        configuration.limits.lambda_max,
    )


@router.post("/withdraw", summary="Straighten, then draw the shaft out", responses=STATE)
async def withdraw(services: ServicesHere, caller: Operator) -> Response:
    """Plays a path called ``withdrawal`` in the place of any other.

    The segment becomes straight while the shaft stands still; then the shaft comes out along its
    axis as far as the limit of lambda allows. Locks are taken off, and the solver becomes the
    lexicographic QP, which keeps all limits. 409 unless the robot is enabled and free.
    """

    def freely(settings: Any) -> None:
        for lock in _LOCKS:
            settings[lock] = 0
        settings["solver"] = Solver.HQP

    record = services.source.fresh_record()
    check_enabled(record)
    check_free(record)
    services.target.clear()
    await services.requests.stop_path()
    await services.requests.trocar_reached()
    services.lease.check(caller)
    await services.requests.settings(freely)
    withdrawal = withdrawal_of(services.source.fresh_record(), services.configuration)
    await services.requests.start_path(withdrawal.samples(), "withdrawal")
    return services.state(caller)
