# SPDX-License-Identifier: GPL-3.0-or-later
"""What a technique's own settings have in common, and how they reach the shader.

Each technique has a frozen dataclass of them. Its fields are numbers, switches and tuples of up to four
numbers; in GLSL, field i is `technique.values[i]`, to which the technique's file gives a name.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

from .wave_maps import MapKind

MAX_VALUES = 24
"""Length of the array in `gpu_shaders/uniforms_lib.glsl`."""


def setting(
    default: Any, name: str, description: str, *, label: str = "", section: bool = False, **limits: Any
) -> Any:
    """A field with what the interface shows: name, tooltip, and as `limits` further arguments of its property
    in Blender (min, max, soft_min, soft_max, subtype, unit, step, precision).

    label: the name where it stands in the panel, at most 14 letters; empty if that is the name itself.
    section: whether the panel leaves a gap before it.
    """
    metadata = {"name": name, "description": description, **limits}
    return field(default=default, metadata=metadata | {"panel": {"label": label or name, "section": section}})


def map_label(sampler: str) -> str:
    """What a person reads for one of `TechniqueSettings.maps`: people count from 1, samplers from 0."""
    words = [str(int(word) + 1) if word.isdigit() else word for word in sampler.split("_")]
    return " ".join(words).title()


LENGTH = {"subtype": "DISTANCE", "unit": "LENGTH"}
ANGLE = {"subtype": "ANGLE", "unit": "ROTATION", "step": 500, "precision": 1}
COLOR = {"subtype": "COLOR", "soft_max": 1.0}
"""What settings of one kind have in common."""


@dataclass(frozen=True)
class TechniqueSettings:
    """Base of the settings of a technique.

    Each field is made with `setting`, from which its property in Blender follows.

    maps: the images that it looks up beside those of the passes, by the name of their sampler, each with
    the kind that is expected: a MapKind, or "COLOR" for any picture.
    """

    maps: ClassVar[Mapping[str, MapKind | str]] = {}

    @property
    def displaces(self) -> bool:
        """Whether the waves raise the surface; if not, it is drawn flat."""
        return True

    def moving(self, time: float) -> tuple[tuple[float, ...], ...]:
        """What of it changes with the scene's time (s), in vectors that follow those of the fields."""
        return ()


def pack(settings: TechniqueSettings, time: float = 0.0) -> np.ndarray:
    """(n, 4) float64: a row for each field in order, then what moves at `time` (s); short rows end in zeros.

    Raises ValueError when the array in the shader is too short for all of them.
    """
    values = [getattr(settings, field.name) for field in fields(settings)]
    values += settings.moving(time)
    if len(values) > MAX_VALUES:
        raise ValueError(f"{type(settings).__name__} has {len(values)} values, the shader takes {MAX_VALUES}")
    rows = np.zeros((len(values), 4))
    for row, value in zip(rows, values, strict=True):
        numbers = np.atleast_1d(np.asarray(value, dtype=np.float64))
        row[: len(numbers)] = numbers
    return rows


def scrolled(velocity: tuple[float, float], time: float, tile_size: float) -> tuple[float, float]:
    """How far, in tiles reduced to [0, 1), a map has moved after `time` s at `velocity` m/s.

    Reduced here, in float64: after hours of scene time a float32 would have lost the ripples' digits.
    """
    x, y = np.mod(np.multiply(velocity, time) / tile_size, 1.0)
    return float(x), float(y)
