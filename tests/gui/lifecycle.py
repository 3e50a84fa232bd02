# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's life in Blender's window: what is drawn, when it changes, and that nothing stays behind.

    blender --factory-startup -P tests/gui/lifecycle.py [-- NAME ...]

Needs a Blender with a window (Xvfb will do) and takes ten minutes with software OpenGL. Without names all
checks run. Uses the installed extension where it is enabled, else this checkout's package.
Exit status: 0 when every check passed, 1 when one failed, 2 for an unknown name.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import bpy
import gpu
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
DETAIL = 0.1  # of the lake: what is checked here does not depend on it
SETTLE = 0.3  # seconds that Blender gets to handle events
SEEN = 0.02  # part of the viewport that the lake covers at least in the views used here
CHANGED = 1e-3  # mean difference of a picture that counts as changed

Steps = Iterator[float]


class CheckError(AssertionError):
    """What a check found wrong."""


def expect(condition: bool, message: str) -> None:
    """Fail the running check unless the condition holds."""
    if not condition:
        raise CheckError(message)


def load_package():
    """The registered package: the installed extension if it is enabled, else this checkout's."""
    if hasattr(bpy.types.Scene, "lake_water"):
        name = next(
            name for name in sys.modules if name.startswith("bl_ext.") and name.endswith(".lake_water")
        )
        return sys.modules[name]
    sys.path.insert(0, str(ROOT))
    package = importlib.import_module("lake_water_addon")
    package.register()
    return package


def module(name: str):
    """A module of the package by its name inside."""
    return importlib.import_module(f".{name}", PACKAGE.__name__)


# The window


def view3d(
    which: int = 0,
) -> tuple[bpy.types.Window, bpy.types.Area, bpy.types.Region, bpy.types.SpaceView3D]:
    """Window, area, main region and space of a 3D viewport."""
    found = [
        (window, area)
        for window in bpy.context.window_manager.windows
        for area in window.screen.areas
        if area.type == "VIEW_3D"
    ]
    window, area = found[which]
    return window, area, next(r for r in area.regions if r.type == "WINDOW"), area.spaces.active


def in_viewport(which: int = 0):
    """Context override of a viewport; to be made anew after each redraw."""
    window, area, region, space = view3d(which)
    return bpy.context.temp_override(window=window, area=area, region=region, space_data=space)


def redraw(times: int = 1) -> None:
    """Draw all windows now."""
    with in_viewport():
        bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=times)


def settle(seconds: float = SETTLE) -> Steps:
    """Let Blender handle events, compile shaders and bake the view transform, and draw."""
    redraw()
    yield seconds
    while bpy.app.is_job_running("SHADER_COMPILATION"):
        yield seconds
    redraw()
    yield seconds
    redraw()


class Probe:
    """Looks at what the draw handler draws: colours of the overlay before and after it.

    picture: what was drawn last, (h, w, 4), and 0 where it did not draw.
    """

    def __init__(self) -> None:
        self.draws = 0
        self.covered: dict[int, float] = {}  # part of each region that the handler covered last
        self.picture: np.ndarray | None = None
        self._before: np.ndarray | None = None
        self._handles: list = []

    def _read(self) -> np.ndarray:
        framebuffer = gpu.state.active_framebuffer_get()
        x, y, width, height = framebuffer.viewport_get()
        return np.array(framebuffer.read_color(x, y, width, height, 4, 0, "FLOAT")).reshape(height, width, 4)

    def _note_before(self) -> None:
        self._before = self._read()

    def _note_after(self) -> None:
        after = self._read()
        self.draws += 1
        changed = np.any(after != self._before, axis=2)
        self.picture = np.where(changed[..., None], after, 0.0)
        self.covered[bpy.context.region.as_pointer()] = float(changed.mean())

    def __enter__(self) -> Probe:
        """Handlers are called in the order in which they were added: register the package in between."""
        PACKAGE.unregister()
        add = bpy.types.SpaceView3D.draw_handler_add
        self._handles.append(add(self._note_before, (), "WINDOW", "POST_VIEW"))
        PACKAGE.register()
        self._handles.append(add(self._note_after, (), "WINDOW", "POST_VIEW"))
        return self

    def __exit__(self, *_args) -> None:
        for handle in self._handles:
            bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")

    def coverage(self, which: int = 0) -> float:
        """Part of a viewport that the handler covered when it was drawn last."""
        return self.covered.get(view3d(which)[2].as_pointer(), 0.0)


class RenderedProbe:
    """Counts what the engine draws in viewports, and keeps the last picture (scene-linear)."""

    def __init__(self) -> None:
        self.draws = 0
        self.picture: np.ndarray | None = None

    def __enter__(self) -> RenderedProbe:
        self._engine = module("engine").LakeWaterRenderEngine
        self._original = original = self._engine._view_draw

        def view_draw(engine, context, depsgraph) -> None:
            original(engine, context, depsgraph)
            self.draws += 1
            self.picture = _mean_picture(engine)

        self._engine._view_draw = view_draw
        return self

    def __exit__(self, *_args) -> None:
        self._engine._view_draw = self._original


def _mean_picture(engine) -> np.ndarray:
    """What the engine has accumulated, divided by its samples."""
    accumulate = importlib.import_module(".render.passes.accumulate", PACKAGE.__name__)
    host = engine._viewport
    mean = accumulate.mean_target(host.renderer.targets, "view", host.report.resolution)
    values = np.asarray(mean.colors[0].read(), dtype=np.float32)
    return values.reshape(mean.size[1], mean.size[0], 4) / engine._samples_done


def fresh_lake(shading: str = "SOLID") -> Steps:
    """A new file with the demonstration lake, seen through its camera."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)
    yield SETTLE
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing)
    with in_viewport():
        bpy.ops.lake_water.add_lake(detail=DETAIL)
    bpy.context.preferences.view.render_display_type = "NONE"
    space = view3d()[3]
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = shading
    yield from settle()


def water_object() -> bpy.types.Object:
    return next(obj for obj in bpy.context.scene.objects if obj.lake_water.enabled)


def counts() -> dict[str, int]:
    """How many data-blocks and handlers there are."""
    blocks = {
        name: len(getattr(bpy.data, name)) for name in ("images", "scenes", "meshes", "objects", "texts")
    }
    lists = {name: getattr(bpy.app.handlers, name) for name in dir(bpy.app.handlers)}
    return blocks | {name: len(value) for name, value in lists.items() if isinstance(value, list)}


def resident_mib() -> float | None:
    """Memory of this process, MiB; None where the system does not tell in this way."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def difference(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.abs(a - b).mean()) if a.shape == b.shape else float("inf")


# The checks


def check_shading_modes() -> Steps:
    """Water is seen in every shading mode, with overlays and without."""
    with Probe() as probe:
        yield from fresh_lake()
        space = view3d()[3]
        seen = {}
        for overlays in (True, False):
            space.overlay.show_overlays = overlays
            for shading, engine in (
                ("WIREFRAME", "LAKE_WATER"),
                ("SOLID", "LAKE_WATER"),
                ("MATERIAL", "LAKE_WATER"),
                ("RENDERED", "BLENDER_WORKBENCH"),
            ):
                bpy.context.scene.render.engine = engine
                space.shading.type = shading
                yield from settle()
                seen[shading, engine, overlays] = probe.coverage()
        for key, part in seen.items():
            expect(part > SEEN, f"no water in {key} (shading, engine, overlays): {part:.1%} covered")
        space.shading.type = "RENDERED"
        for engine in ("LAKE_WATER", "BLENDER_EEVEE", "CYCLES"):
            bpy.context.scene.render.engine = engine
            yield from settle()
            expect(probe.coverage() == 0.0, f"the handler draws over the water in the picture of {engine}")


def check_visibility() -> Steps:
    """Hidden water is not drawn, in local view and in excluded collections neither."""
    with Probe() as probe:
        yield from fresh_lake()
        expect(probe.coverage() > SEEN, "no water to begin with")
        water, scene = water_object(), bpy.context.scene

        def hide_collection(value: bool) -> None:
            collection = water.users_collection[0]
            layers = [bpy.context.view_layer.layer_collection]
            for layer in layers:
                layers += layer.children
                if layer.collection == collection:
                    layer.exclude = value

        for what, switch in (
            ("hidden in the viewport", water.hide_set),
            ("disabled in viewports", lambda v: setattr(water, "hide_viewport", v)),
            ("in an excluded collection", hide_collection),
            ("switched off in the panel", lambda v: setattr(scene.lake_water, "show_in_viewport", not v)),
        ):
            switch(True)
            yield from settle()
            expect(probe.coverage() == 0.0, f"water is drawn although it is {what}")
            switch(False)
            yield from settle()
            expect(probe.coverage() > SEEN, f"water does not come back after it was {what}")
        other = next(obj for obj in scene.objects if obj.type == "MESH" and obj != water)
        for obj, shown in ((other, False), (water, True)):
            for selected in list(bpy.context.selected_objects):
                selected.select_set(False)
            obj.select_set(True)
            bpy.context.view_layer.objects.active = obj
            with in_viewport():
                bpy.ops.view3d.localview(frame_selected=False)
            yield from settle()
            seen = probe.coverage()
            with in_viewport():
                bpy.ops.view3d.localview(frame_selected=False)
            yield from settle()
            expect((seen > SEEN) == shown, f'local view of "{obj.name}": {seen:.1%} covered by water')


def check_viewports() -> Steps:
    """Split and joined areas, quad view and a second window all show water."""
    with Probe() as probe:
        yield from fresh_lake()
        with in_viewport():
            bpy.ops.screen.area_split(direction="VERTICAL", factor=0.4)
        yield from settle()
        for which in (0, 1):
            expect(probe.coverage(which) > SEEN, f"no water in viewport {which} after a split")
        window, first, *_ = view3d(0)
        second = view3d(1)[1]
        with bpy.context.temp_override(window=window):
            bpy.ops.screen.area_join(source_xy=_middle(first), target_xy=_middle(second))
        yield from settle()
        expect(probe.coverage() > SEEN, "no water after areas were joined")
        with in_viewport():
            bpy.ops.screen.region_quadview()
        yield from settle()
        regions = [r for r in view3d()[1].regions if r.type == "WINDOW"]
        expect(len(regions) == 4, "quad view has four regions")
        seen = [probe.covered.get(region.as_pointer(), 0.0) > SEEN for region in regions]
        expect(sum(seen) >= 2, f"top and user view show water in quad view: {seen}")
        with in_viewport():
            bpy.ops.screen.region_quadview()
        view3d()[3].region_3d.view_perspective = "CAMERA"
        yield from settle()
        with in_viewport():
            bpy.ops.wm.window_new()
        yield SETTLE
        windows = list(bpy.context.window_manager.windows)
        for which in range(len(windows)):
            view3d(which)[3].region_3d.view_perspective = "CAMERA"
        yield from settle(1.0)
        expect(len(windows) == 2, "there are two windows")
        for which in range(2):
            expect(probe.coverage(which) > SEEN, f"no water in window {which}")
        with bpy.context.temp_override(window=windows[1]):
            bpy.ops.wm.window_close()
        yield from settle()
        expect(probe.coverage() > SEEN, "no water after the second window was closed")


def _middle(area: bpy.types.Area) -> tuple[int, int]:
    return area.x + area.width // 2, area.y + area.height // 2


def _changes() -> list[tuple[str, Callable[[], None]]]:
    """Each setting, and how to change it so that it shows."""
    water, scene = water_object().lake_water, bpy.context.scene.lake_water

    def setter(owner, name: str, value) -> tuple[str, Callable[[], None]]:
        return f"{name} = {value}", lambda: setattr(owner, name, value)

    return [
        setter(water, "k", 0.05),
        setter(water, "q", 2.0),
        setter(water, "c", 6.0),
        setter(water, "ior", 1.6),
        setter(water, "water_color", (0.3, 0.0, 0.1)),
        setter(water.waves[0], "amplitude", 0.2),
        setter(water.waves[0], "wavelength", 2.5),
        setter(water.waves[0], "direction", 1.5),
        setter(water.waves[0], "phase", 2.0),
        setter(water, "grid_resolution", 3),
        setter(scene, "fov_ext", 2.5),
        setter(scene, "intersection_steps", 1),
        setter(scene, "texture_size", 64),
    ]


def check_settings() -> Steps:
    """Each setting shows at the next redraw, drawn by the handler and by the engine; undo takes it back."""
    with Probe() as probe, RenderedProbe() as rendered:
        yield from fresh_lake()
        bpy.context.scene.lake_water.viewport_samples = 1
        for shading, eye in (("SOLID", probe), ("RENDERED", rendered)):
            view3d()[3].shading.type = shading
            yield from settle()
            for name, change in _changes():
                before = eye.picture
                change()
                yield SETTLE  # no redraw is asked for here: the change itself has to do that
                found = difference(before, eye.picture)
                expect(found > CHANGED / 10, f"{name} does not show in {shading}: {found:.1e} of change")
            yield from fresh_lake()
            bpy.context.scene.lake_water.viewport_samples = 1


def check_undo() -> Steps:
    """Undo and redo of a setting, of a quality, and of deleting the water."""
    with Probe() as probe:
        yield from fresh_lake()
        first = probe.picture
        with in_viewport():
            bpy.ops.ed.undo_push(message="before")
            bpy.ops.lake_water.set_parameters("EXEC_DEFAULT", True, k=0.01, water_color=(0.4, 0.0, 0.0))
        yield from settle()
        second = probe.picture
        expect(difference(first, second) > CHANGED, "set_parameters does not show")
        with in_viewport():
            bpy.ops.ed.undo()
        yield from settle()
        expect(difference(first, probe.picture) < CHANGED / 10, "undo of parameters does not show")
        with in_viewport():
            bpy.ops.ed.redo()
        yield from settle()
        expect(difference(second, probe.picture) < CHANGED / 10, "redo of parameters does not show")
        sizes = []
        for quality in ("BEST", "DRAFT"):
            with in_viewport():
                bpy.ops.wm.context_set_enum(
                    "EXEC_DEFAULT", True, data_path="scene.lake_water.quality", value=quality
                )
            yield SETTLE
            sizes.append(bpy.context.scene.lake_water.texture_size)
        with in_viewport():
            bpy.ops.ed.undo()
        settings = bpy.context.scene.lake_water
        now = settings.quality, settings.texture_size
        expect(now == ("BEST", sizes[0]), f"undo of a quality gives {now}")
        bpy.data.objects.remove(water_object())
        with in_viewport():
            bpy.ops.ed.undo_push(message="delete")
        yield from settle()
        expect(probe.coverage() == 0.0, "deleted water is still drawn")
        with in_viewport():
            bpy.ops.ed.undo()
        yield from settle()
        expect(probe.coverage() > SEEN, "undo does not bring the water back")
        with in_viewport():
            bpy.ops.ed.redo()
        yield from settle()
        expect(probe.coverage() == 0.0, "redo does not delete the water again")


def check_playback() -> Steps:
    """Frames play with statistics on, and the water may be deleted meanwhile."""
    with Probe() as probe:
        yield from fresh_lake()
        scene = bpy.context.scene
        scene.lake_water.show_statistics = True
        scene.frame_start, scene.frame_end = 1, 1000
        first = probe.picture
        with in_viewport():
            bpy.ops.screen.animation_play()
        start = time.monotonic()
        while scene.frame_current < 30 and time.monotonic() - start < 60.0:
            yield 0.2
        expect(scene.frame_current >= 30, "playback does not advance")
        expect(difference(first, probe.picture) > CHANGED, "the waves do not move during playback")
        expect(len(module("handlers").statistics()) > 4, "no statistics during playback")
        bpy.data.objects.remove(water_object())
        yield 1.0
        with in_viewport():
            bpy.ops.screen.animation_cancel(restore_frame=False)
        yield from settle()
        expect(probe.coverage() == 0.0, "water that was deleted during playback is still drawn")


class TimedFrames:
    """Times every frame that is drawn while an animation plays, by the handler or by the engine.

    frames: seconds until it is there, the settings that it is drawn with, whether anything was made for it.
    """

    def __init__(self, shading: str) -> None:
        self.frames: list[tuple[float, object, bool]] = []
        self._rendered = shading == "RENDERED"
        self._budget = module("budget")
        if self._rendered:
            self._owner, self._name = module("engine").LakeWaterRenderEngine, "_view_draw"
        else:
            self._owner, self._name = module("viewport"), "_draw"

    def __enter__(self) -> TimedFrames:
        self._original = original = getattr(self._owner, self._name)
        plans = []
        host_type = module("host").Host
        self._plan = host_plan = host_type.plan

        def plan(host, *args, **options):
            plans.append((host, host_plan(host, *args, **options)))
            return plans[-1][1]

        def draw(*args) -> None:
            framebuffer = gpu.state.active_framebuffer_get()
            plans.clear()
            framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
            start = time.perf_counter()
            original(*args)
            framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
            seconds = time.perf_counter() - start
            if self._budget.is_playing() and plans:
                host, planned = plans[-1]
                self.frames.append((seconds, planned.settings, any(host.report.made.values())))

        setattr(self._owner, self._name, draw)
        host_type.plan = plan
        return self

    def __exit__(self, *_args) -> None:
        setattr(self._owner, self._name, self._original)
        module("host").Host.plan = self._plan


def _play(timed: TimedFrames, seconds: float, least: int = 0) -> Steps:
    """Play for some time, and until there are so many frames."""
    timed.frames.clear()
    with in_viewport():
        bpy.ops.screen.animation_play()
    start = time.monotonic()
    while time.monotonic() - start < seconds or len(timed.frames) < least:
        expect(time.monotonic() - start < 120.0, "playback does not advance")
        yield 0.2
    with in_viewport():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    yield from settle()


def _measured_points(timed: TimedFrames, sizes: tuple[int, ...]) -> Steps:
    """Fill the scene's calibration with what textures of some sizes take here."""
    settings = bpy.context.scene.lake_water
    kept = settings.calibration
    kept.technique, kept.measure = settings.technique, "FLIP"
    for size in sizes:
        values = {"texture_size": size, "caustics_size": size, "photon_size": size}
        for name, value in values.items():
            setattr(settings, name, value)
        yield from settle()
        yield from _play(timed, 1.0, least=12)
        point = kept.points.add()
        point.settings = json.dumps(values)
        point.seconds = float(np.median([seconds for seconds, *_ in timed.frames[2:]]))
        point.flip = 16.0 / size


def check_budget() -> Steps:
    """A time budget holds while an animation plays, and what is drawn at rest is what the panel says."""
    sizes = (64, 384, 640, 1024)
    for shading in ("SOLID", "RENDERED"):
        yield from fresh_lake(shading)
        scene = bpy.context.scene
        settings = scene.lake_water
        scene.frame_start, scene.frame_end = 1, 10000
        with TimedFrames(shading) as timed:
            yield from _measured_points(timed, sizes)
            times = [point.seconds for point in settings.calibration.points]
            settings.budget_time = 1000.0 * (times[0] * times[-1]) ** 0.5
            settings.budget = "TIME"
            yield from settle()
            before = settings.texture_size
            expect(sizes[0] < before < sizes[-1], f"{shading}: {before} was chosen for a time between")
            yield from _play(timed, 10.0, least=100)
            frames = list(timed.frames)
            seconds = np.array([taken for taken, *_ in frames])[20:]  # it has settled
            held = float((seconds <= 1.1e-3 * settings.budget_time).mean())
            used = [planned.texture_size for _, planned, _ in frames]
            steps = int(np.count_nonzero(np.diff(used)))
            found = (
                f"{shading}: {held:.1%} of {len(seconds)} frames within 10 % of {settings.budget_time:.0f} "
                f"ms, median {1e3 * np.median(seconds):.0f} ms, {steps} steps, sizes {sorted(set(used))} "
                f"that take {', '.join(f'{1e3 * taken:.0f}' for taken in times)} ms"
            )
            print(f"lifecycle: budget: {found}", flush=True)
            expect(held >= 0.95, found)
            expect(steps <= 12, found)
            seen: set[int] = set()
            for size, made in zip(used, (made for *_, made in frames), strict=True):
                expect(not made or size not in seen, f"textures of {size} were made again")
                seen.add(size)
            expect(settings.texture_size == before, "playback changed the scene's settings")
            settings.budget = "OFF"
            yield from settle()


def _few_candidates() -> None:
    """Let calibrations of this session measure a few small pictures only: how many does not matter here."""
    candidates = importlib.import_module(".core.candidates", PACKAGE.__name__)
    candidates.GEOMETRY = {"intersection_steps": (1, 4)}
    candidates.RATIOS, candidates.GRIDS, candidates.LIGHT = (0.1, 0.3), (2,), {}
    candidates.BEST = {"intersection_steps": 4}
    calibration = module("calibration")
    calibration.QUALITIES = {}
    calibration.REFERENCE_SAMPLES, calibration.COMBINATIONS = (2, 2), 2


def _calibrate(seconds: float = 300.0) -> Steps:
    """A calibration of the viewport, to its end."""
    running = module("calibrate_operator").running
    with in_viewport():
        bpy.ops.lake_water.calibrate("INVOKE_DEFAULT")
    start, last = time.monotonic(), 0.0
    while running() is not None:
        part, _ = running()
        expect(last <= part <= 1.0, f"the progress goes from {last} to {part}")
        last = part
        expect(time.monotonic() - start < seconds, f"the calibration is at {part:.0%} after {seconds:.0f} s")
        yield 0.2


def _press_escape() -> Steps:
    """Give the running calibration an Escape key, which Blender itself sends only when started for that."""
    window = view3d()[0]
    operator = next(o for o in window.modal_operators if o.bl_idname == "LAKE_WATER_OT_calibrate")
    with in_viewport():
        ended = operator.modal(bpy.context, SimpleNamespace(type="ESC", value="PRESS"))
    expect(ended == {"CANCELLED"}, f"Escape gives {ended}")
    yield SETTLE


def check_calibration() -> Steps:
    """A calibration shows what it measured, leaves viewport and settings alone, and may be cancelled."""
    _few_candidates()
    with Probe() as probe:
        yield from fresh_lake()
        scene = bpy.context.scene
        kept, settings = scene.lake_water.calibration, scene.lake_water
        first, held = probe.picture, (settings.texture_size, settings.intersection_steps, settings.samples)
        area = next(a for a in view3d()[0].screen.areas if a.type == "DOPESHEET_EDITOR")
        area.ui_type = "IMAGE_EDITOR"
        yield from _calibrate()
        redraw()
        expect(len(kept.points) >= 5, f"{len(kept.points)} points were measured")
        expect(kept.view == "3D view", f"the view is {kept.view}")
        region = view3d()[2]
        expect(tuple(kept.resolution) == (region.width, region.height), "the size is not the viewport's")
        expect(difference(first, probe.picture) == 0.0, "a calibration changes what the viewport shows")
        now = settings.texture_size, settings.intersection_steps, settings.samples
        expect(now == held, "a calibration changes the settings")
        image = area.spaces.active.image
        expect(image is not None and image.name == "Lake Water Calibration", "the plot is not shown")

        before = [(point.settings, point.seconds) for point in kept.points]
        with in_viewport():
            bpy.ops.lake_water.calibrate("INVOKE_DEFAULT")
        yield 1.0
        expect(module("calibrate_operator").running() is not None, "the second calibration does not run")
        yield from _press_escape()
        yield from settle()
        expect(module("calibrate_operator").running() is None, "Escape does not end the calibration")
        expect(not view3d()[0].modal_operators, "the cancelled operator still waits for events")
        expect(before == [(p.settings, p.seconds) for p in kept.points], "a cancel loses what was measured")
        expect(difference(first, probe.picture) == 0.0, "a cancel changes what the viewport shows")

        coarse = min(range(len(kept.points)), key=lambda i: kept.points[i].seconds)
        kept.chosen = coarse
        yield from settle()
        expect(difference(first, probe.picture) > CHANGED, "the settings of a point do not show")

        with in_viewport():
            bpy.ops.lake_water.calibrate("INVOKE_DEFAULT")
        yield 0.5
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)
        yield from settle()
        expect(module("calibrate_operator").running() is None, "a calibration outlives its file")


def check_idle() -> Steps:
    """Nothing is redrawn when nothing happens."""
    with Probe() as probe, RenderedProbe() as rendered:
        for shading in ("SOLID", "RENDERED"):
            yield from fresh_lake(shading)
            bpy.context.scene.lake_water.show_statistics = True
            yield from settle(2.0)
            start = time.monotonic()
            before = -1
            while before != probe.draws + rendered.draws and time.monotonic() - start < 30.0:
                before = probe.draws + rendered.draws  # antialiasing samples come to an end
                yield 1.5
            before = probe.draws, rendered.draws
            yield 3.0
            after = probe.draws, rendered.draws
            expect(before == after, f"{shading} is redrawn while nothing happens: {before} -> {after}")


def check_files() -> Steps:
    """Another file, one without water, and a new scene in the same file."""
    with Probe() as probe, tempfile.TemporaryDirectory() as folder:
        yield from fresh_lake()
        path = str(Path(folder) / "lake.blend")
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=False)
        yield from settle()
        expect(probe.coverage() == 0.0, "water is drawn in a file that has none")
        bpy.ops.wm.open_mainfile(filepath=path)
        yield from settle()
        expect(probe.coverage() > SEEN, "no water in the file that was loaded")
        window = bpy.context.window_manager.windows[0]
        lake = window.scene
        window.scene = empty = bpy.data.scenes.new("Empty")
        yield from settle()
        expect(probe.coverage() == 0.0, "water of another scene is drawn")
        window.scene = lake
        view3d()[3].region_3d.view_perspective = "CAMERA"
        yield from settle()
        expect(probe.coverage() > SEEN, "no water after coming back to its scene")
        bpy.data.scenes.remove(empty)


def check_registration() -> Steps:
    """Registered and unregistered a hundred times, nothing is left behind."""
    yield from fresh_lake()
    with Probe() as probe:
        yield from settle()
        expect(probe.coverage() > SEEN, "no water to begin with")
        before = counts()
        sizes = {}
        for i in range(100):
            sizes[i] = resident_mib()
            PACKAGE.unregister()
            redraw()
            expect(probe.coverage() == 0.0, "water is drawn while the package is not registered")
            PACKAGE.register()
            start = time.monotonic()
            while module("viewport")._state.host is None and time.monotonic() - start < 10.0:
                redraw()
                yield 0.0
            expect(module("viewport")._state.host is not None, f"the handler does not draw, time {i}")
            redraw()
        if sizes[99] is not None:
            growth = sizes[99] - sizes[20]
            print(f"lifecycle: {sizes[20]:.0f} MiB, {growth:+.1f} MiB after 80 registrations")
            expect(growth < 40.0, f"80 registrations grow the process by {growth:.1f} MiB")
        expect(counts() == before, f"counts of data-blocks and handlers differ: {before} -> {counts()}")
    with Probe() as probe:  # its order of handlers is the one before
        yield from settle()
        expect(probe.coverage() > SEEN, "no water after a hundred registrations")


def check_unregister_while_rendered() -> Steps:
    """The package may go while a viewport shows its engine, and come back."""
    yield from fresh_lake("RENDERED")
    PACKAGE.unregister()
    yield from settle()
    PACKAGE.register()
    bpy.context.scene.render.engine = "LAKE_WATER"
    view3d()[3].shading.type = "RENDERED"
    with RenderedProbe() as rendered:
        yield from settle()
        expect(rendered.draws > 0, "the Rendered viewport does not come back after registration")


def check_memory() -> Steps:
    """300 redraws of moving water take no more memory, in either kind of viewport."""
    for shading in ("SOLID", "RENDERED"):
        yield from fresh_lake(shading)
        sizes = []
        blocks = counts()
        for i in range(400):
            bpy.context.scene.frame_set(i)
            redraw()
            if i % 20 == 0:
                yield 0.0
            if i in (100, 399):
                sizes.append(resident_mib())
        expect(counts() == blocks, f"{shading}: data-blocks or handlers differ: {blocks} -> {counts()}")
        if sizes[0] is not None:
            growth = sizes[1] - sizes[0]
            print(f"lifecycle: {shading}: {sizes[0]:.0f} MiB, {growth:+.1f} MiB after 300 redraws")
            expect(growth < 10.0, f"{shading}: 300 redraws grow the process by {growth:.1f} MiB")


def _render(**options) -> Steps:
    """One render job of the window, to its end."""
    ended = []

    def note(*_args) -> None:
        ended.append(True)

    ends = (bpy.app.handlers.render_complete, bpy.app.handlers.render_cancel)
    for handlers in ends:
        handlers.append(note)
    try:
        with in_viewport():
            bpy.ops.render.render("INVOKE_DEFAULT", **options)
        start = time.monotonic()
        while not ended and time.monotonic() - start < 120.0:
            yield 0.1
        while bpy.app.is_job_running("RENDER"):
            yield 0.1
    finally:
        for handlers in ends:
            handlers.remove(note)
    expect(bool(ended), "the render job does not end")
    report = module("engine").last_render_report()
    expect(report is not None and report["error"] is None, f"the render failed: {report}")


def _result(folder: str) -> np.ndarray:
    """The last render as (h, w, 4), scene-linear."""
    settings = bpy.context.scene.render.image_settings
    settings.file_format = "OPEN_EXR"
    settings.color_mode = "RGBA"
    path = str(Path(folder) / "result.exr")
    bpy.data.images["Render Result"].save_render(path)
    image = bpy.data.images.load(path)
    try:
        width, height = image.size
        pixels = np.empty(width * height * 4, np.float32)
        image.pixels.foreach_get(pixels)
    finally:
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, 4)


def check_view_border() -> Steps:
    """A render border of the view, or of the camera seen through, limits what is drawn."""
    with Probe() as probe, RenderedProbe() as rendered:
        yield from fresh_lake("MATERIAL")
        _, _, region, space = view3d()
        render = bpy.context.scene.render
        low, high = 0.3, 0.6
        for owner in (space, render):
            prefix = "render_border" if owner == space else "border"
            for axis in "xy":
                setattr(owner, f"{prefix}_min_{axis}", low)
                setattr(owner, f"{prefix}_max_{axis}", high)
        render.use_border = True
        yield from settle()
        inside = np.argwhere(probe.picture[..., 3] > 0.0)
        seen = np.ptp(inside, axis=0) + 1
        expect(bool((seen < (0.31 * region.height, 0.31 * region.width)).all()), f"water outside: {seen}")
        space.shading.type = "RENDERED"
        yield from settle()
        camera = rendered.picture.shape
        expect(camera[1] <= 0.31 * region.width, f"the camera's border is not the picture's: {camera}")
        render.use_border = False
        space.region_3d.view_perspective = "PERSP"
        space.use_render_border = True
        yield from settle()
        wanted = round(0.3 * region.height), round(0.3 * region.width)
        got = rendered.picture.shape[:2]
        expect(abs(got[0] - wanted[0]) <= 1 and abs(got[1] - wanted[1]) <= 1, f"border {wanted}, drawn {got}")


def check_final_render() -> Steps:
    """F12 twice, with a border, cropped or not, a percentage, an animation, beside a Rendered viewport."""
    with tempfile.TemporaryDirectory() as folder:
        yield from fresh_lake("RENDERED")
        scene = bpy.context.scene
        render = scene.render
        render.resolution_x, render.resolution_y = 240, 130
        scene.lake_water.samples = 2
        yield from _render()
        whole = _result(folder)
        expect(whole.shape == (130, 240, 4) and np.ptp(whole[..., 1]) > 0.1, "F12 gives no picture")
        yield from _render()
        expect(np.array_equal(whole, _result(folder)), "a second F12 gives another picture")

        render.use_border = True
        # 0.7 of 130 pixels is 91 in float32 and a little less in float64.
        render.border_min_x, render.border_max_x = 0.2, 0.6
        render.border_min_y, render.border_max_y = 0.1, 0.7
        part = whole[13:91, 48:144]
        yield from _render()
        uncropped = _result(folder)
        expect(uncropped.shape == whole.shape, "a border without crop changes the size")
        expect(bool((uncropped[13:91, 48:144, 3] > 0.0).all()), "a border render leaves pixels out")
        expect(float(uncropped[:13].max()) == 0.0, "a border render draws outside of the border")
        expect(difference(part, uncropped[13:91, 48:144]) < 1e-3, "a border render differs from the whole")
        render.use_crop_to_border = True
        yield from _render()
        expect(difference(part, _result(folder)) < 1e-3, "a cropped border render differs from the whole")
        render.use_border = render.use_crop_to_border = False

        render.resolution_percentage = 50
        yield from _render()
        expect(_result(folder).shape == (65, 120, 4), "50 % give another size")
        scene.frame_start, scene.frame_end = 5, 7
        render.filepath = str(Path(folder) / "frame_####")
        yield from _render(animation=True)
        names = sorted(path.name for path in Path(folder).glob("frame_*"))
        expect(names == [f"frame_000{n}.exr" for n in (5, 6, 7)], f"frames written: {names}")


# Running them


def run(names: list[str]) -> Steps:
    """All checks in turn; ends the process."""
    failed = []
    for name in names:
        start = time.monotonic()
        try:
            yield from CHECKS[name]()
            verdict = "ok"
        except Exception as error:
            failed.append(name)
            verdict = f"FAILED: {error}"
            if not isinstance(error, CheckError):
                traceback.print_exc()
        print(f"lifecycle: {name}: {verdict} ({time.monotonic() - start:.0f} s)", flush=True)
    printed = STDERR.text()
    if "Traceback" in printed or "Python script error" in printed:
        failed.append("stderr")
        print("lifecycle: errors were printed, see above", flush=True)
    print(f"lifecycle: {'failed: ' + ', '.join(failed) if failed else 'all passed'}", flush=True)
    STDERR.close()
    os._exit(1 if failed else 0)  # wm.quit_blender has no exit status, and asks about unsaved changes


class CapturedStderr:
    """What this process writes to stderr, Blender's own code included; shown again by close()."""

    def __init__(self) -> None:
        self._file = tempfile.TemporaryFile()
        self._original = os.dup(2)
        os.dup2(self._file.fileno(), 2)

    def text(self) -> str:
        sys.stderr.flush()
        self._file.seek(0)
        return self._file.read().decode(errors="replace")

    def close(self) -> None:
        text = self.text()
        os.dup2(self._original, 2)
        os.write(2, text.encode())


CHECKS: dict[str, Callable[[], Steps]] = {
    name.removeprefix("check_"): value for name, value in list(globals().items()) if name.startswith("check_")
}

if __name__ == "__main__":
    wanted = (sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []) or list(CHECKS)
    unknown = [name for name in wanted if name not in CHECKS]
    if unknown or bpy.app.background:
        reason = f"no check named {unknown[0]}" if unknown else "needs Blender's window: run without -b"
        print(f"lifecycle: {reason}; there are {', '.join(CHECKS)}", file=sys.stderr)
        sys.stderr.flush()
        os._exit(2)
    bpy.context.preferences.use_preferences_save = False  # what follows is for this session only
    bpy.context.preferences.view.show_splash = False
    PACKAGE = load_package()
    STDERR = CapturedStderr()
    sequence = run(wanted)
    # Persistent: files are loaded on the way.
    bpy.app.timers.register(lambda: next(sequence), first_interval=0.5, persistent=True)
