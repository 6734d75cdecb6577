"""viser's own panel: only what concerns the picture; everything else is on the operator page."""

from __future__ import annotations

import viser

from server.scene.camera import NAMES, SceneCamera
from server.scene.frames import SceneFrames
from server.scene.ground import SceneGround
from server.scene.trails import SceneTrails
from server.scene.trocar import WALL_OPACITY, SceneTrocar


class ScenePanel:
    """Views for one browser; what is shown, for all."""

    def __init__(
        self,
        server: viser.ViserServer,
        camera: SceneCamera,
        frames: SceneFrames,
        trails: SceneTrails,
        trocar: SceneTrocar,
        ground: SceneGround,
    ) -> None:
        """Build the panel, folded to its title."""
        gui = server.gui
        gui.configure_theme(control_width="small", show_logo=False, show_share_button=False)
        gui.set_panel_label("Scene")
        views = gui.add_button_group("View", NAMES, hint="Move the camera of this browser")
        shown_frames = gui.add_checkbox(
            "Frames", False, hint="Axes of base, flange, trocar and tip: x red, y green, z blue"
        )
        shown_trails = gui.add_checkbox(
            "Trails", True, hint="Last 20 s of the tip: desired blue and wide, true green and thin"
        )
        shown_shadows = gui.add_checkbox("Shadows", False, hint="Needs a graphics card")
        opacity = gui.add_slider(
            "Wall opacity",
            min=0.0,
            max=1.0,
            step=0.05,
            initial_value=WALL_OPACITY,
            hint="Of the body wall: 0 hides it, 1 is opaque",
        )
        gui.main_panel.minimize()

        @views.on_click
        async def _(event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
            if event.client is not None:
                camera.show(event.client, views.value)

        @shown_frames.on_update
        async def _(_: object) -> None:
            frames.visible = shown_frames.value

        @shown_trails.on_update
        async def _(_: object) -> None:
            trails.visible = shown_trails.value

        @shown_shadows.on_update
        async def _(_: object) -> None:
            ground.shadows(shown_shadows.value)

        @opacity.on_update
        async def _(_: object) -> None:
            trocar.fade(opacity.value)
