# SPDX-License-Identifier: GPL-3.0-or-later
"""Every parameter by one name: for the operator that sets them all, and for the script's options.

A parameter of the picture or of all water bodies has the name of its setting. One that only a technique has
starts with the technique: `pond_bias` is `object.lake_water.pond.bias`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any

from .settings import FrameSettings
from .snapshot import WaterSettings
from .technique_settings import map_label
from .techniques import TECHNIQUES

SCENE = tuple(field.name for field in fields(FrameSettings))
"""On `scene.lake_water`."""

WATER = tuple(f.name for f in fields(WaterSettings) if f.name not in ("waves", "own", "images"))
"""On `object.lake_water`. The waves are a list, which has buttons of its own."""


@dataclass(frozen=True)
class OwnParameter:
    """One that only a technique has. technique: its key; field: the setting's name in the technique's group.

    label, description: for a person. kind: of an image, as in `TechniqueSettings.maps`; else empty, and
    default is the setting's. unit: LENGTH for m, ROTATION for radians, else empty.
    """

    technique: str
    field: str
    label: str
    description: str
    default: Any = None
    kind: str = ""
    unit: str = ""

    @property
    def is_image(self) -> bool:
        """Whether it is an image of the file, and no value."""
        return bool(self.kind)


_IMAGE_TEXTS = {
    "NORMAL": "Normal map in place of the extension's own",
    "DUDV": "Dudv map in place of the extension's own",
    "COLOR": "Image for it; there is none without",
}


def _own() -> Iterator[tuple[str, OwnParameter]]:
    for key, technique in TECHNIQUES.items():
        if technique.settings is None:
            continue
        for field in fields(technique.settings):
            texts = field.metadata["name"], field.metadata["description"]
            unit = field.metadata.get("unit", "")
            yield (
                f"{key.lower()}_{field.name}",
                OwnParameter(key, field.name, *texts, field.default, unit=unit),
            )
        for name, kind in technique.settings.maps.items():
            texts = map_label(name), _IMAGE_TEXTS[kind]
            yield f"{key.lower()}_{name}", OwnParameter(key, name, *texts, kind=kind)


OWN = dict(_own())

_BY_TECHNIQUE = frozenset().union(*(technique.reads for technique in TECHNIQUES.values()))


def has_effect(name: str, technique: str) -> bool:
    """Whether a parameter can change the picture when a technique draws it.

    What no technique is said to read, such as the sun's glow, has nothing to do with it.
    """
    if name in OWN:
        return OWN[name].technique == technique
    return name in TECHNIQUES[technique].reads or name not in _BY_TECHNIQUE


def of_technique(technique: str) -> tuple[str, ...]:
    """The parameters that the technique reads, the body's first, the picture's last; no images."""
    names = [name for name in WATER if has_effect(name, technique)]
    names += [name for name, own in OWN.items() if own.technique == technique and not own.is_image]
    return (*names, *(name for name in SCENE if name in TECHNIQUES[technique].reads))
