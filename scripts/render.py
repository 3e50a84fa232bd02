# SPDX-License-Identifier: GPL-3.0-or-later
# /// script
# requires-python = "==3.13.*"
# dependencies = ["bpy==5.2.*"]
# ///
"""Renders lake water with no screen: a video, a sequence of pictures, a contact sheet.

    blender -b [scene.blend] -P scripts/render.py -- [options]
    .venv/bin/python scripts/render.py [scene.blend] [options]
    uv run scripts/render.py [scene.blend] [options]

Without a scene it makes the demonstration lake. It works from a checkout with nothing
installed, and takes the installed extension where Blender has one enabled.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import sys
import time
import traceback
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from statistics import median
from types import ModuleType
from typing import TYPE_CHECKING, Any

SCRIPTS = Path(__file__).resolve().parent
CHECKOUT = SCRIPTS.parent
for _folder in (str(CHECKOUT), str(SCRIPTS)):
    if _folder not in sys.path:
        sys.path.insert(0, _folder)

from _arguments import (  # noqa: E402 - after the path
    count,
    error_limit,
    identifier,
    number,
    numbers,
    size,
    time_limit,
)
from _console import STOPPED, Console, Interrupted, Interrupts, Progress, duration  # noqa: E402
from _frame_files import (  # noqa: E402
    Output,
    Record,
    RenderProblem,
    UsageProblem,
    absolute,
    parse_output,
    remove_empty,
    require_file_name,
    require_writable,
    write_text,
)

if TYPE_CHECKING:
    from _blender_side import Job

EPILOG = """\
exit status:
  0 done; 2 wrong command line, or a file, folder or camera that it names is not usable;
  1 something failed later; 130 Ctrl-C; 143 terminated

A value that begins with a minus and has a comma needs an equals sign: --pond-velocity-0=-0.1,0.2

Frames are written under another name and renamed when they are whole. Whatever happens,
the same command with --resume goes on with the first missing one.
"""


def script_arguments() -> list[str]:
    """The arguments that are meant for this script: after `--` in Blender, all of them on the wheel."""
    if "bpy" in sys.modules and sys.modules["bpy"].app.binary_path:
        return sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    arguments = sys.argv[1:]
    return arguments[1:] if arguments[:1] == ["--"] else arguments


def readable_file(text: str) -> Path:
    """The path of a file that can be opened and is not empty. Raises UsageProblem."""
    path = Path(text).expanduser().absolute()
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise UsageProblem(f"{path} is empty: give another file")
    except OSError as error:
        raise UsageProblem(f"{path} cannot be read ({error.strerror}): check the path") from None
    return path


@dataclass(frozen=True)
class Known:
    """What the extension that is going to be used knows.

    choices: by property. own: the parameters that only one technique has (`core.parameters.OWN`), techniques:
    their labels, by key. presets: names of those that it brings.
    """

    choices: Mapping[str, Sequence[str]]
    own: Mapping[str, Any]
    techniques: Mapping[str, str]
    presets: Sequence[str]


def own_option(parser: argparse._ActionsContainer, name: str, own: Any) -> None:
    """Add the option of a parameter that only one technique has. own: its `core.parameters.OwnParameter`."""
    flag = f"--{name.replace('_', '-')}"
    text = own.description.split(". ")[0].replace("%", "%%")
    text = text[0].lower() + text[1:]
    if own.is_image:
        parser.add_argument(flag, metavar="FILE", help=text)
        return
    unit = {"LENGTH": " m", "ROTATION": " radians"}.get(own.unit, "")
    text += f" (default: {_as_text(own.default)}{unit})"
    if isinstance(own.default, bool):
        parser.add_argument(flag, action=argparse.BooleanOptionalAction, help=text)
    elif isinstance(own.default, tuple):
        names = ",".join("XYZW"[: len(own.default)])
        parser.add_argument(flag, type=numbers(len(own.default)), metavar=names, help=text)
    else:
        kind = int if isinstance(own.default, int) else number
        parser.add_argument(flag, type=kind, metavar="N" if kind is int else "X", help=text)


def _as_text(value: Any) -> str:
    """A default as the command line has it."""
    if isinstance(value, bool):
        return "on" if value else "off"
    return ",".join(f"{part:.4g}" for part in (value if isinstance(value, tuple) else (value,)))


def build_parser(known: Known) -> argparse.ArgumentParser:
    """The command line."""
    choices = known.choices
    parser = argparse.ArgumentParser(
        prog="render.py",
        description=(__doc__ or "").split("\n\n")[0],
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add(
        "scene",
        nargs="?",
        metavar="scene.blend",
        help="scene; without it the demonstration lake",
    )
    add(
        "--output",
        metavar="PATH",
        help="FILE.mp4 (H.264), a folder, name_####.png or name_####.exr, or one picture",
    )
    add("--format", choices=("png", "exr"), help="pictures in a folder (default: png)")
    add(
        "--contact-sheet",
        metavar="FILE.png",
        help="frames side by side; without --output only these are rendered",
    )
    add(
        "--contact-grid",
        type=size,
        default=(3, 4),
        metavar="ROWSxCOLUMNS",
        help="of the contact sheet (default: 3x4)",
    )
    add("--stats", metavar="FILE.json", help="write times, settings and versions")
    add("--resume", action="store_true", help="keep the frames that are done, render the missing ones")
    add("--verbose", action="store_true", help="show what Blender prints")

    group = parser.add_argument_group(
        "frames", "default: the scene's own; 96 frames of 960x540 for the demonstration lake"
    )
    add = group.add_argument
    add("--frames", type=count, metavar="N", help="how many")
    add("--frame-start", type=int, metavar="N", help="number of the first one")
    add("--resolution", type=size, metavar="WxH", help="pixels")
    add("--samples", type=count, metavar="N", help="antialiasing: pictures that are averaged for one frame")
    exactness = group.add_mutually_exclusive_group()
    add = exactness.add_argument
    add(
        "--quality",
        type=identifier,
        choices=choices["quality"],
        help="sizes of textures, steps and samples, for the frames' size; options change what it sets",
    )
    add(
        "--budget",
        type=time_limit,
        metavar="33ms",
        help="what a frame may take: measures settings on the first frame, and takes the most exact in it",
    )
    add(
        "--max-error",
        type=error_limit,
        metavar="1px",
        help="how far off a frame may be, in pixels or as 0.05flip: measures, and takes the fastest settings",
    )
    add = group.add_argument
    add(
        "--camera",
        choices=("turntable", "scene"),
        help="go once round the lake or the water, or the scene's camera",
    )

    group = parser.add_argument_group("water", "default: the scene's own")
    add = group.add_argument
    add(
        "--technique",
        type=identifier,
        choices=choices["technique"],
        help="how it is computed",
    )
    add(
        "--preset",
        metavar="NAME",
        help=f"{', '.join(known.presets)}, or one saved in Blender; options change what it sets",
    )
    add("--k", type=number, metavar="K", help="attenuation, 1/m")
    add("--q", type=number, metavar="Q", help="exponent of the Fresnel term")
    add("--c", type=number, metavar="C", help="offset of the reflection lookup, m")
    add(
        "--fov-ext",
        type=number,
        metavar="F",
        help="how much wider the textures see than the camera, at least 1",
    )
    add("--ior", type=number, metavar="N", help="index of refraction, at least 1")
    add("--depth", type=number, metavar="D", help="of the water, m, for the speed of the waves")
    add("--water-color", type=numbers(3), metavar="R,G,B", help="of deep water, scene-linear")
    add(
        "--texture-size",
        type=count,
        metavar="N",
        help="width and height of the refraction and reflection textures",
    )
    add(
        "--least-grid-resolution",
        type=count,
        metavar="N",
        help="vertices along each side of every grid of water, where its own has fewer",
    )
    add(
        "--intersection-steps",
        type=count,
        metavar="N",
        help="of the search for the bottom along a refracted ray",
    )
    add(
        "--refraction-steps",
        type=int,
        metavar="N",
        help="of the search for what a refracted ray meets, in place of --intersection-steps; 0 for those",
    )
    add(
        "--reflection-steps",
        type=int,
        metavar="N",
        help="of the search for what a reflected ray meets; 0 looks up a fixed way c along it",
    )
    add(
        "--exact-fresnel",
        action=argparse.BooleanOptionalAction,
        dest="use_exact_fresnel",
        help="Fresnel's equations in place of Schlick's approximation",
    )
    add(
        "--exact-under-water",
        action=argparse.BooleanOptionalAction,
        dest="use_exact_under_water",
        help="from under water: exact refraction and total reflection",
    )
    add("--water-level", type=number, metavar="Z", help="height of the water plane, m")
    add(
        "--obj",
        type=readable_file,
        metavar="FILE",
        help="Wavefront OBJ to stand in the water, half of it below",
    )

    group = parser.add_argument_group(
        "sunlight", "default: the scene's own; all of it needs a sun light there"
    )
    add = group.add_argument
    add(
        "--caustics",
        action=argparse.BooleanOptionalAction,
        dest="use_caustics",
        help="light that the waves focus on the bottom",
    )
    add(
        "--caustics-method",
        type=identifier,
        choices=choices["caustics_method"],
        help="how photons are summed; AUTO is the fastest that the machine supports",
    )
    add("--caustics-size", type=count, metavar="N", help="width and height of the caustics texture")
    add("--photon-size", type=count, metavar="N", help="photons along each side of the lit surface")
    add("--caustics-steps", type=count, metavar="N", help="of the search for the bottom along a photon's way")
    add(
        "--shadows",
        action=argparse.BooleanOptionalAction,
        dest="use_shadows",
        help="shadows of the sun, on land and under water",
    )
    add(
        "--light-depth-size",
        type=count,
        metavar="N",
        help="width and height of the depth textures as seen from the sun",
    )
    add(
        "--glow",
        action=argparse.BooleanOptionalAction,
        dest="use_glow",
        help="star around the sun's mirror image in the waves",
    )
    add("--glow-strength", type=number, metavar="S", help="brightness of the glow")
    add("--glow-exponent", type=number, metavar="E", help="the higher, the smaller the sun's mirror image")
    add("--glow-threshold", type=number, metavar="T", help="brightness, 0 to 1, below which nothing glows")

    for key, label in known.techniques.items():
        of_technique = {name: own for name, own in known.own.items() if own.technique == key}
        if of_technique:
            group = parser.add_argument_group(f"technique {label}", "of no effect with another")
            for name, own in of_technique.items():
                own_option(group, name, own)

    group = parser.add_argument_group("demonstration lake")
    add = group.add_argument
    add(
        "--view",
        choices=("above", "under", "dive"),
        help="round the lake, round its sunken floor under water, or down through the waves and up again "
        "(default: above)",
    )
    add("--seed", type=int, metavar="N", help="another number gives another lake")
    add("--detail", type=number, metavar="D", help="1 is full detail (about 131,000 vertices)")
    return parser


def known() -> Known:
    """What the extension that is going to be used knows, without starting Blender for it."""
    package = "lake_water_addon"
    if "bpy" in sys.modules:
        from _blender_side import enabled_extension

        package = enabled_extension() or package
    core = f"{package}.core"
    techniques = import_module(f"{core}.techniques").TECHNIQUES
    shipped = Path(str(import_module(core).__file__)).parents[1] / "data" / "presets" / "lake_water"
    return Known(
        choices={
            "technique": list(techniques),
            "caustics_method": list(import_module(f"{core}.settings").CAUSTICS_METHODS),
            "quality": list(import_module(f"{core}.quality").QUALITIES),
        },
        own=import_module(f"{core}.parameters").OWN,
        techniques={key: technique.label for key, technique in techniques.items()},
        presets=sorted(path.stem.replace("_", " ") for path in shipped.glob("*.py")),
    )


def check_inputs(options: argparse.Namespace, images: Iterable[str]) -> None:
    """Open the files that are named, and make their names paths. Raises UsageProblem.

    Not while the command line is taken apart: the value of a mistyped option looks like a scene there.
    images: names of the options that are image files.
    """
    for name in ("scene", "obj", *images):
        if getattr(options, name) is not None:
            setattr(options, name, readable_file(getattr(options, name)))
    if options.scene is not None and options.scene.suffix.lower() != ".blend":
        raise UsageProblem(
            f"{options.scene} is no .blend file: give one, or the option that the value is for"
        )
    if options.obj is not None and options.obj.suffix.lower() != ".obj":
        raise UsageProblem(f"--obj {options.obj}: give a Wavefront file, its name ending in .obj")


def check_places(options: argparse.Namespace, base: Path) -> list[Path]:
    """Find out where everything goes, and that it can be written. Returns the folders made for it.

    Puts the results into the options: target, and paths for contact_sheet and stats. Raises RenderProblem.
    """
    if options.contact_sheet is not None and not options.contact_sheet.lower().endswith(".png"):
        raise UsageProblem(f"--contact-sheet {options.contact_sheet}: give a name that ends in .png")
    target = options.target = parse_output(options.output, options.contact_sheet, options.format, base)
    if target.kind == "STILL":
        if options.frames not in (None, 1):
            raise UsageProblem(
                f"--output {options.output} is one picture and --frames asks for {options.frames}: put #### "
                f"into the name, such as {target.prefix}_####{target.suffix}"
            )
        if options.resume:
            raise UsageProblem(f"--resume is for a video or a sequence, and {options.output} is one picture")
    made: list[Path] = []
    for name in ("contact_sheet", "stats"):
        value = getattr(options, name)
        if value is not None:
            path = absolute(value, base)
            setattr(options, name, path)
            require_file_name(path, f"--{name.replace('_', '-')}")
            made = require_writable(path.parent, f"--{name.replace('_', '-')}") + made
    if target.kind != "SEQUENCE":
        require_file_name(target.path, "--output" if options.output else "--contact-sheet")
        made = require_writable(target.path.parent, "--output") + made
    return require_writable(target.folder, "--output") + made


def import_blender(console: Console) -> None:
    """Import bpy on the wheel; in Blender it is there. Raises RenderProblem."""
    try:
        with console.quiet():
            import bpy
    except ImportError as error:
        remedy = "run make setup and use .venv/bin/python, or uv run scripts/render.py"
        if error.name != "bpy":
            remedy = "a system library is missing: make setup says which and installs it"
        raise RenderProblem(f"Blender cannot be loaded ({error}): {remedy}") from None
    if bpy.app.version[:2] < (5, 2):
        raise RenderProblem(f"this is Blender {bpy.app.version_string}: Lake Water needs 5.2 or later")
    if not bpy.app.background:
        raise UsageProblem(
            "Blender has its window open: start it with -b, as in blender -b -P scripts/render.py"
        )


class Statistics:
    """What --stats writes: every frame's times, their medians, settings, versions, the machine."""

    def __init__(self) -> None:
        self.data: dict[str, Any] = {"outcome": "failed", "frames": []}
        self.started = time.monotonic()

    def describe(self, job: Job, settings: dict[str, Any]) -> None:
        """All that is known before the first frame."""
        import bpy
        from _gpu_start import machine

        self.data |= {
            "settings": settings,
            "frames_requested": len(job.frames),
            "extension": job.package.__name__,
            "versions": {
                "lake_water": settings["extension"],
                "blender": bpy.app.version_string,
                "python": platform.python_version(),
            },
            "machine": {**machine(), "system": platform.platform(), "cpus": os.cpu_count()},
            "notes": list(job.notes),
        }

    def add(self, frame: int, seconds: float, report: dict[str, Any]) -> None:
        """One rendered frame. seconds: all of it, with Blender's own work and the writing of the file."""
        notes = self.data["notes"]
        notes.extend(note for note in report["notes"] if note not in notes)
        kept = {key: value for key, value in report.items() if key not in ("notes", "error")}
        self.data["frames"].append({"frame": frame, "total_s": seconds, **kept})

    def write(self, path: Path) -> None:
        """Write the file; the medians leave out the first frame, which compiles the shaders.

        Raises RenderProblem.
        """
        frames = self.data["frames"]
        steady = frames[1:] or frames
        if steady:
            times = ("total_s", "frame_s", "extraction_s", "planning_s")
            passes = sorted({name for frame in steady for name in frame["passes"]})
            self.data["median"] = {
                "of_frames": len(steady),
                **{name: median(frame[name] for frame in steady) for name in times},
                "passes": {
                    name: median(frame["passes"].get(name, 0.0) for frame in steady) for name in passes
                },
            }
        self.data["elapsed_s"] = time.monotonic() - self.started
        write_text(path, json.dumps(self.data, indent=1) + "\n")


@dataclass
class Context:
    """What accompanies a run from start to end."""

    console: Console
    interrupts: Interrupts
    statistics: Statistics = field(default_factory=Statistics)
    empty_folders: list[Path] = field(default_factory=list)


def render_frames(job: Job, record: Record, chosen: list[int], context: Context) -> None:
    """Render those of the chosen frames that are missing. Raises RenderProblem, Interrupted."""
    from _blender_side import render_frame

    output, console = record.output, context.console
    missing = [frame for frame in chosen if frame not in record.done]
    progress = Progress(console.out, len(missing))
    context.interrupts.say = progress.line
    told: set[str] = set()
    progress.start()
    try:
        for frame in missing:
            context.interrupts.check()
            start = time.monotonic()
            report = render_frame(job, frame, output.frame(frame), console, context.interrupts)
            record.done.add(frame)
            if output.kind != "STILL":
                record.write()
            context.statistics.add(frame, time.monotonic() - start, report)
            for note in report["notes"]:
                if note not in told:
                    told.add(note)
                    progress.line(f"note: {note}")
            progress.step(frame)
    finally:
        progress.close()
    context.interrupts.check()


def make_video(job: Job, output: Output, context: Context) -> None:
    """Encode the frames. Raises RenderProblem."""
    from _video import encode

    with context.console.quiet():
        encode(output.path, [output.frame(frame) for frame in job.frames], job.scene, context.interrupts)


def make_sheet(
    job: Job, output: Output, chosen: list[int], options: argparse.Namespace, context: Context
) -> None:
    """Write the contact sheet of frames that are done. Raises RenderProblem."""
    import _contact_sheet

    with context.console.quiet():
        _contact_sheet.write(
            options.contact_sheet, [output.frame(frame) for frame in chosen], options.contact_grid, job.scene
        )


def run(options: argparse.Namespace, images: Iterable[str], context: Context) -> None:
    """Do what the options ask for. images: as of `check_inputs`. Raises RenderProblem, Interrupted."""
    check_inputs(options, images)
    blender = sys.modules.get("bpy")
    opened = options.scene or (Path(blender.data.filepath) if blender and blender.data.filepath else None)
    base = opened.parent if opened else Path.cwd()
    context.empty_folders = check_places(options, base)
    output: Output = options.target
    if options.resume and output.kind == "VIDEO" and output.path.exists() and not output.record.exists():
        context.console.out.write(f"{output.path} is finished; leave --resume away to render it again\n")
        return

    import_blender(context.console)
    import _blender_side
    import _gpu_start

    _gpu_start.require_gpu(context.console)
    with _blender_side.loaded_package() as package:
        make(package, options, context)


def make(package: ModuleType, options: argparse.Namespace, context: Context) -> None:
    """Prepare the scene, render and put the frames together. Raises RenderProblem, Interrupted."""
    import _blender_side
    from _contact_sheet import choose

    output: Output = options.target
    with context.console.quiet():
        job = _blender_side.prepare(package, options)
    context.interrupts.check()
    for note in job.notes:
        context.console.warn(f"note: {note}")

    if options.budget or options.max_error:
        import _budget

        _budget.choose(job, options, context)
    settings = _blender_side.resolved_settings(job, options)
    context.statistics.describe(job, settings)
    record = Record(output, settings)
    if options.resume and record.resume(job.frames):
        kept = len(record.done.intersection(job.frames))
        context.console.out.write(f"resuming: {kept} of {len(job.frames)} frames are there\n")
    if output.kind != "STILL":
        record.write()  # from here on, frames of an older render under the same names do not count

    sheet = choose(job.frames, *options.contact_grid) if options.contact_sheet else []
    start = time.monotonic()
    try:
        render_frames(job, record, sheet if output.kind == "SHEET" else job.frames, context)
    except BaseException:
        if not record.done and output.kind != "STILL":
            record.remove_frames()  # nothing to resume
        raise
    if job.budget is not None:
        context.statistics.data["budget"] = _budget.report(job, options, context)
    if output.kind == "VIDEO":
        make_video(job, output, context)
    if options.contact_sheet:
        make_sheet(job, output, sheet, options, context)
    if output.frames_are_temporary:
        record.remove_frames()
    made = dict.fromkeys([output.label] + [str(options.contact_sheet)] * bool(options.contact_sheet))
    seconds = time.monotonic() - start
    context.console.out.write(f"{' and '.join(made)}: done in {duration(seconds)}\n")


def main() -> int:
    """Returns the exit status."""
    context = Context(Console(verbose=False), Interrupts())
    context.interrupts.install()
    options: argparse.Namespace | None = None
    statistics = context.statistics
    try:
        extension = known()
        parser = build_parser(extension)
        options = parser.parse_args(script_arguments())
        context.console.verbose = options.verbose
        run(options, [name for name, own in extension.own.items() if own.is_image], context)
        statistics.data["outcome"] = "finished"
        status = 0
    except RenderProblem as problem:
        context.console.warn(f"error: {problem}")
        statistics.data["error"] = str(problem)
        status = problem.exit_code
    except (Interrupted, KeyboardInterrupt) as interrupt:
        context.console.warn(STOPPED)
        statistics.data["outcome"] = "interrupted"
        status = 128 + getattr(interrupt, "signum", signal.SIGINT)
    except Exception as error:  # a fault of ours: say where
        traceback.print_exc()
        context.console.warn(
            f"error: {type(error).__name__}: {error}; this is a fault of the script, please report it"
        )
        statistics.data["error"] = f"{type(error).__name__}: {error}"
        status = 1
    context.interrupts.ignore()
    if options is not None and isinstance(options.stats, Path) and "machine" in statistics.data:
        try:
            statistics.write(options.stats)
        except RenderProblem as problem:
            context.console.warn(f"error: {problem}")
            status = status or 1
    remove_empty(context.empty_folders)
    return status


if __name__ == "__main__":
    sys.exit(main())
