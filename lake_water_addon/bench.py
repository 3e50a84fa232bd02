# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws one view of one snapshot by any settings, and measures what a picture costs and what error it has.

Nothing here shows in a viewport: all is drawn by a host of its own, and only the waves move.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from .core.flip import FlipReference
from .core.flip import reach as flip_reach
from .core.overlay import lay_over
from .core.plan import FramePlan, pixel_jitter
from .core.settings import FrameSettings
from .core.sky import srgb_from_linear
from .core.snapshot import Camera, SceneSnapshot
from .host import Host
from .ray_truth import RayErrors, Truth, find_truth, ray_errors
from .raycast import RayCaster, read_alphas
from .render.frame import PassTimer
from .render.passes.accumulate import mean_target, picture_target
from .render.targets import Target

PIXELS = 500
"""Pixels whose rays are followed, at each of TIMES."""

TIMES = (0.0, 1.37, 2.71)
"""s after the scene's own time at which rays are followed."""

HITS_SIDE = 320
"""Most pixels along the longer side of the pass that tells where rays end: they look where all others do."""

MOST_FRAMES, FRAMES_SECONDS = 9, 0.4
"""Frames that are timed at a time: no more, and none after so many seconds."""
FRAME_RATE = 24.0

WHOLE_PICTURE = 110_000
"""Pixels up to which FLIP is taken of the whole picture; of a larger one, of WINDOWS parts of WINDOW pixels
where there is water."""
WINDOWS = 8
WINDOW = (128, 96)

Settings = Mapping[str, object]


class CalibrationError(ValueError):
    """Why nothing can be measured, in words for a person."""


class Bench:
    """One view of one snapshot.

    frame: the settings in use; size: (width, height) of the picture; host: one that nobody else draws with,
    which may be exchanged for another; exposure: stops, of the pictures that FLIP compares. Raises
    CalibrationError where no water is seen from the air, `look` where it is hidden.
    """

    def __init__(
        self,
        snapshot: SceneSnapshot,
        frame: FrameSettings,
        camera: Camera,
        size: tuple[int, int],
        host: Host,
        exposure: float = 0.0,
    ) -> None:
        if not snapshot.waters:
            raise CalibrationError("There is no water to measure: show it first")
        self.snapshot, self.frame, self.camera, self.size = snapshot, frame, camera, size
        self.host, self._exposure = host, 2.0**exposure
        scale = min(1.0, HITS_SIDE / max(size))
        self.hits_size = tuple(max(1, round(side * scale)) for side in size)
        plan = self.plan(frame)
        if plan.immersed is not None:
            raise CalibrationError(
                "The camera is in the water: calibrate from above it, where rays can be followed"
            )
        drawn = [body for body in plan.bodies if body.drawn]
        if not drawn:
            raise CalibrationError(
                f"No water is in the picture ({plan.bodies[0].reason}): turn the view towards it"
            )
        self.sunlit = any(body.light is not None for body in drawn)
        self._caster = RayCaster(snapshot, read_alphas(snapshot), plan.origin)
        self._truths: list[tuple[float, Truth]] = []
        self._water: np.ndarray | None = None
        self._windows: list[tuple[slice, slice, slice, slice]] = []
        self._references: list[FlipReference] = []

    def plan(
        self, frame: FrameSettings, *, after: float = 0.0, settings: Settings | None = None, **options
    ) -> FramePlan:
        """The picture `after` seconds. settings: in place of those of the frame; options: of `plan_frame`."""
        snapshot = replace(self.snapshot, time=self.snapshot.time + after)
        frame, snapshot = lay_over(frame, snapshot, settings or {})
        return self.host.plan(snapshot, self.camera, None, settings=frame, **options)

    # Rays

    def look(self) -> Iterator[float]:
        """Find what is true, bit by bit: to be gone through before anything is measured. Yields 0..1."""
        while not self._caster.build():
            yield 0.8 * self._caster.progress
        rng = np.random.default_rng(1)
        for number, after in enumerate(TIMES):
            plan = self.plan(self.frame, after=after)
            hits = self.host.renderer.draw_hits(plan, self.hits_size)
            truth = find_truth(plan, hits, self._caster, PIXELS, rng)
            if truth is None:
                raise CalibrationError("No pixel of the picture shows water: turn the view towards it")
            self._truths.append((after, truth))
            if number == 0:
                self._water = hits.surface[..., 3] > 0.5
                self._windows = list(self._water_windows())
            yield 0.8 + 0.2 * (number + 1) / len(TIMES)

    def ray_errors(self, settings: Settings) -> RayErrors:
        """How far off the places are that settings look at, at the pixels and times of `look`."""
        found = []
        for after, truth in self._truths:
            plan = self.plan(self.frame, after=after, settings=settings)
            found.append((plan, self._hits(plan), truth))
        return ray_errors(found, self.size)

    def other_ray_errors(self, settings: Settings, times: Sequence[float], seed: int) -> RayErrors:
        """The same at other times and pixels, whose truth is found for this once."""
        found = []
        rng = np.random.default_rng(seed)
        for after in times:
            plan = self.plan(self.frame, after=after, settings=settings)
            hits = self._hits(plan)
            truth = find_truth(plan, hits, self._caster, PIXELS, rng)
            if truth is not None:
                found.append((plan, hits, truth))
        return ray_errors(found, self.size)

    def _hits(self, plan: FramePlan) -> Hits:
        return self.host.renderer.draw_hits(plan, self.hits_size)

    # Pictures

    def _targets(self) -> tuple[Target, Target]:
        targets = self.host.renderer.targets
        return picture_target(targets, "bench", self.size), mean_target(targets, "bench", self.size)

    def _sample(self, settings: Settings, sample: int, samples: int, after: float = 0.0) -> None:
        """Add one sample of a picture to the mean, which the first empties."""
        picture, mean = self._targets()
        if sample == 0:
            mean.colors[0].clear(format="FLOAT", value=(0.0, 0.0, 0.0, 0.0))
        jitter = pixel_jitter(sample, samples, *self.size)
        plan = self.plan(self.frame, after=after, settings=settings, jitter=jitter, samples=samples)
        self.host.renderer.draw_picture(plan, picture, PassTimer())
        self.host.renderer.mean.add(picture, mean, 1.0)

    def seconds(self, settings: Settings, first_frame: int = 1) -> list[float]:
        """Seconds of pictures of one sample while the waves move, each until it is there.

        first_frame: from which they are counted.
        """
        self._sample(settings, 0, 1, (first_frame - 1) / FRAME_RATE)  # makes what there is to make
        self._wait()
        spent: list[float] = []
        while not spent or (len(spent) < MOST_FRAMES and sum(spent) < FRAMES_SECONDS):
            start = time.perf_counter()
            self._sample(settings, 0, 1, (first_frame + len(spent)) / FRAME_RATE)
            self._wait()
            spent.append(time.perf_counter() - start)
        return spent

    def draw(self, settings: Settings, samples: int) -> Iterator[tuple[int, float]]:
        """Draw a picture for `flip`, sample by sample. Yields (samples that are drawn, seconds of the last).

        It begins anew when the host is exchanged in between, which loses the sum.
        """
        done, host = 0, self.host
        while done < samples:
            if host is not self.host:
                done, host = 0, self.host
            start = time.perf_counter()
            self._sample(settings, done, samples)
            self._wait()
            done += 1
            yield done, time.perf_counter() - start

    def _wait(self) -> None:
        """Until all is drawn."""
        framebuffer = self._targets()[1].framebuffer
        with framebuffer.bind():
            framebuffer.read_color(0, 0, 1, 1, 4, 0, "FLOAT")

    def _water_windows(self) -> Iterator[tuple[slice, slice, slice, slice]]:
        """Parts of the picture that FLIP is taken of: rows and columns with their border, and within that."""
        width, height = self.size
        whole = [(0, 0, width, height)]
        if width * height > WHOLE_PICTURE:
            across, up = WINDOW
            whole = [
                (x, y, min(x + across, width), min(y + up, height))
                for y in range(0, height, up)
                for x in range(0, width, across)
            ]
            wet = [box for box in whole if self._is_water(*box).mean() > 0.25]
            wet = wet or [max(whole, key=lambda box: self._is_water(*box).sum())]
            chosen = np.linspace(0, len(wet) - 1, min(WINDOWS, len(wet))).round().astype(int)
            whole = [wet[i] for i in chosen]
        border = flip_reach()
        for left, bottom, right, top in whole:
            low_x, low_y = max(left - border, 0), max(bottom - border, 0)
            yield (
                slice(low_y, min(top + border, height)),
                slice(low_x, min(right + border, width)),
                slice(bottom - low_y, top - low_y),
                slice(left - low_x, right - low_x),
            )

    def _is_water(self, left: int, bottom: int, right: int, top: int) -> np.ndarray:
        """(h, w) whether pixels of a part of the picture show water."""
        width, height = self.size
        rows = (np.arange(bottom, top) * self.hits_size[1]) // height
        columns = (np.arange(left, right) * self.hits_size[0]) // width
        return self._water[np.ix_(rows, columns)]

    def _read(self, samples: int) -> Iterator[np.ndarray]:
        """The windows of the picture, (h, w, 3), encoded as sRGB."""
        _, mean = self._targets()
        for rows, columns, _, _ in self._windows:
            size = (columns.stop - columns.start, rows.stop - rows.start)
            with mean.framebuffer.bind():
                values = mean.framebuffer.read_color(columns.start, rows.start, *size, 4, 0, "FLOAT")
            picture = np.asarray(values, dtype=np.float32).reshape(size[1], size[0], 4)[..., :3]
            yield srgb_from_linear(np.clip(picture * (self._exposure / samples), 0.0, 1.0))

    def take_reference(self, settings: Settings, samples: int, least: int, seconds: float) -> Iterator[float]:
        """Draw what FLIP compares with, sample by sample: to be gone through once. Yields 0..1.

        samples: fewer, but at least `least`, where they take more than `seconds`.
        """
        begin = time.perf_counter()
        for done, _ in self.draw(settings, samples):
            yield done / samples
            if done >= least and time.perf_counter() - begin > seconds:
                break
        self._references = [FlipReference(picture) for picture in self._read(done)]

    def flip(self, samples: int) -> float:
        """Mean FLIP of the water's pixels of the picture of so many samples that was drawn last.

        NaN where the windows show none.
        """
        values = []
        for window, reference, picture in zip(
            self._windows, self._references, self._read(samples), strict=True
        ):
            rows, columns, inner_rows, inner_columns = window
            inside = (inner_rows, inner_columns)
            left, bottom = columns.start + inner_columns.start, rows.start + inner_rows.start
            right, top = columns.start + inner_columns.stop, rows.start + inner_rows.stop
            values.append(reference.compare(picture)[inside][self._is_water(left, bottom, right, top)])
        values = np.concatenate(values)
        return float(values.mean()) if len(values) else float("nan")
