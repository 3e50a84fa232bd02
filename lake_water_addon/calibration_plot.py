# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of a calibration: time against error, all points, the front and the chosen one.

It is drawn into arrays and by `blf` into an image buffer, so that it needs no window and no GPU.
"""

from __future__ import annotations

import math
from itertools import pairwise

import blf
import bpy
import imbuf
import numpy as np

from .calibration import comparable, front_points
from .calibration_properties import UNKNOWN, LakeWaterCalibration, LakeWaterCalibrationPoint
from .core.techniques import TECHNIQUES

NAME = "Lake Water Calibration"
SIZE = (800, 500)

BACKGROUND, PANEL, GRID = (0.10, 0.10, 0.11), (0.14, 0.14, 0.155), (0.24, 0.24, 0.26)
TEXT, FAINT = (0.90, 0.90, 0.90), (0.62, 0.62, 0.65)
POINT, FRONT, CHOSEN = (0.38, 0.52, 0.66), (0.96, 0.62, 0.15), (1.0, 1.0, 1.0)
"""As displayed."""

PANELS = {"PIXELS": (62, 72, 388, 412), "FLIP": (462, 72, 788, 412)}
"""(left, bottom, right, top) of each error's axes."""

TITLES = {"PIXELS": "Error in pixels", "FLIP": "Error in FLIP"}

FONT = 0
LETTERS, SMALL_LETTERS = 13.0, 11.5


class _Axis:
    """A logarithmic axis between two places of the picture, wide enough for all values."""

    def __init__(self, values: list[float], start: float, end: float) -> None:
        low, high = min(values), max(values)
        room = max(0.05 * math.log10(high / low), 0.03) if high > low else 0.3
        self._low, self._high = math.log10(low) - room, math.log10(high) + room
        self._start, self._end = start, end

    def at(self, value: float) -> float:
        part = (math.log10(value) - self._low) / (self._high - self._low)
        return self._start + part * (self._end - self._start)

    def ticks(self, most: int) -> list[float]:
        """Round values on the axis: a few, at least two."""
        decades = range(math.floor(self._low), math.ceil(self._high) + 1)
        for digits in ((1,), (1, 3), (1, 2, 5), (1, 1.5, 2, 3, 5, 7), tuple(np.arange(10, 100) / 10)):
            values = [d * 10.0**e for e in decades for d in digits]
            values = [v for v in values if self._low <= math.log10(v) <= self._high]
            if len(values) >= 3:
                return values[:: max(1, -(-len(values) // most))]
        return values


class _Canvas:
    """Shapes with soft edges. pixels: (h, w, 3), first row at the bottom."""

    def __init__(self) -> None:
        width, height = SIZE
        self.pixels = np.empty((height, width, 3), np.float32)
        self.pixels[:] = BACKGROUND

    def box(self, left: int, bottom: int, right: int, top: int, color: tuple) -> None:
        self.pixels[bottom:top, left:right] = color

    def line(self, start: tuple[float, float], end: tuple[float, float], width: float, color: tuple) -> None:
        self._cover(start, end, lambda distance: 0.5 * width + 0.5 - distance, 0.5 * width, color)

    def disc(self, at: tuple[float, float], radius: float, color: tuple) -> None:
        self._cover(at, at, lambda distance: radius + 0.5 - distance, radius, color)

    def ring(self, at: tuple[float, float], radius: float, width: float, color: tuple) -> None:
        self._cover(
            at, at, lambda distance: 0.5 * width + 0.5 - np.abs(distance - radius), radius + width, color
        )

    def _cover(self, start, end, coverage, reach: float, color: tuple) -> None:
        """Mix in a colour by how far, as `coverage` has it, pixels are from a line."""
        height, width, _ = self.pixels.shape
        low = np.floor(np.minimum(start, end) - reach - 1.0).astype(int)
        high = np.ceil(np.maximum(start, end) + reach + 2.0).astype(int)
        (left, bottom), (right, top) = np.clip(low, 0, (width, height)), np.clip(high, 0, (width, height))
        y, x = np.mgrid[bottom:top, left:right] + 0.5
        along, at = np.subtract(end, start), np.stack([x, y], axis=-1) - start
        part = np.clip(at @ along / max(along @ along, 1e-12), 0.0, 1.0)
        distance = np.linalg.norm(at - part[..., None] * along, axis=-1)
        alpha = np.clip(coverage(distance), 0.0, 1.0)[..., None]
        area = self.pixels[bottom:top, left:right]
        area += (np.asarray(color, np.float32) - area) * alpha


Text = tuple[float, float, str, tuple, float, float]
"""x, y, what, colour, size, and how much of its width lies left of x."""


def draw(kept: LakeWaterCalibration) -> np.ndarray:
    """(500, 800, 4) float32 as displayed, first row at the bottom. kept: a calibration with points."""
    canvas, texts = _Canvas(), []
    label = TECHNIQUES[kept.technique].label if kept.technique in TECHNIQUES else kept.technique
    width, height = kept.resolution
    texts.append((14, 472, f"{label}, {width} x {height} pixels, {kept.view}", TEXT, LETTERS + 2, 0.0))
    texts.append((14, 450, f"{kept.device}, {kept.date}", FAINT, SMALL_LETTERS, 0.0))
    for measure in PANELS:
        texts += _draw_panel(canvas, kept, measure)
    texts += _draw_legend(canvas, kept)
    pixels = np.ones((SIZE[1], SIZE[0], 4), np.float32)
    pixels[..., :3] = canvas.pixels
    return _with_texts(pixels, texts)


def _draw_panel(canvas: _Canvas, kept: LakeWaterCalibration, measure: str) -> list[Text]:
    left, bottom, right, top = PANELS[measure]
    canvas.box(left, bottom, right, top, PANEL)
    texts: list[Text] = [
        (left, top + 9, TITLES[measure], TEXT, LETTERS, 0.0),
        (0.5 * (left + right), 28, "Time of a picture", FAINT, SMALL_LETTERS, 0.5),
    ]
    shown = {*comparable(kept, measure), kept.chosen} & set(range(len(kept.points)))
    some = {i: (kept.points[i].seconds, getattr(kept.points[i], measure.lower())) for i in sorted(shown)}
    some = {i: place for i, place in some.items() if place[1] != UNKNOWN}
    if not some:
        middle = 0.5 * (left + right), 0.5 * (bottom + top)
        return [*texts, (*middle, "Nothing could be measured", FAINT, LETTERS, 0.5)]
    # The best picture itself may have no error at all, which has no place on the axis.
    least = 0.5 * min((error for _, error in some.values() if error > 0.0), default=1.0)
    some = {i: (max(time, 1e-6), max(error, least)) for i, (time, error) in some.items()}
    across = _Axis([time for time, _ in some.values()], left, right)
    up = _Axis([error for _, error in some.values()], bottom, top)
    for value in across.ticks(5):
        x = across.at(value)
        canvas.line((x, bottom), (x, top), 1.0, GRID)
        texts.append((x, bottom - 18, time_text(value), FAINT, SMALL_LETTERS, 0.5))
    for value in up.ticks(7):
        y = up.at(value)
        canvas.line((left, y), (right, y), 1.0, GRID)
        texts.append((left - 6, y - 4, f"{value:g}", FAINT, SMALL_LETTERS, 1.0))
    at = {i: (across.at(time), up.at(error)) for i, (time, error) in some.items()}
    for place in at.values():
        canvas.disc(place, 2.6, POINT)
    front = [at[i] for i in front_points(kept, measure)]
    for start, end in pairwise(front):
        canvas.line(start, end, 1.6, FRONT)
    for place in front:
        canvas.disc(place, 3.6, FRONT)
    if kept.chosen in at:
        canvas.ring(at[kept.chosen], 8.0, 2.0, CHOSEN)
    return texts


def _draw_legend(canvas: _Canvas, kept: LakeWaterCalibration) -> list[Text]:
    canvas.disc((20, 14), 2.6, POINT)
    canvas.line((98, 14), (122, 14), 1.6, FRONT)
    canvas.disc((110, 14), 3.6, FRONT)
    texts: list[Text] = [
        (30, 10, "measured", FAINT, SMALL_LETTERS, 0.0),
        (130, 10, "worth choosing", FAINT, SMALL_LETTERS, 0.0),
    ]
    if 0 <= kept.chosen < len(kept.points):
        canvas.ring((254, 14), 6.0, 2.0, CHOSEN)
        texts.append((268, 10, f"chosen: {point_text(kept.points[kept.chosen])}", FAINT, SMALL_LETTERS, 0.0))
    return texts


def time_text(seconds: float) -> str:
    """Such as 8.5 ms or 2 s."""
    return f"{1000.0 * seconds:.3g} ms" if seconds < 1.0 else f"{seconds:.3g} s"


def point_text(point: LakeWaterCalibrationPoint) -> str:
    """Time and errors of a point, as far as they are known."""
    found = [time_text(point.seconds)]
    if point.pixels != UNKNOWN:
        found.append(f"{point.pixels:.3g} px")
    if point.flip != UNKNOWN:
        found.append(f"FLIP {point.flip:.2g}")
    return ", ".join(found)


def _with_texts(pixels: np.ndarray, texts: list[Text]) -> np.ndarray:
    """The picture (h, w, 4) with letters on it, cut where it ends."""
    buffer = imbuf.new(SIZE)
    with buffer.with_buffer(write=True) as view:
        np.asarray(view)[:] = np.rint(np.clip(pixels, 0.0, 1.0) * 255.0).astype(np.uint8)
    with blf.bind_imbuf(FONT, buffer):
        for x, y, text, color, size, left in texts:
            blf.size(FONT, size)
            blf.color(FONT, *color, 1.0)
            blf.position(FONT, x - left * blf.dimensions(FONT, text)[0], y, 0.0)
            blf.draw_buffer(FONT, text)
    with buffer.with_buffer() as view:
        drawn = np.asarray(view).astype(np.float32) / 255.0
    buffer.free()
    return drawn


def update_image(scene: bpy.types.Scene) -> bpy.types.Image | None:
    """Draw the scene's calibration into the image NAME, made where it is missing; None without one."""
    kept = scene.lake_water.calibration
    if not kept.points:
        return None
    image = bpy.data.images.get(NAME)
    if image is not None and tuple(image.size) != SIZE:
        bpy.data.images.remove(image)
        image = None
    if image is None:
        image = bpy.data.images.new(NAME, *SIZE, alpha=False)
    image.pixels.foreach_set(draw(kept).ravel())
    image.update()
    image.pack()  # so that it is saved with the file
    return image


def mark_choice(scene: bpy.types.Scene) -> None:
    """Draw the image again, where there is one, with the point that is chosen now."""
    if NAME in bpy.data.images:
        update_image(scene)


def show(image: bpy.types.Image, window_manager: bpy.types.WindowManager) -> bool:
    """Show the image in an image editor that is open; returns whether there is one.

    One that shows it already, else one that shows nothing, else the first that a person doesn't paint in.
    """
    found = []
    order = {image: 0, None: 1}
    for window in window_manager.windows:
        for area in window.screen.areas:
            space = area.spaces.active
            if area.ui_type != "IMAGE_EDITOR":
                continue
            if space.image in order or (space.mode == "VIEW" and not space.use_image_pin):
                found.append((order.get(space.image, 2), window, area))
    if not found:
        return False
    _, window, area = min(found, key=lambda place: place[0])
    put_into(window, area, image)
    return True


def put_into(window: bpy.types.Window, area: bpy.types.Area, image: bpy.types.Image) -> None:
    """Show the image, all of it, in an image editor."""
    if area.spaces.active.image == image:
        return
    area.spaces.active.image = image
    region = next(region for region in area.regions if region.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.image.view_all(fit_view=True)
