# SPDX-License-Identifier: GPL-3.0-or-later
"""scripts/render.py as a person runs it: a process of its own, judged by exit status, messages and files."""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest

SCRIPTS = Path(__file__).resolve().parents[2] / "scripts"
SCRIPT = SCRIPTS / "render.py"
SIZE = (64, 48)


@pytest.fixture(scope="module")
def scripts() -> Iterator[None]:
    """The script and its helper modules can be imported."""
    sys.path.insert(0, str(SCRIPTS))
    yield
    sys.path.remove(str(SCRIPTS))


@pytest.fixture(scope="module")
def frame_files(scripts: None) -> ModuleType:
    """The script's helper module of that name, which needs no Blender."""
    import _frame_files

    return _frame_files


@pytest.fixture(scope="module")
def scenes(
    bpy_module: ModuleType, registered_addon: ModuleType, tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Path]:
    """Small files: "pool" (water over a striped bottom, camera, 3 frames), "dry" and "blind" (no camera)."""
    from mathutils import Matrix, Vector

    from lake_water_addon.water_objects import create_water, waters_of

    bpy = bpy_module
    folder = tmp_path_factory.mktemp("scenes")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.frame_end = 3
    for i in range(8):
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=(i - 3.5, 0.0, -1.5 + 0.2 * (i % 2)))
        bpy.context.object.scale = (1.0, 8.0, 1.0)
        material = bpy.data.materials.new(f"stripe {i}")
        shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = ((0.8, 0.2, 0.1, 1.0), (0.9, 0.9, 0.8, 1.0))[i % 2]
        bpy.context.object.data.materials.append(material)
    create_water("Pool", 8.0, 8.0, scene.collection)
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    scene.collection.objects.link(sun)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    place = Vector((0.0, -9.0, 4.0))
    camera.matrix_world = Matrix.Translation(place) @ (-place).to_track_quat("-Z", "Y").to_matrix().to_4x4()

    paths = {name: folder / f"{name}.blend" for name in ("pool", "dry", "blind")}
    bpy.ops.wm.save_as_mainfile(filepath=str(paths["pool"]), copy=True)
    scene.camera = None
    bpy.ops.wm.save_as_mainfile(filepath=str(paths["blind"]), copy=True)
    scene.camera = camera
    for water in waters_of(scene):
        bpy.data.objects.remove(water)
    bpy.ops.wm.save_as_mainfile(filepath=str(paths["dry"]), copy=True)
    return paths


def command(*arguments: object) -> list[str]:
    """The command line of a render with one sample a pixel."""
    return [sys.executable, str(SCRIPT), *map(str, arguments)]


def render(*arguments: object, folder: Path, status: int = 0, **options: object) -> str:
    """Run the script in `folder`; returns what it said. Fails unless it ends with `status`."""
    result = subprocess.run(
        command(*arguments), cwd=folder, capture_output=True, text=True, timeout=120, check=False, **options
    )
    said = result.stdout + result.stderr
    assert result.returncode == status, f"exit status {result.returncode}, expected {status}:\n{said}"
    assert "Traceback" not in said, said
    return said


def files(folder: Path) -> list[str]:
    """Names of the files below a folder, hidden ones included."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def pixels(bpy: ModuleType, path: Path) -> np.ndarray:
    """(h, w, 3) of a picture file, top row first."""
    image = bpy.data.images.load(str(path))
    width, height = image.size
    values = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(height, width, 4)[::-1, :, :3]


# The command line: refused before Blender is loaded


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--outptu x", r"unrecognized arguments: --outptu"),
        ("", r"nothing to make: give --output"),
        ("--output x --frames 0", r"--frames: 0 is too small"),
        ("--output x --resolution 0x48", r"--resolution: 0x48: both numbers must be at least 1"),
        ("--output x --resolution 64", r"--resolution: '64': give two whole numbers like 640x480"),
        ("--output x --pond-velocity-0 1", r"--pond-velocity-0: '1': give two numbers like 0,0.2"),
        ("--output x --ripple-dudv-map none.png", r"none\.png cannot be read .*check the path"),
        ("--output x --k nan", r"--k: nan is not a finite number"),
        ("--output x --water-color 0,1", r"--water-color: '0,1': give three numbers"),
        ("--output x --technique SEA", r"--technique: invalid choice: 'SEA' \(choose from .*LAKE"),
        ("--output x --caustics-method fast", r"--caustics-method: invalid choice: 'FAST' .*GPU_POINTS"),
        ("--output x --photon-size 0", r"--photon-size: 0 is too small"),
        ("--output x --budget 33", r"--budget: '33': give a number and its unit like 33ms or 2s"),
        ("--output x --budget 0ms", r"--budget: 0ms: must be more than 0"),
        ("--output x --max-error 1m", r"--max-error: '1m': give a number and its unit like 1px or 0\.05flip"),
        ("--output x --budget 33ms --max-error 1px", r"--max-error: not allowed with argument --budget"),
        ("--output x --quality best --budget 1s", r"--budget: not allowed with argument --quality"),
        ("--output x --quality great", r"--quality: invalid choice: 'GREAT' .*BALANCED"),
        (
            "--output x --view sideways",
            r"--view: invalid choice: 'sideways' .*dive",
        ),
        ("--output x --glow-strength inf", r"--glow-strength: inf is not a finite number"),
        ("--output x.mov", r"\.mov is not written; give FILE\.mp4"),
        ("--output x.png --frames 2", r"x\.png is one picture .*x_####\.png"),
        ("--output a#b#.png", r"put the frame number in one place"),
        ("--output x --contact-sheet y.jpg", r"--contact-sheet y\.jpg: give a name that ends in \.png"),
        ("--output file/x.mp4", r"--output .*file cannot be written .*: choose another folder"),
        ("--output x --stats file/s.json", r"--stats .*file cannot be written"),
        ("--output x --obj none.obj", r"none\.obj cannot be read .*check the path"),
        ("--output x --obj empty.obj", r"empty\.obj is empty"),
        ("none.blend --output x", r"none\.blend cannot be read .*check the path"),
    ],
)
def test_wrong_command_line_is_refused_with_a_remedy(tmp_path: Path, arguments: str, message: str) -> None:
    (tmp_path / "file").write_text("in the way of a folder")
    (tmp_path / "empty.obj").touch()
    before = files(tmp_path)
    said = render(*arguments.split(), folder=tmp_path, status=2)
    assert re.search(message, said), said
    assert files(tmp_path) == before
    assert not (tmp_path / "x").exists(), "an empty folder is left behind"


# What only Blender can tell


@pytest.mark.parametrize(
    ("scene", "arguments", "message"),
    [
        ("pool", "--k 1001", r"--k 1001: out of range, give 0 to 1000"),
        ("pool", "--caustics-size 5000", r"--caustics-size 5000: out of range, give 16 to 4096"),
        ("pool", "--glow-threshold 2", r"--glow-threshold 2: out of range, give 0 to 1"),
        ("pool", "--traced-thickness -1", r"--traced-thickness -1: out of range, give 0 to 1000"),
        ("pool", "--ripple-dudv-map points.obj", r"--ripple-dudv-map: .*points\.obj.*: give another"),
        ("pool", "--preset sea", r"--preset: there is no preset 'sea': choose one of Calm sea at dusk, .*"),
        ("dry", "--preset thesis_2008", r"--preset: the scene has no water to set it on"),
        ("dry", "--pond-bias 1", r"--pond-bias: the scene has no water to set it on"),
        ("pool", "--resolution 2x8", r"--resolution 2: out of range, give 4 to 65536"),
        ("pool", "--resolution 65536x8", r"65536x8 pixels: this GPU draws at most \d+ a side"),
        (
            "pool",
            "--output x.mp4 --resolution 63x48",
            r"even width and height, not 63x48: give --resolution 64x48",
        ),
        ("pool", "--seed 2", r"--seed and --detail make the demonstration lake"),
        ("pool", "--view under", r"--view is for the demonstration lake: leave it away with .*pool\.blend"),
        ("pool", "--view dive --camera scene", r"--view dive moves the camera, and --camera scene does not"),
        ("pool", "--obj points.obj", r"--obj: .*points\.obj holds no faces"),
        ("dry", "--budget 33ms", r"--budget: the scene has no water to measure"),
        ("pool", "--budget 33ms --samples 2", r"--samples and --budget both decide .*give one of them"),
        ("pool", "--max-error 1px --caustics", r"--caustics and --max-error both decide"),
        ("blind", "", r'"Scene" has no camera: .*--camera turntable'),
        ("dry", "--k 1", r"--k: the scene has no water to set it on"),
        ("broken", "", r"broken\.blend cannot be opened \(.*\): give a \.blend file"),
    ],
)
def test_what_the_scene_or_the_gpu_cannot_do_is_refused(
    scenes: dict[str, Path], tmp_path: Path, scene: str, arguments: str, message: str
) -> None:
    (tmp_path / "broken.blend").write_text("no Blender file")
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\n")
    blend = scenes.get(scene, tmp_path / "broken.blend")
    before = files(tmp_path)
    said = render(blend, "--output", "x", *arguments.split(), folder=tmp_path, status=2)
    assert re.search(message, said), said
    assert files(tmp_path) == before


def test_no_egl_is_told_and_does_not_crash(tmp_path: Path) -> None:
    nowhere = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nonexistent", "__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}
    said = render("--output", "x", folder=tmp_path, status=1, env=os.environ | nowhere)
    assert re.search(r"no OpenGL context: .*apt-get install libegl1", said), said


# What is made


@pytest.fixture(scope="module")
def sequence(scenes: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the pool's three frames, contact sheet and statistics."""
    folder = tmp_path_factory.mktemp("sequence")
    render(
        *(scenes["pool"], "--output", "frames", "--samples", 2, "--contact-sheet", "sheet.png"),
        *("--contact-grid", "1x3", "--stats", "stats.json"),
        folder=folder,
    )
    return folder


def test_a_sequence_with_contact_sheet_and_statistics(bpy_module: ModuleType, sequence: Path) -> None:
    frames = [f"frames/frame_000{i}.png" for i in (1, 2, 3)]
    assert files(sequence) == ["frames/frame.render.json", *frames, "sheet.png", "stats.json"]
    first, second = (pixels(bpy_module, sequence / frame) for frame in frames[:2])
    assert first.shape == (SIZE[1], SIZE[0], 3)
    assert first.std() > 0.05, "the picture is blank"
    assert np.abs(first - second).max() > 0.02, "the waves stand still"

    sheet = pixels(bpy_module, sequence / "sheet.png")
    assert sheet.shape == (SIZE[1] + 8, 3 * SIZE[0] + 16, 3)
    np.testing.assert_allclose(sheet[4:-4, 4 : 4 + SIZE[0]], first, atol=1.5 / 255)

    stats = json.loads((sequence / "stats.json").read_text())
    assert stats["outcome"] == "finished"
    assert [frame["frame"] for frame in stats["frames"]] == [1, 2, 3]
    assert stats["settings"]["samples"] == 2
    assert stats["median"]["of_frames"] == 2
    assert stats["median"]["total_s"] >= stats["median"]["frame_s"] > 0.0
    assert sum(stats["median"]["passes"].values()) > 0.0
    assert all(stats["machine"][key] for key in ("renderer", "driver", "backend"))


def test_a_video_holds_the_same_pictures(
    bpy_module: ModuleType, scenes: dict[str, Path], sequence: Path, tmp_path: Path
) -> None:
    """H.264, 4:2:0: colours agree within 1 % in the mean; a view transform applied twice would show."""
    bpy = bpy_module
    render(scenes["pool"], "--output", "{pool}.mp4", "--samples", 2, folder=tmp_path)
    assert files(tmp_path) == ["{pool}.mp4"], "work files are left behind"
    scene = bpy.context.scene
    strip = scene.sequence_editor_create().strips.new_movie("pool", str(tmp_path / "{pool}.mp4"), 1, 1)
    assert strip.duration == 3
    assert (strip.elements[0].orig_width, strip.elements[0].orig_height) == SIZE
    assert strip.elements[0].orig_fps == pytest.approx(scene.render.fps / scene.render.fps_base)

    scene.view_settings.view_transform = "Standard"
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    for frame in (1, 3):
        scene.frame_set(frame)
        scene.render.filepath = str(tmp_path / "decoded.png")
        bpy.ops.render.render(write_still=True)
        decoded = pixels(bpy, tmp_path / "decoded.png")
        rendered = pixels(bpy, sequence / f"frames/frame_000{frame}.png")
        np.testing.assert_allclose(decoded.mean(axis=(0, 1)), rendered.mean(axis=(0, 1)), atol=0.01)
        assert np.abs(decoded - rendered).mean() < 0.03


def test_resume_renders_what_is_missing_and_notices_other_settings(
    scenes: dict[str, Path], frame_files: ModuleType, tmp_path: Path
) -> None:
    arguments = (scenes["pool"], "--output", "f_##.exr", "--samples", 1)
    render(*arguments, "--frames", 2, folder=tmp_path)
    first = (tmp_path / "f_01.exr").stat().st_mtime_ns
    whole = (tmp_path / "f_02.exr").read_bytes()
    (tmp_path / "f_02.exr").write_bytes(whole[: len(whole) // 2])

    said = render(*arguments, "--frames", 3, "--resume", folder=tmp_path)
    assert "1 of 3 frames are there" in said
    assert (tmp_path / "f_01.exr").stat().st_mtime_ns == first, "a finished frame was rendered again"
    for name in ("f_02.exr", "f_03.exr"):
        assert frame_files.is_whole_picture(tmp_path / name), f"{name} was not rendered"

    said = render(*arguments, "--frames", 3, "--k", 2, "--resume", folder=tmp_path, status=2)
    assert "other settings (Pool k: 0.5 then, 2.0 now)" in said


def test_ctrl_c_leaves_whole_frames(scenes: dict[str, Path], frame_files: ModuleType, tmp_path: Path) -> None:
    arguments = (scenes["pool"], "--output", "long.mp4", "--frames", 1000, "--samples", 1)
    with subprocess.Popen(
        command(*arguments), cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        for line in process.stdout:
            if line.startswith("frame 3 "):
                break
        process.send_signal(signal.SIGINT)
        process.stdout.read()
        said = process.stderr.read()
    assert process.returncode == 130, said
    assert "the same command with --resume goes on" in said
    work = tmp_path / "long.mp4.frames"
    pictures = [name for name in files(work) if name != "frame.render.json"]
    assert pictures == [f"frame_{i + 1:04d}.png" for i in range(len(pictures))]
    assert len(pictures) >= 3
    assert all(frame_files.is_whole_picture(work / name) for name in pictures)
    assert json.loads((work / "frame.render.json").read_text())["done"] == [[1, len(pictures)]]


def test_a_full_disk_is_told_and_keeps_what_is_there(scenes: dict[str, Path], tmp_path: Path) -> None:
    """A limit on the size of files stands for the disk: Blender reports success for the cut-off frame."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192))

    (tmp_path / "frame_0001.png").write_bytes(b"an older frame")
    said = render(
        *(scenes["pool"], "--output", ".", "--resolution", "320x240", "--samples", 1),
        folder=tmp_path,
        status=1,
        preexec_fn=limit,
    )
    assert re.search(r"frame 1: the disk of .* is full .*: free some space, then .*--resume", said), said
    assert files(tmp_path) == ["frame_0001.png"]
    assert (tmp_path / "frame_0001.png").read_bytes() == b"an older frame"


def test_an_obj_file_and_the_water_level_change_the_picture(
    bpy_module: ModuleType, scenes: dict[str, Path], sequence: Path, tmp_path: Path
) -> None:
    corners = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    text = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
    (tmp_path / "box.obj").write_text("\n".join(text) + "\n")
    render(
        *(scenes["pool"], "--output", "one.png", "--samples", 2, "--obj", "box.obj", "--water-level", "0.25"),
        *("--stats", "stats.json"),
        folder=tmp_path,
    )
    settings = json.loads((tmp_path / "stats.json").read_text())["settings"]
    assert settings["Pool level"] == 0.25
    with_box = pixels(bpy_module, tmp_path / "one.png")
    without = pixels(bpy_module, sequence / "frames/frame_0001.png")
    assert np.abs(with_box - without)[SIZE[1] // 4 : -SIZE[1] // 4].mean() > 0.02


def test_options_of_the_sunlight_reach_the_picture_and_the_statistics(
    scenes: dict[str, Path], tmp_path: Path
) -> None:
    still = (scenes["pool"], "--samples", 1, "--stats", "stats.json", "--output")
    said = render(
        *(*still, "off.png", "--no-caustics", "--no-shadows", "--no-glow", "--no-exact-under-water"),
        *("--glow-strength", 2, "--caustics-steps", 3, "--light-depth-size", 64),
        folder=tmp_path,
    )
    stats = json.loads((tmp_path / "stats.json").read_text())
    settings = stats["settings"]
    assert stats["frames"][0]["sunlight"] == {
        **dict.fromkeys(("caustics", "shadows"), "switched off"),
        "glow": "not drawn, switched off",
    }
    switches = ("use_caustics", "use_shadows", "use_glow", "use_exact_under_water")
    assert [settings[name] for name in switches] == [False, False, False, False]
    for note in (
        "--glow-strength has no effect without --glow",
        "--caustics-steps has no effect without --caustics",
        "--light-depth-size has no effect without --shadows or --caustics",
    ):
        assert f"note: {note}\n" in said

    said = render(
        *(*still, "on.png", "--caustics", "--caustics-method", "cpu", "--caustics-size", 64),
        *("--photon-size", 32, "--caustics-steps", 2, "--shadows", "--light-depth-size", 128),
        *("--glow", "--glow-strength", 0.5, "--glow-exponent", 100, "--glow-threshold", 0.1),
        folder=tmp_path,
    )
    assert "note" not in said
    stats = json.loads((tmp_path / "stats.json").read_text())
    expected = {
        **dict.fromkeys(("use_caustics", "use_shadows", "use_glow"), True),
        **{"caustics_method": "CPU", "caustics_size": 64, "photon_size": 32, "caustics_steps": 2},
        **{"light_depth_size": 128, "glow_strength": 0.5, "glow_exponent": 100.0, "glow_threshold": 0.1},
        "use_exact_under_water": True,
    }
    assert {name: stats["settings"][name] for name in expected} == expected
    assert "shadow depth" in stats["median"]["passes"]
    sunlight = stats["frames"][0]["sunlight"]
    assert sunlight["caustics"] == "CPU, as set"
    assert re.fullmatch(r"[1-3] windows?", sunlight["shadows"])


def test_every_setting_of_the_picture_has_an_option(scripts: None) -> None:
    from dataclasses import fields

    import _blender_side
    import render as script

    from lake_water_addon.core import parameters
    from lake_water_addon.core.settings import FrameSettings

    assert {field.name for field in fields(FrameSettings)} <= set(_blender_side.SCENE_SETTINGS)
    options = script.build_parser(script.known()).parse_args([])
    assert set(_blender_side.WATER_SETTINGS) == set(parameters.WATER)
    for name in (*_blender_side.SCENE_SETTINGS, *_blender_side.WATER_SETTINGS, *parameters.OWN):
        assert getattr(options, name) is None, f"{name} is set though nobody asked for it"


def test_options_of_a_technique_and_a_preset_reach_the_statistics(
    bpy_module: ModuleType, scenes: dict[str, Path], tmp_path: Path
) -> None:
    still = (scenes["pool"], "--samples", 1, "--texture-size", 32, "--no-caustics", "--stats", "stats.json")
    said = render(
        *(*still, "--output", "pond.png", "--preset", "pond_2006", "--pond-velocity-0=-0.5,0.25"),
        *("--pond-geometric-waves", "--pond-shininess", 32, "--k", 0.25, "--traced-march-steps", 8, "--c", 2),
        folder=tmp_path,
    )
    for option in ("--traced-march-steps", "--c"):
        assert f"note: {option} has no effect with the technique Pond\n" in said
    assert said.count("note: ") == 2, said
    settings = json.loads((tmp_path / "stats.json").read_text())["settings"]
    expected = {
        **{"technique": "POND", "preset": "Pond 2006", "Pool k": 0.25, "Pool pond_velocity_0": [-0.5, 0.25]},
        **{"Pool pond_geometric_waves": True, "Pool pond_shininess": 32.0, "Pool pond_normal_map_0": None},
    }
    assert {name: settings[name] for name in expected} == expected
    assert "Pool traced_march_steps" not in settings

    # The picture just made is no dudv map.
    said = render(
        *(*still, "--output", "ripple.png", "--technique", "ripple", "--ripple-dudv-map", "pond.png"),
        folder=tmp_path,
    )
    assert 'note: --ripple-dudv-map: Image "pond.png" does not look like a dudv map\n' in said
    first, second = (pixels(bpy_module, tmp_path / f"{name}.png") for name in ("pond", "ripple"))
    assert np.abs(first - second).mean() > 0.01


def test_a_quality_is_set_before_other_options_and_for_the_size_of_the_frames(
    scenes: dict[str, Path], tmp_path: Path
) -> None:
    from lake_water_addon.core.quality import CUSTOM, quality_settings

    still = (scenes["pool"], "--resolution", "96x128", "--stats", "stats.json", "--output", "one.png")
    for others, quality in (((), "DRAFT"), (("--refraction-steps", 4), CUSTOM)):
        render(*still, "--quality", "draft", *others, folder=tmp_path)
        settings = json.loads((tmp_path / "stats.json").read_text())["settings"]
        assert settings["quality"] == quality
        expected = quality_settings("DRAFT", 128)
        expected["refraction_steps"] = others[1] if others else expected["refraction_steps"]
        del expected["viewport_samples"]  # not of a final render
        assert {name: settings[name] for name in expected} == expected


def test_a_budget_is_measured_chosen_from_and_resumed(scenes: dict[str, Path], tmp_path: Path) -> None:
    """The most exact of all settings are within an hour."""
    arguments = (
        scenes["pool"],
        "--output",
        "frames",
        "--no-caustics",
        "--no-shadows",
        "--stats",
        "stats.json",
    )
    said = render(*arguments, "--frames", 1, "--budget", "3600s", folder=tmp_path)
    assert re.search(r"--budget 3600s: texture \d+, .*; expected .* m?s a frame, .* px, FLIP ", said), said
    stats = json.loads((tmp_path / "stats.json").read_text())
    found = stats["budget"]
    assert found["fits"] and found["settings"]["samples"] > 1
    assert {name: stats["settings"][name] for name in found["settings"]} == found["settings"]
    for values in (found["expected"], found["measured"]):
        assert all(values[name] >= 0.0 for name in ("seconds", "pixels", "flip"))
    # At the same frame they are the same.
    assert found["measured"]["pixels"] == pytest.approx(found["expected"]["pixels"], rel=0.5)
    assert found["measured"]["flip"] == pytest.approx(found["expected"]["flip"], rel=0.5)

    said = render(*arguments, "--frames", 2, "--budget", "3600s", "--resume", folder=tmp_path)
    assert "measuring" not in said and "1 of 2 frames are there" in said
    assert json.loads((tmp_path / "stats.json").read_text())["budget"]["settings"] == found["settings"]


@pytest.mark.parametrize(
    ("limit", "size", "samples", "fits", "seconds"),
    [
        (("TIME", 0.03), 256, 4, True, 0.03),
        (("TIME", 0.001), 128, 1, False, 0.01),
        (("PIXELS", 1.5), 256, None, True, 8.0),  # samples move nothing: the scene's own, measured anew
        (("PIXELS", 0.1), 512, None, False, 8.0),
        (("FLIP", 0.15), 256, 4, True, 0.03),
        (("FLIP", 0.01), 512, 1, False, 0.05),
    ],
)
def test_what_a_limit_of_the_script_chooses(
    scripts: None,
    blender: ModuleType,
    registered_addon: ModuleType,
    limit: tuple[str, float],
    size: int,
    samples: int | None,
    fits: bool,
    seconds: float,
) -> None:
    import _budget
    from _arguments import Limit
    from _blender_side import Job

    from lake_water_addon.calibration import Measurement

    scene = blender.context.scene
    points = [(128, 1, 0.01, 2.0, 0.2), (256, 1, 0.02, 1.0, 0.16), (256, 4, 0.03, 1.0, 0.1)]
    results = []
    for *names, taken, pixels, flip in [*points, (512, 1, 0.05, 0.5, 0.05)]:
        settings = dict(zip(("texture_size", "samples"), names, strict=True))
        results.append(Measurement(settings, taken, 1.0, 1.0, pixels, flip))
        point = scene.lake_water.calibration.points.add()
        point.settings, point.seconds = json.dumps(settings), taken
        point.pixels, point.flip = pixels, flip

    class Bench:
        def draw(self, settings: dict, samples: int) -> Iterator[tuple[int, float]]:
            self.drawn = samples
            return ((i + 1, 1.0) for i in range(samples))

        def flip(self, samples: int) -> float:
            return 0.01 * samples

    calibration = SimpleNamespace(results=results, bench=Bench())
    job = Job(registered_addon, scene, [], [1], False, [])
    found = _budget._choice(job, Limit("", *limit), calibration)
    expected = {"texture_size": size} | ({"samples": samples} if samples else {})
    assert (found["settings"], found["fits"]) == (expected, fits)
    assert found["expected"]["seconds"] == seconds
    if limit[0] == "PIXELS":
        assert calibration.bench.drawn == scene.lake_water.samples == 8
        assert found["expected"]["flip"] == 0.08


def test_a_texture_beyond_the_limit_of_the_gpu_is_refused(
    scripts: None, blender: ModuleType, registered_addon: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    import _blender_side
    from _frame_files import UsageProblem

    monkeypatch.setattr(_blender_side, "max_picture_size", lambda: 4096)
    scene = blender.context.scene
    _blender_side._require_gpu_size(registered_addon, scene)
    scene.lake_water.light_depth_size = 2048
    with pytest.raises(UsageProblem, match=r"--light-depth-size 2048: this GPU takes at most 1365"):
        _blender_side._require_gpu_size(registered_addon, scene)


def test_without_a_sun_its_options_say_that_they_do_nothing(
    bpy_module: ModuleType, scenes: dict[str, Path], tmp_path: Path
) -> None:
    bpy_module.ops.wm.open_mainfile(filepath=str(scenes["pool"]))
    bpy_module.data.objects.remove(bpy_module.data.objects["Sun"])
    bpy_module.ops.wm.save_as_mainfile(filepath=str(tmp_path / "night.blend"), copy=True)
    still = ("night.blend", "--output", "night.png", "--samples", 1)
    said = render(*still, "--glow", "--stats", "stats.json", folder=tmp_path)
    assert "note: --glow has no effect: the scene has no sun light" in said
    sunlight = json.loads((tmp_path / "stats.json").read_text())["frames"][0]["sunlight"]
    assert all("there is no sun" in text for text in sunlight.values())
    said = render(*still, "--no-glow", folder=tmp_path)
    assert "note" not in said


def test_a_scene_without_water_is_rendered_with_a_note(scenes: dict[str, Path], tmp_path: Path) -> None:
    said = render(scenes["dry"], "--output", "dry.png", "--samples", 1, folder=tmp_path)
    assert "note: the scene has no water" in said
    assert files(tmp_path) == ["dry.png"]


def test_the_demonstration_lake_turns(bpy_module: ModuleType, tmp_path: Path) -> None:
    """Without a scene or an output: two opposite views of the lake, on a contact sheet."""
    render(
        *("--contact-sheet", "sheet.png", "--contact-grid", "1x2", "--frames", 48, "--detail", 0.1),
        *("--resolution", "{}x{}".format(*SIZE), "--samples", 1, "--texture-size", 64),
        folder=tmp_path,
    )
    assert files(tmp_path) == ["sheet.png"]
    sheet = pixels(bpy_module, tmp_path / "sheet.png")
    left, right = sheet[4:-4, 4 : 4 + SIZE[0]], sheet[4:-4, 8 + SIZE[0] : -4]
    assert left.std() > 0.05
    assert np.abs(left - right).mean() > 0.03


# Names and files, without Blender


@pytest.mark.parametrize(
    ("text", "frame", "kind"),
    [
        ("out/lake.mp4", "out/lake.mp4.frames/frame_0007.png", "VIDEO"),
        ("out", "out/frame_0007.png", "SEQUENCE"),
        ("out/v2.1", "out/v2.1/frame_0007.png", "SEQUENCE"),
        ("out/a_######.exr", "out/a_000007.exr", "SEQUENCE"),
        ("out/a##b", "out/a07b.png", "SEQUENCE"),
        ("out/##", "out/07.png", "SEQUENCE"),
        ("one.PNG", "one.PNG", "STILL"),
        ("//rel/x.png", "rel/x.png", "STILL"),
    ],
)
def test_names_of_frames(frame_files: ModuleType, text: str, frame: str, kind: str) -> None:
    base = Path.cwd()
    output = frame_files.parse_output(text, None, None, base)
    assert (str(output.frame(7)), output.kind) == (str(base / frame), kind)


def test_every_cut_of_a_picture_is_noticed(frame_files: ModuleType, sequence: Path, tmp_path: Path) -> None:
    whole = (sequence / "frames/frame_0001.png").read_bytes()
    copy = tmp_path / "copy.png"
    copy.write_bytes(whole)
    assert frame_files.is_whole_picture(copy)
    for length in range(0, len(whole), max(len(whole) // 50, 1)):
        copy.write_bytes(whole[:length])
        assert not frame_files.is_whole_picture(copy), f"{length} of {len(whole)} bytes"


def test_a_typing_error_is_told_before_blender_is_loaded() -> None:
    code = (
        f"import sys; sys.path.insert(0, {str(SCRIPTS)!r}); import render\n"
        "render.build_parser(render.known()); sys.exit('bpy' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
