# SPDX-License-Identifier: GPL-3.0-or-later
"""The demonstration lake: its size, its shape, its turntable, and an OBJ file that stands in it."""

from __future__ import annotations

import itertools
import math
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

SPOT = Path(__file__).parents[2] / ".." / "shared" / "data" / "spot" / "spot_triangulated.obj"


def _positions(mesh) -> np.ndarray:
    co = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertices.foreach_get("co", co)
    return co.reshape(-1, 3).astype(np.float64)


def _world_positions(objects) -> dict[str, np.ndarray]:
    """World positions of all vertices, by object name."""
    cache: dict[str, np.ndarray] = {}
    result = {}
    for obj in objects:
        if obj.type == "MESH":
            p = cache.setdefault(obj.data.name, _positions(obj.data))
            m = np.array(obj.matrix_basis)
            result[obj.name] = p @ m[:3, :3].T + m[:3, 3]
    return result


def _open_edges(geometry) -> int:
    """Directed edges without exactly one opposite: 0 for a closed surface with faces of one orientation."""
    count: dict[tuple[int, int], int] = {}
    start = 0
    for size in geometry.sizes:
        face = geometry.corners[start : start + size].tolist()
        start += int(size)
        for edge in zip(face, face[1:] + face[:1], strict=True):
            count[edge] = count.get(edge, 0) + 1
    return sum(n != 1 or count.get((b, a), 0) != 1 for (a, b), n in count.items())


def _volumes(geometry) -> np.ndarray:
    """Signed volume of each connected piece: positive where the normals point outwards."""
    parent = np.arange(len(geometry.positions))

    def root(i: int) -> int:
        while parent[i] != i:
            parent[i] = parent[parent[i]]
            i = parent[i]
        return i

    faces, start = [], 0
    for size in geometry.sizes:
        faces.append(geometry.corners[start : start + size])
        start += int(size)
        for corner in faces[-1][1:]:
            parent[root(int(corner))] = root(int(faces[-1][0]))
    volumes: dict[int, float] = {}
    p = geometry.positions
    for face in faces:
        for a, b in itertools.pairwise(face[1:]):
            piece = root(int(face[0]))
            volumes[piece] = volumes.get(piece, 0.0) + float(np.dot(p[face[0]], np.cross(p[a], p[b]))) / 6.0
    return np.array(list(volumes.values()))


def _solids() -> dict[str, object]:
    from lake_water_addon.scenes import props

    tiles, stone = props.terrace(9, 0.36, 0.175, 0.325, 1.25, 4.4, 2.2)
    return {
        "boulder": props.boulder(1, 6),
        "stones": props.stone_group(1, 2, 5, 1.0),
        "log": props.log(1, length=4.0, radius=0.2, sides=8, rings=9),
        "jetty": props.jetty(1, 9.0, np.linspace(0.3, -2.0, 6)),
        "boat hull": props.boat_hull(20, 9),
        "boat fittings": props.boat_fittings(1),
        "terrace tiles": tiles,
        "terrace stone": stone,
        "boathouse": props.cabin(),
        "post": props.post(3.0, 0.1, 8, np.random.default_rng(1), (1.0, 1.0)),
    }


def test_what_the_water_cuts_is_closed_and_looks_outwards(blender: ModuleType) -> None:
    for name, geometry in _solids().items():
        assert _open_edges(geometry) == 0, f"{name}: not closed, the water would show its inside"
        assert _volumes(geometry).min() > 0.0, f"{name}: a piece is turned inside out"


def test_the_boat_floats_and_stays_dry(blender: ModuleType) -> None:
    from lake_water_addon.scenes import props

    hull = props.boat_hull(20, 9)
    assert hull.positions[:, 2].min() < -0.15, "the keel is not under water"
    # The inside's deepest points, under a wave of the default height.
    half = len(hull.positions) // 20 // 2
    inside = hull.positions.reshape(20, -1, 3)[:, half:, 2]
    assert inside.min() > 0.1, "waves would wash over the floor"


@pytest.mark.parametrize("seed", [1, 2, 7])
def test_land_hides_the_waters_rectangle(blender: ModuleType, seed: int) -> None:
    from lake_water_addon.scenes.lake import WATER_SIZE
    from lake_water_addon.scenes.terrain import LakeTerrain

    terrain = LakeTerrain(seed)
    axis = np.linspace(-WATER_SIZE / 2, WATER_SIZE / 2, 231)
    xy = np.stack(np.meshgrid(axis, axis), axis=-1)
    height = terrain.height(xy)
    shore = terrain.shore_distance(xy)
    along, across = terrain.terrace.local(xy)
    land = (shore > 2.0) & ~((along > -2.0) & (np.abs(across) < 4.0))
    assert height[land].min() > 0.2, "water would stand on the land"
    assert height[np.max(np.abs(xy), axis=-1) > WATER_SIZE / 2 - 0.1].min() > 0.2, (
        "the water's edge would show"
    )
    assert -5.6 < height.min() < -4.2, "the lake's middle is about 5 m deep"


@pytest.mark.parametrize("seed", [1, 5])
def test_the_world_ends_behind_the_hills(blender: ModuleType, seed: int) -> None:
    from lake_water_addon.scenes.terrain import OUTER_RADIUS, LakeTerrain

    theta = np.linspace(0.0, 2.0 * np.pi, 180, endpoint=False)
    rim = OUTER_RADIUS * np.stack([np.cos(theta), np.sin(theta)], axis=-1)
    assert LakeTerrain(seed).height(rim).min() > 20.0, (
        "from a camera at 15 m the world's rim would be seen from above"
    )


def test_size_and_clear_orbit_at_full_detail(blender: ModuleType) -> None:
    from lake_water_addon.scenes import THESIS_VERTICES, build_lake

    lake = build_lake(blender.context.scene, seed=1, detail=1.0)
    assert lake.vertex_count == pytest.approx(THESIS_VERTICES, rel=0.002)
    assert lake.draw_count <= 40
    assert lake.object_count < 1500
    for mesh in blender.data.meshes:
        assert not mesh.validate(), f"{mesh.name}: Blender had to repair it"
    everything = _world_positions(o for o in lake.collection.objects if o is not lake.water)
    total = sum(len(p) for p in everything.values())
    assert total == lake.vertex_count, "the count does not agree with the objects"
    for name, p in everything.items():
        radius = np.hypot(p[:, 0], p[:, 1])
        orbit = (radius > 20.0) & (radius < 25.0) & (p[:, 2] > 1.9)
        assert not orbit.any(), f"{name} stands in the turntable camera's way"
    boat = next(p for name, p in everything.items() if name.startswith("Lake Boat"))
    assert boat[:, 2].min() < -0.1


def test_the_same_seed_gives_the_same_lake(blender: ModuleType) -> None:
    from lake_water_addon.scenes import build_lake

    def build(seed: int) -> tuple[np.ndarray, np.ndarray]:
        blender.ops.wm.read_factory_settings(use_empty=True)
        lake = build_lake(blender.context.scene, seed=seed, detail=0.1)
        places = _world_positions(lake.collection.objects)
        image = blender.data.images["Lake Ground"]
        pixels = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        return np.concatenate([places[name] for name in sorted(places)]), pixels

    first, again, other = build(3), build(3), build(4)
    np.testing.assert_array_equal(first[0], again[0])
    np.testing.assert_array_equal(first[1], again[1])
    assert first[0].shape != other[0].shape or not np.array_equal(first[0], other[0])


def test_nothing_of_the_users_is_replaced(blender: ModuleType) -> None:
    from lake_water_addon.scenes import build_lake

    scene = blender.context.scene
    world = blender.data.worlds.new("Mine")
    camera = blender.data.objects.new("Mine", blender.data.cameras.new("Mine"))
    scene.collection.objects.link(camera)
    scene.world, scene.camera = world, camera
    scene.view_settings.exposure = 1.25
    lake = build_lake(scene, detail=0.1, water_level=12.0, set_world=False, set_camera=False)
    assert (scene.world, scene.camera, scene.view_settings.exposure) == (world, camera, 1.25)
    assert lake.water.matrix_basis.translation.z == pytest.approx(12.0)
    assert lake.terrain.matrix_basis.translation.z == pytest.approx(12.0), "the lake moves with its water"
    assert {c.name for c in lake.water.users_collection} == {lake.collection.name}


@pytest.mark.parametrize("detail", [0.05, 4.5, float("nan")])
def test_detail_out_of_range_is_refused(blender: ModuleType, detail: float) -> None:
    from lake_water_addon.scenes import build_lake

    with pytest.raises(ValueError, match="level of detail"):
        build_lake(blender.context.scene, detail=detail)
    assert not blender.data.objects


def test_turntable_goes_round_once_without_a_seam(blender: ModuleType) -> None:
    from lake_water_addon.scenes import animate_turntable

    scene = blender.context.scene
    camera = blender.data.objects.new("Camera", blender.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.keyframe_insert("location", frame=1)  # an animation of its own must not fight with the orbit
    scene.frame_start = 11
    center, radius, height, frames = (2.0, -3.0, 1.5), 24.0, 5.0, 36
    for _ in range(2):  # a second call replaces the first
        animate_turntable(
            scene, camera, center=center, radius=radius, height=height, frames=frames, look_height=1.0
        )
    assert (scene.frame_start, scene.frame_end) == (11, 46)
    angles = []
    for frame in range(11, 11 + frames + 1):
        scene.frame_set(frame)
        world = np.array(camera.matrix_world)
        offset = world[:3, 3] - center
        assert np.hypot(*offset[:2]) == pytest.approx(radius, abs=1e-4)
        assert offset[2] == pytest.approx(height, abs=1e-4)
        looks_at = np.array([0.0, 0.0, 1.0]) - offset
        np.testing.assert_allclose(-world[:3, 2], looks_at / np.linalg.norm(looks_at), atol=1e-4)
        angles.append(math.atan2(offset[1], offset[0]))
    steps = np.diff(np.unwrap(angles))
    np.testing.assert_allclose(steps, 2.0 * np.pi / frames, atol=1e-4)


@pytest.mark.parametrize("arguments", [{"frames": 0, "radius": 5.0}, {"frames": 10, "radius": 0.0}])
def test_turntable_refuses_what_cannot_be(blender: ModuleType, arguments: dict) -> None:
    from lake_water_addon.scenes import animate_turntable

    camera = blender.data.objects.new("Camera", blender.data.cameras.new("Camera"))
    with pytest.raises(ValueError, match=r"turntable|radius"):
        animate_turntable(blender.context.scene, camera, center=(0, 0, 0), height=5.0, **arguments)


def test_views_under_water_keep_off_the_ground(blender: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """The render script's own, for several lakes: in the water, and 0.3 m or more over its ground."""
    from lake_water_addon.scenes.terrain import LakeTerrain

    monkeypatch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "scripts"))
    import _blender_side as script

    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    circle = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    for seed in range(1, 9):
        terrain = LakeTerrain(seed)
        stage = np.array(terrain.terrace.floor_center, dtype=float)
        orbit = stage + script.UNDER_RADIUS * circle
        assert terrain.height(orbit).max() < script.UNDER_HEIGHT - 0.3
        dive = stage - script.DIVE_DISTANCE * stage / np.linalg.norm(stage)
        assert float(terrain.height(dive)) < -script.DIVE_DEPTH - 0.3


def test_dive_goes_down_and_up_again_and_keeps_its_target(blender: ModuleType) -> None:
    from lake_water_addon.scenes import animate_dive

    scene = blender.context.scene
    camera = blender.data.objects.new("Camera", blender.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    camera.keyframe_insert("rotation_euler", frame=1)
    scene.frame_start = 3
    place, target, frames = (2.0, -3.0, 1.5), (5.0, 4.0, 1.0), 20
    for _ in range(2):
        animate_dive(scene, camera, place=place, target=target, height=0.7, depth=1.1, frames=frames)
    assert (scene.frame_start, scene.frame_end) == (3, 22)
    heights = []
    for frame in range(3, 3 + frames + 1):
        scene.frame_set(frame)
        world = np.array(camera.matrix_world)
        np.testing.assert_allclose(world[:2, 3], place[:2], atol=1e-5)
        ahead = np.array(target) - world[:3, 3]
        np.testing.assert_allclose(-world[:3, 2], ahead / np.linalg.norm(ahead), atol=1e-4)
        assert world[2, 1] > 0.0 and abs(world[2, 0]) < 1e-5, "the camera is upright"
        heights.append(world[2, 3] - place[2])
    assert heights[0] == pytest.approx(0.7, abs=1e-5) and heights[10] == pytest.approx(-1.1, abs=1e-5)
    np.testing.assert_allclose(heights, heights[::-1], atol=1e-5)
    assert np.all(np.diff(heights[:11]) < 0.0)


@pytest.mark.parametrize(
    "arguments", [{"frames": 0, "target": (5, 0, 0)}, {"frames": 9, "target": (1, 2, -4)}]
)
def test_dive_refuses_what_cannot_be(blender: ModuleType, arguments: dict) -> None:
    from lake_water_addon.scenes import animate_dive

    camera = blender.data.objects.new("Camera", blender.data.cameras.new("Camera"))
    with pytest.raises(ValueError, match="dive"):
        animate_dive(blender.context.scene, camera, place=(1, 2, 0), height=1.0, depth=1.0, **arguments)


PYRAMID = """
v 0 0 0
v 2 0 0
v 2 4 0
v 0 4 0
v 1 2 3
vt 0 0
f 1/1 2/1 3/1
f 1/1 3/1 4/1
f 1 2 5
f 2 3 5
f 3 4 5
f 4 1 5
"""


def _write_obj(folder: Path, blender: ModuleType) -> Path:
    path = folder / "pyramid_low.obj"
    path.write_text(PYRAMID)
    image = blender.data.images.new("skin", 4, 4)
    image.filepath_raw, image.file_format = str(folder / "pyramid_skin.png"), "PNG"
    image.save()
    blender.data.images.remove(image)
    return path


def _image_of(obj) -> str:
    nodes = obj.data.materials[0].node_tree.nodes
    return next(Path(n.image.filepath).name for n in nodes if n.type == "TEX_IMAGE")


def test_an_obj_stands_half_under_water_on_the_bottom(blender: ModuleType, tmp_path: Path) -> None:
    from lake_water_addon.scenes import build_lake, place_obj

    scene = blender.context.scene
    lake = build_lake(scene, detail=0.1, water_level=3.0)
    path = _write_obj(tmp_path, blender)
    stand = {"location": lake.stage, "water_level": lake.water_level, "collection": lake.collection}
    obj = place_obj(scene, path, **stand)
    p = _world_positions([obj])[obj.name]
    low, high = p.min(axis=0), p.max(axis=0)
    # The file's Y is the height: scaled to 2.5 m, half of them under water.
    np.testing.assert_allclose([low[2], high[2]], [3.0 - 1.25, 3.0 + 1.25], atol=1e-4)
    np.testing.assert_allclose((low + high)[:2] / 2.0, lake.stage, atol=1e-4)
    assert _image_of(obj) == "pyramid_skin.png"
    assert [c.name for c in obj.users_collection] == [lake.collection.name]
    # Over the deep middle it needs a plinth to stand on; on the shore it moves into the water.
    place_obj(scene, path, location=(-2.0, -1.0), water_level=3.0)
    plinth = next(o for o in blender.data.objects if "Plinth" in o.name)
    top = _world_positions([plinth])[plinth.name][:, 2].max()
    assert top == pytest.approx(3.0 - 1.25, abs=1e-4)
    ashore = place_obj(scene, path, location=(17.5, 0.0), water_level=3.0)
    assert math.hypot(*ashore.location[:2]) < 16.5


@pytest.mark.skipif(not SPOT.exists(), reason="the sample data is not beside this checkout")
def test_spot_wears_the_texture_that_lies_beside_it(blender: ModuleType) -> None:
    from lake_water_addon.scenes import place_obj

    spot = place_obj(blender.context.scene, SPOT, location=(0.0, 0.0))
    assert _image_of(spot) == "spot_texture.png"
    p = _world_positions([spot])[spot.name]
    assert np.ptp(p[:, 2]) == pytest.approx(2.5, abs=1e-4)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "Cannot read"),
        ("", "no vertices"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no faces"),
        ("v 0 0 zero\n", "line 1"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2\n", "line 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", "vertex 9 of 3"),
        ("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n", "one point"),
    ],
)
def test_a_bad_obj_is_refused_and_leaves_nothing(
    blender: ModuleType, tmp_path: Path, text: str | None, message: str
) -> None:
    from lake_water_addon.scenes import place_obj

    path = tmp_path / "bad.obj"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        place_obj(blender.context.scene, path, location=(0.0, 0.0))
    assert "bad.obj" in str(caught.value)
    assert not blender.data.objects and not blender.data.meshes and not blender.data.materials
