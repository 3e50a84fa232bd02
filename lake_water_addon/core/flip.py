# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP: how different two displayed pictures look when one is flipped with the other.

By the paper: P. Andersson, J. Nilsson, T. Akenine-Möller, M. Oskarsson, K. Åström and M. D. Fairchild, "FLIP:
A Difference Evaluator for Alternating Images", Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020. All its
filters are sums of products of one along x and one along y, and are applied so.
"""

from __future__ import annotations

import numpy as np

from .sky import linear_from_srgb

PIXELS_PER_DEGREE = 0.7 * (3840.0 / 0.7) * np.pi / 180.0
"""Seen from 0.7 m, a screen 0.7 m wide of 3840 pixels: the paper's own choice."""

CONTRAST = {"Y": ((1.0, 0.0047),), "Cx": ((1.0, 0.0053),), "Cz": ((34.1, 0.04), (13.5, 0.025))}
"""Contrast sensitivity: (a, b) of Gaussians a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees."""

FEATURE_WIDTH = 0.082
"""Degrees: width of the edges and points that an eye finds best."""

COLOR_EXPONENT, FEATURE_EXPONENT = 0.7, 0.5

SMALL_PART, SMALL_RANGE = 0.4, 0.95
"""Colour differences up to this part of the greatest get this part of the range."""

_DELTA = 6.0 / 29.0


def _to_xyz() -> np.ndarray:
    """(3, 3) linear sRGB to CIE XYZ, from the primaries and D65 of IEC 61966-2-1."""
    xy = np.array([(0.64, 0.33), (0.30, 0.60), (0.15, 0.06)])
    white = np.array([0.3127, 0.3290])
    columns = np.column_stack([xy, 1.0 - xy.sum(axis=1)]).T
    target = np.append(white, 1.0 - white.sum()) / white[1]
    return columns * np.linalg.solve(columns, target)


_XYZ = _to_xyz()
_WHITE = _XYZ.sum(axis=1)


def _opponent(linear: np.ndarray) -> np.ndarray:
    """YCxCz of linear RGB (..., 3)."""
    x, y, z = np.moveaxis(linear @ (_XYZ / _WHITE[:, None]).T, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def _from_opponent(color: np.ndarray) -> np.ndarray:
    """Linear RGB of YCxCz (..., 3)."""
    y = (color[..., 0] + 16.0) / 116.0
    xyz = np.stack([y + color[..., 1] / 500.0, y, y - color[..., 2] / 200.0], axis=-1) * _WHITE
    return xyz @ np.linalg.inv(_XYZ).T


def _lab_with_hunt(linear: np.ndarray) -> np.ndarray:
    """CIELAB of linear RGB (..., 3), less colourful where it is dark (Hunt)."""
    relative = linear @ (_XYZ / _WHITE[:, None]).T
    f = np.where(
        relative > _DELTA**3, np.cbrt(np.maximum(relative, 0.0)), relative / (3.0 * _DELTA**2) + 4.0 / 29.0
    )
    lightness = 116.0 * f[..., 1] - 16.0
    a, b = 500.0 * (f[..., 0] - f[..., 1]), 200.0 * (f[..., 1] - f[..., 2])
    return np.stack([lightness, 0.01 * lightness * a, 0.01 * lightness * b], axis=-1)


def _hyab(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Distance of colours far apart: city block in lightness, Euclidean in the rest."""
    apart = one - other
    return np.abs(apart[..., 0]) + np.hypot(apart[..., 1], apart[..., 2])


_GREATEST = float(
    _hyab(_lab_with_hunt(np.array([0.0, 1.0, 0.0])), _lab_with_hunt(np.array([0.0, 0.0, 1.0])))
    ** COLOR_EXPONENT
)


def _convolve(image: np.ndarray, along_x: np.ndarray, along_y: np.ndarray) -> np.ndarray:
    """An image (h, w) with a separable filter of odd lengths; its border is repeated outside."""
    for kernel, axis in ((along_x, 1), (along_y, 0)):
        reach = len(kernel) // 2
        widths = [(reach, reach) if i == axis else (0, 0) for i in range(2)]
        padded = np.pad(image, widths, mode="edge")
        length = image.shape[axis]
        image = sum(
            weight * (padded[:, i : i + length] if axis == 1 else padded[i : i + length])
            for i, weight in enumerate(kernel[::-1])
        )
    return image


def _gaussians(pixels_per_degree: float) -> dict[str, list[tuple[float, np.ndarray]]]:
    """By channel, the (weight, filter of sum 1) whose weighted sum is the filter of `CONTRAST`."""
    widest = max(b for terms in CONTRAST.values() for _, b in terms)
    reach = int(np.ceil(3.0 * np.sqrt(widest / (2.0 * np.pi**2)) * pixels_per_degree))
    x = np.arange(-reach, reach + 1) / pixels_per_degree
    found = {}
    for channel, terms in CONTRAST.items():
        parts = []
        for a, b in terms:
            kernel = np.exp(-(np.pi**2) * x**2 / b)
            parts.append((a * np.sqrt(np.pi / b) * kernel.sum() ** 2, kernel / kernel.sum()))
        whole = sum(weight for weight, _ in parts)
        found[channel] = [(weight / whole, kernel) for weight, kernel in parts]
    return found


def _features(luminance: np.ndarray, pixels_per_degree: float) -> tuple[np.ndarray, np.ndarray]:
    """How much of an edge, and of a point, is where in an image (h, w)."""
    deviation = 0.5 * FEATURE_WIDTH * pixels_per_degree
    x = np.arange(-(reach := int(np.ceil(3.0 * deviation))), reach + 1)
    bell = np.exp(-(x**2) / (2.0 * deviation**2))
    smooth = bell / bell.sum()
    found = []
    for kernel in (-x * bell, (x**2 / deviation**2 - 1.0) * bell):
        # Each filter gives 1 for what is just like it: what raises and what lowers adds up to 1.
        raising, lowering = np.maximum(kernel, 0.0), np.minimum(kernel, 0.0)
        feature = raising / raising.sum() - lowering / lowering.sum()
        found.append(np.hypot(_convolve(luminance, feature, smooth), _convolve(luminance, smooth, feature)))
    return found[0], found[1]


class FlipReference:
    """A picture that others are compared with. picture: (h, w, 3) in 0..1, encoded as sRGB."""

    def __init__(self, picture: np.ndarray, pixels_per_degree: float = PIXELS_PER_DEGREE) -> None:
        self._pixels_per_degree = pixels_per_degree
        self._seen = self._as_seen(picture)

    def _as_seen(self, picture: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(colour as an eye sees it (h, w, 3), edges (h, w), points (h, w))."""
        opponent = _opponent(linear_from_srgb(np.clip(np.asarray(picture, np.float64), 0.0, 1.0)))
        filters = _gaussians(self._pixels_per_degree).values()
        blurred = np.stack(
            [
                sum(weight * _convolve(opponent[..., i], kernel, kernel) for weight, kernel in terms)
                for i, terms in enumerate(filters)
            ],
            axis=-1,
        )
        color = _lab_with_hunt(np.clip(_from_opponent(blurred), 0.0, 1.0))
        return color, *_features((opponent[..., 0] + 16.0) / 116.0, self._pixels_per_degree)

    def compare(self, picture: np.ndarray) -> np.ndarray:
        """(h, w) FLIP of a picture like the reference, 0 for none to 1. ValueError for another shape."""
        color, edges, points = self._seen
        if picture.shape != color.shape:
            raise ValueError(f"a picture of {picture.shape} cannot be compared with one of {color.shape}")
        other_color, other_edges, other_points = self._as_seen(picture)
        difference = _hyab(color, other_color) ** COLOR_EXPONENT
        part = SMALL_PART * _GREATEST
        difference = np.where(
            difference < part,
            SMALL_RANGE / part * difference,
            SMALL_RANGE + (difference - part) / (_GREATEST - part) * (1.0 - SMALL_RANGE),
        )
        feature = np.maximum(np.abs(edges - other_edges), np.abs(points - other_points))
        return difference ** (1.0 - (feature / np.sqrt(2.0)) ** FEATURE_EXPONENT)


def reach(pixels_per_degree: float = PIXELS_PER_DEGREE) -> int:
    """Pixels beside it that the value of a pixel depends on."""
    widest = max(b for terms in CONTRAST.values() for _, b in terms)
    spread = max(np.sqrt(widest / (2.0 * np.pi**2)), 0.5 * FEATURE_WIDTH)
    return int(np.ceil(3.0 * spread * pixels_per_degree))
