# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture that the optical model asks for, with no texture, no search and no approximation of a ray.

Each camera ray meets the analytic surface or the real geometry. At the surface it is split by Fresnel's
equations into the refracted and the reflected ray, each of which goes on in the same way. What it ends on is
lit as the extension lights it (`core.lighting`): Lambert, the sun with shadow rays, the sky by spherical
harmonics, and under water the sun by a count of photons (`photons`).

What stays out, as no part of the model: light between diffuse surfaces, sunlight that the water throws back
into the air, the sky's occlusion, and the sun's own mirror image (the extension's glow).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
from tqdm import tqdm

from lake_water_addon.core import lighting, optics
from lake_water_addon.core.plan import rebase_view, render_origin
from lake_water_addon.core.snapshot import Camera, SceneSnapshot, WaterSettings
from lake_water_addon.core.under_water import near_plane

from .geometry import Geometry, Hits, SurfacePoints, clearance
from .images import Images, sky_radiance
from .optics import WaterOptics, project_optics
from .photons import Sunlight
from .water import Surface

CHUNK = 1 << 15
"""Rays that are followed at a time."""

MAX_MEETINGS = 5
"""Times that a ray meets the water; from the last on it sees sky or endless water."""

LEAST_WEIGHT = 1e-4
"""What counts less is not followed."""

AIR = -1

SCOUTS = 40_000
"""Camera rays that look for the places under water which need light."""


class Picture(NamedTuple):
    """radiance: (h, w, 3) scene-linear; water: (h, w) part of each pixel that shows a water surface first.

    First row at the bottom.
    """

    radiance: np.ndarray
    water: np.ndarray


class Rays(NamedTuple):
    """origin, direction: (n, 3); medium: (n,) number of the body that they are in, or AIR.

    weight: (n, 3) of what they see in the pixel (n,), times `scale` (n,) for what has radiance of its own.
    """

    origin: np.ndarray
    direction: np.ndarray
    medium: np.ndarray
    pixel: np.ndarray
    weight: np.ndarray
    scale: np.ndarray

    def take(self, which: np.ndarray) -> Rays:
        """Some of them."""
        return Rays(*(array[which] for array in self))


class Meeting(NamedTuple):
    """What rays meet first. distance: (n,) m, inf for nothing; body: (n,) number of the surface, or AIR where
    it is something else; normal: (n, 3) of the water, to the air; triangle: (n,), -1 where there is none."""

    distance: np.ndarray
    body: np.ndarray
    normal: np.ndarray
    triangle: np.ndarray


class Reference:
    """A snapshot, ready to be traced.

    images: pixels of the textures that it names; water_optics: what a body's settings mean, `project_optics`
    or `physical_optics`. ValueError for water that is no rectangle, KeyError for a missing image.
    """

    def __init__(
        self,
        snapshot: SceneSnapshot,
        images: Images | None = None,
        *,
        water_optics: Callable[[WaterSettings], WaterOptics] = project_optics,
        workers: int = 2,
        quiet: bool = True,
    ) -> None:
        self.snapshot = snapshot
        self.origin = render_origin(snapshot)
        self.images = images or {}
        self.geometry = Geometry(snapshot, images)
        self.surfaces = [Surface(body, snapshot.time, self.origin) for body in snapshot.waters]
        self.optics = [water_optics(body.settings) for body in snapshot.waters]
        self.sunlight: list[Sunlight | None] = [None] * len(self.surfaces)
        sun = snapshot.sun
        if sun is not None and sun.direction[2] > 0.0:
            self.sunlight = [
                Sunlight(self.geometry, surface, water, sun)
                for surface, water in zip(self.surfaces, self.optics, strict=True)
            ]
        self._workers, self._quiet = workers, quiet

    def progress(self, chunks: Iterable, number: int, what: str) -> Iterable:
        """A bar on stderr, unless quiet."""
        return tqdm(chunks, desc=what, total=number, disable=self._quiet, leave=False)

    def camera_rays(self, camera: Camera, ndc: np.ndarray) -> Rays:
        """The rays through device coordinates (n, 2), from the near plane on; pixels numbered in order."""
        begin = near_plane(rebase_view(camera.view, self.origin), camera.projection)
        origin = begin.point(ndc)
        if begin.orthographic:
            direction = np.broadcast_to(np.cross(begin.right, begin.up), origin.shape) * -1.0
        else:
            direction = origin - begin.origin
        direction = direction / np.linalg.norm(direction, axis=1, keepdims=True)
        medium = np.full(len(ndc), AIR)
        for i, surface in enumerate(self.surfaces):
            medium[surface.contains(origin)] = i
        weight, scale = np.ones((len(ndc), 3)), np.ones(len(ndc))
        return Rays(origin, direction, medium, np.arange(len(ndc)), weight, scale)

    def meet(self, rays: Rays) -> Meeting:
        """What each ray meets first: the surface of a body or anything else."""
        hits = self.geometry.first_hits(rays.origin, rays.direction)
        distance, triangle = hits.distance.copy(), hits.triangle.copy()
        body = np.full(len(distance), AIR)
        normal = np.zeros_like(rays.origin)
        for i, surface in enumerate(self.surfaces):
            for medium, side in ((AIR, +1.0), (i, -1.0)):
                these = np.flatnonzero(rays.medium == medium)
                found = surface.first_hits(rays.origin[these], rays.direction[these], side)
                nearer = found.distance < distance[these]
                these, of_these = these[nearer], found.distance[nearer]
                distance[these], body[these], normal[these] = of_these, i, found.normal[nearer]
                triangle[these] = -1
        return Meeting(distance, body, normal, triangle)

    def split(self, rays: Rays, met: Meeting) -> tuple[Rays, Rays]:
        """The reflected and the refracted rays of those that met a surface, without what counts little."""
        place = rays.origin + met.distance[:, None] * rays.direction
        from_air = rays.medium == AIR
        normal = np.where(from_air[:, None], met.normal, -met.normal)
        ior = np.array([water.ior for water in self.optics])[met.body]
        leaving = np.array([water.leaving for water in self.optics])[met.body]
        n12 = np.where(from_air, 1.0 / ior, ior)
        cosine = -np.sum(normal * rays.direction, axis=1)
        fresnel, bent, exists = np.empty(len(place)), np.empty_like(place), np.empty(len(place), bool)
        for value in np.unique(n12):
            these = n12 == value
            fresnel[these] = optics.fresnel_dielectric(cosine[these], value)
            bent[these], exists[these] = optics.refract_direction(rays.direction[these], normal[these], value)
        mirrored = optics.reflect_direction(rays.direction, normal)
        reflected = rays._replace(
            origin=place,
            direction=mirrored / np.linalg.norm(mirrored, axis=1, keepdims=True),
            weight=rays.weight * fresnel[:, None],
        )
        refracted = rays._replace(
            origin=place,
            direction=bent / np.maximum(np.linalg.norm(bent, axis=1, keepdims=True), 1e-300),
            medium=np.where(from_air, met.body, AIR),
            weight=rays.weight * (1.0 - fresnel)[:, None],
            scale=rays.scale * np.where(from_air, leaving, 1.0 / leaving),
        )
        exists &= refracted.weight.max(axis=1) > LEAST_WEIGHT
        return reflected.take(reflected.weight.max(axis=1) > LEAST_WEIGHT), refracted.take(exists)

    def through_water(self, rays: Rays, distance: np.ndarray) -> tuple[Rays, np.ndarray]:
        """The rays after `distance` (n,) m, with the weight that is left, and (n, 3) what the water adds."""
        weight, added = rays.weight.copy(), np.zeros_like(rays.weight)
        for i, water in enumerate(self.optics):
            these = rays.medium == i
            a = np.exp(-np.minimum(distance[these, None], 1e30) * water.absorption)
            added[these] = weight[these] * (1.0 - a) * water.color
            weight[these] *= a
        return rays._replace(weight=weight), added

    def shade(self, found: SurfacePoints, medium: np.ndarray) -> np.ndarray:
        """(n, 3) radiance of surfaces in the air, or in the body of water `medium` (n,)."""
        snapshot = self.snapshot
        sun, sky = np.zeros_like(found.position), np.ones_like(found.position)
        if snapshot.sun is not None:
            irradiance = lighting.sun_in_air(found.normal, snapshot.sun)
            these = np.flatnonzero((medium == AIR) & (irradiance.max(axis=1) > 0.0))
            to_sun = snapshot.sun.direction
            face, position = found.face[these], found.position[these]
            side = np.where(np.sum(face * to_sun, axis=1, keepdims=True) < 0.0, -1.0, 1.0)
            start = position + side * face * clearance(position)
            hidden = self.geometry.occluded(start, np.broadcast_to(to_sun, start.shape))
            sun[these] = irradiance[these] * ~hidden[:, None]
        for i, water in enumerate(self.optics):
            these = medium == i
            position = found.position[these]
            if self.sunlight[i] is not None:
                sun[these] = self.sunlight[i].irradiance(position, found.normal[these], found.face[these])
            depth = np.maximum(self.surfaces[i].origin[2] - position[:, 2], 0.0)
            sky[these] = water.sky * np.exp(-depth[:, None] * water.sky_absorption)
        return lighting.diffuse_radiance(found.albedo, found.normal, sun, sky, snapshot.sky)

    def _radiance(
        self, rays: Rays, count: int, visit: Callable[[Rays, SurfacePoints], None] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """(count, 3) radiance of the pixels and (count,) whether they show water first.

        visit: is called with rays that ended on something, in place of shading that.
        """
        radiance = np.zeros((count, 3))
        shows_water = np.zeros(count, bool)
        for meeting in range(MAX_MEETINGS + 1):
            if len(rays.pixel) == 0:
                break
            met = self.meet(rays)
            if meeting == 0:
                shows_water[rays.pixel[met.body != AIR]] = True
            rays, added = self.through_water(rays, met.distance)
            np.add.at(radiance, rays.pixel, added)
            ended = np.flatnonzero(met.triangle >= 0)
            if len(ended):
                seen = rays.take(ended)
                hits = Hits(met.triangle[ended], met.distance[ended])
                found = self.geometry.surface(hits, seen.origin, seen.direction)
                if visit is not None:
                    visit(seen, found)
                else:
                    light = self.shade(found, seen.medium) * seen.scale[:, None]
                    np.add.at(radiance, seen.pixel, seen.weight * light)
            surface = met.body != AIR
            last = meeting == MAX_MEETINGS
            free = (rays.medium == AIR) & (met.triangle < 0) & (last | ~surface)
            seen = rays.take(free)
            sky = sky_radiance(self.snapshot.sky, self.images, seen.direction) * seen.scale[:, None]
            np.add.at(radiance, seen.pixel, seen.weight * sky)
            if last:
                _add_water(radiance, rays.take(surface & (rays.medium != AIR)), self.optics)
                break
            reflected, refracted = self.split(rays.take(surface), Meeting(*(a[surface] for a in met)))
            rays = Rays(*(np.concatenate(pair) for pair in zip(reflected, refracted, strict=True)))
        return radiance, shows_water

    def count_photons(self, camera: Camera, photons: int) -> None:
        """Light what a camera sees under water, by so many photons for each window of each body."""
        side = int(np.sqrt(SCOUTS))
        line = (np.arange(side) + 0.5) / side * 2.0 - 1.0
        ndc = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
        places: list[tuple[np.ndarray, np.ndarray]] = []

        def visit(seen: Rays, found: SurfacePoints) -> None:
            places.append((seen.medium, found.position))

        self._radiance(self.camera_rays(camera, ndc), len(ndc), visit)
        if not places:
            return
        medium, position = (np.concatenate(arrays) for arrays in zip(*places, strict=True))
        begin = near_plane(rebase_view(camera.view, self.origin), camera.projection)
        for i, sunlight in enumerate(self.sunlight):
            if sunlight is None:
                continue
            points = position[medium == i]
            distance = np.linalg.norm(points - begin.origin, axis=1)
            sunlight.count(points, distance, photons, workers=self._workers, progress=self.progress)

    def picture(
        self,
        camera: Camera,
        size: tuple[int, int],
        *,
        samples: int = 16,
        photons: int = 10_000_000,
        seed: int = 1,
    ) -> Picture:
        """What the camera sees, `size` = (width, height) pixels. samples: rays a pixel, in even strata of its
        square; photons: in each window of each body; 0 keeps those that were counted last."""
        width, height = size
        if photons > 0:
            self.count_photons(camera, photons)
        count = width * height
        total, water = np.zeros((count, 3)), np.zeros(count)
        shift = np.random.default_rng(seed).random((count, 2))

        def traced(task: tuple[int, int]) -> tuple[slice, np.ndarray, np.ndarray]:
            sample, start = task
            pixels = np.arange(start, min(start + CHUNK, count))
            # Each pixel has the same sequence (Roberts's R2, 2018), from a start of its own.
            within = np.mod(shift[pixels] + (sample + 1) * _R2, 1.0) if samples > 1 else 0.5
            at = np.stack([pixels % width, pixels // width], axis=1) + within
            rays = self.camera_rays(camera, 2.0 * at / size - 1.0)
            return slice(start, start + len(pixels)), *self._radiance(rays, len(pixels))

        tasks = [(sample, start) for sample in range(samples) for start in range(0, count, CHUNK)]
        with ThreadPoolExecutor(self._workers) as pool:
            for part, radiance, shows_water in self.progress(pool.map(traced, tasks), len(tasks), "rays"):
                total[part] += radiance
                water[part] += shows_water
        return Picture((total / samples).reshape(height, width, 3), (water / samples).reshape(height, width))


_R2 = 1.32471795724474602596 ** -np.array([1.0, 2.0])


def _add_water(radiance: np.ndarray, rays: Rays, water: list[WaterOptics]) -> None:
    for i, of_body in enumerate(water):
        these = rays.medium == i
        np.add.at(radiance, rays.pixel[these], rays.weight[these] * of_body.color)


def render(
    snapshot: SceneSnapshot,
    camera: Camera,
    size: tuple[int, int],
    *,
    images: Images | None = None,
    water_optics: Callable[[WaterSettings], WaterOptics] = project_optics,
    samples: int = 16,
    photons: int = 10_000_000,
    workers: int = 2,
    quiet: bool = True,
) -> np.ndarray:
    """(h, w, 3) scene-linear radiance, first row at the bottom. See `Reference` and its `picture`."""
    reference = Reference(snapshot, images, water_optics=water_optics, workers=workers, quiet=quiet)
    return reference.picture(camera, size, samples=samples, photons=photons).radiance
