# SPDX-License-Identifier: GPL-3.0-or-later
"""What a person can set: on a water object (`object.lake_water`) and on a scene (`scene.lake_water`).

Blender saves these with the file, animates and drives them, and undoes changes of them.
Symbols are those of the optical model: k, q, c, FOV_ext. `water_objects.settings_of`
turns a water object's settings into plain data.
"""

import dataclasses
import math

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import calibration_properties
from .core import parameters, quality
from .core.settings import CAUSTICS_METHODS, DEFAULTS
from .core.technique_settings import TechniqueSettings, map_label
from .core.techniques import TECHNIQUES
from .registration import register_classes, unregister_classes


def _changed(self: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    """Does nothing itself: Blender tags a data-block for an update, also when Python sets a value, only
    for properties that have an update function. Without the tag, extraction would not see the change."""


NOTIFY = {"update": _changed}
# A library override of a linked lake may change every setting of a water object.
OVERRIDABLE = {"override": {"LIBRARY_OVERRIDABLE"}}
OBJECT = NOTIFY | OVERRIDABLE

K = {
    "name": "Attenuation k (1/m)",
    "description": "How fast the water swallows light: after 1/k metres 37 % of what lies behind it is left "
    "and the water colour has taken the rest. 0.1 is clear, 0.5 a lake, 3 a bog. Costs nothing",
    "default": 0.5,
    "min": 0.0,
    "max": 1000.0,
    "soft_max": 3.0,
    "step": 5,
    "precision": 3,
}
Q = {
    "name": "Fresnel Exponent q",
    "description": "How suddenly the reflection takes over towards grazing view: lower reflects more at "
    "middle angles. 5 is Schlick's value, 5.65 comes closest to real water overall. Costs nothing",
    "default": 5.0,
    "min": 0.0,
    "max": 100.0,
    "soft_min": 1.0,
    "soft_max": 10.0,
    "step": 10,
    "precision": 2,
}
C = {
    "name": "Reflection Offset c",
    "description": "How far along the reflected ray the reflection is looked up: more makes the waves bend "
    "the reflections further. 0 gives a plain mirror. Costs nothing",
    "default": 1.0,
    "min": 0.0,
    "max": 1000.0,
    "soft_max": 10.0,
    "subtype": "DISTANCE",
    "unit": "LENGTH",
    "step": 10,
    "precision": 2,
}
WATER_COLOR = {
    "name": "Water Color",
    "description": "Color that deep water turns to: the light that the volume itself sends back, "
    "scene-linear. Costs nothing",
    "default": (0.0, 0.2, 0.1),
    "min": 0.0,
    "max": 1000.0,
    "soft_max": 1.0,
    "size": 3,
    "subtype": "COLOR",
}
FOV_EXT = {
    "name": "FOV Extension",
    "description": "FOV_ext: how much wider the refraction and reflection textures see than the camera, as "
    "a factor of the tangent of half the field of view. More finds what waves bend in from outside the "
    "picture, and makes both textures coarser by the same factor. 1.5 near the water, 1.2 far from it",
    "default": DEFAULTS.fov_ext,
    "min": 1.0,
    "max": 10.0,
    "soft_max": 3.0,
    "step": 5,
    "precision": 2,
}
CAUSTICS_METHOD_TEXTS = {
    "AUTO": "The fastest that this machine supports",
    "CPU": "Photons are read back and summed by the processor: slow, works everywhere",
    "GPU_POINTS": "Photons are drawn as points that add up",
    "GPU_COMPUTE": "A compute shader sums photons in whole numbers: the fastest, and the same to the bit in "
    "every run",
}


class LakeWaterWave(bpy.types.PropertyGroup):
    """One sine wave of a water surface (`core.waves.SineWave`)."""

    amplitude: FloatProperty(
        name="Amplitude",
        description="Height of the crests over the calm surface. High, short waves tear the refraction "
        "apart: keep it below a tenth of the wavelength",
        default=0.02,
        min=0.0,
        max=100.0,
        soft_max=0.5,
        subtype="DISTANCE",
        unit="LENGTH",
        step=1,
        precision=4,
        **OBJECT,
    )
    wavelength: FloatProperty(
        name="Wavelength",
        description="Distance from crest to crest; the speed follows from it and the depth. Waves shorter "
        "than twice the grid spacing need a higher grid resolution",
        default=1.0,
        min=0.01,
        max=10000.0,
        soft_min=0.1,
        soft_max=20.0,
        subtype="DISTANCE",
        unit="LENGTH",
        step=10,
        precision=3,
        **OBJECT,
    )
    direction: FloatProperty(
        name="Direction",
        description="Where the wave travels to, from the water object's X axis towards its Y axis",
        default=0.0,
        soft_min=-math.pi,
        soft_max=math.pi,
        subtype="ANGLE",
        unit="ROTATION",
        step=500,
        precision=1,
        **OBJECT,
    )
    phase: FloatProperty(
        name="Phase",
        description="Where in its cycle the wave starts at the object's origin: gives waves of equal length "
        "different places",
        default=0.0,
        soft_min=0.0,
        soft_max=2.0 * math.pi,
        subtype="ANGLE",
        unit="ROTATION",
        step=500,
        precision=1,
        **OBJECT,
    )


MAP_TEXTS = {
    "NORMAL": "Normal map of ripples; set its color space to Non-Color. Empty: one made by the extension",
    "DUDV": "Dudv map of ripples; set its color space to Non-Color. Empty: one made by the extension",
    "COLOR": "Any image. Empty: none",
}


def _property_of(field: dataclasses.Field) -> object:
    """The property in Blender of one of a technique's own settings (`technique_settings.setting`)."""
    options = {"default": field.default, **field.metadata, **OBJECT}
    del options["panel"]
    if isinstance(field.default, tuple):
        return FloatVectorProperty(**{"size": len(field.default), **options})
    for kind, make in ((bool, BoolProperty), (int, IntProperty), (float, FloatProperty)):
        if isinstance(field.default, kind):
            return make(**options)
    raise TypeError(f"{field.name}: no property for a setting like {field.default!r}")


def _group_of(key: str, settings: type[TechniqueSettings]) -> type[bpy.types.PropertyGroup]:
    """The settings that only one technique has, as they are on a water object."""
    properties = {field.name: _property_of(field) for field in dataclasses.fields(settings)}
    for sampler, kind in settings.maps.items():
        properties[sampler] = PointerProperty(
            type=bpy.types.Image,
            name=map_label(sampler),
            description=MAP_TEXTS[kind],
            **OBJECT,
        )
    name = f"LakeWater{key.title().replace('_', '')}Settings"
    text = f"Settings that only the technique {TECHNIQUES[key].label} has."
    return type(name, (bpy.types.PropertyGroup,), {"__annotations__": properties, "__doc__": text})


TECHNIQUE_GROUPS = {
    key.lower(): _group_of(key, technique.settings)
    for key, technique in TECHNIQUES.items()
    if technique.settings is not None
}
"""By name on `object.lake_water`."""


class LakeWaterObjectSettings(bpy.types.PropertyGroup):
    """Settings of one water body, on the object whose mesh is its surface."""

    enabled: BoolProperty(
        name="Water",
        description="This object is a water surface, drawn by Lake Water",
        default=False,
        **OBJECT,
    )
    surface: EnumProperty(
        name="Surface",
        description="What the waves displace",
        items=(
            (
                "GRID",
                "Grid",
                "A grid over the object's rectangle, made on the graphics card: any resolution without more "
                "work for the processor",
            ),
            (
                "MESH",
                "Mesh",
                "The object's own vertices, modifiers included: any outline, as fine as modeled",
            ),
        ),
        default="GRID",
        **OBJECT,
    )
    grid_resolution: IntProperty(
        name="Grid Resolution",
        description="Vertices along each side of the grid. 49 is enough for a small lake; short waves on a "
        "large one need more. The graphics card's work grows with its square",
        default=49,
        min=2,
        max=1024,
        soft_max=512,
        **OBJECT,
    )
    k: FloatProperty(**K, **OBJECT)
    q: FloatProperty(**Q, **OBJECT)
    c: FloatProperty(**C, **OBJECT)
    ior: FloatProperty(
        name="Index of Refraction",
        description="How strongly light bends at the surface: 1.333 for fresh water, 1.34 for the sea, 1 "
        "for none. Costs nothing",
        default=1.333,
        min=1.0,
        max=4.0,
        soft_max=2.0,
        step=0.5,
        precision=3,
        **OBJECT,
    )
    water_color: FloatVectorProperty(**WATER_COLOR, **OBJECT)
    depth: FloatProperty(
        name="Depth",
        description="Depth of the water for the speed of the waves: long waves slow down where it is "
        "shallow. It changes nothing else",
        default=5.0,
        min=0.01,
        max=12000.0,
        soft_min=0.1,
        soft_max=100.0,
        subtype="DISTANCE",
        unit="LENGTH",
        step=10,
        precision=2,
        **OBJECT,
    )
    waves: CollectionProperty(
        type=LakeWaterWave,
        name="Waves",
        description="The sine waves whose sum is the surface",
        override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"},
    )
    active_wave: IntProperty(
        name="Active Wave",
        description="The wave whose values are shown below the list",
        default=0,
        min=0,
        options=set(),
        **OVERRIDABLE,
    )
    previous_display_type: StringProperty(
        description="The object's Display As before it became water, to be put back",
        options={"HIDDEN"},
        **OVERRIDABLE,
    )


for _name, _group in TECHNIQUE_GROUPS.items():
    LakeWaterObjectSettings.__annotations__[_name] = PointerProperty(
        type=_group,
        name=TECHNIQUES[_name.upper()].label,
        description=f"What only the technique {TECHNIQUES[_name.upper()].label} reads",
        **OVERRIDABLE,
    )


BUDGETS = (
    ("OFF", "None", "Settings are yours"),
    (
        "TIME",
        "Time",
        "The most exact settings that take no longer. Held while an animation plays in a viewport",
    ),
    (
        "PIXELS",
        "Pixels",
        "The fastest settings that show things in the water and its mirror image no further off",
    ),
    (
        "FLIP",
        "FLIP",
        "The fastest settings whose picture looks no more different from the best that the "
        "technique can do, samples included",
    ),
)


def _choose(self: "LakeWaterSceneSettings", context: bpy.types.Context) -> None:
    from .budget import apply

    apply(self.id_data)


QUALITY_ITEMS = [
    *((key, q.label, q.description, number) for number, (key, q) in enumerate(quality.QUALITIES.items())),
    (quality.CUSTOM, "Custom", "The settings are those of no quality", len(quality.QUALITIES)),
]
QUALITY_KEYS = [key for key, *_ in QUALITY_ITEMS]


def longer_side(scene: bpy.types.Scene) -> int:
    """Pixels of the longer side of the scene's picture, as Blender rounds them."""
    render = scene.render
    return max(render.resolution_x, render.resolution_y) * render.resolution_percentage // 100


def _get_quality(self: "LakeWaterSceneSettings") -> int:
    return QUALITY_KEYS.index(quality.quality_of(self, longer_side(self.id_data)))


def _set_quality(self: "LakeWaterSceneSettings", number: int) -> None:
    if QUALITY_KEYS[number] == quality.CUSTOM:
        return
    values = quality.quality_settings(QUALITY_KEYS[number], longer_side(self.id_data))
    for name, value in values.items():
        setattr(self, name, value)


class LakeWaterSceneSettings(bpy.types.PropertyGroup):
    """Settings of the picture, on the scene."""

    technique: EnumProperty(
        name="Technique",
        description="How the water is computed",
        items=[(key, t.label, t.description) for key, t in TECHNIQUES.items()],
        default=DEFAULTS.technique,
        **NOTIFY,
    )
    quality: EnumProperty(
        name="Quality",
        description="How exactly the water is computed: sets sizes, steps and samples below, for the size of "
        "the scene's picture. Technique, water and light stay as they are",
        items=QUALITY_ITEMS,
        get=_get_quality,
        set=_set_quality,
        options={"SKIP_SAVE"},
    )
    fov_ext: FloatProperty(**FOV_EXT, **NOTIFY)
    texture_size: IntProperty(
        name="Texture Size",
        description="Width and height of the refraction and reflection textures in pixels. Larger is "
        "sharper under water; time and memory grow with the square",
        default=DEFAULTS.texture_size,
        min=16,
        max=8192,
        soft_min=128,
        soft_max=2048,
        subtype="PIXEL",
        **NOTIFY,
    )
    least_grid_resolution: IntProperty(
        name="Least Grid Resolution",
        description="Vertices along each side of every grid of water, where its own resolution is lower. "
        "Raise it where the shore, or crests before others, look angular: what the water shows is found "
        "between the vertices, too",
        default=DEFAULTS.least_grid_resolution,
        min=2,
        max=1024,
        soft_max=512,
        **NOTIFY,
    )
    intersection_steps: IntProperty(
        name="Intersection Steps",
        description="Steps of the search for the point where a refracted ray meets the bottom: the main dial "
        "between speed and accuracy. 1 bends the sight towards a level bottom, 3 is the thesis's choice, "
        "more helps where the bottom is uneven",
        default=DEFAULTS.intersection_steps,
        min=1,
        max=16,
        soft_max=8,
        **NOTIFY,
    )
    refraction_steps: IntProperty(
        name="Refraction Steps",
        description="Most steps along a refracted ray, through the distances of the refraction texture, "
        "until it meets what it shows. 0 is the thesis's choice: the search, from a camera turned into the "
        "water, which misses what lies behind edges. 32 is enough for most bottoms; time grows with it",
        default=DEFAULTS.refraction_steps,
        min=0,
        max=256,
        soft_max=64,
        **NOTIFY,
    )
    reflection_steps: IntProperty(
        name="Reflection Steps",
        description="Most steps along a reflected ray, through the distances of the reflection texture, "
        "until it meets what it mirrors; from under water, along refracted rays, too. 0 is the thesis's "
        "choice: looked up a fixed way along the ray, the reflection offset c. 16 is enough for most shores; "
        "time grows with it",
        default=DEFAULTS.reflection_steps,
        min=0,
        max=256,
        soft_max=64,
        **NOTIFY,
    )
    use_exact_fresnel: BoolProperty(
        name="Exact Fresnel",
        description="How much the surface reflects by Fresnel's equations. Off: Schlick's approximation with "
        "the exponent q. Costs next to nothing",
        default=DEFAULTS.use_exact_fresnel,
        **NOTIFY,
    )
    use_caustics: BoolProperty(
        name="Caustics",
        description="Light that the waves focus on the bottom. Off: the sun lights the bottom as through a "
        "calm surface. Costs a picture of the water as seen from the sun and the sum of its photons "
        "whenever the waves move",
        default=DEFAULTS.use_caustics,
        **NOTIFY,
    )
    caustics_method: EnumProperty(
        name="Caustics Method",
        description="How photons are summed. All give the same light and differ in time",
        items=[(key, label, CAUSTICS_METHOD_TEXTS[key]) for key, label in CAUSTICS_METHODS.items()],
        default=DEFAULTS.caustics_method,
        **NOTIFY,
    )
    caustics_size: IntProperty(
        name="Caustics Texture Size",
        description="Width and height of the caustics texture in pixels. Raise it, and the photons with it, "
        "where the lines of light are blurred. Memory grows with the square",
        default=DEFAULTS.caustics_size,
        min=16,
        max=4096,
        soft_min=128,
        soft_max=2048,
        subtype="PIXEL",
        **NOTIFY,
    )
    photon_size: IntProperty(
        name="Photons per Side",
        description="Photons along each side of the sunlit water. Raise it where the lines of light are "
        "coarse; time and memory grow with the square",
        default=DEFAULTS.photon_size,
        min=16,
        max=4096,
        soft_min=128,
        soft_max=2048,
        **NOTIFY,
    )
    caustics_steps: IntProperty(
        name="Caustics Steps",
        description="Steps of the search for the point where a photon meets the bottom. 1 is the thesis's "
        "choice and exact for calm water; 2 or 3 where the bottom is uneven. Each costs a lookup a photon",
        default=DEFAULTS.caustics_steps,
        min=1,
        max=16,
        soft_max=8,
        **NOTIFY,
    )
    use_shadows: BoolProperty(
        name="Sun Shadows",
        description="Shadows of the sun, on land and under water. Costs some lookups in each pixel, and the "
        "scene drawn as seen from the sun when it, the sun or the view changes",
        default=DEFAULTS.use_shadows,
        **NOTIFY,
    )
    light_depth_size: IntProperty(
        name="Light Depth Size",
        description="Width and height in pixels of the textures that hold distances from the sun: three for "
        "shadows, near to far, and one for each water's caustics and shadows. Raise it for sharper shadows; "
        "memory grows with the square",
        default=DEFAULTS.light_depth_size,
        min=16,
        max=4096,
        soft_min=256,
        soft_max=2048,
        subtype="PIXEL",
        **NOTIFY,
    )
    use_glow: BoolProperty(
        name="Sun Glow",
        description="Star-shaped glow around the sun's mirror image in the waves. Costs a small picture of "
        "the water, and nothing while the sun's mirror image is out of view",
        default=DEFAULTS.use_glow,
        **NOTIFY,
    )
    glow_strength: FloatProperty(
        name="Glow Strength",
        description="Brightness of the glow, scene-linear. Costs nothing",
        default=DEFAULTS.glow_strength,
        min=0.0,
        max=1000.0,
        soft_max=10.0,
        step=10,
        precision=2,
        **NOTIFY,
    )
    glow_exponent: FloatProperty(
        name="Glow Exponent",
        description="How small the sun's mirror image is. Raise it for fewer, smaller sparks, lower it for "
        "a broad glitter. Costs nothing",
        default=DEFAULTS.glow_exponent,
        min=1.0,
        max=100000.0,
        soft_min=10.0,
        soft_max=2000.0,
        step=1000,
        precision=0,
        **NOTIFY,
    )
    glow_threshold: FloatProperty(
        name="Glow Threshold",
        description="Brightness of the mirror image, 0 to 1, below which nothing glows. Raise it to keep "
        "only the brightest sparks. Costs nothing",
        default=DEFAULTS.glow_threshold,
        min=0.0,
        max=1.0,
        step=1,
        precision=3,
        **NOTIFY,
    )
    use_exact_under_water: BoolProperty(
        name="Exact Under Water",
        description="Seen from under water, refract exactly: the world above shrinks to Snell's window, with "
        "total reflection around it. Off: the thesis's approximation, which shows the world above "
        "everywhere. Costs nothing",
        default=DEFAULTS.use_exact_under_water,
        **NOTIFY,
    )
    samples: IntProperty(
        name="Render Samples",
        description="Pictures from slightly shifted cameras that are averaged in a final render, for smooth "
        "edges. Render time is proportional to it",
        default=8,
        min=1,
        max=4096,
        soft_max=64,
        **NOTIFY,
    )
    viewport_samples: IntProperty(
        name="Viewport Samples",
        description="Pictures that are averaged in the Rendered viewport while nothing moves",
        default=8,
        min=1,
        max=1024,
        soft_max=64,
        **NOTIFY,
    )
    show_in_viewport: BoolProperty(
        name="Show Water in Viewport",
        description="Draw the water over what Blender shows, in every shading mode. Costs the refraction and "
        "reflection pass at each redraw",
        default=True,
        **NOTIFY,
    )
    show_statistics: BoolProperty(
        name="Statistics",
        description="Show frames per second and the time of each pass. Measuring them makes a frame slower",
        default=False,
        **NOTIFY,
    )
    budget: EnumProperty(
        name="Budget",
        description="What a picture may take, or how far from the truth it may be. The settings for it are "
        "chosen from the calibration",
        items=BUDGETS,
        default="OFF",
        options=set(),
        update=_choose,
    )
    budget_time: FloatProperty(
        name="Time (ms)",
        description="Milliseconds that one sample of a picture may take: a viewport draws one for each frame "
        "of an animation, a final render as many as Render Samples",
        default=33.0,
        min=0.1,
        max=100000.0,
        soft_min=1.0,
        soft_max=1000.0,
        step=100,
        precision=1,
        options=set(),
        update=_choose,
    )
    budget_pixels: FloatProperty(
        name="Error (px)",
        description="Pixels between where things are shown in the water or mirrored by it, and where they "
        "are, in the mean",
        default=1.0,
        min=0.01,
        max=1000.0,
        soft_max=10.0,
        step=10,
        precision=2,
        options=set(),
        update=_choose,
    )
    budget_flip: FloatProperty(
        name="FLIP",
        description="Mean difference on the water, as an eye sees it, 0 to 1: below 0.05 it is hard to see",
        default=0.05,
        min=0.001,
        max=1.0,
        soft_max=0.3,
        step=1,
        precision=3,
        options=set(),
        update=_choose,
    )
    calibration: PointerProperty(
        type=calibration_properties.LakeWaterCalibration,
        name="Calibration",
        description="What each setting costs and what error it leaves, measured on this scene",
    )


CLASSES = (
    LakeWaterWave,
    *TECHNIQUE_GROUPS.values(),
    LakeWaterObjectSettings,
    *calibration_properties.CLASSES,
    LakeWaterSceneSettings,
)


def place_of(name: str, scene: bpy.types.Scene, obj: bpy.types.Object) -> tuple[bpy.types.PropertyGroup, str]:
    """The group that holds a parameter of `core.parameters`, and its name in it. obj: a water object."""
    if name in parameters.SCENE:
        return scene.lake_water, name
    own = parameters.OWN.get(name)
    if own is None:
        return obj.lake_water, name
    return getattr(obj.lake_water, own.technique.lower()), own.field


def register() -> None:
    """Add the settings to Blender's types.

    Raises RuntimeError when another copy of the extension is enabled: two would share names and settings.
    """
    if hasattr(bpy.types.Object, "lake_water") or hasattr(bpy.types.Scene, "lake_water"):
        raise RuntimeError("Another copy of Lake Water is already enabled: disable it first")
    register_classes(CLASSES)
    bpy.types.Object.lake_water = PointerProperty(
        type=LakeWaterObjectSettings, name="Lake Water", **OVERRIDABLE
    )
    bpy.types.Scene.lake_water = PointerProperty(type=LakeWaterSceneSettings, name="Lake Water")


def unregister() -> None:
    """Take the settings away again; files keep the values."""
    del bpy.types.Scene.lake_water
    del bpy.types.Object.lake_water
    unregister_classes(CLASSES)
