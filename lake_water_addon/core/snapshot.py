# SPDX-License-Identifier: GPL-3.0-or-later
"""What a frame is drawn from: plain data, world space in float64, no Blender objects.

`extract.py` fills these from the evaluated depsgraph, `core/plan.py` reads them and
`render/` uploads them. A consumer that keeps a copy on the GPU compares `version`:
equal versions mean equal content, so nothing has to be uploaded again.

Conventions: metres, radians, scene-linear RGB, Z up. Matrices act on column vectors.
A camera looks along its own -Z with +Y up, as in Blender and OpenGL.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product

import numpy as np

from .technique_settings import TechniqueSettings
from .waves import SineWave


@dataclass(frozen=True, eq=False)
class MeshPart:
    """The triangles of one material slot: (T, 3) int32 indices into the mesh's vertices."""

    slot: int
    triangles: np.ndarray


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangulated, evaluated mesh in object space.

    positions, normals: (V, 3) float32; uvs: (V, 2) float32 or None; colors: (V, 4)
    float32 scene-linear or None. `solid` tells that the surface is closed (every edge
    has exactly two faces), so that its back faces are its inside.
    """

    key: Hashable
    version: int
    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    colors: np.ndarray | None
    parts: tuple[MeshPart, ...]
    solid: bool

    @cached_property
    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner (3,) of the box around it in object space; NaN without vertices."""
        if len(self.positions) == 0:
            return np.full(3, np.nan), np.full(3, np.nan)
        return self.positions.min(axis=0).astype(np.float64), self.positions.max(axis=0).astype(np.float64)

    def bounds_below(self, matrix: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray] | None:
        """The box around what of the triangles lies below a height, both after `matrix` (4, 4); None when
        nothing does."""
        if matrix[2, :2].any() or matrix[2, 2] <= 0.0:
            return _bounds_below(self._corners @ matrix[:3, :3].T + matrix[:3, 3], height)
        # Upright: below is the same triangles wherever it stands, so that a moving scene asks once.
        at = float((height - matrix[2, 3]) / matrix[2, 2])
        if at not in self._below:
            self._below[at] = _bounds_below(self._corners, at)
        if self._below[at] is None:
            return None
        low, high = self._below[at]
        corners = np.array(list(product(*zip(low, high, strict=True)))) @ matrix[:3, :3].T + matrix[:3, 3]
        return corners.min(axis=0), corners.max(axis=0)

    @property
    def _corners(self) -> np.ndarray:
        """(T, 3, 3) float64."""
        triangles = [part.triangles for part in self.parts] or [np.empty((0, 3), int)]
        return self.positions[np.concatenate(triangles)].astype(np.float64)

    @cached_property
    def _below(self) -> dict[float, tuple[np.ndarray, np.ndarray] | None]:
        """What `bounds_below` has found in object space."""
        return {}

    @cached_property
    def covered_area(self) -> float:
        """Area of its triangles seen along z, in the units of object space, overlaps counted twice."""
        if not self.parts:
            return 0.0
        corners = self.positions[np.concatenate([part.triangles for part in self.parts])][..., :2]
        a, b = (corners[:, i].astype(np.float64) - corners[:, 0] for i in (1, 2))
        return float(0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())

    @cached_property
    def max_slope(self) -> float:
        """The greatest |n.xy| / |n.z| of the normals in object space; inf where one lies level."""
        n = self.normals.astype(np.float64)
        level = np.hypot(n[:, 0], n[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.nan_to_num(level / np.abs(n[:, 2]), nan=np.inf, posinf=np.inf).max(initial=0.0))


def _bounds_below(corners: np.ndarray, height: float) -> tuple[np.ndarray, np.ndarray] | None:
    """The box around what of triangles (T, 3, 3) lies below a height; None when nothing does."""
    sunken = corners[..., 2] < height
    used = sunken.any(axis=1)
    if not used.any():
        return None
    corners, sunken = corners[used], sunken[used]
    points = [corners[sunken]]
    for i in range(3):  # where edges cross the height
        j = (i + 1) % 3
        start, end = (corners[sunken[:, i] != sunken[:, j], k] for k in (i, j))
        part = (height - start[:, 2:]) / (end[:, 2:] - start[:, 2:])
        points.append(start + part * (end - start))
    points = np.concatenate(points)
    return points.min(axis=0), points.max(axis=0)


@dataclass(frozen=True, eq=False)
class Material:
    """The diffuse part of a Blender material.

    base_color: (3,) scene-linear. image: name of the base-colour image (multiplied by
    nothing: it replaces base_color) or None. alpha_threshold: fragments of the image
    with less alpha are dropped; None for opaque. cull_back_faces: the user's own
    "Backface Culling" switch.
    """

    key: Hashable
    base_color: np.ndarray
    image: str | None = None
    use_color_attribute: bool = False
    alpha_threshold: float | None = None
    cull_back_faces: bool = False


@dataclass(frozen=True, eq=False)
class Draw:
    """Instances of one mesh part with one material. matrices: (n, 4, 4) float64 object to world."""

    mesh: Hashable
    part: int
    material: Hashable
    matrices: np.ndarray
    version: int


@dataclass(frozen=True, eq=False)
class Sun:
    """A directional light. direction: (3,) unit, towards the sun; irradiance: (3,) W/m^2, scene-linear."""

    direction: np.ndarray
    irradiance: np.ndarray


@dataclass(frozen=True, eq=False)
class Sky:
    """The world's light.

    radiance: (3,) the constant colour, or the mean of the image. image: name of an
    equirectangular image or None; strength multiplies it; rotation: about +Z, radians.
    irradiance_sh: (9, 3) coefficients of the diffuse irradiance divided by pi in real
    spherical harmonics (Ramamoorthi and Hanrahan 2001), ordered l,m = 00, 1-1, 10, 11,
    2-2, 2-1, 20, 21, 22, in world axes.
    """

    radiance: np.ndarray
    irradiance_sh: np.ndarray
    image: str | None = None
    strength: float = 1.0
    rotation: float = 0.0
    version: int = 0


@dataclass(frozen=True, eq=False)
class Camera:
    """view: (4, 4) world to camera, rigid; projection: (4, 4) OpenGL clip space (-w..w in depth). float64.

    Perspective or orthographic, with lens shift, pixel aspect and clip range all in `projection`.
    """

    view: np.ndarray
    projection: np.ndarray


@dataclass(frozen=True)
class WaterSettings:
    """What a person set on a water body (MODEL's symbols).

    own: settings that single techniques have, an instance of each class at most. images: (class, sampler,
    name of the image) of the images that a person chose for a technique.
    """

    k: float = 0.5
    q: float = 5.0
    c: float = 1.0
    ior: float = 1.333
    water_color: tuple[float, float, float] = (0.0, 0.2, 0.1)
    waves: tuple[SineWave, ...] = ()
    depth: float = 5.0  # m, for the dispersion relation
    own: tuple[TechniqueSettings, ...] = ()
    images: tuple[tuple[type[TechniqueSettings], str, str], ...] = ()

    def of(self, kind: type[TechniqueSettings] | None) -> TechniqueSettings | None:
        """The settings of one class of a technique's own; its defaults where none are given."""
        return None if kind is None else next((s for s in self.own if type(s) is kind), None) or kind()


@dataclass(frozen=True, eq=False)
class WaterBody:
    """One water surface over a horizontal plane.

    matrix: (4, 4) float64 object to world. Waves run in the *water frame*: origin at
    the object's location, axes turned by the object's heading (rotation about Z), in
    metres whatever the object's scale.

    grid: (resolution, half_x, half_y, center_x, center_y), a flat rectangle in the
    water frame that is tessellated on the GPU, or None when `mesh` (key of a Mesh in
    the snapshot) is to be drawn vertex for vertex.
    """

    key: Hashable
    name: str
    matrix: np.ndarray
    settings: WaterSettings
    grid: tuple[int, float, float, float, float] | None
    mesh: Hashable | None = None

    @property
    def level(self) -> float:
        """World z of the water plane."""
        return float(self.matrix[2, 3])

    @property
    def heading(self) -> float:
        """Rotation of the water frame about world Z, radians."""
        return float(np.arctan2(self.matrix[1, 0], self.matrix[0, 0]))


@dataclass(frozen=True, eq=False)
class SceneSnapshot:
    """Everything that does not depend on the view.

    version: changes when anything below changed, the time excepted. time: seconds
    since frame 0, the waves' clock. notes: what could not be taken over from Blender,
    in words for a person (unsupported nodes, skipped objects).
    """

    version: int
    time: float
    meshes: dict[Hashable, Mesh]
    materials: dict[Hashable, Material]
    draws: tuple[Draw, ...]
    sky: Sky
    sun: Sun | None = None
    waters: tuple[WaterBody, ...] = ()
    notes: tuple[str, ...] = field(default=())
