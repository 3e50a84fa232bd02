# SPDX-License-Identifier: GPL-3.0-or-later
"""Which settings a calibration measures: each dial by itself, then combinations that promise to be good.

Settings are dictionaries of names in `parameters` (and `samples`). Those of a technique that sweep the same
thing form an axis; axes are either geometry, which decides where is looked up, or light.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .parameters import OWN, has_effect
from .quality import texture_size
from .settings import FrameSettings

Settings = Mapping[str, object]

RATIOS = (0.25, 0.5, 1.0, 1.6, 2.4, 4.0)
"""Texels a side for each pixel of the picture's longer side."""

LARGEST = 4096
"""Texels a side: no candidate has more, whatever the picture."""

OWN_GRID = 2
GRIDS = (OWN_GRID, 64, 128, 256)
"""Vertices along each side of a water's grid; the least leaves it as it is."""

_SIZES = ((256, 128), (512, 256), (1024, 512))

GEOMETRY = {
    "intersection_steps": (
        *({"intersection_steps": steps, "refraction_steps": 0} for steps in (1, 2, 3, 5, 8)),
        *({"intersection_steps": 3, "refraction_steps": steps} for steps in (16, 32)),
    ),
    "reflection_steps": tuple({"reflection_steps": steps} for steps in (0, 16, 32)),
    "traced_march_steps": tuple({"traced_march_steps": steps} for steps in (8, 16, 32, 64, 128)),
    "traced_bisection_steps": tuple({"traced_bisection_steps": steps} for steps in (3, 6, 10)),
    "fov_ext": tuple({"fov_ext": factor} for factor in (1.2, 1.5, 2.0)),
}
"""Beside the size of the textures: what decides where rays are taken to end."""

LIGHT = {
    "caustics": (
        {"use_caustics": False},
        *({"use_caustics": True, "caustics_size": c, "photon_size": p} for c, p in _SIZES),
    ),
    "light_depth_size": ({"light_depth_size": size} for size in (512, 1024, 2048)),
    "use_exact_fresnel": ({"use_exact_fresnel": value} for value in (False, True)),
}
LIGHT = {name: tuple(options) for name, options in LIGHT.items()}
"""What decides how bright is what is found there."""

BEST = {
    "intersection_steps": 3,
    "refraction_steps": 64,
    "reflection_steps": 64,
    "traced_march_steps": 128,
    "traced_bisection_steps": 10,
    "fov_ext": 1.5,
    "least_grid_resolution": 384,
    "caustics_size": 2048,
    "photon_size": 1024,
    "light_depth_size": 4096,
    "use_exact_fresnel": True,
}
"""With the largest textures: what pictures are compared with."""

BASE = {
    "intersection_steps": 3,
    "refraction_steps": 0,
    "reflection_steps": 16,
    "traced_march_steps": 32,
    "traced_bisection_steps": 6,
    "fov_ext": 1.5,
}
"""Around which dials are turned, one at a time, with textures of 1.6 texels a pixel."""

SLOPES = np.logspace(-4.0, 4.0, 81)
"""Prices of error in time, relative to the ranges of both, at which combinations are looked for."""


@dataclass(frozen=True)
class Axes:
    """What a calibration turns. geometry, light: by name of the axis, the settings of each of its options."""

    geometry: Mapping[str, Sequence[Settings]]
    light: Mapping[str, Sequence[Settings]]
    current: Settings
    base: Settings
    best: Settings

    @property
    def names(self) -> tuple[str, ...]:
        """Of all settings that a candidate has."""
        return tuple(self.current)

    def geometry_of(self, settings: Settings) -> tuple:
        """Equal for settings that look at the same places."""
        names = {name for options in self.geometry.values() for option in options for name in option}
        return tuple((name, settings[name]) for name in self.names if name in names)


def light_of(settings: Settings) -> dict[str, object]:
    """Of some settings, those that decide how light is computed."""
    names = {name for options in LIGHT.values() for option in options for name in option}
    unused = {"caustics_size", "photon_size"} if not settings.get("use_caustics", True) else set()
    return {name: value for name, value in settings.items() if name in names - unused}


def axes(
    frame: FrameSettings,
    own: Settings,
    longer_side: int,
    *,
    sunlit: bool,
    largest: int,
    grid: int | None = None,
) -> Axes:
    """What can be turned with the technique of a picture.

    frame: settings in use; own: those of the technique alone, by name; longer_side: of the picture, pixels;
    sunlit: whether there is sunlight in the water; largest: texels a side that the device can hold; grid:
    vertices along each side of the water's own grid, None without one.
    """
    technique = frame.technique
    largest = min(LARGEST, largest)
    sizes = sorted({min(texture_size(ratio, longer_side), largest) for ratio in RATIOS})
    geometry = {"texture_size": tuple({"texture_size": size} for size in sizes)}
    for name, options in GEOMETRY.items():
        if name in own or (name not in OWN and has_effect(name, technique)):
            geometry[name] = options
    if grid is not None:
        finer = [value for value in GRIDS if value == OWN_GRID or value > grid]
        geometry["least_grid_resolution"] = tuple({"least_grid_resolution": value} for value in finer)
    light = dict(LIGHT)
    if not sunlit or not frame.use_caustics:  # whoever switched them off wants none
        light.pop("caustics", None)
    if not sunlit or not (frame.use_caustics or frame.use_shadows):
        light.pop("light_depth_size", None)
    if not has_effect("use_exact_fresnel", technique):
        light.pop("use_exact_fresnel", None)
    names = [
        *dict.fromkeys(
            name for group in (geometry, light) for options in group.values() for o in options for name in o
        )
    ]
    current = {name: _shorter(own[name] if name in own else getattr(frame, name)) for name in names}
    base = current | {name: value for name, value in BASE.items() if name in current}
    if grid is not None:
        base["least_grid_resolution"] = 128 if grid < 128 else OWN_GRID
    best = current | {name: min(v, largest) for name, v in BEST.items() if name in current}
    return Axes(
        geometry,
        light,
        current,
        base | {"texture_size": min(texture_size(1.6, longer_side), largest)},
        best | {"texture_size": sizes[-1]},
    )


def _shorter(value: object) -> object:
    """Without the digits that Blender's float32 adds."""
    return round(value, 6) if isinstance(value, float) else value


def sweep(of: Axes) -> list[dict[str, object]]:
    """The base, then every option of every axis in its place, each once."""
    found = [dict(of.base)]
    for options in (*of.geometry.values(), *of.light.values()):
        found += [{**of.base, **option} for option in options]
    return without_repeats(found)


def without_repeats(candidates: Sequence[Settings]) -> list[dict[str, object]]:
    """The same in the same order, each once."""
    found = []
    for candidate in candidates:
        if candidate not in found:
            found.append(dict(candidate))
    return found


def combinations(
    of: Axes,
    turned: Mapping[str, Sequence[Settings]],
    measured: Sequence[tuple[Settings, float, float]],
    most: int,
) -> list[dict[str, object]]:
    """Settings that promise to be on the front, from the fastest to the most exact.

    turned: the axes, of geometry or all. measured: (settings, seconds, error) of the sweep. What an option
    adds to time and error is taken to be the same whatever the others are; at each price of error the best
    option of each axis is then known. most: as many as that at most, evenly spread.
    """
    known = {tuple(sorted(settings.items())): (t, e) for settings, t, e in measured}

    def at(settings: Settings) -> tuple[float, float]:
        return known[tuple(sorted(settings.items()))]

    time, error = (np.ptp([m[i] for m in measured]) for i in (1, 2))
    price = time / error if error > 0.0 else 1.0
    found = []
    for slope in SLOPES * price:
        settings = dict(of.base)
        for options in turned.values():
            cost = [np.dot(at({**of.base, **option}), (1.0, slope)) for option in options]
            settings.update(options[int(np.argmin(cost))])
        found.append(settings)
    found = without_repeats(found)
    chosen = np.linspace(0, len(found) - 1, min(most, len(found))).round().astype(int)
    return [found[i] for i in chosen]
