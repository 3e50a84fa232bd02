# SPDX-License-Identifier: GPL-3.0-or-later
"""Draws the scene's own geometry and the sky: shared by the passes that need it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import gpu
from gpu.types import GPUTexture, GPUUniformBuf

from ...core.plan import TexturePass
from ..resources import Resources
from ..scene_buffers import SceneBuffers, Segment
from ..shader_library import ShaderLibrary, ShaderSpec

SCENE = dict(
    name="scene",
    vertex="scene_vert.glsl",
    fragment="scene_frag.glsl",
    vertex_in=(("VEC3", "position"), ("VEC3", "normal"), ("VEC2", "uv"), ("VEC4", "color")),
    varyings=(
        ("VEC3", "v_position"),
        ("VEC3", "v_normal"),
        ("VEC2", "v_uv"),
        ("VEC4", "v_color"),
        ("FLOAT", "v_depth"),
    ),
)

NO_DEPTH = 1e5
"""m: the distance of the sky in textures of distances."""


def background_spec(*, linear_depth: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The interface and defines of the sky's shader."""
    outputs = (("VEC4", "out_color"), *((("FLOAT", "out_depth"),) if linear_depth else ()))
    spec = ShaderSpec(
        name="background",
        vertex="background_vert.glsl",
        fragment="background_frag.glsl",
        vertex_in=(("VEC2", "position"),),
        varyings=(("VEC2", "v_ndc"),),
        outputs=outputs,
        uniform_buffers=(("Lights", "lights"), ("View", "pass_view")),
        samplers=(("FLOAT_2D", "sky_image"),),
    )
    return spec, {"LINEAR_DEPTH": f"{NO_DEPTH:.1f}"} if linear_depth else {}


DEPTH = {**SCENE, "name": "depth", "fragment": "depth_frag.glsl"}


@dataclass(frozen=True, eq=False)
class SunInWater:
    """What lights a scene through one body of water. caustics: texture of the photons' sum, or None."""

    water: GPUUniformBuf
    water_light: GPUUniformBuf
    light_depth: GPUTexture | None
    caustics: GPUTexture | None


@dataclass(frozen=True, eq=False)
class SceneLook:
    """How the scene is lit. shadow_depth: texture of the sun's camera, or None for no shadows at all.

    sun_in_water: for what lies under water; above_too: what lies above the waves is lit as in the air.
    """

    lights: GPUUniformBuf
    shadow_depth: GPUTexture | None
    sun_in_water: SunInWater | None = None
    above_too: bool = False

    @property
    def defines(self) -> dict[str, str]:
        """Those of the scene's shader."""
        under = self.sun_in_water
        return {
            name: ""
            for name, given in (
                ("SHADOWS", self.shadow_depth is not None),
                ("UNDER_WATER", under is not None),
                ("CAUSTICS", under is not None and under.caustics is not None),
                ("WATER_LINE", self.above_too),
            )
            if given
        }

    def samplers(self) -> list[tuple[str, GPUTexture]]:
        """Names and textures that the variant looks up, beyond those of every variant."""
        found = []
        under = self.sun_in_water
        if self.shadow_depth is not None:
            found.append(("shadow_depth", self.shadow_depth))
            if under is not None:
                found.append(("light_depth", under.light_depth))
        if under is not None and under.caustics is not None:
            found.append(("caustics", under.caustics))
        return found


def scene_spec(
    look: SceneLook, *, textured: bool, clipped: bool, mark_inside: bool, linear_depth: bool
) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    defines = look.defines
    # A driver drops what a variant does not use, and setting it then is an error: declare just that.
    push_constants = [("INT", "instance_base"), ("VEC4", "base_color")]  # a: the least alpha that is kept
    buffers = [("Lights", "lights"), ("View", "pass_view")]
    samplers = [("FLOAT_2D", "instances"), ("FLOAT_2D", "sky_image")]
    samplers += [("FLOAT_2D", name) for name, _ in look.samplers()]
    outputs = [("VEC4", "out_color")]
    if textured:
        defines["TEXTURED"] = ""
        samplers.append(("FLOAT_2D", "base_image"))
    else:
        push_constants.append(("INT", "use_vertex_color"))
    if clipped or look.sun_in_water is not None:
        buffers.append(("Water", "water"))
    if look.sun_in_water is not None:
        buffers.append(("WaterLight", "water_light"))
    if clipped:
        defines["CLIPPED"] = ""
    if mark_inside:
        defines["MARK_INSIDE"] = ""
        push_constants.append(("INT", "mark_inside"))
    if linear_depth:
        defines["LINEAR_DEPTH"] = ""
        outputs.append(("FLOAT", "out_depth"))
    spec = ShaderSpec(
        **SCENE,
        outputs=tuple(outputs),
        uniform_buffers=tuple(buffers),
        samplers=tuple(samplers),
        push_constants=tuple(push_constants),
    )
    return spec, defines


def depth_spec(*, textured: bool, clipped: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The interface and defines of a variant that writes distances only."""
    defines = {"CLIPPED": ""} if clipped else {}
    if textured:
        defines["TEXTURED"] = ""
    spec = ShaderSpec(
        **DEPTH,
        outputs=(("FLOAT", "out_depth"),),
        uniform_buffers=(("View", "pass_view"),),
        samplers=(("FLOAT_2D", "instances"), *((("FLOAT_2D", "base_image"),) if textured else ())),
        push_constants=(("INT", "instance_base"), *((("VEC4", "base_color"),) if textured else ())),
    )
    return spec, defines


@contextmanager
def opaque_state(clip_distances: int = 0) -> Iterator[None]:
    """Depth test and depth write on, blending off; afterwards everything as Blender expects it."""
    depth_test, depth_mask, blend = (
        gpu.state.depth_test_get(),
        gpu.state.depth_mask_get(),
        gpu.state.blend_get(),
    )
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(True)
    gpu.state.blend_set("NONE")
    gpu.state.clip_distances_set(clip_distances)
    try:
        yield
    finally:
        gpu.state.clip_distances_set(0)
        gpu.state.face_culling_set("NONE")
        gpu.state.front_facing_set(False)
        gpu.state.blend_set(blend)
        gpu.state.depth_mask_set(depth_mask)
        gpu.state.depth_test_set(depth_test)


class GeometryPainter:
    """Draws scene and sky with given uniform buffers into whatever framebuffer is bound."""

    def __init__(self, resources: Resources, library: ShaderLibrary, scene: SceneBuffers) -> None:
        self._library = library
        self._scene = scene
        self._resources = resources

    def draw_scene(
        self,
        look: SceneLook,
        view: GPUUniformBuf,
        *,
        side: TexturePass | None = None,
        water: GPUUniformBuf | None = None,
        mark_insides: bool = False,
        linear_depth: bool = False,
    ) -> None:
        """Draw every draw call. With `side` and `water`, only what lies on that side of the water body.

        Back faces are culled where the material says so, and those of solids in a pass with a `side`,
        unless `mark_insides`: then those of solids that the water line may cut open get alpha 0.
        What no wave can cut goes without the clip, which is cheaper.
        """
        if side is None:
            uncut, cut = self._scene.segments(0, 0.0, 0.0)
        else:
            uncut, cut = self._scene.segments(side.keep, side.clip_height, side.clear_height)
        mirrored = side is not None and side.mirrored
        common = (look, view, mirrored, side is not None, mark_insides, linear_depth)
        with opaque_state():
            self._draw_segments(uncut, *common)
        with opaque_state(clip_distances=1):
            self._draw_segments(cut, *common, water=water)

    def draw_scene_in_water(
        self,
        in_air: SceneLook,
        in_water: SceneLook,
        view: GPUUniformBuf,
        lowest: float,
        highest: float,
        *,
        linear_depth: bool = False,
    ) -> None:
        """Draw every draw call, what lies below the waves lit through them.

        lowest, highest: heights that no wave goes beyond; only between them each fragment asks the waves.
        """
        below, across, above = self._scene.around(lowest, highest)
        at_the_line = replace(in_water, above_too=True)
        for segments, look in ((below, in_water), (across, at_the_line), (above, in_air)):
            with opaque_state():
                self._draw_segments(segments, look, view, False, False, False, linear_depth)

    def draw_depths(
        self, view: GPUUniformBuf, keep: int = 0, height: float = 0.0, *, cull_back_faces: bool = False
    ) -> None:
        """Distances along the viewing axis of what reaches to one side of a height (see `HeightOrder.split`).

        keep +1: cut off at `height`; -1: whole, what lies below does no harm; 0: everything.
        cull_back_faces: where the material says so, which a shadow does not care for.
        """
        uncut, cut = self._scene.segments(keep, height, height)
        for segments, clipped in ((uncut, False), (cut, keep > 0)):
            textured = shader = None
            with opaque_state(clip_distances=int(clipped)):
                for segment in segments:
                    call, material = segment.call, segment.call.material
                    clip_image = call.image if material.alpha_threshold is not None else None
                    if textured != (clip_image is not None):
                        textured = clip_image is not None
                        shader = self._library.get(*depth_spec(textured=textured, clipped=clipped))
                        shader.bind()
                        shader.uniform_block("pass_view", view)
                        shader.uniform_sampler("instances", self._scene.instances)
                    if textured:
                        shader.uniform_sampler("base_image", clip_image)
                        shader.uniform_float("base_color", (0.0, 0.0, 0.0, material.alpha_threshold))
                    shader.uniform_int("instance_base", segment.first)
                    gpu.state.face_culling_set(
                        "BACK" if cull_back_faces and material.cull_back_faces else "NONE"
                    )
                    gpu.state.front_facing_set(call.flipped)
                    segment.draw(shader)

    def _draw_segments(
        self,
        segments: list[Segment],
        look: SceneLook,
        view: GPUUniformBuf,
        mirrored: bool,
        cull_solids: bool,
        mark_insides: bool,
        linear_depth: bool,
        water: GPUUniformBuf | None = None,
    ) -> None:
        """Draw with one of two shaders, textured or not. water: clip at this body's surface."""
        clipped = water is not None
        textured = image = shader = None
        under = look.sun_in_water
        for segment in segments:
            call, material = segment.call, segment.call.material
            if textured != (call.image is not None):
                textured = call.image is not None
                spec, defines = scene_spec(
                    look,
                    textured=textured,
                    clipped=clipped,
                    mark_inside=mark_insides,
                    linear_depth=linear_depth,
                )
                shader = self._library.get(spec, defines)
                shader.bind()
                shader.uniform_block("lights", look.lights)
                shader.uniform_block("pass_view", view)
                if under is not None:
                    shader.uniform_block("water", under.water)
                    shader.uniform_block("water_light", under.water_light)
                elif clipped:
                    shader.uniform_block("water", water)
                shader.uniform_sampler("instances", self._scene.instances)
                shader.uniform_sampler("sky_image", self._scene.sky_image)
                for name, texture in look.samplers():
                    shader.uniform_sampler(name, texture)
            if textured and call.image is not image:
                image = call.image
                shader.uniform_sampler("base_image", image)
            # One of many instances that no wave can reach is whole; a range of triangles is the rest of
            # something that was cut.
            marked = mark_insides and call.solid and (clipped or segment.indices is not None)
            culled = material.cull_back_faces or (cull_solids and call.solid)
            gpu.state.face_culling_set("BACK" if culled and not marked else "NONE")
            gpu.state.front_facing_set(mirrored != call.flipped)
            shader.uniform_float("base_color", (*material.base_color, material.alpha_threshold or 0.0))
            shader.uniform_int("instance_base", segment.first)
            if mark_insides:
                shader.uniform_int("mark_inside", int(marked))
            if not textured:
                shader.uniform_int("use_vertex_color", int(material.use_color_attribute))
            segment.draw(shader)

    def draw_sky(self, lights: GPUUniformBuf, view: GPUUniformBuf, *, linear_depth: bool = False) -> None:
        """Draw the sky wherever nothing is nearer."""
        with opaque_state():
            shader = self._library.get(*background_spec(linear_depth=linear_depth))
            shader.bind()
            shader.uniform_block("lights", lights)
            shader.uniform_block("pass_view", view)
            shader.uniform_sampler("sky_image", self._scene.sky_image)
            self._resources.covering_triangle().draw(shader)
