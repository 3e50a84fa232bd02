# SPDX-License-Identifier: GPL-3.0-or-later
"""What settings cost and what error they leave on a scene, in a view and on this machine: measured and kept.

`Calibration` measures; the rest reads and writes `scene.lake_water.calibration`, where it is kept.
"""

from __future__ import annotations

import hashlib
import json
import math
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from statistics import median

import bpy
import gpu

from . import handlers
from .bench import Bench
from .calibration_properties import UNKNOWN, LakeWaterCalibration, LakeWaterCalibrationPoint
from .core import trade
from .core.candidates import Axes, axes, combinations, light_of, sweep
from .core.parameters import OWN
from .core.quality import QUALITIES, quality_settings
from .core.snapshot import Camera, SceneSnapshot
from .core.techniques import TECHNIQUES
from .host import Host, frame_settings
from .properties import place_of
from .ray_truth import RayErrors

REFERENCE_SAMPLES = (24, 8)
"""Most and least of the picture that others are compared with; the least when it takes REFERENCE_SECONDS."""
REFERENCE_SECONDS = 20.0

COMBINATIONS = 6
"""Most for each kind of error, that what was measured of single dials leads to."""

SAMPLES = {4: 4, 16: 1}
"""Of a camera's pictures, beside a single one, each with so many of the best settings."""

STEP_SECONDS = 0.2
"""A step measures for so long, and to the end of what it is at then."""

LOOKING, REFERENCE, TIMING_AGAIN = 0.1, 0.15, 0.1
"""Parts of the progress before and after the measurements."""

Settings = Mapping[str, object]


@dataclass(frozen=True)
class Measurement:
    """What some settings come to; NaN where there is nothing to measure. As `LakeWaterCalibrationPoint`."""

    settings: Settings
    seconds: float
    metres: float
    texels: float
    pixels: float
    flip: float


class Calibration:
    """Measures candidates one after the other; `step` until `done`, then there are `results`.

    camera, size: of the picture in pixels; host: of its own. samples: whether pictures have several, as those
    of a camera do, or one, as a viewport has while it moves. Raises CalibrationError, also in `step`, where
    nothing can be measured.
    """

    def __init__(
        self,
        scene: bpy.types.Scene,
        snapshot: SceneSnapshot,
        camera: Camera,
        size: tuple[int, int],
        host: Host,
        *,
        samples: bool = True,
    ) -> None:
        frame = frame_settings(scene)
        self.technique = frame.technique
        self.size, self._samples = size, samples
        self.bench = Bench(snapshot, frame, camera, size, host, float(scene.view_settings.exposure))
        self._axes = _axes_of(self.bench)
        self._scene_samples = int(scene.lake_water.samples)
        self.results: list[Measurement] = []
        self.progress = 0.0
        self.done = False
        self.doing = "Looking where rays end"
        self._spent: dict[tuple, list[float]] = {}
        self._rays: dict[tuple, RayErrors] = {}
        self._work = self._run()

    @property
    def axes(self) -> Axes:
        """What is turned."""
        return self._axes

    @property
    def candidates(self) -> list[tuple[dict[str, object], int]]:
        """(settings, samples) that are measured first: those in use, the qualities, one dial at a time."""
        of = self._axes
        found = [(dict(of.current), self._scene_samples if self._samples else 1)]
        for name, quality in QUALITIES.items():
            values = quality_settings(name, max(self.size))
            settings = of.current | {key: value for key, value in values.items() if key in of.current}
            settings["texture_size"] = min(settings["texture_size"], of.best["texture_size"])
            found.append((settings, quality.samples if self._samples else 1))
        found += [(settings, 1) for settings in sweep(of)]
        return [candidate for i, candidate in enumerate(found) if candidate not in found[:i]]

    def step(self) -> None:
        """Measure the next thing: a fifth of a second, or one that takes longer."""
        begin = time.perf_counter()
        while not self.done and time.perf_counter() - begin < STEP_SECONDS:
            self.done = next(self._work, None) is None
        if self.done:
            self.progress = 1.0

    def _run(self) -> Iterator[bool]:
        for part in self.bench.look():
            self.progress = LOOKING * part
            yield True
        self.doing = "Drawing the picture to compare with"
        for part in self.bench.take_reference(self._axes.best, *REFERENCE_SAMPLES, REFERENCE_SECONDS):
            self.progress = LOOKING + REFERENCE * part
            yield True
        first = self.candidates
        expected = len(first) + 2 * COMBINATIONS + self._samples * sum(SAMPLES.values())
        yield from self._measure_all(first, expected)
        combined = [(settings, 1) for settings in self._combinations()]
        yield from self._measure_all(combined, expected)
        if self._samples:
            yield from self._measure_all(self._with_samples(), expected)
        self.doing = "Timing the best once more"
        yield from self._time_again()

    def _measure_all(
        self, candidates: Sequence[tuple[dict[str, object], int]], expected: int
    ) -> Iterator[bool]:
        for settings, samples in candidates:
            if self._known(settings, samples) is None:
                self.doing = (
                    f"Measuring {len(self.results) + 1} of about {max(expected, len(self.results) + 1)}"
                )
                yield from self._measure(settings, samples)
            before = LOOKING + REFERENCE
            part = min(len(self.results) / expected, 1.0)
            self.progress = max(self.progress, before + (1.0 - before - TIMING_AGAIN) * part)

    def _measure(self, settings: dict[str, object], samples: int) -> Iterator[bool]:
        yield True
        spent = self.bench.seconds(settings)
        yield True
        places = self._axes.geometry_of(settings)
        if places not in self._rays:
            self._rays[places] = self.bench.ray_errors(settings)
            yield True
        rays = self._rays[places]
        whole = 0.0
        for done, seconds in self.bench.draw(settings, samples):
            whole = seconds if done == 1 else whole + seconds
            yield True
        if samples > 1:  # the first sample draws what moves, and the others use it
            spent = [whole]
        self._spent[_key(settings, samples)] = spent
        given = {**settings, "samples": samples} if self._samples else settings
        flip = self.bench.flip(samples)
        self.results.append(Measurement(given, median(spent), rays.metres, rays.texels, rays.pixels, flip))

    def _known(self, settings: Settings, samples: int) -> Measurement | None:
        key = _key(settings, samples)
        return next((m for m in self.results if self._key_of(m) == key), None)

    def _key_of(self, measured: Measurement) -> tuple:
        settings = dict(measured.settings)
        return _key(settings, int(settings.pop("samples", 1)))

    def _combinations(self) -> list[dict[str, object]]:
        """Those that promise to be on the fronts of both errors."""
        of = self._axes
        points = [(settings, self._known(settings, 1)) for settings in sweep(of)]
        found = []
        for turned, error in ((of.geometry, "pixels"), ({**of.geometry, **of.light}, "flip")):
            measured = [(s, m.seconds, getattr(m, error)) for s, m in points]
            if all(math.isfinite(e) for _, _, e in measured):
                found += combinations(of, turned, measured, COMBINATIONS)
        return found

    def _with_samples(self) -> list[tuple[dict[str, object], int]]:
        """The most exact and, evenly spread, others down to the fastest by FLIP, with more samples."""
        single = [m for m in self.results if m.settings["samples"] == 1]
        front = trade.pareto_front([trade.Point(m.settings, m.seconds, m.flip) for m in single])
        found = []
        for samples, count in SAMPLES.items():
            for p in front[:: -max(1, -(-len(front) // count))]:
                found.append(({name: p.settings[name] for name in self._axes.names}, samples))
        return found

    def _time_again(self) -> Iterator[bool]:
        """Points of a front are the fastest of their like, in part by chance: single pictures once more."""
        best = {id(m) for error in ("pixels", "flip") for m in self._front(error)}
        before = self.progress
        for i, measured in enumerate(self.results):
            self.progress = before + (1.0 - before) * i / len(self.results)
            if id(measured) not in best:
                continue
            settings = dict(measured.settings)
            if settings.pop("samples", 1) == 1:
                spent = self._spent[self._key_of(measured)]
                spent += self.bench.seconds(settings, first_frame=20)
                self.results[i] = Measurement(**{**vars(measured), "seconds": median(spent)})
                yield True

    def _front(self, error: str) -> list[Measurement]:
        points = {
            id(p := trade.Point(m.settings, m.seconds, getattr(m, error))): (p, m) for m in self.results
        }
        return [points[id(p)][1] for p in trade.pareto_front([p for p, _ in points.values()])]


def _key(settings: Settings, samples: int) -> tuple:
    return (*sorted(settings.items()), samples)


def _axes_of(bench: Bench) -> Axes:
    kind = TECHNIQUES[bench.frame.technique].settings
    technique_of = bench.snapshot.waters[0].settings.of(kind)
    own = {
        name: getattr(technique_of, parameter.field)
        for name, parameter in OWN.items()
        if parameter.technique == bench.frame.technique and not parameter.is_image
    }
    largest = gpu.capabilities.max_texture_size_get()
    grid = max((body.grid[0] for body in bench.snapshot.waters if body.grid is not None), default=None)
    return axes(bench.frame, own, max(bench.size), sunlit=bench.sunlit, largest=largest, grid=grid)


# What a scene keeps


def device_name() -> str:
    """What draws, as its driver calls itself."""
    return gpu.platform.renderer_get()


def signature(scene: bpy.types.Scene) -> str:
    """Changes with what decides where rays end: the waters, their waves, the number of objects."""
    parts: list[object] = [len(scene.objects)]
    for obj in sorted(handlers.waters(scene), key=lambda o: o.name):
        water = obj.lake_water
        parts += [obj.name, water.surface, water.grid_resolution]
        parts += [round(v, 5) for row in obj.matrix_world for v in row]
        parts += [round(v, 5) for v in (water.k, water.c, water.ior, water.depth)]
        parts += [round(v, 5) for w in water.waves for v in (w.amplitude, w.wavelength, w.direction, w.phase)]
    return hashlib.sha1(repr(parts).encode(), usedforsecurity=False).hexdigest()


def store(scene: bpy.types.Scene, calibration: Calibration, view: str) -> None:
    """Keep the results, in place of those of before, and tell those who follow them."""
    kept = scene.lake_water.calibration
    kept.points.clear()
    kept.chosen = -1
    for measured in calibration.results:
        point = kept.points.add()
        point.settings = json.dumps(measured.settings)
        for name in ("seconds", "metres", "texels", "pixels", "flip"):
            value = getattr(measured, name)
            setattr(point, name, value if math.isfinite(value) else UNKNOWN)
    kept.technique, kept.resolution, kept.view = calibration.technique, calibration.size, view
    kept.device, kept.signature = device_name(), signature(scene)
    kept.date = datetime.now().strftime("%Y-%m-%d %H:%M")
    handlers.notify_calibrated(scene)


def settings_of(point: LakeWaterCalibrationPoint) -> dict[str, object]:
    """By name. ValueError where a file was made by other hands, or another version."""
    try:
        settings = json.loads(point.settings)
    except ValueError:
        settings = None
    if not isinstance(settings, dict):
        raise ValueError(f"The calibration holds {point.settings!r} in place of settings: calibrate anew")
    return settings


def comparable(kept: LakeWaterCalibration, measure: str) -> list[int]:
    """Numbers of the points that an error can tell apart.

    By PIXELS, pictures of one sample that are lit as by the settings that were in use, which are the first
    point: how light is computed moves nothing.
    """
    some = [i for i, point in enumerate(kept.points) if getattr(point, measure.lower()) != UNKNOWN]
    if measure != "PIXELS" or not some:
        return some
    settings = [settings_of(point) for point in kept.points]
    lit = light_of(settings[0])
    return [i for i in some if light_of(settings[i]) == lit and settings[i].get("samples", 1) == 1]


def front_points(kept: LakeWaterCalibration, measure: str | None = None) -> list[int]:
    """Numbers of the points that no other beats in both time and error, from the fastest to the most exact.

    measure: a key of MEASURES, else that of the panel.
    """
    measure = measure or kept.measure
    points = {}
    for i in comparable(kept, measure):
        error = getattr(kept.points[i], measure.lower())
        point = trade.Point(settings_of(kept.points[i]), kept.points[i].seconds, error)
        points[id(point)] = (i, point)
    return [points[id(p)][0] for p in trade.pareto_front([p for _, p in points.values()])]


def front(scene: bpy.types.Scene, measure: str) -> list[trade.Point]:
    """The front of the scene's calibration by PIXELS or FLIP; empty without one."""
    kept = scene.lake_water.calibration
    return [
        trade.Point(settings_of(p), p.seconds, getattr(p, measure.lower()))
        for p in (kept.points[i] for i in front_points(kept, measure))
    ]


def apply_settings(scene: bpy.types.Scene, settings: Settings) -> None:
    """Give the scene and its waters the settings of a point, where they differ."""
    values = dict(settings)
    if "samples" in values:
        values["viewport_samples"] = values["samples"]
    for name, value in values.items():
        places = [place_of(name, scene, obj) for obj in handlers.waters(scene)] if name in OWN else []
        for group, attribute in places or [(scene.lake_water, name)]:
            if not _is_equal(getattr(group, attribute), value):
                setattr(group, attribute, value)


def _is_equal(held: object, value: object) -> bool:
    """Blender holds numbers as float32."""
    return math.isclose(held, value, rel_tol=1e-6) if isinstance(value, float) else held == value


def apply_point(scene: bpy.types.Scene, point: LakeWaterCalibrationPoint) -> None:
    """`apply_settings` of a point that the scene keeps."""
    apply_settings(scene, settings_of(point))


def choose(scene: bpy.types.Scene, settings: Settings) -> None:
    """Mark the point with these settings as the chosen one, and give its settings to the scene."""
    kept = scene.lake_water.calibration
    kept.chosen = next((i for i, p in enumerate(kept.points) if settings_of(p) == dict(settings)), -1)


def differences(scene: bpy.types.Scene, size: tuple[int, int] | None) -> list[str]:
    """In what the calibration is one of something else than what is there now, in words.

    size: of the picture now; None where it is not known.
    """
    kept = scene.lake_water.calibration
    found = []
    now = scene.lake_water.technique
    if kept.technique != now:
        label = TECHNIQUES[kept.technique].label if kept.technique in TECHNIQUES else kept.technique
        found.append(f"It is of the technique {label}, not of {TECHNIQUES[now].label}")
    if kept.signature != signature(scene):
        found.append("The water or the scene has changed since")
    if size is not None and any(abs(a - b) > 0.05 * b for a, b in zip(size, kept.resolution, strict=True)):
        found.append(
            f"It is of {kept.resolution[0]} x {kept.resolution[1]} pixels, not of {size[0]} x {size[1]}"
        )
    if kept.device != device_name():
        found.append(f"It was measured on {kept.device}")
    return found


_LABELS = {
    "texture_size": "texture {}",
    "intersection_steps": "{} steps",
    "fov_ext": "FOV x{:g}",
    "traced_march_steps": "{} march steps",
    "traced_bisection_steps": "{} bisections",
    "light_depth_size": "shadows {}",
}


def words(settings: Settings) -> str:
    """A point's settings for a person."""
    replaced = {"intersection_steps"} if settings.get("refraction_steps") else set()
    found = [t.format(settings[name]) for name, t in _LABELS.items() if name in settings.keys() - replaced]
    if settings.get("refraction_steps"):
        found.append(f"refractions in {settings['refraction_steps']} steps")
    if settings.get("least_grid_resolution", 2) > 2:
        found.append(f"grid {settings['least_grid_resolution']}")
    if "reflection_steps" in settings:
        steps = settings["reflection_steps"]
        found.append(f"reflections in {steps} steps" if steps else "reflections by offset")
    if settings.get("use_caustics"):
        found.append(f"caustics {settings['caustics_size']}, {settings['photon_size']} photons")
    elif "use_caustics" in settings:
        found.append("no caustics")
    if "use_exact_fresnel" in settings:
        found.append("exact Fresnel" if settings["use_exact_fresnel"] else "Fresnel by q")
    if "samples" in settings:
        found.append(f"{settings['samples']} samples" if settings["samples"] > 1 else "1 sample")
    return ", ".join(found)
