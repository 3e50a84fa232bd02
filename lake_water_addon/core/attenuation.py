# SPDX-License-Identifier: GPL-3.0-or-later
"""Published values of how fast water swallows light, by colour."""

from __future__ import annotations

from dataclasses import dataclass

WAVELENGTHS = (650, 550, 450)
"""nm: what stands for red, green and blue."""


@dataclass(frozen=True)
class PublishedWater:
    """per_metre: 1/m at WAVELENGTHS. label, description: for a person."""

    label: str
    description: str
    per_metre: tuple[float, float, float]


PUBLISHED: dict[str, PublishedWater] = {
    # Pope and Fry, Applied Optics 36, 1997, table 3: absorption alone.
    "PURE": PublishedWater("Pure Water", "It only absorbs", (0.340, 0.0565, 0.0092)),
    # Jerlov, Marine Optics, 2nd edition, 1976, table XXVII: the attenuation coefficient of downward
    # irradiance, which has some scattering in it.
    **{
        f"COASTAL_{kind}": PublishedWater(
            f"Coastal {kind}",
            f"Jerlov's coastal type {kind}, from 1, the clearest, to 9, the most turbid",
            values,
        )
        for kind, values in (
            (1, (0.45, 0.12, 0.25)),
            (3, (0.46, 0.19, 0.39)),
            (5, (0.54, 0.30, 0.56)),
            (7, (0.63, 0.46, 0.89)),
            (9, (0.76, 0.63, 1.60)),
        )
    },
}
