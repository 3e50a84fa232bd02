# SPDX-License-Identifier: GPL-3.0-or-later
"""Four steps from fast to exact, each a point of the measured front (docs/trade.md).

A quality says how exactly the water is computed, and never what: technique, colors and optics stay. The size
of the refraction and reflection textures follows the picture's, so that a quality means the same at any.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

CUSTOM = "CUSTOM"
"""What settings are that no quality has."""
STEP = 64
"""Sizes of textures are multiples of it."""
LARGEST = 8192
"""No texture is larger, whatever the picture."""


@dataclass(frozen=True)
class Quality:
    """texture_ratio: texels a side of both textures for each pixel of the picture's longer side.

    settings: of `FrameSettings`, by name. samples: of a final render and of the resting viewport.
    """

    label: str
    description: str
    texture_ratio: float
    samples: int
    settings: Mapping[str, object] = field(default_factory=dict)


QUALITIES = {
    "DRAFT": Quality(
        "Draft",
        "For setting a scene up, and for slow machines",
        texture_ratio=0.8,
        samples=1,
        settings={
            "fov_ext": 1.2,
            "least_grid_resolution": 64,
            "refraction_steps": 8,
            "reflection_steps": 8,
            "use_exact_fresnel": True,
            "caustics_size": 256,
            "photon_size": 256,
            "caustics_steps": 1,
            "light_depth_size": 512,
        },
    ),
    "BALANCED": Quality(
        "Balanced",
        "Close to the truth in motion",
        texture_ratio=1.6,
        samples=4,
        settings={
            "fov_ext": 1.2,
            "least_grid_resolution": 128,
            "refraction_steps": 16,
            "reflection_steps": 32,
            "use_exact_fresnel": True,
            "caustics_size": 1024,
            "photon_size": 512,
            "caustics_steps": 2,
            "light_depth_size": 1024,
        },
    ),
    "FINE": Quality(
        "Fine",
        "For final pictures",
        texture_ratio=2.4,
        samples=8,
        settings={
            "fov_ext": 1.2,
            "least_grid_resolution": 192,
            "refraction_steps": 32,
            "reflection_steps": 64,
            "use_exact_fresnel": True,
            "caustics_size": 1024,
            "photon_size": 512,
            "caustics_steps": 2,
            "light_depth_size": 2048,
        },
    ),
    "BEST": Quality(
        "Best",
        "As close to the truth as the technique gets",
        texture_ratio=4.0,
        samples=32,
        settings={
            "fov_ext": 1.3,
            "least_grid_resolution": 256,
            "refraction_steps": 64,
            "reflection_steps": 64,
            "use_exact_fresnel": True,
            "caustics_size": 2048,
            "photon_size": 1024,
            "caustics_steps": 3,
            "light_depth_size": 4096,
        },
    ),
}
"""From the fastest to the most exact."""


def texture_size(ratio: float, longer_side: int) -> int:
    """Texels a side for a picture whose longer side has so many pixels."""
    return min(max(round(ratio * longer_side / STEP), 1) * STEP, LARGEST)


def quality_settings(name: str, longer_side: int) -> dict[str, object]:
    """All that a quality sets for a picture whose longer side has so many pixels, by name.

    Names of `FrameSettings`, and `samples` and `viewport_samples`.
    """
    quality = QUALITIES[name]
    return {
        "texture_size": texture_size(quality.texture_ratio, longer_side),
        **quality.settings,
        "samples": quality.samples,
        "viewport_samples": quality.samples,
    }


def quality_of(settings: object, longer_side: int) -> str:
    """The key of the quality that an object's attributes are set to, or CUSTOM.

    settings: has the names of `quality_settings`, such as `scene.lake_water`.
    """
    for name in QUALITIES:
        wanted = quality_settings(name, longer_side)
        if all(_is_equal(getattr(settings, key), value) for key, value in wanted.items()):
            return name
    return CUSTOM


def _is_equal(value: object, wanted: object) -> bool:
    """Blender holds numbers as float32."""
    if isinstance(wanted, float):
        return abs(value - wanted) <= 1e-6 * max(1.0, abs(wanted))
    return value == wanted
