# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures and framebuffers: made, resized and freed here and nowhere else."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import gpu
from gpu.types import GPUFrameBuffer, GPUTexture

from .resources import Resources


class TargetError(RuntimeError):
    """A picture that this graphics device cannot hold."""


@dataclass(eq=False)
class Target:
    """A framebuffer with its textures. size: (width, height) in pixels."""

    size: tuple[int, int]
    framebuffer: GPUFrameBuffer
    colors: tuple[GPUTexture, ...]
    depth: GPUTexture | None


class Targets:
    """Targets by name; one is made again only when its size or its formats change.

    spares: so many earlier ones of each name are kept, for who goes to and fro between sizes.
    """

    def __init__(self, resources: Resources) -> None:
        self.spares = 0
        self._resources = resources
        self._targets: dict[Hashable, tuple[tuple, Target]] = {}
        self._spare: dict[Hashable, OrderedDict[tuple, Target]] = {}
        self._color_only: WeakKeyDictionary[Target, GPUFrameBuffer] = WeakKeyDictionary()

    def get(
        self,
        key: Hashable,
        size: tuple[int, int],
        formats: tuple[str, ...],
        *,
        depth: bool = True,
        filtered: tuple[bool, ...] = (),
    ) -> Target:
        """filtered: which colour textures are read with interpolation (default none). Edges are repeated.

        Raises TargetError when the size is not one that the device can hold.
        """
        description = (size, formats, depth, filtered)
        if key in self._targets and self._targets[key][0] == description:
            return self._targets[key][1]
        largest = gpu.capabilities.max_texture_size_get()
        if not (1 <= size[0] <= largest and 1 <= size[1] <= largest):
            raise TargetError(
                f"a picture of {size[0]} x {size[1]} pixels cannot be drawn: "
                f"this graphics device takes 1 to {largest} pixels a side"
            )
        known = self._exchange(key, description)
        if known is not None:
            return known
        colors = tuple(self._resources.texture(size, pixel_format) for pixel_format in formats)
        for texture, smooth in zip(colors, filtered or (False,) * len(colors), strict=True):
            texture.filter_mode(smooth)
            texture.extend_mode("EXTEND")
        depth_texture = self._resources.texture(size, "DEPTH_COMPONENT32F") if depth else None
        target = Target(size, self._resources.framebuffer(colors, depth_texture), colors, depth_texture)
        self._targets[key] = (description, target)
        return target

    def _exchange(self, key: Hashable, description: tuple) -> Target | None:
        """Put the target of a name aside for another that was put aside before; None where there is none."""
        spare = self._spare.setdefault(key, OrderedDict())
        if key in self._targets:
            before, target = self._targets.pop(key)
            spare[before] = target
        known = spare.pop(description, None)
        while len(spare) > self.spares:
            spare.popitem(last=False)
        if known is not None:
            self._targets[key] = (description, known)
        return known

    def free_spares(self) -> None:
        """Free what is kept beside the targets in use, and keep nothing more."""
        self.spares = 0
        self._spare.clear()

    def color_only(self, target: Target) -> GPUFrameBuffer:
        """A framebuffer of the target's first colour alone, so that its depth can be read while drawing."""
        if target not in self._color_only:
            self._color_only[target] = self._resources.framebuffer(target.colors[:1])
        return self._color_only[target]

    def discard(self, key: Hashable) -> None:
        """Free a target; one that was never made is no error."""
        self._targets.pop(key, None)
        self._spare.pop(key, None)

    def keys(self) -> set[Hashable]:
        """Names of the targets that there are."""
        return set(self._targets)
