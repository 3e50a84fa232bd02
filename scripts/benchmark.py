#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures what the water costs, and what error it leaves.

    python scripts/benchmark.py frames [options]    time of each pass and of the frame
    python scripts/benchmark.py trade [options]     time and error of each setting, against references

Everything that is compared is measured in turn, in one run, so that the ratios mean something
on a machine whose speed wanders. Runs on the bpy wheel, with no display.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from _arguments import count, identifier, number, size
from _console import Console
from _frame_files import RenderProblem
from _gpu_start import machine, require_gpu

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from _bench_kinds import DRY, FURTHER, KINDS, TECHNIQUE_KINDS
from _bench_report import report

from lake_water_addon.core.settings import DEFAULTS
from lake_water_addon.core.techniques import TECHNIQUES

RESUMES = "the same command goes on where it stopped"


def parse_arguments(arguments: list[str] | None = None) -> argparse.Namespace:
    """The options; `kinds` names the kinds of frame to draw, `further` what else to measure."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    frames = commands.add_parser("frames", help="time of each pass and of the frame, of every kind of frame")
    frames.add_argument("--repeats", type=count, default=30, help="rounds of all kinds (default 30)")
    frames.add_argument("--memory-frames", type=count, default=500, help="of the memory test")
    frames.add_argument("--resolution", type=size, default=(640, 480), metavar="WxH")
    frames.add_argument("--texture-size", type=count, default=DEFAULTS.texture_size)
    frames.add_argument("--caustics-size", type=count, default=DEFAULTS.caustics_size, help="texels a side")
    frames.add_argument(
        "--photon-size", type=count, default=DEFAULTS.photon_size, help="photons of caustics a side"
    )
    frames.add_argument("--detail", type=number, default=1.0, help="of the lake; 1 is the thesis's size")
    frames.add_argument("--seed", type=int, default=1)
    frames.add_argument(
        "--kinds",
        nargs="+",
        choices=(*KINDS, *FURTHER, "all"),
        metavar="KIND",
        help=f"measure these alone, of {', '.join((*KINDS, *FURTHER))}; all is the default",
    )
    frames.add_argument(
        "--techniques", action="store_true", help="compare the techniques; alone unless --kinds adds to it"
    )
    frames.add_argument("--markdown", action="store_true", help="print the tables for docs/benchmark.md")
    frames.add_argument("--json", type=Path, metavar="FILE", help="write the figures there, too")
    _add_trade(commands.add_parser("trade", help="time against error of every setting, in every scene"))
    options = parser.parse_args(arguments)
    if options.command == "frames":
        _choose_kinds(parser, options)
    return options


def _choose_kinds(parser: argparse.ArgumentParser, options: argparse.Namespace) -> None:
    wanted = options.kinds or ([] if options.techniques else ["all"])
    if "all" in wanted:
        wanted = (*KINDS, *FURTHER)
    options.further = [name for name in FURTHER if name in wanted]
    options.kinds = [name for name in KINDS if name in wanted or (name == DRY and options.techniques)]
    options.kinds += TECHNIQUE_KINDS if options.techniques else ()
    if not options.kinds:
        parser.error("--kinds: give at least one kind of frame besides " + ", ".join(options.further))


def _add_trade(trade: argparse.ArgumentParser) -> None:
    add = trade.add_argument
    add("--scenes", nargs="+", metavar="SCENE", help="of _trade_scenes.py; all is the default")
    add("--techniques", nargs="+", type=identifier, choices=TECHNIQUES, default=list(TECHNIQUES))
    add("--resolution", type=size, default=(320, 240), metavar="WxH")
    add("--detail", type=number, default=0.3, help="of the lake (default 0.3)")
    add("--quick", action="store_true", help="few settings, to try the program")
    add("--brief", action="store_true", help="the most important settings alone, a quarter of the points")
    add(
        "--engines",
        nargs="*",
        metavar="SCENE",
        help="EEVEE and Cycles as well, in these scenes, or all of them",
    )
    add(
        "--output", type=Path, default=Path("build/trade"), help="tables and references (default build/trade)"
    )
    add("--repeats", type=count, default=5, help="most pictures of a setting that are timed (default 5)")
    add(
        "--shared",
        type=number,
        default=1.0,
        metavar="PART",
        help="measure times again during which other programs had more of the processor than this, 0 to 1",
    )
    add("--photons", type=count, default=10_000_000, help="of a reference, in each of its windows")
    add("--rays", type=count, default=16, help="of a reference, for each pixel")
    add("--workers", type=count, default=4, help="threads that make a reference")
    only = trade.add_mutually_exclusive_group()
    only.add_argument("--errors-only", action="store_true", help="no times, as on a busy machine")
    only.add_argument("--times-only", action="store_true", help="no errors")
    only.add_argument("--report-only", action="store_true", help="measure nothing more")
    add("--no-report", action="store_true", help=argparse.SUPPRESS)
    add(
        "--report",
        type=Path,
        metavar="FOLDER",
        help="where trade.md, trade.csv and images/trade are written (default: in the output's folder)",
    )


def main() -> int:
    options = parse_arguments()
    return {"frames": _frames, "trade": _trade}[options.command](options)


def _frames(options: argparse.Namespace) -> int:
    if options.json is not None and not options.json.parent.is_dir():
        print(f"benchmark: the folder of {options.json} does not exist: make it first", file=sys.stderr)
        return 2
    # What is wrong with the options is said before Blender is loaded.
    from _bench_frames import measure_frames

    figures: dict = {}
    status = _with_blender(lambda: figures.update(measure_frames(options)), "nothing is written")
    if status != 0:
        return status
    figures["machine"] = this_machine()
    print(report(figures, markdown=options.markdown))
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


def _trade(options: argparse.Namespace) -> int:
    from _trade_report import write_report

    options.quiet = not sys.stderr.isatty()
    options.errors = not (options.times_only or options.report_only)
    options.times = not (options.errors_only or options.report_only)
    if not options.report_only:
        from _trade_measure import measure_trade
        from _trade_scenes import TRADE_SCENES

        scenes = options.scenes or list(TRADE_SCENES)
        if len(scenes) > 1:
            status = _each_alone(scenes)
        else:
            status = _with_blender(lambda: measure_trade(options, this_machine()), RESUMES)
        if status != 0 or options.no_report:
            return status
    folder = options.report or options.output / "report"
    try:
        written = write_report(options.output, folder)
    except ValueError as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    print(f"{written}")
    return 0


def _each_alone(scenes: Sequence[str]) -> int:
    """Measure each scene in a process of its own: opening the next would end the graphics context."""
    for scene in scenes:
        try:
            # Of an option that is given twice, the last counts.
            status = subprocess.call([sys.executable, *sys.argv, "--scenes", scene, "--no-report"])
        except KeyboardInterrupt:
            return 130  # the other has said so
        if status != 0:
            return status
    return 0


def _with_blender(measure: Callable[[], object], stopped: str) -> int:
    """Exit status after measuring with the extension registered. stopped: what is said after Ctrl-C."""
    import lake_water_addon
    from lake_water_addon.render.targets import TargetError

    try:
        require_gpu(Console(verbose=False))
    except RenderProblem as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 1
    lake_water_addon.register()
    try:
        measure()
    except (ValueError, TargetError) as error:
        print(f"benchmark: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f"benchmark: stopped, {stopped}", file=sys.stderr)
        return 130
    finally:
        lake_water_addon.unregister()
    return 0


def this_machine() -> dict[str, str]:
    """What measured."""
    import bpy

    return {
        "processor": platform.processor() or platform.machine(),
        "cores": str(os.cpu_count()),
        **machine(),
        "blender": bpy.app.version_string,
        "python": platform.python_version(),
    }


if __name__ == "__main__":
    sys.exit(main())
