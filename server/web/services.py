"""What the parts of the web process share, made once per process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated

from fastapi import Depends
from starlette.requests import HTTPConnection
from starlette.responses import Response

from robot.configuration import Configuration
from server.audit.writer import AuditLog
from server.memory.link import WebLink
from server.memory.recording_link import RecordingLink
from server.memory.replay_link import ReplayLink
from server.memory.robot_selection import RobotSelection
from server.web.access import Access, Caller
from server.web.access_guard import caller_of
from server.web.api_leaders import PoseLeader, TargetLeader
from server.web.control_requests import ControlRequests
from server.web.dexterity_source import DexteritySource
from server.web.events import WebEvents
from server.web.gamepad_leader import GamepadLeader
from server.web.lease import Lease
from server.web.open_scenes import OpenScenes
from server.web.operator_watch import OperatorWatch
from server.web.recordings import Recordings
from server.web.state_source import StateSource
from server.web.stylus_bridge import StylusBridge
from server.web.trocar_view import TrocarView


@dataclass(frozen=True)
class Services:
    """Everything that the API, the stream and the proxy need.

    Attributes:
        configuration: of the robot.
        link: to the control process.
        access: who may speak.
        events: what is noted and told.
        lease: who drives.
        source: the newest state.
        requests: to the control process.
        target: the API's standing target.
        pose: the API's clutched leader.
        stylus: a bridge without ROS.
        gamepad: at the operator's browser.
        watch: over the operator.
        dexterity: where the tip is.
        trocar: how the shaft stands to the trocar.
        recordings: to the recorder process.
        replay: to the process that shows a recording; None where there is a robot.
        selection: of another robot, for the supervisor.
        scenes: that browsers show.
        scene: ``loading``, ``ready``, or why there is no scene.
    """

    configuration: Configuration
    link: WebLink
    access: Access
    events: WebEvents
    lease: Lease
    source: StateSource
    requests: ControlRequests
    target: TargetLeader
    pose: PoseLeader
    stylus: StylusBridge
    gamepad: GamepadLeader
    watch: OperatorWatch
    dexterity: DexteritySource
    trocar: TrocarView
    recordings: Recordings
    replay: ReplayLink | None
    selection: RobotSelection
    scenes: OpenScenes
    scene: Callable[[], str]

    def state(self, caller: Caller) -> Response:
        """The state message as ``caller`` sees it, as a response."""
        return Response(self.source.text(caller), media_type="application/json")


def _stands_right(_: object) -> None:
    """A robot without a trocar stands right wherever it stands."""


def make_services(
    configuration: Configuration,
    link: WebLink,
    access: Access,
    audit: AuditLog,
    scene: Callable[[], str],
) -> Services:
    """Put the services together."""
    lease = Lease(configuration.server.lease_seconds)
    recorder = RecordingLink(link.directory)
    replay = ReplayLink(link.directory) if ReplayLink.is_in(link.directory) else None
    source = StateSource(link, configuration, lease, recorder=recorder, replay=replay)
    target = TargetLeader(link, source, configuration)
    pose = PoseLeader(link, source, configuration)
    trocar = TrocarView(configuration)
    through_trocar = configuration.robot == "instrument"
    events = WebEvents(audit, lease)
    return Services(
        configuration,
        link,
        access,
        events,
        lease,
        source,
        ControlRequests(link, source, trocar.check_inserted if through_trocar else _stands_right),
        target,
        pose,
        StylusBridge(link, lease, configuration),
        GamepadLeader(link, source, configuration),
        OperatorWatch(link, source, lease, target, pose, events),
        DexteritySource(configuration),
        trocar,
        Recordings(recorder),
        replay,
        RobotSelection(link.directory),
        OpenScenes(),
        scene,
    )


def services_of(connection: HTTPConnection) -> Services:
    """The services of the application that a request came to."""
    services = connection.app.state.services
    assert isinstance(services, Services)
    return services


def _caller(connection: HTTPConnection) -> Caller:
    return caller_of(connection.scope)


def _operator(connection: HTTPConnection) -> Caller:
    caller = caller_of(connection.scope)
    services_of(connection).lease.check(caller)
    return caller


ServicesHere = Annotated[Services, Depends(services_of)]
AnyCaller = Annotated[Caller, Depends(_caller)]
Operator = Annotated[Caller, Depends(_operator)]
"""A caller who holds the lease; anybody else gets 403."""
