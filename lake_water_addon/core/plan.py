# SPDX-License-Identifier: GPL-3.0-or-later
"""What one view of a scene needs: which passes, from which cameras, and why (or why not).

A plan is made anew for each view and frame and holds only small matrices, so it is cheap.
All of it is in *render space*: world axes with the origin moved to the first water body (or
the scene's own origin without water), so that float32 on the GPU stays exact far from the
world's origin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from . import cameras, waves
from .snapshot import Camera, SceneSnapshot, WaterBody

CLIP_CLEARANCE = 0.02
"""m: how far the clip planes lie beyond the highest (lowest) wave, the thesis's "little bit"."""

WHOLE = (0.0, 0.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class TexturePass:
    """A picture of the scene that the water looks up. view, projection: (4, 4) float64, render space.

    keep: +1 draws what lies below `clip_height`, -1 what lies above; what does not reach
    beyond `clear_height` cannot be cut by a wave. drawn: False when the pass is not needed;
    `reason` says why, either way, in words for a person. region: (left, bottom, right, top) of
    the texture, in 0..1, outside of which nothing is ever looked up.
    """

    name: str
    view: np.ndarray
    projection: np.ndarray
    keep: int
    clip_height: float
    clear_height: float
    drawn: bool
    reason: str
    region: tuple[float, float, float, float] = WHOLE

    @property
    def mirrored(self) -> bool:
        """True when the view turns the winding of triangles around."""
        return bool(np.linalg.det(self.view[:3, :3]) < 0.0)


@dataclass(frozen=True, eq=False)
class BodyPlan:
    """One water body in one view. origin: (3,) of the water frame in render space."""

    body: WaterBody
    origin: np.ndarray
    packed_waves: np.ndarray
    refraction: TexturePass
    reflection: TexturePass
    drawn: bool
    reason: str


@dataclass(frozen=True, eq=False)
class FramePlan:
    """One view of one snapshot. origin: (3,) float64, world position of render space's origin."""

    snapshot: SceneSnapshot
    origin: np.ndarray
    camera: Camera
    bodies: tuple[BodyPlan, ...]
    texture_size: int
    fov_ext: float
    intersection_steps: int
    technique: str

    def without_water(self) -> FramePlan:
        """The same picture with no water in it, to compare with."""
        return replace(self, bodies=())


def render_origin(snapshot: SceneSnapshot) -> np.ndarray:
    """(3,) float64: where render space's origin lies in the world. Depends on the scene, not on the view."""
    return snapshot.waters[0].matrix[:3, 3].copy() if snapshot.waters else np.zeros(3)


def rebase(matrix: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """Object to world (..., 4, 4) -> object to render space."""
    moved = np.array(matrix, dtype=np.float64)
    moved[..., :3, 3] -= origin
    return moved


def rebase_view(view: np.ndarray, origin: np.ndarray) -> np.ndarray:
    """World to camera -> render space to camera."""
    moved = np.array(view, dtype=np.float64)
    moved[:3, 3] += moved[:3, :3] @ origin
    return moved


def plan_frame(
    snapshot: SceneSnapshot,
    camera: Camera,
    *,
    fov_ext: float,
    texture_size: int,
    intersection_steps: int,
    technique: str = "LAKE",
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0),
    jitter: tuple[float, float] = (0.0, 0.0),
) -> FramePlan:
    """Plan one picture.

    camera: of the whole picture; window: the part (left, bottom, right, top) of it that is
    drawn, in 0..1 (a border render). The textures are those of the whole picture, so that a
    part of it looks the same when drawn alone. jitter: shift of the picture in device
    coordinates, for antialiasing.
    """
    origin = render_origin(snapshot)
    shift = np.eye(4)
    shift[:2, 3] = jitter
    whole = Camera(rebase_view(camera.view, origin), shift @ camera.projection)
    drawn = replace(whole, projection=cameras.crop(whole.projection, *window))
    bodies = tuple(
        _plan_body(body, snapshot, whole, drawn, origin, fov_ext, technique) for body in snapshot.waters
    )
    return FramePlan(snapshot, origin, drawn, bodies, texture_size, fov_ext, intersection_steps, technique)


def _plan_body(
    body: WaterBody,
    snapshot: SceneSnapshot,
    whole: Camera,
    drawn: Camera,
    origin: np.ndarray,
    fov_ext: float,
    technique: str,
) -> BodyPlan:
    settings = body.settings
    at = body.matrix[:3, 3] - origin
    level = float(at[2])
    n12 = 1.0 / settings.ior
    highest = waves.max_height(settings.waves) + CLIP_CLEARANCE
    packed = waves.pack(settings.waves[: waves.MAX_WAVES], snapshot.time, settings.depth, body.heading)

    visible, reason = _visibility(body, at, highest, packed, drawn)
    wide = cameras.widen(whole.projection, fov_ext)
    refraction_view = cameras.refraction_view(whole.view, whole.projection, level, n12)
    refraction = TexturePass(
        "refraction",
        refraction_view,
        wide,
        keep=+1,
        clip_height=level + highest,
        clear_height=level - highest,
        drawn=visible,
        reason=f"the bottom seen through it: {reason}",
    )
    mirrored = cameras.mirrored_view(whole.view, level)
    reflection = TexturePass(
        "reflection",
        mirrored,
        wide,
        keep=-1,
        clip_height=level - highest,
        clear_height=level + highest,
        drawn=visible,
        reason=f"what it mirrors: {reason}",
        region=_reflection_region(body, at, highest, drawn, wide @ mirrored) if visible else WHOLE,
    )
    return BodyPlan(body, at, packed, refraction, reflection, visible, reason)


def _visibility(
    body: WaterBody, at: np.ndarray, highest: float, packed: np.ndarray, camera: Camera
) -> tuple[bool, str]:
    """Whether the water has to be drawn at all, and why."""
    if not _is_above(camera, at, packed):
        return False, "the camera is below the water; views from under water are not drawn yet"
    if body.grid is not None:
        points = np.concatenate([_rectangle(body, at, height) for height in (-highest, highest)])
        clip = cameras.to_clip(camera.projection @ camera.view, points)
        for axis in range(3):
            for side in (-1.0, 1.0):
                if np.all(side * clip[:, axis] > clip[:, 3]):
                    return False, "out of the picture"
    return True, "in the picture"


def _rectangle(body: WaterBody, at: np.ndarray, height: float) -> np.ndarray:
    """(4, 3) corners of a grid body's rectangle in render space, so high above its plane, in order."""
    _, half_x, half_y, center_x, center_y = body.grid
    x = center_x + half_x * np.array([-1.0, 1.0, 1.0, -1.0])
    y = center_y + half_y * np.array([-1.0, -1.0, 1.0, 1.0])
    cos_h, sin_h = np.cos(body.heading), np.sin(body.heading)
    return np.stack([cos_h * x - sin_h * y, sin_h * x + cos_h * y, np.full(4, height)], axis=1) + at


def _reflection_region(
    body: WaterBody, at: np.ndarray, highest: float, camera: Camera, to_texture_clip: np.ndarray
) -> tuple[float, float, float, float]:
    """The part of the reflection texture that U + c R can fall into, for any U in the picture and any R.

    U lies in the visible part of the slab between the lowest and the highest wave, and c R in a box.
    """
    if body.grid is None:
        return WHOLE
    to_clip = camera.projection @ camera.view
    visible = [cameras.clip_polygon(_rectangle(body, at, height), to_clip) for height in (-highest, highest)]
    points = np.concatenate(visible)
    if min(len(polygon) for polygon in visible) == 0:
        return WHOLE
    c = body.settings.c
    reach = np.array([(x, y, z) for x in (-c, c) for y in (-c, c) for z in (min(c, 0.0), max(c, 0.0))])
    clip = cameras.to_clip(to_texture_clip, (points[:, None] + reach).reshape(-1, 3))
    if clip[:, 3].min() <= 1e-6:
        return WHOLE
    uv = np.clip(0.5 * clip[:, :2] / clip[:, 3:] + 0.5, 0.0, 1.0)
    return (*uv.min(axis=0).tolist(), *uv.max(axis=0).tolist())


def _is_above(camera: Camera, at: np.ndarray, packed: np.ndarray) -> bool:
    """Whether the camera looks at the water from the air.

    An orthographic camera is nowhere, so its direction decides.
    """
    if cameras.is_orthographic(camera.projection):
        return bool(camera.view[2, 2] > 0.0)
    eye = cameras.eye_position(camera.view) - at
    return bool(eye[2] > waves.height(packed, eye[:2]))


def pixel_jitter(sample: int, samples: int, width: int, height: int) -> tuple[float, float]:
    """Shift in device coordinates for antialiasing sample `sample` of `samples`.

    Halton points (2, 3) in the pixel's square, centred; a single sample is not moved.
    """
    if samples <= 1:
        return 0.0, 0.0
    x, y = _halton(sample + 1, 2) - 0.5, _halton(sample + 1, 3) - 0.5
    return 2.0 * x / width, 2.0 * y / height


def _halton(index: int, base: int) -> float:
    result, fraction = 0.0, 1.0
    while index > 0:
        fraction /= base
        result += fraction * (index % base)
        index //= base
    return result
