# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person set for the picture as a whole, as plain data; its defaults are those of the interface."""

from __future__ import annotations

from dataclasses import dataclass

from .techniques import DEFAULT_TECHNIQUE

CAUSTICS_METHODS = {
    "AUTO": "Automatic",
    "CPU": "CPU",
    "GPU_POINTS": "GPU Points",
    "GPU_COMPUTE": "GPU Compute",
}
"""How photons are summed, with the name that a person reads. AUTO: the fastest on the machine."""


@dataclass(frozen=True)
class FrameSettings:
    """Settings of a picture, under the names that they have on `scene.lake_water`.

    texture_size, caustics_size, photon_size, light_depth_size: texels a side. least_grid_resolution: vertices
    along each side of a water's grid, where its own has fewer. intersection_steps: of
    the search for the bottom; refraction_steps: most along a refracted ray that is followed in its place,
    when more than 0. reflection_steps: most along a reflected ray; 0 looks up a fixed distance c away, from
    below RAY_LENGTH. caustics_method: a key of CAUSTICS_METHODS.
    """

    technique: str = DEFAULT_TECHNIQUE
    fov_ext: float = 1.5
    texture_size: int = 512
    least_grid_resolution: int = 2
    intersection_steps: int = 3
    refraction_steps: int = 0
    reflection_steps: int = 0
    use_exact_fresnel: bool = False
    use_caustics: bool = True
    caustics_method: str = "AUTO"
    caustics_size: int = 512
    photon_size: int = 256
    caustics_steps: int = 1
    use_shadows: bool = True
    light_depth_size: int = 1024
    use_glow: bool = True
    glow_strength: float = 8.0
    glow_exponent: float = 6000.0
    glow_threshold: float = 0.1
    use_exact_under_water: bool = True


DEFAULTS = FrameSettings()
