# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a planned frame on the GPU: textures, then the scene, then the water over it."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import gpu
from gpu.types import GPUFrameBuffer, GPUTexture, GPUUniformBuf

from ..core.plan import FramePlan
from . import uniforms
from .passes import textures
from .passes.accumulate import SampleMean
from .passes.geometry import GeometryPainter
from .passes.water import WaterPainter
from .resources import Resources
from .scene_buffers import SceneBuffers
from .shader_library import ShaderLibrary
from .targets import Target, Targets
from .uniforms import UniformBlock


class PassTimer:
    """Seconds of each pass. When `enabled` it waits for the GPU after each, which itself costs time."""

    def __init__(self, enabled: bool = False) -> None:
        self.enabled = enabled
        self.seconds: dict[str, float] = {}

    @contextmanager
    def measure(self, name: str, target: GPUFrameBuffer | None) -> Iterator[None]:
        """target: what the pass draws into; reading one pixel of it waits until it is drawn."""
        start = time.perf_counter()
        yield
        if self.enabled and target is not None:
            with target.bind():
                target.read_color(0, 0, 1, 1, 4, 0, "FLOAT")
        self.seconds[name] = self.seconds.get(name, 0.0) + time.perf_counter() - start


class FrameRenderer:
    """Everything that one graphics context keeps from frame to frame.

    Framebuffers belong to the context they were made in, so each host has a renderer of its own.
    """

    def __init__(self) -> None:
        self.resources = Resources()
        self.library = ShaderLibrary(self.resources)
        self.targets = Targets(self.resources)
        self.scene = SceneBuffers(self.resources)
        self._geometry = GeometryPainter(self.resources, self.library, self.scene)
        self._water = WaterPainter(self.resources, self.library, self.scene)
        self.mean = SampleMean(self.resources, self.library)
        self._blocks: dict[tuple, UniformBlock] = {}
        self._bodies = 0

    def _block(self, *key) -> UniformBlock:
        if key not in self._blocks:
            self._blocks[key] = UniformBlock(self.resources)
        return self._blocks[key]

    def upload(self, plan: FramePlan) -> GPUUniformBuf:
        """Bring the GPU's copy of the scene up to date; returns the lights' buffer."""
        self.scene.update(plan.snapshot, plan.origin)
        bodies = len(plan.snapshot.waters)
        for gone in range(bodies, self._bodies):
            textures.free_targets(self.targets, gone)
        self._bodies = bodies
        return self._block("lights").update(*uniforms.lights(plan))

    def draw_textures(self, plan: FramePlan, timer: PassTimer) -> None:
        """The refraction and reflection textures of each water body that is in the picture."""
        lights = self.upload(plan)
        for i, body in enumerate(plan.bodies):
            if not body.drawn:
                continue
            water = self._block("water", i).update(*uniforms.water(plan, body))
            target = textures.refraction_target(self.targets, i, plan.settings.texture_size)
            view = self._block("refraction", i).update(*uniforms.texture_view(body.refraction))
            with timer.measure("refraction", target.framebuffer):
                textures.draw_refraction(self._geometry, body.refraction, target, lights, view, water)
            target = textures.reflection_target(self.targets, i, plan.settings.texture_size)
            view = self._block("reflection", i).update(*uniforms.texture_view(body.reflection))
            with timer.measure("reflection", target.framebuffer):
                textures.draw_reflection(self._geometry, body.reflection, target, lights, view, water)

    def draw_depth(self, plan: FramePlan, timer: PassTimer, framebuffer: GPUFrameBuffer) -> None:
        """The depth of the dry scene alone into the bound framebuffer, in place of what it holds."""
        lights = self.upload(plan)
        view = self._block("view").update(*uniforms.view(plan.camera.view, plan.camera.projection))
        with timer.measure("depth", framebuffer):
            framebuffer.clear(depth=1.0)
            gpu.state.color_mask_set(False, False, False, False)
            try:
                self._geometry.draw_scene(lights, view)
            finally:
                gpu.state.color_mask_set(True, True, True, True)

    def draw_water(
        self,
        plan: FramePlan,
        timer: PassTimer,
        framebuffer: GPUFrameBuffer | None,
        view_transform: tuple[GPUTexture, tuple[float, float]] | None = None,
    ) -> None:
        """The water surfaces, into the bound framebuffer, after `draw_textures` of the same plan."""
        lights = self.upload(plan)
        view = self._block("view").update(*uniforms.view(plan.camera.view, plan.camera.projection))
        with timer.measure("water", framebuffer):
            for i, body in enumerate(plan.bodies):
                if not body.drawn:
                    continue
                water = self._block("water", i).update(*uniforms.water(plan, body))
                self._water.draw(
                    body,
                    plan.origin,
                    plan.settings.technique,
                    lights,
                    view,
                    water,
                    textures.refraction_target(self.targets, i, plan.settings.texture_size),
                    textures.reflection_target(self.targets, i, plan.settings.texture_size),
                    view_transform,
                )

    def draw_picture(
        self, plan: FramePlan, target: Target, timer: PassTimer, *, transparent: bool = False
    ) -> None:
        """The whole picture into `target`, scene-linear. transparent: leave the sky out, alpha 0."""
        self.draw_textures(plan, timer)
        lights = self.upload(plan)
        with target.framebuffer.bind():
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            view = self._block("view").update(*uniforms.view(plan.camera.view, plan.camera.projection))
            with timer.measure("scene", target.framebuffer):
                self._geometry.draw_scene(lights, view)
                if not transparent:
                    self._geometry.draw_sky(lights, view)
            self.draw_water(plan, timer, target.framebuffer)
