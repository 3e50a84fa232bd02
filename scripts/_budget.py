# SPDX-License-Identifier: GPL-3.0-or-later
"""--budget and --max-error of the render script: measures what settings cost, and chooses by that."""

from __future__ import annotations

import itertools
import time
from argparse import Namespace
from collections.abc import Mapping
from statistics import median
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from _arguments import Limit
from _blender_side import Job, part_of
from _console import duration
from _frame_files import RenderProblem, UsageProblem, recorded_settings

if TYPE_CHECKING:
    from render import Context

TOLD_EVERY = 10.0  # s between lines of progress, where they stay on the screen


def limit_of(options: Namespace) -> tuple[str, Limit]:
    """The option that was given, and its value."""
    if options.budget is not None:
        return "--budget", options.budget
    return "--max-error", options.max_error


def choose(job: Job, options: Namespace, context: Context) -> None:
    """Give the scene the settings that the option asks for, and put what is known of them into the job.

    That is `asked`, `settings`, `fits`, and `expected`: `seconds` of a frame, `pixels` and `flip` of error,
    None where it could not be measured; `best`, the settings that FLIP compares with. With --resume they are
    those of before, and nothing is measured. Raises RenderProblem, Interrupted.
    """
    option, limit = limit_of(options)
    asked = f"{option} {limit.text}"
    if not job.water:
        raise UsageProblem(f"{option}: the scene has no water to measure")
    _refuse_both(job, options, option)
    calibration = part_of(job.package, "calibration")
    then = recorded_settings(options.target).get("budget") if options.resume else None
    if isinstance(then, dict) and then.get("asked") == asked and isinstance(then.get("settings"), dict):
        calibration.apply_settings(job.scene, then["settings"])
        job.budget = then
        return
    start = time.monotonic()
    measured = _measure(job, option, context)
    job.budget = {"asked": asked, **_choice(job, limit, measured), "best": dict(measured.axes.best)}
    calibration.apply_settings(job.scene, job.budget["settings"])
    took = duration(time.monotonic() - start)
    words, expected = calibration.words(job.budget["settings"]), _words(job, job.budget["expected"])
    context.console.out.write(f"{asked}: {words}; expected {expected}, found in {took}\n")
    if not job.budget["fits"]:
        nearest = "the fastest" if limit.kind == "TIME" else "the most exact"
        context.console.warn(f"note: nothing that was measured is within {asked}: {nearest} is taken")


def _refuse_both(job: Job, options: Namespace, option: str) -> None:
    """Refuse options that set what a budget chooses. Raises UsageProblem."""
    candidates = part_of(job.package, "core.candidates")
    names = {"texture_size", "samples", *candidates.BEST}
    names |= {name for values in candidates.LIGHT.values() for value in values for name in value}
    for name in sorted(names):
        if getattr(options, name, None) not in (None, False):
            own = "--" + name.removeprefix("use_").replace("_", "-")
            raise UsageProblem(f"{own} and {option} both decide how exactly to compute: give one of them")


def _measure(job: Job, option: str, context: Context) -> Any:
    """The finished calibration of the first frame; the scene keeps it. Raises UsageProblem, Interrupted."""
    operator = part_of(job.package, "calibrate_operator")
    error_kind = part_of(job.package, "bench").CalibrationError
    console, told = context.console, time.monotonic()
    console.out.write("measuring what settings cost on the first frame\n")
    try:
        with console.quiet():
            job.scene.frame_set(job.frames[0])
            calibration, view = operator.start(bpy.context, "CAMERA")
        while not calibration.done:
            context.interrupts.check()
            with console.quiet():
                calibration.step()
            if time.monotonic() - told > TOLD_EVERY:
                told = time.monotonic()
                console.out.write(f"measuring: {calibration.progress:.0%}\n")
    except error_kind as error:
        raise UsageProblem(f"{option}: {error}") from None
    except ValueError as error:
        raise RenderProblem(f"{option}: {error}") from None
    part_of(job.package, "calibration").store(job.scene, calibration, view)
    return calibration


def _choice(job: Job, limit: Limit, calibration: Any) -> dict[str, Any]:
    """`settings`, `fits` and `expected` of `choose`."""
    trade = part_of(job.package, "core.trade")
    parts = part_of(job.package, "calibration")
    kind = "FLIP" if limit.kind == "TIME" else limit.kind
    front = parts.front(job.scene, kind)
    if limit.kind == "TIME":
        front = front or parts.front(job.scene, "PIXELS")
    if not front:
        raise UsageProblem(f"{limit.text}: the error in {kind.lower()} could not be measured in this picture")
    if limit.kind == "TIME":
        chosen, nearest = trade.best_within(front, limit.value), front[0]
    else:
        chosen, nearest = trade.cheapest_within(front, limit.value), front[-1]
    settings = dict((chosen or nearest).settings)
    known = next(m for m in calibration.results if dict(m.settings) == settings)
    expected = {"seconds": known.seconds, "pixels": known.pixels, "flip": known.flip}
    if limit.kind == "PIXELS":  # samples move nothing: the scene's own
        del settings["samples"]
        samples = job.scene.lake_water.samples
        expected["seconds"], expected["flip"] = _picture(calibration.bench, settings, samples)
    return {"settings": settings, "fits": chosen is not None, "expected": _plain(expected)}


def _picture(bench: Any, settings: Mapping[str, object], samples: int) -> tuple[float, float]:
    """Seconds and FLIP of a picture of so many samples."""
    for _ in bench.draw(settings, 1):  # makes what it needs
        pass
    seconds = sum(taken for _, taken in bench.draw(settings, samples))
    return seconds, bench.flip(samples)


def _plain(values: Mapping[str, float]) -> dict[str, float | None]:
    """For JSON, which has no NaN."""
    return {name: float(f"{value:.6g}") if np.isfinite(value) else None for name, value in values.items()}


def _words(job: Job, found: Mapping[str, float | None]) -> str:
    words = [part_of(job.package, "calibration_plot").time_text(found["seconds"]) + " a frame"]
    if found["pixels"] is not None:
        words.append(f"{found['pixels']:.2g} px")
    if found["flip"] is not None:
        words.append(f"FLIP {found['flip']:.2g}")
    return ", ".join(words)


def report(job: Job, options: Namespace, context: Context) -> dict[str, Any]:
    """What was expected and what came: for --stats, and in a line for the person.

    measured: `seconds`, the median of the frames but the first, without extraction, which calibration leaves
    out, too; with --stats, errors at the frame in the middle, elsewhere than where they were expected from.
    """
    frames = context.statistics.data["frames"]
    steady = [f["frame_s"] - f["extraction_s"] for f in frames[1:] or frames]
    found = dict(job.budget)
    if not steady:
        return found
    measured = {"seconds": median(steady), "pixels": float("nan"), "flip": float("nan")}
    if options.stats is not None:
        measured |= _errors(job, job.frames[len(job.frames) // 2], context)
    found["measured"] = _plain(measured)
    context.console.out.write(f"measured {_words(job, found['measured'])}\n")
    return found


def _errors(job: Job, frame: int, context: Context) -> dict[str, float]:
    """pixels and flip of the settings in use at a frame; NaN where there is nothing to measure."""
    operator, parts = (part_of(job.package, name) for name in ("calibrate_operator", "calibration"))
    settings, samples = job.budget["settings"], job.scene.lake_water.samples
    values = {name: value for name, value in settings.items() if name != "samples"}
    try:
        with context.console.quiet():
            job.scene.frame_set(frame)
            calibration, _ = operator.start(bpy.context, "CAMERA")
        bench = calibration.bench
        take = (job.budget["best"], *parts.REFERENCE_SAMPLES, parts.REFERENCE_SECONDS)
        for _ in itertools.chain(bench.look(), bench.take_reference(*take)):
            context.interrupts.check()
    except part_of(job.package, "bench").CalibrationError:
        return {}  # at this frame, no water is seen from the air
    return {"pixels": bench.ray_errors(values).pixels, "flip": _picture(bench, values, samples)[1]}
