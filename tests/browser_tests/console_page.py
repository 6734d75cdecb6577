"""The operator page in a real browser, used as a person does: with mouse and keyboard."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

import numpy as np
from playwright.sync_api import BrowserContext, Locator

from tests.server.console_process import ConsoleProcess, eventually

JSON = dict[str, Any]
Driven = TypeVar("Driven")

SCENE_S = 120.0
"""Without a graphics card, and beside other work, the first picture takes its time."""
SLOW_S = 30.0

STALLS = {"leader_stale", "control_late"}
DRIVES = 5
"""How often one drives anew where the browser or the machine stalled."""

GRIP_M = 0.045
"""Where on an arrow of the gizmo the mouse takes it, from the tip."""

# Drawing in software takes a processor that the console under test needs: a display of 15 Hz.
_SLOW_DISPLAY = """
window.requestAnimationFrame = (draw) => setTimeout(() => draw(performance.now()), 66);
window.cancelAnimationFrame = clearTimeout;
"""
_STATE = "() => window.keyhole?.state ?? null"
_SCENE = "const scene = document.getElementById('scene').contentWindow.__viserMutable;"
_HAS_GIZMO = f"""() => {{
  {_SCENE}
  return !!scene?.camera && !!scene.nodeRefFromName?.["/gizmo"];
}}"""
_GIZMO = f"""() => {{
  {_SCENE}
  const pose = scene.nodeRefFromName["/gizmo"].matrix.elements;
  return [pose[12] * 1e3, pose[13] * 1e3, pose[14] * 1e3];
}}"""
_PIXEL = f"""(local) => {{
  {_SCENE}
  const gizmo = scene.nodeRefFromName["/gizmo"];
  gizmo.updateWorldMatrix(true, false);
  const vector = new scene.camera.position.constructor(...local);
  const point = gizmo.localToWorld(vector).project(scene.camera);
  const outer = document.getElementById("scene").getBoundingClientRect();
  const inner = scene.canvas.getBoundingClientRect();
  return [
    outer.left + inner.left + ((point.x + 1) / 2) * inner.width,
    outer.top + inner.top + ((1 - point.y) / 2) * inner.height,
  ];
}}"""
# What the scene says when the mouse takes the gizmo, and nothing of its end.
_TAKE = f"""() => {{
  {_SCENE}
  scene.sendMessage({{ type: "TransformControlsDragStartMessage", name: "/gizmo", owner: "" }});
}}"""
# The gizmo paints what the mouse would take yellow; its first three lines are the arrows.
_LIT = f"""() => {{
  {_SCENE}
  const lines = [];
  scene.nodeRefFromName["/gizmo"].traverse((part) => {{
    if (part.type === "Line2") lines.push(part.material.color.getHexString() === "ffff40");
  }});
  return lines.flatMap((lit, index) => (lit ? [index] : []));
}}"""
_SCENE_BOX = "() => document.getElementById('scene').getBoundingClientRect().toJSON()"
_FOCUSED = "() => document.activeElement.id"


class Stalled(AssertionError):
    """The browser was silent while it led, or the machine stood: the robot is rightly paused."""


class ConsolePage:
    """One tab with the operator page.

    Args:
        context: the browser session that it belongs to.
        console: the console that serves it.

    Attributes:
        robot: the one that the console drives.
    """

    def __init__(self, context: BrowserContext, console: ConsoleProcess) -> None:
        self.context, self.console = context, console
        self.robot = "instrument"
        self.page = context.new_page()
        self.page.add_init_script(_SLOW_DISPLAY)
        self.page.goto(f"{console.base}/?token={console.token}")
        # The token leaves the address bar, and whatever else stood there with it.
        self.page.goto(f"{console.base}/?fixedDpr=0.25")
        eventually(lambda: self.page.evaluate(_STATE), "the page shows a state", SLOW_S)

    def button(self, name: str) -> Locator:
        """The page's button of that name."""
        return self.page.get_by_role("button", name=name)

    def shown(self) -> JSON:
        """The state that the page shows."""
        state = self.page.evaluate(_STATE)
        assert isinstance(state, dict)
        return state

    def call(self, method: str, path: str, body: Any = None) -> int:
        """Call the API with nothing but the browser session's cookie; returns the status."""
        address = f"{self.console.base}/api/v1/robots/{self.robot}{path}"
        return self.context.request.fetch(address, method=method, data=body).status

    def state(self) -> JSON:
        """The newest state, from the API; empty while the server does not answer."""
        with contextlib.suppress(OSError):
            state = self.console.call("GET", f"/api/v1/robots/{self.robot}/state")
            assert isinstance(state, dict)
            return state
        return {}

    def until(self, shown: str, within_s: float = SLOW_S) -> None:
        """Wait until the chip in the top bar says so."""
        chip = self.page.locator("#safety-state")
        eventually(lambda: chip.inner_text() == shown, f"the page says {shown}", within_s)

    # Driving

    def take_control(self) -> None:
        """Become the operator by the button, as soon as nobody else is."""
        if not self.shown()["operator"]["you"]:
            eventually(lambda: self.state()["operator"]["name"] is None, "nobody drives", SLOW_S)
            self.button("Take control").click()
        eventually(lambda: self.shown()["operator"]["you"], "this page drives", SLOW_S)

    def enable(self) -> None:
        """Enable by the button."""
        if self.state()["safety"]["state"] != "ENABLED":
            self.button("Enable").click()
        # A page that draws slowly may still show the time before it was paused.
        eventually(lambda: self.state()["safety"]["state"] == "ENABLED", "enabled", SLOW_S)
        self.until("ENABLED")

    def settle(self) -> None:
        """Drive an enabled robot that stands, with the settings of the configuration."""
        self.take_control()
        as_configured: JSON = {"motion_scale": 1.0, "alignment": "relative", "hold_to_move": False}
        as_configured |= {"lock_rotation": False, "lock_translation": False}
        priority = {"case": "1", "solver": "hqp", "coordinates": "uv"}
        assert self.call("DELETE", "/path") == 200
        assert self.call("PUT", "/priority", priority) == 200
        assert self.call("PUT", "/teleoperation", as_configured) == 200
        holds = self.page.get_by_role("switch", name="Hold-to-move")
        eventually(lambda: not holds.is_checked(), "the settings are shown", SLOW_S)
        if self.state()["safety"]["state"] == "FAULT":
            assert self.call("POST", "/reset") == 200
            self.until("DISABLED")
        self.enable()

    # The scene

    def wait_for_scene(self) -> None:
        """Wait until the mouse can take the gizmo."""
        page = self.page
        eventually(lambda: page.evaluate(_HAS_GIZMO), "the scene has a gizmo", SCENE_S, 0.2)
        # viser says that it draws in software, and covers a part of the scene with it.
        scene = page.frame_locator("#scene")
        for close in scene.locator(".mantine-Notification-closeButton").all():
            close.click(timeout=SCENE_S * 1e3)
        self.point_at(0)

    def gizmo_mm(self) -> list[float]:
        """Where this browser draws the gizmo, base frame."""
        position = self.page.evaluate(_GIZMO)
        assert isinstance(position, list)
        return position

    def pixel(self, axis: int, along_m: float) -> tuple[float, float]:
        """Where on the page the point of an arrow of the gizmo is seen that far from the tip."""
        local = [0.0, 0.0, 0.0]
        local[axis] = along_m
        x, y = self.page.evaluate(_PIXEL, local)
        return float(x), float(y)

    def point_at(self, axis: int) -> None:
        """Move the mouse to an arrow of the gizmo and wait until it lights up."""
        nudges = iter(range(10_000))

        def lit() -> bool:
            x, y = self.pixel(axis, GRIP_M)
            # A mouse that stays where it is sends no event.
            self.page.mouse.move(x + 0.5 * (next(nudges) % 2), y)
            return bool(self.page.evaluate(_LIT) == [axis])

        eventually(lit, f"arrow {axis} of the gizmo lights up", SCENE_S, 0.1)

    @contextlib.contextmanager
    def pulling(self, axis: int, distance_mm: float) -> Iterator[None]:
        """Hold an arrow of the gizmo, pulled along itself, for the length of the block."""
        start = self.pixel(axis, GRIP_M)
        end = self.pixel(axis, GRIP_M + distance_mm * 1e-3)
        self.point_at(axis)
        self.page.mouse.move(*start)
        self.page.mouse.down()
        self.page.mouse.move(*end, steps=4)
        try:
            yield
        finally:
            if not self.page.is_closed():
                self.page.mouse.up()

    def take_and_forget(self) -> None:
        """The scene takes the gizmo, and never says that it lets it go."""
        self.page.evaluate(_TAKE)

    def leading(self) -> JSON:
        """The newest state of a robot that must be enabled.

        Raises:
            Stalled: it was paused because this browser was silent, or a tick late.
        """
        state = self.state()
        if state["safety"]["reason_code"] in STALLS:
            raise Stalled(state["safety"]["reason"])
        assert state["safety"]["state"] == "ENABLED", state["safety"]
        return state

    def despite_stalls(self, drive: Callable[[], Driven]) -> Driven:
        """What ``drive`` returns, which is begun anew where the browser stalled in it.

        A browser that draws in software may stall for longer than a leader may be silent.
        """
        for _ in range(DRIVES - 1):
            try:
                return drive()
            except Stalled:
                self.enable()
                eventually(self.gizmo_is_at_the_tip, "the gizmo is put back", SLOW_S)
        return drive()

    def gizmo_is_at_the_tip(self) -> bool:
        """Whether this browser draws the gizmo where the robot's tip is."""
        tip = self.state()["true"]["position_mm"]
        return bool(np.allclose(self.gizmo_mm(), tip, atol=0.2))

    def focus_scene(self) -> None:
        """Click beside the robot, so that the scene has the keyboard."""
        box = self.page.evaluate(_SCENE_BOX)
        self.page.mouse.click(box["x"] + 20, box["y"] + box["height"] - 20)
        page = self.page
        eventually(lambda: page.evaluate(_FOCUSED) == "scene", "the scene has the focus", SLOW_S)
