# SPDX-License-Identifier: GPL-3.0-or-later
"""The mean of the antialiasing samples, kept in 32-bit floats on the GPU."""

from __future__ import annotations

import gpu

from ..resources import Resources
from ..shader_library import ShaderLibrary, ShaderSpec
from ..targets import Target, Targets

ACCUMULATE = ShaderSpec(
    name="accumulate",
    vertex="background_vert.glsl",
    fragment="accumulate_frag.glsl",
    vertex_in=(("VEC2", "position"),),
    varyings=(("VEC2", "v_ndc"),),
    samplers=(("FLOAT_2D", "picture"),),
    push_constants=(("FLOAT", "weight"),),
)


def mean_target(targets: Targets, key: str, size: tuple[int, int]) -> Target:
    return targets.get((key, "mean"), size, ("RGBA32F",), depth=False)


def picture_target(targets: Targets, key: str, size: tuple[int, int]) -> Target:
    return targets.get((key, "picture"), size, ("RGBA16F",))


class SampleMean:
    """Adds pictures to a target with weights. Clear the target before the first."""

    def __init__(self, resources: Resources, library: ShaderLibrary) -> None:
        self._resources = resources
        self._library = library

    def add(self, picture: Target, mean: Target, weight: float) -> None:
        """mean += weight * picture."""
        with mean.framebuffer.bind():
            self._draw(picture, weight, "ADDITIVE_PREMULT")

    def show(self, mean: Target, weight: float) -> None:
        """weight * mean over what is in the bound framebuffer."""
        self._draw(mean, weight, "ALPHA_PREMULT")

    def _draw(self, source: Target, weight: float, blend: str) -> None:
        shader = self._library.get(ACCUMULATE)
        blend_before, depth_test_before = gpu.state.blend_get(), gpu.state.depth_test_get()
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set("NONE")
        shader.bind()
        shader.uniform_sampler("picture", source.colors[0])
        shader.uniform_float("weight", weight)
        self._resources.covering_triangle().draw(shader)
        gpu.state.blend_set(blend_before)
        gpu.state.depth_test_set(depth_test_before)
