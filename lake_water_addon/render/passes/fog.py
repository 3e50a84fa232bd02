# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera under water: fog over what is drawn, and the line where the surface cuts the picture."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import gpu
import numpy as np
from gpu.types import GPUShader, GPUTexture, GPUUniformBuf

from ...core.plan import BodyPlan
from ...core.under_water import HEIGHT_TEXELS, NO_WATER
from ..resources import Resources
from ..shader_library import ShaderLibrary, ShaderSpec
from ..targets import Target, Targets
from .geometry import opaque_state
from .water import NearSide, ViewTransform, WaterPainter, surface_interface


def heights_target(targets: Targets, body: int) -> Target:
    """colors: height of the surface in render space, m."""
    return targets.get(("surface heights", body), (HEIGHT_TEXELS, HEIGHT_TEXELS), ("R32F",))


def heights_spec(*, grid: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    surface, push_constants, defines = surface_interface(grid, heights_only=True)
    spec = ShaderSpec(
        name="surface_height",
        fragment="surface_height_frag.glsl",
        **surface,
        outputs=(("FLOAT", "out_height"),),
        uniform_buffers=(("View", "pass_view"), ("Water", "water")),
        push_constants=tuple(push_constants),
    )
    return spec, defines


def covering_spec(name: str, *, split: bool, display_referred: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The interface and defines of a variant of fog or meniscus."""
    defines = {}
    samplers, push_constants = [], []
    if name == "fog":
        samplers.append(("DEPTH_2D", "scene_depth"))
    else:
        push_constants.append(("FLOAT", "meniscus_width"))
    if split:
        defines["SPLIT"] = ""
        samplers.append(("FLOAT_2D", "surface_heights"))
    if display_referred:
        defines["DISPLAY_REFERRED"] = ""
        samplers.append(("FLOAT_3D", "view_transform_table"))
        push_constants.append(("VEC2", "view_transform_range"))
    spec = ShaderSpec(
        name=name,
        vertex="background_vert.glsl",
        fragment=f"{name}_frag.glsl",
        vertex_in=(("VEC2", "position"),),
        varyings=(("VEC2", "v_ndc"),),
        uniform_buffers=(("Water", "water"), ("NearPlane", "near_plane")),
        samplers=tuple(samplers),
        push_constants=tuple(push_constants),
    )
    return spec, defines


@contextmanager
def over_the_picture() -> Iterator[None]:
    """Premultiplied blending, no depth; afterwards as it was."""
    blend, depth_test = gpu.state.blend_get(), gpu.state.depth_test_get()
    gpu.state.blend_set("ALPHA_PREMULT")
    gpu.state.depth_test_set("NONE")
    try:
        yield
    finally:
        gpu.state.blend_set(blend)
        gpu.state.depth_test_set(depth_test)


class FogPainter:
    """Draws into whatever framebuffer is bound; its depth must not be the texture that fog reads."""

    def __init__(self, resources: Resources, library: ShaderLibrary) -> None:
        self._resources = resources
        self._library = library

    def draw_heights(
        self,
        surface: WaterPainter,
        body: BodyPlan,
        origin: np.ndarray,
        target: Target,
        view: GPUUniformBuf,
        water: GPUUniformBuf,
    ) -> None:
        """The map of the body's surface around the near plane. view: of `HeightMap`'s camera."""
        spec, defines = heights_spec(grid=body.body.grid is not None)
        with target.framebuffer.bind():
            target.framebuffer.clear(depth=1.0)
            target.colors[0].clear(format="FLOAT", value=(NO_WATER,))
            shader = self._library.get(spec, defines)
            with opaque_state():
                shader.bind()
                shader.uniform_block("pass_view", view)
                shader.uniform_block("water", water)
                surface.draw_surface(shader, body, origin, heights_only=True)

    def draw_fog(
        self,
        side: NearSide,
        water: GPUUniformBuf,
        depth: GPUTexture,
        view_transform: ViewTransform | None = None,
    ) -> None:
        """Blend the water over what is drawn. depth: of it, in the camera that `side` is of.

        view_transform: to draw in display colours. Blending those is not what light does; scene-linear
        colours are not to be had where Blender has drawn.
        """
        with over_the_picture():
            shader = self._bind("fog", side, water, view_transform)
            shader.uniform_sampler("scene_depth", depth)
            self._resources.covering_triangle().draw(shader)

    def draw_meniscus(
        self,
        side: NearSide,
        water: GPUUniformBuf,
        width: float,
        view_transform: ViewTransform | None = None,
    ) -> None:
        """The line between the pixels in the air and those under water. width: pixels."""
        with over_the_picture():
            shader = self._bind("meniscus", side, water, view_transform)
            shader.uniform_float("meniscus_width", width)
            self._resources.covering_triangle().draw(shader)

    def _bind(
        self, name: str, side: NearSide, water: GPUUniformBuf, view_transform: ViewTransform | None
    ) -> GPUShader:
        spec, defines = covering_spec(
            name, split=side.heights is not None, display_referred=view_transform is not None
        )
        shader = self._library.get(spec, defines)
        shader.bind()
        shader.uniform_block("water", water)
        shader.uniform_block("near_plane", side.near_plane)
        if side.heights is not None:
            shader.uniform_sampler("surface_heights", side.heights)
        if view_transform is not None:
            shader.uniform_sampler("view_transform_table", view_transform[0])
            shader.uniform_float("view_transform_range", view_transform[1])
        return shader
