# SPDX-License-Identifier: GPL-3.0-or-later
"""What the two hosts (`engine.py` and `viewport.py`) share: extraction, planning and a renderer."""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field, fields

import bpy

from .core.extents import Extents
from .core.plan import FramePlan, plan_frame
from .core.settings import FrameSettings
from .core.snapshot import Camera, SceneSnapshot
from .extract import SceneExtractor, view_visibility
from .render.frame import FrameRenderer, PassTimer
from .render.passes.caustics import chosen_method


@dataclass
class FrameReport:
    """What one frame cost and made. Seconds; `passes` by name; `made` counts GPU objects by kind.

    sunlight: as `describe_sunlight` gives it.
    """

    resolution: tuple[int, int] = (0, 0)
    extraction_s: float = 0.0
    planning_s: float = 0.0
    frame_s: float = 0.0
    passes: dict[str, float] = field(default_factory=dict)
    made: dict[str, int] = field(default_factory=dict)
    water_bodies: int = 0
    water_drawn: tuple[str, ...] = ()
    sunlight: dict[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    error: str | None = None

    def as_dict(self) -> dict:
        """Plain types, for JSON."""
        return {
            "error": self.error,
            "resolution": list(self.resolution),
            "extraction_s": self.extraction_s,
            "planning_s": self.planning_s,
            "frame_s": self.frame_s,
            "passes": dict(self.passes),
            "created": dict(self.made),
            "water_bodies": self.water_bodies,
            "water": list(self.water_drawn),
            "sunlight": dict(self.sunlight),
            "notes": list(self.notes),
        }


def frame_settings(scene: bpy.types.Scene) -> FrameSettings:
    """The scene's settings of the picture as plain data."""
    settings = scene.lake_water
    return FrameSettings(**{f.name: getattr(settings, f.name) for f in fields(FrameSettings)})


def describe_sunlight(plan: FramePlan) -> dict[str, str]:
    """What the sun does in a picture, and why not what it doesn't, by effect, in words for a person."""
    settings, sun = plan.settings, plan.snapshot.sun
    missing = "there is no sun" if sun is None else None
    caustics = missing or "no sunlit water is in the picture"
    if any(body.light is not None for body in plan.bodies):
        caustics = chosen_method(settings.caustics_method).reason
    shadows = missing or "nothing is in the picture"
    if plan.shadows:
        shadows = f"{len(plan.shadows)} windows" if len(plan.shadows) > 1 else "1 window"
    return {
        "caustics": caustics if settings.use_caustics else "switched off",
        "shadows": shadows if settings.use_shadows else "switched off",
        "glow": f"{'drawn' if plan.glow.drawn else 'not drawn'}, {plan.glow.reason}",
    }


class Host:
    """Extraction and rendering for one graphics context."""

    def __init__(self) -> None:
        self.extractor = SceneExtractor()
        self.renderer = FrameRenderer()
        self.report = FrameReport()
        self.paced = ""  # what a time budget has the frame drawn with, in words
        self._extents: Extents | None = None
        self._recent: deque[float] = deque(maxlen=20)

    def begin(self, resolution: tuple[int, int]) -> None:
        """A new frame: its report starts empty."""
        self.renderer.resources.reset_counts()
        self.report = FrameReport(resolution=resolution)
        self.paced = ""

    def snapshot(self, depsgraph: bpy.types.Depsgraph, **options) -> SceneSnapshot:
        """Extract, timed. options: those of `SceneExtractor.snapshot`."""
        start = time.perf_counter()
        snapshot = self.extractor.snapshot(depsgraph, **options)
        self.report.extraction_s += time.perf_counter() - start
        self.report.notes = snapshot.notes
        self.report.water_bodies = len(snapshot.waters)
        return snapshot

    def view_snapshot(self, depsgraph: bpy.types.Depsgraph, space: bpy.types.SpaceView3D) -> SceneSnapshot:
        """What one 3D view shows: `snapshot` with its local view and filters."""
        is_visible, key = view_visibility(space)
        return self.snapshot(depsgraph, is_visible=is_visible, visibility_key=key)

    def plan(
        self,
        snapshot: SceneSnapshot,
        camera: Camera,
        scene: bpy.types.Scene,
        *,
        settings: FrameSettings | None = None,
        **options,
    ) -> FramePlan:
        """Plan, timed. settings: in place of the scene's; options: those of `plan_frame`."""
        start = time.perf_counter()
        settings = settings or frame_settings(scene)
        plan = plan_frame(snapshot, camera, settings, extents=self._extents, **options)
        self._extents = plan.extents
        self.report.planning_s += time.perf_counter() - start
        self.report.water_drawn = tuple(
            f"{body.body.name}: {'drawn' if body.drawn else 'not drawn'}, {body.reason}"
            for body in plan.bodies
        )
        self.report.sunlight = describe_sunlight(plan)
        return plan

    def finish(self, timer: PassTimer, seconds: float) -> None:
        """The frame is drawn: complete its report."""
        self.report.passes = dict(timer.seconds)
        self.report.made = dict(self.renderer.resources.made)
        self.report.frame_s = seconds
        self._recent.append(time.perf_counter())

    def frames_per_second(self) -> float:
        """Over the last frames; 0 until there are two."""
        if len(self._recent) < 2 or self._recent[-1] == self._recent[0]:
            return 0.0
        return (len(self._recent) - 1) / (self._recent[-1] - self._recent[0])

    def statistics(self) -> list[str]:
        """Lines for the viewport and the panel."""
        report = self.report
        lines = [f"{self.frames_per_second():.1f} fps, water frame {1000 * report.frame_s:.1f} ms"]
        lines += [f"budget: {self.paced}"] if self.paced else []
        lines += [f"{name}: {1000 * seconds:.1f} ms" for name, seconds in report.passes.items()]
        lines.append(f"extraction: {1000 * report.extraction_s:.1f} ms")
        lines.append(f"planning: {1000 * report.planning_s:.1f} ms")
        lines += report.water_drawn
        lines += [f"{effect}: {text}" for effect, text in report.sunlight.items()]
        return lines
