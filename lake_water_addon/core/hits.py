# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a technique looks (the twin of `gpu_shaders/hits_lib.glsl`), and how far that is from the truth.

Points are in render space (see `plan`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import cameras

if TYPE_CHECKING:  # errors of a plan are told, none is made here
    from .plan import FramePlan

HORIZON = 5e4
"""m: what is farther is the sky, or water without a bottom."""

Places = Callable[[np.ndarray], np.ndarray]
"""Points (n, 3) -> places (n, 2) in a picture or a texture, in its pixels or texels."""


class HitErrors(NamedTuple):
    """How far each pixel's W is from the true W*, NaN where one of the two is missing.

    distance: m; texels: in the technique's texture; pixels: in the picture, with half a texel for what a
    colour of the texture may be off, and no more than the picture's diagonal.

    missed: share of the true hits that were not found; false: share of the pixels without one that were given
    one; beyond: share of the pairs that lie more than a texel apart. NaN for a share of nothing.
    """

    distance: np.ndarray
    texels: np.ndarray
    pixels: np.ndarray
    missed: float
    false: float
    beyond: float


def shown_point(
    depth: np.ndarray, view: np.ndarray, projection: np.ndarray, uv: np.ndarray, known: np.ndarray
) -> np.ndarray:
    """(n, 4) the points that a texture shows at uv (n, 2), and 1; zeros where there is none.

    depth: (h, w) along the axis of the texture's camera (view, projection), which is affine; known: (n,) how
    far the colour there is known.
    """
    height, width = depth.shape
    x, y = np.minimum((np.clip(uv, 0.0, 1.0) * (width, height)).astype(int), (width - 1, height - 1)).T
    z = depth[y, x][:, None]
    ndc, scale = 2.0 * uv - 1.0, (projection[0, 0], projection[1, 1])
    orthographic = cameras.is_orthographic(projection)
    at = ndc - projection[:2, 3] if orthographic else z * (ndc + projection[:2, 2])
    to_render = np.linalg.inv(view)
    points = np.concatenate([at / scale, -z], axis=1) @ to_render[:3, :3].T + to_render[:3, 3]
    there = (known > 0.5) & (z[:, 0] > 0.0) & (z[:, 0] < HORIZON)
    return np.where(there[:, None], np.append(points, np.ones_like(z), axis=1), 0.0)


def hit_errors(
    true: np.ndarray,
    given: np.ndarray,
    mask: np.ndarray,
    to_texels: Places,
    to_pixels: Places,
    texel: float,
    farthest: float,
) -> HitErrors:
    """How far the points that a technique gives, (..., 3), are from the true ones, NaN where there is none.

    mask: (...) the pixels that count. to_texels, to_pixels: see `texture_places`. texel: its width in pixels;
    farthest: most pixels that two points can be apart.
    """
    exists, found = np.isfinite(true).all(axis=-1), np.isfinite(given).all(axis=-1)
    both = mask & exists & found
    distance, texels, pixels = (np.full(mask.shape, np.nan) for _ in range(3))
    one, other = given[both], true[both]
    distance[both] = np.linalg.norm(one - other, axis=-1)
    texels[both] = np.linalg.norm(to_texels(one) - to_texels(other), axis=-1)
    apart = np.linalg.norm(to_pixels(one) - to_pixels(other), axis=-1)
    pixels[both] = np.minimum(apart + 0.5 * texel, farthest)
    return HitErrors(
        distance,
        texels,
        pixels,
        missed=_share(~found, mask & exists),
        false=_share(found, mask & ~exists),
        beyond=_share(texels > 1.0, both),
    )


def _share(of: np.ndarray, among: np.ndarray) -> float:
    return float(of[among].mean()) if among.any() else float("nan")


def texture_places(view: np.ndarray, projection: np.ndarray, size: tuple[int, int]) -> Places:
    """Places in a picture of (width, height) pixels or texels by a camera (4, 4), (4, 4)."""

    def places(points: np.ndarray) -> np.ndarray:
        return cameras.to_texture(projection, points @ view[:3, :3].T + view[:3, 3]) * size

    return places


def found_points(hits: np.ndarray) -> np.ndarray:
    """(..., 3) of the hits pass's (..., 4): NaN where nothing was found."""
    return np.where(hits[..., 3:] > 0.5, hits[..., :3].astype(np.float64), np.nan)


def refraction_errors(
    plan: FramePlan,
    i: int,
    size: tuple[int, int],
    hits: np.ndarray,
    true: np.ndarray,
    mask: np.ndarray,
    *,
    from_below: bool = False,
) -> HitErrors:
    """Of what is seen through body `i`, in a picture of `size` pixels (width, height).

    hits: (..., 4) of the hits pass; true: (..., 3), NaN where there is none; mask: (...) pixels that count,
    all of that body's surface from above, or from_below. Pixels are those of the picture as seen straight.
    """
    passes = plan.bodies[i].under if from_below else plan.bodies[i]
    return _errors(plan, passes.refraction, plan.camera.view, size, hits, true, mask)


def reflection_errors(
    plan: FramePlan,
    i: int,
    size: tuple[int, int],
    hits: np.ndarray,
    true: np.ndarray,
    mask: np.ndarray,
    *,
    from_below: bool = False,
) -> HitErrors:
    """As `refraction_errors`, of what is mirrored; pixels are those of the picture in calm water."""
    body = plan.bodies[i]
    passes = body.under if from_below else body
    mirrored = cameras.mirrored_view(plan.camera.view, float(body.origin[2]))
    return _errors(plan, passes.reflection, mirrored, size, hits, true, mask)


def _errors(plan, texture_pass, view, size, hits, true, mask) -> HitErrors:
    texels = plan.settings.texture_size
    projection = plan.camera.projection
    texel = max(projection[axis, axis] / texture_pass.projection[axis, axis] * size[axis] for axis in (0, 1))
    return hit_errors(
        true,
        found_points(hits),
        mask,
        texture_places(texture_pass.view, texture_pass.projection, (texels, texels)),
        texture_places(view, projection, size),
        texel / texels,
        float(np.hypot(*size)),
    )
