# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the benchmark's frames and takes their times."""

from __future__ import annotations

import argparse
import math
import statistics
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy
from _bench_kinds import DEFAULT, DRY, KINDS, RATIOS, SHORE, SPLIT, TECHNIQUE_KINDS, TOWARD_SUN, UNDER, Ratio
from _blender_side import DIVE_DISTANCE, UNDER_HEIGHT, UNDER_LOOK_HEIGHT, UNDER_RADIUS
from mathutils import Matrix, Vector

from lake_water_addon import handlers
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.extract import camera_from_object
from lake_water_addon.host import FrameReport, Host
from lake_water_addon.render.frame import PassTimer
from lake_water_addon.render.passes.accumulate import picture_target
from lake_water_addon.scenes import LakeScene, build_lake

GRIDS = (49, 128, 256, 512, 1024)
SUN_STEP = math.radians(0.5)
"""By how much the sun moves from frame to frame in the measurement of that name."""
WARM_UP = 20
"""Frames before memory is looked at."""


def resident_bytes() -> int:
    """Memory of this process in RAM."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


def make_cameras(scene: bpy.types.Scene, lake: LakeScene) -> dict[str, bpy.types.Object]:
    """A camera for each view, with the lens of the lake's own, which stands on the shore."""
    level, center, stage = lake.water_level, Vector(lake.center), Vector((*lake.stage, lake.water_level))
    to_sun = lake.sun.matrix_basis.to_3x3() @ Vector((0.0, 0.0, 1.0))
    # Over the lake's edge, with the mirror image that a calm surface has in the middle of the picture.
    away = -Vector((to_sun.x, to_sun.y, 0.0))
    over_water = center + 0.7 * lake.radius * away.normalized()
    over_water.z = level + 2.5
    mirrored = over_water - (over_water.z - level) / to_sun.z * (away + Vector((0.0, 0.0, to_sun.z)))
    sunken = stage + Vector((0.0, -UNDER_RADIUS, UNDER_HEIGHT))
    afloat = stage + DIVE_DISTANCE * (Vector((center.x, center.y, level)) - stage).normalized()
    places = {
        TOWARD_SUN: (over_water, mirrored),
        UNDER: (sunken, stage + Vector((0.0, 0.0, UNDER_LOOK_HEIGHT))),
        SPLIT: (afloat, stage),
    }
    cameras = {SHORE: lake.camera}
    for view, (place, target) in places.items():
        data = lake.camera.data.copy()
        camera = bpy.data.objects.new(f"Benchmark {view}", data)
        turned = (target - place).to_track_quat("-Z", "Y").to_matrix().to_4x4()
        camera.matrix_world = Matrix.Translation(place) @ turned
        scene.collection.objects.link(camera)
        cameras[view] = camera
    # The near plane's rectangle reaches beyond the highest and the lowest wave: it is cut in every frame.
    highest = sum(abs(wave.amplitude) for wave in lake.water.lake_water.waves)
    data = cameras[SPLIT].data
    data.clip_start = 1.1 * highest / _half_height(data, scene)
    return cameras


def _half_height(camera: bpy.types.Camera, scene: bpy.types.Scene) -> float:
    """Of the picture, at a distance of 1 m."""
    corners = camera.view_frame(scene=scene)
    return max(corner.y for corner in corners) / -corners[0].z


@dataclass
class Times:
    """What the frames of one kind cost. Seconds, one entry a round."""

    frame: list[float] = field(default_factory=list)
    extraction: list[float] = field(default_factory=list)
    planning: list[float] = field(default_factory=list)
    passes: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    made: Counter[str] = field(default_factory=Counter)
    sides: Counter[str] = field(default_factory=Counter)
    frames: int = 0
    report: FrameReport = field(default_factory=FrameReport)

    def add(self, report: FrameReport, side: str) -> None:
        """A frame; its own time counts when its passes were not timed."""
        self.report = report
        self.frames += 1
        self.made.update(report.made)
        self.sides[side] += 1
        self.extraction.append(report.extraction_s)
        self.planning.append(report.planning_s)

    def of(self, passes: Sequence[str]) -> list[float]:
        """Of the frame, or of these passes together, by round."""
        if not passes:
            return self.frame
        return [sum(spent) for spent in zip(*(self.passes[name] for name in passes), strict=True)]


class FrameBench:
    """The demonstration lake, drawn in frames of every kind.

    Each kind has a host of its own, as each viewport has: so a frame finds textures and light cameras as it
    left them in the frame before, and what another kind needs does not make it pay for them again.
    """

    def __init__(self, options: argparse.Namespace) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.size = options.resolution
        self.scene = bpy.context.scene
        self.scene.render.resolution_x, self.scene.render.resolution_y = self.size
        self.lake = build_lake(self.scene, seed=options.seed, detail=options.detail)
        self.cameras = make_cameras(self.scene, self.lake)
        self.settings = FrameSettings(
            texture_size=options.texture_size,
            caustics_size=options.caustics_size,
            photon_size=options.photon_size,
        )
        self.hosts: dict[str, Host] = {}
        self.depsgraph = bpy.context.evaluated_depsgraph_get()
        # Blender tells what changed only while it updates: listen, as the viewport does.
        self._listener = handlers.Listener(updated=self._note, frame_changed=self._note)
        handlers.subscribe(self._listener)

    def close(self) -> None:
        """Listen no more."""
        handlers.unsubscribe(self._listener)

    def advance(self, frame: int) -> None:
        """Go to a frame, as playback does."""
        self.scene.frame_set(frame)
        self.depsgraph = bpy.context.evaluated_depsgraph_get()

    def _note(self, _scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        for host in self.hosts.values():
            host.extractor.note_updates(depsgraph)

    def draw(self, name: str, times: Times | None = None, *, time_passes: bool = False) -> FrameReport:
        """One frame of a kind, from extraction to the last pixel."""
        kind = {**KINDS, **TECHNIQUE_KINDS}[name]
        host = self.hosts.setdefault(name, Host())
        host.begin(self.size)
        timer = PassTimer(enabled=time_passes)
        target = picture_target(host.renderer.targets, "benchmark", self.size)
        start = time.perf_counter()
        snapshot = host.snapshot(self.depsgraph)
        if not kind.water:
            snapshot = replace(snapshot, waters=())
        camera = self.cameras[kind.view].evaluated_get(self.depsgraph)
        plan = host.plan(
            snapshot,
            camera_from_object(camera, self.scene, *self.size),
            self.scene,
            settings=replace(self.settings, **kind.settings),
        )
        host.renderer.draw_picture(plan, target, timer)
        with target.framebuffer.bind():
            target.framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
        host.finish(timer, time.perf_counter() - start)
        if times is not None:
            times.add(host.report, plan.bodies[0].side.side.name if plan.bodies else "")
            if time_passes:
                for name_of_pass, spent in timer.seconds.items():
                    if plan.bodies or name_of_pass != "water":  # which has nothing to draw then
                        times.passes[name_of_pass].append(spent)
            else:
                times.frame.append(host.report.frame_s)
        return host.report


def measure_frames(options: argparse.Namespace) -> dict:
    """All figures of `frames`, as plain types. options: those of `benchmark.py frames`."""
    names, further = options.kinds, options.further
    bench = FrameBench(options)
    try:
        # The first frame of all compiles what the others may find compiled.
        first = DEFAULT if DEFAULT in names else names[0]
        bench.advance(1)
        first_frame = bench.draw(first).as_dict()
        for frame in (1, 2):
            bench.advance(frame)
            for name in names:
                bench.draw(name, time_passes=frame == 2)
        measured = _rounds(bench, names, options.repeats)
        figures = {
            "scene": {
                "vertices": bench.lake.vertex_count,
                "draw_calls": len(bench.hosts[first].renderer.scene.calls),
                "instances": sum(call.instances for call in bench.hosts[first].renderer.scene.calls),
                "resolution": list(options.resolution),
                "texture_size": options.texture_size,
                "caustics_size": options.caustics_size,
                "photon_size": options.photon_size,
                "repeats": options.repeats,
            },
            "first_frame": {"kind": first, **first_frame},
            "kinds": {name: _as_dict(name, times) for name, times in measured.items()},
            "ratios": [_ratio(r, measured) for r in RATIOS if {r.over, r.under} <= measured.keys()],
            "techniques": _techniques(measured) if options.techniques else {},
            "resident_mib": resident_bytes() / 2**20,
        }
        if "moving-sun" in further:
            figures["moving_sun"] = measure_moving_sun(bench, options.repeats)
        if "grid" in further:
            figures["grid"] = measure_grids(bench, options.repeats)
        if "memory" in further:
            figures["memory"] = measure_memory(bench, options.memory_frames)
        return figures
    finally:
        bench.close()


def _rounds(bench: FrameBench, names: Sequence[str], repeats: int) -> dict[str, Times]:
    """Every kind once in each round: what slows the machine down slows all of them."""
    measured = {name: Times() for name in names}
    for repeat in range(repeats):
        if sys.stderr.isatty():
            print(f"\rround {repeat + 1} of {repeats}", end="", file=sys.stderr, flush=True)
        # Every other round backwards, so that none always comes after the same one.
        order = names[:: 1 if repeat % 2 == 0 else -1]
        for time_passes in (False, True):
            bench.advance(2 * repeat + 3 + time_passes)  # new waves, without which caustics are not drawn
            for name in order:
                bench.draw(name, measured[name], time_passes=time_passes)
    if sys.stderr.isatty():
        print(file=sys.stderr)
    return measured


def _ms(seconds: Iterable[float]) -> float:
    return 1000.0 * statistics.median(seconds)


def _quartiles(values: Sequence[float]) -> list[float]:
    if len(values) < 2:
        return [values[0], values[0]]
    lower, _, upper = statistics.quantiles(values, n=4, method="inclusive")
    return [lower, upper]


def _as_dict(name: str, times: Times) -> dict:
    kind = {**KINDS, **TECHNIQUE_KINDS}[name]
    return {
        "label": kind.label,
        "view": kind.view,
        "settings": dict(kind.settings),
        "frame_ms": _ms(times.frame),
        "frame_ms_quartiles": [1000.0 * value for value in _quartiles(times.frame)],
        "frames_per_second": 1000.0 / _ms(times.frame),
        "extraction_ms": _ms(times.extraction),
        "planning_ms": _ms(times.planning),
        "passes_ms": {passed: _ms(spent) for passed, spent in times.passes.items()},
        "frames": times.frames,
        "made": dict(times.made),
        "sides": dict(times.sides) if kind.water else {},
        "sunlight": times.report.sunlight,
    }


def _pairs(over: Sequence[float], under: Sequence[float]) -> list[float]:
    return [a / b for a, b in zip(over, under, strict=True)]


def _ratio(ratio: Ratio, measured: dict[str, Times]) -> dict:
    values = _pairs(*(measured[name].of(ratio.passes) for name in (ratio.over, ratio.under)))
    value = statistics.median(values)
    return {
        "label": ratio.label,
        "over": ratio.over,
        "under": ratio.under,
        "passes": list(ratio.passes),
        "median": value,
        "quartiles": _quartiles(values),
        "aim": ratio.aim,
        "at_least": ratio.at_least,
        "met": ratio.met(value),
        "thesis": ratio.thesis,
    }


def _techniques(measured: dict[str, Times]) -> dict[str, dict]:
    """By name of the technique: its frame, its water, and its frame by that of the scene without water."""
    return {
        kind.settings["technique"]: {
            "label": kind.label,
            "frame_ms": _ms(measured[name].frame),
            "water_pass_ms": _ms(measured[name].passes["water"]),
            "ratio_to_scene_without_water": statistics.median(
                _pairs(measured[name].frame, measured[DRY].frame)
            ),
        }
        for name, kind in TECHNIQUE_KINDS.items()
    }


def measure_moving_sun(bench: FrameBench, repeats: int) -> dict:
    """Frames in which the depth textures of the sun's light have to be drawn anew."""
    times = Times()
    before = bench.lake.sun.rotation_euler.copy()
    for repeat in range(2 * repeats):
        bench.lake.sun.rotation_euler.z = before.z + SUN_STEP * (1 + repeat % 2)
        bench.advance(repeat + 2)
        bench.draw(DEFAULT, times, time_passes=repeat % 2 == 1)
    bench.lake.sun.rotation_euler = before
    return _as_dict(DEFAULT, times)


def measure_grids(bench: FrameBench, repeats: int) -> dict[str, dict[str, float]]:
    """What a finer water grid costs the processor before drawing, and the whole frame."""
    measured = {resolution: Times() for resolution in GRIDS}
    for repeat in range(-1, max(3, repeats // 5)):
        for resolution, times in measured.items():
            bench.lake.water.lake_water.grid_resolution = resolution
            bench.advance(repeat + 3)
            bench.draw(DEFAULT, times if repeat >= 0 else None)  # the first makes the grid
    bench.lake.water.lake_water.grid_resolution = GRIDS[0]
    return {
        str(resolution): {
            "extraction_and_planning_ms": _ms(map(sum, zip(times.extraction, times.planning, strict=True))),
            "frame_ms": _ms(times.frame),
        }
        for resolution, times in measured.items()
    }


def measure_memory(bench: FrameBench, frames: int) -> dict:
    """Growth of the process over many animated frames, after a warm-up."""
    for frame in range(WARM_UP):
        bench.advance(frame + 2)
        bench.draw(DEFAULT)
    before, times = resident_bytes(), Times()
    for frame in range(frames):
        bench.advance(frame + 2)
        bench.draw(DEFAULT, times)
    return {
        "frames": frames,
        "growth_kib": (resident_bytes() - before) / 1024,
        "made": dict(times.made),
    }
