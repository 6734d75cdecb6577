"""The proxy to viser: what passes, what does not, and that viser's own port is closed."""

from __future__ import annotations

import contextlib
import json
import math
import re
import socket
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import viser
import zstandard
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect
from websockets.sync.connection import Connection
from websockets.typing import Subprotocol

from server.web.viser_messages import LARGEST_MESSAGE, ViserFilter
from tests.server.api_client import JSON, ApiClient
from tests.server.console_process import ConsoleProcess, eventually

GIZMO = "/gizmo"
PROTOCOL = Subprotocol(f"viser-v{viser.__version__}")


def encoded(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


def drag(position: Any, wxyz: Any = (1.0, 0.0, 0.0, 0.0), name: str = GIZMO) -> bytes:
    pose = {"wxyz": list(wxyz), "position": [float(part) for part in position]}
    return encoded("TransformControlsUpdateMessage", name=name, owner="", **pose)


START = encoded("TransformControlsDragStartMessage", name=GIZMO, owner="")
END = encoded("TransformControlsDragEndMessage", name=GIZMO, owner="")
CAMERA = encoded(
    "ViewerCameraMessage", wxyz=[1, 0, 0, 0], position=[1.0, 0, 0], fov=0.8, near=0.01, far=100,
    image_height=600, image_width=800, look_at=[0, 0, 0], up_direction=[0, 0, 1],
)  # fmt: skip


class Scene:
    """A viser client, as far as the tests need one."""

    def __init__(
        self,
        client: ApiClient,
        protocol: Subprotocol = PROTOCOL,
        headers: dict[str, str] | None = None,
    ) -> None:
        headers = headers or {}
        sent = {"Authorization": client.http.headers["Authorization"], **headers}
        if "X-Keyhole-Lease" in client.http.headers:
            sent["X-Keyhole-Lease"] = client.http.headers["X-Keyhole-Lease"]
        self.socket = connect(
            client.console.base.replace("http://", "ws://") + "/viser",
            additional_headers=sent,
            subprotocols=[protocol],
            compression=None,
            max_size=50 * 1024 * 1024,
            proxy=None,
            close_timeout=0.2,
        )
        # viser counts a client only when it knows its camera.
        self.send(CAMERA)

    def send(self, frame: bytes) -> None:
        self.socket.send(frame)

    def messages(self, for_s: float) -> list[dict[str, Any]]:
        """What viser has sent so far, and within ``for_s``."""
        found: list[dict[str, Any]] = []
        ends = time.monotonic() + for_s
        with contextlib.suppress(TimeoutError):
            while True:
                frame = self.socket.recv(timeout=max(0.0, ends - time.monotonic()))
                assert isinstance(frame, bytes)
                found += unpacked(frame)
        return found


def unpacked(frame: bytes) -> list[dict[str, Any]]:
    size = int.from_bytes(frame[8:16], "little")
    inner = zstandard.ZstdDecompressor().decompress(frame[16 : 16 + size])
    return list(msgspec.msgpack.decode(inner)["messages"])


@pytest.fixture
def ready(console: ConsoleProcess, watcher: ApiClient) -> None:
    """The scene is loaded."""
    address = console.base + "/api/v1/health"
    eventually(lambda: watcher.http.get(address).json()["scene"] == "ready", "the scene", 30.0)


@pytest.fixture
def scene(ready: None, driver: ApiClient) -> Iterator[Scene]:
    """The operator's scene."""
    scene = Scene(driver)
    yield scene
    scene.socket.close()


@pytest.mark.parametrize(
    "frame", [CAMERA, encoded("GuiUpdateMessage", uuid="x", updates={"value": True})]
)
def test_what_moves_nothing_passes_for_everyone(frame: bytes) -> None:
    assert ViserFilter().passes(frame, is_operator=False)
    assert ViserFilter().passes(frame, is_operator=True)


@pytest.mark.parametrize("frame", [START, drag((0, 0, 0)), END])
def test_the_gizmo_passes_for_the_operator_only(frame: bytes) -> None:
    assert ViserFilter().passes(frame, is_operator=True)
    assert not ViserFilter().passes(frame, is_operator=False)


@pytest.mark.parametrize(
    "frame",
    [
        encoded("ShareUrlRequest"),
        encoded("ShareUrlDisconnect"),
        encoded("FileTransferStartUpload", source_component_uuid="x", transfer_uuid="y"),
        encoded("FileTransferPart", content=b"x"),
        encoded("RunJavascriptMessage", source="alert(1)"),
        encoded("GetRenderResponseMessage", payload=b"x"),
        encoded("CommandTriggerMessage", uuid="x"),
        encoded("ScenePointerMessage", event_type="click"),
        encoded("SceneNodeDragMessage", name=GIZMO),
        encoded("GuiUpdateMessage", uuid="x"),
        encoded("GuiUpdateMessage", uuid="x", updates=[1]),
        encoded("TransformControlsUpdateMessage", name=GIZMO, position=[0, 0, 0]),
        drag((math.nan, 0, 0)),
        drag((0, math.inf, 0)),
        drag((0, 0, 0), (0, 0, 0, 0)),
        drag((0, 0)),
        drag((0, 0, 0), name="x" * 300),
        encoded("TransformControlsDragStartMessage", name=GIZMO, owner="", excluded_self_client=0),
        encoded("GuiUpdateMessage", uuid="x", updates={"value": "y" * LARGEST_MESSAGE}),
        msgspec.msgpack.encode(["type", "ViewerCameraMessage"]),
        msgspec.msgpack.encode({"type": 1}),
        msgspec.msgpack.encode({}),
        b"",
        b"\xc1",
        b"\x81\xa4type",
        b"\x91" * 10_000,
    ],
)
def test_nothing_else_passes_even_from_the_operator(frame: bytes) -> None:
    assert not ViserFilter().passes(frame, is_operator=True)


def test_a_drag_that_began_with_the_lease_may_end_without_it() -> None:
    filtered = ViserFilter()
    assert filtered.passes(START, is_operator=True)
    assert not filtered.passes(drag((0, 0, 0)), is_operator=False)
    assert filtered.passes(END, is_operator=False)
    assert not filtered.passes(END, is_operator=False)
    assert filtered.passes(START, is_operator=True)
    assert [msgspec.msgpack.decode(frame) for frame in filtered.ends_of_drags()] == [
        msgspec.msgpack.decode(END)
    ]
    assert filtered.ends_of_drags() == []


def test_the_client_is_served_at_once_and_only_once(watcher: ApiClient) -> None:
    base = watcher.console.base
    page = watcher.http.get(base + "/viser/?websocket=ws://127.0.0.1/viser")
    assert page.status_code == 200
    assert page.headers["content-type"].startswith("text/html")
    assert "<html" in page.text
    again = watcher.http.get(base + "/viser/", headers={"If-None-Match": page.headers["etag"]})
    assert (again.status_code, again.content) == (304, b"")
    plain = watcher.http.get(base + "/viser/", headers={"Accept-Encoding": "identity"})
    assert plain.text == page.text
    assert watcher.http.get(base + "/viser/../../keyhole.toml").status_code == 404


@pytest.mark.usefixtures("ready")
def test_the_scene_comes_through(watcher: ApiClient) -> None:
    scene = Scene(watcher)
    assert scene.socket.subprotocol == PROTOCOL
    found = scene.messages(1.0)
    scene.socket.close()
    assert GIZMO in [one["name"] for one in found if one["type"] == "TransformControlsMessage"]


@pytest.mark.usefixtures("ready")
@pytest.mark.parametrize(
    ("headers", "status"),
    [({"Authorization": "Bearer wrong"}, 401), ({"Origin": "http://evil.example"}, 403)],
)
def test_the_scene_has_the_same_door(
    watcher: ApiClient, headers: dict[str, str], status: int
) -> None:
    with pytest.raises(InvalidStatus) as refusal:
        Scene(watcher, headers=headers)
    assert refusal.value.response.status_code == status


@pytest.mark.usefixtures("ready")
def test_another_protocol_is_not_passed_on(watcher: ApiClient) -> None:
    with pytest.raises(InvalidStatus):
        Scene(watcher, Subprotocol("something-else"))


def dragged(scene: Scene, state: JSON, millimetres: int) -> None:
    """Drag the gizmo from the tip along y in steps of 1 mm, as fast as a browser does."""
    start = np.array(state["true"]["position_mm"]) * 1e-3
    scene.send(START)
    for step in range(millimetres + 1):
        position = start + np.array([0.0, 1e-3 * step, 0.0])
        scene.send(drag(position, state["true"]["orientation_wxyz"]))
        time.sleep(0.05)


def test_the_operators_gizmo_moves_the_tip(scene: Scene, driver: ApiClient) -> None:
    before = driver.state()
    dragged(scene, before, 8)
    state = driver.until(
        lambda s: abs(s["true"]["position_mm"][1] - before["true"]["position_mm"][1] - 8.0) < 0.1,
        "8 mm along y",
    )
    assert state["leader"] == "gizmo"
    assert state["errors"]["rcm_mm"] <= 0.001
    scene.send(END)
    after = driver.until(lambda s: not s["engaged"], "let go")
    assert after["safety"]["state"] == "ENABLED"


@pytest.mark.usefixtures("ready")
def test_a_watchers_gizmo_moves_nothing(driver: ApiClient, watcher: ApiClient) -> None:
    before = driver.state()
    scene = Scene(watcher)
    dragged(scene, before, 8)
    after = driver.state()
    scene.send(END)
    scene.socket.close()
    assert after["true"] == before["true"]
    assert (after["engaged"], after["leader"]) == (False, "none")
    log = driver.http.get("/audit", params={"last": 200}).json()
    assert any("tried to drag the gizmo" in entry["text"] for entry in log)


def test_a_button_that_came_up_ends_a_drag_whose_end_got_lost(
    scene: Scene, driver: ApiClient
) -> None:
    dragged(scene, driver.state(), 3)
    driver.until(lambda s: s["engaged"], "dragging")
    with driver.stream() as stream:
        stream.send(json.dumps({"type": "let-go"}))
        driver.until(lambda s: not s["engaged"], "let go")
        scene.send(END)
        dragged(scene, driver.state(), 3)
        assert driver.until(lambda s: s["engaged"], "dragged again")["leader"] == "gizmo"
        scene.send(END)
        driver.until(lambda s: not s["engaged"], "let go again")


def test_closing_the_scene_mid_drag_lets_go(scene: Scene, driver: ApiClient) -> None:
    dragged(scene, driver.state(), 3)
    driver.until(lambda s: s["engaged"], "dragging")
    scene.socket.socket.shutdown(socket.SHUT_RDWR)
    began = time.monotonic()
    driver.until(lambda s: not s["engaged"], "let go")
    assert time.monotonic() - began < 1.0


def test_losing_the_lease_mid_drag_lets_go(scene: Scene, driver: ApiClient) -> None:
    dragged(scene, driver.state(), 3)
    driver.until(lambda s: s["engaged"], "dragging")
    driver.done("DELETE", "/lease")
    driver.forget_lease()
    driver.until(lambda s: s["safety"]["state"] == "PAUSED" and not s["engaged"], "paused")
    time.sleep(0.3)
    driver.take()
    driver.done("POST", "/enable")
    time.sleep(0.3)
    state = driver.state()
    assert (state["engaged"], state["safety"]["state"]) == (False, "ENABLED")


def test_a_public_tunnel_cannot_be_asked_for(scene: Scene) -> None:
    scene.messages(0.3)
    scene.send(encoded("ShareUrlRequest"))
    assert "ShareUrlUpdated" not in [one["type"] for one in scene.messages(1.0)]


def own_port(console: ConsoleProcess) -> int:
    """Viser's own port: what the web process listens on beside the public port."""
    _, pid = console.children()
    sockets = {
        link[8:-1]
        for entry in Path(f"/proc/{pid}/fd").iterdir()
        if (link := str(entry.readlink() if entry.is_symlink() else "")).startswith("socket:[")
    }
    public = int(re.findall(r":(\d+)$", console.base)[0])
    listening = "0A"
    for line in Path(f"/proc/{pid}/net/tcp").read_text().splitlines()[1:]:
        fields = line.split()
        address, _, port = fields[1].partition(":")
        if fields[3] == listening and fields[9] in sockets and int(port, 16) != public:
            assert address == "0100007F", "loopback only"
            return int(port, 16)
    raise AssertionError("viser does not listen")


@pytest.mark.usefixtures("ready")
@pytest.mark.parametrize(
    "headers", [{}, {"X-Keyhole-Proxy": "guess"}, {"Origin": "http://localhost"}]
)
def test_visers_own_port_listens_to_the_proxy_only(
    console: ConsoleProcess, driver: ApiClient, headers: dict[str, str]
) -> None:
    before = driver.state()
    with connect(
        f"ws://127.0.0.1:{own_port(console)}",
        subprotocols=[PROTOCOL],
        additional_headers=headers,
        compression=None,
        proxy=None,
    ) as direct:
        _speak_into(direct, before)
        with pytest.raises(ConnectionClosed):
            direct.recv(timeout=3.0)
    after = driver.state()
    assert after["true"] == before["true"]
    assert after["engaged"] is False
    assert "Traceback" not in console.errors()


def _speak_into(direct: Connection, state: dict[str, Any]) -> None:
    start = np.array(state["true"]["position_mm"]) * 1e-3
    with contextlib.suppress(ConnectionClosed):
        for frame in (START, drag(start), drag(start + np.array([0.0, 0.005, 0.0]))):
            direct.send(frame)
