# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole pictures against closed forms and physical invariants."""

import os
from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import optics, waves
from tests.gpu import scenes
from tests.gpu.pictures import SIZE, draw, draw_plan, draw_textures, planned

BED_ALBEDO = np.array([0.7, 0.5, 0.3])
VIEW = scenes.look_at((14, -14, 6), (0, 0, -0.5))


def shifted_lens(camera, x, y):
    projection = camera.projection.copy()
    projection[0, 2] += x
    projection[1, 2] += y
    return replace(camera, projection=projection)


STEEP_ENOUGH = {
    "perspective": scenes.look_at((1, -8, 6), (0, 0, 0), fov=0.8),
    "shifted lens": shifted_lens(scenes.look_at((1, -8, 7), (0, 0, 0), fov=0.8), 0.3, -0.2),
    "straight down": scenes.look_at((1, -8, 6), (1, -8, 0), fov=0.8),
    "orthographic": scenes.look_at((1, -8, 7), (0, 0, 0), ortho=10.0),
}


def even_pond(waves_of_pond, depth=3.0, level=0.0, **settings):
    """Water over a level bottom of one albedo, under a sky of one radiance: each pixel has a closed form."""
    bed = scenes.grid_mesh("bed", 2, 400.0, level - depth)
    sand = scenes.Material("sand", BED_ALBEDO)
    options = {"k": 0.4, "water_color": (0.02, 0.1, 0.08), "waves": waves_of_pond, **settings}
    body = scenes.water((0, 0, level), half_size=20.0, resolution=512 if waves_of_pond else 2, **options)
    return scenes.snapshot((bed,), (sand,), (("bed", "sand", [np.eye(4)]),), (body,))


def closed_form(scene, camera, depth):
    """(h, w, 3) radiance by Snell, Beer-Lambert and Schlick, ray by ray, without a texture or a GPU."""
    (body,) = scene.waters
    settings = body.settings
    packed = waves.pack(settings.waves, scene.time, settings.depth, body.heading)
    width, height = SIZE
    y, x = np.meshgrid(
        2 * (np.arange(height) + 0.5) / height - 1, 2 * (np.arange(width) + 0.5) / width - 1, indexing="ij"
    )
    ends = []
    for z in (-1.0, 0.9):
        clip = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, z), np.ones(x.size)])
        point = clip @ np.linalg.inv(camera.projection @ camera.view).T
        ends.append(point[:, :3] / point[:, 3:])
    origin, direction = ends[0], ends[1] - ends[0]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    assert np.all(direction[:, 2] < -0.1), "every pixel has to see the water"
    at = -(origin[:, 2] - body.level) / direction[:, 2]
    for _ in range(50):  # along the ray to the waves: a contraction, as they are far flatter than the rays
        surface = origin + at[:, None] * direction
        above = surface[:, 2] - body.level - waves.height(packed, surface[:, :2])
        at = at - above / direction[:, 2]
    normal = waves.normal(packed, surface[:, :2])
    refracted, _ = optics.refract_direction(direction, normal, 1.0 / settings.ior)
    path = (surface[:, 2] - body.level + depth) / -refracted[:, 2]
    bottom = BED_ALBEDO * scenes.SKY_RADIANCE
    color = np.array(settings.water_color)
    through = color + np.exp(-settings.k * path)[:, None] * (bottom - color)
    f = ((settings.ior - 1.0) / (settings.ior + 1.0)) ** 2
    cosine = -np.sum(direction * normal, axis=1, keepdims=True)
    fresnel = f + (1.0 - f) * (1.0 - cosine) ** settings.q
    return ((1.0 - fresnel) * through + fresnel * scenes.SKY_RADIANCE).reshape(height, width, 3)


@pytest.mark.parametrize("camera", STEEP_ENOUGH.values(), ids=STEEP_ENOUGH)
def test_flat_water_over_a_level_bottom(renderer, camera):
    """Every pixel to 0.002 (the bottom's depth is that of a texel's middle), the mean to 0.0005."""
    scene = even_pond((), depth=3.0)
    error = np.abs(draw(renderer, scene, camera)[..., :3] - closed_form(scene, camera, 3.0))
    assert error.max() < 2e-3 and error.mean() < 5e-4, (error.max(), error.mean())


@pytest.mark.parametrize("level", [0.0, 137.0])
@pytest.mark.parametrize("camera", STEEP_ENOUGH.values(), ids=STEEP_ENOUGH)
def test_waves_over_a_level_bottom(renderer, camera, level):
    """99 of 100 pixels to 0.005 with 8 steps: the grid's triangles stand in for the waves' curve."""
    _, camera = scenes.moved(even_pond(()), camera, (0, 0, level))
    scene = even_pond(scenes.LAKE_WAVES, depth=2.0, level=level)
    picture = draw(renderer, scene, camera, intersection_steps=8, fov_ext=2.0, texture_size=512)
    error = np.abs(picture[..., :3] - closed_form(scene, camera, 2.0))
    assert np.quantile(error, 0.99) < 5e-3 and error.mean() < 1e-3, (np.quantile(error, 0.99), error.mean())


@pytest.mark.parametrize("camera", STEEP_ENOUGH.values(), ids=STEEP_ENOUGH)
def test_waves_on_a_coarse_mesh(renderer, camera):
    """The same bounds with triangles of 0.6 m, under waves of 0.8 m and more: all pixels look from the waves.

    With the triangles' own points the error of the 99th of 100 pixels is more than 0.02.
    """
    scene = even_pond(scenes.LAKE_WAVES, depth=2.0)
    body = replace(scene.waters[0], grid=(64, *scene.waters[0].grid[1:]))
    scene = replace(scene, waters=(body,))
    picture = draw(renderer, scene, camera, intersection_steps=8, fov_ext=2.0, texture_size=512)
    error = np.abs(picture[..., :3] - closed_form(scene, camera, 2.0))
    assert np.quantile(error, 0.99) < 5e-3 and error.mean() < 1e-3, (np.quantile(error, 0.99), error.mean())


@pytest.mark.parametrize("ior", [1.0, 1.1, 2.4])
@pytest.mark.parametrize("k", [0.0, 2.0, 1000.0])
def test_flat_water_of_other_liquids(renderer, ior, k):
    scene = even_pond((), depth=3.0, ior=ior, k=k, q=4.5)
    camera = STEEP_ENOUGH["perspective"]
    error = np.abs(draw(renderer, scene, camera, fov_ext=2.5)[..., :3] - closed_form(scene, camera, 3.0))
    assert error.max() < 2e-3, error.max()


def test_water_that_neither_bends_nor_absorbs_nor_mirrors_is_not_there(renderer):
    """ior = 1 (so f = 0), k = 0, and q = 100: the picture of the scene without water, but for edges."""
    scene = scenes.pond(ior=1.0, k=0.0, q=100.0, waves=())
    camera = scenes.look_at((6, -14, 12), (0, 0, -0.5))
    with_water = draw(renderer, scene, camera, texture_size=1024, fov_ext=1.1)
    without = draw(renderer, replace(scene, version=-1, waters=()), camera)
    error = np.abs(with_water - without).max(axis=-1)
    assert error.mean() < 0.01, error.mean()
    assert np.mean(error > 0.1) < 0.03, "more than edges differ"


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 0.5, 0.0), (-1.0, 1.0, 1.0)])
def test_water_of_a_mesh_is_that_of_the_grid(renderer, scale):
    """The same surface as a mesh of the user's, also scaled, flattened (a z scale of 0) or mirrored."""
    grid = scenes.pond()
    grid = replace(grid, waters=(replace(grid.waters[0], grid=(513, 30.0, 30.0, 0.0, 0.0)),))
    sheet = scenes.grid_mesh("sheet", 513, 30.0)
    sheet = replace(sheet, positions=(sheet.positions / np.where(scale, scale, 1.0)).astype(np.float32))
    body = replace(grid.waters[0], matrix=np.diag([*scale, 1.0]), grid=None, mesh="sheet")
    mesh = replace(grid, version=-4, meshes={**grid.meshes, "sheet": sheet}, waters=(body,))
    if scale[0] < 0:  # the water frame's heading is that of the object's +X
        body = replace(grid.waters[0], matrix=np.diag([-1.0, -1.0, 1.0, 1.0]))
        grid = replace(grid, waters=(body,))
    error = np.abs(draw(renderer, mesh, VIEW) - draw(renderer, grid, VIEW)).max(axis=-1)
    assert error.mean() < 1e-3 and np.mean(error > 0.02) < 0.01, (error.mean(), np.mean(error > 0.02))


def test_waves_modelled_as_a_mesh_look_like_the_waves(renderer):
    """A swell in the mesh's own vertices and normals, against the same swell as a sine wave on the grid."""
    swell = (scenes.SineWave(0.15, 4.0, 0.9, 0.3),)
    grid = scenes.snapshot((), (), (), (scenes.water(half_size=20.0, resolution=257, waves=swell),))
    packed = waves.pack(swell, grid.time, 5.0)
    sheet = scenes.grid_mesh(
        "sheet", 257, 20.0, lambda x, y: waves.height(packed, np.stack([x, y], -1)).reshape(x.shape)
    )
    still = replace(scenes.water(), grid=None, mesh="sheet")
    mesh = scenes.snapshot((sheet,), (), (), (still,))
    camera = scenes.look_at((12, -14, 3), (3, 1, 0))
    error = np.abs(draw(renderer, mesh, camera) - draw(renderer, grid, camera)).max(axis=-1)
    assert error.mean() < 2e-3 and np.mean(error > 0.03) < 0.01, (error.mean(), np.mean(error > 0.03))


def baked(mesh, matrix):
    """The mesh with the matrix already applied: positions, and normals by the inverse transpose."""
    normals = mesh.normals @ np.linalg.inv(matrix[:3, :3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    positions = mesh.positions @ matrix[:3, :3].T + matrix[:3, 3]
    return scenes.changed(mesh, positions=positions.astype(np.float32), normals=normals.astype(np.float32))


SQUEEZED = np.array([[1.2, -0.9, 0, 3.0], [0.6, 1.6, 0, 1.0], [0, 0, 0.7, 0.5], [0, 0, 0, 1]])


def test_normals_follow_a_matrix_that_squeezes(renderer):
    """Hills under a sun, shaped by the instance's matrix or before: the same light on the same slopes."""
    hills = scenes.grid_mesh("hills", 129, 8.0, lambda x, y: 1.5 * np.sin(x) * np.cos(0.7 * y))
    white, sun = scenes.Material("white", np.ones(3)), scenes.pond().sun

    def picture(mesh, matrix):
        scene = scenes.snapshot((mesh,), (white,), (("hills", "white", [matrix]),), sun=sun)
        return draw(renderer, scene, scenes.look_at((12, -14, 12), (3, 1, 0)))

    error = np.abs(picture(hills, SQUEEZED) - picture(baked(hills, SQUEEZED), np.eye(4))).max(axis=-1)
    assert error.mean() < 1e-4 and np.mean(error > 0.01) < 1e-3, (error.mean(), np.mean(error > 0.01))


def test_normals_of_water_follow_a_matrix_that_squeezes(renderer):
    """A swell modelled as a mesh, under the same matrix: its slopes are in the reflections."""
    swell = scenes.grid_mesh("swell", 129, 8.0, lambda x, y: 0.3 * np.sin(x) * np.cos(0.7 * y))
    pond = scenes.pond(waves=())

    def picture(mesh, matrix):
        body = replace(pond.waters[0], matrix=matrix, grid=None, mesh="swell")
        scene = scenes.snapshot((mesh,), (), (), (body,))
        return draw(renderer, scene, scenes.look_at((12, -14, 6), (3, 1, 0)))

    unmoved = np.eye(4)
    unmoved[:3, 3] = SQUEEZED[:3, 3]
    shape = SQUEEZED.copy()
    shape[:3, 3] = 0.0
    error = np.abs(picture(swell, SQUEEZED) - picture(baked(swell, shape), unmoved)).max(axis=-1)
    assert error.mean() < 1e-4 and np.mean(error > 0.01) < 2e-3, (error.mean(), np.mean(error > 0.01))


@pytest.mark.parametrize(("near", "far"), [(0.1, 1000.0), (1e-3, 1e5)])
def test_sky_image_is_seen_in_its_direction(renderer, bpy_module, near, far):
    """Each pixel of an image sky that holds its own directions: to a third of a degree, at any clip range."""
    from lake_water_addon.core import sky as sky_math

    height, width = 256, 512
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = 0.5 + 0.5 * sky_math.equirectangular_direction(np.stack([u, v], -1))
    image = bpy_module.data.images.new("directions", width, height, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    try:
        rotation = 0.7
        base = scenes.constant_sky()
        sky = scenes.Sky(base.radiance, base.irradiance_sh, image.name, 1.0, rotation)
        scene = scenes.snapshot((), (), (), sky=sky)
        # One picture over the image's seam, one towards the zenith.
        for target in ((-10, -8, 6), (1, 2, 30)):
            camera = scenes.look_at((0, 0, 4), target, near=near, far=far)
            seen = 2.0 * draw(renderer, scene, camera)[..., :3] - 1.0
            seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
            y, x = np.meshgrid(
                2 * (np.arange(SIZE[1]) + 0.5) / SIZE[1] - 1,
                2 * (np.arange(SIZE[0]) + 0.5) / SIZE[0] - 1,
                indexing="ij",
            )
            rays = np.stack([x / camera.projection[0, 0], y / camera.projection[1, 1], -np.ones_like(x)], -1)
            uv = sky_math.equirectangular_uv(rays @ camera.view[:3, :3], rotation)
            expected = sky_math.equirectangular_direction(uv)
            angle = np.degrees(np.arccos(np.clip(np.sum(seen * expected, -1), -1.0, 1.0)))
            assert angle.max() < 0.33 and angle.mean() < 0.1, (angle.max(), angle.mean())
    finally:
        bpy_module.data.images.remove(image)


def test_meshes_without_vertices_and_zero_scales_are_drawn_as_nothing(renderer):
    scene = scenes.pond()
    sheet = scenes.grid_mesh("nothing", 2, 1.0)
    nothing = replace(
        sheet,
        positions=np.zeros((0, 3), np.float32),
        normals=np.zeros((0, 3), np.float32),
        parts=(replace(sheet.parts[0], triangles=np.zeros((0, 3), np.int32)),),
    )
    more = replace(
        scene,
        version=-5,
        meshes={**scene.meshes, "nothing": nothing},
        draws=(
            *scene.draws,
            replace(scene.draws[0], mesh="nothing", version=-1),
            replace(scene.draws[1], matrices=np.diag([0.0, 0.0, 0.0, 1.0])[None], version=-2),
        ),
    )
    np.testing.assert_array_equal(draw(renderer, more, VIEW), draw(renderer, scene, VIEW))


def test_dense_water_shows_its_own_colour(renderer):
    scene = scenes.pond(ior=1.0, k=1000.0, q=100.0, waves=(), water_color=(0.1, 0.2, 0.3))
    camera = scenes.look_at((0, -14, 12), (0, -8, 0), fov=0.3)
    picture = draw(renderer, scene, camera)[..., :3]
    np.testing.assert_allclose(picture, np.broadcast_to([0.1, 0.2, 0.3], picture.shape), atol=1e-4)


def two_coloured_boxes(mirrored=False):
    """Boxes over the water, on the right: green above, red below; or their mirror images, upside down."""
    box = scenes.box_mesh("box", (1.0, 1.0, 0.75))
    side = -1.0 if mirrored else 1.0
    flip = np.diag([1.0, 1.0, side, 1.0])
    places = [(4.0, 0.0), (5.5, 5.0)]
    upper = [scenes.translation(x, y, side * 3.0) @ flip for x, y in places]
    lower = [scenes.translation(x, y, side * 1.5) @ flip for x, y in places]
    green, red = (
        scenes.Material("green", np.array([0.1, 0.8, 0.1])),
        scenes.Material("red", np.array([0.8, 0.1, 0.1])),
    )
    # Draws whose matrices mirror and draws whose matrices do not are kept apart by the extraction, too.
    waters = () if mirrored else (scenes.water(half_size=60.0, q=0.0),)
    return scenes.snapshot((box,), (green, red), (("box", "green", upper), ("box", "red", lower)), waters)


@pytest.mark.parametrize(
    "camera",
    [
        scenes.look_at((0, -16, 5), (1, 0, 0)),
        scenes.look_at((0, -16, 0.4), (1, 0, 0)),
        scenes.look_at((0, -16, 8), (1, 0, 0), ortho=18.0),
    ],
    ids=["perspective", "near the water", "orthographic"],
)
def test_mirror_shows_the_mirrored_scene(renderer, camera):
    """q = 0 is a perfect mirror: below the horizon the picture is that of the boxes turned upside down."""
    mirror = draw(renderer, two_coloured_boxes(), camera, texture_size=512, fov_ext=1.1)
    above = draw(renderer, replace(two_coloured_boxes(), waters=()), camera)
    below = draw(renderer, two_coloured_boxes(mirrored=True), camera)
    sky = np.append(scenes.SKY_RADIANCE, 1.0)
    hides_water = np.abs(above - sky).max(axis=-1) > 1e-3
    expected = np.where(hides_water[..., None], above, below)
    error = np.abs(mirror - expected).max(axis=-1)
    assert np.mean(np.abs(below - sky).max(axis=-1) > 0.1) > 0.02, "no mirror image in the picture"
    assert np.mean(error > 0.05) < 0.015, "more than the edges of the mirror image differ"
    columns = np.nonzero((mirror[..., 0] > 2 * mirror[..., 2]).any(axis=0))[0]
    assert columns.min() > SIZE[0] / 2, "red belongs to the right of the picture, in the mirror, too"


@pytest.mark.parametrize("offset", [(0, 0, 137.0), (1e5, -1e5, 0.0), (1e5, 2e5, -3e3)])
def test_scene_elsewhere_in_the_world_looks_the_same(renderer, offset):
    here = draw(renderer, scenes.pond(), VIEW)
    there = draw(renderer, *scenes.moved(scenes.pond(), VIEW, offset))
    error = np.abs(here - there).max(axis=-1)
    assert error.mean() < 1e-4 and np.mean(error > 0.02) < 0.002, (error.mean(), np.mean(error > 0.02))


def test_border_render_is_the_part_of_the_whole(renderer):
    """The window (0.25, 0.25)-(0.75, 0.75) at half the size is those pixels of the whole picture."""
    scene = scenes.pond()
    whole = draw(renderer, scene, VIEW)
    part = draw(renderer, scene, VIEW, size=(80, 60), window=(0.25, 0.25, 0.75, 0.75))
    error = np.abs(part - whole[30:90, 40:120]).max(axis=-1)
    assert error.mean() < 1e-4 and np.mean(error > 0.02) < 0.005, (error.mean(), np.mean(error > 0.02))


def test_reflection_of_a_scene_without_water_and_water_without_a_scene(renderer):
    """Both are drawn: the one shows no water, the other mirrors the sky and is else of the water's colour."""
    dry = draw(renderer, replace(scenes.pond(), version=-2, waters=()), VIEW)
    assert np.isfinite(dry).all()
    camera = STEEP_ENOUGH["straight down"]
    empty = scenes.snapshot((), (), (), (scenes.water(water_color=(0.1, 0.2, 0.3), k=0.0, q=100.0),))
    picture = draw(renderer, empty, camera)[..., :3]
    f = ((1.333 - 1) / (1.333 + 1)) ** 2
    np.testing.assert_allclose(
        picture,
        np.broadcast_to((1 - f) * np.array([0.1, 0.2, 0.3]) + f * scenes.SKY_RADIANCE, picture.shape),
        atol=5e-4,
    )


EXTREMES = {
    "steep waves": {"settings": {"waves": scenes.STEEP_WAVES}},
    "many waves": {"settings": {"waves": scenes.LAKE_WAVES * 8}},
    "k = 1000": {"settings": {"k": 1000.0}},
    "k = 0": {"settings": {"k": 0.0}},
    "q = 0": {"settings": {"q": 0.0, "waves": ()}},
    "q = 100": {"settings": {"q": 100.0}},
    "c = 0": {"settings": {"c": 0.0}},
    "c = 100": {"settings": {"c": 100.0, "waves": scenes.STEEP_WAVES}},
    "ior = 1": {"settings": {"ior": 1.0}},
    "ior = 4": {"settings": {"ior": 4.0}},
    "fov_ext = 1": {"fov_ext": 1.0},
    "fov_ext = 3": {"fov_ext": 3.0},
    "tiny textures": {"texture_size": 16},
    "one step": {"intersection_steps": 1},
    "sixteen steps": {"intersection_steps": 16, "settings": {"waves": scenes.STEEP_WAVES}},
    "orthographic": {"camera": scenes.look_at((14, -14, 6), (0, 0, 0), ortho=20.0)},
    "orthographic level": {"camera": scenes.look_at((14, -14, 0.5), (0, 0, 0.499), ortho=20.0)},
    "1 cm above": {"camera": scenes.look_at((6, -6, 0.01), (0, 0, 0)), "settings": {"waves": ()}},
    "straight down": {"camera": scenes.look_at((1, -8, 6), (1, -8, 0)), "settings": {"waves": ()}},
    "looking up": {"camera": scenes.look_at((6, -6, 1), (0, 0, 12))},
    "just above the horizon": {"camera": scenes.look_at((6, -6, 1), (0, 0, 3.55))},
    "inside a post": {"camera": scenes.look_at((0, 0, 1), (5, 5, 0))},
    "near clip 1 um": {"camera": scenes.look_at((14, -14, 6), (0, 0, 0), near=1e-6)},
    "one cell": {"resolution": 2},
}


@pytest.mark.parametrize("case", EXTREMES.values(), ids=EXTREMES)
def test_no_pixel_is_undefined_at_the_extremes(renderer, case):
    """Finite, not negative, not brighter than the light: the picture and the textures that it looks up."""
    case = dict(case)
    scene = scenes.pond(**case.pop("settings", {}))
    camera = case.pop("camera", VIEW)
    if resolution := case.pop("resolution", None):
        body = replace(scene.waters[0], grid=(resolution, *scene.waters[0].grid[1:]))
        scene = replace(scene, waters=(body,))
    picture = draw(renderer, scene, camera, **case)
    _, refraction, depth, reflection = draw_textures(renderer, scene, camera, **case)
    for name, pixels in (
        ("picture", picture),
        ("refraction", refraction),
        ("depth", depth),
        ("reflection", reflection),
    ):
        bad = int(np.sum(~np.isfinite(pixels)))
        assert bad == 0, f"{bad} undefined values in the {name}"
        assert pixels.min() >= 0.0, f"the {name} goes down to {pixels.min()}"
    brightest = 1.0 * np.max(scenes.SKY_RADIANCE + 3.0 / np.pi)
    assert picture[..., :3].max() <= brightest, (
        f"brighter ({picture[..., :3].max()}) than all the light there is"
    )


# The water line: which side of the waves the textures show.


def shore_with_boxes(waves_of_lake, slope):
    """A sloping shore and boxes across the water line; every texel's colour tells its position."""
    meshes = [scenes.grid_mesh("shore", 65, 7.0, lambda x, y: slope * y)]
    for i, place in enumerate([(-3, -2, 0), (2, -3, 0.5), (3.5, 2, -0.3)]):
        box = scenes.box_mesh(f"box {i}", (1.0, 1.0, 2.0))
        meshes.append(replace(box, positions=box.positions + np.float32(place)))
    coded = scenes.Material("coded", np.ones(3), use_color_attribute=True)
    return scenes.snapshot(
        [scenes.position_coded(m) for m in meshes],
        (coded,),
        [(m.key, "coded", [np.eye(4)]) for m in meshes],
        (scenes.water(half_size=7.0, waves=waves_of_lake),),
        sky=scenes.constant_sky((1.0, 1.0, 1.0)),
    )


def grown(mask):
    """The mask with all eight neighbours of its texels."""
    padded = np.pad(mask, 1)
    n, m = mask.shape
    return np.any([padded[y : y + n, x : x + m] for y in range(3) for x in range(3)], axis=0)


HIGH_WAVES = (scenes.SineWave(0.25, 3.0, 0.3), scenes.SineWave(0.15, 1.7, -0.8, 1.0))


@pytest.mark.parametrize("slope", [0.1, 0.4])
@pytest.mark.parametrize("waves_of_lake", [(), scenes.LAKE_WAVES, HIGH_WAVES], ids=["flat", "lake", "high"])
@pytest.mark.parametrize(
    ("camera", "allowed"),
    [
        (scenes.look_at((0, -6, 9), (0, 0, 0), ortho=14.0), 0.001),
        (scenes.look_at((1, -8, 8), (0, 0, 0)), 0.001),
        # Near the horizon a wave is smaller than a texel, and the shore's rim is seen edge on.
        (scenes.look_at((-6, -9, 1.2), (0, 0, 0)), 0.01),
    ],
    ids=["orthographic", "from above", "low"],
)
def test_textures_keep_to_their_side_of_the_waves(renderer, camera, allowed, waves_of_lake, slope):
    """The refraction texture shows nothing above the waves, the reflection texture nothing below them.

    A texel of the other side next to one of the right side (in all eight directions) is the margin
    for the filter. Beyond it, at the rims of objects, `allowed` of the covered texels may be wrong.
    """
    scene = shore_with_boxes(waves_of_lake, slope)
    plan, refraction, _, reflection = draw_textures(renderer, scene, camera, fov_ext=1.2)
    is_sky = np.abs(reflection[..., :3] - 1.0).max(axis=-1) < 1e-3
    for name, texture, keep, covered in (
        ("refraction", refraction, 1.0, refraction[..., 3] > 0.5),
        ("reflection", reflection, -1.0, (reflection[..., 3] > 0.5) & ~is_sky),
    ):
        position = scenes.decoded_positions(texture)
        depth = waves.height(plan.bodies[0].packed_waves, position[..., :2]) - position[..., 2]
        wrong = covered & (keep * depth < -0.012)  # half floats hold a position to 8 mm
        beyond = np.sum(wrong & ~grown(covered & ~wrong)) / covered.sum()
        assert covered.sum() > 5000
        assert beyond <= allowed, f"{beyond:.2%} of the {name} texture show the wrong side of the water"


REGION_CASES = {
    "lake": (VIEW, {}),
    "near the water": (scenes.look_at((2, -13, 0.3), (0, 0, 0.3)), {}),
    "among the waves": (scenes.look_at((2, -13, 0.9), (0, 0, 0.4)), {"waves": scenes.STEEP_WAVES}),
    "straight down": (scenes.look_at((1, -8, 6), (1, -8, 0)), {"waves": HIGH_WAVES}),
    "orthographic": (scenes.look_at((14, -14, 6), (0, 0, 0), ortho=20.0), {}),
    "looking up": (scenes.look_at((6, -6, 1), (0, 0, 3)), {}),
    "far reflection": (VIEW, {"c": 30.0, "waves": scenes.STEEP_WAVES}),
    "the shore from afar": (scenes.look_at((60, -60, 20), (0, 0, 0), fov=0.3), {"waves": HIGH_WAVES}),
}


@pytest.mark.parametrize(("camera", "settings"), REGION_CASES.values(), ids=REGION_CASES)
def test_nothing_is_looked_up_outside_of_the_drawn_regions(renderer, camera, settings):
    """The planned parts of the textures are enough: drawn whole, the picture is the same to the last bit."""
    plan = planned(scenes.pond(**settings), camera)
    (body,) = plan.bodies
    assert body.drawn
    whole = replace(
        body,
        refraction=replace(body.refraction, region=(0.0, 0.0, 1.0, 1.0)),
        reflection=replace(body.reflection, region=(0.0, 0.0, 1.0, 1.0)),
    )
    np.testing.assert_array_equal(
        draw_plan(renderer, plan), draw_plan(renderer, replace(plan, bodies=(whole,)))
    )


# What a frame makes and keeps.


def test_unchanged_frame_makes_nothing(renderer):
    scene = scenes.pond()
    for _ in range(2):
        renderer.resources.reset_counts()
        draw(renderer, scene, VIEW)
    assert dict(renderer.resources.made) == {}


def test_only_the_time_and_the_camera_change_nothing_is_made(renderer):
    """An animation of waves and camera uploads matrices and phases, into the buffers that are there."""
    scene = scenes.pond()
    draw(renderer, scene, VIEW)
    renderer.resources.reset_counts()
    first = draw(renderer, scene, VIEW)
    later = draw(renderer, replace(scene, time=1.7), VIEW)
    elsewhere = draw(renderer, scene, scenes.look_at((-14, -14, 6), (0, 0, 0)))
    assert dict(renderer.resources.made) == {}
    assert np.abs(first - later).mean() > 1e-3, "the waves stand still"
    assert np.abs(first - elsewhere).mean() > 1e-2, "the camera stands still"


def test_changed_scene_uploads_what_is_new(renderer):
    """Another version of one mesh: one vertex and one index buffer, and the picture shows it."""
    scene = scenes.pond()
    before = draw(renderer, scene, VIEW)
    meshes = dict(scene.meshes)
    meshes["crate"] = replace(scenes.box_mesh("crate", (3.0, 3.0, 1.0)))
    renderer.resources.reset_counts()
    after = draw(renderer, replace(scene, version=-3, meshes=meshes), VIEW)
    assert renderer.resources.made["shaders"] == 0 and renderer.resources.made["batches"] == 1
    assert np.abs(before - after).mean() > 1e-3


def test_memory_is_flat_over_200_frames(renderer):
    """Resident memory after 20 frames and after 200 more: at most 2 MB apart."""

    def resident():
        with open("/proc/self/statm", encoding="ascii") as statm:
            return int(statm.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    scene = scenes.pond()

    def frames(first, count):
        for i in range(first, first + count):
            angle = 0.05 * i
            camera = scenes.look_at((14 * np.cos(angle), 14 * np.sin(angle), 5), (0, 0, 0))
            draw(renderer, replace(scene, time=i / 24.0), camera, size=(32, 24), texture_size=32)

    frames(0, 20)
    before = resident()
    frames(20, 200)
    grown_by = resident() - before
    assert grown_by < 2_000_000, f"{grown_by / 1e6:.1f} MB more after 200 frames"


def test_renderer_after_renderer_draws_the_same(renderer):
    """Viewports come and go: a shader that lies where a freed one lay must be bound all the same."""
    from lake_water_addon.render.frame import FrameRenderer

    scene = scenes.pond()
    expected = draw(renderer, scene, VIEW, size=(32, 24), texture_size=32)
    for _ in range(8):
        np.testing.assert_array_equal(
            draw(FrameRenderer(), scene, VIEW, size=(32, 24), texture_size=32), expected
        )


def test_planning_says_why_nothing_is_drawn(renderer):
    """Water behind the camera costs no texture pass: the timer has no entry for one."""
    from lake_water_addon.render.frame import PassTimer

    away = scenes.look_at((40, -40, 6), (80, -80, 8))
    plan = planned(scenes.pond(), away)
    assert plan.bodies[0].reason == "out of the picture"
    timer = PassTimer()
    target = renderer.targets.get(("test", SIZE), SIZE, ("RGBA32F",))
    renderer.draw_picture(plan, target, timer)
    assert "refraction" not in timer.seconds and "reflection" not in timer.seconds


@pytest.mark.parametrize("c", [0.0, 1.0, -2.0, 30.0])
def test_reflection_is_drawn_wherever_it_is_looked_up(renderer, c):
    """Leaving out the rest of the texture must not change one bit of the picture."""
    scene = scenes.pond(waves=scenes.STEEP_WAVES, c=c)
    for camera in (VIEW, scenes.look_at((9, 2, 1.5), (0, 0, 0)), scenes.look_at((0, 0, 9), (0.1, 0, 0))):
        plan = planned(scene, camera)
        part = draw_plan(renderer, plan)
        body = plan.bodies[0]
        whole = replace(body, reflection=replace(body.reflection, region=(0.0, 0.0, 1.0, 1.0)))
        np.testing.assert_array_equal(part, draw_plan(renderer, replace(plan, bodies=(whole,))))


def test_textures_of_a_deleted_body_are_freed(renderer):
    """And those of the body that stays are not made again."""
    scene = scenes.pond()
    (body,) = scene.waters
    two = replace(scene, version=-11, waters=(body, replace(body, key="other")))
    draw(renderer, two, VIEW)
    keys = {("refraction", 1), ("reflection", 1)}
    assert keys <= renderer.targets.keys()
    draw(renderer, replace(scene, version=-12), VIEW)
    assert not keys & renderer.targets.keys()
    assert ("refraction", 0) in renderer.targets.keys()
