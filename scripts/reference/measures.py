# SPDX-License-Identifier: GPL-3.0-or-later
"""How far a picture is from its reference, and caustics from the count of photons.

Pictures are (h, w, 3) scene-linear radiance. FLIP's map and SSIM's are made of the whole picture and then
averaged over the pixels that count, so that their filters see what an eye sees beside them.
"""

from __future__ import annotations

from dataclasses import dataclass

import flip_evaluator
import numpy as np
from skimage.metrics import structural_similarity

GAUSSIAN = {"gaussian_weights": True, "sigma": 1.5, "use_sample_covariance": False}
"""SSIM as its authors define it (Wang et al. 2004)."""


@dataclass(frozen=True)
class PictureError:
    """flip: mean LDR-FLIP of the displayed pictures, hdr_flip: mean HDR-FLIP, both 0 to 1; rmse: W/(m^2 sr),
    over pixels and channels; ssim: mean, 1 for equal pictures."""

    flip: float
    hdr_flip: float
    rmse: float
    ssim: float


@dataclass(frozen=True)
class CausticsError:
    """correlation: Pearson's with the count of photons; contrast: standard deviation over mean, relative to
    the count's; energy: sum relative to the count's."""

    correlation: float
    contrast: float
    energy: float


@dataclass(frozen=True, eq=False)
class ErrorMaps:
    """(h, w) float32: what the means of `PictureError` are taken of."""

    flip: np.ndarray
    hdr_flip: np.ndarray
    ssim: np.ndarray


def displayed(picture: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """(h, w, 3) in 0..1, sRGB-encoded (Blender's Standard view). exposure: stops."""
    linear = np.clip(np.asarray(picture, dtype=np.float64) * 2.0**exposure, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def error_maps(reference: np.ndarray, picture: np.ndarray, exposure: float = 0.0) -> ErrorMaps:
    """Maps of the error of a picture, both as the eye sees them from 0.7 m of a 4K screen (FLIP's default).

    exposure: stops, of the displayed pictures; HDR-FLIP takes its own range of them from the reference.
    ValueError when their shapes differ, a value is not finite, or the reference is black.
    """
    _same_shape(reference, picture)
    # FLIP itself takes NaN for equal, and ends the process where no exposure shows anything.
    if not (np.isfinite(reference).all() and np.isfinite(picture).all()):
        raise ValueError("a picture has values that are not finite")
    if not np.max(reference) > 0.0:
        raise ValueError("the reference is black: there is no exposure to compare at")
    shown = [displayed(image, exposure).astype(np.float32) for image in (reference, picture)]
    linear = [np.ascontiguousarray(np.maximum(image, 0.0), np.float32) for image in (reference, picture)]
    flip, _, _ = flip_evaluator.evaluate(*shown, "LDR", applyMagma=False)
    hdr_flip, _, _ = flip_evaluator.evaluate(*linear, "HDR", applyMagma=False)
    _, ssim = structural_similarity(*shown, channel_axis=2, data_range=1.0, full=True, **GAUSSIAN)
    return ErrorMaps(flip[..., 0], hdr_flip[..., 0], ssim.mean(axis=2))


def picture_error(
    reference: np.ndarray,
    picture: np.ndarray,
    mask: np.ndarray | None = None,
    *,
    maps: ErrorMaps | None = None,
    exposure: float = 0.0,
) -> PictureError:
    """The error of a picture over the pixels of a mask (h, w), bool or weights; None: over all of it.

    maps: of the same two pictures, where they are made already. ValueError for a mask with nothing in it.
    """
    _same_shape(reference, picture)
    weights = np.ones(reference.shape[:2]) if mask is None else np.asarray(mask, dtype=np.float64)
    if weights.sum() <= 0.0:
        raise ValueError("no pixel counts: the mask is empty")
    maps = maps or error_maps(reference, picture, exposure)
    square = np.mean((np.asarray(picture, dtype=np.float64) - reference) ** 2, axis=2)
    flip, hdr_flip, ssim, squares = (
        float(np.average(m, weights=weights)) for m in (maps.flip, maps.hdr_flip, maps.ssim, square)
    )
    return PictureError(flip, hdr_flip, float(np.sqrt(squares)), ssim)


def caustics_error(counted: np.ndarray, given: np.ndarray, mask: np.ndarray | None = None) -> CausticsError:
    """How far light under water is from the counted one; arrays of the same shape, for the same places.

    ValueError where either is even, so that nothing can be told of its pattern.
    """
    if counted.shape != given.shape:
        raise ValueError(f"the light has the shape {given.shape}, the count {counted.shape}")
    which = np.ones(counted.shape, bool) if mask is None else mask
    a, b = (np.asarray(light, dtype=np.float64)[which] for light in (counted, given))
    if a.size == 0 or a.std() == 0.0 or b.std() == 0.0:
        raise ValueError("there is no pattern to compare: the light is even")
    return CausticsError(
        correlation=float(np.corrcoef(a, b)[0, 1]),
        contrast=float((b.std() / b.mean()) / (a.std() / a.mean())),
        energy=float(b.sum() / a.sum()),
    )


def _same_shape(reference: np.ndarray, picture: np.ndarray) -> None:
    if reference.shape != picture.shape or reference.ndim != 3 or reference.shape[2] != 3:
        raise ValueError(
            f"pictures of (height, width, 3) are compared, not {picture.shape} with {reference.shape}"
        )
