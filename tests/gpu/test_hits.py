# SPDX-License-Identifier: GPL-3.0-or-later
"""The hits pass: the points that it tells are those that the picture shows, or where the search ends.

What is shown is known from scenes whose colours are their places.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import (
    air_lookup,
    depth_trace,
    intersection,
    optics,
    waves,
)
from lake_water_addon.core.technique_pond import PondSettings
from lake_water_addon.core.technique_ripple import RippleSettings
from lake_water_addon.core.technique_traced import TracedSettings
from lake_water_addon.core.techniques import TECHNIQUES
from tests.gpu import pictures, scenes
from tests.gpu.glsl import read_texture

SIZE = (160, 120)
VIEW = scenes.look_at((1, -8, 5), (0, 0.5, 0), SIZE)
ORTHOGRAPHIC = scenes.look_at((1, -8, 5), (0, 0.5, 0), SIZE, ortho=9.0)
FROM_BELOW = scenes.look_at((0.5, -4, -0.8), (0, 0, 0.3), SIZE)
AT_THE_SURFACE = scenes.look_at((1, -6, 0.02), (0, 0, 0.1), SIZE)

MATERIAL = {"ambient": (1.0,) * 3, "diffuse": (0.0,) * 3, "specular": (0.0,) * 3, "impurity": 0.0}
STRENGTHS = ("distance", "angle", "depth")
CLEAR = {f"{name}_strength": 0.0 for name in STRENGTHS} | {"depth_darkening": 0.0, "path_darkening": 0.0}
OWN = {
    "refracted": (PondSettings(**MATERIAL, bias=2.0), RippleSettings(**CLEAR)),
    "reflected": (
        PondSettings(**MATERIAL, bias=-2.0),
        RippleSettings(**{**CLEAR, "distance_strength": 1.0, "distance_range": (0.0, 0.0)}),
    ),
}
"""Settings with which only one of the two is seen, and its colour is not changed."""


BOXES = (
    ((-2, 1, 0), (0.3, 0.3, 2)),
    ((2, -1, 0), (0.2, 0.4, 2)),
    ((0, 3, 1), (3, 0.2, 0.2)),
    ((0, 6, 2), (6, 0.2, 4)),
)
"""Middles and half extents, m."""


def coded(waves_of_lake=scenes.LAKE_WAVES, **settings):
    """A bowl with posts, a beam over the water and a wall behind it, in the colours of their places."""
    bowl = scenes.grid_mesh("bowl", 97, 7.9, lambda x, y: -2.5 + (x * x + y * y) / 30.0)
    meshes = [bowl]
    for i, (place, half) in enumerate(BOXES):
        box = scenes.box_mesh(f"box {i}", half)
        meshes.append(replace(box, positions=box.positions + np.float32(place)))
    material = scenes.Material("coded", np.ones(3), use_color_attribute=True)
    return scenes.snapshot(
        [scenes.position_coded(mesh) for mesh in meshes],
        (material,),
        [(mesh.key, "coded", [np.eye(4)]) for mesh in meshes],
        (scenes.water(half_size=7.0, waves=waves_of_lake, k=0.0, **settings),),
        sky=scenes.constant_sky((1.0, 1.0, 1.0)),
    )


def compare_with_picture(renderer, scene, camera, which, **options):
    """The picture's colours, decoded, are the places found: to 4 cm in 95 of 100 pixels."""
    plan = pictures.planned(scene, camera, texture_size=512, **options)
    hits = renderer.draw_hits(plan, SIZE)
    shown = scenes.decoded_positions(pictures.draw_plan(renderer, plan, SIZE))
    found = getattr(hits, which)
    there = (hits.surface[..., 3] == 1.0) & (found[..., 3] == 1.0)
    assert there.mean() > 0.05
    off = np.linalg.norm(found[there][:, :3] - shown[there], axis=1)
    # The others lie at edges, where a filtered colour is none of the two sides'.
    assert np.mean(off < 0.04) > 0.95, f"{np.mean(off < 0.04):.3f}"
    assert np.median(off) < 0.01
    return hits


@pytest.mark.parametrize("camera", [VIEW, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("technique", ["SIMPLE_LAKE", "POND", "RIPPLE"])
def test_what_is_seen_through_the_water(renderer, technique, camera):
    scene = coded(q=1e4, own=OWN["refracted"])
    hits = compare_with_picture(renderer, scene, camera, "refracted", technique=technique)
    water = hits.surface[..., 3] == 1.0
    assert hits.refracted[water][:, 3].mean() > 0.9


@pytest.mark.parametrize("camera", [VIEW, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
@pytest.mark.parametrize("technique", ["LAKE", "SIMPLE_LAKE", "POND", "RIPPLE"])
def test_what_is_mirrored(renderer, technique, camera):
    scene = coded(q=0.0, own=OWN["reflected"])
    hits = compare_with_picture(renderer, scene, camera, "reflected", technique=technique)
    water = hits.surface[..., 3] == 1.0
    sky = hits.reflected[water][:, 3] == 0.0
    assert 0.02 < sky.mean() < 0.95
    np.testing.assert_array_equal(hits.reflected[water][sky], 0.0)


def surface_rays(plan, hits):
    """U, the refracted and the reflected directions (n, 3) of the pixels that show water, and which do."""
    body = plan.bodies[0]
    water = hits.surface[..., 3] == 1.0
    surface = hits.surface[water][:, :3].astype(np.float64)
    if plan.camera.projection[3, 3] == 1.0:
        to_eye = np.broadcast_to(plan.camera.view[2, :3], surface.shape)
    else:
        to_eye = np.linalg.inv(plan.camera.view)[:3, 3] - surface
        to_eye = to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True)
    normal = waves.normal(body.packed_waves, (surface - body.origin)[:, :2])
    normal = optics.face_viewer(normal, to_eye)
    bent, _ = optics.refract_direction(-to_eye, normal, 1.0 / body.body.settings.ior)
    return surface, bent, optics.reflect_upwards(-to_eye, normal), water


@pytest.mark.parametrize("camera", [VIEW, ORTHOGRAPHIC], ids=["perspective", "orthographic"])
def test_lake_tells_the_end_of_its_search(renderer, camera):
    """W of the twin on the depth that the GPU drew: to 1 cm in 97 of 100 pixels."""
    from lake_water_addon.render.passes import textures

    plan = pictures.planned(scenes.pond(), camera, texture_size=512)
    hits = renderer.draw_hits(plan, SIZE)
    target = textures.refraction_target(renderer.targets, 0, 512)
    depth = read_texture(target.colors[1])[..., 0].astype(np.float64)
    refraction = plan.bodies[0].refraction
    surface, bent, _, water = surface_rays(plan, hits)

    def look_up(uv):
        x, y = np.clip((uv * len(depth)).astype(int), 0, len(depth) - 1).T
        return depth[y, x]

    found = intersection.intersect(
        air_lookup.in_camera(refraction, surface),
        bent @ refraction.view[:3, :3].T,
        look_up,
        refraction.projection,
        plan.settings.intersection_steps,
    )
    want = (found.hit - refraction.view[:3, 3]) @ refraction.view[:3, :3]
    assert len(want) > 5000
    there = hits.refracted[water][:, 3] == 1.0
    assert there.mean() > 0.95
    off = np.linalg.norm(hits.refracted[water][:, :3] - want, axis=1)[there]
    assert np.mean(off < 0.01) > 0.97, f"{np.mean(off < 0.01):.3f}"
    assert np.median(off) < 1e-3


def compare_with_trace(given, water, surface, direction, target, trace):
    """The twin's trace (points, directions, depth) on the depth that the GPU drew: whether there is anything,
    and W to 1 cm, or 1 % of the way, in 97 of 100 pixels."""
    depth = read_texture(target.colors[1])[..., 0].astype(np.float64)
    met = trace(surface, direction, depth)
    want = surface + met.way[:, None] * direction
    known = given[water][:, 3] == 1.0
    assert np.mean(known == (met.known > 0.5)) > 0.97
    both = known & (met.known > 0.5)
    assert both.mean() > 0.1
    off = np.linalg.norm(given[water][:, :3] - want, axis=1)[both]
    same = off < 0.01 * np.maximum(met.way[both], 1.0)
    assert np.mean(same) > 0.97, f"{np.mean(same):.3f}"


def tracers(body, search):
    """The twin's traces of refracted and of reflected rays (points, directions, depth), from the air."""

    def down(surface, direction, depth):
        planned, lowest = body.refraction, body.lowest
        return depth_trace.trace_downwards(surface, direction, planned, lowest, search, depth)

    def up(surface, direction, depth):
        planned, highest = body.reflection, body.highest
        return depth_trace.trace_upwards(surface, direction, planned, highest, search, depth)

    return down, up


FOLLOWING = {
    "traced": ({"technique": "TRACED"}, TracedSettings()),
    "lake": ({"refraction_steps": 48, "reflection_steps": 48}, depth_trace.FollowedRays(48)),
}


@pytest.mark.parametrize("following", FOLLOWING.values(), ids=FOLLOWING)
def test_followed_rays_tell_what_they_met(renderer, following):
    from lake_water_addon.render.passes import textures

    settings, search = following
    plan = pictures.planned(scenes.pond(), VIEW, texture_size=512, **settings)
    hits = renderer.draw_hits(plan, SIZE)
    surface, bent, mirrored, water = surface_rays(plan, hits)
    down, up = tracers(plan.bodies[0], search)
    target = textures.refraction_target(renderer.targets, 0, 512)
    compare_with_trace(hits.refracted, water, surface, bent, target, down)
    target = textures.reflection_target(renderer.targets, 0, 512, linear_depth=True)
    compare_with_trace(hits.reflected, water, surface, mirrored, target, up)


def test_from_below(renderer):
    """Straight through a surface that does not bend light, and what the surface mirrors of the bowl."""
    scene = coded(ior=1.0, q=1e4)
    hits = compare_with_picture(renderer, scene, FROM_BELOW, "refracted", use_exact_under_water=False)
    found = hits.refracted[..., 3] == 1.0
    assert hits.refracted[found][:, 2].min() > -0.2
    scene = coded(ior=1.333, q=0.0)
    hits = compare_with_picture(renderer, scene, FROM_BELOW, "reflected", use_exact_under_water=False)
    found = hits.reflected[..., 3] == 1.0
    assert hits.reflected[found][:, 2].max() < 0.2


def test_total_reflection_is_not_seen_through(renderer):
    plan = pictures.planned(coded(), FROM_BELOW)
    hits = renderer.draw_hits(plan, SIZE)
    water = hits.surface[..., 3] == 1.0
    mirror = water & (hits.refracted[..., 3] == 0.0) & (hits.reflected[..., 3] == 1.0)
    assert mirror.sum() > 0.3 * water.sum()


def test_each_pixel_is_of_the_side_on_which_it_begins(renderer):
    plan = pictures.planned(coded(), AT_THE_SURFACE)
    body = plan.bodies[0]
    assert body.refraction.drawn and body.under.refraction.drawn
    hits = renderer.draw_hits(plan, SIZE)
    water = hits.surface[..., 3] == 1.0
    surface = hits.surface[water][:, :3].astype(np.float64)
    eye = np.linalg.inv(plan.camera.view)[:3, 3]
    normal = waves.normal(body.packed_waves, (surface - body.origin)[:, :2])
    above = np.sum((eye - surface) * normal, axis=1) > 0.0
    assert 0.05 < above.mean() < 0.95
    mirrored = hits.reflected[water]
    under, known = mirrored[:, 2] < surface[:, 2], mirrored[:, 3] == 1.0
    assert np.mean(under[known & above]) < 0.05
    assert np.mean(under[known & ~above]) > 0.95


def test_bodies_are_told_apart_and_things_hide_them(renderer):
    """Two rectangles, one of them a mesh; what stands before the water is no water."""
    scene = coded(waves_of_lake=())
    (left,) = scene.waters
    left = replace(left, grid=(17, 3.0, 6.0, -3.0, 0.0))
    sheet = scenes.grid_mesh("sheet", 17, 3.0)
    matrix = scenes.translation(3.0, 0.0) @ np.diag([1.0, 2.0, 1.0, 1.0])
    right = replace(left, key="right", grid=None, mesh="sheet", matrix=matrix)
    scene = replace(scene, meshes={**scene.meshes, "sheet": sheet}, waters=(left, right))
    hits = renderer.draw_hits(pictures.planned(scene, VIEW), SIZE)
    number = hits.surface[..., 3]
    assert set(np.unique(number)) == {0.0, 1.0, 2.0}
    assert hits.surface[number == 1.0][:, 0].max() < 0.01
    assert hits.surface[number == 2.0][:, 0].min() > -0.01
    np.testing.assert_allclose(hits.surface[number > 0.0][:, 2], 0.0, atol=1e-5)
    picture = pictures.draw(renderer, replace(scene, waters=()), VIEW)
    position = scenes.decoded_positions(picture)
    dry = np.linalg.norm(position - (0.0, 3.0, 1.0), axis=-1) < 0.3  # the beam
    assert dry.sum() > 20
    assert np.all(number[dry] == 0.0)


@pytest.mark.parametrize("technique", TECHNIQUES)
def test_a_picture_does_not_know_of_it(renderer, technique):
    """The same picture before and after, and nothing is made for it."""
    scene = scenes.pond()
    options = {"technique": technique, "use_caustics": True, "use_shadows": True}
    plan = pictures.planned(scene, VIEW, **options)
    before = pictures.draw_plan(renderer, plan, SIZE)
    renderer.draw_hits(plan, SIZE)
    renderer.resources.reset_counts()
    after = pictures.draw_plan(renderer, plan, SIZE)
    renderer.draw_hits(plan, SIZE)
    assert dict(renderer.resources.made) == {}
    np.testing.assert_array_equal(before, after)


def test_no_water(renderer):
    scene = replace(scenes.pond(), waters=())
    hits = renderer.draw_hits(pictures.planned(scene, VIEW), SIZE)
    for points in hits:
        assert points.shape == (SIZE[1], SIZE[0], 4)
        np.testing.assert_array_equal(points, 0.0)
