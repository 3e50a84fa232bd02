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
import sys
from pathlib import Path

from _arguments import count, number, size
from _console import Console
from _frame_files import RenderProblem
from _gpu_start import machine, require_gpu

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from _bench_kinds import DRY, FURTHER, KINDS, TECHNIQUE_KINDS
from _bench_report import report

from lake_water_addon.core.settings import DEFAULTS


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
    options = parser.parse_args(arguments)
    wanted = options.kinds or ([] if options.techniques else ["all"])
    if "all" in wanted:
        wanted = (*KINDS, *FURTHER)
    options.further = [name for name in FURTHER if name in wanted]
    options.kinds = [name for name in KINDS if name in wanted or (name == DRY and options.techniques)]
    options.kinds += TECHNIQUE_KINDS if options.techniques else ()
    if not options.kinds:
        parser.error("--kinds: give at least one kind of frame besides " + ", ".join(options.further))
    return options


def main() -> int:
    options = parse_arguments()
    if options.json is not None and not options.json.parent.is_dir():
        print(f"benchmark: the folder of {options.json} does not exist: make it first", file=sys.stderr)
        return 2
    # What is wrong with the options is said before Blender is loaded.
    import bpy
    from _bench_frames import measure_frames

    import lake_water_addon
    from lake_water_addon.render.targets import TargetError

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
    figures["machine"] = {
        "processor": platform.processor() or platform.machine(),
        **machine(),
        "blender": bpy.app.version_string,
        "python": platform.python_version(),
    }
    print(report(figures, markdown=options.markdown))
    if options.json is not None:
        options.json.write_text(json.dumps(figures, indent=2) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
