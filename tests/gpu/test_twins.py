# SPDX-License-Identifier: GPL-3.0-or-later
"""Every function of `gpu_shaders/*_lib.glsl`, run on the GPU, against its float64 twin in `core/`.

The test of a function is called `test_twin_<function>`: `test_every_function_has_a_twin_test` relies on it.
Bounds are stated beside each comparison. EPS is one step of float32 at 1; the transcendental functions of
GLSL are allowed more than that, and what is allowed was measured on Mesa's llvmpipe and rounded up.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lake_water_addon.core import (
    air_lookup,
    cameras,
    caustics,
    depth_trace,
    glow,
    hits,
    intersection,
    lighting,
    lookup,
    optics,
    screen_lookup,
    shadows,
    sky,
    surface,
    technique_lake,
    technique_lake_under,
    technique_pond,
    technique_ripple,
    technique_settings,
    technique_simple_lake,
    technique_traced,
    under_water,
    view_transform,
    water_light,
    wave_maps,
    waves,
)
from lake_water_addon.core.plan import plan_frame
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import Sky, Sun
from tests.gpu import scenes
from tests.gpu.glsl import data_texture, evaluate, single
from tests.light_window import lattice

EPS = 2.0**-23
N12 = float(np.float32(1.0 / 1.333))
RNG = np.random.default_rng
SHADERS = Path(__file__).resolve().parents[2] / "lake_water_addon" / "gpu_shaders"
WATER_SOURCES = (
    "camera_lib.glsl",
    "waves_lib.glsl",
    "optics_lib.glsl",
    "sky_lib.glsl",
    "technique_lake_lib.glsl",
)

pytestmark = pytest.mark.usefixtures("gpu")


def compare(got, want, atol, rtol=0.0):
    """All within atol + rtol |want|; a failure names the worst case."""
    got, want = np.asarray(got, np.float64), np.asarray(want, np.float64)
    assert got.shape == want.shape
    excess = np.abs(got - want) / (atol + rtol * np.abs(want))
    excess = np.where(np.isnan(excess), np.inf, excess)
    worst = np.unravel_index(np.argmax(excess), excess.shape)
    assert excess[worst] <= 1.0, (
        f"case {worst}: GLSL {got[worst]!r}, twin {want[worst]!r}: {excess[worst]:.3g} times the bound"
    )


def unit_vectors(count, seed):
    v = RNG(seed).normal(size=(count, 3))
    return single(v / np.linalg.norm(v, axis=1, keepdims=True))


def normals_and_eyes(count=3000):
    """Random pairs, then the extremes: facing, edge on, turned away, and steep normals with a grazing eye."""
    normal, to_eye = unit_vectors(count, 1), unit_vectors(count, 2)
    normal[:50] = to_eye[:50]
    normal[50:100] = -to_eye[50:100]
    edge_on = np.cross(to_eye[100:200], unit_vectors(100, 3))
    normal[100:200] = single(edge_on / np.linalg.norm(edge_on, axis=1, keepdims=True))
    normal[200:300] = (0.0, 0.0, 1.0)
    angle = np.geomspace(1e-6, 0.1, 100)
    to_eye[200:300] = single(np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=1))
    return normal, to_eye


def test_every_function_has_a_twin_test():
    """A function added to a library without a test of its own fails here, by name."""
    functions = {
        (path.name, name)
        for path in sorted(SHADERS.glob("*_lib.glsl"))
        for name in re.findall(
            r"^(?!struct|return|else)\w+ (\w+)\([^;]*?\)\s*\{", path.read_text(), re.MULTILINE | re.DOTALL
        )
    }
    assert len(functions) > 20, "the pattern no longer finds the functions"
    tests = re.findall(r"^def test_twin_(\w+)\(", Path(__file__).read_text(), re.MULTILINE)
    missing = sorted(f"{name} of {path}" for path, name in functions if name not in tests)
    assert not missing, f"no test_twin_<name> for: {', '.join(missing)}"


# optics_lib.glsl


def test_twin_face_viewer():
    normal, to_eye = normals_and_eyes()
    got = evaluate(["optics_lib.glsl"], {"n": ("vec3", "face_viewer(n, e)")}, n=normal, e=to_eye)["n"]
    # Turned away exactly, the sum is MIN_COSINE long: its direction has 1 / MIN_COSINE times the rounding.
    lost = np.linalg.norm(
        normal + np.maximum(optics.MIN_COSINE - np.sum(normal * to_eye, 1), 0)[:, None] * to_eye, axis=1
    )
    compare(got, optics.face_viewer(normal, to_eye), 4 * EPS / lost[:, None])
    assert np.all(np.sum(got * to_eye, axis=1) > 0.0)


@pytest.mark.parametrize("n12", [N12, 1.0, 0.25, float(np.float32(1.333))])
def test_twin_refract_direction(n12):
    normal, to_eye = normals_and_eyes()
    incident = -np.where(np.sum(normal * to_eye, 1, keepdims=True) < 0, -to_eye, to_eye)
    got = evaluate(
        ["optics_lib.glsl"],
        {"r": ("vec3", "refract_direction(i, n, n12)")},
        i=incident,
        n=normal,
        n12=np.full(len(normal), n12),
    )["r"]
    want, exists = optics.refract_direction(incident, normal, n12)
    cosine = np.sum(normal * incident, axis=1)
    s = 1.0 - n12 * n12 * (1.0 - cosine * cosine)
    decided = np.abs(s) > 8 * EPS  # at the critical angle the sign of s is rounding
    assert decided.mean() > 0.9
    # The square root has a steep beginning: an error of EPS in s is EPS / sqrt(s) in the direction.
    bound = EPS * (8.0 + 4.0 / np.sqrt(np.maximum(np.abs(s), 8 * EPS)))
    compare(got[decided], want[decided], bound[decided, None])
    assert np.all(got[decided & ~exists] == 0.0)


def test_twin_reflect_direction():
    normal, to_eye = normals_and_eyes()
    got = evaluate(["optics_lib.glsl"], {"r": ("vec3", "reflect_direction(i, n)")}, i=-to_eye, n=normal)["r"]
    compare(got, optics.reflect_direction(-to_eye, normal), 4 * EPS)


def test_twin_reflect_upwards():
    normal, to_eye = normals_and_eyes()
    got = evaluate(["optics_lib.glsl"], {"r": ("vec3", "reflect_upwards(i, n)")}, i=-to_eye, n=normal)["r"]
    # Near the clamp a kink in z: no steeper than 1, so that the bound is that of the reflection.
    compare(got, optics.reflect_upwards(-to_eye, normal), 8 * EPS)


def test_twin_schlick():
    """1e-6 and 1e-7 q, what pow loses; q = 0, looking straight down, and cosines beyond 0..1 included."""
    cosine, f, q = (
        a.ravel()
        for a in np.meshgrid(
            single([-0.5, 0.0, 1e-6, 1e-3, 0.1, 0.5, 0.9, 0.999999, 1.0, 1.0 + EPS, 2.0]),
            single([0.0, 0.0204, 0.36, 1.0]),
            single([0.0, 0.5, 1.0, 4.5, 5.0, 5.65, 20.0, 100.0]),
        )
    )
    got = evaluate(["optics_lib.glsl"], {"f": ("float", "schlick(cosine, f, q)")}, cosine=cosine, f=f, q=q)[
        "f"
    ]
    compare(got, optics.schlick(cosine, f, q), 1e-6 + 1e-7 * q)


@pytest.mark.parametrize("n12", [N12, 1.0, 0.25, float(np.float32(1.333)), 4.0])
def test_twin_fresnel_dielectric(n12):
    """At total internal reflection, n12 = 1, grazing light; the critical angle has the root's steepness."""
    cosine = np.concatenate([np.linspace(0, 1, 2000), np.geomspace(1e-9, 1, 500), [-0.5, 1.0 + EPS, 2.0]])
    cosine = single(cosine)
    got = evaluate(
        ["optics_lib.glsl"],
        {"f": ("float", "fresnel_dielectric(cosine, n12)")},
        cosine=cosine,
        n12=np.full(len(cosine), n12),
    )["f"]
    s = (1.0 - n12) * (1.0 + n12) + (n12 * np.clip(cosine, 0, 1)) ** 2
    size = abs(1.0 - n12) * (1.0 + n12) + (n12 * np.clip(cosine, 0, 1)) ** 2  # of what is added up in s
    decided = np.abs(s) > 8 * EPS * size
    assert decided.mean() > 0.9
    lost = np.where(s > 0.0, size / np.maximum(np.abs(s), 1e-30), 0.0)
    bound = EPS * (16.0 + 8.0 * n12 * np.sqrt(size) * np.sqrt(lost))
    compare(got[decided], optics.fresnel_dielectric(cosine, n12)[decided], bound[decided])


def test_twin_attenuation():
    """Relative 4 EPS (1 + k d), as rounding k d is; what underflows float32 may be 0."""
    k, d = (
        a.ravel() for a in np.meshgrid(single([0, 0.01, 0.5, 3, 1000]), single([0, 1e-3, 0.1, 1, 7, 40, 1e5]))
    )
    got = evaluate(["optics_lib.glsl"], {"a": ("float", "attenuation(k, d)")}, k=k, d=d)["a"]
    want = optics.attenuation(k, d)
    compare(got, want, 1e-37, 4 * EPS * (1.0 + np.minimum(k * d, 100.0)))


def test_twin_through_water():
    rng = RNG(4)
    color, water, a = (
        single(rng.uniform(0, 50, (500, 3))),
        single(rng.uniform(0, 1, (500, 3))),
        rng.random(500),
    )
    a[:2] = 0.0, 1.0
    a = single(a)
    got = evaluate(["optics_lib.glsl"], {"c": ("vec3", "through_water(c, w, a)")}, c=color, w=water, a=a)["c"]
    compare(got, optics.through_water(color, water, a[:, None]), 100 * EPS)


def test_twin_mix_fresnel():
    rng = RNG(5)
    one, other, f = (
        single(rng.uniform(0, 50, (500, 3))),
        single(rng.uniform(0, 50, (500, 3))),
        rng.random(500),
    )
    f[:2] = 0.0, 1.0
    f = single(f)
    got = evaluate(["optics_lib.glsl"], {"c": ("vec3", "mix_fresnel(a, b, f)")}, a=one, b=other, f=f)["c"]
    compare(got, optics.mix_fresnel(one, other, f[:, None]), 100 * EPS)


# waves_lib.glsl


def planned(scene=None, camera=None, **options):
    return plan_frame(
        scene or scenes.pond(),
        camera or scenes.look_at((14, -14, 4), (0, 0, -0.5)),
        FrameSettings(**{"texture_size": 64, **options}),
    )


def water_block(plan):
    from lake_water_addon.render import uniforms
    from lake_water_addon.render.resources import Resources

    return uniforms.UniformBlock(Resources()).update(*uniforms.water(plan, plan.bodies[0]))


def block_of(members):
    """A uniform buffer that holds these members."""
    from lake_water_addon.render.resources import Resources
    from lake_water_addon.render.uniforms import UniformBlock

    return UniformBlock(Resources()).update(*members)


def lights_block(scene):
    from lake_water_addon.render import uniforms
    from lake_water_addon.render.resources import Resources

    return uniforms.UniformBlock(Resources()).update(*uniforms.lights(planned(scene)))


def wave_cases():
    """Packed waves as the GPU gets them, and points up to 500 m from the water's origin."""
    for waves_of_case in ((), scenes.LAKE_WAVES, scenes.STEEP_WAVES, scenes.LAKE_WAVES * 8):
        plan = planned(scenes.pond(waves=waves_of_case))
        points = single(RNG(6).uniform(-1, 1, (2000, 2)) * np.geomspace(0.1, 500, 2000)[:, None])
        yield plan, single(plan.bodies[0].packed_waves), points


def wave_bound(packed, points, factor):
    """Rounding of the angle k.p (2 EPS of its terms), of sin and cos (1e-6), times amplitude and factor."""
    angle = np.abs(points) @ np.abs(packed[:, :2]).T + 2 * np.pi
    return (2 * EPS * angle + 1e-6) @ (packed[:, 2] * factor) + 1e-9


def test_twin_sine_cosine():
    """4e-7, and what the angle's own rounding costs."""
    angle = RNG(41).uniform(-1, 1, 4000) * np.geomspace(0.1, 1e4, 4000)
    angle = single(np.append(angle, [0.0, np.pi]))
    blocks = {"water": ("Water", water_block(planned()))}
    got = evaluate(["waves_lib.glsl"], {"s": ("vec2", "sine_cosine(a)")}, uniform_buffers=blocks, a=angle)[
        "s"
    ]
    compare(got, np.stack([np.sin(angle), np.cos(angle)], 1), (4e-7 + 2 * EPS * np.abs(angle))[:, None])


def test_twin_wave_slope_and_height():
    for plan, packed, points in wave_cases():
        got = evaluate(
            ["waves_lib.glsl"],
            {"w": ("vec3", "wave_slope_and_height(p)")},
            uniform_buffers={"water": ("Water", water_block(plan))},
            p=points,
        )["w"]
        steepness = np.linalg.norm(packed[:, :2], axis=1)
        compare(got[:, :2], waves.slope(packed, points), wave_bound(packed, points, steepness)[:, None])
        compare(got[:, 2], waves.height(packed, points), wave_bound(packed, points, 1.0))


def test_twin_wave_height():
    for plan, packed, points in wave_cases():
        got = evaluate(
            ["waves_lib.glsl"],
            {"h": ("float", "wave_height(p)")},
            uniform_buffers={"water": ("Water", water_block(plan))},
            p=points,
        )["h"]
        compare(got, waves.height(packed, points), wave_bound(packed, points, 1.0))


# surface_lib.glsl


def test_twin_is_in_body():
    """In and around a turned rectangle that does not lie about its origin."""
    body = planned(scenes.pond()).bodies[0]
    body = replace(body, body=replace(body.body, matrix=turned(0.7)), extent=(6.0, 2.5, 1.5, -0.5))
    points = single(RNG(8).uniform(-9, 9, (4000, 3)))
    blocks = {"water": ("Water", water_block(replace(planned(), bodies=(body,))))}
    got = evaluate(
        ["waves_lib.glsl", "surface_lib.glsl"],
        {"i": ("float", "float(is_in_body(p))")},
        uniform_buffers=blocks,
        p=points,
    )["i"]
    want = surface.is_in_body(points, body)
    assert 0.1 < want.mean() < 0.9
    apart = np.abs(surface.in_water_frame(points, body) - body.extent[2:]) - body.extent[:2]
    clear = np.abs(apart).min(axis=1) > 1e-5
    np.testing.assert_array_equal(got[clear], want[clear])


def test_twin_most_towards_eye():
    point, eye = single(RNG(9).uniform(-50, 50, (500, 3))), single([3.0, -4.0, 2.0])
    for orthographic in (False, True):
        given = single(np.append(eye, float(orthographic)))
        got = evaluate(
            ["waves_lib.glsl", "surface_lib.glsl"],
            {"m": ("float", "most_towards_eye(e, p)")},
            uniform_buffers={"water": ("Water", water_block(planned()))},
            e=np.broadcast_to(given, (500, 4)),
            p=point,
        )["m"]
        compare(got, surface.most_towards_eye(eye, point, orthographic=orthographic), 0.0, 4 * EPS)


def turned(heading):
    """The matrix of a body at the origin whose X axis has that heading."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]]
    return matrix


@pytest.mark.parametrize("up", [1.0, -1.0], ids=["from the air", "from below"])
@pytest.mark.parametrize("steep", [False, True], ids=["lake", "steep"])
def test_twin_surface_in_sight(steep, up):
    """The twin's place to 0.1 mm where Newton's steps are a contraction, and no worse than the mesh anywhere.

    Points lie up to 20 m away, of a mesh that is off by up to the waves' whole height.
    """
    plan = planned(scenes.pond(waves=scenes.STEEP_WAVES if steep else scenes.LAKE_WAVES))
    body = replace(plan.bodies[0], packed_waves=single(plan.bodies[0].packed_waves))
    rng = RNG(7)
    point = single(np.append(rng.uniform(-20, 20, (3000, 2)), rng.normal(0, 0.05, (3000, 1)), axis=1))
    wave = single(point[:, 2] - rng.normal(0, 0.01, 3000))
    mesh_slope = single(rng.normal(0, 0.03, (3000, 2)))
    angle, rise = rng.uniform(-np.pi, np.pi, 3000), np.geomspace(0.01, 1.57, 3000)
    to_eye = single(
        np.stack([np.cos(angle) * np.cos(rise), np.sin(angle) * np.cos(rise), up * np.sin(rise)], axis=1)
    )
    most = single(rng.uniform(0.05, 5.0, 3000))
    got = evaluate(
        ["waves_lib.glsl", "surface_lib.glsl"],
        {"position": ("vec3", "found.position"), "slope": ("vec2", "found.slope")},
        statements=f"SurfacePoint found = surface_in_sight(p, wave, mesh_slope, e, most, {up});",
        uniform_buffers={"water": ("Water", water_block(replace(plan, bodies=(body,))))},
        p=point,
        wave=wave,
        mesh_slope=mesh_slope,
        e=to_eye,
        most=most,
    )
    want = surface.surface_in_sight(point, wave, mesh_slope, to_eye, most, up, body)

    def above(place):
        along = np.sum((place - point) * to_eye, axis=1)
        over_mesh = to_eye[:, 2] - np.sum(mesh_slope * to_eye[:, :2], axis=1)
        height = waves.height(body.packed_waves, place[:, :2] - body.origin[:2])
        return np.abs(wave + along * over_mesh - height)

    assert np.all(above(got["position"].astype(np.float64)) <= above(point) + 2e-5)
    if not steep:
        steady = rise > 0.5
        compare(got["position"][steady], want.position[steady], 1e-4)
        compare(got["slope"][steady], want.slope[steady], 1e-3)
        assert np.median(above(want.position)[steady]) < 1e-6 < np.median(above(point)[steady])


# camera_lib.glsl

PROJECTIONS = {
    "perspective": scenes.look_at((0, 0, 1), (0, 1, 0)).projection,
    "shifted": scenes.look_at((0, 0, 1), (0, 1, 0)).projection
    + np.array([[0, 0, 0.4, 0], [0, 0, -0.7, 0], [0, 0, 0, 0], [0, 0, 0, 0]]),
    "long clip range": scenes.look_at((0, 0, 1), (0, 1, 0), near=1e-3, far=1e5).projection,
    "orthographic": scenes.look_at((0, 0, 1), (0, 1, 0), ortho=30.0).projection,
}
every_projection = pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS)


def repeated(matrix, count):
    return np.broadcast_to(matrix, (count, 4, 4))


@every_projection
def test_twin_is_orthographic(projection):
    got = evaluate(
        ["camera_lib.glsl"],
        {
            "plain": ("bool", "is_orthographic(p)"),
            "wide": ("bool", "is_orthographic(w)"),
            "part": ("bool", "is_orthographic(c)"),
        },
        p=repeated(projection, 1),
        w=repeated(cameras.widen(projection, 1.7), 1),
        c=repeated(cameras.crop(projection, 0.1, 0.2, 0.4, 0.9), 1),
    )
    for value in got.values():
        assert bool(value[0]) is cameras.is_orthographic(projection)


@every_projection
def test_twin_to_texture(projection):
    """Before, beside and behind the camera. Relative to the terms that are added, 8 EPS."""
    projection = single(projection)
    points = RNG(7).uniform([-50, -50, -100], [50, 50, 20], (3000, 3))
    points[:100, 2] = 0.0
    points[100:200, 2] = -np.geomspace(1e-5, 1, 100)
    points = single(points)
    got = evaluate(
        ["camera_lib.glsl"],
        {"uv": ("vec2", "to_texture(m, p)")},
        m=repeated(projection, len(points)),
        p=points,
    )["uv"]
    terms = np.abs(points) @ np.abs(projection[:2, :3]).T + np.abs(projection[:2, 3])
    w = np.maximum(points @ projection[3, :3] + projection[3, 3], cameras.MIN_W)
    compare(got, cameras.to_texture(projection, points), EPS * (8.0 * terms / w[:, None] + 4.0), 2 * EPS)


def test_twin_transform_point():
    matrices = single(RNG(8).normal(size=(500, 4, 4)) * 10)
    points = single(RNG(9).normal(size=(500, 3)) * 10)
    got = evaluate(["camera_lib.glsl"], {"p": ("vec3", "transform_point(m, p)")}, m=matrices, p=points)["p"]
    want = np.einsum("nij,nj->ni", matrices[:, :3, :3], points) + matrices[:, :3, 3]
    terms = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), np.abs(points)) + np.abs(matrices[:, :3, 3])
    compare(got, want, 4 * EPS * terms)


def test_twin_transform_direction():
    matrices = single(RNG(8).normal(size=(500, 4, 4)) * 10)
    directions = unit_vectors(500, 9)
    got = evaluate(
        ["camera_lib.glsl"], {"d": ("vec3", "transform_direction(m, d)")}, m=matrices, d=directions
    )["d"]
    want = np.einsum("nij,nj->ni", matrices[:, :3, :3], directions)
    compare(got, want, 4 * EPS * np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), np.abs(directions)))


# intersection_lib.glsl


def test_twin_bottom_through():
    points = RNG(10).uniform([-20, -20, -60], [20, 20, 1], (1000, 3))
    points[:20, 2] = 0.0
    points, z = single(points), single(-RNG(11).uniform(0.1, 80, 1000))
    got = evaluate(
        ["camera_lib.glsl", "intersection_lib.glsl"],
        {
            "perspective": ("vec3", "bottom_through(p, z, false)"),
            "orthographic": ("vec3", "bottom_through(p, z, true)"),
        },
        prelude="float bottom_depth(vec2 uv) { return 1.0; }",
        p=points,
        z=z,
    )
    compare(got["perspective"], intersection.bottom_through(points, z, False), 1e-30, 4 * EPS)
    compare(got["orthographic"], intersection.bottom_through(points, z, True), 1e-30, 0.0)


def bottom_texture(size=256):
    """Distances of an uneven bottom, 8 to 14 m away, with a hole that has no bottom at all."""
    y, x = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="ij")
    z = 11.0 + 2.0 * np.sin(5 * x + 1) * np.cos(4 * y) + np.where(x > 0.7, 1.0, 0.0)
    z[200:230, 20:60] = 1e5
    return single(z)


def fetch(values, uv):
    """texelFetch at texture coordinates, the border repeated: the twin of bottom_depth."""
    size = np.array(values.shape[::-1])
    at = np.minimum((np.clip(uv, 0.0, 1.0) * size).astype(int), size - 1)
    return values[at[:, 1], at[:, 0]]


@pytest.mark.parametrize("steps", [1, 2, 3, 16])
@every_projection
def test_twin_intersect(projection, steps):
    """1 mm for hit and bottom, at 8 to 14 m, in 99 of 100 cases.

    The others decide differently by rounding (a lookup at the border of a texel, a point just between).
    Those, and rays that are no refracted ones (the first 120), must be valid estimates of their own.
    """
    projection = single(projection)
    count = 4000
    rng = RNG(12)
    surface = rng.uniform([-6, -6, -8], [6, 6, -3], (count, 3))
    direction = rng.normal(size=(count, 3)) * [0.4, 0.4, 0.1] + [0, 0, -1]
    direction[:100] = rng.normal(size=(100, 3))  # any direction at all
    direction = single(direction / np.linalg.norm(direction, axis=1, keepdims=True))
    direction[100:110] = 0.0
    surface[110:120] = 0.0
    surface = single(surface)
    depth = bottom_texture()
    got = evaluate(
        ["camera_lib.glsl", "intersection_lib.glsl"],
        {"hit": ("vec3", "found.hit"), "bottom": ("vec3", "found.bottom"), "error": ("float", "found.error")},
        prelude="""float bottom_depth(vec2 uv) {
  ivec2 size = textureSize(refraction_depth, 0);
  return texelFetch(refraction_depth, min(ivec2(clamp(uv, 0.0, 1.0) * vec2(size)), size - 1), 0).r;
}""",
        statements="Intersection found = intersect(u, r, m, int(steps));",
        samplers={"refraction_depth": ("FLOAT_2D", data_texture(depth))},
        u=surface,
        r=direction,
        m=repeated(projection, count),
        steps=np.full(count, steps, float),
    )
    with np.errstate(all="ignore"):
        want = intersection.intersect(surface, direction, lambda uv: fetch(depth, uv), projection, steps)
    got = {name: values.astype(np.float64) for name, values in got.items()}
    assert all(np.isfinite(values).all() for values in got.values())
    far = np.maximum(1.0, np.linalg.norm(want.bottom, axis=1) / 14.0)
    apart = np.maximum(
        np.linalg.norm(got["hit"] - want.hit, axis=1), np.linalg.norm(got["bottom"] - want.bottom, axis=1)
    )
    differ = np.mean((apart > 1e-3 * far)[120:])
    assert differ < 0.01, f"{differ:.2%} differ"

    size = np.linalg.norm(got["bottom"], axis=1) + np.linalg.norm(got["hit"], axis=1) + 1.0
    off_the_ray = np.linalg.norm(np.cross(got["hit"] - surface, direction), axis=1)
    assert np.all(off_the_ray < 1e-5 * size)
    gap = np.linalg.norm(got["hit"] - got["bottom"], axis=1)
    assert np.all(np.abs(gap - got["error"]) < 1e-5 * size)


# sky_lib.glsl


def test_twin_equirectangular():
    """2e-4 in each coordinate (asin near the poles): a tenth of a texel of a 512 x 256 image."""
    directions = np.concatenate([unit_vectors(3000, 13), np.eye(3), -np.eye(3), [[1e-4, 0, 1.0]]])
    directions = single(directions / np.linalg.norm(directions, axis=1, keepdims=True))
    for rotation in (0.0, 1.0, -2.5, 6.0):
        got = evaluate(
            ["sky_lib.glsl"],
            {"uv": ("vec2", "equirectangular(d, rotation)")},
            uniform_buffers={"lights": ("Lights", lights_block(scenes.pond()))},
            samplers={"sky_image": ("FLOAT_2D", data_texture(np.zeros((1, 1, 4))))},
            d=directions,
            rotation=np.full(len(directions), rotation),
        )["uv"].astype(np.float64)
        want = sky.equirectangular_uv(directions, float(np.float32(rotation)))
        around = (got[:, 0] - want[:, 0] + 0.5) % 1.0 - 0.5
        around *= np.hypot(directions[:, 0], directions[:, 1])  # at the poles all azimuths are one
        compare(around, np.zeros(len(around)), 2e-4)
        compare(got[:, 1], want[:, 1], 2e-4)


def test_twin_sky_radiance():
    """Constant, and an image that is turned: a smooth one, so that a difference is one of direction.

    The image's seam and its poles are looked at, too: no texel of the ground shows at the zenith.
    """
    directions = np.concatenate([unit_vectors(3000, 14), np.eye(3), -np.eye(3)])
    height, width = 128, 256
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width, indexing="ij")
    image = np.ones((height, width, 4))
    image[..., :3] = 0.5 + 0.5 * sky.equirectangular_direction(np.stack([u, v], -1))
    texture = data_texture(image, smooth=True)
    texture.extend_mode("REPEAT")
    base = scenes.constant_sky()
    with_image = Sky(base.radiance, base.irradiance_sh, "an image", 2.5, 2.0)
    for case in (base, with_image):
        scene = scenes.snapshot((), (), (), sky=case)
        got = evaluate(
            ["sky_lib.glsl"],
            {"c": ("vec3", "sky_radiance(d)")},
            uniform_buffers={"lights": ("Lights", lights_block(scene))},
            samplers={"sky_image": ("FLOAT_2D", texture)},
            d=directions,
        )["c"]
        if case.image is None:
            compare(got, np.broadcast_to(case.radiance, got.shape), EPS)
            continue
        uv = sky.equirectangular_uv(directions, case.rotation)
        want = case.strength * (0.5 + 0.5 * sky.equirectangular_direction(uv))
        # Next to the poles the image is flat; elsewhere the linear filter follows it to 1e-3.
        pole = np.minimum(uv[:, 1], 1.0 - uv[:, 1]) < 1.0 / height
        compare(got[~pole], want[~pole], 1e-3 * case.strength)
        compare(got[pole], want[pole], 2e-2 * case.strength)


def lit_scenes():
    """Random expansions, one of them negative in places, with and without a sun."""
    for seed, sun in ((1, None), (2, Sun(unit_vectors(1, 3)[0], np.array([3.0, 2.5, 2.0])))):
        sh = single(RNG(seed).normal(size=(9, 3)))
        yield scenes.snapshot((), (), (), sky=Sky(np.zeros(3), sh), sun=sun)


def test_twin_sky_irradiance():
    """2e-5: the basis' constants are printed with six digits in the shader."""
    normals = np.concatenate([unit_vectors(2000, 15), np.eye(3), -np.eye(3)])
    clamped = False
    for scene in lit_scenes():
        got = evaluate(
            ["sky_lib.glsl"],
            {"c": ("vec3", "sky_irradiance(n)")},
            uniform_buffers={"lights": ("Lights", lights_block(scene))},
            samplers={"sky_image": ("FLOAT_2D", data_texture(np.zeros((1, 1, 4))))},
            n=normals,
        )["c"]
        compare(got, lighting.sky_irradiance(scene.sky, normals), 2e-5)
        clamped = clamped or np.any(got == 0.0)
    assert clamped, "no case tried the clamp at 0"


# lighting_lib.glsl


def test_twin_sun_in_air():
    normals = np.concatenate([unit_vectors(2000, 16), np.eye(3), -np.eye(3)])
    for scene in lit_scenes():
        got = evaluate(
            ["sky_lib.glsl", "lighting_lib.glsl"],
            {"c": ("vec3", "sun_in_air(n)")},
            uniform_buffers={"lights": ("Lights", lights_block(scene))},
            samplers={"sky_image": ("FLOAT_2D", data_texture(np.zeros((1, 1, 4))))},
            n=normals,
        )["c"]
        compare(got, lighting.sun_in_air(normals, scene.sun), 2e-6)


def test_twin_diffuse_radiance():
    normals = np.concatenate([unit_vectors(2000, 16), np.eye(3), -np.eye(3)])
    albedo = single(RNG(17).uniform(0, 1, normals.shape))
    sun = single(RNG(18).uniform(0, 5, normals.shape))
    part = single(RNG(19).uniform(0, 1, normals.shape))
    for scene in lit_scenes():
        got = evaluate(
            ["sky_lib.glsl", "lighting_lib.glsl"],
            {"c": ("vec3", "diffuse_radiance(albedo, n, sun, part)")},
            uniform_buffers={"lights": ("Lights", lights_block(scene))},
            samplers={"sky_image": ("FLOAT_2D", data_texture(np.zeros((1, 1, 4))))},
            albedo=albedo,
            n=normals,
            sun=sun,
            part=part,
        )["c"]
        compare(got, lighting.diffuse_radiance(albedo, normals, sun, part, scene.sky), 2e-5)


# shadow_lib.glsl


def test_twin_spline_weights():
    offset = single(np.linspace(-0.5, 0.5, 1001))
    got = evaluate(["shadow_lib.glsl"], {"w": ("vec3", "spline_weights(x)")}, x=offset)["w"]
    compare(got, shadows.spline_weights(offset), 4 * EPS)
    compare(got.sum(axis=1), np.ones(1001), 4 * EPS)


def test_twin_normal_offset():
    normal, to_light = normals_and_eyes()
    got = evaluate(["shadow_lib.glsl"], {"d": ("float", "normal_offset(n, l, 0.25)")}, n=normal, l=to_light)[
        "d"
    ]
    want = shadows.normal_offset(normal, to_light, 0.25)
    # The sine is the root of a difference: where it is small, it has the root of the rounding.
    compare(np.abs(got), np.abs(want), 0.25 * np.sqrt(4 * EPS))
    sided = np.abs(np.sum(normal * to_light, axis=1)) > 4 * EPS
    np.testing.assert_array_equal(np.sign(got[sided]), np.sign(want[sided]))


def shadowed(size=16):
    """A lit plan with three windows, and random distances to the nearest thing in each, around its points."""
    plan = planned(light_depth_size=size)
    assert len(plan.shadows) == 3
    rng = RNG(30)
    points, depths = [], []
    for camera in plan.shadows:
        inside = np.linalg.inv(camera.projection @ camera.view)
        device = np.column_stack([rng.uniform(-1.2, 1.2, (400, 2)), rng.uniform(-1, 1, 400), np.ones(400)])
        here = single((device @ inside.T)[:, :3])
        points.append(here)
        depths.append(single(rng.choice(-(here @ camera.view[2, :3]), (size, size))))
    return plan, np.concatenate(points), depths


def test_twin_in_window():
    plan, points, _ = shadowed()
    camera = plan.shadows[0]
    at = single(points @ camera.view[:3, :3].T)
    got = evaluate(
        ["shadow_lib.glsl"],
        {"t": ("vec2", "in_window(m, 16.0, at)")},
        at=at,
        m=np.repeat(camera.projection[None], len(at), axis=0),
    )["t"]
    texel = shadows.in_window(single(camera.projection), 16, at)
    compare(got, texel, 1e-5 * (1 + np.abs(texel)))


def test_twin_window_weight():
    texel = single(RNG(36).uniform(-2, 18, (2000, 2)))
    for blend in (shadows.LEAST_BLEND, 3.0):
        got = evaluate(["shadow_lib.glsl"], {"w": ("float", f"window_weight(16.0, t, {blend})")}, t=texel)[
            "w"
        ]
        compare(got, shadows.window_weight(16, texel, blend), 4 * EPS / blend)


def test_twin_face_slope():
    projection = single(np.diag([0.5, 0.2, -0.01, 1.0]))
    normal = unit_vectors(2000, 37)
    normal[:100, 2] = single(RNG(38).uniform(-0.1, 0.1, 100))
    normal[100] = 1.0, 0.0, 0.0
    got = evaluate(
        ["shadow_lib.glsl"],
        {"s": ("vec2", "face_slope(n, m, 64.0)")},
        n=normal,
        m=np.repeat(projection[None], len(normal), axis=0),
    )["s"]
    compare(got, shadows.face_slope(normal, projection, 64), 1e-6, 8 * EPS)


def test_twin_lit_part():
    rng = RNG(31)
    depth = single(rng.uniform(0, 10, (12, 9)))
    texel = single(rng.uniform(1.5, [7.5, 10.5], (3000, 2)))
    along = single(rng.uniform(-1, 11, 3000))
    slope = single(rng.normal(size=(3000, 2)) * rng.choice([0.0, 0.5, 3.0], (3000, 1)))
    got = evaluate(
        ["shadow_lib.glsl"],
        {"lit": ("float", "lit_part(distances, t, d, s)")},
        samplers={"distances": ("FLOAT_2D", data_texture(np.repeat(depth[..., None], 4, axis=2)))},
        t=texel,
        d=along,
        s=slope,
    )["lit"]
    nearly_even(got, shadows.lit_part(depth, texel, along, slope), 0.001)
    assert 0.1 < np.mean((got > 0.01) & (got < 0.99)), "no soft edges among the cases"


def shadow_options(plan, depths):
    """What the shadow libraries need: block and texture."""
    from lake_water_addon.render import uniforms

    return {
        "defines": {"SHADOWS": ""},
        "uniform_buffers": {"lights": ("Lights", block_of(uniforms.lights(plan)))},
        "samplers": {
            "shadow_depth": (
                "FLOAT_2D",
                data_texture(np.repeat(np.concatenate(depths)[..., None], 4, axis=2)),
            )
        },
    }


def nearly_even(got, want, share):
    """Equal but for `share` of the cases, where rounding decides on which side of a texel they lie."""
    wrong = np.abs(got - want) > 1e-3
    assert wrong.mean() <= share, f"{wrong.mean():.4f} of the cases differ, first: {np.nonzero(wrong)[0][:5]}"


def test_twin_sun_visibility():
    plan, points, depths = shadowed()
    normal = unit_vectors(len(points), 33)
    got = evaluate(
        ["shadow_lib.glsl"],
        {"lit": ("float", "sun_visibility(p, n)")},
        **shadow_options(plan, depths),
        p=points,
        n=normal,
    )["lit"]
    want = shadows.visibility(points, normal, plan.shadows, depths)
    assert 0.2 < want.mean() < 0.8
    nearly_even(got, want, 0.002)


# water_light_lib.glsl


every_light = pytest.mark.parametrize("technique", ["LAKE", "TRACED"])


def in_water(technique="LAKE"):
    """A lit body of water, points in and around its window, and textures: (plan, points, depth, caustics)."""
    plan = planned(light_depth_size=16, technique=technique)
    camera = plan.bodies[0].light.camera
    rng = RNG(34)
    points = single(rng.uniform((-40, -40, -6), (40, 40, 1), (4000, 3)))
    depth = single(rng.choice(-(points @ camera.view[2, :3]), (16, 16)))
    return plan, points, depth, single(rng.uniform(0, 3, (8, 8, 1)))


def water_light_options(plan, depths, depth, caustics):
    """Blocks, textures and defines of the water's light. caustics: None for a calm surface."""
    from lake_water_addon.render import uniforms

    body = plan.bodies[0]
    options = shadow_options(plan, depths)
    options["uniform_buffers"] |= {
        "water": ("Water", block_of(uniforms.water(plan, body))),
        "water_light": ("WaterLight", block_of(uniforms.water_light(plan, body))),
    }
    options["samplers"]["light_depth"] = ("FLOAT_2D", data_texture(np.repeat(depth[..., None], 4, axis=2)))
    if caustics is not None:
        smooth = data_texture(np.repeat(caustics, 4, axis=2))
        smooth.filter_mode(True)
        smooth.extend_mode("EXTEND")
        options["defines"]["CAUSTICS"] = ""
        options["samplers"]["caustics"] = ("FLOAT_2D", smooth)
    return options


def evaluate_in_water(expression, technique="LAKE", calm=False, **inputs):
    """The expression, which is a float, over the points of `in_water`; and what the twin needs."""
    plan, points, depth, caustics = in_water(technique)
    caustics = None if calm else caustics
    depths = shadowed()[2]
    got = evaluate(
        ["water_light_lib.glsl"],
        {"x": expression},
        **water_light_options(plan, depths, depth, caustics),
        p=points,
        **inputs,
    )["x"]
    body = plan.bodies[0]
    up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)

    def caustic(uv):
        return linear_filter(caustics)(uv)[:, 0]

    light = water_light.light_through_water(
        points, body, None if calm else caustic, lambda at: shadows.visibility(at, up, plan.shadows, depths)
    )
    return got, plan, points, depth, light


def test_twin_calm_light_path():
    got, plan, points, _, _ = evaluate_in_water(("float", "calm_light_path(p)"))
    compare(got, water_light.calm_light_path(points, plan.bodies[0]), 1e-5)


@pytest.mark.parametrize("calm", [False, True])
def test_twin_light_through_water(calm):
    got, _, _, _, light = evaluate_in_water(("float", "light_through_water(p)"), calm=calm)
    assert np.ptp(light) > 0.5
    # 8-bit fractions in the texture filter; texels of shadows that rounding chooses.
    assert np.mean(np.abs(got - light) > 0.02) < 0.01, np.abs(got - light).max()


def test_twin_water_light_visibility():
    normal = unit_vectors(4000, 35)
    got, plan, points, depth, _ = evaluate_in_water(("float", "water_light_visibility(p, n)"), n=normal)
    want = shadows.visibility(points, normal, [plan.bodies[0].light.camera], [depth])
    nearly_even(got, want, 0.002)


@every_light
def test_twin_sky_in_water(technique):
    got, plan, points, _, _ = evaluate_in_water(("vec3", "sky_in_water(p)"), technique)
    want = water_light.sky_in_water(points, plan.bodies[0])
    compare(got, want, 1e-5)
    assert (np.ptp(want) == 0.0) == (technique == "LAKE")


@every_light
def test_twin_sun_in_water(technique):
    normal = unit_vectors(4000, 35)
    got, plan, points, depth, light = evaluate_in_water(
        ("vec3", "sun_in_water(p, n, n)"), technique, n=normal
    )
    body, sun = plan.bodies[0], plan.snapshot.sun
    visible = shadows.visibility(points, normal, [body.light.camera], [depth])
    want = water_light.sun_in_water(points, normal, body, sun, light, visible)
    assert want.max() > 1.0
    assert np.mean(np.abs(got - want).max(axis=1) > 0.02 * sun.irradiance.max()) < 0.01


# air_lookup_lib.glsl, technique_lake_lib.glsl


def linear_filter(values):
    """The twin of a filtered lookup with its edges repeated: uv (n, 2) -> (n, channels)."""
    size = np.array(values.shape[1::-1])

    def lookup(uv):
        at = uv * size - 0.5
        low = np.floor(at)
        part = at - low
        corners = []
        for dy in (0, 1):
            for dx in (0, 1):
                x, y = (np.clip(low + np.array([dx, dy]), 0, size - 1)).astype(int).T
                corners.append(values[y, x])
        bottom = corners[0] + part[:, :1] * (corners[1] - corners[0])
        top = corners[2] + part[:, :1] * (corners[3] - corners[2])
        return bottom + part[:, 1:] * (top - bottom)

    return lookup


def lake_case(camera=None, frame=None, **settings):
    """A plan, made-up textures (smooth colours, parts with none, an uneven bottom), and rays to look up.

    frame: settings of the picture.
    """
    plan = planned(
        scenes.pond(**settings),
        camera or scenes.look_at((6, -9, 5), (0, 0, 0)),
        texture_size=128,
        **(frame or {}),
    )
    size = 128
    y, x = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="ij")
    rgb = np.stack([0.5 + 0.4 * np.sin(5 * x), 0.5 + 0.4 * np.cos(4 * y), 0.3 + 0.2 * x * y], -1)
    alpha = np.ones((size, size, 1))
    alpha[30:60, 70:110] = 0.0
    color = single(np.concatenate([rgb * alpha, alpha], -1))
    mirror = single(np.concatenate([rgb[::-1] * alpha[:, ::-1], alpha[:, ::-1]], -1))
    depth = single(11.0 + 2.0 * np.sin(5 * x + 1) * np.cos(4 * y))
    textures = air_lookup.WaterTextures(
        linear_filter(color),
        lambda uv: fetch(depth, uv),
        linear_filter(mirror),
        lambda d: np.broadcast_to(scenes.SKY_RADIANCE, d.shape),
        0.03,
    )
    gpu_arguments = {
        "sources": WATER_SOURCES,
        "uniform_buffers": {
            "lights": ("Lights", lights_block(plan.snapshot)),
            "water": ("Water", water_block(plan)),
        },
        "samplers": {
            "sky_image": ("FLOAT_2D", data_texture(np.zeros((1, 1, 4)))),
            "refraction_color": ("FLOAT_2D", data_texture(color, smooth=True)),
            "refraction_depth": ("FLOAT_2D", data_texture(depth)),
            "reflection_color": ("FLOAT_2D", data_texture(mirror, smooth=True)),
        },
    }
    xy = RNG(18).uniform(-7, 7, (4000, 2))
    packed = plan.bodies[0].packed_waves
    surface = single(np.concatenate([xy, waves.height(packed, xy)[:, None]], 1))
    eye = cameras.eye_position(plan.camera.view)
    to_eye = single((eye - surface) / np.linalg.norm(eye - surface, axis=1, keepdims=True))
    normal = single(optics.face_viewer(waves.normal(packed, xy), to_eye))
    return plan, textures, gpu_arguments, surface, normal, to_eye


def made_up_land(size=128):
    """(size, size) distances of hills, with a post before them and the sky."""
    y, x = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="ij")
    land = 25.0 + 8.0 * np.sin(6 * x + 2) + 3.0 * y
    land[80:, :] = 1e5  # the sky
    land[30:70, 60:70] = 14.0
    return single(land)


def made_up_bottom(size=128):
    """(size, size) distances of an uneven bottom with a post on it."""
    y, x = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="ij")
    bottom = 12.0 - 5.0 * y + 0.5 * np.sin(9 * x) * np.cos(7 * y)
    bottom[20:50, 40:44] -= 2.0
    return single(bottom)


def compare_radiance(got, want):
    """2e-3 in 99 of 100 cases and 2e-4 in the median: filter weights of 8 bits, texels chosen by rounding."""
    assert np.isfinite(got).all()
    apart = np.max(np.abs(got - want), axis=1)
    assert np.mean(apart > 2e-3) < 0.01, f"{np.mean(apart > 2e-3):.2%} differ by more than 2e-3"
    assert np.median(apart) < 2e-4, np.median(apart)


def test_twin_bottom_depth():
    """Also outside of the texture, where its border goes on, however far."""
    uv = RNG(19).uniform(-1, 2, (2000, 2))
    uv[:4] = (1e30, 1e30), (-1e30, 1e30), (1e12, 0.5), (1.0, 1.0)
    uv = single(uv)
    _, textures, gpu_arguments, *_ = lake_case()
    got = evaluate(results={"z": ("float", "bottom_depth(uv)")}, uv=uv, **gpu_arguments)["z"]
    same = got == textures.bottom_depth(uv)
    assert same[:4].all() and same.mean() > 0.999  # the border between two texels is rounding


def test_twin_inside_texture():
    uv = single(
        np.concatenate([RNG(20).uniform(-0.2, 1.2, (2000, 2)), [[0, 0.5], [1, 0.5], [0.015, 0.5], [1e6, 0]]])
    )
    _, textures, gpu_arguments, *_ = lake_case()
    got = evaluate(results={"w": ("float", "inside_texture(uv)")}, uv=uv, **gpu_arguments)["w"]
    compare(got, lookup.inside_texture(uv, textures.fade), 16 * EPS / textures.fade)


def test_twin_known_color():
    """Of texels with much, little and no colour, also beyond the border."""
    _, textures, gpu_arguments, *_ = lake_case()
    uv = single(RNG(54).uniform(-0.2, 1.2, (2000, 2)))
    texel = RNG(55).uniform(0.0, 1.0, (2000, 4))
    texel[:500, 3] *= 0.25
    texel[:100] = 0.0
    texel = single(texel)
    got = evaluate(results={"c": ("vec4", "known_color(t, uv)")}, t=texel, uv=uv, **gpu_arguments)["c"]
    color, known = lookup.known_color(texel, uv, textures.fade)
    compare(got[:, :3], color, 1e-5, 8 * EPS)
    compare(got[:, 3:], known, 16 * EPS / textures.fade)


LAKE_CASES = {
    "lake": {},
    "flat and clear": {"waves": (), "k": 0.0},
    "steep": {"waves": scenes.STEEP_WAVES, "c": 20.0},
    "orthographic": {"camera": scenes.look_at((6, -9, 5), (0, 0, 0), ortho=12.0)},
}
every_lake = pytest.mark.parametrize("case", LAKE_CASES.values(), ids=LAKE_CASES)


@every_lake
def test_twin_refracted_radiance(case):
    plan, textures, gpu_arguments, surface, normal, to_eye = lake_case(**case)
    direction = single(optics.refract_direction(-to_eye, normal, N12)[0])
    got = evaluate(
        results={"c": ("vec3", "refracted_radiance(u, r)")}, u=surface, r=direction, **gpu_arguments
    )["c"]
    compare_radiance(got, technique_lake.refracted_radiance(surface, direction, plan.bodies[0], 3, textures))


@every_lake
def test_twin_straight_bottom(case):
    """Relative 1e-5 in 999 of 1000 cases; the others take the neighbouring texel."""
    plan, textures, gpu_arguments, surface, *_ = lake_case(**case)
    refraction = plan.bodies[0].refraction
    u = single(air_lookup.in_camera(refraction, surface))
    got = evaluate(results={"a": ("vec3", "straight_bottom(u)")}, u=u, **gpu_arguments)["a"]
    want = air_lookup.straight_bottom(u, refraction.projection, textures.bottom_depth)
    apart = np.linalg.norm(got - want, axis=1) / np.linalg.norm(want, axis=1)
    assert np.mean(apart > 1e-5) < 1e-3, f"{np.mean(apart > 1e-5):.2%} differ"


@every_lake
def test_twin_radiance_through_water(case):
    """Anywhere in the texture, also where nothing is known, and outside of it."""
    plan, textures, gpu_arguments, surface, *_ = lake_case(**case)
    (body,) = plan.bodies
    u = single(air_lookup.in_camera(body.refraction, surface))
    uv = single(RNG(40).uniform(-0.2, 1.2, (len(u), 2)))
    path = single(RNG(41).uniform(0.0, 20.0, len(u)))
    unknown = textures.refraction_color(uv)[:, 3] < air_lookup.LEAST_KNOWN
    assert 0.02 < unknown.mean() < 0.5
    got = evaluate(
        results={"c": ("vec3", "radiance_through_water(u, uv, path)")}, u=u, uv=uv, path=path, **gpu_arguments
    )["c"]
    compare_radiance(got, air_lookup.radiance_through_water(u, uv, path, body, textures))


@every_lake
def test_twin_over_horizon(case):
    plan, _, gpu_arguments, *_ = lake_case(**case)
    points = single(RNG(29).uniform(-8, 8, (2000, 3)))
    got = evaluate(results={"p": ("vec3", "over_horizon(p)")}, p=points, **gpu_arguments)["p"]
    want = air_lookup.over_horizon(plan.bodies[0].reflection, points)
    compare(got, want, 64 * EPS * 8.0)
    assert np.any(want != points) or cameras.is_orthographic(plan.bodies[0].reflection.projection)


@every_lake
def test_twin_reflected_radiance(case):
    plan, textures, gpu_arguments, surface, normal, to_eye = lake_case(**case)
    direction = single(optics.reflect_upwards(-to_eye, normal))
    got = evaluate(
        results={"c": ("vec3", "reflected_radiance(u, r)")}, u=surface, r=direction, **gpu_arguments
    )["c"]
    compare_radiance(got, air_lookup.reflected_radiance(surface, direction, plan.bodies[0], textures))


@every_lake
def test_twin_water_radiance(case):
    plan, textures, gpu_arguments, surface, normal, to_eye = lake_case(**case)
    got = evaluate(
        results={"c": ("vec3", "water_radiance(u, n, e)")}, u=surface, n=normal, e=to_eye, **gpu_arguments
    )["c"]
    looked_up = depth_trace.TracedTextures(textures, None, None)
    (body,) = plan.bodies
    want = technique_lake.water_radiance(surface, normal, to_eye, body, plan.settings, looked_up)
    compare_radiance(got, want)


FOLLOWED = {
    "reflections": ({"reflection_steps": 20}, ["TRACE_REFLECTIONS"]),
    "refractions": ({"refraction_steps": 24}, ["TRACE_REFRACTIONS"]),
    "both": ({"refraction_steps": 24, "reflection_steps": 20}, ["TRACE_REFRACTIONS", "TRACE_REFLECTIONS"]),
}


@pytest.mark.parametrize("followed", FOLLOWED.values(), ids=FOLLOWED)
@every_lake
def test_twin_water_radiance_with_followed_rays_and_exact_fresnel(case, followed):
    frame, defines = followed
    frame = {"use_exact_fresnel": True, **frame}
    plan, textures, gpu_arguments, surface, normal, to_eye = lake_case(**case, frame=frame)
    land, bottom = made_up_land(), made_up_bottom()
    depths = {"reflection_depth": land} if "reflection_steps" in frame else {}
    if "refraction_steps" in frame:
        depths["refraction_depth"] = bottom
    arguments = gpu_arguments | {
        "defines": dict.fromkeys([*defines, "EXACT_FRESNEL"], ""),
        "samplers": gpu_arguments["samplers"]
        | {name: ("FLOAT_2D", data_texture(depth)) for name, depth in depths.items()},
    }
    got = evaluate(
        results={"c": ("vec3", "water_radiance(u, n, e)")}, u=surface, n=normal, e=to_eye, **arguments
    )["c"]
    (body,) = plan.bodies
    looked_up = depth_trace.TracedTextures(textures, bottom, land)
    want, not_followed = (
        technique_lake.water_radiance(surface, normal, to_eye, body, settings, looked_up)
        for settings in (plan.settings, replace(plan.settings, refraction_steps=0, reflection_steps=0))
    )
    compare_radiance(got, want)
    assert np.mean(np.abs(want - not_followed) > 1e-3) > 0.01


# technique_simple_lake_lib.glsl, screen_lookup_lib.glsl, technique_pond_lib.glsl, technique_ripple_lib.glsl,
# wave_maps_lib.glsl

OWN_TIME = 5000.3
"""s: maps have moved over many tiles."""


def repeating(values):
    """The twin of a filtered lookup in a picture that repeats."""
    wrapped = linear_filter(np.pad(values, ((1, 1), (1, 1), (0, 0)), mode="wrap"))
    size = np.array(values.shape[1::-1])

    def lookup_in(uv):
        return wrapped((uv % 1.0 * size + 1.0) / (size + 2.0))

    return lookup_in


def own_maps():
    """Smooth pictures of the kinds that techniques take, by the name of their sampler: (texels, repeats)."""
    waves_of_map = wave_maps.Spectrum(1.0, 3.0)
    y, x = np.meshgrid(np.arange(64) / 64.0, np.arange(64) / 64.0, indexing="ij")
    cover = np.stack(
        [0.3 + 0.2 * np.sin(2 * np.pi * x), 0.4 + 0 * x, 0.1 + 0 * x, 0.5 + 0.5 * np.cos(2 * np.pi * y)]
    )
    grey = np.stack([0.5 * x + 0.4 * y, x, y, np.ones_like(x)])
    kinds = {
        "normal_map_0": ("NORMAL", 1, 0.4),
        "normal_map_1": ("NORMAL", 2, 0.6),
        "dudv_map": ("DUDV", 3, 0.25),
    }
    maps = {
        name: (
            np.dstack([wave_maps.make_map(kind, seed, 64, strength, waves_of_map), np.ones((64, 64))]),
            True,
        )
        for name, (kind, seed, strength) in kinds.items()
    }
    maps |= {"impurity_map": (np.moveaxis(cover, 0, 2), True), "bias_map": (np.moveaxis(grey, 0, 2), False)}
    return {name: (single(texels), repeats) for name, (texels, repeats) in maps.items()}


def own_case(
    settings, file, *, camera=None, time=OWN_TIME, sun=True, extent=(30, 20, 1, -2), **water_settings
):
    """`lake_case` for a technique with settings of its own, over a turned body, seen by the main camera.

    Returns the body, textures, lookups of the maps, GPU arguments, surface points, normals, directions to the
    eye, and the snapshot.
    """
    plan, textures, arguments, surface, normal, to_eye = lake_case(camera, **water_settings)
    c, s = np.cos(0.7), np.sin(0.7)
    matrix = plan.bodies[0].body.matrix.copy()
    matrix[:2, :2] = [[c, -s], [s, c]]
    planned_body = replace(
        plan.bodies[0],
        body=replace(plan.bodies[0].body, matrix=matrix),
        refraction=replace(plan.bodies[0].refraction, view=plan.camera.view),
        extent=extent,
    )
    snapshot = plan.snapshot if sun else replace(plan.snapshot, sun=None)
    plan = replace(plan, bodies=(planned_body,), snapshot=snapshot)
    values = np.zeros((technique_settings.MAX_VALUES, 4))
    packed = technique_settings.pack(settings, time)
    values[: len(packed)] = packed
    lookups, samplers = {}, {}
    for name, (texels, repeats) in own_maps().items():
        if name in settings.maps:
            lookups[name] = repeating(texels) if repeats else linear_filter(texels)
            samplers[name] = ("FLOAT_2D", data_texture(texels, smooth=True))
            if repeats:
                samplers[name][1].extend_mode("REPEAT")
    assert set(samplers) == set(settings.maps)
    arguments = {
        "sources": (*WATER_SOURCES[:-1], file),
        "uniform_buffers": {
            "lights": ("Lights", block_of(uniforms_of("lights", plan))),
            "water": ("Water", block_of(uniforms_of("water", plan, planned_body))),
            "technique": ("Technique", block_of([values])),
        },
        "samplers": {**arguments["samplers"], **samplers},
    }
    return planned_body, textures, lookups, arguments, surface, normal, to_eye, snapshot


def uniforms_of(name, *arguments):
    from lake_water_addon.render import uniforms

    return getattr(uniforms, name)(*arguments)


SIMPLE_LAKE = technique_simple_lake.SimpleLakeSettings()
# Numbers that are all different, so that none can stand in another's place.
POND = technique_pond.PondSettings(
    tile_size_0=3.1,
    velocity_0=(0.21, -0.13),
    tile_size_1=1.9,
    velocity_1=(-0.07, 0.33),
    ripple_scale=(0.11, 0.07),
    bias=0.04,
    bias_map_strength=0.13,
    bias_depth_strength=0.22,
    bias_depth_range=(0.5, 6.0),
    bias_distance_strength=-0.17,
    bias_distance_range=(9.0, 13.0),
    power=1.7,
    ambient=(0.45, 0.5, 0.55),
    diffuse=(0.6, 0.65, 0.7),
    specular=(0.9, 0.8, 0.75),
    shininess=23.0,
    impurity=0.3,
    impurity_map_strength=0.8,
    impurity_tile_size=5.3,
    geometric_waves=True,
)
RIPPLE = technique_ripple.RippleSettings(
    tile_size=3.3,
    flow_direction=0.9,
    flow_speed=0.41,
    reflection_distortion=0.08,
    refraction_distortion=0.05,
    normal_strength=0.6,
    distance_strength=0.31,
    distance_range=(7.0, 15.0),
    angle_strength=0.43,
    angle_range=(0.5, 1.4),
    depth_strength=0.27,
    depth_range=(0.3, 5.0),
    depth_darkening=0.37,
    depth_darkening_range=(0.2, 4.4),
    path_darkening=0.29,
    path_darkening_range=(1.0, 9.0),
)


def pond_case(settings=POND, **case):
    return own_case(settings, "technique_pond_lib.glsl", **case)


def ripple_case(settings=RIPPLE, **case):
    return own_case(settings, "technique_ripple_lib.glsl", **case)


def evaluate_own(case, expression, **inputs):
    return evaluate(results={"x": expression}, **case[3], **inputs)["x"]


def test_twin_decode_normal():
    """Grey and black texels, too, whose directions are short or point inwards."""
    texels = single(RNG(50).random((2000, 4)))
    texels[:3] = (0, 0, 0, 0), (0.5, 0.5, 0.5, 1), (1, 1, 1, 1)
    got = evaluate(["wave_maps_lib.glsl"], {"n": ("vec3", "decode_normal(t)")}, t=texels)["n"]
    compare(got, wave_maps.decode_normal(texels), 8 * EPS)


def test_twin_decode_dudv():
    texels = single(RNG(51).random((500, 4)))
    got = evaluate(["wave_maps_lib.glsl"], {"d": ("vec2", "decode_dudv(t)")}, t=texels)["d"]
    compare(got, wave_maps.decode_dudv(texels), 2 * EPS)


def test_twin_ramp():
    """Rising, falling, and of no width at all."""
    x, begin, end = (
        a.ravel()
        for a in np.meshgrid(single(np.linspace(-3, 9, 61)), single([-2, 0, 0.3, 5]), single([-1, 0, 0.3, 7]))
    )
    case = ripple_case()
    got = evaluate_own(case, ("float", "ramp(x, vec2(a, b))"), x=x, a=begin, b=end)
    want = [float(screen_lookup.ramp(*values)) for values in zip(x, begin, end, strict=True)]
    compare(got, np.array(want), 8 * EPS)


def test_twin_in_water_frame():
    case = ripple_case()
    got = evaluate_own(case, ("vec2", "in_water_frame(u)"), u=case[4])
    compare(got, surface.in_water_frame(case[4], case[0]), 32 * EPS)


def test_twin_from_water_frame():
    case = ripple_case()
    vectors = single(RNG(52).normal(size=(500, 2)))
    got = evaluate_own(case, ("vec2", "from_water_frame(v)"), v=vectors)
    compare(got, screen_lookup.from_water_frame(vectors, case[0]), 16 * EPS)


@every_lake
def test_twin_screen_coordinate(case):
    own = ripple_case(**case)
    got = evaluate_own(own, ("vec2", "screen_coordinate(u)"), u=own[4])
    compare(got, screen_lookup.screen_coordinate(own[4], own[0]), 64 * EPS)


@every_lake
def test_twin_under_horizon(case):
    """All over the picture; of level cameras, too, whose horizon is in the picture."""
    level = scenes.look_at((6, -9, 2), (0, 0, 2))
    for camera in (case.get("camera"), replace(level, projection=PROJECTIONS["shifted"]), level):
        own = ripple_case(**{**case, "camera": camera})
        at = single(RNG(66).uniform(-0.2, 1.2, (2000, 2)))
        got = evaluate_own(own, ("vec2", "under_horizon(uv)"), uv=at)
        want = screen_lookup.under_horizon(at, own[0])
        compare(got, want, 64 * EPS)
    assert np.any(want != at) and np.any(want == at)


@every_lake
def test_twin_viewing_distance(case):
    own = ripple_case(**case)
    got = evaluate_own(own, ("float", "viewing_distance(u)"), u=own[4])
    compare(got, screen_lookup.viewing_distance(own[4], own[0]), 1e-5)


@every_lake
def test_twin_water_below(case):
    """1e-4 m in 99 of 100 cases; the others take the neighbouring texel. Some things are nearer than U."""
    own = ripple_case(**case)
    got = evaluate_own(own, ("vec2", "water_below(u)"), u=own[4])
    want = np.stack(screen_lookup.water_below(own[4], own[0], own[1].bottom_depth), axis=1)
    assert np.mean(np.abs(got - want).max(axis=1) > 1e-4) < 0.01
    assert 0.02 < np.mean(want[:, 1] == 0.0) < 0.98


def test_twin_radiance_near():
    """Known at the place, only at the fragment's own, at neither."""
    case = ripple_case()
    at, own = (single(RNG(seed).uniform(-0.1, 1.1, (4000, 2))) for seed in (53, 54))
    substitute = np.array([0.1, 0.2, 0.3])
    got = evaluate_own(
        case, ("vec3", "radiance_near(refraction_color, a, b, vec3(0.1, 0.2, 0.3))"), a=at, b=own
    )
    compare_radiance(got, screen_lookup.radiance_near(case[1].refraction_color, at, own, substitute))
    assert np.any(np.all(np.abs(got - substitute) < 1e-6, axis=1)), "no case is unknown at both"


@every_lake
def test_twin_simple_lake_refracted_radiance(case):
    own = own_case(SIMPLE_LAKE, "technique_simple_lake_lib.glsl", **case)
    body, textures, _, _, surface, normal, to_eye, _ = own
    direction = single(optics.refract_direction(-to_eye, normal, N12)[0])
    got = evaluate_own(own, ("vec3", "refracted_radiance(u, r)"), u=surface, r=direction)
    want = technique_simple_lake.refracted_radiance(surface, direction, body, SIMPLE_LAKE, textures)
    compare_radiance(got, want)


@every_lake
def test_twin_simple_lake_water_radiance(case):
    own = own_case(SIMPLE_LAKE, "technique_simple_lake_lib.glsl", **case)
    body, textures, _, _, surface, normal, to_eye, _ = own
    got = evaluate_own(own, ("vec3", "water_radiance(u, n, e)"), u=surface, n=normal, e=to_eye)
    want = technique_simple_lake.water_radiance(surface, normal, to_eye, body, SIMPLE_LAKE, textures)
    compare_radiance(got, want)


def test_twin_ripple_displacement():
    """2e-3: the filter's weights have 8 bits."""
    case = ripple_case()
    got = evaluate_own(case, ("vec2", "ripple_displacement(u)"), u=case[4])
    want = technique_ripple.displacement(case[4], case[0], RIPPLE, OWN_TIME, case[2]["dudv_map"])
    assert np.abs(want).max() > 0.5
    compare(got, want, 5e-3)


def test_twin_ripple_opacity():
    """1e-4: what acos of llvmpipe loses."""
    rng = RNG(55)
    distance, depth = single(rng.uniform(0, 20, 3000)), single(rng.uniform(0, 7, 3000))
    cosine = single(rng.uniform(-0.1, 1.0, 3000))
    cosine[:3] = 0.0, 1.0, 1.0 + EPS
    got = evaluate_own(
        ripple_case(),
        ("float", "ripple_opacity(far, cosine, depth)"),
        far=distance,
        cosine=cosine,
        depth=depth,
    )
    want = technique_ripple.opacity(distance, cosine, depth, RIPPLE)
    compare(got, want, 1e-4)
    assert np.any(want == 1.0), "no case tried the clamp"


def test_twin_ripple_brightness():
    depth, path = (single(RNG(seed).uniform(0, 12, 2000)) for seed in (56, 57))
    for settings in (RIPPLE, replace(RIPPLE, path_darkening=0.9)):
        got = evaluate_own(ripple_case(settings), ("float", "ripple_brightness(d, p)"), d=depth, p=path)
        compare(got, technique_ripple.brightness(depth, path, settings), 8 * EPS)
    assert np.any(got == 0.0), "no case tried the clamp"


OWN_CASES = LAKE_CASES | {
    "towards the sun": {"camera": scenes.look_at((-7, 5, 6), (0, 0, 0))},
    "to the horizon": {"camera": scenes.look_at((6, -9, 0.05), (0, 0, 0.05)), "waves": ()},
}
every_own = pytest.mark.parametrize("case", OWN_CASES.values(), ids=OWN_CASES)


@every_own
def test_twin_ripple_water_radiance(case):
    own = ripple_case(**case)
    body, textures, maps, _, surface, normal, to_eye, _ = own
    got = evaluate_own(own, ("vec3", "water_radiance(u, n, e)"), u=surface, n=normal, e=to_eye)
    want = technique_ripple.water_radiance(
        surface, to_eye, body, RIPPLE, OWN_TIME, textures, maps["dudv_map"]
    )
    compare_radiance(got, want)


def pond_maps(case):
    return technique_pond.PondMaps(**case[2])


def test_twin_pond_ripple_normal():
    """5e-3: the filter's weights have 8 bits."""
    case = pond_case()
    p = single(RNG(58).uniform(-60, 60, (3000, 2)))
    got = evaluate_own(case, ("vec3", "pond_ripple_normal(p)"), p=p)
    want = technique_pond.ripple_normal(p, POND, OWN_TIME, pond_maps(case))
    assert np.abs(want[:, :2]).max() > 0.4
    compare(got, want, 5e-3)


def test_twin_pond_on_waves():
    case = pond_case()
    normal, ripple = unit_vectors(3000, 59), unit_vectors(3000, 60)
    normal[:, 2], ripple[:, 2] = np.abs(normal[:, 2]), np.maximum(np.abs(ripple[:, 2]), 1e-3)
    normal[:100] = 0.0, 0.0, 1.0
    normal, ripple = single(normal), single(ripple)
    want = technique_pond.on_waves(normal, ripple, case[0])
    got = evaluate_own(case, ("vec3", "pond_on_waves(n, r)"), n=normal, r=ripple)
    turned = screen_lookup.from_water_frame(ripple[:, :2], case[0])
    level = normal[:, :2] * ripple[:, 2:] + turned * normal[:, 2:]
    length = np.linalg.norm(np.column_stack([level, normal[:, 2] * ripple[:, 2]]), axis=1)
    compare(got, want, 16 * EPS / length[:, None])


def test_twin_pond_lookup_shift():
    """All over the picture and beyond its edges."""
    case = pond_case()
    ripple, own = unit_vectors(2000, 61), single(RNG(62).uniform(-0.3, 1.3, (2000, 2)))
    got = evaluate_own(case, ("vec2", "pond_lookup_shift(r, uv)"), r=ripple, uv=own)
    compare(got, technique_pond.lookup_shift(ripple, own, POND), 16 * EPS * 0.11)


@pytest.mark.parametrize("extent", [(30, 20, 1, -2), (0, 5, 0, 0)])
def test_twin_pond_over_the_water(extent):
    """A surface of no width, too."""
    case = pond_case(extent=extent)
    p = single(RNG(63).uniform(-40, 40, (500, 2)))
    got = evaluate_own(case, ("vec2", "pond_over_the_water(p)"), p=p)
    compare(got, technique_pond.over_the_water(p, case[0]), 8 * EPS, 8 * EPS)


def test_twin_pond_refraction_bias():
    rng = RNG(64)
    depth, distance, grey = (single(rng.uniform(0, top, 2000)) for top in (8, 20, 1))
    got = evaluate_own(
        pond_case(), ("float", "pond_refraction_bias(depth, far, grey)"), depth=depth, far=distance, grey=grey
    )
    compare(got, technique_pond.refraction_bias(depth, distance, grey, POND), 16 * EPS)


@pytest.mark.parametrize("power", [0.0, 1.0, 1.7, 40.0])
def test_twin_pond_refraction_weight(power):
    settings = replace(POND, power=power)
    cosine, bias = (
        a.ravel() for a in np.meshgrid(single([-1, 0, 1e-4, 0.1, 0.5, 0.9, 1]), single([-2, -0.3, 0, 0.2, 2]))
    )
    got = evaluate_own(pond_case(settings), ("float", "pond_refraction_weight(c, b)"), c=cosine, b=bias)
    compare(got, technique_pond.refraction_weight(cosine, bias, power), 2e-6)


@pytest.mark.parametrize("sun", [True, False])
def test_twin_pond_light_on_material(sun):
    case = pond_case(sun=sun)
    normal = unit_vectors(1000, 65)
    got = evaluate_own(case, ("vec3", "pond_light_on_material(n)"), n=normal)
    compare(got, technique_pond.light_on_material(normal, POND, case[7].sun), 8 * EPS)


@pytest.mark.parametrize("sun", [True, False])
def test_twin_pond_highlight(sun):
    """4 EPS, what the cosine loses, times the exponent; half of the cases look along the mirrored ray."""
    case = pond_case(sun=sun)
    normal, to_eye = normals_and_eyes()
    if sun:
        mirrored = optics.reflect_direction(np.broadcast_to(-case[7].sun.direction, normal.shape), normal)
        to_eye[::2] = mirrored[::2] + 0.2 * to_eye[::2]
        to_eye = single(to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True))
    want = technique_pond.highlight(normal, to_eye, POND, case[7].sun)
    got = evaluate_own(case, ("vec3", "pond_highlight(n, e)"), n=normal, e=to_eye)
    facing = np.ones(len(normal), bool) if not sun else np.abs(normal @ case[7].sun.direction) > 4 * EPS
    compare(got[facing], want[facing], 4 * EPS * POND.shininess)
    assert np.any(want > 0.5) == sun


POND_CASES = OWN_CASES | {"no sun": {"sun": False}}


@pytest.mark.parametrize("case", POND_CASES.values(), ids=POND_CASES)
def test_twin_pond_water_radiance(case):
    own = pond_case(**case)
    body, textures, _, _, surface, normal, to_eye, snapshot = own
    got = evaluate_own(own, ("vec3", "water_radiance(u, n, e)"), u=surface, n=normal, e=to_eye)
    want = technique_pond.water_radiance(
        surface,
        normal,
        to_eye,
        body,
        POND,
        OWN_TIME,
        textures,
        pond_maps(own),
        snapshot.sun,
        snapshot.sky,
    )
    compare_radiance(got, want)


# technique_lake_under_lib.glsl


STEPS_FROM_BELOW = 20


def under_case(exact=False, camera=None, follows=False, **settings):
    """Made-up textures as in `lake_case`, and the surface of the pond seen from below."""
    camera = camera or scenes.look_at((2, -3, -2), (0, 1, 0.5))
    frame = {"reflection_steps": STEPS_FROM_BELOW} if follows else {}
    plan = planned(scenes.pond(**settings), camera, texture_size=128, **frame)
    _, from_air, arguments, surface, *_ = lake_case(camera, **settings)
    (body,) = plan.bodies
    level = float(body.origin[2])
    wide = cameras.widen(plan.camera.projection, plan.settings.fov_ext)
    mirrored = cameras.mirrored_view(plan.camera.view, level)
    refraction = replace(body.refraction, view=plan.camera.view, projection=wide)
    reflection = replace(body.reflection, view=mirrored, projection=wide)
    land, bottom = made_up_land(), made_up_bottom()
    textures = technique_lake_under.UnderTextures(
        from_air.refraction_color,
        from_air.reflection_color,
        from_air.sky_radiance,
        refraction,
        reflection,
        from_air.fade,
        land,
        bottom,
    )
    search = depth_trace.FollowedRays(STEPS_FROM_BELOW)
    follow = technique_lake_under.Follow(search, body.lowest, body.highest)
    from_below = replace(plan, bodies=(replace(body, refraction=refraction, reflection=reflection),))
    arguments = dict(arguments)
    arguments["sources"] = (*WATER_SOURCES[:-1], "technique_lake_under_lib.glsl")
    arguments["uniform_buffers"] = {
        **arguments["uniform_buffers"],
        "water": ("Water", water_block(from_below)),
    }
    samplers = {k: v for k, v in arguments["samplers"].items() if k != "refraction_depth"}
    if follows:
        samplers["refraction_depth"] = ("FLOAT_2D", data_texture(land))
        samplers["reflection_depth"] = ("FLOAT_2D", data_texture(bottom))
    arguments["samplers"] = samplers
    arguments["defines"] = dict.fromkeys([*["EXACT"] * exact, *["FOLLOW"] * follows], "")
    eye = cameras.eye_position(plan.camera.view)
    path = single(np.linalg.norm(eye - surface, axis=1))
    to_eye = single((eye - surface) / path[:, None])
    normal = -single(optics.face_viewer(-waves.normal(body.packed_waves, surface[:, :2]), to_eye))
    return body.body.settings, textures, arguments, surface, normal, to_eye, path, follow if follows else None


UNDER_CASES = {
    "lake": {},
    "flat and clear": {"waves": (), "k": 0.0},
    "steep": {"waves": scenes.STEEP_WAVES},
    "another liquid": {"ior": 2.4, "q": 0.0},
    "no refraction": {"ior": 1.0},
    "orthographic": {"camera": scenes.look_at((2, -3, -2), (0, 1, 0.5), ortho=9.0)},
}
every_under = pytest.mark.parametrize("case", UNDER_CASES.values(), ids=UNDER_CASES)


@every_under
def test_twin_refraction_without_hole(case):
    settings, _, arguments, _, normal, to_eye, *_ = under_case(**case)
    got = evaluate(results={"r": ("vec3", "refraction_without_hole(n, e)")}, n=normal, e=to_eye, **arguments)[
        "r"
    ]
    want = technique_lake_under.refraction_without_hole(normal, to_eye, 1.0 / settings.ior)
    compare(got, want, 8 * EPS * settings.ior)


every_way = pytest.mark.parametrize("follows", [False, True], ids=["looked up", "followed"])


@every_way
@every_under
def test_twin_radiance_from_above(case, follows):
    settings, textures, arguments, surface, normal, to_eye, _, follow = under_case(**case, follows=follows)
    direction = single(technique_lake_under.refraction_without_hole(normal, to_eye, 1.0 / settings.ior))
    got = evaluate(results={"c": ("vec3", "radiance_from_above(u, r)")}, u=surface, r=direction, **arguments)[
        "c"
    ]
    compare_radiance(got, technique_lake_under.radiance_from_above(surface, direction, textures, follow))


@every_way
@every_under
def test_twin_radiance_from_below(case, follows):
    settings, textures, arguments, surface, normal, to_eye, path, follow = under_case(**case, follows=follows)
    direction = single(optics.reflect_direction(-to_eye, normal))
    results = {"c": ("vec3", "radiance_from_below(u, r, p)")}
    got = evaluate(results=results, u=surface, r=direction, p=path, **arguments)["c"]
    if follows:
        want = technique_lake_under.followed_from_below(surface, direction, path, settings, textures, follow)
    else:
        want = technique_lake_under.radiance_from_below(surface, direction, settings, textures)
    compare_radiance(got, want)


@every_way
@pytest.mark.parametrize("exact", [False, True], ids=["thesis", "exact"])
@every_under
def test_twin_water_radiance_from_below(case, exact, follows):
    settings, textures, arguments, surface, normal, to_eye, path, follow = under_case(
        exact, **case, follows=follows
    )
    got = evaluate(
        results={"c": ("vec3", "water_radiance_from_below(u, n, e, path)")},
        u=surface,
        n=normal,
        e=to_eye,
        path=path,
        **arguments,
    )["c"]
    want = technique_lake_under.water_radiance_from_below(
        surface, normal, to_eye, path, settings, textures, exact=exact, follow=follow
    )
    compare_radiance(got, want)
    if exact and settings.ior > 1.2:
        cosine = -np.sum(normal * to_eye, axis=1)
        assert np.any(optics.fresnel_dielectric(cosine, settings.ior) == 1.0), "no case of total reflection"


# fog_lib.glsl, near_side_lib.glsl

MIRROR = cameras.mirrored_view(scenes.look_at((1, -2, -1.5), (0, 3, 0)).view, 0.25)


def near_plane_cases():
    """Perspective, shifted, cropped, of a long clip range; orthographic, also from behind; mirrored."""
    view = scenes.look_at((1, -2, -1.5), (0, 3, 0)).view
    behind = scenes.look_at((0, 0, 1), (0, 1, 0), near=-50.0, far=80.0, ortho=12.0).projection
    for projection in (
        *PROJECTIONS.values(),
        cameras.crop(PROJECTIONS["shifted"], 0.1, 0.2, 0.4, 0.9),
        behind,
    ):
        for matrix in (view, MIRROR):
            yield under_water.near_plane(matrix, projection)


def near_plane_arguments(plane, heights=None, texels=None):
    """Every member is used, or the driver drops the block."""
    from lake_water_addon.render import uniforms
    from lake_water_addon.render.resources import Resources

    block = uniforms.UniformBlock(Resources()).update(*uniforms.near_plane(plane, heights))
    arguments = {
        "sources": ["optics_lib.glsl", "fog_lib.glsl"],
        "uniform_buffers": {"near_plane": ("NearPlane", block)},
    }
    if heights is not None:
        arguments["sources"].append("near_side_lib.glsl")
        arguments["samplers"] = {"surface_heights": ("FLOAT_2D", data_texture(texels))}
    return arguments


def device_coordinates(count=2000):
    ndc = RNG(24).uniform(-1, 1, (count, 2))
    ndc[:5] = (0, 0), (-1, -1), (1, -1), (1, 1), (-1, 1)
    return single(ndc)


def test_twin_near_offset():
    """8 EPS of the terms' size: also where a lens shift makes the parts cancel."""
    ndc = device_coordinates()
    for plane in near_plane_cases():
        got = evaluate(results={"o": ("vec3", "near_offset(p)")}, p=ndc, **near_plane_arguments(plane))["o"]
        size = sum(np.linalg.norm(part) for part in (plane.center, plane.right, plane.up))
        compare(got, plane.offset(ndc), 8 * EPS * size)


def depths(count):
    """Window depths as a depth texture holds them, towards both ends, which are in it."""
    depth = RNG(25).uniform(0, 1, count)
    third = count // 3
    depth[:third] = 1.0 - np.geomspace(1e-7, 1, third)
    depth[third : 2 * third] = np.geomspace(1e-7, 1, third)
    depth[:3] = 0.0, 1.0, 0.5
    return single(depth)


def test_twin_sight_distance():
    """Relative 16 EPS at any clip range: the inverted projection does not cancel."""
    ndc = device_coordinates()
    depth = depths(len(ndc))
    for plane in near_plane_cases():
        got = evaluate(
            results={"d": ("float", "sight_distance(p, z)")}, p=ndc, z=depth, **near_plane_arguments(plane)
        )["d"]
        compare(got, plane.distance(ndc, depth), 8 * EPS * max(-plane.near, 1e-6), 16 * EPS)


def test_twin_fog_transmittance():
    ndc = device_coordinates()
    depth = depths(len(ndc))
    for plane in near_plane_cases():
        for k in single([0.0, 0.5, 1000.0]):
            got = evaluate(
                results={"a": ("float", "fog_transmittance(k, p, z)")},
                p=ndc,
                z=depth,
                k=np.full(len(ndc), k),
                **near_plane_arguments(plane),
            )["a"]
            path = k * plane.distance(ndc, depth)
            compare(
                got,
                under_water.fog_transmittance(plane, k, ndc, depth),
                1e-37 + 8 * EPS * k * max(-plane.near, 1e-6),
                32 * EPS * (1.0 + np.minimum(path, 100.0)),
            )
            assert np.all(got[depth == 1.0] == 0.0)


def test_twin_meniscus_weight():
    height = single(np.concatenate([RNG(26).normal(size=2000) * 1e-3, [0.0, 1e5, -1e5]]))
    per_pixel = single(np.concatenate([RNG(27).uniform(0, 1e-3, 2000), [0.0, 1e5, 1e-4]]))
    got = evaluate(
        ["optics_lib.glsl", "fog_lib.glsl"],
        # The library's block must be used, or the driver drops it.
        {"w": ("float", "meniscus_weight(h, d, 3.0)"), "also": ("vec3", "near_offset(vec2(h, d))")},
        uniform_buffers=near_plane_arguments(next(iter(near_plane_cases())))["uniform_buffers"],
        h=height,
        d=per_pixel,
    )["w"]
    compare(got, under_water.meniscus_weight(height, per_pixel, 3.0), 32 * EPS)


def height_cases():
    """Near planes at the pond's surface, and maps of it with an edge of the water in them."""
    for camera in (
        scenes.look_at((1, -2, 0.05), (0, 3, 0)),
        scenes.look_at((1, -2, 0.05), (0, 3, 0), near=1e-4),
        scenes.look_at((1, -2, 0.05), (1, -2, -1)),
        scenes.look_at((1, -2, 0.05), (0, 3, 0), ortho=30.0),
    ):
        plane = under_water.near_plane(camera.view, camera.projection)
        heights = under_water.height_map(plane, -0.3, 0.3)
        n = under_water.HEIGHT_TEXELS
        at = heights.corner + (np.stack(np.meshgrid(*2 * [np.arange(n) + 0.5]), -1)) / n * heights.size
        texels = waves.height(planned().bodies[0].packed_waves, at)
        yield plane, heights, single(texels)
        texels = np.where(np.arange(n) < n // 3, under_water.NO_WATER, texels)
        yield plane, heights, single(texels)


def test_twin_surface_height():
    """Rounding of x and y, in texels, times what a texel may differ from the next; beyond the map, too."""
    for plane, heights, texels in height_cases():
        xy = heights.corner + RNG(28).uniform(-0.1, 1.1, (2000, 2)) * heights.size
        xy = single(xy)
        got = evaluate(
            results={"h": ("float", "surface_height(p)"), "also": ("vec3", "near_offset(p)")},
            p=xy,
            **near_plane_arguments(plane, heights, texels),
        )["h"]
        step = max(np.abs(np.diff(texels, axis=i)).max() for i in (0, 1))
        in_texels = EPS * (4.0 * np.abs(xy).max() / heights.size.min() * len(texels) + 4.0 * len(texels))
        compare(got, heights.height(texels, xy), 2.0 * step * in_texels + 4 * EPS * np.abs(texels).max())


def test_twin_height_over_surface():
    ndc = device_coordinates()
    for plane, heights, texels in height_cases():
        got = evaluate(
            results={"h": ("float", "height_over_surface(p)")},
            p=ndc,
            **near_plane_arguments(plane, heights, texels),
        )["h"]
        begin = plane.point(ndc)
        want = begin[:, 2] - heights.height(texels, begin[:, :2])
        step = max(np.abs(np.diff(texels, axis=i)).max() for i in (0, 1))
        size = np.abs(begin).max() + sum(np.linalg.norm(p) for p in (plane.center, plane.right, plane.up))
        in_texels = EPS * (8.0 * size / heights.size.min() * len(texels) + 4.0 * len(texels))
        compare(got, want, 2.0 * step * in_texels + 8 * EPS * (size + np.abs(texels).max()))


# view_transform_lib.glsl


def view_transform_arguments(lattice, table):
    from gpu.types import Buffer, GPUTexture

    flat = np.ascontiguousarray(table, dtype=np.float32).ravel()
    texture = GPUTexture(table.shape[2::-1], format="RGBA32F", data=Buffer("FLOAT", flat.size, flat))
    texture.filter_mode(True)
    texture.extend_mode("EXTEND")
    return {
        "sources": ("view_transform_lib.glsl",),
        "samplers": {"view_transform_table": ("FLOAT_3D", texture)},
        "constants": {"view_transform_range": ("VEC2", lattice)},
    }


def linear_colors():
    """Scene-linear colours from black to far beyond the table, and negative ones (out of gamut)."""
    colors = RNG(21).uniform(0, 1, (2000, 3)) ** 3 * np.geomspace(1e-4, 500, 2000)[:, None]
    colors[:3] = (0, 0, 0), (-0.1, 0.5, 1.0), (1e6, 1e4, 0.0)
    return single(colors)


@pytest.mark.parametrize("exposure", [0.0, 2.5, -4.0])
def test_twin_to_lattice(exposure):
    lattice = tuple(single(view_transform.lattice_range(exposure)))
    size = view_transform.SIZE
    arguments = view_transform_arguments(lattice, np.zeros((size, size, size, 4)))
    colors = linear_colors()
    got = evaluate(results={"at": ("vec3", "to_lattice(c)")}, c=colors, **arguments)["at"]
    compare(got, view_transform.to_lattice(colors, lattice), 4e-6)


def test_twin_overlay_decoded():
    """Relative 4e-6, as that of pow; values outside of 0..1 included."""
    display = single(np.concatenate([RNG(22).uniform(-0.2, 2.0, (1000, 3)), [[0.0, 1e-3, 1.0]]]))
    size = view_transform.SIZE
    arguments = view_transform_arguments(view_transform.lattice_range(), np.zeros((size, size, size, 4)))
    # The driver drops a constant that nothing uses, and setting it is then an error: use it, too.
    both = {"c": ("vec3", "overlay_decoded(c)"), "also": ("vec3", "to_lattice(c)")}
    got = evaluate(results=both, c=display, **arguments)["c"]
    compare(got, view_transform.overlay_decoded(display), 1e-7, 4e-6)


def test_twin_view_transform():
    """Trilinear between the entries, the border beyond them: 1e-3 of the display's range (filter weights)."""
    lattice = tuple(single(view_transform.lattice_range()))
    size = view_transform.SIZE
    z, y, x = np.meshgrid(*3 * [np.linspace(0, 1, size)], indexing="ij")
    table = np.ones((size, size, size, 4))
    table[..., :3] = np.stack([x + 0.1 * y, y * y, 0.5 * z + 0.5 * x * y], -1) / 1.1
    colors = linear_colors()
    got = evaluate(
        results={"d": ("vec3", "view_transform(c)")}, c=colors, **view_transform_arguments(lattice, table)
    )["d"]
    at = np.clip(view_transform.to_lattice(colors, lattice), 0.0, 1.0) * (size - 1)
    low = np.minimum(np.floor(at).astype(int), size - 2)
    part = at - low
    want = np.zeros_like(colors)
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, part, 1.0 - part), axis=1)
        ix, iy, iz = (low + corner).T
        want += weight[:, None] * table[iz, iy, ix, :3]
    compare(got, view_transform.overlay_decoded(want), 1e-3)


# glow_lib.glsl, glow_star_lib.glsl


def test_twin_highlight():
    """R.s is off by EPS and its power by `exponent` times as much, relatively. On both sides of the cut."""
    sun = unit_vectors(4000, 30)
    # As many as possible in the lobe: moved from s by up to all angles.
    moved = sun + RNG(31).normal(size=sun.shape) * np.geomspace(1e-4, 3.0, len(sun))[:, None]
    reflected = single(moved / np.linalg.norm(moved, axis=1, keepdims=True))
    reflected[:3], reflected[3:6] = sun[:3], -sun[3:6]
    for exponent, cut in ((1.0, 3e-4), (200.0, 3e-4), (200.0, 0.95), (5000.0, 0.1), (1e5, 3e-7)):
        exponent, cut = single([exponent, cut])  # noqa: PLW2901
        got = evaluate(
            ["glow_lib.glsl"],
            {"h": ("float", "highlight(r, s, exponent, cut)")},
            r=reflected,
            s=sun,
            exponent=np.full(len(sun), exponent),
            cut=np.full(len(sun), cut),
        )["h"].astype(np.float64)
        want = np.array([glow.highlight(r, s, exponent, cut) for r, s in zip(reflected, sun, strict=True)])
        lobe = np.array([glow.highlight(r, s, exponent, 0.0) for r, s in zip(reflected, sun, strict=True)])
        base = np.maximum(np.sum(reflected * sun, axis=1), EPS)
        bound = (4e-6 + 6 * EPS * exponent / base) * lobe
        decided = np.abs(lobe - cut) > bound
        assert decided.mean() > 0.95 and np.any(want > 0.0) and np.any(want == 0.0)
        compare(got[decided], want[decided], 1e-30 + bound[decided])
        assert np.all((got == 0.0) | (got >= cut))


def bright_texels():
    """Random highlights, a few of them bright, and the texels to look at: inside, at the border, beyond."""
    values = single(RNG(32).uniform(0, 1, (23, 31)) ** 8)
    y, x = (a.ravel() for a in np.mgrid[-5:28, -5:36])
    return values, x, y


def test_twin_highlight_at():
    """Dark beyond the border, on all sides."""
    values, x, y = bright_texels()
    got = evaluate(
        ["glow_star_lib.glsl"],
        {"h": ("float", "highlight_at(ivec2(at))")},
        samplers={"highlights": ("FLOAT_2D", data_texture(values))},
        at=np.stack([x, y], 1),
    )["h"]
    padded = np.pad(values, 5)
    np.testing.assert_array_equal(got, padded[y + 5, x + 5])


def test_twin_star_filter():
    values, x, y = bright_texels()
    got = evaluate(
        ["glow_star_lib.glsl"],
        {"star": ("float", "star_filter(ivec2(at))")},
        samplers={"highlights": ("FLOAT_2D", data_texture(values))},
        at=np.stack([x, y], 1),
    )["star"]
    compare(got, glow.star_filter(np.pad(values, 5))[y + 5, x + 5], 4 * EPS)


# photon_lib.glsl

PHOTON_CASES = {
    "lake": {},
    "calm": {"waves": ()},
    "steep": {"waves": scenes.STEEP_WAVES},
    "high index, no refraction": {"ior": 1.0, "waves": scenes.LAKE_WAVES},
}
every_photon = pytest.mark.parametrize("case", PHOTON_CASES.values(), ids=PHOTON_CASES)


def photon_case(steps=2, **settings):
    """A scene for photons, the same for the GPU, and points of the surface with their waves."""
    from lake_water_addon.render import uniforms

    plan = planned(scenes.pond(**settings), photon_size=128, caustics_steps=steps, light_depth_size=64)
    body = plan.bodies[0]
    camera = body.light.camera
    water, light = uniforms.water(plan, body), uniforms.water_light(plan, body)
    size = 64
    y, x = np.meshgrid(np.linspace(-1, 1, size), np.linspace(-1, 1, size), indexing="ij")
    level = -camera.view[2, :3] @ body.origin
    depth = level + 3.0 + 0.6 * np.sin(4 * x) * np.cos(3 * y) + np.where(x > 0.6, -5.0, 0.0)
    depth[10:20, 10:20] = 1e5
    exact = single(light[0].T), single(light[1].T)
    scene = caustics.PhotonScene(
        single(plan.snapshot.sun.direction),
        replace(camera, view=exact[0], projection=exact[1], direction=single(camera.direction)),
        single(depth),
        single(body.origin),
        single(body.packed_waves),
        *single([body.body.settings.k, body.body.settings.q, 1.0 / body.body.settings.ior]).tolist(),
        128,
        steps,
    )
    rng = RNG(40)
    launch = single((rng.integers(0, 128, (3000, 2)) + 0.5) / 128)
    # On the water plane below its place in the window, and as much displaced as the waves do it.
    device = np.concatenate([2 * launch - 1, np.zeros((3000, 1)), np.ones((3000, 1))], axis=1)
    start = (device @ np.linalg.inv(camera.projection @ camera.view).T)[:, :3]
    start += ((body.origin[2] - start[:, 2]) / camera.direction[2])[:, None] * camera.direction
    wave = waves.height(body.packed_waves, start[:, :2] - body.origin[:2]) + rng.normal(0, 0.02, 3000)
    point = single(start + wave[:, None] * caustics.sun_run(plan.snapshot.sun.direction))
    options = {
        "sources": ["photon_lib.glsl"],
        "uniform_buffers": {
            "lights": ("Lights", lights_block(plan.snapshot)),
            "water": ("Water", block_of(water)),
            "water_light": ("WaterLight", block_of(light)),
        },
        "samplers": {"light_depth": ("FLOAT_2D", data_texture(depth))},
    }
    return scene, point, single(wave), launch, options


def on_true_waves(scene, point, wave):
    """`on_waves` of the twin, in numbers that the GPU has, too."""
    found = caustics.on_waves(
        point,
        wave,
        np.zeros((len(point), 2)),
        scene.origin,
        scene.packed_waves,
        caustics.sun_run(scene.sun_direction),
    )
    return caustics.WaterPoint(*(single(part) for part in found))


@every_photon
def test_twin_waves_at(case):
    scene, point, _, _, options = photon_case(**case)
    xy = single(point[:, :2] - scene.origin[:2])
    results = {
        "height": ("float", "waves_at(p).height"),
        "slope": ("vec2", "waves_at(p).slope"),
        "curvature": ("vec3", "waves_at(p).curvature"),
    }
    got = evaluate(results=results, p=xy, **options)
    want = caustics.waves_at(scene.packed_waves, xy)
    k = np.linalg.norm(scene.packed_waves[:, :2], axis=1)
    for power, name in enumerate(results):
        bound = wave_bound(scene.packed_waves, xy, k**power)
        compare(got[name], getattr(want, name), bound if power == 0 else bound[:, None])


def test_twin_bend():
    curvature, step = single(RNG(42).normal(size=(500, 3))), single(RNG(43).normal(size=(500, 2)))
    *_, options = photon_case()
    got = evaluate(results={"b": ("vec2", "bend(c, s)")}, c=curvature, s=step, **options)["b"]
    compare(got, caustics.bend(curvature, step), 8 * EPS)


def test_twin_sun_run():
    scene, *_, options = photon_case()
    got = evaluate(results={"r": ("vec3", "sun_run()")}, i=np.zeros(1), **options)["r"]
    compare(got[0], caustics.sun_run(scene.sun_direction), 0.0, 2 * EPS)


@every_photon
def test_twin_on_waves(case):
    """Points at 30 m are known to 8e-6 m, and the waves and their derivatives as well as such a point is."""
    scene, point, wave, _, options = photon_case(**case)
    results = {
        "position": ("vec3", "on_waves(p, wave, mesh).position"),
        "slope": ("vec2", "on_waves(p, wave, mesh).slope"),
        "curvature": ("vec3", "on_waves(p, wave, mesh).curvature"),
    }
    mesh = single(RNG(44).normal(0, 0.05, (len(point), 2)))
    got = evaluate(results=results, p=point, wave=wave, mesh=mesh, **options)
    run = caustics.sun_run(scene.sun_direction)
    want = caustics.on_waves(point, wave, mesh, scene.origin, scene.packed_waves, run)
    if case == PHOTON_CASES["steep"]:
        # Slopes of 6: a rounding of the height decides where the ray meets the surface. Near it, it must be.
        apart = np.linalg.norm(got["position"] - want.position, axis=1)
        assert np.median(apart) < 1e-4 and np.quantile(apart, 0.95) < 5e-3
        return
    compare(got["position"], want.position, 4e-5)
    compare(got["slope"], want.slope, 2e-4)
    compare(got["curvature"], want.curvature, 2e-3)


def test_twin_bottom_depth_of_the_light():
    """Bilinear, nearest at edges and at holes, the border beyond; 1 mm of some 10 m."""
    uv = single(np.concatenate([RNG(45).uniform(-0.2, 1.2, (4000, 2)), [[0, 0], [1, 1], [1e12, -1e12]]]))
    scene, *_, options = photon_case()
    got = evaluate(results={"z": ("float", "bottom_depth(uv)")}, uv=uv, **options)["z"]
    want = caustics.bottom_depth(scene.depth, uv, float(scene.camera.texel.max()))
    assert np.mean(np.abs(got - want) > 1e-3) < 2e-3
    assert np.any(want > 1e4) and np.ptp(want[want < 1e4]) > 4.0


def test_twin_is_water():
    scene, point, _, _, options = photon_case()
    got = evaluate(results={"w": ("bool", "is_water(p)")}, p=point, **options)["w"].astype(bool)
    want = caustics.is_water(point, scene)
    assert 0.2 < want.mean() < 0.9 and np.mean(got != want) < 0.002


def test_twin_launch_step():
    scene, *_, options = photon_case()
    got = evaluate(
        results={"x": ("vec3", "launch_step(0)"), "y": ("vec3", "launch_step(1)")}, i=np.zeros(1), **options
    )
    for axis, name in enumerate("xy"):
        compare(got[name][0], caustics.launch_step(scene.camera, axis, 128), 8 * EPS)


@every_photon
def test_twin_ray_spread(case):
    """1e-5 of the step and of what the waves' curvature makes of it on the way."""
    scene, point, wave, _, options = photon_case(**case)
    at = on_true_waves(scene, point, wave)
    count = len(point)
    step, mesh = single(RNG(46).normal(0, 0.2, (count, 3))), single(RNG(47).normal(0, 0.05, (count, 2)))
    way = single(RNG(48).uniform(0, 10, count))
    got = evaluate(
        results={"d": ("vec3", "ray_spread(WaterPoint(p, s, c), mesh, way, between)")},
        p=at.position, s=at.slope, c=at.curvature, mesh=mesh, way=way, between=step, **options,
    )["d"]  # fmt: skip
    want = np.empty((count, 3))
    for i in range(count):
        one = caustics.WaterPoint(*(part[i : i + 1] for part in at))
        want[i] = caustics.ray_spread(one, mesh[i : i + 1], way[i : i + 1], step[i], scene)
    bent = np.linalg.norm(at.curvature, axis=1) * np.linalg.norm(step, axis=1) / caustics.MIN_FACING
    compare(got, want, 1e-5 * (1.0 + (1.0 + way) * (1.0 + bent))[:, None])


@every_photon
@pytest.mark.parametrize("steps", [1, 3])
def test_twin_photon(case, steps):
    """2e-5 of the window, 1e-4 of the light, in 99 of 100 cases; in others rounding chose another texel."""
    scene, point, wave, launch, options = photon_case(steps, **case)
    at = on_true_waves(scene, point, wave)
    mesh = single(RNG(49).normal(0, 0.01, (len(point), 2, 2)))
    call = "photon(WaterPoint(p, s, c), mat2(mx, my), launch)"
    results = {
        "landing": ("vec2", f"{call}.landing"),
        "spread": ("vec2", f"{call}.spread"),
        "light": ("float", f"{call}.light"),
        "landed": ("bool", f"{call}.landed"),
    }
    got = evaluate(
        results=results,
        p=at.position, s=at.slope, c=at.curvature, mx=mesh[:, 0], my=mesh[:, 1], launch=launch, **options,
    )  # fmt: skip
    want = caustics.photon(at, mesh, launch, scene)
    assert all(np.isfinite(values).all() for values in got.values())
    near = caustics.is_water(at.position, scene) & (np.abs(want.landing - 0.5).max(axis=1) < 2.0)
    assert 0.2 < near.mean() < 1.0 and 0.2 < want.landed.mean() < 1.0
    for name, bound in (("landing", 2e-5), ("spread", 2e-5), ("light", 1e-4)):
        apart = np.abs(got[name] - getattr(want, name)).reshape(len(launch), -1).max(axis=1)
        assert np.mean(apart[near] > bound) < 0.01, f"{name}: {np.sort(apart[near])[-60:]}"
    assert np.mean(got["landed"].astype(bool) != want.landed) < 0.01


# caustics_lib.glsl

RESOLUTIONS = ((96, 64), (64, 512), (256, 256), (1000, 100), (16, 1000))
"""Photons and texels a side."""


@pytest.mark.parametrize(("photons", "texels"), RESOLUTIONS)
def test_twin_tent_spread(photons, texels):
    spacing = float(np.float32(texels / photons))
    spread = single(RNG(51).uniform(0, 1, (2000, 2)) * np.geomspace(1e-6, 1, 2000)[:, None])
    spread[0] = 1.0 / photons
    got = evaluate(
        ["caustics_lib.glsl"],
        {"h": ("vec2", "tent_spread(s, size, spacing)")},
        s=spread,
        size=np.full(2000, texels, float),
        spacing=np.full(2000, spacing),
    )["h"]
    compare(got, caustics.tent_spread(spread, texels, spacing), 0.0, 2 * EPS)


def test_twin_tent_before():
    z = single(np.linspace(-2, 2, 4001))
    got = evaluate(["caustics_lib.glsl"], {"t": ("float", "tent_before(z)")}, z=z)["t"]
    compare(got, caustics.tent_before(z), 2 * EPS)
    assert got.min() == 0.0 and got.max() == 1.0


def test_twin_tent_part():
    """Of a texel at 1000, whose middle is known to 6e-5 of a texel."""
    rng = RNG(52)
    texel = np.floor(rng.uniform(0, 1000, 4000))
    center, half = single(texel + rng.uniform(-4, 4, 4000)), single(rng.uniform(0.25, 8, 4000))
    results = {"t": ("float", "tent_part(t, c, h)")}
    got = evaluate(["caustics_lib.glsl"], results, t=texel, c=center, h=half)["t"]
    compare(got, caustics.tent_part(texel, center, half), 4 * EPS)


# coverage_lib.glsl


def shore_case(photons):
    """A mask of photons launched from water, and the options to look it up."""
    x, y = lattice(photons).T.reshape(2, photons, photons)
    wet = (y > 0.4 + 0.2 * np.sin(7.0 * x)) & (np.hypot(x - 0.6, y - 0.8) > 0.1)
    spread = np.repeat(wet[..., None], 4, axis=2).astype(float)
    return wet, {
        "sources": ["coverage_lib.glsl"],
        "samplers": {"spread_map": ("FLOAT_2D", data_texture(spread))},
    }


def test_twin_is_wet():
    wet, options = shore_case(64)
    y, x = (a.ravel() for a in np.mgrid[:64, :64])
    got = evaluate(results={"w": ("bool", "is_wet(ivec2(p))")}, p=np.stack([x, y], 1), **options)["w"]
    np.testing.assert_array_equal(got, wet.ravel())


@pytest.mark.parametrize(("photons", "texels"), RESOLUTIONS)
def test_twin_border_coverage(photons, texels):
    texel, every = np.arange(texels, dtype=float), np.ones(texels)
    spacing = float(np.float32(texels / photons))
    _, options = shore_case(16)
    got = evaluate(
        results={"b": ("float", "border_coverage(t, size, spacing)")},
        t=texel,
        size=texels * every,
        spacing=spacing * every,
        **options,
    )["b"]
    compare(got, caustics.border_coverage(texel, texels, spacing), 4 * EPS * max(spacing, 1.0))


def evaluate_at_texels(function, photons, texels):
    """function(ivec2 texel, float size, float spacing) at all texels, and the photons launched from water."""
    wet, options = shore_case(photons)
    y, x = (a.ravel() for a in np.mgrid[:texels, :texels])
    got = evaluate(
        results={"c": ("float", f"{function}(ivec2(t), size, spacing)")},
        t=np.stack([x, y], 1),
        size=np.full(texels**2, texels, float),
        spacing=np.full(texels**2, texels / photons),
        **options,
    )
    return got["c"].reshape(texels, texels), wet


@pytest.mark.parametrize(("photons", "texels"), [(64, 200), (200, 64), (96, 96)])
def test_twin_coverage(photons, texels):
    """A place in the texture is known to EPS of its size, and a tent is 1 / spacing steep."""
    got, wet = evaluate_at_texels("coverage", photons, texels)
    want = caustics.coverage(wet.astype(float), texels)
    assert np.mean((want > 0.01) & (want < 0.99)) > 0.01
    compare(got, want, 8 * EPS * texels)


@pytest.mark.parametrize(("photons", "texels"), [(64, 200), (200, 64), (96, 96)])
def test_twin_whole_coverage(photons, texels):
    got, _ = evaluate_at_texels("whole_coverage", photons, texels)
    compare(got, caustics.whole_coverage(texels, texels / photons), 8 * EPS)


# technique_traced_lib.glsl, depth_trace_lib.glsl, reflection_trace_lib.glsl

TRACED_SOURCES = (*WATER_SOURCES[:4], "technique_traced_lib.glsl")


def traced_case(camera=None, size=96, **settings):
    """A plan, uneven distances with edges and holes in both textures, and points of the surface seen."""
    from lake_water_addon.render import uniforms

    own = technique_traced.TracedSettings(24, 5, 0.3, (0.4, 0.2, 0.3))
    plan = planned(
        scenes.pond(own=(own,), **settings),
        camera or scenes.look_at((6, -9, 5), (0, 0, 0)),
        technique="TRACED",
        texture_size=size,
    )
    body = plan.bodies[0]
    y, x = np.meshgrid(np.linspace(0, 1, size), np.linspace(0, 1, size), indexing="ij")
    rgb = np.stack([0.5 + 0.4 * np.sin(5 * x), 0.5 + 0.4 * np.cos(4 * y), 0.3 + 0.2 * x * y], -1)
    color = single(np.concatenate([rgb, np.ones((size, size, 1))], -1))
    bottom = 12.0 - 5.0 * y + 0.5 * np.sin(9 * x) * np.cos(7 * y)
    bottom[20:50, 40:44] -= 2.0  # a post
    bottom[70:80, 10:20] = 1e5
    land = 25.0 + 8.0 * np.sin(6 * x + 2)
    land[60:, :] = 1e5  # the sky
    land[30:70, 60:70] = 14.0
    land[10:20, 20:30] = 0.0  # the inside of something
    bottom, land = single(bottom), single(land)
    lookups = air_lookup.WaterTextures(
        linear_filter(color),
        None,
        linear_filter(color[::-1]),
        lambda d: np.broadcast_to(scenes.SKY_RADIANCE, d.shape),
        0.03,
    )
    gpu_arguments = {
        "sources": TRACED_SOURCES,
        "uniform_buffers": {
            "lights": ("Lights", lights_block(plan.snapshot)),
            "water": ("Water", water_block(plan)),
            "technique": ("Technique", block_of([uniforms.technique(own, plan)])),
        },
        "samplers": {
            "sky_image": ("FLOAT_2D", data_texture(np.zeros((1, 1, 4)))),
            "refraction_color": ("FLOAT_2D", data_texture(color, smooth=True)),
            "refraction_depth": ("FLOAT_2D", data_texture(bottom)),
            "reflection_color": ("FLOAT_2D", data_texture(color[::-1], smooth=True)),
            "reflection_depth": ("FLOAT_2D", data_texture(land)),
        },
    }
    xy = RNG(40).uniform(-6, 6, (4000, 2))
    packed = body.packed_waves
    surface = single(np.concatenate([xy, waves.height(packed, xy)[:, None]], 1))
    if cameras.is_orthographic(plan.camera.projection):
        to_eye = single(np.broadcast_to(plan.camera.view[2, :3], surface.shape))
    else:
        eye = cameras.eye_position(plan.camera.view)
        to_eye = single((eye - surface) / np.linalg.norm(eye - surface, axis=1, keepdims=True))
    normal = single(optics.face_viewer(waves.normal(packed, xy), to_eye))
    textures = depth_trace.TracedTextures(lookups, bottom, land)
    return body, own, textures, gpu_arguments, surface, normal, to_eye


TRACED_CASES = {
    "perspective": {},
    "steep": {"waves": scenes.STEEP_WAVES},
    "orthographic": {"camera": scenes.look_at((6, -9, 5), (0, 0, 0), ortho=14.0)},
}
every_trace = pytest.mark.parametrize("case", TRACED_CASES.values(), ids=TRACED_CASES)


def rays_of(case):
    """Refracted rays in the refraction camera's space: (ray of the twin, end, projection, size, others)."""
    body, own, textures, gpu_arguments, surface, normal, to_eye = traced_case(**case)
    planned_pass, size = body.refraction, len(textures.refraction_depth)
    view = planned_pass.view
    bent = optics.refract_direction(-to_eye, normal, N12)[0]
    origin = single(surface @ view[:3, :3].T + view[:3, 3])
    along = single(bent @ view[:3, :3].T)
    along[:200] *= -1.0  # towards the camera
    along[200:800] = unit_vectors(600, 47)  # most of these leave the texture
    end = single(RNG(41).uniform(0.1, 40.0, len(origin)))
    projection = single(planned_pass.projection)
    ray = depth_trace.texture_ray(origin, along, projection, end, size)
    statement = f"TextureRay ray = texture_ray(o, d, m, e, {size}.0);"
    inputs = {"o": origin, "d": along, "e": end, "m": repeated(projection, len(origin))}
    return ray, statement, inputs, own, textures, gpu_arguments


@every_trace
def test_twin_texture_ray(case):
    """Float32 cancels where a ray hardly changes its place in the texture: 1e-4 of the way is allowed."""
    ray, statement, inputs, _, _, gpu_arguments = rays_of(case)
    got = evaluate(
        results={
            "ends": ("vec4", "vec4(ray.from, ray.to)"),
            "w": ("vec4", "vec4(ray.w, ray.dw, ray.end, ray.texel_width)"),
        },
        statements=statement,
        **inputs,
        **gpu_arguments,
    )
    shortened = ray.end < inputs["e"] * 0.999
    assert 0.05 < shortened.mean() < 0.95
    compare(got["ends"], np.concatenate([ray.start, ray.to], axis=1), 5e-4)
    want = np.stack([ray.w, ray.dw, ray.end, np.full(len(ray.w), ray.texel_width)], axis=1)
    compare(got["w"], want, 1e-5, 2e-4)


@every_trace
def test_twin_way_at(case):
    ray, statement, inputs, _, _, gpu_arguments = rays_of(case)
    part = single(RNG(42).uniform(0, 1, len(ray.w)))
    got = evaluate(
        results={"t": ("float", "way_at(ray, part)")},
        statements=statement,
        part=part,
        **inputs,
        **gpu_arguments,
    )["t"]
    want = depth_trace.way_at(ray, part)
    compare(got, want, 1e-5, 1e-3)
    # It is the perspective-correct one: the point there projects onto the straight line.
    projection = single(inputs["m"][0])
    uv = cameras.to_texture(projection, ray.origin + want[:, None] * ray.direction)
    np.testing.assert_allclose(uv, ray.at(part), atol=1e-9)


@every_trace
def test_twin_texel_at(case):
    ray, statement, inputs, _, _, gpu_arguments = rays_of(case)
    way = single(RNG(43).uniform(0, 3, len(ray.w)))
    got = evaluate(
        results={"m": ("float", "texel_at(ray, t)")}, statements=statement, t=way, **inputs, **gpu_arguments
    )["m"]
    compare(got, depth_trace.texel_at(ray, way), 1e-6, 1e-5)


def test_twin_depth_between():
    """Also beyond the border, and across the edges of the post and the hole."""
    _, _, textures, gpu_arguments, *_ = traced_case()
    uv = RNG(44).uniform(-0.1, 1.1, (4000, 2))
    uv[:4] = (0.0, 0.0), (1.0, 1.0), (1e6, -1e6), (0.5, 1.0)
    uv = single(uv)
    jump = single(RNG(45).choice([0.05, 1.0, 1e6], len(uv)))
    got = evaluate(
        results={"z": ("float", "depth_between(refraction_depth, uv, jump)")},
        uv=uv,
        jump=jump,
        **gpu_arguments,
    )["z"]
    want = depth_trace.depth_between(textures.refraction_depth, uv, jump)
    differs = np.abs(got - want) > 1e-3 * (1.0 + np.abs(want) * 1e-3)
    assert differs.mean() < 0.002  # the border between two texels is rounding
    smooth = linear_filter(textures.refraction_depth[..., None])(uv)[:, 0]
    assert np.median(np.abs(want - smooth)[jump == 1e6]) < 1e-9
    assert np.mean(np.abs(want - smooth)[jump < 0.1] > 1e-6) > 0.1


@every_trace
def test_twin_behind(case):
    ray, statement, inputs, _, textures, gpu_arguments = rays_of(case)
    part = single(RNG(46).uniform(0, 1, len(ray.w)))
    got = evaluate(
        results={"z": ("float", "behind(refraction_depth, ray, part)")},
        statements=statement,
        part=part,
        **inputs,
        **gpu_arguments,
    )["z"]
    want = depth_trace.behind(textures.refraction_depth, ray, part)
    assert np.mean(np.abs(got - want) > 5e-3 * (1.0 + 1e-3 * np.abs(want))) < 0.01


def compare_traces(got, want, size):
    """1/10 texel and 2 cm of the way in 99 of 100 cases: the others decide differently by rounding."""
    assert np.isfinite(got).all()
    apart = np.linalg.norm(got[:, :2] - want.uv, axis=1) * size > 0.1
    apart |= np.abs(got[:, 2] - want.way) > 0.02 * (1.0 + 0.1 * want.way)
    apart |= got[:, 3] != want.known
    assert apart.mean() < 0.01, f"{apart.mean():.2%} differ"


@every_trace
def test_twin_trace(case):
    ray, statement, inputs, own, textures, gpu_arguments = rays_of(case)
    size = len(textures.refraction_depth)
    for hidden in (0.4, 1.0):
        got = evaluate(
            results={"t": ("vec4", "vec4(t.uv, t.way, t.known)")},
            statements=f"""{statement}
                Trace t = trace(refraction_depth, ray, {size}.0, {hidden}, MARCH_STEPS);""",
            **inputs,
            **gpu_arguments,
        )["t"].astype(np.float64)
        compare_traces(got, depth_trace.trace(textures.refraction_depth, ray, size, own, hidden), size)
        assert 0.2 < got[:, 3].mean() < 0.999


def trace_through_camera(case, kind, direction_of, twin):
    """Of the GPU and of its twin, `trace_upwards` or `trace_downwards`, from points in render space."""
    body, own, textures, gpu_arguments, surface, normal, to_eye = traced_case(**case)
    direction = single(direction_of(-to_eye, normal))
    camera = f"water.{kind}_view, water.{kind}_projection"
    got = evaluate(
        results={"t": ("vec4", "vec4(t.uv, t.way, t.known)")},
        statements=f"Trace t = {twin.__name__}({kind}_depth, {camera}, u, r, MARCH_STEPS);",
        u=surface,
        r=direction,
        **gpu_arguments,
    )["t"].astype(np.float64)
    depth = getattr(textures, f"{kind}_depth")
    ends = body.lowest if twin is depth_trace.trace_downwards else body.highest
    compare_traces(got, twin(surface, direction, getattr(body, kind), ends, own, depth), len(depth))


@every_trace
def test_twin_trace_downwards(case):
    def bent(incident, normal):
        return optics.refract_direction(incident, normal, N12)[0]

    trace_through_camera(case, "refraction", bent, depth_trace.trace_downwards)


@every_trace
def test_twin_trace_upwards(case):
    trace_through_camera(case, "reflection", optics.reflect_upwards, depth_trace.trace_upwards)


def test_twin_color_and_known():
    """Anywhere in the texture, and outside of it, of rays that met something and of rays that did not."""
    _, textures, gpu_arguments, *_ = lake_case()
    uv = single(RNG(50).uniform(-0.2, 1.2, (2000, 2)))
    met = single(RNG(51).choice([0.0, 1.0], 2000))
    got = evaluate(
        results={"c": ("vec4", "color_and_known(refraction_color, Trace(uv, 1.0, met))")},
        uv=uv,
        met=met,
        **gpu_arguments,
    )["c"]
    found = depth_trace.Trace(uv, np.ones(len(uv)), met)
    color, known = depth_trace.color_and_known(found, textures.refraction_color, textures.fade)
    assert 0.1 < (known > 0.5).mean() < 0.9
    compare_radiance(got[:, 3:], known)
    compare_radiance(got[:, :3] * got[:, 3:], color * known)


def test_twin_hit_of():
    _, _, gpu_arguments, surface, _, to_eye = lake_case()
    way, known = single(RNG(52).uniform(0, 9, len(surface))), single(RNG(53).uniform(0, 1, len(surface)))
    got = evaluate(
        results={"h": ("vec4", "hit_of(Trace(vec2(0.0), t, 1.0), k, u, r)")},
        t=way,
        k=known,
        u=surface,
        r=to_eye,
        **gpu_arguments,
    )["h"]
    want = np.append(surface + way[:, None] * to_eye, np.ones((len(way), 1)), axis=1)
    compare(got, np.where(known[:, None] >= 0.5, want, 0.0), 1e-5)


@every_trace
def test_twin_traced_refraction(case):
    body, own, textures, gpu_arguments, surface, normal, to_eye = traced_case(**case)
    direction = single(optics.refract_direction(-to_eye, normal, N12)[0])
    got = evaluate(
        results={"c": ("vec3", "traced_refraction(u, r)")}, u=surface, r=direction, **gpu_arguments
    )["c"]
    compare_radiance(got, technique_traced.traced_refraction(surface, direction, body, own, textures))


@every_trace
def test_twin_traced_reflection(case):
    body, own, textures, gpu_arguments, surface, normal, to_eye = traced_case(**case)
    direction = single(optics.reflect_upwards(-to_eye, normal))
    got = evaluate(
        results={"c": ("vec3", "traced_reflection(u, r)")}, u=surface, r=direction, **gpu_arguments
    )["c"]
    compare_radiance(got, depth_trace.traced_reflection(surface, direction, body, own, textures))


@every_trace
def test_twin_mirrored_radiance(case):
    """Waves this steep send some rays downwards, which meet the water again."""
    body, own, textures, gpu_arguments, surface, normal, to_eye = traced_case(**case)
    tilted = normal + single(RNG(48).uniform(-0.6, 0.6, normal.shape))
    normal = single(optics.face_viewer(tilted / np.linalg.norm(tilted, axis=1, keepdims=True), to_eye))
    assert 0.02 < np.mean(optics.reflect_direction(-to_eye, normal)[:, 2] < 0.0) < 0.9
    below = single(RNG(49).uniform(0.0, 1.0, normal.shape))
    got = evaluate(
        results={"c": ("vec3", "mirrored_radiance(u, -e, n, b)")},
        u=surface,
        n=normal,
        e=to_eye,
        b=below,
        **gpu_arguments,
    )["c"]
    want = depth_trace.mirrored_radiance(surface, -to_eye, normal, below, body, own, textures)
    compare_radiance(got, want)


@every_trace
def test_twin_water_radiance_traced(case):
    body, own, textures, gpu_arguments, surface, normal, to_eye = traced_case(**case)
    got = evaluate(
        results={"c": ("vec3", "water_radiance(u, n, e)")}, u=surface, n=normal, e=to_eye, **gpu_arguments
    )["c"]
    compare_radiance(got, technique_traced.water_radiance(surface, normal, to_eye, body, own, textures))


# hits_lib.glsl

HIT_VIEWS = {
    "rigid": scenes.look_at((6, -9, 5), (0, 0, 0)).view,
    "mirrored": cameras.mirrored_view(scenes.look_at((6, -9, 5), (0, 0, 0)).view, 0.3),
    "flattened": cameras.flattened_view(scenes.look_at((6, -9, 5), (0, 0, 0)).view, 0.3, 0.6),
}


@every_projection
@pytest.mark.parametrize("view", HIT_VIEWS.values(), ids=HIT_VIEWS)
def test_twin_shown_point(view, projection):
    """Also where nothing is known, or nothing drawn. Relative to the way from the camera, 64 EPS."""
    view, projection = single(view), single(projection)
    depth = single(RNG(60).uniform(0.5, 40.0, (48, 64)))
    depth[10:20, 10:30], depth[30:40, 10:30] = 0.0, 1e5
    uv, known = single(RNG(61).uniform(0.02, 0.98, (3000, 2))), single(RNG(62).uniform(0.0, 1.0, 3000))
    texel = uv * (64, 48) % 1.0
    uv = uv[np.all(np.abs(texel - 0.5) < 0.49, axis=1)]  # the border between two texels is rounding
    known = known[: len(uv)]
    statements = "vec4 p = shown_point(depths, v, m, uv, known);"
    got = evaluate(
        ["camera_lib.glsl", "hits_lib.glsl"],
        {"p": ("vec4", "p")},
        statements=statements,
        samplers={"depths": ("FLOAT_2D", data_texture(depth))},
        v=repeated(view, len(uv)),
        m=repeated(projection, len(uv)),
        uv=uv,
        known=known,
    )["p"]
    want = hits.shown_point(depth, view, projection, uv, known)
    there = want[:, 3] == 1.0
    assert 0.2 < there.mean() < 0.8
    np.testing.assert_array_equal(got[:, 3], want[:, 3])
    np.testing.assert_array_equal(got[~there], 0.0)
    compare(got[there], want[there], 64 * EPS * 50.0, 64 * EPS)
    # It is the point that the camera sees there.
    points = want[there][:, :3] @ view[:3, :3].T + view[:3, 3]
    np.testing.assert_allclose(cameras.to_texture(projection, points), uv[there], atol=1e-9)
