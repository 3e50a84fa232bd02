# SPDX-License-Identifier: GPL-3.0-or-later
"""What one view of a scene needs: which passes, from which cameras, and why (or why not).

A plan is made anew for each view and frame and holds only small matrices, so it is cheap.
All of it is in *render space*: world axes with the origin moved to the first water body (or
the scene's own origin without water), so that float32 on the GPU stays exact far from the
world's origin.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from . import cameras, optics, waves
from .extents import Bounds, Extents
from .glow import GlowPlan, mirror_surface, plan_glow
from .light import (
    LightCamera,
    box_corners,
    light_camera,
    seen_through,
    sunlight_in_water,
    visible_part_of_box,
)
from .settings import FrameSettings
from .snapshot import Camera, SceneSnapshot, Sun, WaterBody
from .techniques import TECHNIQUES, RefractionMap, Technique
from .under_water import (
    RAY_LENGTH,
    HeightMap,
    NearPlane,
    Side,
    ViewSide,
    height_map,
    near_plane,
    surface_band,
    view_side,
)

CLIP_CLEARANCE = 0.02
"""m: how far the clip planes lie beyond the highest (lowest) wave, the thesis's "little bit"."""

WHOLE = (0.0, 0.0, 1.0, 1.0)

LEAST_SEEN = 1.0 / 256.0
"""Part of the light that is left where the water ends the view: beyond, no caustics are needed."""

SEARCH_OVERSHOOT = 1.5
"""How far beyond the lowest point of the bottom, as a part of the depth, the search may look on its way."""

SIGHTS = 24
"""Lines of sight along each side of the picture that are asked how deep the water appears."""

MOST_RAISED = 4.0
"""Most times as high as it is that what is above is drawn from under water: at the rim of Snell's window its
apparent height has no bound."""

LEAST_DIP = 0.02
"""Least cosine of the angle of incidence that counts there: beyond, all is reflected."""

SHORTEST_SEARCH = 1.0
"""m along the ray that it may look in any case, however shallow the water."""

CASCADES = 3
"""Shadow textures, each for what is seen within a distance."""

CASCADE_RATIO = 6.0
"""Each shadow texture reaches so many times farther than the one before."""

LEAST_TEXEL = 4e-3
"""m: a nearer shadow texture is not worth while when its texels would be smaller."""

SCHLICK = 5.0
"""The exponent q of Schlick's own formula."""

MIRRORED_REACH = 0.5
"""Part of the distance of what is seen within which also what only the water shows gets shadows, at least."""

LEAST_LOD_BIAS = -2.0
"""n averaged samples lie closer than pixels by sqrt(n), and so may an image's texels: by 4 is enough."""

LEAST_SUN = 1e-3
"""Least z of the direction to a sun that lights the water: at 0.06 degrees all of it is reflected."""


@dataclass(frozen=True, eq=False)
class TexturePass:
    """A picture of the scene that the water looks up. view, projection: (4, 4) float64, render space.

    keep: +1 draws what lies below `clip_height`, -1 what lies above, 0 all; what does not reach
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
class WaterLight:
    """Sunlight below one water surface. camera: along it; what lies below `clip_height` is in its picture.

    bending: s.z / |r.z|, irradiance across a beam in the water over that of the same beam in the air;
    transmittance: 1 - F at the flat surface.
    """

    camera: LightCamera
    clip_height: float
    bending: float
    transmittance: float


@dataclass(frozen=True, eq=False)
class Spectrum:
    """How light in the water differs, by colour, from white light attenuated by k.

    absorption: (3,) 1/m, that of sunlight; sun: what of it passes the surface, relative to Schlick's term;
    sky: part of the sky's light that does; sky_absorption: (3,) 1/m of that, for each m of depth.
    """

    absorption: np.ndarray
    sun: float
    sky: float
    sky_absorption: np.ndarray


@dataclass(frozen=True, eq=False)
class UnderWater:
    """What a picture needs that begins, in all or some of its pixels, in this body of water.

    refraction: what is above, from the main camera; reflection: what is in the water, from the mirrored
    one. steps: most along a ray that is followed from the surface through their depth; 0 where they are
    looked up at RAY_LENGTH. mirrored_plane: the reflection's near plane, for its fog. heights: the map that
    tells on which side each pixel begins, None where all begin under water.
    """

    refraction: TexturePass
    reflection: TexturePass
    steps: int
    mirrored_plane: NearPlane
    heights: HeightMap | None


@dataclass(frozen=True, eq=False)
class BodyPlan:
    """One water body in one view. origin: (3,) of the water frame in render space.

    body: as the technique draws it, which may be without waves, or with a k of its own. lowest, highest:
    heights in render space of the lowest thing in it and of the highest of all. extent: (half_x, half_y,
    center_x, center_y) of the rectangle around it in the water frame.

    side: of its surface, on which the picture begins. refraction and reflection are what is looked up from
    the air; under: from the water, None when the picture does not begin in it.
    """

    body: WaterBody
    origin: np.ndarray
    packed_waves: np.ndarray
    side: ViewSide
    refraction: TexturePass
    reflection: TexturePass
    under: UnderWater | None
    drawn: bool
    reason: str
    light: WaterLight | None
    spectrum: Spectrum
    lowest: float
    highest: float
    extent: tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class FramePlan:
    """One view of one snapshot. origin: (3,) float64, world position of render space's origin.

    shadows: cameras along the sun for the shadows of what stands above the water; each holds what the view
    sees within a distance, the nearest first. Empty without sun or shadows. near_plane: where the picture
    begins. whole_height: of the whole picture, as a multiple of the drawn part's. lod_bias:
    levels of detail by which materials' images are looked up sharper (less than 0) than for a picture of one
    sample.
    """

    snapshot: SceneSnapshot
    origin: np.ndarray
    camera: Camera
    bodies: tuple[BodyPlan, ...]
    settings: FrameSettings
    technique: Technique
    shadows: tuple[LightCamera, ...]
    extents: Extents
    near_plane: NearPlane
    whole_height: float
    glow: GlowPlan
    lod_bias: float

    @property
    def reflection_depth(self) -> bool:
        """Whether the reflection texture has distances, too."""
        return self.technique.reflection_depth or _follows_reflections(self.technique, self.settings)

    @property
    def follows_refractions(self) -> bool:
        """Whether refracted rays are followed by choice, in place of the search."""
        return _follows_refractions(self.technique, self.settings)

    @property
    def immersed(self) -> int | None:
        """Index of the body that the picture begins in, wholly or in part."""
        return next((i for i, body in enumerate(self.bodies) if body.under is not None), None)


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
    settings: FrameSettings,
    *,
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0),
    jitter: tuple[float, float] = (0.0, 0.0),
    samples: int = 1,
    extents: Extents | None = None,
) -> FramePlan:
    """Plan one picture.

    camera: of the whole picture; window: the part (left, bottom, right, top) of it that is
    drawn, in 0..1 (a border render). The textures are those of the whole picture, so that a
    part of it looks the same when drawn alone. jitter: shift of the picture in device
    coordinates, for antialiasing; samples: pictures so shifted that are averaged. extents: of the
    last plan's scene, used again while they hold.
    """
    technique = TECHNIQUES[settings.technique]
    waters = tuple(_as_drawn(body, technique, settings) for body in snapshot.waters)
    origin = render_origin(snapshot)
    shift = np.eye(4)
    shift[:2, 3] = jitter
    # Light cameras follow the whole picture without its jitter: one fit serves all samples and borders.
    steady = Camera(rebase_view(camera.view, origin), camera.projection)
    whole = replace(steady, projection=shift @ camera.projection)
    drawn = replace(whole, projection=cameras.crop(whole.projection, *window))
    if extents is None or not extents.is_of(snapshot, origin):
        extents = Extents(snapshot, origin)
    begin = near_plane(drawn.view, drawn.projection)
    packed = [
        waves.pack(b.settings.waves[: waves.MAX_WAVES], snapshot.time, b.settings.depth, b.heading)
        for b in waters
    ]
    sides = _sides(waters, snapshot, origin, begin, packed)
    bodies = tuple(
        _plan_body(waters[i], snapshot, steady, whole, drawn, origin, extents, settings, packed[i], sides[i])
        for i in range(len(sides))
    )
    shadows = _plan_shadows(snapshot.sun, steady, bodies, extents.bounds, settings)
    whole_height = 1.0 / (window[3] - window[1])
    surfaces = [
        mirror_surface(body.body, snapshot.meshes.get(body.body.mesh), body.origin, body.packed_waves)
        if body.refraction.drawn
        else None
        for body in bodies
    ]
    glow = plan_glow(snapshot.sun, steady, surfaces, settings, window=window, jitter=jitter)
    return FramePlan(
        snapshot,
        origin,
        drawn,
        bodies,
        settings,
        technique,
        shadows,
        extents,
        begin,
        whole_height,
        glow,
        max(-0.5 * float(np.log2(samples)), LEAST_LOD_BIAS),
    )


def _as_drawn(body: WaterBody, technique: Technique, frame: FrameSettings) -> WaterBody:
    """The body with the grid that the picture asks for, and the settings that a technique makes its own."""
    if body.grid is not None and body.grid[0] < frame.least_grid_resolution:
        body = replace(body, grid=(frame.least_grid_resolution, *body.grid[1:]))
    own = body.settings.of(technique.settings)
    changed = {}
    if own is not None and not own.displaces:
        changed["waves"] = ()
    if technique.spectral:
        # For what knows no colours and no exact Fresnel term, such as photons and the view from under water.
        changed = {**changed, "k": float(np.mean(own.absorption)), "q": SCHLICK}
    return replace(body, settings=replace(body.settings, **changed)) if changed else body


def _follows_reflections(technique: Technique, settings: FrameSettings) -> bool:
    """Whether reflected rays are followed by choice, which takes the place of the offset c."""
    return "reflection_steps" in technique.reads and settings.reflection_steps > 0


def _follows_refractions(technique: Technique, settings: FrameSettings) -> bool:
    """Whether refracted rays are followed by choice, which takes the place of the search."""
    return "refraction_steps" in technique.reads and settings.refraction_steps > 0


def _steps_from_below(body: WaterBody, technique: Technique, settings: FrameSettings) -> int:
    """Most along a ray from the surface seen from below: as many as along one that is followed from above."""
    if technique.reflection_depth:
        return body.settings.of(technique.settings).march_steps
    return settings.reflection_steps if _follows_reflections(technique, settings) else 0


def _spectrum(body: WaterBody, sun: Sun | None, technique: Technique) -> Spectrum:
    settings = body.settings
    if not technique.spectral:
        return Spectrum(np.full(3, settings.k), 1.0, 1.0, np.zeros(3))
    n12 = 1.0 / settings.ior
    absorption = np.array(settings.of(technique.settings).absorption, dtype=np.float64)
    passed = 1.0
    if sun is not None:
        schlick = optics.schlick(sun.direction[2], optics.reflectance_at_normal(n12), settings.q)
        exact = optics.fresnel_dielectric(sun.direction[2], n12)
        passed = float((1.0 - exact) / max(1.0 - schlick, 1e-6))
    return Spectrum(
        absorption,
        passed,
        optics.diffuse_transmittance(settings.ior),
        absorption * optics.diffuse_path(settings.ior),
    )


def _sides(
    waters: tuple[WaterBody, ...],
    snapshot: SceneSnapshot,
    origin: np.ndarray,
    begin: NearPlane,
    packed: list[np.ndarray],
) -> list[ViewSide]:
    """On which side of each body's surface the picture begins; it begins in one body at most.

    Of several, that with the lowest surface: the others lie over it, as the basins of a fountain do.
    """
    sides = [
        view_side(begin, body, snapshot.meshes.get(body.mesh), body.matrix[:3, 3] - origin, of_body)
        for body, of_body in zip(waters, packed, strict=True)
    ]
    inside = [i for i, side in enumerate(sides) if side.from_below]
    for i in sorted(inside, key=lambda i: waters[i].level)[1:]:
        sides[i] = ViewSide(Side.AIR, "the camera is in another water below it", sides[i].from_above, False)
    return sides


def _plan_body(
    body: WaterBody,
    snapshot: SceneSnapshot,
    steady: Camera,
    whole: Camera,
    drawn: Camera,
    origin: np.ndarray,
    extents: Extents,
    settings: FrameSettings,
    packed: np.ndarray,
    side: ViewSide,
) -> BodyPlan:
    optics_of = body.settings
    technique = TECHNIQUES[settings.technique]
    at = body.matrix[:3, 3] - origin
    level = float(at[2])
    n12 = 1.0 / optics_of.ior
    highest = waves.max_height(optics_of.waves) + CLIP_CLEARANCE

    visible, reason = _visibility(body, snapshot, at, highest, side, drawn)
    if side.from_below:
        reason = f"{side.reason}, the surface is {reason}"
    from_above = visible and side.from_above
    seen = reason if from_above or not visible else side.reason
    wide = cameras.widen(whole.projection, settings.fov_ext)
    refraction_view, seen_as = whole.view, technique.refraction
    if _follows_refractions(technique, settings):
        seen_as = RefractionMap.APPARENT
    if seen_as is RefractionMap.TURNED:
        refraction_view = cameras.refraction_view(whole.view, whole.projection, level, n12)
    elif seen_as is RefractionMap.APPARENT:
        scale = _apparent_depth(steady, _rectangle(body, snapshot, at, 0.0), n12)
        refraction_view = cameras.flattened_view(whole.view, level, scale)
    refraction_keep = 0 if technique.refraction is RefractionMap.WHOLE else +1
    sunken = extents.below(level + highest)
    corners = _seen_surface(body, snapshot, at, highest, drawn) if visible else None
    refraction = TexturePass(
        "refraction",
        refraction_view,
        wide,
        keep=refraction_keep,
        clip_height=level + highest,
        clear_height=level - highest,
        drawn=from_above,
        reason=f"the bottom seen through it: {seen}",
        region=_refraction_region(corners, body, level + highest, drawn, wide @ refraction_view, sunken)
        if from_above and refraction_keep
        else WHOLE,
    )
    mirrored = cameras.mirrored_view(whole.view, level)
    reflection = TexturePass(
        "reflection",
        mirrored,
        wide,
        keep=-1,
        clip_height=level - highest,
        clear_height=level + highest,
        drawn=from_above,
        reason=f"what it mirrors: {seen}",
        # Only those that look it up at U + c R stay near U.
        region=_reflection_region(corners, body, level + highest, drawn, wide @ mirrored)
        if from_above and "c" in technique.reads and not _follows_reflections(technique, settings)
        else WHOLE,
    )
    under = None
    if side.from_below:
        steps = _steps_from_below(body, technique, settings)
        under = _plan_under_water(
            body, snapshot, at, highest, steady, whole, drawn, wide, side, visible, corners, reason, steps
        )
    light = None
    is_lit = snapshot.sun is not None and snapshot.sun.direction[2] >= LEAST_SUN
    if (visible or side.from_below) and is_lit and sunken is not None:
        light = _plan_light(body, snapshot, steady, at, highest, sunken, settings, side)
    return BodyPlan(
        body,
        at,
        packed,
        side,
        refraction,
        reflection,
        under,
        visible,
        reason,
        light,
        _spectrum(body, snapshot.sun, technique),
        float(sunken[0][2]) if sunken is not None else level - highest,
        float(extents.bounds[1][2]) if extents.bounds is not None else level,
        _extent(body, snapshot),
    )


def _plan_under_water(
    body: WaterBody,
    snapshot: SceneSnapshot,
    at: np.ndarray,
    highest: float,
    steady: Camera,
    whole: Camera,
    drawn: Camera,
    wide: np.ndarray,
    side: ViewSide,
    visible: bool,
    corners: np.ndarray | None,
    reason: str,
    steps: int,
) -> UnderWater:
    """The passes of a picture that begins in this body; the surface needs its textures when it is seen.

    corners: of the part that is seen, as `_seen_surface` has them. steps: as `UnderWater` has them. Where
    rays are followed, what is above is drawn as high as it appears: the camera below sees land from beneath,
    where it has no faces, and what appears higher is seen more from above.
    """
    level = float(at[2])
    mirrored = cameras.mirrored_view(whole.view, level)
    longest = RAY_LENGTH * np.hypot(body.settings.ior, body.settings.ior - 1.0)  # of R1, seen edge on
    reach = np.array(list(product((-longest, longest), repeat=3)))
    above = whole.view
    if steps:
        scale = _apparent_height(steady, _rectangle(body, snapshot, at, 0.0), body.settings.ior)
        above = cameras.flattened_view(whole.view, level, scale)
    refraction = TexturePass(
        "refraction from below",
        above,
        wide,
        keep=-1,
        clip_height=level - highest,
        clear_height=level + highest,
        drawn=visible,
        reason=f"what is seen through the surface from below: {reason}",
        region=WHOLE if steps else _region_around(corners, wide @ above, reach),
    )
    reflection = TexturePass(
        "reflection from below",
        mirrored,
        wide,
        keep=+1,
        clip_height=level + highest,
        clear_height=level - highest,
        drawn=visible,
        reason=f"what the surface mirrors from below: {reason}",
        region=WHOLE if steps else _region_around(corners, wide @ mirrored, reach),
    )
    heights = None
    if side.side is Side.SPLIT:
        begin = near_plane(drawn.view, drawn.projection)
        heights = height_map(begin, *surface_band(body, snapshot.meshes.get(body.mesh), at))
    return UnderWater(refraction, reflection, steps, near_plane(mirrored, wide), heights)


def _plan_light(
    body: WaterBody,
    snapshot: SceneSnapshot,
    camera: Camera,
    at: np.ndarray,
    highest: float,
    sunken: Bounds,
    settings: FrameSettings,
    side: ViewSide,
) -> WaterLight | None:
    """Sunlight in the part of the water that the view sees; None when that has no bottom.

    sunken: the box around all that reaches below the highest wave.
    """
    sun = snapshot.sun.direction
    n12 = 1.0 / body.settings.ior
    level = float(at[2])
    depth = max(level - float(sunken[0][2]), highest)
    reach = -np.log(LEAST_SEEN) / max(body.settings.k, 1e-9)
    points = _seen_in_water(body, snapshot, camera, at, highest, min(depth, reach), n12, side)
    if len(points) == 0:
        return None
    direction = sunlight_in_water(sun, n12)
    # Waves turn a ray of sunlight by at most about half their slope.
    margin = highest + 0.5 * _greatest_slope(body) * min(depth, reach)
    fresnel = optics.schlick(sun[2], optics.reflectance_at_normal(n12), body.settings.q)
    camera = light_camera(direction, points, sunken, settings.light_depth_size, margin, within=sunken)
    if camera is None:
        return None
    return WaterLight(
        camera,
        level + highest,
        float(sun[2] / -direction[2]),
        float(1.0 - fresnel),
    )


def _seen_in_water(
    body: WaterBody,
    snapshot: SceneSnapshot,
    camera: Camera,
    at: np.ndarray,
    highest: float,
    depth: float,
    n12: float,
    side: ViewSide,
) -> np.ndarray:
    """(n, 3) points around all that the view sees below the surface, down to `depth` m."""
    to_clip = camera.projection @ camera.view
    points = [np.empty((0, 3))]
    if side.from_above:
        polygons = [
            cameras.clip_polygon(_rectangle(body, snapshot, at, height), to_clip)
            for height in (-highest, highest)
        ]
        polygon = np.concatenate(polygons)
        points.append(polygon)
        if len(polygon):
            directions = seen_through(polygon, camera.view, camera.projection, n12)
            points.append(polygon + directions * (depth / np.maximum(-directions[:, 2:], 1e-3)))
    if side.from_below or cameras.eye_position(camera.view)[2] < at[2] + highest:
        # From below the surface the view volume itself lies in the water.
        low, high = (f(_rectangle(body, snapshot, at, 0.0), axis=0) for f in (np.min, np.max))
        low[2], high[2] = at[2] - depth, at[2] + highest
        points.append(visible_part_of_box(low, high, to_clip))
    return np.concatenate(points)


def _plan_shadows(
    sun: Sun | None,
    camera: Camera,
    bodies: tuple[BodyPlan, ...],
    bounds: Bounds | None,
    settings: FrameSettings,
) -> tuple[LightCamera, ...]:
    """Cameras for the sun's shadows on all that the view sees, and on the water that lights its bottom.

    What is seen in the water alone gets a window of its own, at the end, when there is one left; else the
    largest one takes in what of it is near.
    """
    if sun is None or bounds is None or not settings.use_shadows:
        return ()
    to_clip = camera.projection @ camera.view
    seen = visible_part_of_box(*bounds, to_clip)
    surfaces = [_surface_of(b.light.camera, float(b.origin[2])) for b in bodies if b.light is not None]
    points = np.concatenate([seen, *surfaces])
    size, along = settings.light_depth_size, -sun.direction
    found: list[LightCamera] = []
    eye, distance = cameras.eye_position(camera.view), np.inf
    if len(seen) and not cameras.is_orthographic(camera.projection):
        distance = float(np.linalg.norm(seen - eye, axis=1).max())
        reach = distance
        for _ in range(1, CASCADES):
            reach /= CASCADE_RATIO
            near = _around(eye, reach, bounds)
            if 2.0 * reach < LEAST_TEXEL * size or np.any(near[0] > near[1]):
                break
            seen = visible_part_of_box(*near, to_clip)
            if len(seen) == 0:
                break
            found.insert(0, light_camera(along, seen, bounds, size, steady=True))
    spare = len(found) < CASCADES - 1
    within = bounds if spare else _around(eye, MIRRORED_REACH * distance, bounds)
    mirrored = np.concatenate([points, *_seen_in_surfaces(camera, bodies, within, settings)])
    if len(points) and spare:
        found.append(light_camera(along, points, bounds, size))
    if len(mirrored) > len(points) or not spare:
        largest = light_camera(along, mirrored, bounds, size)
        if not found or largest.key != found[-1].key:
            found.append(largest)
    return tuple(found)


def _around(eye: np.ndarray, reach: float, bounds: Bounds) -> Bounds:
    """The part of a box that lies within a cube around the eye; its corners are exchanged when none does."""
    return np.maximum(bounds[0], eye - reach), np.minimum(bounds[1], eye + reach)


def _seen_in_surfaces(
    camera: Camera, bodies: tuple[BodyPlan, ...], bounds: Bounds, settings: FrameSettings
) -> list[np.ndarray]:
    """Points (n, 3) around what the surfaces show of the air, mirrored or from below."""
    wide = cameras.widen(camera.projection, settings.fov_ext)
    found = []
    for body in bodies:
        mirrored = cameras.mirrored_view(camera.view, float(body.origin[2]))
        views = [(mirrored, body.reflection)] if body.reflection.drawn else []
        if body.under is not None and body.under.refraction.drawn:
            views.append((camera.view, body.under.refraction))
        for view, looked_up in views:
            low = np.append(bounds[0][:2], max(bounds[0][2], looked_up.clip_height))
            if np.all(low <= bounds[1]):
                found.append(visible_part_of_box(low, bounds[1], wide @ view))
    return found


def _surface_of(camera: LightCamera, level: float) -> np.ndarray:
    """(4, 3) corners of the part of the plane z = level that a light camera's picture holds."""
    to_render = np.linalg.inv(camera.projection @ camera.view)
    corners = np.array([(x, y, 0.0, 1.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)]) @ to_render.T
    along = (level - corners[:, 2]) / camera.direction[2]
    return corners[:, :3] + along[:, None] * camera.direction


def _visibility(
    body: WaterBody,
    snapshot: SceneSnapshot,
    at: np.ndarray,
    highest: float,
    side: ViewSide,
    camera: Camera,
) -> tuple[bool, str]:
    """Whether the water's surface has to be drawn at all, and why."""
    if not (side.from_above or side.from_below):
        return False, side.reason
    if body.grid is not None:
        points = np.concatenate([_rectangle(body, snapshot, at, height) for height in (-highest, highest)])
        clip = cameras.to_clip(camera.projection @ camera.view, points)
        for axis in range(3):
            for edge in (-1.0, 1.0):
                if np.all(edge * clip[:, axis] > clip[:, 3]):
                    return False, "out of the picture"
    return True, "in the picture"


def _rectangle(body: WaterBody, snapshot: SceneSnapshot, at: np.ndarray, height: float) -> np.ndarray:
    """(4, 3) corners of a rectangle around the body in render space, so high above its plane, in order.

    Of a body that is a mesh, the rectangle along the axes around its bounding box.
    """
    if body.grid is None:
        corners = box_corners(*snapshot.meshes[body.mesh].bounds) @ body.matrix[:3, :3].T
        low, high = corners.min(axis=0), corners.max(axis=0)
        x, y = np.array([low[0], high[0], high[0], low[0]]), np.array([low[1], low[1], high[1], high[1]])
        return np.stack([x, y, np.full(4, height)], axis=1) + at
    _, half_x, half_y, center_x, center_y = body.grid
    x = center_x + half_x * np.array([-1.0, 1.0, 1.0, -1.0])
    y = center_y + half_y * np.array([-1.0, -1.0, 1.0, 1.0])
    cos_h, sin_h = np.cos(body.heading), np.sin(body.heading)
    return np.stack([cos_h * x - sin_h * y, sin_h * x + cos_h * y, np.full(4, height)], axis=1) + at


def _extent(body: WaterBody, snapshot: SceneSnapshot) -> tuple[float, float, float, float]:
    """Half extents and centre, along the water frame's axes, of the rectangle around the body."""
    if body.grid is not None:
        return body.grid[1:]
    corners = box_corners(*snapshot.meshes[body.mesh].bounds) @ body.matrix[:3, :3].T
    cos_h, sin_h = np.cos(body.heading), np.sin(body.heading)
    in_frame = corners[:, :2] @ np.array([[cos_h, -sin_h], [sin_h, cos_h]])
    low, high = in_frame.min(axis=0), in_frame.max(axis=0)
    return (*(0.5 * (high - low)).tolist(), *(0.5 * (low + high)).tolist())


def _reflection_region(
    corners: np.ndarray | None,
    body: WaterBody,
    top: float,
    camera: Camera,
    to_texture_clip: np.ndarray,
) -> tuple[float, float, float, float]:
    """The part of the reflection texture that U + c R can fall into, for any U in the picture and any R.

    corners: as `_seen_surface` has them; top: height of the highest wave.
    """
    if cameras.eye_position(camera.view)[2] < top:
        return WHOLE  # the mirrored eye is among the waves: lookups are raised to its horizon
    c = body.settings.c
    reach = np.array([(x, y, z) for x in (-c, c) for y in (-c, c) for z in (min(c, 0.0), max(c, 0.0))])
    return _region_around(corners, to_texture_clip, reach)


def _seen_cosines(camera: Camera, rectangle: np.ndarray) -> np.ndarray:
    """(n,) cosines of the angles at which lines of sight, even in the picture, meet a level rectangle."""
    line = np.linspace(-1.0, 1.0, SIGHTS)
    ndc = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    ends = np.array([(x, y, z, 1.0) for z in (-1.0, 0.5) for x, y in ndc])
    ends = ends @ np.linalg.inv(camera.projection @ camera.view).T
    near, beyond = np.split(ends[:, :3] / ends[:, 3:], 2)
    sight = beyond - near
    cosine = np.abs(sight[:, 2]) / np.linalg.norm(sight, axis=1)
    reaches = cosine > LEAST_DIP
    along = (rectangle[0, 2] - near[:, 2]) / np.where(reaches, sight[:, 2], 1.0)
    hit = (near + along[:, None] * sight)[:, None, :2]
    edge = np.roll(rectangle, -1, axis=0)[:, :2] - rectangle[:, :2]
    offset = hit - rectangle[:, :2]
    within = edge[:, 0] * offset[..., 1] - edge[:, 1] * offset[..., 0]
    seen = reaches & (along > 0.0) & (np.all(within >= 0.0, axis=1) | np.all(within <= 0.0, axis=1))
    return cosine[seen]


def _apparent_depth(camera: Camera, rectangle: np.ndarray, n12: float) -> float:
    """The mean apparent depth of the water that the picture shows in a rectangle (4, 3); n12 where none."""
    cosine = _seen_cosines(camera, rectangle)
    return float(cameras.apparent_depth(cosine, n12).mean()) if len(cosine) else n12


def _apparent_height(camera: Camera, rectangle: np.ndarray, ior: float) -> float:
    """The least apparent height of what a picture from below shows through a rectangle (4, 3): with a greater
    one, part of it would be drawn beyond the picture; ior where all is reflected."""
    cosine = _seen_cosines(camera, rectangle)
    if len(cosine) == 0 or cosine.max() ** 2 <= 1.0 - 1.0 / ior**2:
        return ior
    return min(float(cameras.apparent_depth(cosine.max(), ior)), MOST_RAISED)


def _refraction_region(
    corners: np.ndarray | None,
    body: WaterBody,
    top: float,
    camera: Camera,
    to_texture_clip: np.ndarray,
    sunken: Bounds | None,
) -> tuple[float, float, float, float]:
    """The part of the refraction texture that the search can look up on its way to the bottom and beyond.

    corners: as `_seen_surface` has them; top: height of the highest wave.
    """
    if corners is None or sunken is None:
        return WHOLE
    depth = top - float(sunken[0][2])
    directions = seen_through(corners, camera.view, camera.projection, 1.0 / body.settings.ior)
    length = np.maximum(SEARCH_OVERSHOOT * depth / np.maximum(-directions[:, 2:], 1e-3), SHORTEST_SEARCH)
    along = directions * length
    turned = 0.5 * _greatest_slope(body) * max(SEARCH_OVERSHOOT * depth, SHORTEST_SEARCH)
    box = np.array(list(product((-turned, turned), (-turned, turned), (0.0,))))
    return _region_around(np.concatenate([corners, corners + along]), to_texture_clip, box)


def _greatest_slope(body: WaterBody) -> float:
    """Tangent of the steepest slope that the waves can add up to; 1 when that is more."""
    return min(sum(2.0 * np.pi * abs(w.amplitude) / w.wavelength for w in body.settings.waves), 1.0)


def _seen_surface(
    body: WaterBody, snapshot: SceneSnapshot, at: np.ndarray, highest: float, camera: Camera
) -> np.ndarray | None:
    """Corners (n, 3) of the visible part of the slab between the lowest and the highest wave; None when they
    are not known."""
    if body.grid is None:
        return None
    to_clip = camera.projection @ camera.view
    visible = [
        cameras.clip_polygon(_rectangle(body, snapshot, at, height), to_clip)
        for height in (-highest, highest)
    ]
    return np.concatenate(visible) if min(len(polygon) for polygon in visible) else None


def _region_around(
    points: np.ndarray | None, to_texture_clip: np.ndarray, reach: np.ndarray
) -> tuple[float, float, float, float]:
    """The part of a texture that points (n, 3) with a box (m, 3) around each fall into; all for None."""
    if points is None:
        return WHOLE
    clip = cameras.to_clip(to_texture_clip, (points[:, None] + reach).reshape(-1, 3))
    if clip[:, 3].min() <= 1e-6:
        return WHOLE
    uv = np.clip(0.5 * clip[:, :2] / clip[:, 3:] + 0.5, 0.0, 1.0)
    return (*uv.min(axis=0).tolist(), *uv.max(axis=0).tolist())


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
