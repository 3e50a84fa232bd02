# SPDX-License-Identifier: GPL-3.0-or-later
"""The water surface itself, over the scene that is already drawn."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from gpu.types import GPUBatch, GPUShader, GPUTexture, GPUUniformBuf

from ...core.plan import BodyPlan, rebase
from ...core.techniques import TECHNIQUES
from ..resources import Resources
from ..scene_buffers import SceneBuffers
from ..shader_library import ShaderLibrary, ShaderSpec
from ..targets import Target
from .geometry import opaque_state

ViewTransform = tuple[GPUTexture, tuple[float, float]]

MAX_GRIDS = 4
"""Grids of different resolution that are kept on the GPU."""


def surface_interface(
    grid: bool, *, heights_only: bool = False
) -> tuple[dict, list[tuple[str, str]], dict[str, str]]:
    """What `water_vert.glsl` takes of a grid or a mesh: fields of a ShaderSpec, push constants and defines.

    It also takes the uniform blocks `pass_view` and `water`. heights_only: the shader does not use slopes.
    """
    fields = {
        "vertex": "water_vert.glsl",
        "vertex_in": (("VEC2", "cell"),) if grid else (("VEC3", "position"), ("VEC3", "normal")),
        "varyings": (("VEC3", "v_position"), ("VEC2", "v_slope")),
    }
    if not heights_only:
        fields["varyings"] += (("FLOAT", "v_wave"),)
    push_constants = [] if grid else [("MAT4", "object_matrix")]
    defines = {"GRID" if grid else "MESH": ""}
    if heights_only:
        defines["HEIGHTS_ONLY"] = ""
    elif not grid:
        push_constants.append(("MAT3", "normal_matrix"))
    return fields, push_constants, defines


FROM_BELOW = "lake_under"
"""The technique of the surface seen from under water, whatever the one from the air is."""

DEPTHS = ("refraction_depth", "reflection_depth")
"""Samplers of distances. The hits pass always has them."""


@dataclass(frozen=True, eq=False)
class NearSide:
    """Where each pixel of a picture begins. near_plane: block of that name; heights: the surface's map
    where the pixels differ, None where all of them begin on one side."""

    near_plane: GPUUniformBuf
    heights: GPUTexture | None


@dataclass(frozen=True, eq=False)
class SurfaceLook:
    """How the surface is drawn. technique: from the air; own: block of the settings that only it has, maps:
    its images by sampler; view_transform: table and range of `core/view_transform.py`, to draw in display
    colours; near_side: where the picture may begin in this body; from_below: seen from the water, exact: by
    the exact equations. exact_fresnel: Fresnel's equations from the air, too. follows_refractions: refracted
    rays are followed, by choice; follows_reflections: reflected ones, and there are distances in that
    texture; from below both or none. hit_number: of the body, for the hits pass (see `passes/hits.py`),
    where all textures have distances; 0 for a picture.
    """

    technique: str
    own: GPUUniformBuf | None = None
    maps: Mapping[str, GPUTexture] = MappingProxyType({})
    view_transform: ViewTransform | None = None
    near_side: NearSide | None = None
    from_below: bool = False
    exact: bool = False
    exact_fresnel: bool = False
    follows_refractions: bool = False
    follows_reflections: bool = False
    hit_number: int = 0

    @property
    def split(self) -> bool:
        """Whether only some pixels begin on the side that is drawn."""
        return self.near_side is not None and self.near_side.heights is not None


def water_spec(look: SurfaceLook, *, grid: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    surface, push_constants, defines = surface_interface(grid)
    technique = FROM_BELOW if look.from_below else look.technique.lower()
    defines["TECHNIQUE"] = f'"technique_{technique}_lib.glsl"'
    samplers = [
        ("FLOAT_2D", "sky_image"),
        ("FLOAT_2D", "refraction_color"),
        ("FLOAT_2D", "reflection_color"),
    ]
    uniform_buffers = [("Lights", "lights"), ("View", "pass_view"), ("Water", "water")]
    if look.from_below:
        defines["FROM_BELOW"] = ""
        if look.exact:
            defines["EXACT"] = ""
        if look.follows_reflections:
            defines["FOLLOW"] = ""
            samplers += [("FLOAT_2D", name) for name in DEPTHS]
    else:
        samplers.append(("FLOAT_2D", "refraction_depth"))
        chosen = TECHNIQUES[look.technique]
        if look.follows_refractions:
            defines["TRACE_REFRACTIONS"] = ""
        if look.follows_reflections:
            defines["TRACE_REFLECTIONS"] = ""
            samplers.append(("FLOAT_2D", "reflection_depth"))
        if look.exact_fresnel:
            defines["EXACT_FRESNEL"] = ""
        if chosen.settings is not None:
            uniform_buffers.append(("Technique", "technique"))
            samplers += [("FLOAT_2D", name) for name in chosen.settings.maps]
    outputs = [("VEC4", "out_color")]
    if look.hit_number:
        defines["HITS"] = ""
        outputs += [("VEC4", name) for name in ("out_surface", "out_refracted", "out_reflected")]
        given = {name for _, name in samplers}
        samplers += [("FLOAT_2D", name) for name in DEPTHS if name not in given]
        push_constants.append(("FLOAT", "body_number"))
    if look.split:
        defines["SPLIT"] = ""
        samplers.append(("FLOAT_2D", "surface_heights"))
        uniform_buffers.append(("NearPlane", "near_plane"))
        surface["varyings"] = (*surface["varyings"], ("VEC4", "v_clip"))
    if look.view_transform is not None:
        defines["DISPLAY_REFERRED"] = ""
        samplers.append(("FLOAT_3D", "view_transform_table"))
        push_constants.append(("VEC2", "view_transform_range"))
    spec = ShaderSpec(
        name="water",
        fragment="water_frag.glsl",
        **surface,
        outputs=tuple(outputs),
        uniform_buffers=tuple(uniform_buffers),
        samplers=tuple(samplers),
        push_constants=tuple(push_constants),
    )
    return spec, defines


class WaterPainter:
    """Draws one body of water into whatever framebuffer is bound."""

    def __init__(self, resources: Resources, library: ShaderLibrary, scene: SceneBuffers) -> None:
        self._resources = resources
        self._library = library
        self._scene = scene
        self._grids: OrderedDict[int, GPUBatch] = OrderedDict()

    def draw(
        self,
        look: SurfaceLook,
        body: BodyPlan,
        origin: np.ndarray,
        lights: GPUUniformBuf,
        view: GPUUniformBuf,
        water: GPUUniformBuf,
        refraction: Target,
        reflection: Target,
    ) -> None:
        """water, refraction, reflection: the cameras and textures of the side that the look is from."""
        spec, defines = water_spec(look, grid=body.body.grid is not None)
        shader = self._library.get(spec, defines)
        with opaque_state():
            shader.bind()
            shader.uniform_block("lights", lights)
            shader.uniform_block("pass_view", view)
            shader.uniform_block("water", water)
            shader.uniform_sampler("sky_image", self._scene.sky_image)
            shader.uniform_sampler("refraction_color", refraction.colors[0])
            shader.uniform_sampler("reflection_color", reflection.colors[0])
            names = {name for _, name in spec.samplers}
            for name, looked_up in zip(DEPTHS, (refraction, reflection), strict=True):
                if name in names:
                    shader.uniform_sampler(name, looked_up.colors[1])
            if not look.from_below:
                chosen = TECHNIQUES[look.technique]
                if chosen.settings is not None:
                    shader.uniform_block("technique", look.own)
                    for name, texture in look.maps.items():
                        shader.uniform_sampler(name, texture)
            if look.hit_number:
                shader.uniform_float("body_number", look.hit_number)
            if look.split:
                shader.uniform_block("near_plane", look.near_side.near_plane)
                shader.uniform_sampler("surface_heights", look.near_side.heights)
            if look.view_transform is not None:
                shader.uniform_sampler("view_transform_table", look.view_transform[0])
                shader.uniform_float("view_transform_range", look.view_transform[1])
            self.draw_surface(shader, body, origin)

    def draw_surface(
        self, shader: GPUShader, body: BodyPlan, origin: np.ndarray, *, heights_only: bool = False
    ) -> None:
        """The body's triangles with a bound shader made with `surface_interface`. origin: of render space."""
        if body.body.grid is not None:
            self._grid(body.body.grid[0]).draw(shader)
            return
        matrix = rebase(body.body.matrix, origin)
        shader.uniform_float("object_matrix", matrix.T.ravel().tolist())
        if not heights_only:
            # The cofactors and not the inverse, which a scale of 0 does not have; as in scene_vert.glsl.
            a, b, c = matrix[:3, :3]
            normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
            shader.uniform_float("normal_matrix", normals.T.ravel().tolist())
        for batch in self._scene.parts_of(body.body.mesh):
            batch.draw(shader)

    def _grid(self, resolution: int) -> GPUBatch:
        """The unit square with resolution x resolution vertices."""
        if resolution not in self._grids:
            line = np.linspace(0.0, 1.0, resolution, dtype=np.float32)
            y, x = np.meshgrid(line, line, indexing="ij")
            vertices = self._resources.vertex_buffer({"cell": np.stack([x.ravel(), y.ravel()], axis=1)})
            corner = (np.arange(resolution - 1)[:, None] * resolution + np.arange(resolution - 1)).ravel()
            lower = np.stack([corner, corner + 1, corner + resolution + 1], axis=1)
            upper = np.stack([corner, corner + resolution + 1, corner + resolution], axis=1)
            self._grids[resolution] = self._resources.batch(vertices, np.concatenate([lower, upper]))
            while len(self._grids) > MAX_GRIDS:
                self._grids.popitem(last=False)
        self._grids.move_to_end(resolution)
        return self._grids[resolution]
