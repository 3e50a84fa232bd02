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
from .passes import light, textures
from .passes.accumulate import SampleMean
from .passes.geometry import GeometryPainter, SceneLook, SunInWater
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
        self._drawn: dict[tuple, tuple] = {}  # what the textures of the sun's light were drawn from
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
            light.free_targets(self.targets, gone)
            self._drawn.pop(("light depth", gone), None)
        self._bodies = bodies
        return self._block("lights").update(*uniforms.lights(plan))

    def _is_new(self, key: tuple, state: tuple) -> bool:
        """Whether the texture `key` has to be drawn, because it shows another state."""
        if self._drawn.get(key) == state:
            return False
        self._drawn[key] = state
        return True

    def draw_shadow(self, plan: FramePlan, timer: PassTimer) -> GPUTexture | None:
        """The depth texture of the cameras along the sun; a window is drawn when it, sun or scene changed."""
        if not plan.shadows:
            return None
        target = light.shadow_target(self.targets, plan.settings.light_depth_size)
        below = min((body.refraction.clear_height for body in plan.bodies), default=None)
        for i, camera in enumerate(plan.shadows):
            if self._is_new(("shadow", i), (camera.key, plan.snapshot.version, target)):
                view = self._block("shadow", i).update(*uniforms.view(camera.view, camera.projection))
                with timer.measure("shadow depth", target.framebuffer):
                    light.draw_shadow(self._geometry, target, i, view, below)
        return target.colors[0]

    def draw_light_depth(self, i: int, plan: FramePlan, timer: PassTimer) -> GPUTexture | None:
        """The depth texture of the camera along the sunlight in body `i`, drawn when something changed."""
        planned = plan.bodies[i].light
        if planned is None:
            return None
        camera = planned.camera
        target = light.light_depth_target(self.targets, i, camera.resolution)
        state = (camera.key, planned.clip_height, plan.snapshot.version, target)
        if self._is_new(("light depth", i), state):
            view = self._block("light depth", i).update(
                *uniforms.view(camera.view, camera.projection, +1, planned.clip_height)
            )
            with timer.measure("light depth", target.framebuffer):
                light.draw_light_depth(self._geometry, planned, target, view)
        return target.colors[0]

    def sun_in_water(
        self, i: int, plan: FramePlan, timer: PassTimer, shadow_depth: GPUTexture | None
    ) -> SunInWater:
        """What lights the things under the water of body `i`."""
        body = plan.bodies[i]
        return SunInWater(
            self._block("water", i).update(*uniforms.water(plan, body)),
            self._block("water light", i).update(*uniforms.water_light(plan, body)),
            self.draw_light_depth(i, plan, timer),
            None,
        )

    def draw_textures(self, plan: FramePlan, timer: PassTimer) -> SceneLook:
        """The textures of each water body that is in the picture, and those of the sun's light before.

        Returns how the dry scene is lit.
        """
        lights = self.upload(plan)
        in_air = SceneLook(lights, self.draw_shadow(plan, timer))
        for i, body in enumerate(plan.bodies):
            if not body.drawn:
                continue
            sun = self.sun_in_water(i, plan, timer, in_air.shadow_depth)
            # Without sunlight in the water there is nothing to shade there.
            in_water = SceneLook(lights, in_air.shadow_depth if body.light else None, sun)
            water = sun.water
            target = textures.refraction_target(self.targets, i, plan.settings.texture_size)
            view = self._block("refraction", i).update(*uniforms.texture_view(body.refraction))
            with timer.measure("refraction", target.framebuffer):
                textures.draw_refraction(self._geometry, body.refraction, target, in_water, view, water)
            target = textures.reflection_target(self.targets, i, plan.settings.texture_size)
            view = self._block("reflection", i).update(*uniforms.texture_view(body.reflection))
            with timer.measure("reflection", target.framebuffer):
                textures.draw_reflection(self._geometry, body.reflection, target, in_air, view, water)
        return in_air

    def draw_depth(self, plan: FramePlan, timer: PassTimer, framebuffer: GPUFrameBuffer) -> None:
        """The depth of the dry scene alone into the bound framebuffer, in place of what it holds."""
        self.upload(plan)
        view = self._block("view").update(*uniforms.view(plan.camera.view, plan.camera.projection))
        with timer.measure("depth", framebuffer):
            framebuffer.clear(depth=1.0)
            gpu.state.color_mask_set(False, False, False, False)
            try:
                self._geometry.draw_depths(view, cull_back_faces=True)
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
        look = self.draw_textures(plan, timer)
        with target.framebuffer.bind():
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            view = self._block("view").update(*uniforms.view(plan.camera.view, plan.camera.projection))
            with timer.measure("scene", target.framebuffer):
                self._geometry.draw_scene(look, view)
                if not transparent:
                    self._geometry.draw_sky(look.lights, view)
            self.draw_water(plan, timer, target.framebuffer)
