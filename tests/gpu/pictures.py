# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws a snapshot with the real frame renderer and compares pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lake_water_addon.core.plan import FramePlan, plan_frame
from lake_water_addon.core.settings import FrameSettings

SIZE = (160, 120)
PLAIN = {"use_caustics": False, "use_shadows": False, "use_glow": False}
"""Settings with none of the sun's extras."""


def planned(scene, camera, **options) -> FramePlan:
    """Small textures, none of the sun's extras. options: FrameSettings', or window and jitter."""
    view = {name: options.pop(name) for name in ("window", "jitter") if name in options}
    settings = FrameSettings(**{"texture_size": 256, **PLAIN, **options})
    return plan_frame(scene, camera, settings, **view)


def draw(renderer, scene, camera, size=SIZE, **options) -> np.ndarray:
    """(h, w, 4) float64 scene-linear picture, first row at the bottom. options: of plan_frame."""
    return draw_plan(renderer, planned(scene, camera, **options), size)


def draw_plan(renderer, plan, size=SIZE) -> np.ndarray:
    """The same of a plan that is made already."""
    from lake_water_addon.render.frame import PassTimer
    from tests.gpu.glsl import read_texture

    target = renderer.targets.get(("test", size), size, ("RGBA32F",))
    renderer.draw_picture(plan, target, PassTimer())
    return read_texture(target.colors[0]).astype(np.float64)


def draw_textures(renderer, scene, camera, **options):
    """(plan, refraction (n, n, 4), bottom depth (n, n), reflection (n, n, 4)) of the first water body."""
    from lake_water_addon.render.frame import PassTimer
    from lake_water_addon.render.passes import textures
    from tests.gpu.glsl import read_texture

    plan = planned(scene, camera, **options)
    renderer.draw_textures(plan, PassTimer())
    refraction = textures.refraction_target(renderer.targets, 0, plan.settings.texture_size)
    reflection = textures.reflection_target(renderer.targets, 0, plan.settings.texture_size)
    return (
        plan,
        read_texture(refraction.colors[0]).astype(np.float64),
        read_texture(refraction.colors[1])[..., 0].astype(np.float64),
        read_texture(reflection.colors[0]).astype(np.float64),
    )


def to_8_bit(picture: np.ndarray) -> np.ndarray:
    """(h, w, 3) uint8, sRGB-encoded, first row at the top."""
    linear = np.clip(picture[::-1, :, :3], 0.0, 1.0)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255.0 * encoded).astype(np.uint8)


def save(picture_8_bit: np.ndarray, path: Path) -> None:
    from PIL import Image

    Image.fromarray(picture_8_bit).save(path, optimize=True)


def load(path: Path) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))


def amplified_difference(one: np.ndarray, other: np.ndarray, factor: int = 8) -> np.ndarray:
    """8-bit picture of the differences, `factor` times as large."""
    difference = np.abs(one.astype(int) - other.astype(int))
    return np.clip(factor * difference, 0, 255).astype(np.uint8)
