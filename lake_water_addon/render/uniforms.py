# SPDX-License-Identifier: GPL-3.0-or-later
"""Fills the uniform buffers of `gpu_shaders/uniforms_lib.glsl` (std140, 16-byte members in order)."""

from __future__ import annotations

import numpy as np
from gpu.types import Buffer, GPUUniformBuf

from ..core import cameras, optics, technique_settings, waves
from ..core.plan import CASCADES, BodyPlan, FramePlan, TexturePass
from ..core.technique_settings import TechniqueSettings
from ..core.under_water import HEIGHT_TEXELS, HeightMap, NearPlane
from ..core.waves import MAX_WAVES
from .resources import Resources

BORDER_FADE = 0.03
"""Width, as a part of the texture, over which a lookup near its border gives way to its substitute."""


class UniformBlock:
    """A uniform buffer that is uploaded only when its content changed."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._data: np.ndarray | None = None
        self.buffer: GPUUniformBuf | None = None

    def update(self, *members: np.ndarray | tuple[float, ...]) -> GPUUniformBuf:
        """members: in the struct's order; (4,) or (n, 4) vectors, (4, 4) matrices (stored by columns)."""
        data = np.concatenate([np.asarray(m, dtype=np.float32).ravel() for m in members])
        if self.buffer is None:
            self.buffer = self._resources.uniform_buffer(data)
        elif not np.array_equal(data, self._data):
            self.buffer.update(Buffer("FLOAT", data.size, data))
        self._data = data
        return self.buffer


def _vec4(xyz: np.ndarray, w: float = 0.0) -> np.ndarray:
    return np.append(np.asarray(xyz, dtype=np.float64), w)


def lights(plan: FramePlan) -> list[np.ndarray]:
    """Members of struct Lights."""
    sun, sky, shadows = plan.snapshot.sun, plan.snapshot.sky, plan.shadows
    projections, texels = np.zeros((CASCADES, 4, 4)), np.zeros(4)
    for i, camera in enumerate(shadows):
        projections[i], texels[i] = camera.projection.T, camera.texel.max()
    sh = np.zeros((9, 4))
    sh[:, :3] = sky.irradiance_sh
    return [
        _vec4(sun.direction if sun else np.zeros(3)),
        _vec4(sun.irradiance if sun else np.zeros(3)),
        _vec4(sky.radiance, 1.0 if sky.image else 0.0),
        np.array([sky.strength, sky.rotation, 0.0, 0.0]),
        sh,
        shadows[0].view.T if shadows else np.eye(4),
        projections,
        np.array([len(shadows), shadows[0].resolution if shadows else 0.0, 0.0, 0.0]),
        texels,
    ]


def clip_to_direction(view_matrix: np.ndarray, projection: np.ndarray) -> np.ndarray:
    """(4, 4) of a perspective camera: its xyz of (x, y, 1, 1) is the direction of sight at (x, y), not unit.

    Without the camera's place and without a division by w, whose digits cancel in float32 when the
    clip range is long: the far plane would be beyond what it resolves.
    """
    rotation = np.eye(4)
    rotation[:3, :3] = view_matrix[:3, :3]
    return np.linalg.inv(projection @ rotation)


def view(
    view_matrix: np.ndarray,
    projection: np.ndarray,
    keep: int = 0,
    clip_height: float = 0.0,
    lod_bias: float = 0.0,
) -> list[np.ndarray]:
    """Members of struct View."""
    if cameras.is_orthographic(projection):
        eye = _vec4(view_matrix[2, :3], 1.0)
    else:
        eye = _vec4(np.linalg.inv(view_matrix)[:3, 3], 0.0)
    return [
        view_matrix.T,
        projection.T,
        clip_to_direction(view_matrix, projection).T,
        eye,
        np.array([keep, clip_height, lod_bias, 0.0]),
    ]


def texture_view(texture_pass: TexturePass, plan: FramePlan) -> list[np.ndarray]:
    """Members of struct View for a pass of a plan into a texture."""
    camera = texture_pass.view, texture_pass.projection
    return view(*camera, texture_pass.keep, texture_pass.clip_height, plan.lod_bias)


def water(plan: FramePlan, body: BodyPlan, *, from_below: bool = False) -> list[np.ndarray]:
    """Members of struct Water, with the cameras of what is looked up from the air or from below."""
    settings, frame = body.body.settings, plan.settings
    looked_up = body.under if from_below else body
    n12 = 1.0 / settings.ior
    reflection_steps = body.under.steps if from_below else frame.reflection_steps
    refraction_steps = frame.refraction_steps or frame.intersection_steps
    greatest = waves.max_height(settings.waves)
    packed = np.zeros((MAX_WAVES, 4))
    packed[: len(body.packed_waves)] = body.packed_waves
    return [
        _vec4(body.origin, len(body.packed_waves)),
        np.array([settings.k, settings.q, settings.c, n12]),
        np.array([optics.reflectance_at_normal(n12), greatest, BORDER_FADE, frame.texture_size]),
        _vec4(np.array(settings.water_color), waves.met_slope(body.packed_waves)),
        np.array(body.extent),
        np.array([np.cos(body.body.heading), np.sin(body.body.heading), 0.0, 0.0]),
        np.array([refraction_steps, reflection_steps, body.lowest, body.highest]),
        looked_up.refraction.view.T,
        looked_up.refraction.projection.T,
        looked_up.reflection.view.T,
        looked_up.reflection.projection.T,
        packed,
    ]


def water_light(plan: FramePlan, body: BodyPlan) -> list[np.ndarray]:
    """Members of struct WaterLight; without sunlight in the water, all of them zero but the sky's."""
    light, settings, spectrum = body.light, plan.settings, body.spectrum
    sky = _vec4(spectrum.sky_absorption, spectrum.sky)
    if light is None:
        return [np.zeros((4, 4)), np.zeros((4, 4)), np.zeros(4), np.zeros(4), np.zeros(4), np.zeros(4), sky]
    camera = light.camera
    return [
        camera.view.T,
        camera.projection.T,
        _vec4(camera.direction, light.bending),
        np.array([settings.photon_size, settings.caustics_size, settings.caustics_steps, 0.0]),
        np.array([camera.resolution, camera.texel.max(), light.transmittance, 1.0]),
        _vec4(spectrum.absorption - body.body.settings.k, spectrum.sun),
        sky,
    ]


def technique(settings: TechniqueSettings, plan: FramePlan) -> np.ndarray:
    """The only member of struct Technique."""
    packed = technique_settings.pack(settings, plan.snapshot.time)
    values = np.zeros((technique_settings.MAX_VALUES, 4))
    values[: len(packed)] = packed
    return values


def near_plane(plane: NearPlane, heights: HeightMap | None = None) -> list[np.ndarray]:
    """Members of struct NearPlane. heights: the map that tells the pixels' sides, where they differ."""
    beyond = plane.far - plane.near if plane.orthographic else plane.near / plane.far
    return [
        _vec4(plane.origin),
        _vec4(plane.center, plane.near),
        _vec4(plane.right, beyond),
        _vec4(plane.up, 1.0 if plane.orthographic else 0.0),
        np.append(heights.corner, HEIGHT_TEXELS / heights.size) if heights else np.zeros(4),
    ]
