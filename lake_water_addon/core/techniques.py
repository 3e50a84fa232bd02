# SPDX-License-Identifier: GPL-3.0-or-later
"""The techniques that a person can choose from: one entry each, which all else follows.

`scene.lake_water.technique` holds the key. A file stores a choice by its place in this
dictionary, so that new techniques go to the end.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .technique_pond import PondSettings
from .technique_ripple import RippleSettings
from .technique_settings import TechniqueSettings
from .technique_simple_lake import SimpleLakeSettings
from .technique_traced import TracedSettings


class RefractionMap(Enum):
    """The picture in which a technique looks up what lies under water.

    TURNED: what lies below the surface, from the camera turned into the water as refraction bends its lowest
    ray; APPARENT: the same from the main camera, the water as shallow as it appears; MAIN: the same from the
    main camera; WHOLE: the whole scene without the water, from the main camera.
    """

    TURNED = "TURNED"
    APPARENT = "APPARENT"
    MAIN = "MAIN"
    WHOLE = "WHOLE"


@dataclass(frozen=True)
class Technique:
    """One way to turn a point of the surface into radiance, seen from the air.

    label: in title case; description: what it models and costs, for a person. reads: settings of the water
    body and the scene that have an effect. settings: the class of those that only this technique has, under
    `object.lake_water.<key in lower case>`, or None. reflection_depth: the reflection texture always has
    distances, too. spectral: its own setting `absorption` (1/m, RGB) replaces k, and light in the water is
    followed by colour.
    """

    label: str
    description: str
    refraction: RefractionMap
    reads: frozenset[str]
    settings: type[TechniqueSettings] | None = None
    reflection_depth: bool = False
    spectral: bool = False


_PICTURES = frozenset({"fov_ext", "texture_size"})
_WAVES = frozenset({"waves", "depth"})
_SUNLIGHT = frozenset({"k", "q", "ior"})  # in the water, which all but a spectral one take from there
_LAKE = _PICTURES | _WAVES | _SUNLIGHT | {"c", "water_color"}

TECHNIQUES: dict[str, Technique] = {
    "LAKE": Technique(
        "Lake",
        "Refraction camera turned into the water, several steps of the intersection search, Schlick's "
        "Fresnel term (Mihálik 2008). Draws the scene three times a frame: as seen, refracted and reflected",
        RefractionMap.TURNED,
        _LAKE | {"intersection_steps", "refraction_steps", "reflection_steps", "use_exact_fresnel"},
    ),
    "SIMPLE_LAKE": Technique(
        "Simple Lake",
        "As Lake, with the main camera for refraction, one short step and a simpler Fresnel term (Mihálik "
        "and Ďurikovič). Draws the scene three times a frame; its water costs the least",
        RefractionMap.MAIN,
        _LAKE,
        settings=SimpleLakeSettings,
    ),
    "POND": Technique(
        "Pond",
        "Two scrolling normal maps move what is seen through and mirrored in the water, under a material "
        "with a highlight (Luna 2006). Draws the scene three times a frame",
        RefractionMap.WHOLE,
        _PICTURES | _WAVES | _SUNLIGHT | {"water_color"},
        settings=PondSettings,
    ),
    "RIPPLE": Technique(
        "Ripple",
        "Flat water under a scrolling dudv map, more opaque with distance, angle and depth (Chen). Draws the "
        "scene three times a frame",
        RefractionMap.WHOLE,
        _PICTURES | _SUNLIGHT | {"water_color"},  # the color from under water alone
        settings=RippleSettings,
    ),
    "TRACED": Technique(
        "Traced",
        "Refracted and reflected rays followed through the depth of their pictures, exact Fresnel equations, "
        "absorption by color: the most accurate and the slowest. Draws the scene three times a frame",
        RefractionMap.APPARENT,
        _PICTURES | _WAVES | {"ior", "water_color"},
        settings=TracedSettings,
        reflection_depth=True,
        spectral=True,
    ),
}

DEFAULT_TECHNIQUE = "LAKE"
