#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what the water costs: `python scripts/benchmark.py frames [options]`.

Everything that is compared is measured in turn, in one run, so that the ratios mean something
on a machine whose speed wanders. Runs on the bpy wheel, with no display.
"""

from __future__ import annotations

import argparse
import json
import platform
import statistics
import sys
import time
from collections import defaultdict
from pathlib import Path

import bpy
from _arguments import count, number, size
from _console import Console
from _frame_files import RenderProblem
from _gpu_start import machine, require_gpu

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import lake_water_addon
from lake_water_addon import handlers
from lake_water_addon.core.plan import FramePlan
from lake_water_addon.extract import camera_from_object
from lake_water_addon.host import Host
from lake_water_addon.render.frame import PassTimer
from lake_water_addon.render.passes.accumulate import picture_target
from lake_water_addon.render.targets import TargetError
from lake_water_addon.scenes import build_lake

GRIDS = (49, 128, 256, 512, 1024)


def parse_arguments(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    frames = commands.add_parser("frames", help="time of each pass and of the frame, with water and without")
    frames.add_argument("--repeats", type=count, default=30, help="frames of each kind (default 30)")
    frames.add_argument("--memory-frames", type=count, default=500, help="of the memory test")
    frames.add_argument("--resolution", type=size, default=(640, 480), metavar="WxH")
    frames.add_argument("--texture-size", type=count, default=512)
    frames.add_argument("--detail", type=number, default=1.0, help="of the lake; 1 is the thesis's size")
    frames.add_argument("--seed", type=int, default=1)
    frames.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, too")
    return parser.parse_args(arguments)


def resident_bytes() -> int:
    """Memory of this process in RAM."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


class FrameBench:
    """The demonstration lake, drawn with and without its water."""

    def __init__(self, options: argparse.Namespace) -> None:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.size = options.resolution
        self.scene = bpy.context.scene
        self.lake = build_lake(self.scene, seed=options.seed, detail=options.detail)
        self.scene.camera = self.lake.camera
        self.scene.lake_water.texture_size = options.texture_size
        self.host = Host()
        self.depsgraph = bpy.context.evaluated_depsgraph_get()
        # Blender tells what changed only while it updates: listen, as the viewport does.
        handlers.subscribe(handlers.Listener(updated=self._note, frame_changed=self._note))
        self.target = picture_target(self.host.renderer.targets, "benchmark", self.size)

    def advance(self, frame: int) -> None:
        """Go to a frame, as playback does."""
        self.scene.frame_set(frame)
        self.depsgraph = bpy.context.evaluated_depsgraph_get()

    def _note(self, _scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        self.host.extractor.note_updates(depsgraph)

    def plan(self, *, water: bool = True) -> FramePlan:
        snapshot = self.host.snapshot(self.depsgraph)
        camera = camera_from_object(self.scene.camera.evaluated_get(self.depsgraph), self.scene, *self.size)
        plan = self.host.plan(snapshot, camera, self.scene)
        return plan if water else plan.without_water()

    def frame(self, *, water: bool = True, time_passes: bool = False) -> None:
        """One frame, from extraction to the last pixel; figures are in `host.report`."""
        self.host.begin(self.size)
        timer = PassTimer(enabled=time_passes)
        start = time.perf_counter()
        plan = self.plan(water=water)
        self.host.renderer.draw_picture(plan, self.target, timer)
        with self.target.framebuffer.bind():
            self.target.framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
        self.host.finish(timer, time.perf_counter() - start)


def median_ms(seconds: list[float]) -> float:
    return 1000.0 * statistics.median(seconds)


def measure_frames(options: argparse.Namespace) -> dict:
    """All figures of `frames`, as plain types."""
    bench = FrameBench(options)
    start = time.perf_counter()
    bench.frame()
    first_frame = bench.host.report.as_dict()
    first_frame["frame_s"] = time.perf_counter() - start
    bench.frame(time_passes=True)

    seconds: dict[str, list[float]] = defaultdict(list)
    made = defaultdict(int)
    for repeat in range(options.repeats):
        # Every kind once in each round: what slows the machine down slows all of them.
        bench.advance(repeat + 2)
        bench.frame()
        seconds["whole frame"].append(bench.host.report.frame_s)
        seconds["extraction"].append(bench.host.report.extraction_s)
        seconds["planning"].append(bench.host.report.planning_s)
        for kind, number_made in bench.host.report.made.items():
            made[kind] += number_made
        bench.frame(water=False)
        seconds["scene without water"].append(bench.host.report.frame_s)
        bench.frame(time_passes=True)
        for name, spent in bench.host.report.passes.items():
            seconds[f"pass {name}"].append(spent)

    return {
        "machine": {
            "processor": platform.processor() or platform.machine(),
            **machine(),
            "blender": bpy.app.version_string,
            "python": platform.python_version(),
        },
        "scene": {
            "vertices": bench.lake.vertex_count,
            "draw_calls": len(bench.host.renderer.scene.calls),
            "instances": sum(call.instances for call in bench.host.renderer.scene.calls),
            "resolution": list(options.resolution),
            "texture_size": options.texture_size,
            "repeats": options.repeats,
        },
        "first_frame": first_frame,
        "median_ms": {name: median_ms(values) for name, values in seconds.items()},
        "ratio_to_scene_without_water": statistics.median(
            with_water / without
            for with_water, without in zip(
                seconds["whole frame"], seconds["scene without water"], strict=True
            )
        ),
        "made_in_unchanged_frames": dict(made),
        "grid": measure_grids(bench, options.repeats),
        "memory": measure_memory(bench, options.memory_frames),
    }


def measure_grids(bench: FrameBench, repeats: int) -> dict[str, dict[str, float]]:
    """What a finer water grid costs the processor before drawing, and the whole frame."""
    spent: dict[int, dict[str, list[float]]] = {n: defaultdict(list) for n in GRIDS}
    for repeat in range(-1, max(3, repeats // 5)):
        for resolution in GRIDS:
            bench.lake.water.lake_water.grid_resolution = resolution
            bench.advance(2)
            bench.frame()
            if repeat < 0:  # makes the grid
                continue
            report = bench.host.report
            spent[resolution]["extraction and planning"].append(report.extraction_s + report.planning_s)
            spent[resolution]["whole frame"].append(report.frame_s)
    bench.lake.water.lake_water.grid_resolution = GRIDS[0]
    return {str(n): {name: median_ms(values) for name, values in by.items()} for n, by in spent.items()}


def measure_memory(bench: FrameBench, frames: int) -> dict:
    """Growth of the process over many animated frames, after a warm-up."""
    for frame in range(20):
        bench.advance(frame + 2)
        bench.frame()
    before = resident_bytes()
    made = defaultdict(int)
    for frame in range(frames):
        bench.advance(frame + 2)
        bench.frame()
        for kind, number_made in bench.host.report.made.items():
            made[kind] += number_made
    return {"frames": frames, "growth_kib": (resident_bytes() - before) / 1024, "made": dict(made)}


def print_figures(figures: dict) -> None:
    device, scene = figures["machine"], figures["scene"]
    print(f"{device['renderer']}, {device['driver']}, Blender {device['blender']}")
    print(
        f"{scene['vertices']} vertices, {scene['instances']} instances, {scene['draw_calls']} draw calls; "
        f"{scene['resolution'][0]} x {scene['resolution'][1]}, textures {scene['texture_size']}²"
    )
    for name, value in figures["median_ms"].items():
        print(f"  {name:22s} {value:9.2f} ms")
    print(f"  whole frame / scene without water: {figures['ratio_to_scene_without_water']:.2f}")
    first = figures["first_frame"]
    print(f"  first frame {first['frame_s']:.2f} s, of it extraction {first['extraction_s']:.2f} s")
    print(f"  made in the first frame: {first['created']}")
    print(f"  made in frames where only the time changed: {figures['made_in_unchanged_frames'] or 'nothing'}")
    for resolution, values in figures["grid"].items():
        print(
            f"  water grid {resolution:>4s}²: "
            f"extraction and planning {values['extraction and planning']:.2f} ms, "
            f"whole frame {values['whole frame']:.1f} ms"
        )
    memory = figures["memory"]
    print(
        f"  memory over {memory['frames']} frames: {memory['growth_kib']:+.0f} KiB, "
        f"made {memory['made'] or 'nothing'}"
    )


def main() -> int:
    options = parse_arguments()
    if options.json is not None and not options.json.parent.is_dir():
        print(f"benchmark: the folder of {options.json} does not exist: make it first", file=sys.stderr)
        return 2
    try:
        require_gpu(Console(verbose=False))
    except RenderProblem as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 1
    lake_water_addon.register()
    try:
        figures = measure_frames(options)
    except (ValueError, TargetError) as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("benchmark: stopped, nothing is written", file=sys.stderr)
        return 130
    finally:
        lake_water_addon.unregister()
    print_figures(figures)
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
