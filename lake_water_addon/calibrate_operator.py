# SPDX-License-Identifier: GPL-3.0-or-later
"""The buttons of the calibration: measure, with a progress that a person sees and can cancel, and show."""

from __future__ import annotations

import traceback
from dataclasses import dataclass

import bpy
import gpu
from bpy.props import EnumProperty

from . import calibration_plot
from .bench import CalibrationError
from .calibration import Calibration, store
from .core.snapshot import Camera, SceneSnapshot
from .extract import camera_from_object, camera_from_view
from .host import Host
from .registration import register_classes, unregister_classes
from .render.targets import TargetError

INTERVAL = 0.02
"""s from the end of a step to the next, in which Blender draws and hears the Escape key."""


@dataclass(eq=False)
class _Running:
    """A calibration that a window waits for."""

    calibration: Calibration
    scene: int  # its session_uid: the scene itself may have moved in memory
    view: str
    window_manager: bpy.types.WindowManager
    workspace: bpy.types.WorkSpace
    timer: bpy.types.Timer
    screen: gpu.types.GPUFrameBuffer | None = None  # of the window whose graphics context drew last

    def use_context(self, screen: gpu.types.GPUFrameBuffer) -> None:
        """Draw with a new host where the context is another window's, in which framebuffers are void."""
        if self.screen is not None and screen != self.screen:
            self.calibration.bench.host = Host()
        self.screen = screen

    def end(self) -> None:
        """Leave nothing of it on the screen."""
        self.window_manager.event_timer_remove(self.timer)
        self.window_manager.progress_end()
        self.workspace.status_text_set(None)
        redraw_panels(self.window_manager)


class _State:
    """What lives between register() and unregister()."""

    def __init__(self) -> None:
        self.running: _Running | None = None


_state: _State | None = None


def running() -> tuple[float, str] | None:
    """(0 to 1, what it is at) of the calibration that is running; None without one."""
    if _state is None or _state.running is None:
        return None
    calibration = _state.running.calibration
    return calibration.progress, calibration.doing


def redraw_panels(window_manager: bpy.types.WindowManager) -> None:
    """Draw what shows the calibration, and not the viewports."""
    for window in window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
            elif area.type in {"VIEW_3D", "IMAGE_EDITOR"}:
                for region in area.regions:
                    if region.type == "UI" or area.type == "IMAGE_EDITOR":
                        region.tag_redraw()


def _start_gpu() -> None:
    if bpy.app.background:
        try:
            gpu.init()
        except SystemError as error:
            raise CalibrationError(f"There is no GPU to measure, not even in software: {error}") from None


def _of_view(
    context: bpy.types.Context, host: Host
) -> tuple[SceneSnapshot, Camera, tuple[int, int], str] | None:
    """What the 3D view of the context shows; None in another editor."""
    space = context.space_data
    if space is None or space.type != "VIEW_3D":
        return None
    region = next(region for region in context.area.regions if region.type == "WINDOW")
    snapshot = host.view_snapshot(context.evaluated_depsgraph_get(), space)
    return snapshot, camera_from_view(space.region_3d), (region.width, region.height), "3D view"


def camera_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Width and height of a render, pixels, as Blender rounds them."""
    render = scene.render
    width, height = (
        side * render.resolution_percentage // 100 for side in (render.resolution_x, render.resolution_y)
    )
    return width, height


def _of_camera(context: bpy.types.Context, host: Host) -> tuple[SceneSnapshot, Camera, tuple[int, int], str]:
    """What the scene's camera shows, in the size of a render."""
    scene = context.scene
    if scene.camera is None:
        raise CalibrationError("The scene has no camera: add one, or calibrate the view of a 3D viewport")
    depsgraph = context.evaluated_depsgraph_get()
    size = camera_size(scene)
    camera = camera_from_object(scene.camera.evaluated_get(depsgraph), scene, *size)
    return host.snapshot(depsgraph), camera, size, f'camera "{scene.camera.name}"'


def start(context: bpy.types.Context, source: str) -> tuple[Calibration, str]:
    """A calibration of VIEW or CAMERA, and its view in words; without a 3D view, of the camera.

    Raises CalibrationError or ValueError where there is nothing to measure, in words for a person.
    """
    _start_gpu()
    host = Host()
    seen = _of_view(context, host) if source == "VIEW" else None
    is_view = seen is not None
    snapshot, camera, size, view = seen or _of_camera(context, host)
    return Calibration(context.scene, snapshot, camera, size, host, samples=not is_view), view


def finish(scene: bpy.types.Scene, calibration: Calibration, view: str) -> str:
    """Keep and show what was measured; returns a line for the person."""
    store(scene, calibration, view)
    image = calibration_plot.update_image(scene)
    windows = bpy.context.window_manager
    shown = not bpy.app.background and calibration_plot.show(image, windows)
    redraw_panels(windows)
    where = "in the image editor" if shown else f'in the image "{image.name}"'
    return f"Measured {len(calibration.results)} settings in the {view}; the plot is {where}"


class LAKE_WATER_OT_calibrate(bpy.types.Operator):
    """Measure what each setting costs and what error it leaves, on this scene, in this view, on this machine.
    Takes seconds on a graphics card, minutes without one; Escape cancels"""

    bl_idname = "lake_water.calibrate"
    bl_label = "Calibrate"
    bl_options = {"UNDO"}

    source: EnumProperty(
        name="Source",
        description="The picture that is measured",
        items=(
            ("VIEW", "3D View", "What the 3D view shows, in its size; elsewhere the camera"),
            ("CAMERA", "Camera", "What the scene's camera shows, in the size and samples of a render"),
        ),
        default="VIEW",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if running() is not None:
            cls.poll_message_set("A calibration is running: wait, or press Escape")
            return False
        return True

    def _refuse(self, error: Exception) -> set[str]:
        if not isinstance(error, ValueError | TargetError):  # those say what a person has to change
            traceback.print_exc()
            error = RuntimeError(f"Lake Water could not calibrate: {error}")
        self.report({"ERROR"}, str(error))
        return {"CANCELLED"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        windows = context.window_manager
        windows.progress_begin(0.0, 100.0)
        try:
            calibration, view = start(context, self.source)
            while not calibration.done:
                calibration.step()
                windows.progress_update(100.0 * calibration.progress)
        except Exception as error:
            return self._refuse(error)
        finally:
            windows.progress_end()
        self.report({"INFO"}, finish(context.scene, calibration, view))
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.window is None:
            return self.execute(context)
        try:
            calibration, view = start(context, self.source)
        except Exception as error:
            return self._refuse(error)
        windows = context.window_manager
        timer = windows.event_timer_add(INTERVAL, window=context.window)
        _state.running = _Running(
            calibration, context.scene.session_uid, view, windows, context.workspace, timer
        )
        windows.progress_begin(0.0, 100.0)
        windows.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        now = _state.running if _state is not None else None
        if now is None:
            return {"CANCELLED"}
        if event.type == "ESC" and event.value == "PRESS":
            self._end()
            self.report({"INFO"}, "Calibration cancelled; what was measured before is kept")
            return {"CANCELLED"}
        if event.type != "TIMER":  # its own, or that of another: both are as good
            return {"RUNNING_MODAL"}
        calibration = now.calibration
        try:
            now.use_context(gpu.state.active_framebuffer_get())
            calibration.step()
        except Exception as error:
            self._end()
            return self._refuse(error)
        now.window_manager.progress_update(100.0 * calibration.progress)
        part = (
            f"Calibrating: {calibration.progress:.0%}, {calibration.doing[0].lower()}{calibration.doing[1:]}"
        )
        now.workspace.status_text_set(f"{part}   |   Esc: Cancel")
        redraw_panels(now.window_manager)
        if not calibration.done:
            return {"RUNNING_MODAL"}
        self._end()
        scene = next((s for s in bpy.data.scenes if s.session_uid == now.scene), None)
        if scene is None:
            return self._refuse(CalibrationError("The scene that was measured is gone"))
        self.report({"INFO"}, finish(scene, calibration, now.view))
        return {"FINISHED"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Called by Blender when the window goes, or another file comes."""
        self._end()

    @staticmethod
    def _end() -> None:
        if _state is not None and _state.running is not None:
            ended, _state.running = _state.running, None
            ended.end()


class LAKE_WATER_OT_show_calibration(bpy.types.Operator):
    """Show the plot of the calibration in an image editor, in a window of its own where none is open"""

    bl_idname = "lake_water.show_calibration"
    bl_label = "Show Plot"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not context.scene.lake_water.calibration.points:
            cls.poll_message_set("Nothing is measured yet: calibrate first")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        image = calibration_plot.update_image(context.scene)
        windows = context.window_manager
        if bpy.app.background or calibration_plot.show(image, windows):
            return {"FINISHED"}
        known = set(windows.windows)
        bpy.ops.wm.window_new()
        window = next(window for window in windows.windows if window not in known)
        area = window.screen.areas[0]
        area.ui_type = "IMAGE_EDITOR"
        calibration_plot.put_into(window, area, image)
        return {"FINISHED"}


CLASSES = (LAKE_WATER_OT_calibrate, LAKE_WATER_OT_show_calibration)


def register() -> None:
    """Add the operators."""
    global _state  # noqa: PLW0603 - the one piece of state, gone again after unregister()
    register_classes(CLASSES)
    _state = _State()


def unregister() -> None:
    """Remove the operators, and end what is running."""
    global _state  # noqa: PLW0603
    if _state is not None and _state.running is not None:
        _state.running.end()
    _state = None
    unregister_classes(CLASSES)
