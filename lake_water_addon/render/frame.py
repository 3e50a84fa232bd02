# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs a planned frame on the GPU: textures, then the scene, then the water over it."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from weakref import WeakValueDictionary

import gpu
import numpy as np
from gpu.types import GPUFrameBuffer, GPUTexture, GPUUniformBuf

from ..core.plan import FramePlan
from ..core.under_water import Side, meniscus_width
from . import uniforms
from .map_textures import MapTextures
from .passes import hits, light, textures
from .passes.accumulate import SampleMean
from .passes.caustics import CausticsPainter
from .passes.fog import FogPainter, heights_target
from .passes.geometry import GeometryPainter, SceneLook, SunInWater
from .passes.glow import GlowPainter
from .passes.water import NearSide, SurfaceLook, ViewTransform, WaterPainter
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
        self._fog = FogPainter(self.resources, self.library)
        self._caustics = CausticsPainter(self.resources, self.library, self.targets, self._water)
        self._glow = GlowPainter(self.resources, self.library, self.targets, self._water)
        self._maps = MapTextures(self.resources)
        self.mean = SampleMean(self.resources, self.library)
        self._blocks: dict[tuple, UniformBlock] = {}
        self._filled_for: WeakValueDictionary[tuple, FramePlan] = WeakValueDictionary()
        self._drawn: dict[tuple, tuple] = {}  # what the textures of the sun's light were drawn from
        self._bodies = 0

    def _block(self, *key) -> UniformBlock:
        if key not in self._blocks:
            self._blocks[key] = UniformBlock(self.resources)
        return self._blocks[key]

    def _filled(
        self, plan: FramePlan, key: tuple, members: Callable[[], Sequence[np.ndarray]]
    ) -> GPUUniformBuf:
        """The block `key`, which a plan fills once, however many passes use it."""
        if self._filled_for.get(key) is not plan:
            self._block(*key).update(*members())
            self._filled_for[key] = plan
        return self._block(*key).buffer

    def _view(self, plan: FramePlan) -> GPUUniformBuf:
        camera = plan.camera
        return self._filled(
            plan, ("view",), lambda: uniforms.view(camera.view, camera.projection, lod_bias=plan.lod_bias)
        )

    def _water_of(self, plan: FramePlan, i: int) -> GPUUniformBuf:
        """Body `i` with the cameras of what is looked up from the air."""
        return self._filled(plan, ("water", i), lambda: uniforms.water(plan, plan.bodies[i]))

    def upload(self, plan: FramePlan) -> GPUUniformBuf:
        """Bring the GPU's copy of the scene up to date; returns the lights' buffer."""
        self.scene.update(plan.snapshot, plan.origin)
        bodies = len(plan.snapshot.waters)
        for gone in range(bodies, self._bodies):
            textures.free_targets(self.targets, gone)
            hits.free_targets(self.targets, gone)
            self.targets.discard(("surface heights", gone))
            light.free_targets(self.targets, gone)
            self._caustics.free(gone)
            for kind in ("light depth", "caustics"):
                self._drawn.pop((kind, gone), None)
        self._bodies = bodies
        return self._filled(plan, ("lights",), lambda: uniforms.lights(plan))

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
        for i, camera in enumerate(plan.shadows):
            if self._is_new(("shadow", i), (camera.key, plan.snapshot.version, target)):
                view = self._block("shadow", i).update(*uniforms.view(camera.view, camera.projection))
                with timer.measure("shadow depth", target.framebuffer):
                    light.draw_shadow(self._geometry, target, i, view)
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
        water = self._water_of(plan, i)
        water_light = self._block("water light", i).update(*uniforms.water_light(plan, body))
        light_depth = self.draw_light_depth(i, plan, timer)
        caustics = None
        if light_depth is not None and plan.settings.use_caustics:
            caustics = self._caustics.target(i, plan.settings.caustics_size)
            # They move with the waves; the samples of one picture share them.
            state = (
                caustics,
                body.light.camera.key,
                tuple(camera.key for camera in plan.shadows),
                plan.snapshot.version,
                body.packed_waves.tobytes(),
                plan.settings,
            )
            if self._is_new(("caustics", i), state):
                lights = self._block("lights").buffer
                self._caustics.draw(
                    i, plan, body, lights, water, water_light, light_depth, shadow_depth, timer
                )
        return SunInWater(water, water_light, light_depth, caustics.colors[0] if caustics else None)

    def caustics_texture(self, i: int, size: int) -> GPUTexture:
        """The sunlight in the water of body `i` as it was drawn last, `size` texels a side."""
        return self._caustics.target(i, size).colors[0]

    def draw_textures(self, plan: FramePlan, timer: PassTimer) -> tuple[SceneLook, SceneLook | None]:
        """The textures of each water body that is in the picture, and those of the sun's light before.

        Returns how the scene is lit in the air, and in the water that the picture begins in.
        """
        lights = self.upload(plan)
        in_air = SceneLook(lights, self.draw_shadow(plan, timer))
        around_the_eye = None
        for i, body in enumerate(plan.bodies):
            if not body.drawn and body.under is None:
                continue
            sun = self.sun_in_water(i, plan, timer, in_air.shadow_depth)
            # Without sunlight in the water there is nothing to shade there.
            in_water = SceneLook(lights, in_air.shadow_depth if body.light else None, sun)
            if body.refraction.drawn:
                self._draw_textures_from_above(i, plan, timer, in_air, in_water)
            if body.under is not None:
                around_the_eye = in_water
                self._draw_textures_from_below(i, plan, timer, in_air, in_water)
        return in_air, around_the_eye

    def _draw_textures_from_above(
        self, i: int, plan: FramePlan, timer: PassTimer, in_air: SceneLook, in_water: SceneLook
    ) -> None:
        body, water = plan.bodies[i], in_water.sun_in_water.water
        target = textures.refraction_target(self.targets, i, plan.settings.texture_size)
        view = self._block("refraction", i).update(*uniforms.texture_view(body.refraction, plan))
        with timer.measure("refraction", target.framebuffer):
            if body.refraction.keep:
                textures.draw_refraction(self._geometry, body.refraction, target, in_water, view, water)
            else:
                textures.draw_whole_refraction(
                    self._geometry, body.refraction, target, in_air, in_water, view
                )
        target = self._reflection_target(i, plan)
        view = self._block("reflection", i).update(*uniforms.texture_view(body.reflection, plan))
        with timer.measure("reflection", target.framebuffer):
            textures.draw_reflection(self._geometry, body.reflection, target, in_air, view, water)

    def _reflection_target(self, i: int, plan: FramePlan) -> Target:
        size, linear_depth = plan.settings.texture_size, plan.reflection_depth
        return textures.reflection_target(self.targets, i, size, linear_depth=linear_depth)

    def _draw_textures_from_below(
        self, i: int, plan: FramePlan, timer: PassTimer, in_air: SceneLook, in_water: SceneLook
    ) -> None:
        body, water = plan.bodies[i], in_water.sun_in_water.water
        under, size = body.under, plan.settings.texture_size
        if under.heights is not None:
            target = heights_target(self.targets, i)
            view = self._block("surface heights", i).update(
                *uniforms.view(under.heights.view, under.heights.projection)
            )
            with timer.measure("surface heights", target.framebuffer):
                self._fog.draw_heights(self._water, body, plan.origin, target, view, water)
        if not under.refraction.drawn:
            return
        linear_depth = under.steps > 0
        target = textures.refraction_from_below_target(self.targets, i, size, linear_depth=linear_depth)
        view = self._block("refraction from below", i).update(*uniforms.texture_view(under.refraction, plan))
        with timer.measure("refraction", target.framebuffer):
            textures.draw_reflection(self._geometry, under.refraction, target, in_air, view, water)
        target = textures.reflection_from_below_target(self.targets, i, size, linear_depth=linear_depth)
        view = self._block("reflection from below", i).update(*uniforms.texture_view(under.reflection, plan))
        plane = self._block("mirrored near plane", i).update(*uniforms.near_plane(under.mirrored_plane))
        with timer.measure("reflection", target.framebuffer):
            textures.draw_reflection_from_below(
                self._geometry, under.reflection, target, in_water, view, water
            )
            with (
                self.targets.color_only(target).bind(),
                textures.drawn_region(under.reflection.region, target.size),
            ):
                self._fog.draw_fog(NearSide(plane, None), water, target.depth)

    def draw_depth(self, plan: FramePlan, timer: PassTimer, framebuffer: GPUFrameBuffer) -> None:
        """The depth of the dry scene alone into the bound framebuffer, in place of what it holds."""
        self.upload(plan)
        view = self._view(plan)
        with timer.measure("depth", framebuffer):
            framebuffer.clear(depth=1.0)
            gpu.state.color_mask_set(False, False, False, False)
            try:
                self._geometry.draw_depths(view, cull_back_faces=True)
            finally:
                gpu.state.color_mask_set(True, True, True, True)

    def scene_depth(self, size: tuple[int, int]) -> GPUTexture:
        """What `draw_scene_depth` drew last."""
        return self._scene_depth_target(size).depth

    def draw_scene_depth(self, plan: FramePlan, timer: PassTimer, size: tuple[int, int]) -> None:
        """The depth of the scene into a texture, for the fog over a picture that Blender has drawn.

        That of the other waters, too: after `draw_textures`.
        """
        target = self._scene_depth_target(size)
        with target.framebuffer.bind():
            self.draw_depth(plan, timer, target.framebuffer)
            self._draw_other_surfaces(plan, _look_from_air(plan))

    def _scene_depth_target(self, size: tuple[int, int]) -> Target:
        return self.targets.get(("scene depth",), size, ("R32F",))

    def near_side(self, plan: FramePlan, i: int) -> NearSide:
        """Where the picture's pixels begin, in respect of body `i`, after `draw_textures`."""
        heights = plan.bodies[i].under.heights
        return NearSide(
            self._block("near plane").update(*uniforms.near_plane(plan.near_plane, heights)),
            heights_target(self.targets, i).colors[0] if heights is not None else None,
        )

    def draw_water(
        self,
        plan: FramePlan,
        timer: PassTimer,
        framebuffer: GPUFrameBuffer | None,
        depth: GPUTexture | None = None,
        over: GPUFrameBuffer | None = None,
        view_transform: ViewTransform | None = None,
    ) -> None:
        """The water's surfaces and the fog, into the bound framebuffer, after `draw_textures` of the plan.

        depth: when the picture begins in a body of water, that of what is drawn already; over: a framebuffer
        of the same colours without it, None where the bound one does not have that texture.
        """
        immersed = plan.immersed
        look = replace(_look_from_air(plan), view_transform=view_transform)
        with timer.measure("water", framebuffer):
            self._draw_other_surfaces(plan, look)
        if immersed is None:
            return
        body, side = plan.bodies[immersed], self.near_side(plan, immersed)
        water = self._water_of(plan, immersed)
        with timer.measure("fog", framebuffer), over.bind() if over else nullcontext():
            self._fog.draw_fog(side, water, depth, view_transform)
        look = replace(look, near_side=side)
        with timer.measure("water", framebuffer):
            if body.refraction.drawn:
                self._draw_surface(immersed, plan, look)
            if body.under.refraction.drawn:
                exact = plan.settings.use_exact_under_water
                below = replace(look, from_below=True, exact=exact)
                self._draw_surface(immersed, plan, below)
        if side.heights is not None:
            with timer.measure("fog", framebuffer), over.bind() if over else nullcontext():
                width = meniscus_width(depth.height * plan.whole_height)
                self._fog.draw_meniscus(side, water, width, view_transform)

    def _draw_other_surfaces(self, plan: FramePlan, look: SurfaceLook) -> None:
        """Those of the bodies that the picture does not begin in."""
        for i, body in enumerate(plan.bodies):
            if body.refraction.drawn and i != plan.immersed:
                self._draw_surface(i, plan, look)

    def _draw_surface(self, i: int, plan: FramePlan, look: SurfaceLook) -> None:
        lights = self.upload(plan)
        view = self._view(plan)
        body, size = plan.bodies[i], plan.settings.texture_size
        if look.from_below:
            water = self._block("water from below", i).update(*uniforms.water(plan, body, from_below=True))
            follows = body.under.steps > 0
            refraction = textures.refraction_from_below_target(self.targets, i, size, linear_depth=follows)
            reflection = textures.reflection_from_below_target(self.targets, i, size, linear_depth=follows)
            look = replace(look, follows_reflections=follows)
        else:
            water = self._water_of(plan, i)
            refraction = textures.refraction_target(self.targets, i, size)
            reflection = self._reflection_target(i, plan)
            if plan.technique.settings is not None:
                own = body.body.settings.of(plan.technique.settings)
                images = {name: image for kind, name, image in body.body.settings.images if kind is type(own)}
                look = replace(
                    look,
                    own=self._block("technique", i).update(uniforms.technique(own, plan)),
                    maps=self._maps.of(own, images),
                )
        if look.hit_number:
            if look.from_below and not look.follows_reflections:
                refraction = hits.texture_target(self.targets, "refraction from below", i, size)
                reflection = hits.texture_target(self.targets, "reflection from below", i, size)
            elif not look.from_below and not plan.reflection_depth:
                reflection = hits.texture_target(self.targets, "reflection", i, size)
        self._water.draw(look, body, plan.origin, lights, view, water, refraction, reflection)

    def draw_picture(
        self, plan: FramePlan, target: Target, timer: PassTimer, *, transparent: bool = False
    ) -> None:
        """The whole picture into `target`, scene-linear. transparent: leave the sky out, alpha 0.

        Water is never transparent: what begins in it has alpha 1.
        """
        in_air, in_water = self.draw_textures(plan, timer)
        with target.framebuffer.bind():
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            view = self._view(plan)
            with timer.measure("scene", target.framebuffer):
                if in_water is None:
                    self._geometry.draw_scene(in_air, view)
                else:
                    line = plan.bodies[plan.immersed].refraction
                    self._geometry.draw_scene_in_water(
                        in_air, in_water, view, line.clear_height, line.clip_height
                    )
                if not transparent and _sees_sky(plan):
                    self._geometry.draw_sky(in_air.lights, view)
            over = self.targets.color_only(target) if in_water is not None else None
            self.draw_water(plan, timer, target.framebuffer, target.depth, over)
        if plan.glow.drawn:
            with timer.measure("glow", target.framebuffer):
                star = self.draw_star(plan, target.depth, in_air.shadow_depth)
                with target.framebuffer.bind():
                    self.add_glow(plan, star)

    def draw_hits(self, plan: FramePlan, size: tuple[int, int], timer: PassTimer | None = None) -> hits.Hits:
        """Where the water's pixels look in a picture of `size`, (width, height)."""
        timer = timer or PassTimer()
        plan = hits.without_light(plan)
        in_air, _ = self.draw_textures(plan, timer)
        self._draw_hit_textures(plan, timer, in_air)
        target = hits.hits_target(self.targets, size)
        with target.framebuffer.bind(), timer.measure("hits", target.framebuffer):
            target.framebuffer.clear(color=(0.0, 0.0, 0.0, 0.0), depth=1.0)
            self.draw_depth(plan, timer, target.framebuffer)
            for i, body in enumerate(plan.bodies):
                look = replace(_look_from_air(plan), hit_number=i + 1)
                if body.under is not None:
                    look = replace(look, near_side=self.near_side(plan, i))
                if body.refraction.drawn:
                    self._draw_surface(i, plan, look)
                if body.under is not None and body.under.refraction.drawn:
                    exact = plan.settings.use_exact_under_water
                    self._draw_surface(i, plan, replace(look, from_below=True, exact=exact))
        return hits.read(target)

    def _draw_hit_textures(self, plan: FramePlan, timer: PassTimer, look: SceneLook) -> None:
        """Once more those textures that have no distances for a picture. How they are lit does not matter."""
        for i, body in enumerate(plan.bodies):
            passes = []
            if body.refraction.drawn and not plan.reflection_depth:
                passes.append(("reflection", body.reflection, textures.draw_reflection))
            if body.under is not None and body.under.refraction.drawn and not body.under.steps:
                passes += [
                    ("refraction from below", body.under.refraction, textures.draw_reflection),
                    ("reflection from below", body.under.reflection, textures.draw_reflection_from_below),
                ]
            for name, planned, draw in passes:
                target = hits.texture_target(self.targets, name, i, plan.settings.texture_size)
                view = self._block(name, i).update(*uniforms.texture_view(planned, plan))
                with timer.measure("hits", target.framebuffer):
                    draw(self._geometry, planned, target, look, view, self._water_of(plan, i))

    def draw_star(
        self, plan: FramePlan, depth: GPUTexture, shadow_depth: GPUTexture | None = None
    ) -> GPUTexture:
        """The glow of a plan that has one (see `GlowPainter.draw_star`), after the water is drawn."""
        lights = self.upload(plan)
        view = self._view(plan)
        waters = [self._water_of(plan, i) if plan.glow.bodies[i] else None for i in range(len(plan.bodies))]
        return self._glow.draw_star(plan, lights, view, waters, depth, shadow_depth)

    def add_glow(
        self, plan: FramePlan, star: GPUTexture, view_transform: ViewTransform | None = None
    ) -> None:
        """Add the star to the bound framebuffer, in display colours with a view transform."""
        self._glow.add(plan, star, view_transform)


def _look_from_air(plan: FramePlan) -> SurfaceLook:
    """The look of a body's surface but for what belongs to the body."""
    exact = plan.settings.use_exact_fresnel and "use_exact_fresnel" in plan.technique.reads
    return SurfaceLook(
        plan.settings.technique,
        exact_fresnel=exact,
        follows_refractions=plan.follows_refractions,
        follows_reflections=plan.reflection_depth,
    )


def _sees_sky(plan: FramePlan) -> bool:
    """Whether some pixel begins in the air: under water, what is not drawn has the water's colour."""
    return plan.immersed is None or plan.bodies[plan.immersed].side.side is not Side.UNDER
