# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine LAKE_WATER: F12, `blender -b`, and the Rendered viewport.

A thin host: extraction, planning and drawing happen elsewhere. Blender's colour management
makes the final picture from the scene-linear one given here.
"""

from __future__ import annotations

import time
import traceback

import bpy
import gpu
import numpy as np

from . import budget
from .borders import picture_window, view_window
from .core.overlay import lay_over
from .core.plan import pixel_jitter
from .core.snapshot import Camera, SceneSnapshot
from .extract import camera_from_object, camera_from_view
from .host import FrameReport, Host, frame_settings
from .registration import register_classes, unregister_classes
from .render.frame import PassTimer
from .render.passes.accumulate import mean_target, picture_target
from .render.targets import Target, TargetError


class _State:
    """What lives between register() and unregister()."""

    def __init__(self) -> None:
        self.final: Host | None = None
        self.last_report: FrameReport | None = None
        self.viewport_statistics: list[str] = []


_state: _State | None = None


def last_render_report() -> dict | None:
    """What the last final render cost and made (`FrameReport.as_dict`); None before the first."""
    if _state is None or _state.last_report is None:
        return None
    return _state.last_report.as_dict()


def viewport_statistics() -> list[str]:
    """Lines of text about what the Rendered viewport drew last; read them while its region is drawn."""
    return list(_state.viewport_statistics) if _state is not None else []


def release_final_host() -> None:
    """Forget what final renders keep from frame to frame (another file, another job)."""
    if _state is not None:
        _state.final = None


class LakeWaterRenderEngine(bpy.types.RenderEngine):
    """Blender makes an instance for each final render and for each viewport in Rendered mode."""

    bl_idname = "LAKE_WATER"
    bl_label = "Lake Water"
    bl_use_gpu_context = True
    bl_use_preview = False
    bl_use_eevee_viewport = True  # Material Preview is EEVEE's

    def __init__(self, *args, **kwargs) -> None:
        super().__init__(*args, **kwargs)
        self._viewport: Host | None = None
        self._pacing: budget.Pacing | None = None
        self._samples_done = 0
        self._drawn_state: tuple | None = None

    # Final render

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Called by Blender. An exception here would give a blank picture and exit status 0."""
        report = FrameReport()
        try:
            if _state.final is None:
                _state.final = Host()
            host = _state.final
            self._render_final(host, depsgraph)
            report = host.report
        except Exception as error:
            if not isinstance(error, ValueError | TargetError):  # those say what a person has to change
                traceback.print_exc()
            report.error = str(error) or type(error).__name__
            _state.final = None
            self.error_set(f"Lake Water could not render: {error}")
        _state.last_report = report

    def _render_final(self, host: Host, depsgraph: bpy.types.Depsgraph) -> None:
        start = time.perf_counter()
        scene = depsgraph.scene
        render = scene.render
        width, height = self.resolution_x, self.resolution_y  # those of another scene that composits this one
        left, bottom, right, top = picture_window(render, width, height)
        size = (right - left, top - bottom)
        host.begin(size)
        timer = PassTimer(enabled=scene.lake_water.show_statistics)

        snapshot = host.snapshot(depsgraph)
        camera_object = (self.camera_override or scene.camera).evaluated_get(depsgraph)
        camera = camera_from_object(camera_object, scene, width, height)
        window = (left / width, bottom / height, right / width, top / height)
        mean = self._draw_samples(host, snapshot, camera, scene, (width, height), size, window, timer)
        if mean is None:
            host.finish(timer, time.perf_counter() - start)
            return
        pixels = np.asarray(mean.colors[0].read(), dtype=np.float32).reshape(-1)
        result = self.begin_result(0, 0, *size, layer=depsgraph.view_layer.name)
        result.layers[0].passes["Combined"].rect.foreach_set(pixels)
        self.end_result(result)
        host.finish(timer, time.perf_counter() - start)

    def _draw_samples(
        self,
        host: Host,
        snapshot: SceneSnapshot,
        camera: Camera,
        scene: bpy.types.Scene,
        whole: tuple[int, int],
        size: tuple[int, int],
        window: tuple[float, float, float, float],
        timer: PassTimer,
    ) -> Target | None:
        """The mean of all antialiasing samples; None when the person pressed Escape."""
        renderer = host.renderer
        samples = scene.lake_water.samples
        picture = picture_target(renderer.targets, "final", size)
        mean = mean_target(renderer.targets, "final", size)
        mean.colors[0].clear(format="FLOAT", value=(0.0, 0.0, 0.0, 0.0))
        for sample in range(samples):
            if self.test_break():
                return None
            plan = host.plan(
                snapshot,
                camera,
                scene,
                window=window,
                jitter=pixel_jitter(sample, samples, *whole),
                samples=samples,
            )
            renderer.draw_picture(plan, picture, timer, transparent=scene.render.film_transparent)
            with timer.measure("mean", mean.framebuffer):
                renderer.mean.add(picture, mean, 1.0 / samples)
            self.update_progress((sample + 1) / samples)
        return mean

    # Rendered viewport

    def view_update(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Something changed."""
        if self._viewport is not None:
            self._viewport.extractor.note_updates(depsgraph)
        self._drawn_state = None

    def view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw one more sample and show the mean."""
        try:
            self._view_draw(context, depsgraph)
        except Exception as error:
            traceback.print_exc()
            self.error_set(f"Lake Water could not draw the viewport: {error}")

    def _view_draw(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        start = time.perf_counter()
        if self._viewport is None:
            self._viewport = Host()
            self._pacing = budget.Pacing(self._viewport)
        host, renderer, scene = self._viewport, self._viewport.renderer, depsgraph.scene
        region = context.region
        left, bottom, right, top = border = view_window(
            context.space_data, region, context.region_data, depsgraph
        )
        whole, size = (region.width, region.height), (right - left, top - bottom)
        window = (left / whole[0], bottom / whole[1], right / whole[0], top / whole[1])
        host.begin(size)
        timer = PassTimer(enabled=scene.lake_water.show_statistics)
        picture = picture_target(renderer.targets, "view", size)
        mean = mean_target(renderer.targets, "view", size)
        pace = self._pacing.of(region, scene)
        watch = budget.Watch(pace, lambda: _wait_for(picture))
        snapshot = host.view_snapshot(depsgraph, context.space_data)
        settings = frame_settings(scene)
        samples = scene.lake_water.viewport_samples
        if pace is not None:
            settings, snapshot = lay_over(settings, snapshot, pace.point.settings)
            samples = 1
        camera = camera_from_view(context.region_data)
        state = (
            snapshot.version,
            snapshot.time,
            whole,
            border,
            camera.view.tobytes(),
            camera.projection.tobytes(),
            settings,
            tuple(body.settings for body in snapshot.waters),
        )
        if state != self._drawn_state:
            self._drawn_state, self._samples_done = state, 0
            mean.colors[0].clear(format="FLOAT", value=(0.0, 0.0, 0.0, 0.0))
        drawn = self._samples_done < samples
        if drawn:
            jitter = pixel_jitter(self._samples_done, samples, *whole)
            plan = host.plan(snapshot, camera, scene, settings=settings, window=window, jitter=jitter)
            renderer.draw_picture(plan, picture, timer, transparent=scene.render.film_transparent)
            renderer.mean.add(picture, mean, 1.0)
            self._samples_done += 1
            if self._samples_done < samples:
                self.tag_redraw()
        # Blender's viewport is scene-linear here and goes through its own colour management afterwards.
        gpu.state.viewport_set(left, bottom, *size)
        renderer.mean.show(mean, 1.0 / self._samples_done)
        gpu.state.viewport_set(0, 0, *whole)
        if pace is not None:
            host.paced = budget.describe(pace)
            budget.publish(host.paced)
        if drawn:  # else it is only shown again, and that took no time worth telling
            watch.stop()
            host.finish(timer, time.perf_counter() - start)
        _state.viewport_statistics = host.statistics()


def _wait_for(target: Target) -> None:
    with target.framebuffer.bind():
        budget.wait_for(target.framebuffer)


@bpy.app.handlers.persistent
def _render_init(*_args) -> None:
    """A window's render job has a graphics context of its own, in which framebuffers of the last are void."""
    if not bpy.app.background:
        release_final_host()


@bpy.app.handlers.persistent
def _load_pre(*_args) -> None:
    release_final_host()


def register() -> None:
    """Add the engine."""
    global _state  # noqa: PLW0603 - the one piece of state, gone again after unregister()
    register_classes((LakeWaterRenderEngine,))
    bpy.app.handlers.render_init.append(_render_init)
    bpy.app.handlers.load_pre.append(_load_pre)
    _state = _State()


def unregister() -> None:
    """Take the engine away, and all that it kept."""
    global _state  # noqa: PLW0603
    _state = None
    bpy.app.handlers.load_pre.remove(_load_pre)
    bpy.app.handlers.render_init.remove(_render_init)
    unregister_classes((LakeWaterRenderEngine,))
