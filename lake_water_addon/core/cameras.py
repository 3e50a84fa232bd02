# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of the passes, in float64, and the projection's own algebra.

`view` is (4, 4), world (or render space) to camera, rigid; `projection` is (4, 4), camera to
OpenGL clip space. Whatever a lens does (shift, pixel aspect, orthographic) is in `projection`,
and everything here is derived from it.
"""

from __future__ import annotations

import numpy as np

from .optics import refract_direction

UP = np.array([0.0, 0.0, 1.0])

MIN_W = 1e-6
"""Least clip w that a lookup divides by: what lies behind a camera must not turn up in its picture."""


def is_orthographic(projection: np.ndarray) -> bool:
    """True when clip w does not depend on the point."""
    return not projection[3, :3].any()


def eye_position(view: np.ndarray) -> np.ndarray:
    """(3,) the camera's position in world space."""
    return -view[:3, :3].T @ view[:3, 3]


def to_clip(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Homogeneous clip coordinates (n, 4) of points (n, 3) under a view-projection (4, 4)."""
    return points @ matrix[:, :3].T + matrix[:, 3]


def clip_polygon(polygon: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    """The part of a convex polygon (n, 3) that lies in the view volume of a view-projection (4, 4).

    Sutherland and Hodgman's algorithm in clip space; (m, 3) points in the polygon's own space,
    m = 0 when nothing of it does.
    """
    points, clip = np.asarray(polygon, dtype=np.float64), to_clip(matrix, polygon)
    for axis in range(3):
        for side in (-1.0, 1.0):
            if len(points) == 0:
                return points
            inside = clip[:, 3] - side * clip[:, axis]  # signed distance from this plane
            if inside.min() >= 0.0:
                continue
            kept, kept_clip = [], []
            for i in range(len(points)):
                j = (i + 1) % len(points)
                if inside[i] >= 0.0:
                    kept.append(points[i])
                    kept_clip.append(clip[i])
                if (inside[i] >= 0.0) != (inside[j] >= 0.0):
                    t = inside[i] / (inside[i] - inside[j])
                    kept.append(points[i] + t * (points[j] - points[i]))
                    kept_clip.append(clip[i] + t * (clip[j] - clip[i]))
            points, clip = np.array(kept).reshape(-1, 3), np.array(kept_clip).reshape(-1, 4)
    return points


def to_ndc(projection: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Normalised device coordinates (..., 3) of camera-space points (..., 3)."""
    clip = points @ projection[:3, :3].T + projection[:3, 3]
    w = points @ projection[3, :3] + projection[3, 3]
    return clip / w[..., None]


def to_texture(projection: np.ndarray, points: np.ndarray) -> np.ndarray:
    """T of the thesis: texture coordinates (..., 2), 0..1 inside, of camera-space points (..., 3).

    A point beside or behind the camera gets coordinates far outside, on its own side.
    """
    clip = points @ projection[:2, :3].T + projection[:2, 3]
    w = points @ projection[3, :3] + projection[3, 3]
    return 0.5 * clip / np.maximum(w, MIN_W)[..., None] + 0.5


def ray_through(projection: np.ndarray, ndc: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Camera-space ray (origin (3,), unit direction (3,)) of the point `ndc` (2,) of the picture."""
    inverse = np.linalg.inv(projection)
    near = inverse @ np.array([ndc[0], ndc[1], -1.0, 1.0])
    far = inverse @ np.array([ndc[0], ndc[1], 1.0, 1.0])
    near, far = near[:3] / near[3], far[:3] / far[3]
    direction = (far - near) / np.linalg.norm(far - near)
    return (near if is_orthographic(projection) else np.zeros(3)), direction


def clip_range(projection: np.ndarray) -> tuple[float, float]:
    """(near, far) distances along the viewing axis, in m."""
    a, b = projection[2, 2], projection[2, 3]
    if is_orthographic(projection):
        return float((b + 1.0) / a), float((b - 1.0) / a)
    return float(b / (a - 1.0)), float(b / (a + 1.0))


def widen(projection: np.ndarray, fov_ext: float) -> np.ndarray:
    """The projection whose half-field tangents are `fov_ext` times as large, about the same centre.

    A point that had the device coordinate p has p / fov_ext in it.
    """
    return np.diag([1.0 / fov_ext, 1.0 / fov_ext, 1.0, 1.0]) @ projection


def crop(projection: np.ndarray, left: float, bottom: float, right: float, top: float) -> np.ndarray:
    """The projection whose picture is the part (left, bottom)-(right, top) of the given one's, in 0..1."""
    window = np.eye(4)
    window[0, 0], window[0, 3] = 1.0 / (right - left), (1.0 - left - right) / (right - left)
    window[1, 1], window[1, 3] = 1.0 / (top - bottom), (1.0 - bottom - top) / (top - bottom)
    return window @ projection


def mirror_matrix(level: float) -> np.ndarray:
    """(4, 4) reflection in the plane z = level; its own inverse."""
    matrix = np.diag([1.0, 1.0, -1.0, 1.0])
    matrix[2, 3] = 2.0 * level
    return matrix


def mirrored_view(view: np.ndarray, level: float) -> np.ndarray:
    """View of the camera mirrored in z = level. Its handedness is turned, so winding is, too."""
    return view @ mirror_matrix(level)


def rotation_about(point: np.ndarray, axis: np.ndarray, angle: float) -> np.ndarray:
    """(4, 4) rotation by `angle` about the unit `axis` through `point` (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = point - rotation @ point
    return matrix


def turning_ray(view: np.ndarray, projection: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """World-space ray (origin, unit direction) that the refraction camera is made for.

    Perspective: the middle of the picture's lowest edge (-J of the thesis). For an upright camera that
    is the bottom edge. A rolled or upside-down camera has its lowest edge elsewhere; with ties
    (looking straight down) the bottom edge is taken. Orthographic: the middle of the picture. All its
    rays are refracted alike, and about its middle the turned picture stays best within its texture.
    """
    to_world = np.linalg.inv(view)
    candidates = ((0.0, -1.0), (-1.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    if is_orthographic(projection):
        candidates = ((0.0, 0.0),)
    best = None
    for ndc in candidates:
        origin, direction = ray_through(projection, np.array(ndc))
        origin = to_world[:3, :3] @ origin + to_world[:3, 3]
        direction = to_world[:3, :3] @ direction
        if best is None or direction[2] < best[1][2] - 1e-9:
            best = (origin, direction)
    return best


def apparent_depth(cosine: np.ndarray, n12: float) -> np.ndarray:
    """Apparent over true depth below a flat surface, of what is seen at an angle of incidence with this
    cosine: tan(refraction) / tan(incidence) = cosine / sqrt(1 / n12^2 - 1 + cosine^2); n12 straight down.

    From below, with n12 > 1, apparent over true height of what is above, unless all is reflected.
    """
    return cosine / np.sqrt(1.0 / n12**2 - 1.0 + cosine**2)


def flattened_view(view: np.ndarray, level: float, scale: float) -> np.ndarray:
    """View in which heights over z = level are `scale` times as large: affine, no longer rigid.

    With the apparent depth of an angle of incidence, each ray that meets the flat surface at this angle is
    seen straight on where it was bent, whatever its azimuth.
    """
    flat = np.eye(4)
    flat[2, 2], flat[2, 3] = scale, level * (1.0 - scale)
    return view @ flat


def refraction_view(view: np.ndarray, projection: np.ndarray, level: float, n12: float) -> np.ndarray:
    """View of the refraction camera: the camera turned about O by the angle between I and R.

    O is where `turning_ray`, that of the bottom centre of the picture, meets the plane z = level (eq. 1), I
    that ray's direction and R its refraction: so the bottom centre shows just what is seen through O.
    Where that ray misses the water (looking up, or from below it) the camera itself is returned. The
    rays of an orthographic camera have no beginning: they meet the plane wherever the camera stands.
    """
    origin, incident = turning_ray(view, projection)
    height = origin[2] - level
    if incident[2] >= -1e-6 or (height <= 0.0 and not is_orthographic(projection)):
        return view
    hit = origin + incident * (height / -incident[2])
    refracted, _ = refract_direction(incident, UP, n12)
    axis = np.cross(incident, refracted)
    sine = np.linalg.norm(axis)
    if sine < 1e-12:
        return view
    angle = float(np.arctan2(sine, incident @ refracted))
    return view @ np.linalg.inv(rotation_about(hit, axis / sine, angle))
