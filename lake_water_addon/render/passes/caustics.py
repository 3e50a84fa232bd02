# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons of sunlight through the waves, summed to caustics on what lies below: three ways, one result."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import gpu
import numpy as np
from gpu.types import GPUBatch, GPUTexture, GPUUniformBuf

from ...core import caustics
from ...core.plan import BodyPlan, FramePlan
from ...core.settings import CAUSTICS_METHODS
from ..resources import Resources
from ..shader_library import ShaderLibrary, ShaderSpec
from ..targets import Target, Targets
from .geometry import opaque_state
from .water import WaterPainter, surface_interface

if TYPE_CHECKING:
    from ..frame import PassTimer

GROUP = 8
"""Photons a side that a work group adds."""

TILE = 16
"""Photons a side of a tile in which there is a shore or not."""

LARGEST_POINT = 60
"""Pixels a side of a point: every graphics device draws one of 63."""

MAPS = (("FLOAT_2D", "photon_map"), ("FLOAT_2D", "spread_map"))

SUM = ShaderSpec(
    name="caustics_sum",
    compute="caustics_sum_comp.glsl",
    group=(GROUP, GROUP),
    samplers=MAPS,
    images=(("R32UI", "UINT_2D", "counters"),),
)

SHORE = ShaderSpec(
    name="caustics_shore",
    vertex="background_vert.glsl",
    fragment="caustics_shore_frag.glsl",
    vertex_in=(("VEC2", "position"),),
    varyings=(("VEC2", "v_ndc"),),
    outputs=(("FLOAT", "out_part"),),
    samplers=MAPS[1:],
    push_constants=(("INT", "margin"),),
)

POINTS = ShaderSpec(
    name="caustics_points",
    vertex="caustics_points_vert.glsl",
    fragment="caustics_points_frag.glsl",
    vertex_in=(("FLOAT", "column"),),
    varyings=(("VEC2", "v_center"), ("VEC2", "v_half_width"), ("VEC2", "v_first"), ("FLOAT", "v_light")),
    outputs=(("FLOAT", "out_sum"),),
    samplers=MAPS,
    push_constants=(("FLOAT", "size"), ("INT", "parts")),
)


def photon_spec(*, grid: bool, shadows: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    surface, push_constants, defines = surface_interface(grid)
    defines["PHOTONS"] = ""
    samplers = [("FLOAT_2D", "light_depth")]
    if shadows:
        defines["SHADOWS"] = ""
        samplers.append(("FLOAT_2D", "shadow_depth"))
    surface["varyings"] = (*surface["varyings"], ("VEC2", "v_launch"))
    spec = ShaderSpec(
        name="photons",
        fragment="photon_frag.glsl",
        **surface,
        outputs=(("VEC4", "out_photon"), ("VEC2", "out_spread")),
        uniform_buffers=(("Lights", "lights"), ("Water", "water"), ("WaterLight", "water_light")),
        samplers=tuple(samplers),
        push_constants=tuple(push_constants),
    )
    return spec, defines


def resolve_spec(*, counters: bool) -> tuple[ShaderSpec, dict[str, str]]:
    """The variant's interface and defines."""
    defines = {"TILE": str(TILE)}
    sums = ("FLOAT_2D", "sums")
    if counters:
        defines["COUNTERS"] = ""
        sums = ("UINT_2D", "counters")
    spec = ShaderSpec(
        name="caustics_resolve",
        vertex="background_vert.glsl",
        fragment="caustics_resolve_frag.glsl",
        vertex_in=(("VEC2", "position"),),
        varyings=(("VEC2", "v_ndc"),),
        outputs=(("FLOAT", "out_value"),),
        samplers=(sums, MAPS[1], ("FLOAT_2D", "shore")),
    )
    return spec, defines


@dataclass(frozen=True)
class ChosenMethod:
    """How photons are summed. name: a key of `CAUSTICS_METHODS`, never AUTO; reason: for a person."""

    name: str
    reason: str


def chosen_method(wanted: str) -> ChosenMethod:
    """What a setting comes to on this machine. Raises ValueError for one that is no method."""
    if wanted not in CAUSTICS_METHODS:
        raise ValueError(f"{wanted} is no way to sum caustics: use one of {', '.join(CAUSTICS_METHODS)}")
    backend = gpu.platform.backend_type_get()
    # Metal has them for textures of a kind that Blender gives to no script.
    has_atomics = backend != "METAL"
    if wanted == "AUTO":
        name = "GPU_COMPUTE" if has_atomics else "GPU_POINTS"
        return ChosenMethod(name, f"{CAUSTICS_METHODS[name]}, the fastest on this machine")
    if wanted == "GPU_COMPUTE" and not has_atomics:
        name = CAUSTICS_METHODS["GPU_POINTS"]
        return ChosenMethod(
            "GPU_POINTS", f"{name}: {CAUSTICS_METHODS[wanted]} cannot run on {backend.title()}"
        )
    return ChosenMethod(wanted, f"{CAUSTICS_METHODS[wanted]}, as set")


class CausticsPainter:
    """Draws the caustics of one body of water after the other, each into a texture of its own."""

    def __init__(
        self, resources: Resources, library: ShaderLibrary, targets: Targets, water: WaterPainter
    ) -> None:
        self._resources = resources
        self._library = library
        self._targets = targets
        self._water = water
        self._columns: tuple[int, GPUBatch] | None = None

    def draw(
        self,
        i: int,
        plan: FramePlan,
        body: BodyPlan,
        lights: GPUUniformBuf,
        water: GPUUniformBuf,
        water_light: GPUUniformBuf,
        light_depth: GPUTexture,
        shadow_depth: GPUTexture | None,
        timer: PassTimer,
    ) -> GPUTexture:
        """Light through the water of body number `i`, relative to the sun's on the water plane; filtered.

        It is a picture by the body's light camera. light_depth: that camera's; shadow_depth: of the cameras
        along the sun, or None for water that all the sun reaches.
        """
        settings = plan.settings
        photons = self.photon_target(settings.photon_size)
        with timer.measure("photons", photons.framebuffer):
            blocks = (lights, water, water_light)
            self.draw_photons(photons, body, plan.origin, blocks, light_depth, shadow_depth)
        target = self.target(i, settings.caustics_size)
        with timer.measure("caustics", target.framebuffer):
            self.sum_photons(photons, target, chosen_method(settings.caustics_method).name)
        return target.colors[0]

    def photon_target(self, photons: int) -> Target:
        """colors: landing x, y, light and 1 where it landed; how far its light is spread, 0 without water."""
        return self._targets.get(("photons",), (photons, photons), ("RGBA32F", "RG32F"))

    def target(self, i: int, texels: int) -> Target:
        """colors: the caustics of body number `i`."""
        size = (texels, texels)
        return self._targets.get(("caustics", i), size, ("R16F",), depth=False, filtered=(True,))

    def free(self, i: int) -> None:
        """Free the texture of a water body that is gone."""
        self._targets.discard(("caustics", i))

    def draw_photons(
        self,
        target: Target,
        body: BodyPlan,
        origin: np.ndarray,
        blocks: Sequence[GPUUniformBuf],
        light_depth: GPUTexture,
        shadow_depth: GPUTexture | None,
    ) -> None:
        """The body's surface into a `photon_target`. blocks: lights, water, water_light."""
        spec, defines = photon_spec(grid=body.body.grid is not None, shadows=shadow_depth is not None)
        shader = self._library.get(spec, defines)
        with target.framebuffer.bind():
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            with opaque_state():
                shader.bind()
                for (_, name), block in zip(spec.uniform_buffers, blocks, strict=True):
                    shader.uniform_block(name, block)
                shader.uniform_sampler("light_depth", light_depth)
                if shadow_depth is not None:
                    shader.uniform_sampler("shadow_depth", shadow_depth)
                self._water.draw_surface(shader, body, origin)

    def sum_photons(self, photons: Target, target: Target, method: str) -> None:
        """The caustics of a photon map into `target`. method: as `ChosenMethod` has it."""
        texels = target.size[0]
        shore = self._draw_shore(photons, texels)
        sums = self.light_sums(photons, texels, method)
        spec, defines = resolve_spec(counters=method == "GPU_COMPUTE")
        shader = self._library.get(spec, defines)
        with target.framebuffer.bind(), _whole_target():
            shader.bind()
            shader.uniform_sampler(spec.samplers[0][1], sums)
            shader.uniform_sampler("spread_map", photons.colors[1])
            shader.uniform_sampler("shore", shore)
            self._resources.covering_triangle().draw(shader)

    def _draw_shore(self, photons: Target, texels: int) -> GPUTexture:
        """Where there are photons that are launched from water and others close to each other."""
        tiles = -(-photons.size[0] // TILE)
        target = self._targets.get(("caustics shore",), (tiles, tiles), ("R8",), depth=False)
        shader = self._library.get(SHORE, {"TILE": str(TILE)})
        with target.framebuffer.bind(), _whole_target():
            shader.bind()
            shader.uniform_sampler("spread_map", photons.colors[1])
            shader.uniform_int("margin", caustics.shore_margin(texels / photons.size[0]))
            self._resources.covering_triangle().draw(shader)
        return target.colors[0]

    def light_sums(self, photons: Target, texels: int, method: str) -> GPUTexture:
        """Sums of a photon map's light, (texels, texels).

        GPU_COMPUTE: integers, two such squares one above the other, as its shader says.
        """
        if method == "GPU_COMPUTE":
            return self._count(photons, texels)
        if method == "GPU_POINTS":
            return self._draw_points(photons, texels)
        return self._add_on_processor(photons, texels)

    def _count(self, photons: Target, texels: int) -> GPUTexture:
        counters = self._targets.get(("caustics counters",), (texels, 2 * texels), ("R32UI",), depth=False)
        counters.colors[0].clear(format="UINT", value=(0,))
        shader = self._library.get(SUM)
        shader.bind()
        shader.uniform_sampler("photon_map", photons.colors[0])
        shader.uniform_sampler("spread_map", photons.colors[1])
        shader.image("counters", counters.colors[0])
        groups = -(-photons.size[0] // GROUP)
        gpu.compute.dispatch(shader, groups, groups, 1)
        return counters.colors[0]

    def _draw_points(self, photons: Target, texels: int) -> GPUTexture:
        """Sums by blending, each photon a point as large as its light is spread."""
        count = photons.size[0]
        if self._columns is None or self._columns[0] != count:
            columns = np.arange(count, dtype=np.float32)[:, None]
            self._columns = count, self._resources.points(self._resources.vertex_buffer({"column": columns}))
        sums = self._targets.get(("caustics sums",), (texels, texels), ("R32F",), depth=False)
        widest = 2.0 * max(caustics.MAX_SPREAD, texels / count) + 2.0
        parts = math.ceil(widest / LARGEST_POINT)
        shader = self._library.get(POINTS, {"LARGEST_POINT": f"{LARGEST_POINT}.0"})
        with sums.framebuffer.bind(), _whole_target():
            sums.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0))
            gpu.state.blend_set("ADDITIVE_PREMULT")
            gpu.state.program_point_size_set(True)
            try:
                shader.bind()
                shader.uniform_sampler("photon_map", photons.colors[0])
                shader.uniform_sampler("spread_map", photons.colors[1])
                shader.uniform_float("size", texels)
                shader.uniform_int("parts", parts)
                self._columns[1].draw_instanced(shader, instance_count=count * parts * parts)
            finally:
                gpu.state.program_point_size_set(False)
        return sums.colors[0]

    def _add_on_processor(self, photons: Target, texels: int) -> GPUTexture:
        """Sums by numpy. A texture cannot be written to from here: each sum makes a new one."""
        count = photons.size[0]
        maps = [np.asarray(texture.read()).reshape(count, count, -1) for texture in photons.colors]
        sums = caustics.sum_photons(*maps, texels)
        return self._resources.texture((texels, texels), "R32F", sums)


@contextmanager
def _whole_target() -> Iterator[None]:
    """Every pixel is drawn, whatever the depth; afterwards everything as Blender expects it."""
    with opaque_state():
        gpu.state.depth_test_set("NONE")
        gpu.state.depth_mask_set(False)
        yield
