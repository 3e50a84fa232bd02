# SPDX-License-Identifier: GPL-3.0-or-later
"""Measures points of `_trade_points` in one scene: time beside the dry scene's, error against references."""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import statistics
import subprocess
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np
from _trade_engines import CONVERGED, DIRECT, busy_seconds, engine_points
from _trade_points import (
    ALWAYS,
    DEFAULT,
    Settings,
    optics_of,
    point,
    points,
    quality_point,
    to_cells,
    without_caustics,
)
from _trade_scenes import FRAME, TRADE_SCENES, open_scene
from _trade_table import (
    CAUSTICS_ERRORS,
    ERRORS,
    PICTURE_ERRORS,
    TIMES,
    engines_table,
    errors_table,
    picture_file,
    reference_file,
    times_table,
)
from tqdm import tqdm

from lake_water_addon import handlers
from lake_water_addon.core.overlay import lay_over
from lake_water_addon.core.plan import FramePlan, pixel_jitter
from lake_water_addon.core.quality import QUALITIES
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import Camera, SceneSnapshot, WaterSettings
from lake_water_addon.core.technique_traced import TracedSettings
from lake_water_addon.core.techniques import TECHNIQUES
from lake_water_addon.extract import camera_from_object
from lake_water_addon.host import Host
from lake_water_addon.render.frame import PassTimer
from lake_water_addon.render.passes.accumulate import mean_target, picture_target
from lake_water_addon.render.passes.hits import Hits
from scripts.reference.images import bilinear, read_images
from scripts.reference.measures import caustics_error, error_maps, picture_error
from scripts.reference.optics import WaterOptics, physical_optics, project_optics
from scripts.reference.photons import Sunlight
from scripts.reference.tracer import Picture, Reference
from scripts.reference.truth import TrueHits, technique_errors, true_hits

DRY = FrameSettings(use_caustics=False, **ALWAYS)
"""The scene without water, with shadows, which every time is compared with."""

SECONDS = 1.5
"""What the timed frames of one point may take together, as long as there are LEAST_PAIRS of them..."""
LEAST_PAIRS = 2
MOST_SECONDS = 5.0
"""... or they take as long as this: of a picture of many samples, one is a mean already."""

COUNTED = 512
"""Texels a side of the counted light that caustics are compared with."""
COUNT_BORDER = 12
"""Texels at its border, where the extension drops light, that don't count."""

WATER_SHOWN = 0.5
"""Part of a pixel from which on it is one of the water's, where a yes or no is asked."""


@dataclass(frozen=True)
class Accuracy:
    """Of the references. photons: in each window; rays: of a pixel."""

    photons: int = 10_000_000
    rays: int = 16


class SceneBench:
    """One scene of the trade: draws it by any settings, and knows what it should look like.

    size: (width, height); folder: of the run, where references are kept; workers: threads that make them.
    """

    def __init__(
        self, name: str, size: tuple[int, int], detail: float, accuracy: Accuracy, folder: Path, workers: int
    ) -> None:
        self.name, self.size, self._accuracy = name, size, accuracy
        self._folder, self._workers = folder, workers
        self._built = open_scene(name, size, detail)
        self.scene = bpy.context.scene
        self.exposure = float(self.scene.view_settings.exposure)
        self._wet, self._dry = Host(), Host()
        self._listener = handlers.Listener(updated=self._note, frame_changed=self._note)
        handlers.subscribe(self._listener)
        self._frame = 0
        self._advance(FRAME)
        snapshot, camera = self._extracted(self._wet)
        self.content = _fingerprint(snapshot, camera)
        self._references: dict[str, Picture] = {}
        self._hits: TrueHits | None = None
        self._counts: dict[str, np.ndarray] = {}

    def close(self) -> None:
        """Listen no more."""
        handlers.unsubscribe(self._listener)

    def _note(self, _scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        for host in (self._wet, self._dry):
            host.extractor.note_updates(depsgraph)

    def _advance(self, frame: int) -> None:
        if frame != self._frame:
            self.scene.frame_set(frame)
            self._frame = frame
        self._depsgraph = bpy.context.evaluated_depsgraph_get()

    def _extracted(self, host: Host) -> tuple[SceneSnapshot, Camera]:
        snapshot = host.snapshot(self._depsgraph)
        camera = self._built.camera.evaluated_get(self._depsgraph)
        # How fine the surface is, the setting of the picture says alone.
        waters = tuple(replace(body, grid=(2, *body.grid[1:])) for body in snapshot.waters)
        return replace(snapshot, waters=waters), camera_from_object(camera, self.scene, *self.size)

    def is_under_water(self) -> bool:
        """Whether the picture begins in the water."""
        self._advance(FRAME)
        return self._plan(DEFAULT, point(DEFAULT, {})).immersed is not None

    # Drawing

    def _draw(self, technique: str | None, settings: Settings, samples: int) -> tuple[float, FramePlan]:
        """Seconds of a picture from extraction to its last pixel, and its last plan. None: the dry scene."""
        host = self._dry if technique is None else self._wet
        renderer = host.renderer
        picture = picture_target(renderer.targets, "trade", self.size)
        mean = mean_target(renderer.targets, "trade", self.size)
        start = time.perf_counter()
        host.begin(self.size)
        mean.colors[0].clear(format="FLOAT", value=(0.0, 0.0, 0.0, 0.0))
        snapshot, camera = self._extracted(host)
        if technique is None:
            snapshot, frame = replace(snapshot, waters=()), DRY
        else:
            frame, snapshot = lay_over(FrameSettings(technique=technique, **ALWAYS), snapshot, settings)
        for sample in range(samples):
            jitter = pixel_jitter(sample, samples, *self.size)
            plan = host.plan(snapshot, camera, self.scene, settings=frame, jitter=jitter, samples=samples)
            renderer.draw_picture(plan, picture, PassTimer())
            renderer.mean.add(picture, mean, 1.0 / samples)
        with mean.framebuffer.bind():
            mean.framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
        return time.perf_counter() - start, plan

    def times(self, technique: str, settings: Settings, most_pairs: int) -> dict[str, object]:
        """TIMES of a point: pictures in turn with the dry scene, while the waves move."""
        samples = int(settings["samples"])
        self._advance(FRAME)
        for of in (None, technique):  # what they make for the first time is made now
            self._draw(of, settings, 1)
        wet, dry = [], []
        busy, own, began = busy_seconds(), time.process_time(), time.perf_counter()
        while len(wet) < most_pairs and sum(wet) < (SECONDS if len(wet) >= LEAST_PAIRS else MOST_SECONDS):
            self._advance(FRAME + 1 + len(wet))
            for of in (technique, None) if len(wet) % 2 else (None, technique):
                spent, _ = self._draw(of, settings, samples if of else 1)
                (wet if of else dry).append(spent)
        ratios = [a / b for a, b in zip(wet, dry, strict=True)]
        low, high = np.quantile(ratios, (0.25, 0.75))
        medians = map(statistics.median, (wet, dry, ratios))
        others = busy_seconds() - busy - (time.process_time() - own)
        shared = max(others, 0.0) / ((time.perf_counter() - began) * (os.cpu_count() or 1))
        return dict(zip(TIMES, (*medians, float(low), float(high), len(wet), shared), strict=True))

    def dry_seconds(self, pictures: int = 5) -> float:
        """Median of a picture of the dry scene, to set beside times that others took."""
        spent = []
        for number in range(pictures + 1):
            self._advance(FRAME + number)
            spent.append(self._draw(None, {}, 1)[0])
        return statistics.median(spent[1:])

    def picture(self, technique: str, settings: Settings) -> tuple[np.ndarray, FramePlan]:
        """(h, w, 3) at FRAME, first row at the bottom, and its last plan."""
        self._advance(FRAME)
        _, plan = self._draw(technique, settings, int(settings["samples"]))
        mean = mean_target(self._wet.renderer.targets, "trade", self.size)
        width, height = self.size
        pixels = np.asarray(mean.colors[0].read(), dtype=np.float32).reshape(height, width, 4)
        return pixels[..., :3].astype(np.float64), plan

    # Errors

    def errors(self, technique: str, settings: Settings) -> tuple[dict[str, float], np.ndarray]:
        """ERRORS of a point, NaN for what does not exist, and its picture."""
        picture, plan = self.picture(technique, settings)
        found = self.picture_errors(picture, optics_of(technique))
        if technique == DEFAULT and settings.get("use_caustics"):
            found |= self._caustics_errors(plan)
        # Last: it draws other textures.
        found |= self._hit_errors(*self.hits(technique, settings))
        return {name: found.get(name, float("nan")) for name in ERRORS}, picture

    def hits(self, technique: str, settings: Settings) -> tuple[FramePlan, Hits]:
        """Where the pixels' middles look at FRAME, and the plan by which they do."""
        self._advance(FRAME)
        plan = self._plan(technique, settings)
        return plan, self._wet.renderer.draw_hits(plan, self.size)

    def _plan(self, technique: str, settings: Settings) -> FramePlan:
        snapshot, camera = self._extracted(self._wet)
        frame, snapshot = lay_over(FrameSettings(technique=technique, **ALWAYS), snapshot, settings)
        return self._wet.plan(snapshot, camera, self.scene, settings=frame)

    def picture_errors(self, picture: np.ndarray, optics: str) -> dict[str, float]:
        """PICTURE_ERRORS on the water and, with `_all`, of the whole. optics: a key of OPTICS."""
        reference = self.reference(optics)
        maps = error_maps(reference.radiance, picture, self.exposure)
        errors = {}
        for ending, mask in (("", reference.water), ("_all", None)):
            error = picture_error(reference.radiance, picture, mask, maps=maps)
            errors |= {name + ending: getattr(error, name) for name in PICTURE_ERRORS}
        return errors

    def _hit_errors(self, plan: FramePlan, hits: Hits) -> dict[str, float]:
        true = self.true_hits()
        of = technique_errors(plan, hits, true)
        errors = {}
        for kind, error, ends in (
            ("refracted", of.refracted, true.refracted),
            ("reflected", of.reflected, true.reflected),
        ):
            shares = {"beyond": error.beyond, "missed": error.missed, "false": error.false}
            if np.isfinite(error.distance).any():
                shares |= {
                    "median_m": np.nanmedian(error.distance),
                    "median_share": np.nanmedian(error.distance / ends.distance),
                    "median_texels": np.nanmedian(error.texels),
                    "median_pixels": np.nanmedian(error.pixels),
                    "mean_pixels": np.nanmean(error.pixels),
                }
            errors |= {f"{kind}_{name}": float(value) for name, value in shares.items()}
        return errors

    def _caustics_errors(self, plan: FramePlan) -> dict[str, float]:
        light = plan.bodies[0].light
        if light is None:
            return {}
        width = plan.settings.caustics_size
        texture = self._wet.renderer.caustics_texture(0, width)
        given = np.asarray(texture.read(), dtype=np.float64).reshape(width, width, -1)[..., 0]
        counted = self._counted(light.camera)
        inside = np.zeros(counted.shape, bool)
        inside[COUNT_BORDER:-COUNT_BORDER, COUNT_BORDER:-COUNT_BORDER] = True
        try:
            error = caustics_error(counted, resampled(given, COUNTED), inside)
        except ValueError:  # the light is even
            return {}
        return {f"caustics_{name}": getattr(error, name) for name in CAUSTICS_ERRORS}

    # References

    def tracer(self, optics: str) -> Reference:
        """What traces rays through the scene at FRAME. optics: a key of OPTICS."""
        self._advance(FRAME)
        snapshot, _ = self._extracted(self._wet)
        images = read_images(snapshot)
        return Reference(
            snapshot, images, water_optics=OPTICS[optics], workers=self._workers, quiet=not os.isatty(2)
        )

    def _kept(self, what: str, *more: object) -> Path:
        row = {"scene": self.name, "size": "x".join(map(str, self.size)), "content": self.content}
        row |= {"photons": self._accuracy.photons, "rays": self._accuracy.rays}
        return reference_file(self._folder, row, "-".join((what, *map(str, more))))

    def reference(self, optics: str) -> Picture:
        """What the scene looks like at FRAME. optics: a key of OPTICS. Kept on the disk."""
        if optics not in self._references:
            if not self._kept(optics).exists():
                self._make_references()
            with np.load(self._kept(optics)) as kept:
                self._references[optics] = Picture(*(kept[n].astype(np.float64) for n in Picture._fields))
        return self._references[optics]

    def _make_references(self) -> None:
        """With every optics. They bend light alike: photons are followed once and absorbed in all ways."""
        tracers = {name: self.tracer(name) for name in OPTICS}
        first = next(iter(tracers.values()))
        sun = first.snapshot.sun
        each = [
            np.concatenate([t.optics[i].absorption for t in tracers.values()])
            for i in range(len(first.optics))
        ]
        _, camera = self._extracted(self._wet)
        if any(first.sunlight):
            first.sunlight = [
                Sunlight(first.geometry, surface, replace(water, absorption=absorption), sun)
                for surface, water, absorption in zip(first.surfaces, first.optics, each, strict=True)
            ]
            first.count_photons(camera, self._accuracy.photons)
            windows = [sunlight.windows for sunlight in first.sunlight]
            for number, tracer in enumerate(tracers.values()):
                tracer.sunlight = [
                    Sunlight(tracer.geometry, surface, water, sun)
                    for surface, water in zip(tracer.surfaces, tracer.optics, strict=True)
                ]
                for sunlight, counted in zip(tracer.sunlight, windows, strict=True):
                    own = slice(3 * number, 3 * number + 3)
                    sunlight.windows = [replace(w, counts=w.counts[..., own]) for w in counted]
        for name, tracer in tracers.items():
            if not self._kept(name).exists():
                made = tracer.picture(camera, self.size, samples=self._accuracy.rays, photons=0)
                parts = {part: getattr(made, part).astype(np.float32) for part in Picture._fields}
                save(self._kept(name), **parts)

    def true_hits(self) -> TrueHits:
        """Where the rays through the pixels' middles go at FRAME."""
        if self._hits is None:
            _, camera = self._extracted(self._wet)
            self._hits = true_hits(self.tracer("project"), camera, self.size)
        return self._hits

    def _counted(self, camera) -> np.ndarray:
        """(COUNTED, COUNTED) light on the bottom in the texture of a light camera. Kept on the disk."""
        key = hashlib.blake2s(camera.view.tobytes() + camera.projection.tobytes(), digest_size=4).hexdigest()
        if key not in self._counts:
            path = self._kept("light", key)
            if not path.exists():
                sunlight = self.tracer("project").sunlight[0]
                counted = sunlight.count_texture(
                    camera, COUNTED, max(self._accuracy.photons // 4, 1), workers=self._workers
                )
                save(path, light=counted[..., 0].astype(np.float32))
            with np.load(path) as kept:
                self._counts[key] = kept["light"].astype(np.float64)
        return self._counts[key]


def save(path: Path, **arrays: np.ndarray) -> None:
    """Whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part")
    with part.open("wb") as file:
        np.savez_compressed(file, **arrays)
    part.replace(path)


def traced_optics(settings: WaterSettings) -> WaterOptics:
    """What the technique Traced models."""
    return physical_optics(settings, np.array(settings.of(TracedSettings).absorption))


OPTICS = {"project": project_optics, "physical": traced_optics}


def resampled(light: np.ndarray, size: int) -> np.ndarray:
    """(size, size) of a square texture: filtered as a lookup does, or the mean where it has more texels."""
    factor = len(light) // size
    if factor >= 1:
        return light.reshape(size, factor, size, factor).mean(axis=(1, 3))
    at = (np.arange(size) + 0.5) / size
    uv = np.stack(np.meshgrid(at, at), axis=-1).reshape(-1, 2)
    return bilinear(light[..., None], uv).reshape(size, size)


def _fingerprint(snapshot: SceneSnapshot, camera: Camera) -> str:
    """8 digits that change with what is seen: rows of a scene that changed are measured again."""
    digest = hashlib.blake2s(digest_size=4)

    def add(values: Iterator[object]) -> None:
        for value in values:
            digest.update(value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode())

    add((snapshot.time, camera.view, camera.projection))
    for mesh in snapshot.meshes.values():
        add((mesh.positions, *(part.triangles for part in mesh.parts)))
    for draw in snapshot.draws:
        add((draw.part, draw.matrices))
    for material in snapshot.materials.values():
        add((material.base_color, material.image, material.alpha_threshold))
    for body in snapshot.waters:
        # Not how finely the surface is drawn: the references have the waves themselves.
        add((body.matrix, body.grid and body.grid[1:], replace(body.settings, own=(), images=())))
    if snapshot.sun is not None:
        add((snapshot.sun.direction, snapshot.sun.irradiance))
    add((snapshot.sky.irradiance_sh, snapshot.sky.image, snapshot.sky.strength, snapshot.sky.rotation))
    return digest.hexdigest()


def measure_trade(options: argparse.Namespace, machine: Mapping[str, str]) -> None:
    """All that `benchmark.py trade` asks for and that is not in its tables yet.

    machine: what measures. ValueError for a scene that there is not.
    """
    scenes = options.scenes or list(TRADE_SCENES)
    for name in scenes:
        if name not in TRADE_SCENES:
            raise ValueError(f"--scenes: {name} is none of {', '.join(TRADE_SCENES)}")
    accuracy = Accuracy(options.photons, options.rays)
    errors, times = errors_table(options.output), times_table(options.output)
    commit = current_commit()
    run = Run(options.output, machine, accuracy, options.detail)
    longer_side = max(options.resolution)
    wanted = {t: points(t, longer_side, quick=options.quick, brief=options.brief) for t in options.techniques}
    number = sum(map(len, wanted.values()))
    kinds = [kind for kind, asked in (("error", options.errors), ("time", options.times)) if asked]
    with tqdm(total=number * len(kinds) * len(scenes), unit="point", disable=options.quiet) as bar:
        for name in scenes:
            bar.set_description(name)
            bench = SceneBench(
                name,
                options.resolution,
                options.detail,
                accuracy,
                options.output,
                options.workers,
            )
            try:
                run.note(bench)
                at = {"scene": name, "size": "x".join(map(str, options.resolution)), "content": bench.content}
                for kind in kinds:
                    for technique, settings in ((t, p) for t, of in wanted.items() for p in of):
                        bar.set_postfix_str(f"{kind}, {TECHNIQUES[technique].label}", refresh=False)
                        row = {**at, "technique": technique, **to_cells(settings)}
                        if kind == "time" and not times.has(row, options.shared):
                            row |= bench.times(technique, settings, options.repeats)
                            times.append({**row, "commit": commit})
                        elif kind == "error" and not errors.has(
                            row | {"photons": str(accuracy.photons), "rays": str(accuracy.rays)}
                        ):
                            found, picture = bench.errors(technique, settings)
                            if is_kept(technique, settings, longer_side):
                                save(picture_file(options.output, row), picture=picture.astype(np.float16))
                            row |= {"photons": accuracy.photons, "rays": accuracy.rays, **found}
                            errors.append({**row, "commit": commit})
                        bar.update()
                if options.engines is not None and name in (options.engines or scenes):
                    measure_engines(bench, options, at, commit)
            finally:
                bench.close()
    run.note()


def measure_engines(
    bench: SceneBench, options: argparse.Namespace, at: Mapping[str, str], commit: str
) -> None:
    """EEVEE and Cycles in the scene of a bench, which is gone then: each opens files of its own."""
    table = engines_table(options.output)
    dry = bench.dry_seconds()
    bench.reference("project")
    found = engine_points(
        bench.name,
        size=options.resolution,
        folder=options.output / "engines",
        detail=options.detail,
        others_at_most=options.shared,
        quiet=options.quiet,
    )
    for made in found:
        row = {**at, "label": made.label}
        if table.has(row, options.shared):
            continue
        engine = made.settings["engine"].removeprefix("BLENDER_")
        denoised = bool(made.settings.get("use_denoising"))
        name = "-".join((bench.name, *made.label.lower().replace(",", "").split(), bench.content)) + ".npz"
        save(options.output / "pictures" / name, picture=made.picture.astype(np.float16))
        row |= {
            "engine": engine,
            "samples": made.settings["samples"],
            "denoised": ("no", "yes")[denoised],
            "direct": ("no", "yes")[made.label == DIRECT.label],
            "converged": ("no", "yes")[made.label == CONVERGED.label],
            "picture": name,
            "seconds": made.seconds,
            "dry_seconds": dry,
            "ratio": made.seconds / dry,
            "shared": made.others,
            **bench.picture_errors(made.picture.astype(np.float64), "project"),
            "commit": commit,
        }
        table.append(row)


class Run:
    """What there is to know of a run beside its tables, in run.json."""

    def __init__(self, folder: Path, machine: Mapping[str, str], accuracy: Accuracy, detail: float) -> None:
        self._path = folder / "run.json"
        kept = json.loads(self._path.read_text()) if self._path.exists() else {}
        self._told = {
            "began": kept.get("began", _now()),
            "machine": dict(machine),
            "photons": accuracy.photons,
            "rays": accuracy.rays,
            "detail": detail,
            "scenes": kept.get("scenes", {}),
        }

    def note(self, bench: SceneBench | None = None) -> None:
        """Write it, with a scene that is measured now."""
        if bench is not None:
            trade = TRADE_SCENES[bench.name]
            self._told["scenes"][bench.name] = {
                "label": trade.label,
                "description": trade.description,
                "exposure": bench.exposure,
                "under_water": bench.is_under_water(),
            }
        order = [name for name in TRADE_SCENES if name in self._told["scenes"]]
        self._told["scenes"] = {name: self._told["scenes"][name] for name in order}
        self._path.write_text(json.dumps({**self._told, "ended": _now()}, indent=2) + "\n")


def _now() -> str:
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())


def is_kept(technique: str, settings: Settings, longer_side: int) -> bool:
    """Whether the picture of a point is shown in the report: qualities, and the base."""
    shown = [quality_point(technique, name, longer_side) for name in QUALITIES]
    return settings in (*shown, point(technique, {}), without_caustics(longer_side))


def current_commit() -> str:
    """Of the checkout, with a plus where files differ from it."""
    told = subprocess.run(
        ["git", "describe", "--always", "--exclude=*", "--dirty=+"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return told.stdout.strip() or "unknown"
