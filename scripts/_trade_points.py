# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings that `benchmark.py trade` measures: plain data, one setting at a time and chosen combinations.

A point is a dictionary of dials: names of `FrameSettings`, of the water body (c, q), of a technique's own
settings (`core.parameters`), and `samples`. It names every dial that counts in it and no other, so that equal
pictures have equal points. c and q are missing where they are the scene's own.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields

from lake_water_addon.core.parameters import OWN, has_effect
from lake_water_addon.core.quality import QUALITIES, quality_settings, texture_size
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.techniques import TECHNIQUES

Settings = Mapping[str, object]

BASE: Settings = {
    "samples": 1,
    "texture_size": 512,
    "fov_ext": 1.5,
    "least_grid_resolution": 128,
    "intersection_steps": 3,
    "refraction_steps": 0,
    "reflection_steps": 16,
    "use_exact_fresnel": True,
    "use_caustics": True,
    "caustics_method": "AUTO",
    "caustics_size": 512,
    "photon_size": 256,
    "caustics_steps": 1,
    "light_depth_size": 1024,
}
"""What the others are varied around: so good that what one setting leaves is not lost in what others do."""

ALWAYS = {"use_glow": False}
"""The sun's mirror image is no part of the references."""

_FRAME = {f.name: type(f.default) for f in fields(FrameSettings)}
_CAUSTICS = ("caustics_method", "caustics_size", "photon_size", "caustics_steps")


@dataclass(frozen=True)
class Sweep:
    """One dial with each of its values, beside that of the base. around: what differs from the base besides.

    label: for a person. few: the values for techniques whose share in it is the same as Lake's.
    """

    dial: str
    label: str
    values: tuple[object, ...]
    around: Settings = field(default_factory=dict)
    few: tuple[object, ...] = ()


SWEEPS = (
    Sweep("intersection_steps", "Intersection steps", (1, 2, 4, 6, 8, 16)),
    Sweep("texture_size", "Texture size", (128, 256, 1024, 2048), few=(128, 1024)),
    Sweep("fov_ext", "FOV extension", (1.0, 1.2, 2.0), few=(1.0,)),
    Sweep("least_grid_resolution", "Grid resolution", (49, 256, 384), few=(256,)),
    Sweep("samples", "Samples", (2, 4, 16), few=(4,)),
    Sweep("refraction_steps", "Refraction steps", (8, 16, 32, 64)),
    Sweep("reflection_steps", "Reflection steps", (0, 4, 8, 32)),
    Sweep("c", "Reflection offset c", (0.0, 3.0, 10.0, 100.0), {"reflection_steps": 0}, few=(10.0,)),
    Sweep("q", "Schlick's exponent q", (5.65,), {"use_exact_fresnel": False}, few=(4.5,)),
    Sweep("use_caustics", "Caustics", (False,), few=(False,)),
    Sweep("caustics_method", "Caustics method", ("CPU", "GPU_POINTS")),
    Sweep("caustics_size", "Caustics size", (128, 256, 1024)),
    Sweep("photon_size", "Photons a side", (64, 128, 512)),
    Sweep("caustics_steps", "Caustics steps", (3,)),
    Sweep("light_depth_size", "Light depth size", (256, 2048)),
    Sweep("simple_lake_step", "Step along the ray", (0.0, 0.6)),
    Sweep("pond_bias", "Bias of refraction", (0.4,)),
    Sweep("pond_geometric_waves", "Waves raise the surface", (False,)),
    Sweep("ripple_refraction_distortion", "Shift of the bottom", (0.0,)),
    Sweep("ripple_normal_strength", "Slope of ripples", (0.0,)),
    Sweep("traced_march_steps", "March steps", (4, 8, 16, 64)),
    Sweep("traced_bisection_steps", "Bisections", (0, 3)),
    Sweep("traced_thickness", "Thickness", (0.1, 2.0)),
)

DIALS = tuple(dict.fromkeys((*BASE, *(sweep.dial for sweep in SWEEPS))))
"""Everything that a point may name, in the order of the table's columns."""

CHEAP = {
    "fov_ext": 1.2,
    "least_grid_resolution": 64,
    "caustics_size": 256,
    "photon_size": 128,
    "light_depth_size": 512,
}
FINE = {
    "refraction_steps": 32,
    "least_grid_resolution": 256,
    "caustics_size": 1024,
    "photon_size": 512,
    "light_depth_size": 2048,
}

_FOLLOWED = {"refraction_steps": 16, "reflection_steps": 32}
COMBINATIONS: tuple[tuple[float, Settings], ...] = (
    (0.4, {"intersection_steps": 1, "reflection_steps": 0, "use_exact_fresnel": False, **CHEAP}),
    (0.4, {"refraction_steps": 8, "reflection_steps": 8, **CHEAP}),
    (0.8, {"intersection_steps": 3, "reflection_steps": 8, **CHEAP}),
    (0.8, {"refraction_steps": 16, "reflection_steps": 16}),
    (1.2, _FOLLOWED),
    (1.6, {**_FOLLOWED, "fov_ext": 1.2, "photon_size": 512}),
    (1.6, {"samples": 2, **_FOLLOWED, "fov_ext": 1.2, "photon_size": 512}),
    (1.6, {"samples": 4, "intersection_steps": 6, "reflection_steps": 32, "photon_size": 512}),
    (1.6, {"samples": 4, "reflection_steps": 64, **FINE}),
    (2.4, {"samples": 4, "reflection_steps": 64, "fov_ext": 1.2, **FINE}),
    (1.2, {"samples": 16, "reflection_steps": 64, **FINE}),
)
"""Texels of the texture for each pixel of the picture's longer side, and what differs from the base."""

FEW_COMBINATIONS = (2, 10)
"""Those that are measured for techniques other than Lake."""

BRIEF = (
    *("intersection_steps", "refraction_steps", "reflection_steps", "texture_size", "fov_ext", "c", "q"),
    "least_grid_resolution",
    *("use_caustics", "traced_march_steps"),
)
"""The dials that a brief run turns."""

DEFAULT = "LAKE"
"""The technique whose settings are all measured, and whose front the qualities lie on."""


def point(technique: str, changes: Settings, base: Settings = BASE) -> dict[str, object]:
    """The point that differs from a base in some dials, with those alone that count for a technique."""
    dials = {**base, **changes}
    if dials.get("reflection_steps", 0) and has_effect("reflection_steps", technique):
        dials.pop("c", None)
    if dials.get("refraction_steps", 0) and has_effect("refraction_steps", technique):
        dials.pop("intersection_steps", None)
    if dials.get("use_exact_fresnel") and has_effect("use_exact_fresnel", technique):
        dials.pop("q", None)
    if not dials.get("use_caustics", True):
        dials = {name: value for name, value in dials.items() if name not in _CAUSTICS}
    return {n: dials[n] for n in DIALS if n in dials and (n == "samples" or has_effect(n, technique))}


def quality_point(technique: str, quality: str, longer_side: int) -> dict[str, object]:
    """What a quality (key of `QUALITIES`) comes to for pictures of that size."""
    return point(technique, quality_settings(quality, longer_side))


def without_caustics(longer_side: int) -> dict[str, object]:
    """Balanced without what Cycles does not have either, to be compared with that."""
    return point(DEFAULT, {**quality_settings("BALANCED", longer_side), "use_caustics": False})


def sweep_points(technique: str, sweep: Sweep) -> list[dict[str, object]]:
    """The base (as changed by `around`) and the points of a sweep; nothing where the dial does not count."""
    if not has_effect(sweep.dial, technique) and sweep.dial != "samples":
        return []
    values = sweep.values if technique == DEFAULT or sweep.dial in OWN else sweep.few
    if not values:
        return []
    return [
        point(technique, sweep.around),
        *(point(technique, {**sweep.around, sweep.dial: value}) for value in values),
    ]


def points(
    technique: str, longer_side: int, *, quick: bool = False, brief: bool = False
) -> list[dict[str, object]]:
    """All that is measured of a technique, each once: the qualities, the base, sweeps and combinations.

    The finest quality is measured of the techniques alone that follow rays: what limits the others is not its
    to mend. quick: two qualities, the base and one other, to try the program. brief: of the sweeps BRIEF the
    first and the last value alone, and of the techniques that follow no rays only one quality.
    """
    names = list(QUALITIES) if technique in (DEFAULT, "TRACED") else list(QUALITIES)[:-1]
    if brief and technique not in (DEFAULT, "TRACED"):
        names = ["BALANCED"]
    found = [quality_point(technique, name, longer_side) for name in (names[:2] if quick else names)]
    found.append(point(technique, {}))
    if quick:
        few = [p for s in SWEEPS if s.dial == "texture_size" for p in sweep_points(technique, s)]
        return _once([*found, few[1]])
    if technique == DEFAULT:
        found.append(without_caustics(longer_side))
    for sweep in SWEEPS:
        of_sweep = sweep_points(technique, sweep)
        if not brief:
            found += of_sweep
        elif sweep.dial in BRIEF and (technique == DEFAULT or sweep.dial in OWN):
            found += [*of_sweep[:2], *of_sweep[-1:]]
    if brief:
        return _once(found)
    numbers = range(len(COMBINATIONS)) if technique == DEFAULT else FEW_COMBINATIONS
    for ratio, changes in (COMBINATIONS[i] for i in numbers):
        found.append(point(technique, {**changes, "texture_size": texture_size(ratio, longer_side)}))
    return _once(found)


def _once(found: Iterable[dict[str, object]]) -> list[dict[str, object]]:
    return list({tuple(p.items()): p for p in found}.values())


def optics_of(technique: str) -> str:
    """What a technique is to come near to: the project's own model, or the physics of water."""
    return "physical" if TECHNIQUES[technique].spectral else "project"


def to_cells(settings: Settings) -> dict[str, str]:
    """A point as a row of the table: the columns DIALS, empty where a dial is not named."""
    return {name: _text(settings[name]) if name in settings else "" for name in DIALS}


def _text(value: object) -> str:
    return (
        ("no", "yes")[value]
        if isinstance(value, bool)
        else f"{value:.6g}"
        if isinstance(value, float)
        else str(value)
    )


def from_cells(row: Mapping[str, str]) -> dict[str, object]:
    """The inverse of `to_cells`; other columns are ignored."""
    return {name: _value(name, row[name]) for name in DIALS if row.get(name)}


def _value(name: str, text: str) -> object:
    if text in ("no", "yes"):
        return text == "yes"
    kind = _FRAME.get(name) or (
        int if name == "samples" else type(OWN[name].default) if name in OWN else float
    )
    return kind(text)
