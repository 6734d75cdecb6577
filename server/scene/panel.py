"""viser's own panel: only what concerns the picture; everything else is on the operator page."""

from __future__ import annotations

import viser

from server.scene.camera import SceneCamera
from server.scene.robot_scene import RobotScene
from server.scene.trails import SceneTrails


class ScenePanel:
    """Views for one browser; what is shown, for all."""

    def __init__(
        self,
        server: viser.ViserServer,
        robot: RobotScene,
        camera: SceneCamera,
        trails: SceneTrails,
    ) -> None:
        """Build the panel, folded to its title."""
        gui = server.gui
        gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        gui.set_panel_label("Scene")
        views = gui.add_button_group(
            "View", camera.viewpoints.names, hint="Move the camera of this browser"
        )
        shown_frames = gui.add_checkbox(
            "Frames", robot.frames.visible, hint=f"{robot.frames.words}: x red, y green, z blue"
        )
        shown_trails = gui.add_checkbox(
            "Trails", True, hint="Last 20 s of the tip: desired blue and wide, true green and thin"
        )
        shown_shadows = gui.add_checkbox("Shadows", False, hint="Needs a graphics card")
        robot.add_controls(gui)
        gui.main_panel.minimize()

        @views.on_click
        async def _(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
            if event.client is not None:
                camera.show(event.client, views.value)

        @shown_frames.on_update
        async def _(_: object) -> None:
            robot.frames.visible = shown_frames.value

        @shown_trails.on_update
        async def _(_: object) -> None:
            trails.visible = shown_trails.value

        @shown_shadows.on_update
        async def _(_: object) -> None:
            robot.ground.shadows(shown_shadows.value)
