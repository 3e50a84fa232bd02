# SPDX-License-Identifier: GPL-3.0-or-later
"""Traced against rays that are cast into the geometry itself, and against the physics of still water.

What is measured of the search is the GLSL: it runs on the textures that the passes drew, from points of the
surface and directions that are computed here.
"""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, optics, waves
from lake_water_addon.core.plan import plan_frame
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.technique_traced import TracedSettings
from tests.gpu import scenes
from tests.gpu.glsl import evaluate, read_texture, single
from tests.gpu.pictures import PLAIN, draw
from tests.gpu.rays import RayCaster, pixel_rays

SOURCES = (
    "camera_lib.glsl",
    "waves_lib.glsl",
    "optics_lib.glsl",
    "sky_lib.glsl",
    "technique_traced_lib.glsl",
)
BISECTIONS = 40

pytestmark = pytest.mark.usefixtures("gpu")


def planned(scene, camera, texture_size=512):
    settings = FrameSettings(technique="TRACED", texture_size=texture_size, **PLAIN)
    return plan_frame(scene, camera, settings)


def seen_surface(plan, caster, size):
    """(U, E), (n, 3) each: points of the waves that pixels of a picture of this size show, and where from."""
    body, origin = plan.bodies[0], plan.origin
    start, sight = pixel_rays(plan.camera.view, plan.camera.projection, size)
    reach = np.abs(body.packed_waves[:, 2]).sum()
    down = sight[:, 2] < -1e-3
    start, sight = start[down], sight[down]
    near, far = (
        (start[:, 2] - body.origin[2] - side * reach) / -sight[:, 2] for side in (1.0 + 1e-9, -1.0 - 1e-9)
    )

    def above(t):
        at = start + t[:, None] * sight - body.origin
        return at[:, 2] > waves.height(body.packed_waves, at[:, :2])

    low, high = near.copy(), far.copy()
    open_rays = np.ones(len(start), bool)
    for part in np.linspace(0.0, 1.0, 65)[1:]:  # the first crossing, then bisection
        t = near + part * (far - near)
        here = open_rays & above(t)
        low[here] = t[here]
        below = open_rays & ~here
        high[below] = t[below]
        open_rays = here
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        here = above(middle)
        low, high = np.where(here, middle, low), np.where(here, high, middle)
    point = start + low[:, None] * sight
    _, half_x, half_y, _, _ = body.body.grid
    seen = np.all(np.abs((point - body.origin)[:, :2]) < (half_x, half_y), axis=1)
    seen &= caster.cast(start + origin, sight).distance > low
    return single(point[seen]), -sight[seen]


def traced(renderer, plan, which, surface, direction):
    """(n, 4) what the shader finds on the drawn textures: uv, way and whether there is anything."""
    from lake_water_addon.render import uniforms
    from lake_water_addon.render.frame import PassTimer
    from lake_water_addon.render.passes import textures
    from lake_water_addon.render.resources import Resources

    def block(members):
        return uniforms.UniformBlock(Resources()).update(*members)

    renderer.draw_textures(plan, PassTimer())
    body, size = plan.bodies[0], plan.settings.texture_size
    refraction = textures.refraction_target(renderer.targets, 0, size)
    reflection = textures.reflection_target(renderer.targets, 0, size, linear_depth=True)
    own = body.body.settings.of(TracedSettings)
    way = {"refraction": "downwards", "reflection": "upwards"}[which]
    camera = f"water.{which}_view, water.{which}_projection"
    found = evaluate(
        SOURCES,
        {"t": ("vec4", "vec4(t.uv, t.way, t.known)")},
        statements=f"Trace t = trace_{way}({which}_depth, {camera}, u, r, MARCH_STEPS);",
        uniform_buffers={
            "lights": ("Lights", block(uniforms.lights(plan))),
            "water": ("Water", block(uniforms.water(plan, body))),
            "technique": ("Technique", block([uniforms.technique(own, plan)])),
        },
        samplers={
            "sky_image": ("FLOAT_2D", renderer.scene.sky_image),
            "refraction_color": ("FLOAT_2D", refraction.colors[0]),
            "refraction_depth": ("FLOAT_2D", refraction.colors[1]),
            "reflection_color": ("FLOAT_2D", reflection.colors[0]),
            "reflection_depth": ("FLOAT_2D", reflection.colors[1]),
        },
        u=surface,
        r=direction,
    )
    return found["t"].astype(np.float64)


def texels_off(plan, planned_pass, surface, direction, caster, got):
    """(n,) texels between what was found and the true hit; inf where only one of the two is there."""
    way = caster.cast(surface + plan.origin, direction).distance
    there = np.isfinite(way)
    hit = surface + np.where(there, way, 0.0)[:, None] * direction
    view = planned_pass.view
    uv = cameras.to_texture(planned_pass.projection, hit @ view[:3, :3].T + view[:3, 3])
    off = np.linalg.norm(got[:, :2] - uv, axis=1) * plan.settings.texture_size
    known = got[:, 3] > 0.5
    return np.where(there & known, off, np.where(there == known, 0.0, np.inf))


def refraction_error(renderer, plan, caster, size):
    surface, to_eye = seen_surface(plan, caster, size)
    body = plan.bodies[0]
    normal = waves.normal(body.packed_waves, surface[:, :2] - body.origin[:2])
    normal = optics.face_viewer(normal, to_eye)
    direction = single(optics.refract_direction(-to_eye, normal, 1.0 / body.body.settings.ior)[0])
    got = traced(renderer, plan, "refraction", surface, direction)
    return texels_off(plan, body.refraction, surface, direction, caster, got)


VIEWS = {
    "from the shore": scenes.look_at((6, -9, 5), (0, 0, 0), (160, 120)),
    "grazing": scenes.look_at((6, -12, 1.0), (0, 0, 0), (160, 120)),
    "straight down": scenes.look_at((2, -3, 9), (2, -3, 0), (160, 120)),
    "orthographic": scenes.look_at((6, -9, 5), (0, 0, 0), (160, 120), ortho=14.0),
}


@pytest.mark.parametrize("size", [256, 1024])
@pytest.mark.parametrize("view", VIEWS.values(), ids=VIEWS)
def test_refracted_rays_hit_what_they_hit(renderer, view, size):
    """Within one texel for 99 of 100 pixels, on an uneven bottom with posts; in the median, a hundredth."""
    scene = scenes.pond()
    plan = planned(scene, view, size)
    off = refraction_error(renderer, plan, RayCaster(scene), (160, 120))
    assert len(off) > 5000
    assert np.mean(off <= 1.0) >= 0.99, f"{np.mean(off <= 1.0):.4f} within a texel"
    assert np.median(off) < 0.01


@pytest.fixture(scope="module")
def lake(bpy_module, registered_addon):
    """(snapshot, camera) of the demonstration lake at half its detail.

    Without what the image of a material cuts out (leaves, grass), which the ray caster does not know.
    """
    from lake_water_addon.extraction.cameras import camera_from_object
    from lake_water_addon.extraction.scene import SceneExtractor
    from lake_water_addon.scenes.lake import build_lake

    scene = bpy_module.context.scene
    for obj in list(bpy_module.data.objects):  # loading an empty file would end the graphics context
        bpy_module.data.objects.remove(obj)
    built = build_lake(scene, detail=0.5)
    snapshot = SceneExtractor().snapshot(bpy_module.context.evaluated_depsgraph_get())
    draws = tuple(d for d in snapshot.draws if snapshot.materials[d.material].alpha_threshold is None)
    return replace(snapshot, draws=draws), camera_from_object(built.camera, scene, 640, 480)


@pytest.mark.parametrize("size", [512, 1024])
def test_refracted_rays_hit_what_they_hit_in_the_demonstration_lake(renderer, lake, size):
    scene, camera = lake
    off = refraction_error(renderer, planned(scene, camera, size), RayCaster(scene), (160, 120))
    assert len(off) > 5000
    assert np.mean(off <= 1.0) >= 0.99, f"{np.mean(off <= 1.0):.4f} within a texel"


def test_a_turned_camera_would_not_see_enough(renderer, lake):
    """Why the bottom is drawn as shallow as it appears: the thesis's camera hides more than 1 % of it."""
    scene, camera = lake
    plan = planned(scene, camera)
    body, caster = plan.bodies[0], RayCaster(scene)
    turned = cameras.refraction_view(
        plan.camera.view, plan.camera.projection, float(body.origin[2]), 1.0 / body.body.settings.ior
    )
    planned_pass = replace(body.refraction, view=turned, region=(0.0, 0.0, 1.0, 1.0))
    other = replace(plan, bodies=(replace(body, refraction=planned_pass),))
    as_it_is = np.mean(refraction_error(renderer, plan, caster, (160, 120)) <= 1.0)
    as_turned = np.mean(refraction_error(renderer, other, caster, (160, 120)) <= 1.0)
    assert as_turned < 0.99 <= as_it_is


@pytest.mark.parametrize("view", ["from the shore", "grazing"])
def test_reflected_rays_hit_what_they_hit(renderer, view):
    """Within one texel, or the sky where it is, for 90 of 100: a mirrored camera sees no backs of things."""
    scene = scenes.pond()
    plan = planned(scene, VIEWS[view], 512)
    caster, body = RayCaster(scene), plan.bodies[0]
    surface, to_eye = seen_surface(plan, caster, (160, 120))
    normal = waves.normal(body.packed_waves, surface[:, :2] - body.origin[:2])
    direction = single(optics.reflect_upwards(-to_eye, optics.face_viewer(normal, to_eye)))
    got = traced(renderer, plan, "reflection", surface, direction)
    off = texels_off(plan, body.reflection, surface, direction, caster, got)
    hits = got[:, 3] > 0.5
    assert 0.05 < hits.mean()
    assert np.mean(off <= 1.0) >= 0.90, f"{np.mean(off <= 1.0):.4f} within a texel"


def still_water(own, depth=2.0, ior=1.333, sun=None, **settings):
    """Calm water over a level bottom of one colour, under a constant sky."""
    bed = scenes.grid_mesh("bed", 3, 500.0, -depth)
    options = {"water_color": (0.02, 0.1, 0.08), "ior": ior, "own": (own,), **settings}
    return scenes.snapshot(
        (bed,),
        (scenes.Material("sand", ALBEDO),),
        (("bed", "sand", [np.eye(4)]),),
        (scenes.water(half_size=400.0, resolution=3, **options),),
        sun=sun,
    )


ALBEDO = np.array([0.5, 0.4, 0.3])
ABSORPTION = (0.3, 0.1, 0.2)


@pytest.mark.parametrize("view", ["straight down", "orthographic", "from the shore"])
def test_still_water_is_what_physics_has(renderer, view):
    """F L_sky + (1 - F) (w + a (L_bottom / n^2 - w)) by colour, to 1 %.

    L_bottom = albedo T exp(-1.19 absorption depth) L_sky, T = 0.934 what the surface lets in of an even sky.
    """
    n, depth = 1.333, 2.0
    scene = still_water(TracedSettings(absorption=ABSORPTION), depth)
    plan = planned(scene, VIEWS[view])
    got = draw(renderer, scene, VIEWS[view], technique="TRACED", texture_size=512)[..., :3].reshape(-1, 3)
    _, sight = pixel_rays(plan.camera.view, plan.camera.projection, (160, 120))
    on_water = sight[:, 2] < -0.05
    cosine = -sight[on_water, 2]
    fresnel = optics.fresnel_dielectric(cosine, 1.0 / n)[:, None]
    below = np.sqrt(1.0 - (1.0 - cosine**2) / n**2)
    absorption = np.array(ABSORPTION)
    entered = 0.9336 * np.exp(-1.193 * absorption * depth) * scenes.SKY_RADIANCE
    left = np.exp(-absorption * (depth / below)[:, None])
    water = np.array([0.02, 0.1, 0.08])
    want = fresnel * scenes.SKY_RADIANCE + (1.0 - fresnel) * (
        water + left * (ALBEDO * entered / n**2 - water)
    )
    np.testing.assert_allclose(got[on_water], want, rtol=0.01)


def test_sunlight_is_absorbed_by_color(renderer):
    """On the way down, along the refracted ray, and up again; sky light is the same in both pictures."""
    n, depth = 1.333, 2.0
    absorption = np.array(ABSORPTION)
    toward = np.array([0.6, 0.0, 0.8])
    own = TracedSettings(absorption=ABSORPTION)
    sunny = still_water(own, depth, sun=scenes.Sun(toward, np.array([3.0, 2.0, 1.0])))
    pictures = [
        draw(renderer, scene, VIEWS["straight down"], technique="TRACED")[60, 80, :3]
        for scene in (sunny, still_water(own, depth))
    ]
    way = depth / np.sqrt(1.0 - 0.6**2 / n**2)
    entered = (1.0 - optics.fresnel_dielectric(0.8, 1.0 / n)) * 0.8 * np.exp(-absorption * way)
    leaves = (1.0 - optics.fresnel_dielectric(1.0, 1.0 / n)) / n**2 * np.exp(-absorption * depth)
    want = ALBEDO / np.pi * np.array([3.0, 2.0, 1.0]) * entered * leaves
    np.testing.assert_allclose(pictures[0] - pictures[1], want, rtol=0.01)


def test_water_that_neither_bends_nor_absorbs_is_not_there(renderer):
    scene = scenes.pond(ior=1.0, own=(TracedSettings(absorption=(0.0, 0.0, 0.0)),))
    dry = replace(scene, waters=(), version=next(scenes._versions))
    size, view = (160, 120), VIEWS["from the shore"]
    wet_picture = draw(renderer, scene, view, size, technique="TRACED", texture_size=1024)
    off = np.abs(wet_picture - draw(renderer, dry, view, size))[..., :3].max(axis=-1)
    assert np.median(off) < 5e-3
    assert np.mean(off > 0.1) < 0.05  # the edges of squares and posts, which a texture blurs


def test_reflection_depth_is_drawn_for_traced_only(renderer):
    from lake_water_addon.render.frame import PassTimer
    from lake_water_addon.render.passes import textures

    scene, view = scenes.pond(), VIEWS["from the shore"]
    plan = planned(scene, view, 128)
    renderer.draw_textures(plan, PassTimer())
    target = textures.reflection_target(renderer.targets, 0, 128, linear_depth=True)
    depth = read_texture(target.colors[1])[..., 0]
    sky = depth > 9e4
    assert 0.05 < sky.mean() < 0.95
    inside = read_texture(target.colors[0])[..., 3] < 0.5
    assert inside.any()
    assert np.all(depth[inside] == 0.0)
    lake_plan = replace(plan, technique=plan_frame(scene, view, FrameSettings()).technique)
    renderer.draw_textures(lake_plan, PassTimer())
    assert len(textures.reflection_target(renderer.targets, 0, 128).colors) == 1
