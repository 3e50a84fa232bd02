# SPDX-License-Identifier: GPL-3.0-or-later
"""What the water does to light, in a reference: the project's own model, or the physics of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lake_water_addon.core import optics
from lake_water_addon.core.snapshot import WaterSettings


@dataclass(frozen=True, eq=False)
class WaterOptics:
    """absorption: (3,) 1/m; color: (3,) radiance of endless water as seen from the air.

    leaving: what radiance is multiplied by where it leaves the water, beside 1 - F, and divided by where it
    enters. sky, sky_absorption: part of the sky's irradiance that passes the surface, and its (3,) 1/m for
    each m of depth.
    """

    ior: float
    absorption: np.ndarray
    color: np.ndarray
    leaving: float
    sky: float
    sky_absorption: np.ndarray

    @property
    def is_gray(self) -> bool:
        """Whether all colours are absorbed alike."""
        return bool(np.ptp(self.absorption) == 0.0)


def project_optics(settings: WaterSettings) -> WaterOptics:
    """The model of MODEL.md: k for all colours, radiance that leaves unchanged, the sky's light untouched."""
    return WaterOptics(
        settings.ior,
        np.full(3, settings.k),
        np.array(settings.water_color, dtype=np.float64),
        leaving=1.0,
        sky=1.0,
        sky_absorption=np.zeros(3),
    )


def physical_optics(settings: WaterSettings, absorption: np.ndarray | None = None) -> WaterOptics:
    """As water does it: T / n^2 of the radiance leaves, and of the sky's light comes in what Fresnel's
    equations pass, less what is absorbed on its way. absorption: (3,) 1/m in place of k.

    Where all of a body's sky light is followed along one mean path (`optics.diffuse_path`), this is what the
    extension's spectral techniques model.
    """
    absorption = np.full(3, settings.k) if absorption is None else np.asarray(absorption, dtype=np.float64)
    return WaterOptics(
        settings.ior,
        absorption,
        np.array(settings.water_color, dtype=np.float64),
        leaving=settings.ior**-2,
        sky=optics.diffuse_transmittance(settings.ior),
        sky_absorption=absorption * optics.diffuse_path(settings.ior),
    )
