# SPDX-License-Identifier: GPL-3.0-or-later
"""The techniques that a person can choose from: one entry each, nothing else to touch in the interface.

`scene.lake_water.technique` holds the key. A file stores a choice by its place in this
dictionary, so that new techniques go to the end.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Technique:
    """What the interface says about one technique: a label in title case, what it models and costs."""

    label: str
    description: str


TECHNIQUES: dict[str, Technique] = {
    "LAKE": Technique(
        "Lake",
        "Refraction camera turned into the water, several steps of the intersection search, Schlick's "
        "Fresnel term (Mihálik 2008). Draws the scene three times a frame: as seen, refracted and reflected",
    ),
}

DEFAULT_TECHNIQUE = "LAKE"
