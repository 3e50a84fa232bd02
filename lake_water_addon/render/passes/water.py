# SPDX-License-Identifier: GPL-3.0-or-later
"""The water surface itself, over the scene that is already drawn."""

from __future__ import annotations

from collections import OrderedDict

import numpy as np
from gpu.types import GPUBatch, GPUShader, GPUTexture, GPUUniformBuf

from ...core.plan import BodyPlan, rebase
from ..resources import Resources
from ..scene_buffers import SceneBuffers
from ..shader_library import ShaderLibrary, ShaderSpec
from ..targets import Target
from .geometry import opaque_state

MAX_GRIDS = 4
"""Grids of different resolution that are kept on the GPU."""


def surface_interface(grid: bool) -> tuple[dict, list[tuple[str, str]], dict[str, str]]:
    """What `water_vert.glsl` takes of a grid or a mesh: fields of a ShaderSpec, push constants and defines.

    It also takes the uniform blocks `pass_view` and `water`.
    """
    fields = {
        "vertex": "water_vert.glsl",
        "vertex_in": (("VEC2", "cell"),) if grid else (("VEC3", "position"), ("VEC3", "normal")),
        "varyings": (("VEC3", "v_position"), ("VEC2", "v_slope")),
    }
    push_constants = [] if grid else [("MAT4", "object_matrix"), ("MAT3", "normal_matrix")]
    return fields, push_constants, {"GRID" if grid else "MESH": ""}


def water_spec(*, grid: bool, technique: str, display_referred: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    surface, push_constants, defines = surface_interface(grid)
    defines["TECHNIQUE"] = f'"technique_{technique.lower()}_lib.glsl"'
    samplers = [
        ("FLOAT_2D", "sky_image"),
        ("FLOAT_2D", "refraction_color"),
        ("FLOAT_2D", "refraction_depth"),
        ("FLOAT_2D", "reflection_color"),
    ]
    if display_referred:
        defines["DISPLAY_REFERRED"] = ""
        samplers.append(("FLOAT_3D", "view_transform_table"))
        push_constants.append(("VEC2", "view_transform_range"))
    spec = ShaderSpec(
        name="water",
        fragment="water_frag.glsl",
        **surface,
        uniform_buffers=(("Lights", "lights"), ("View", "pass_view"), ("Water", "water")),
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
        body: BodyPlan,
        origin: np.ndarray,
        technique: str,
        lights: GPUUniformBuf,
        view: GPUUniformBuf,
        water: GPUUniformBuf,
        refraction: Target,
        reflection: Target,
        view_transform: tuple[GPUTexture, tuple[float, float]] | None = None,
    ) -> None:
        """view_transform: table and range of `core/view_transform.py`, to draw in display colours."""
        spec, defines = water_spec(
            grid=body.body.grid is not None,
            technique=technique,
            display_referred=view_transform is not None,
        )
        shader = self._library.get(spec, defines)
        with opaque_state():
            shader.bind()
            shader.uniform_block("lights", lights)
            shader.uniform_block("pass_view", view)
            shader.uniform_block("water", water)
            shader.uniform_sampler("sky_image", self._scene.sky_image)
            shader.uniform_sampler("refraction_color", refraction.colors[0])
            shader.uniform_sampler("refraction_depth", refraction.colors[1])
            shader.uniform_sampler("reflection_color", reflection.colors[0])
            if view_transform is not None:
                shader.uniform_sampler("view_transform_table", view_transform[0])
                shader.uniform_float("view_transform_range", view_transform[1])
            self.draw_surface(shader, body, origin)

    def draw_surface(self, shader: GPUShader, body: BodyPlan, origin: np.ndarray) -> None:
        """The body's triangles with a bound shader made with `surface_interface`. origin: of render space."""
        if body.body.grid is not None:
            self._grid(body.body.grid[0]).draw(shader)
            return
        matrix = rebase(body.body.matrix, origin)
        # The cofactors and not the inverse, which a scale of 0 does not have; as in scene_vert.glsl.
        a, b, c = matrix[:3, :3]
        normals = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
        shader.uniform_float("object_matrix", matrix.T.ravel().tolist())
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
