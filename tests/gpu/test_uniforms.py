# SPDX-License-Identifier: GPL-3.0-or-later
"""The uniform buffers arrive member by member where the shader looks for them (std140)."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.gpu.glsl import evaluate

LIBRARY = Path(__file__).resolve().parents[2] / "lake_water_addon" / "gpu_shaders" / "uniforms_lib.glsl"
SIZES = {"vec4": 4, "mat4": 16}

pytestmark = pytest.mark.usefixtures("gpu")


def structs():
    """name -> [(type, member, length or None)], read from the shader's own source."""
    text = re.sub(r"//.*", "", LIBRARY.read_text())
    lengths = {name: int(value) for name, value in re.findall(r"#define (\w+) (\d+)", text)}
    found = {}
    for name, body in re.findall(r"struct (\w+) \{(.*?)\};", text, re.DOTALL):
        found[name] = [
            (kind, member, None if not length else lengths.get(length) or int(length))
            for kind, member, length in re.findall(r"(\w+) (\w+)(?:\[(\w+)\])?;", body)
        ]
    return found


def test_only_members_of_whole_vectors_are_used():
    """vec4, mat4 and arrays of them: with others std140 pads, and `uniforms.py` does not."""
    assert set(structs()) == {"Lights", "View", "Water", "WaterLight", "Technique", "NearPlane"}
    for name, members in structs().items():
        for kind, member, _ in members:
            assert kind in SIZES, f"{kind} {member} in struct {name}"


def member_arrays():
    """Distinct numbers for every component, through the functions that fill the real buffers."""
    from lake_water_addon.core import under_water
    from lake_water_addon.core.plan import CASCADES, plan_frame
    from lake_water_addon.core.settings import FrameSettings
    from lake_water_addon.core.snapshot import Material, Sky, Sun, WaterSettings
    from lake_water_addon.core.technique_traced import TracedSettings
    from lake_water_addon.core.waves import SineWave
    from lake_water_addon.render import uniforms
    from tests.gpu import scenes

    rng = np.random.default_rng(1)
    sky = Sky(rng.random(3), rng.random((9, 3)), "image", 1.25, 0.75)
    many = tuple(SineWave(*rng.uniform(0.1, 3.0, 4)) for _ in range(32))
    settings = WaterSettings(0.31, 4.5, 1.7, 1.41, (0.11, 0.22, 0.33), many)
    body = scenes.water((3, 4, 5))
    body = replace(body, settings=settings, grid=(49, 7.0, 8.0, 9.0, 10.0))
    bed, sand = scenes.grid_mesh("bed", 5, 40.0, 4.9), Material("sand", np.ones(3))
    scene = scenes.snapshot(
        (bed,),
        (sand,),
        (("bed", "sand", [np.eye(4)]),),
        (body,),
        sky,
        Sun(np.array([0.6, 0.0, 0.8]), np.array([3.0, 2.0, 1.0])),
    )
    plan = plan_frame(
        scene,
        scenes.look_at((1, -9, 5.2), (0, 1, 4)),
        FrameSettings(technique="TRACED", texture_size=64, intersection_steps=7, light_depth_size=64),
        jitter=(0.01, 0.02),
        samples=4,
    )
    body_plan = plan.bodies[0]
    assert len(plan.shadows) == CASCADES
    assert body_plan.light is not None
    begin = under_water.near_plane(plan.camera.view, plan.camera.projection)
    return {
        "Lights": uniforms.lights(plan),
        "View": uniforms.texture_view(body_plan.reflection, plan),
        "Water": uniforms.water(plan, body_plan),
        "WaterLight": uniforms.water_light(plan, body_plan),
        "Technique": [uniforms.technique(TracedSettings(1, 2, 3.0, (4.0, 5.0, 6.0)), plan)],
        "NearPlane": uniforms.near_plane(begin, under_water.height_map(begin, -1.0, 2.0)),
    }


@pytest.mark.parametrize("struct", ["Lights", "View", "Water", "WaterLight", "Technique", "NearPlane"])
def test_every_member_arrives(struct):
    from lake_water_addon.render.resources import Resources
    from lake_water_addon.render.uniforms import UniformBlock

    values = member_arrays()[struct]
    members = structs()[struct]
    assert len(values) == len(members), "uniforms.py and uniforms_lib.glsl differ in the number of members"
    block = UniformBlock(Resources()).update(*values)
    for (kind, member, length), sent in zip(members, values, strict=True):
        sent = np.asarray(sent, np.float32).reshape(-1, 4)  # noqa: PLW2901
        assert len(sent) == SIZES[kind] // 4 * (length or 1), f"{struct}.{member} has another size"
        index = np.arange(len(sent), dtype=float)
        expression = {
            ("vec4", False): f"block.{member}",
            ("vec4", True): f"block.{member}[int(i)]",
            ("mat4", False): f"block.{member}[int(i)]",
            ("mat4", True): f"block.{member}[int(i) / 4][int(i) % 4]",
        }[kind, length is not None]
        got = evaluate([], {"v": ("vec4", expression)}, uniform_buffers={"block": (struct, block)}, i=index)[
            "v"
        ]
        np.testing.assert_array_equal(got, sent, err_msg=f"{struct}.{member}")


def test_matrices_act_on_column_vectors():
    """Stored by columns: M p in the shader is M p here."""
    from lake_water_addon.render.resources import Resources
    from lake_water_addon.render.uniforms import UniformBlock

    view, projection = (m.T for m in member_arrays()["View"][:2])
    block = UniformBlock(Resources()).update(*member_arrays()["View"])
    points = np.random.default_rng(2).normal(size=(50, 4))
    got = evaluate(
        [],
        {"p": ("vec4", "block.projection * (block.view * p)")},
        uniform_buffers={"block": ("View", block)},
        p=points,
    )["p"]
    np.testing.assert_allclose(got, points @ (projection @ view).T, atol=1e-4)


def test_what_does_not_change_is_not_uploaded_and_what_does_is():
    from lake_water_addon.render.resources import Resources
    from lake_water_addon.render.uniforms import UniformBlock

    resources = Resources()
    block = UniformBlock(resources)
    numbers = np.arange(56.0)  # as many as a View has; the last four are View.clip

    def on_the_gpu():
        return evaluate(
            [],
            {"v": ("vec4", "block.clip")},
            uniform_buffers={"block": ("View", block.buffer)},
            i=np.zeros(1),
        )["v"][0]

    first = block.update(numbers)
    np.testing.assert_array_equal(on_the_gpu(), [52, 53, 54, 55])
    assert block.update(numbers.copy()) is first
    assert block.update(numbers + 100.0) is first
    np.testing.assert_array_equal(on_the_gpu(), [152, 153, 154, 155])
    assert resources.made == {"buffers": 1}
