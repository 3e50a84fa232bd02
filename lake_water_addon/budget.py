# SPDX-License-Identifier: GPL-3.0-or-later
"""The budget of a scene: settings chosen from its calibration, and held to a time while an animation plays.

A time is that of one sample, as a viewport draws it; an error in pixels or FLIP is that of a whole picture.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import bpy
from gpu.types import GPUFrameBuffer

from . import calibration, handlers
from .calibration_plot import time_text
from .calibration_properties import MEASURES, LakeWaterCalibration, LakeWaterCalibrationPoint
from .core.parameters import OWN
from .core.techniques import TECHNIQUES
from .core.trade import Pace, Point, best_within, cheapest_within, pareto_front
from .host import Host
from .properties import LakeWaterSceneSettings, place_of
from .registration import register_classes, unregister_classes

NUMBER = "number"  # of a calibration's point, in the settings of a Point that stands for it
SAMPLES = ("samples", "viewport_samples")
REGIONS = 8  # whose paces are kept: viewports come and go
SPARES = 3  # textures of other sizes that are kept, so that a step back makes nothing


@dataclass(frozen=True)
class Choice:
    """What a budget comes to. number: of the calibration's point. fits: whether it is within the budget.

    limit: the budget in words. settings: by name, as the scene gets them.
    """

    number: int
    fits: bool
    limit: str
    settings: Mapping[str, object]


def single_front(kept: LakeWaterCalibration, measure: str) -> list[Point]:
    """The front of what was measured with one sample; their settings are the NUMBER of a point."""
    if measure == "PIXELS":
        numbers = calibration.front_points(kept, measure)
    else:
        numbers = [i for i, point in enumerate(kept.points) if _samples(point) == 1]
    return pareto_front([_point(kept, i, measure) for i in numbers if _error(kept.points[i], measure) >= 0.0])


def _samples(point: LakeWaterCalibrationPoint) -> int:
    return calibration.settings_of(point).get("samples", 1)


def _error(point: LakeWaterCalibrationPoint, measure: str) -> float:
    return getattr(point, measure.lower())


def _point(kept: LakeWaterCalibration, number: int, measure: str) -> Point:
    point = kept.points[number]
    return Point({NUMBER: number}, point.seconds, _error(point, measure))


def choice(scene: bpy.types.Scene) -> Choice | None:
    """What the scene's budget comes to; None without one, or where `problem` has something to say."""
    settings = scene.lake_water
    kept = settings.calibration
    if settings.budget == "OFF" or problem(scene):
        return None
    if settings.budget == "TIME":
        front, limit = single_front(kept, kept.measure), f"{settings.budget_time:.4g} ms"
        point = best_within(front, settings.budget_time / 1000.0)
        nearest = front[0]
    elif settings.budget == "PIXELS":
        front, limit = single_front(kept, "PIXELS"), f"{settings.budget_pixels:.3g} px"
        point = cheapest_within(front, settings.budget_pixels)
        nearest = front[-1]
    else:
        front = [_point(kept, i, "FLIP") for i in calibration.front_points(kept, "FLIP")]
        limit = f"FLIP {settings.budget_flip:.3g}"
        point = cheapest_within(front, settings.budget_flip)
        nearest = front[-1]
    number = (point or nearest).settings[NUMBER]
    values = calibration.settings_of(kept.points[number])
    if settings.budget != "FLIP":  # only the look of a picture depends on them
        values = {name: value for name, value in values.items() if name not in SAMPLES}
    return Choice(number, point is not None, limit, values)


def problem(scene: bpy.types.Scene) -> str:
    """Why the scene's budget cannot choose, in words; empty where it can, and without a budget."""
    settings = scene.lake_water
    kept = settings.calibration
    if settings.budget == "OFF":
        return ""
    if not kept.points:
        return "Nothing is measured on this scene: calibrate first"
    if kept.technique != settings.technique:
        label = TECHNIQUES[kept.technique].label if kept.technique in TECHNIQUES else kept.technique
        return f"The calibration is of the technique {label}: calibrate again"
    measure = {"TIME": kept.measure}.get(settings.budget, settings.budget)
    try:
        front = single_front(kept, measure)
    except ValueError:  # JSON that other hands have written
        return "The calibration of this file cannot be read: calibrate again"
    if not front:
        return f"The calibration could not measure {MEASURES[measure][0]}: choose another budget"
    return ""


def apply(scene: bpy.types.Scene) -> Choice | None:
    """Give the scene the settings that its budget comes to. Returns `choice`."""
    chosen = choice(scene)
    if chosen is not None:
        settings = scene.lake_water
        kept = {name: getattr(settings, name) for name in SAMPLES}
        settings.calibration.chosen = chosen.number  # marks it, and sets all that it names
        if "samples" not in chosen.settings:
            for name, value in kept.items():
                setattr(settings, name, value)
    return chosen


def is_applied(scene: bpy.types.Scene, chosen: Choice) -> bool:
    """Whether the scene still has the settings of a choice."""
    for name, value in chosen.settings.items():
        objects = handlers.waters(scene) if name in OWN else [None]
        for obj in objects:
            held = getattr(*place_of(name, scene, obj)) if obj else getattr(scene.lake_water, name)
            if held != value and not (isinstance(value, float) and math.isclose(held, value, rel_tol=1e-6)):
                return False  # Blender holds numbers as float32
    return True


# While an animation plays


@dataclass
class _State:
    """What lives between register() and unregister()."""

    listener: handlers.Listener
    now: str = ""  # what a viewport draws with while an animation plays


_state: _State | None = None


def is_playing() -> bool:
    """Whether an animation plays in one of the windows."""
    return any(window.screen.is_animation_playing for window in bpy.context.window_manager.windows)


class Pacing:
    """The paces of the viewport regions that one host draws."""

    def __init__(self, host: Host) -> None:
        self._host = host
        self._paces: dict[int, tuple[tuple, Pace | None]] = {}

    def of(self, region: bpy.types.Region, scene: bpy.types.Scene) -> Pace | None:
        """The pace of a region; None unless an animation plays and the scene has a time budget to hold.

        The settings of its points are those of the picture and the water, without samples.
        """
        settings = scene.lake_water
        if settings.budget != "TIME":
            self._host.renderer.targets.free_spares()
            return None
        self._host.renderer.targets.spares = SPARES
        if not is_playing():
            return None
        key = _front_key(settings)
        known = self._paces.pop(region.as_pointer(), None)
        if known is None or known[0] != key:
            points = [] if problem(scene) else _viewport_points(settings)
            known = (key, Pace(points, settings.budget_time / 1000.0) if points else None)
        self._paces[region.as_pointer()] = known
        while len(self._paces) > REGIONS:
            del self._paces[next(iter(self._paces))]
        return known[1]


class Watch:
    """Times a frame for a pace, where that asks for it; with no pace, it does nothing.

    wait: returns when the graphics card has drawn all that it was given. Made when the frame begins.
    """

    def __init__(self, pace: Pace | None, wait: Callable[[], object]) -> None:
        self._pace = pace if pace is not None and pace.measures(time.perf_counter()) else None
        self._wait = wait
        if self._pace is not None:
            wait()
        self._start = time.perf_counter()

    def stop(self) -> None:
        """The frame is drawn. Without this, as where nothing had to be drawn, it does not count."""
        if self._pace is not None:
            self._wait()
            now = time.perf_counter()
            self._pace.record(now - self._start, now)


def wait_for(framebuffer: GPUFrameBuffer) -> None:
    """Read one pixel of the bound framebuffer, which is there once all is drawn."""
    framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")


def _front_key(settings: LakeWaterSceneSettings) -> tuple:
    """All that a front follows from, without reading what the points say: this is asked at each frame."""
    kept = settings.calibration
    points = tuple((p.settings, p.seconds, _error(p, kept.measure)) for p in kept.points)
    return settings.budget_time, settings.technique, kept.technique, kept.measure, points


def _viewport_points(settings: LakeWaterSceneSettings) -> list[Point]:
    kept = settings.calibration
    found = []
    for point in single_front(kept, kept.measure):
        values = calibration.settings_of(kept.points[point.settings[NUMBER]])
        values = {name: value for name, value in values.items() if name not in SAMPLES}
        found.append(Point(values, point.seconds, point.error))
    return found


def describe(pace: Pace) -> str:
    """What a pace draws with now, in words."""
    words = f"point {pace.index + 1} of {len(pace.front)}"
    return words if pace.seconds is None else f"{words}, {time_text(pace.seconds)}"


def publish(words: str) -> None:
    """What the panel says while an animation plays (`describe`)."""
    if _state is not None:
        _state.now = words


def published() -> str:
    """What was published last, while an animation plays; else nothing."""
    return _state.now if _state is not None and is_playing() else ""


class LAKE_WATER_OT_apply_budget(bpy.types.Operator):
    """Give the scene the settings that its budget comes to, by its calibration"""

    bl_idname = "lake_water.apply_budget"
    bl_label = "Apply Budget"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        scene = context.scene
        chosen = apply(scene)
        if chosen is None:
            self.report({"ERROR"}, problem(scene) or "The scene has no budget: choose what it is to hold")
            return {"CANCELLED"}
        if not chosen.fits:
            self.report({"WARNING"}, f"Nothing measured is within {chosen.limit}: the nearest is taken")
        return {"FINISHED"}


def _calibrated(scene: bpy.types.Scene) -> None:
    apply(scene)


def register() -> None:
    """Add the operator; a new calibration is chosen from at once."""
    global _state  # noqa: PLW0603 - the one piece of state, gone again after unregister()
    register_classes((LAKE_WATER_OT_apply_budget,))
    _state = _State(handlers.Listener(calibrated=_calibrated))
    handlers.subscribe(_state.listener)


def unregister() -> None:
    """Take the operator away, and follow no calibration."""
    global _state  # noqa: PLW0603
    if _state is not None:
        handlers.unsubscribe(_state.listener)
    _state = None
    unregister_classes((LAKE_WATER_OT_apply_budget,))
