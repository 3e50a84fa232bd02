# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures of the images that a technique looks up: a person's own, or maps of waves made when needed."""

from __future__ import annotations

import numpy as np
from gpu.types import GPUTexture

from ..core.technique_settings import TechniqueSettings
from ..core.wave_maps import make_map
from .resources import Resources
from .scene_buffers import image_texture

SIZE = 256
"""Texels a side of a map that is made here, as of those in the interface."""


class MapTextures:
    """One texture for each kind of map and number among a technique's maps; images are Blender's own."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._made: dict[tuple[str, int], GPUTexture] = {}

    def of(self, settings: TechniqueSettings, images: dict[str, str]) -> dict[str, GPUTexture]:
        """Texture by sampler. images: names of images by sampler; one that is missing or gone is made.

        In place of a picture, as opposed to a map of waves, there is one without colour and alpha.
        """
        found = {}
        for number, (sampler, kind) in enumerate(settings.maps.items()):
            texture = image_texture(images[sampler]) if sampler in images else None
            if texture is None:
                texture = self._own(kind, number)
            texture.extend_mode("REPEAT")
            found[sampler] = texture
        return found

    def _own(self, kind: str, number: int) -> GPUTexture:
        key = (kind, 0 if kind == "COLOR" else number)
        if key not in self._made:
            if kind == "COLOR":
                texels = np.zeros((1, 1, 4))
            else:
                texels = np.ones((SIZE, SIZE, 4))
                texels[..., :3] = make_map(kind, number + 1, SIZE)
            texture = self._resources.texture(texels.shape[1::-1], "RGBA16F", texels)
            texture.filter_mode(True)
            self._made[key] = texture
        return self._made[key]
