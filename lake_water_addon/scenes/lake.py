# SPDX-License-Identifier: GPL-3.0-or-later
"""Puts the demonstration lake together: what stands where, and the Blender objects."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Matrix, Vector

from ..water_objects import create_water, default_waves, set_waves
from . import plants, props, sky, textures
from .geometry import Geometry, build_mesh
from .materials import attribute_material, image_material
from .noise import smoothstep
from .terrain import HAZE, LakeTerrain, paint_ground, paint_hills, terrain_mesh

THESIS_VERTICES = 131_437  # Mihalik's scene, 2008: what detail 1.0 amounts to
ORBIT_RADIUS = 24.0  # m
ORBIT_HEIGHT = 5.0  # m above the water
LOOK_HEIGHT = 1.4  # m above the water
WATER_SIZE = 46.0  # m, side of the water's square; the banks hide what is too much
CLEARING = 27.5  # m, no trunk stands nearer to the centre: the turntable's camera goes round inside
SUN_ELEVATION = math.radians(33.0)
SUN_AZIMUTH = math.radians(208.0)  # behind the first camera, to its left
SUN_STRENGTH = 4.2  # W/m^2
SUN_COLOR = (1.0, 0.90, 0.77)


@dataclass(frozen=True, eq=False)
class LakeScene:
    """What was made, for those who go on with it. Lengths in m, world space.

    stage: (x, y) of the middle of the sunken tiled floor, where an object can stand (1.25 m deep).
    orbit_radius, orbit_height, look_height: of a turntable around `center`; heights above the water.
    vertex_count, face_count: of all instances together, the water excepted. object_count: mesh objects.
    mesh_count: meshes that they share. draw_count: pairs of mesh and material.
    """

    water: bpy.types.Object
    terrain: bpy.types.Object
    camera: bpy.types.Object
    sun: bpy.types.Object
    world: bpy.types.World
    collection: bpy.types.Collection
    center: tuple[float, float, float]
    water_level: float
    radius: float
    stage: tuple[float, float]
    orbit_radius: float
    orbit_height: float
    look_height: float
    vertex_count: int
    face_count: int
    object_count: int
    mesh_count: int
    draw_count: int


class _Builder:
    """Collects the objects of one lake. q: square root of the detail: resolution and number share it."""

    def __init__(self, collection: bpy.types.Collection, seed: int, detail: float, level: float) -> None:
        self.collection = collection
        self.seed = seed
        self.detail = detail
        self.q = math.sqrt(detail)
        self.level = level
        self.terrain = LakeTerrain(seed)
        self.shade: list[tuple[float, float, float, float]] = []
        self.vertices = self.faces = self.objects = 0
        self.draws: set[tuple[str, int]] = set()
        self.meshes: set[str] = set()

    def count(self, n: float) -> int:
        """A number of things at this detail."""
        return max(int(round(n * self.q)), 1)

    def sides(self, n: int, least: int = 4) -> int:
        """A number of subdivisions at this detail."""
        return max(int(round(n * math.sqrt(self.q))), least)

    def pixels(self, size: int) -> int:
        """Side of an image that has `size` pixels at full detail."""
        return size if self.detail >= 0.7 else size // 2 if self.detail >= 0.3 else size // 4

    def rng(self, stream: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, 100 + stream])

    def mesh(self, name: str, geometry: Geometry, *materials: bpy.types.Material) -> bpy.types.Mesh:
        return build_mesh(f"Lake {name}", geometry, materials)

    def put(
        self,
        mesh: bpy.types.Mesh,
        place: Sequence[float],
        *,
        yaw: float = 0.0,
        tilt: Sequence[float] = (0.0, 0.0),
        scale: float | Sequence[float] = 1.0,
    ) -> bpy.types.Object:
        """An object of the mesh at `place`, z above the water. tilt: turns about X and Y before the yaw."""
        obj = bpy.data.objects.new(mesh.name, mesh)
        obj.location = (place[0], place[1], place[2] + self.level)
        obj.rotation_euler = (tilt[0], tilt[1], yaw)
        obj.scale = (scale, scale, scale) if np.isscalar(scale) else scale
        self.collection.objects.link(obj)
        self.vertices += len(mesh.vertices)
        self.faces += len(mesh.polygons)
        self.objects += 1
        self.meshes.add(mesh.name)
        self.draws.update((mesh.name, slot) for slot in range(len(mesh.materials)))
        return obj

    def ground(self, x: float, y: float) -> float:
        return float(self.terrain.height(np.array([x, y])))

    def shore(self, theta: float, offset: float) -> tuple[float, float]:
        """The point in direction theta at distance `offset` from the shoreline (negative: in the lake)."""
        e = np.array([math.cos(theta), math.sin(theta)])
        r = float(self.terrain.shore_radius(theta)) + offset
        for _ in range(4):
            r += offset - float(self.terrain.shore_distance(e * r))
        return float(e[0] * r), float(e[1] * r)

    def lean(self, x: float, y: float, yaw: float, reach: float = 0.6) -> tuple[float, float]:
        """Turns about X and Y, before a yaw, that lay a thing flat on the slope at (x, y)."""
        return _lean(self.terrain.gradient(np.array([x, y]), reach), yaw)


def _lean(slope: np.ndarray, yaw: float) -> tuple[float, float]:
    """Turns about X and Y, before a yaw, that lay a thing flat on a slope (dz/dx, dz/dy)."""
    gx, gy = slope
    c, s = math.cos(yaw), math.sin(yaw)
    return math.atan(-gx * s + gy * c), -math.atan(gx * c + gy * s)


def build_lake(
    scene: bpy.types.Scene,
    *,
    seed: int = 1,
    detail: float = 1.0,
    water_level: float = 0.0,
    set_world: bool = True,
    set_camera: bool = True,
) -> LakeScene:
    """Add the demonstration lake to the scene, in one collection; nothing of the user's is removed.

    seed: the same seed gives the same lake. detail: 0.1 .. 4, the number of vertices is 131,437 times it,
    less at most a patch of grass; below 0.5 up to 40 % more. water_level: world z of the water; the whole
    lake moves with it. set_world: the lake's sky becomes the scene's world, with exposure and view
    transform; set_camera: its camera the scene's. ValueError for a detail out of range.
    """
    if not 0.1 <= detail <= 4.0:
        raise ValueError(f"The level of detail must lie between 0.1 and 4, not {detail:g}.")
    if not math.isfinite(water_level):
        raise ValueError("The water level must be a finite height in metres.")
    collection = bpy.data.collections.new("Lake")
    scene.collection.children.link(collection)
    b = _Builder(collection, int(seed), float(detail), float(water_level))

    stone = attribute_material("Lake Stone", cull=True)
    timber = attribute_material("Lake Timber", cull=True)
    plank = image_material(
        "Lake Planks", textures.make_image("Lake Planks", textures.wood(b.pixels(512), b.seed)), cull=True
    )
    _add_jetty_and_boat(b, plank)
    _add_terrace(b)
    _add_cabin(b)
    _add_poles(b)
    _add_boulders(b, stone)
    _add_stones(b, stone)
    _add_logs(b, timber)
    _add_reeds(b)
    _add_trees(b, timber)
    _add_far_forest(b)
    ground = _add_terrain(b)
    _add_grass(b)

    water = _add_water(b)
    sun_direction = np.array(
        [
            math.cos(SUN_ELEVATION) * math.cos(SUN_AZIMUTH),
            math.cos(SUN_ELEVATION) * math.sin(SUN_AZIMUTH),
            math.sin(SUN_ELEVATION),
        ]
    )
    sun = _add_sun(b, sun_direction)
    camera = _add_camera(b)
    world = sky.make_world("Lake Sky", sky.sky_image(sun_direction, b.seed, width=b.pixels(1024)))
    scene.eevee.use_raytracing = True  # else EEVEE has no refraction of what lies in the water
    if set_world:
        scene.world = world
        _set_view(scene)
    if set_camera:
        scene.camera = camera
    terrace = b.terrain.terrace
    return LakeScene(
        water=water,
        terrain=ground,
        camera=camera,
        sun=sun,
        world=world,
        collection=collection,
        center=(0.0, 0.0, b.level),
        water_level=b.level,
        radius=17.0,
        stage=tuple(float(c) for c in terrace.floor_center),
        orbit_radius=ORBIT_RADIUS,
        orbit_height=ORBIT_HEIGHT,
        look_height=LOOK_HEIGHT,
        vertex_count=b.vertices,
        face_count=b.faces,
        object_count=b.objects,
        mesh_count=len(b.meshes),
        draw_count=len(b.draws),
    )


def _set_view(scene: bpy.types.Scene) -> None:
    view = scene.view_settings
    view.view_transform = "AgX"
    view.look = "AgX - High Contrast"
    view.exposure = 0.2
    view.gamma = 1.0


def _add_terrain(b: _Builder) -> bpy.types.Object:
    image = textures.make_image("Lake Ground", paint_ground(b.terrain, b.pixels(1536), b.shade))
    inner = image_material("Lake Ground", image, cull=True)
    outer = image_material(
        "Lake Hills", textures.make_image("Lake Hills", paint_hills(b.terrain, b.pixels(2048))), cull=True
    )
    return b.put(b.mesh("Terrain", terrain_mesh(b.terrain, b.detail), inner, outer), (0.0, 0.0, 0.0))


JETTY_ANGLE = math.radians(203.0)


def _add_jetty_and_boat(b: _Builder, plank: bpy.types.Material) -> None:
    x0, y0 = b.shore(JETTY_ANGLE, 1.7)
    yaw = JETTY_ANGLE + math.pi + 0.06
    inward = np.array([math.cos(yaw), math.sin(yaw)])
    side = np.array([-inward[1], inward[0]])
    length = 9.4
    pairs = 6
    bed = np.array(
        [b.ground(*(np.array([x0, y0]) + inward * x)) for x in np.linspace(0.35, length - 0.12, pairs)]
    )
    shape = props.jetty(b.seed, length, bed, sides=b.sides(10, 6))
    b.put(b.mesh("Jetty", shape, plank), (x0, y0, 0.0), yaw=yaw)
    for x in np.linspace(0.5, length, 7):
        px, py = np.array([x0, y0]) + inward * x
        b.shade.append((float(px), float(py), 1.1, 0.30))

    paint = image_material(
        "Lake Boat Paint",
        textures.make_image("Lake Boat Paint", textures.boat_paint(b.pixels(256), b.seed)),
        cull=True,
    )
    bx, by = np.array([x0, y0]) + inward * (length - 1.2) - side * 1.95
    heading = yaw - 0.16
    b.put(b.mesh("Boat", props.boat_hull(b.sides(22, 9), b.sides(9, 5)), paint), (bx, by, 0.0), yaw=heading)
    b.put(b.mesh("Boat Fittings", props.boat_fittings(b.seed), plank), (bx, by, 0.0), yaw=heading)
    b.shade.append((float(bx), float(by), 1.3, 0.22))


def _add_terrace(b: _Builder) -> None:
    t = b.terrain.terrace
    tiles = image_material(
        "Lake Tiles", textures.make_image("Lake Tiles", textures.mosaic(b.pixels(512), b.seed)), cull=True
    )
    masonry = image_material(
        "Lake Masonry",
        textures.make_image("Lake Masonry", textures.masonry(b.pixels(512), b.seed)),
        cull=True,
    )
    tiled, stone = props.terrace(t.steps, t.tread, t.rise, t.top, t.floor_depth, t.floor_length, t.half_width)
    x, y = np.asarray(t.origin) + t.start * np.asarray(t.inward)
    yaw = math.atan2(t.inward[1], t.inward[0])
    b.put(b.mesh("Terrace Tiles", tiled, tiles), (x, y, 0.0), yaw=yaw)
    b.put(b.mesh("Terrace Stone", stone, masonry), (x, y, 0.0), yaw=yaw)


CABIN_ANGLE = math.radians(113.0)
CABIN_RADIUS = 29.5


def _add_cabin(b: _Builder) -> None:
    image = textures.make_image("Lake Boathouse", textures.cabin_atlas(b.pixels(512), b.seed))
    material = image_material("Lake Boathouse", image, cull=True)
    x, y = CABIN_RADIUS * math.cos(CABIN_ANGLE), CABIN_RADIUS * math.sin(CABIN_ANGLE)
    # The gable with the door looks at the lake, a little askew.
    b.put(
        b.mesh("Boathouse", props.cabin(), material),
        (x, y, b.ground(x, y) + 0.12),
        yaw=CABIN_ANGLE + math.pi + 0.35,
    )
    b.shade.append((x, y, 3.4, 0.45))


def _add_poles(b: _Builder) -> None:
    rng = b.rng(1)
    paint = image_material(
        "Lake Pole Paint",
        textures.make_image("Lake Pole Paint", textures.stripes(b.pixels(256), b.seed)),
        cull=True,
    )
    shape = props.post(3.1, 0.055, b.sides(12, 8), np.random.default_rng([b.seed, 3]), (1.0, 1.0))
    mesh = b.mesh("Mooring Pole", shape, paint)
    for degrees, offset in ((213.0, -7.6), (-112.0, -4.6), (20.0, -4.2), (98.0, -3.8)):
        x, y = b.shore(math.radians(degrees), offset)
        z = max(b.ground(x, y), -2.1) - 0.35
        tilt = rng.normal(0.0, 0.09, size=2)
        b.put(mesh, (x, y, z), yaw=rng.uniform(0, 6.28), tilt=tilt)


def _free_shore(b: _Builder, theta: float, margin: float) -> bool:
    """Whether a direction is clear of the jetty and of the bathing steps. margin: m along the shore."""
    terrace = math.atan2(-b.terrain.terrace.inward[1], -b.terrain.terrace.inward[0])
    half = margin / 17.0
    for angle, width in ((JETTY_ANGLE, 1.2), (terrace, b.terrain.terrace.half_width + 0.6)):
        if abs(math.remainder(theta - angle, 2.0 * math.pi)) < half + width / 17.0:
            return False
    return True


def _add_boulders(b: _Builder, material: bpy.types.Material) -> None:
    rng = b.rng(2)
    big = [
        b.mesh(f"Boulder {n}", props.boulder(b.seed * 31 + n, b.sides(8, 3), moss=0.6), material)
        for n in range(2)
    ]
    small = [
        b.mesh(f"Rock {n}", props.boulder(b.seed * 37 + n, b.sides(5, 2), moss=0.35, base=base), material)
        for n, base in enumerate((props.GREY, props.WARM))
    ]

    def place(x: float, y: float, size: float, sink: float) -> None:
        mesh = (big if size > 0.75 else small)[int(rng.integers(2))]
        yaw = rng.uniform(0.0, 2.0 * math.pi)
        scale = size * rng.uniform(0.88, 1.12, 3)
        z = b.ground(x, y) + size * (0.42 - sink)
        b.put(mesh, (x, y, z), yaw=yaw, tilt=rng.normal(0.0, 0.14, 2), scale=tuple(scale))
        b.shade.append((x, y, 1.25 * size, 0.5))

    # Groups on the shoreline: a large one, with lesser ones about it, half in the water.
    groups = 0
    while groups < 9:
        theta = rng.uniform(0.0, 2.0 * math.pi)
        if not _free_shore(b, theta, 2.2):
            continue
        groups += 1
        x, y = b.shore(theta, rng.uniform(-1.6, 0.2))
        place(x, y, rng.uniform(0.8, 1.35), rng.uniform(0.0, 0.15))
        for _ in range(b.count(3.4)):
            a, r = rng.uniform(0, 2 * math.pi), rng.uniform(1.0, 2.6)
            place(x + r * math.cos(a), y + r * math.sin(a), rng.uniform(0.28, 0.7), rng.uniform(0.0, 0.2))
    # Alone in the shallows, tops above the water.
    for _ in range(6):
        theta = rng.uniform(0.0, 2.0 * math.pi)
        if _free_shore(b, theta, 3.0):
            x, y = b.shore(theta, rng.uniform(-4.6, -2.8))
            size = rng.uniform(1.0, 1.3)
            place(x, y, size, -0.12)
    # Erratic blocks in the meadow.
    for _ in range(12):
        theta, r = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(26.5, 42.0)
        place(r * math.cos(theta), r * math.sin(theta), rng.uniform(0.35, 0.74), 0.15)
    # The islet's skirt of rock.
    ix, iy = b.terrain.islet
    for n in range(9):
        a = 2.0 * math.pi * n / 9 + rng.uniform(-0.25, 0.25)
        r = rng.uniform(1.5, 2.7)
        place(
            ix + 1.15 * r * math.cos(a), iy + r * math.sin(a), rng.uniform(0.35, 1.15), rng.uniform(0.0, 0.2)
        )


def _add_stones(b: _Builder, material: bpy.types.Material) -> None:
    rng = b.rng(3)
    meshes = [
        b.mesh(f"Stones {n}", props.stone_group(b.seed * 7 + n, b.sides(2, 1), 6, 1.1), material)
        for n in range(2)
    ]
    for _ in range(b.count(40)):
        theta = rng.uniform(0.0, 2.0 * math.pi)
        offset = -7.2 * rng.uniform() ** 1.25 + 0.7
        if not _free_shore(b, theta, 1.3) and offset > -6.5:
            continue
        x, y = b.shore(theta, offset)
        yaw = rng.uniform(0.0, 2.0 * math.pi)
        b.put(
            meshes[int(rng.integers(2))],
            (x, y, b.ground(x, y) - 0.02),
            yaw=yaw,
            tilt=b.lean(x, y, yaw),
            scale=rng.uniform(0.75, 1.35),
        )
        b.shade.append((x, y, 1.0, 0.18))


def _add_logs(b: _Builder, material: bpy.types.Material) -> None:
    rng = b.rng(4)
    meshes = [
        b.mesh(
            f"Sunken Log {n}",
            props.log(
                b.seed * 5 + n, length=length, radius=radius, sides=b.sides(12, 6), rings=b.sides(13, 6)
            ),
            material,
        )
        for n, (length, radius) in enumerate(((4.6, 0.21), (3.2, 0.15)))
    ]
    # (direction, distance from the shore, turn against the shore's normal); the last ones reach out of the
    # water
    for n, (degrees, offset, turn) in enumerate(
        (
            (-112.0, -3.3, 1.2),
            (-98.0, -5.2, 0.5),
            (-38.0, -3.6, 1.0),
            (8.0, -4.2, 2.2),
            (62.0, -3.0, 1.3),
            (118.0, -3.8, 0.5),
            (172.0, -3.5, 1.8),
            (-128.0, -1.5, 0.25),
            (44.0, -1.6, -0.3),
            (132.0, -1.4, 0.4),
        )
    ):
        theta = math.radians(degrees + rng.uniform(-3.0, 3.0))
        x, y = b.shore(theta, offset)
        yaw = theta + math.pi + turn
        mesh = meshes[n % 2]
        pitch = b.lean(x, y, yaw, 1.6)[1]
        if n >= 7:
            pitch += 0.05
        b.put(mesh, (x, y, b.ground(x, y) + 0.10), yaw=yaw, tilt=(rng.uniform(-0.4, 0.4), pitch))
        for f in (-1.4, -0.5, 0.5, 1.4):
            b.shade.append((x + f * math.cos(yaw), y + f * math.sin(yaw), 0.5, 0.4))


def _add_reeds(b: _Builder) -> None:
    rng = b.rng(5)
    image = textures.make_image("Lake Reeds", textures.reed_atlas(b.pixels(512), b.seed))
    material = image_material("Lake Reeds", image, clip=True, cull=True)
    meshes = [
        b.mesh(
            f"Reeds {n}",
            plants.reed_clump(b.seed * 3 + n, stalks=b.count(13), radius=0.75, height=1.7),
            material,
        )
        for n in range(2)
    ]
    placed = 0
    wanted = b.count(78)
    for _ in range(6000):
        if placed >= wanted:
            break
        theta = rng.uniform(0.0, 2.0 * math.pi)
        e = np.array([math.cos(theta), math.sin(theta)])
        # Reeds grow in belts: a smooth function around the shore says where. The first view stays open.
        belt = float(b.terrain.noise(np.array([2.1 * e[0], 2.1 * e[1], 4.0]))) + 0.25 * rng.normal()
        open_view = abs(math.remainder(theta + math.pi / 2.0, 2.0 * math.pi)) < 0.30
        if belt < 0.12 or open_view or not _free_shore(b, theta, 1.0):
            continue
        x, y = b.shore(theta, rng.uniform(-1.9, 0.25))
        z = b.ground(x, y)
        if not -0.5 < z < 0.10:
            continue
        b.put(meshes[int(rng.integers(2))], (x, y, z), yaw=rng.uniform(0, 6.28), scale=rng.uniform(0.7, 1.1))
        b.shade.append((x, y, 0.8, 0.3))
        placed += 1
    ix, iy = b.terrain.islet
    for _ in range(b.count(7)):
        a = rng.uniform(0.3, 3.4)
        x, y = ix + 2.3 * math.cos(a), iy + 1.9 * math.sin(a)
        b.put(
            meshes[0],
            (x, y, max(b.ground(x, y), -0.5)),
            yaw=rng.uniform(0, 6.28),
            scale=rng.uniform(0.6, 0.9),
        )


def _add_trees(b: _Builder, timber: bpy.types.Material) -> None:
    rng = b.rng(6)

    def leaves(name: str, pixels: np.ndarray) -> bpy.types.Material:
        return image_material(f"Lake {name}", textures.make_image(f"Lake {name}", pixels), clip=True)

    green, light, dark = (0.105, 0.165, 0.032), (0.155, 0.205, 0.04), (0.062, 0.112, 0.045)
    oak = leaves("Oak Leaves", textures.leaf_atlas(b.pixels(512), b.seed, green))
    birch = leaves(
        "Birch Leaves", textures.leaf_atlas(b.pixels(512), b.seed + 1, light, leaves=140, leaf=0.13)
    )
    pine = leaves(
        "Pine Needles",
        textures.leaf_atlas(b.pixels(512), b.seed + 2, dark, leaves=170, leaf=0.24, slender=0.16),
    )
    needles = leaves("Spruce Branches", textures.needle_atlas(b.pixels(512), b.seed, (0.05, 0.092, 0.035)))
    n = b.count(11)
    sides = b.sides(8, 5)
    grow = 1.0 / math.sqrt(b.q)  # fewer cards are larger ones
    kinds: list[tuple[bpy.types.Mesh, float, float]] = []  # mesh, crown radius, weight

    def add(name: str, shape: Geometry, material: bpy.types.Material, crown: float, weight: float) -> None:
        kinds.append((b.mesh(name, shape, timber, material), crown, weight))

    add(
        "Oak",
        plants.broadleaf(
            b.seed,
            height=9.5,
            spread=3.9,
            cards_per_blob=n,
            blobs=9,
            card=0.85 * grow,
            trunk_radius=0.30,
            sides=sides,
        ),
        oak,
        4.4,
        1.0,
    )
    add(
        "Maple",
        plants.broadleaf(
            b.seed + 1,
            height=11.5,
            spread=3.4,
            cards_per_blob=n,
            blobs=9,
            card=0.85 * grow,
            trunk_radius=0.27,
            sides=sides,
            clear_trunk=0.22,
        ),
        oak,
        4.0,
        1.0,
    )
    add(
        "Birch",
        plants.broadleaf(
            b.seed + 2,
            height=11.0,
            spread=2.3,
            cards_per_blob=n,
            blobs=8,
            card=0.74 * grow,
            trunk_radius=0.15,
            sides=sides,
            clear_trunk=0.3,
            bark=plants.BIRCH_BARK,
        ),
        birch,
        2.8,
        1.2,
    )
    add(
        "Pine",
        plants.broadleaf(
            b.seed + 3,
            height=11.5,
            spread=2.7,
            cards_per_blob=n,
            blobs=7,
            card=0.72 * grow,
            trunk_radius=0.21,
            sides=sides,
            clear_trunk=0.52,
            flat=0.5,
            bark=plants.PINE_BARK,
        ),
        pine,
        3.0,
        0.8,
    )
    add(
        "Spruce",
        plants.conifer(b.seed, height=13.5, spread=2.6, whorls=b.count(13), branches=6, sides=sides),
        needles,
        3.0,
        1.4,
    )
    add(
        "Young Spruce",
        plants.conifer(b.seed + 1, height=7.5, spread=1.9, whorls=b.count(10), branches=6, sides=sides),
        needles,
        2.2,
        0.8,
    )
    shrubs = [
        b.mesh(
            "Willow Shrub", plants.shrub(b.seed, radius=1.1, cards_count=b.count(26), card=0.5 * grow), birch
        ),
        b.mesh(
            "Alder Shrub",
            plants.shrub(b.seed + 1, radius=1.3, cards_count=b.count(26), card=0.58 * grow),
            oak,
        ),
    ]

    # One crooked pine on the islet.
    ix, iy = b.terrain.islet
    b.put(
        kinds[3][0],
        (ix + 0.2, iy + 0.2, b.ground(ix + 0.2, iy + 0.2)),
        yaw=1.0,
        tilt=(0.10, -0.08),
        scale=0.52,
    )

    weights = np.array([k[2] for k in kinds])
    # The boathouse and the view to it stay free: as if trees stood there already.
    cx, cy = math.cos(CABIN_ANGLE), math.sin(CABIN_ANGLE)
    trees: list[tuple[float, float, float]] = [
        (r * cx, r * cy, 4.0) for r in (CABIN_RADIUS - 3.0, CABIN_RADIUS)
    ]
    taken = len(trees)
    wanted = b.count(64)
    for _ in range(20000):
        if len(trees) - taken >= wanted:
            break
        r = CLEARING + 42.0 * rng.uniform() ** 1.6
        theta = rng.uniform(0.0, 2.0 * math.pi)
        x, y = r * math.cos(theta), r * math.sin(theta)
        # Woods and glades: a smooth density lets hills and sky through in places.
        wood = float(b.terrain.noise(np.array([0.035 * x, 0.035 * y, 2.0])))
        if wood + 0.22 * rng.normal() < -0.16:
            continue
        stand = np.where(
            np.array([0, 0, 0, 1, 1, 1], dtype=bool),
            smoothstep(-0.5, 0.5, float(b.terrain.noise(np.array([0.05 * x, 0.05 * y, 7.0])))),
            smoothstep(0.5, -0.5, float(b.terrain.noise(np.array([0.05 * x, 0.05 * y, 7.0])))),
        )
        p = weights * (0.15 + stand)
        mesh, crown, _ = kinds[int(rng.choice(len(kinds), p=p / p.sum()))]
        scale = rng.uniform(0.72, 1.18)
        crown *= scale
        if r - crown < ORBIT_RADIUS + 1.2:
            continue
        if any((x - tx) ** 2 + (y - ty) ** 2 < (0.62 * (crown + tc)) ** 2 for tx, ty, tc in trees):
            continue
        trees.append((x, y, crown))
        b.put(
            mesh,
            (x, y, b.ground(x, y) - 0.05),
            yaw=rng.uniform(0, 6.28),
            tilt=rng.normal(0.0, 0.02, 2),
            scale=(scale * rng.uniform(0.94, 1.06), scale * rng.uniform(0.94, 1.06), scale),
        )
        b.shade.append((x, y, 0.9 * crown, 0.45))
    for _ in range(b.count(52)):
        r = 26.6 + 20.0 * rng.uniform() ** 1.8
        theta = rng.uniform(0.0, 2.0 * math.pi)
        x, y = r * math.cos(theta), r * math.sin(theta)
        scale = rng.uniform(0.55, 1.2)
        if any((x - tx) ** 2 + (y - ty) ** 2 < 14.0 for tx, ty, _ in trees[:taken]):
            continue
        b.put(
            shrubs[int(rng.integers(2))],
            (x, y, b.ground(x, y) - 0.12),
            yaw=rng.uniform(0, 6.28),
            scale=(scale, scale, scale * rng.uniform(0.75, 1.1)),
        )
        b.shade.append((x, y, 1.1 * scale, 0.5))


def _add_far_forest(b: _Builder) -> None:
    rng = b.rng(7)
    image = textures.make_image("Lake Far Trees", textures.far_tree_atlas(b.pixels(512), b.seed, HAZE))
    material = image_material("Lake Far Trees", image, clip=True)
    wanted = b.count(1000)
    tries = wanted * 4
    r = 66.0 * (470.0 / 66.0) ** (rng.uniform(size=tries) ** 1.15)
    theta = rng.uniform(0.0, 2.0 * math.pi, tries)
    xy = np.stack([r * np.cos(theta), r * np.sin(theta)], axis=-1)
    clearing = b.terrain.clearing(xy)
    chosen = np.flatnonzero(clearing < 0.28 + 0.1 * rng.normal(size=tries))[:wanted]
    xy, r = xy[chosen], r[chosen]
    n = len(chosen)
    stand = b.terrain.noise(xy / 40.0 + 3.0) + 0.25 * rng.normal(size=n)
    kinds = np.where(stand > 0.0, rng.integers(0, 2, n), rng.integers(2, 4, n))
    bands = np.digitize(r, [130.0, 260.0])
    heights = np.where(kinds < 2, rng.uniform(9.0, 15.0, n), rng.uniform(7.0, 11.0, n)) * (1.0 + r / 700.0)
    points = np.column_stack([xy, b.terrain.height(xy)])
    b.put(b.mesh("Far Forest", plants.far_forest(points, heights, kinds, bands), material), (0.0, 0.0, 0.0))


def _add_grass(b: _Builder) -> None:
    """Last: as many patches as are left of the vertices that the level of detail allows."""
    rng = b.rng(8)
    image = textures.make_image("Lake Grass", textures.grass_atlas(b.pixels(512), b.seed))
    material = image_material("Lake Grass", image, clip=True, cull=True)
    tufts = b.count(16)
    meadow = b.mesh(
        "Meadow Grass",
        plants.grass_patch(b.seed, radius=0.95, tufts=tufts, height=0.42, kinds=(5.0, 1.5, 1.5, 0.8)),
        material,
    )
    short = b.mesh(
        "Turf",
        plants.grass_patch(b.seed + 1, radius=1.0, tufts=tufts, height=0.26, kinds=(2.0, 5.0, 0.3, 0.8)),
        material,
    )
    dry = b.mesh(
        "Dry Grass",
        plants.grass_patch(b.seed + 2, radius=0.9, tufts=tufts, height=0.5, kinds=(2.0, 0.5, 5.0, 0.3)),
        material,
    )
    left = int(THESIS_VERTICES * b.detail - b.vertices) // len(meadow.vertices)
    if left <= 0:
        return
    # More candidates than needed, all at once: most are good, and the noise is quicker on arrays.
    tries = 3 * left + 100
    theta = rng.uniform(0.0, 2.0 * np.pi, tries)
    direction = np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    by_shore = rng.uniform(size=tries) < 0.62
    offset = 0.6 + 6.5 * rng.uniform(size=tries) ** 1.5
    radius = np.where(by_shore, b.terrain.shore_radius(theta) + offset, 23.0 + 16.0 * rng.uniform(size=tries))
    for _ in range(3):
        off = offset - b.terrain.shore_distance(direction * radius[:, None])
        radius = np.where(by_shore, radius + off, radius)
    xy = direction * radius[:, None]
    z = b.terrain.height(xy)
    along, across = b.terrain.terrace.local(xy)
    on_terrace = (along > b.terrain.terrace.start - 1.0) & (
        np.abs(across) < b.terrain.terrace.half_width + 0.9
    )
    cabin = CABIN_RADIUS * np.array([math.cos(CABIN_ANGLE), math.sin(CABIN_ANGLE)])
    in_cabin = np.hypot(*(xy - cabin).T) < 3.6
    chosen = np.flatnonzero((z > 0.17) & ~on_terrace & ~in_cabin)[:left]
    gradient = b.terrain.gradient(xy[chosen], 0.6)
    patches = 1.3 * b.terrain.noise.fbm(0.11 * xy[chosen] + 23.0, 3) + 0.3 * rng.normal(size=len(chosen))
    for i, slope, patch in zip(chosen, gradient, patches, strict=True):
        if abs(radius[i] - ORBIT_RADIUS) < 1.6:
            mesh = short  # the turntable's camera passes here, even when it is set low
        elif patch > 0.45:
            mesh = dry
        else:
            mesh = meadow if rng.uniform() < 0.62 else short
        yaw = rng.uniform(0.0, 2.0 * math.pi)
        b.put(mesh, (*xy[i], z[i]), yaw=yaw, tilt=_lean(slope, yaw), scale=rng.uniform(0.8, 1.3))


def _add_water(b: _Builder) -> bpy.types.Object:
    water = create_water("Lake Water", WATER_SIZE, WATER_SIZE, b.collection, (0.0, 0.0, b.level))
    # A clear lake under trees. The thesis's green, the default, belongs to a picture without exposure.
    water.lake_water.k = 0.38
    water.lake_water.water_color = (0.010, 0.080, 0.065)
    # From more sides than in a breeze: on a sheltered lake parallel crests look like corrugated iron.
    set_waves(
        water,
        default_waves(count=9, spread=math.radians(230.0), height=0.10, longest=3.6, shortest=0.42, seed=5),
    )
    return water


def _add_sun(b: _Builder, direction: np.ndarray) -> bpy.types.Object:
    lamp = bpy.data.lights.new("Lake Sun", "SUN")
    lamp.energy = SUN_STRENGTH
    lamp.color = SUN_COLOR
    lamp.angle = math.radians(0.53)
    sun = bpy.data.objects.new("Lake Sun", lamp)
    sun.rotation_euler = Vector(direction).to_track_quat("Z", "Y").to_euler()
    sun.location = Vector(direction) * 40.0 + Vector((0.0, 0.0, b.level))
    b.collection.objects.link(sun)
    return sun


def _add_camera(b: _Builder) -> bpy.types.Object:
    data = bpy.data.cameras.new("Lake Camera")
    data.lens = 26.0
    data.sensor_width = 36.0
    data.clip_start = 0.1
    data.clip_end = 2000.0
    camera = bpy.data.objects.new("Lake Camera", data)
    place = Vector((0.0, -ORBIT_RADIUS, ORBIT_HEIGHT + b.level))
    look = Vector((0.0, 0.0, LOOK_HEIGHT + b.level)) - place
    camera.matrix_world = Matrix.Translation(place) @ look.to_track_quat("-Z", "Y").to_matrix().to_4x4()
    b.collection.objects.link(camera)
    return camera
