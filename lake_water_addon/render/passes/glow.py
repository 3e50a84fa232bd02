# SPDX-License-Identifier: GPL-3.0-or-later
"""The star-shaped glow around the sun's mirror image in the water: highlights, filter, sum."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import gpu
import numpy as np
from gpu.types import GPUTexture, GPUUniformBuf

from ...core.glow import COLOR, LONG_SIDE, MARGIN
from ...core.plan import BodyPlan, FramePlan
from .. import uniforms
from ..resources import Resources
from ..shader_library import ShaderLibrary, ShaderSpec
from ..targets import Target, Targets
from ..uniforms import UniformBlock
from .geometry import opaque_state
from .water import WaterPainter, surface_interface

SIDE = LONG_SIDE + 2 * MARGIN + 2
"""Texels a side of the textures, of which a picture uses a part: they serve every picture and border. The
lattice's last texel may be cut by the picture's border, on each side."""

FILTER = ShaderSpec(
    name="glow_filter",
    vertex="background_vert.glsl",
    fragment="glow_filter_frag.glsl",
    vertex_in=(("VEC2", "position"),),
    varyings=(("VEC2", "v_ndc"),),
    outputs=(("FLOAT", "out_star"),),
    samplers=(("FLOAT_2D", "highlights"),),
    push_constants=(("VEC2", "size"),),
)


def highlight_spec(*, grid: bool, shadows: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    surface, push_constants, defines = surface_interface(grid)
    samplers = [("DEPTH_2D", "picture_depth")]
    if shadows:
        defines["SHADOWS"] = ""
        samplers.append(("FLOAT_2D", "shadow_depth"))
    spec = ShaderSpec(
        name="glow",
        fragment="glow_frag.glsl",
        **surface,
        outputs=(("FLOAT", "out_highlight"),),
        uniform_buffers=(
            ("Lights", "lights"),
            ("View", "pass_view"),
            ("Water", "water"),
            ("View", "picture_view"),
        ),
        samplers=tuple(samplers),
        push_constants=(*push_constants, ("VEC2", "lobe")),
    )
    return spec, defines


def add_spec(*, display_referred: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    defines = {}
    samplers = [("FLOAT_2D", "star")]
    push_constants = [("VEC4", "place"), ("VEC3", "glow")]
    if display_referred:
        defines["DISPLAY_REFERRED"] = ""
        samplers.append(("FLOAT_3D", "view_transform_table"))
        push_constants.append(("VEC2", "view_transform_range"))
    spec = ShaderSpec(
        name="glow_add",
        vertex="background_vert.glsl",
        fragment="glow_add_frag.glsl",
        vertex_in=(("VEC2", "position"),),
        varyings=(("VEC2", "v_ndc"),),
        samplers=tuple(samplers),
        push_constants=tuple(push_constants),
    )
    return spec, defines


def highlight_target(targets: Targets) -> Target:
    """colors: 0..1, of the sun's mirror image."""
    return targets.get(("glow", "highlights"), (SIDE, SIDE), ("R16F",))


def star_target(targets: Targets) -> Target:
    """colors: the filtered highlights."""
    return targets.get(("glow", "star"), (SIDE, SIDE), ("R16F",), depth=False, filtered=(True,))


class GlowPainter:
    """Draws the glow of a planned picture: `draw_star`, then `add` into the picture's framebuffer.

    Its two textures are made with the first glow and kept, whatever the size of the pictures.
    """

    def __init__(
        self, resources: Resources, library: ShaderLibrary, targets: Targets, water: WaterPainter
    ) -> None:
        self._resources = resources
        self._library = library
        self._targets = targets
        self._water = water
        self._view = UniformBlock(resources)

    def draw_star(
        self,
        plan: FramePlan,
        lights: GPUUniformBuf,
        view: GPUUniformBuf,
        waters: Sequence[GPUUniformBuf | None],
        depth: GPUTexture,
        shadow_depth: GPUTexture | None = None,
    ) -> GPUTexture:
        """The filtered highlights. Call it while no framebuffer that holds `depth` is bound.

        view: of the picture; waters: uniform blocks of the bodies that `plan.glow.bodies` names; depth: of
        the picture after the water is drawn, or of its dry scene alone, of the picture's size. shadow_depth:
        of the cameras along the sun, or None for water that all the sun reaches.
        """
        glow = plan.glow
        highlights, star = highlight_target(self._targets), star_target(self._targets)
        projection = glow.drawn_projection((depth.width, depth.height))
        own_view = self._view.update(*uniforms.view(glow.view, projection))
        with _drawn_part(highlights, glow.size):
            with opaque_state():
                for i, body in enumerate(plan.bodies):
                    if glow.bodies[i]:
                        blocks = (lights, own_view, waters[i], view)
                        self._draw_highlights(plan, body, blocks, depth, shadow_depth)
        with _drawn_part(star, glow.size), opaque_state():
            gpu.state.depth_test_set("NONE")
            gpu.state.depth_mask_set(False)
            shader = self._library.get(FILTER)
            shader.bind()
            shader.uniform_sampler("highlights", highlights.colors[0])
            shader.uniform_float("size", glow.size)
            self._resources.covering_triangle().draw(shader)
        return star.colors[0]

    def _draw_highlights(
        self,
        plan: FramePlan,
        body: BodyPlan,
        blocks: Sequence[GPUUniformBuf],
        depth: GPUTexture,
        shadow_depth: GPUTexture | None,
    ) -> None:
        spec, defines = highlight_spec(grid=body.body.grid is not None, shadows=shadow_depth is not None)
        shader = self._library.get(spec, defines)
        shader.bind()
        for (_, name), block in zip(spec.uniform_buffers, blocks, strict=True):
            shader.uniform_block(name, block)
        shader.uniform_sampler("picture_depth", depth)
        if shadow_depth is not None:
            shader.uniform_sampler("shadow_depth", shadow_depth)
        shader.uniform_float("lobe", (plan.settings.glow_exponent, plan.glow.cut))
        self._water.draw_surface(shader, body, plan.origin)

    def add(
        self,
        plan: FramePlan,
        star: GPUTexture,
        view_transform: tuple[GPUTexture, tuple[float, float]] | None = None,
    ) -> None:
        """Add what `draw_star` gave to the bound framebuffer, whose viewport is the picture; alpha stays.

        view_transform: table and range of `core/view_transform.py`, to add in display colours.
        """
        left, bottom, width, height = gpu.state.viewport_get()
        x, y, part_width, part_height = plan.glow.pixels((width, height))
        if part_width == 0 or part_height == 0:
            return
        scale, offset = plan.glow.to_texels((width, height))
        # The viewport is the part alone: device coordinates -1..1 are its pixels.
        half = 0.5 * np.array([part_width / width, part_height / height])
        middle = np.array([x / width, y / height]) + half
        place = np.concatenate([scale * half, scale * middle + offset]) / SIDE
        spec, defines = add_spec(display_referred=view_transform is not None)
        shader = self._library.get(spec, defines)
        with opaque_state():
            gpu.state.depth_test_set("NONE")
            gpu.state.depth_mask_set(False)
            gpu.state.blend_set("ADDITIVE_PREMULT")
            gpu.state.viewport_set(left + x, bottom + y, part_width, part_height)
            try:
                shader.bind()
                shader.uniform_sampler("star", star)
                if view_transform is not None:
                    shader.uniform_sampler("view_transform_table", view_transform[0])
                    shader.uniform_float("view_transform_range", view_transform[1])
                shader.uniform_float("place", place.tolist())
                shader.uniform_float("glow", [plan.settings.glow_strength * channel for channel in COLOR])
                self._resources.covering_triangle().draw(shader)
            finally:
                gpu.state.viewport_set(left, bottom, width, height)


@contextmanager
def _drawn_part(target: Target, size: tuple[int, int]) -> Iterator[None]:
    """Draw into so many texels of the target, from its corner; the rest of it is dark."""
    with target.framebuffer.bind():
        if target.depth is None:
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0))
        else:
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
        gpu.state.viewport_set(0, 0, *size)
        try:
            yield
        finally:
            gpu.state.viewport_set(0, 0, *target.size)
