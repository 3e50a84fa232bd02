# SPDX-License-Identifier: GPL-3.0-or-later
"""The shader node groups: *Lake Water*, and what gives it the waves' normal for every pixel.

In Cycles the water is a volume below the surface. Along a ray, absorption k and emission j give
L(d) = C exp(-k d) + j/k (1 - exp(-k d)); with j = k water_color that is the model's
C' = water_color + exp(-k d) (C - water_color), exactly, and for any k: Cycles integrates a
homogeneous volume without scattering in closed form. The camera may be under water too.

Light on its way down meets the surface as a shadow ray or a diffuse ray that comes from the bottom
along a straight line. There the surface is transparent, weakened by (1 - F) exp(-k d) over the path
that light refracted at the flat surface would take, d = depth / cos of the refracted angle: what
LAKE_WATER takes without caustics. The volume leaves these rays alone, or it would count them twice.

EEVEE has no volume behind a surface. There d is found by a ray cast through the depth buffer along
the refracted direction, which is what its refraction looks up too. Where that leaves the picture, the
surface is looked through straight on. Its sunlight is not weakened on the way down, and with the
camera under water it shows the surface, attenuated over the way to it, but no fog on anything else.
"""

from __future__ import annotations

from .trees import GroupSpec, Socket, Tree, Value

MIN_COSINE = 1e-3  # as core.optics.MIN_COSINE
FAR = 1000.0  # m, length of EEVEE's rays
TOTAL = 0.9999  # exact reflectance above this is total reflection

LAKE_WATER_SOCKETS = (
    Socket("Cycles Surface", "NodeSocketShader", output=True),
    Socket("Cycles Volume", "NodeSocketShader", output=True),
    Socket("EEVEE Surface", "NodeSocketShader", output=True),
    Socket("EEVEE Thickness", "NodeSocketFloat", output=True),
    Socket(
        "k",
        "NodeSocketFloat",
        options={"description": "Attenuation constant (1/m)", "default_value": 0.5, "min_value": 0.0},
    ),
    Socket(
        "q",
        "NodeSocketFloat",
        options={
            "description": "Exponent of the thesis's Fresnel curve",
            "default_value": 5.0,
            "min_value": 0.0,
        },
    ),
    Socket(
        "Index of Refraction",
        "NodeSocketFloat",
        options={"description": "Of the water against air", "default_value": 1.333, "min_value": 1.0},
    ),
    Socket(
        "Water Color",
        "NodeSocketColor",
        options={"description": "Color that deep water turns to", "default_value": (0.0, 0.2, 0.1, 1.0)},
    ),
    Socket(
        "Exact Fresnel",
        "NodeSocketBool",
        options={
            "description": "Reflectance of a dielectric by Fresnel's equations, instead of the curve with q",
            "default_value": False,
        },
    ),
    Socket(
        "Normal",
        "NodeSocketVector",
        options={
            "description": "Unit normal from the water to the air, world space; the mesh's own if unlinked",
            "hide_value": True,
        },
    ),
)


def _mix(t: Tree, factor: Value, first: Value, second: Value) -> Value:
    return t.node("ShaderNodeMixShader", factor, first, second)["Shader"]


def _add(t: Tree, first: Value, second: Value) -> Value:
    return t.node("ShaderNodeAddShader", first, second)["Shader"]


def _gray(t: Tree, value: Value) -> Value:
    return t.combine(value, value, value)


def _choose(t: Tree, condition: Value, no: Value | float, yes: Value | float) -> Value:
    """Scalar `yes` where the condition is 1, `no` where it is 0."""
    return t.node("ShaderNodeMix", condition, None, no, yes, data_type="FLOAT", clamp_factor=True)["Result"]


def _schlick(t: Tree, cosine: Value, f: Value, q: Value) -> Value:
    """F = f + (1 - f) (1 - cosine)^q: `core.optics.schlick`."""
    return f + (1.0 - f) * t.math("POWER", 1.0 - t.math("MINIMUM", cosine, 1.0), q)


def _build_lake_water(t: Tree) -> None:
    given = t.inputs()
    k, q, ior, color = given["k"], given["q"], given["Index of Refraction"], given["Water Color"]
    exact = given["Exact Fresnel"]
    geometry = t.node("ShaderNodeNewGeometry")
    path = t.node("ShaderNodeLightPath")
    below, to_eye = geometry["Backfacing"], geometry["Incoming"]

    # Blender turns the mesh's own normal towards the eye, and so must we with one that is given.
    has_normal = t.math("GREATER_THAN", given["Normal"].length(), 0.5)
    turned = given["Normal"] * (1.0 - 2.0 * below)
    facing = turned * has_normal + geometry["Normal"] * (1.0 - has_normal)
    lacking = t.math("MAXIMUM", MIN_COSINE - to_eye.dot(facing), 0.0)
    normal = (facing + to_eye * lacking).normalized()
    cosine = to_eye.dot(normal)

    f = t.math("POWER", (ior - 1.0) / (ior + 1.0), 2.0)
    curve = _schlick(t, cosine, f, q)
    fresnel = t.node("ShaderNodeFresnel", ior, normal)["Factor"]  # inverts the index where seen from below
    curve = t.math("MAXIMUM", curve, t.math("GREATER_THAN", fresnel, TOTAL))
    reflected = _choose(t, exact, curve, fresnel)

    mirror = t.node("ShaderNodeBsdfGlossy", (1.0, 1.0, 1.0), 0.0)
    t.plug(mirror.made.inputs["Normal"], normal)
    clear = t.node("ShaderNodeBsdfRefraction", (1.0, 1.0, 1.0), 0.0, ior, normal)
    seen = _mix(t, reflected, clear["BSDF"], mirror["BSDF"])

    # Light from the air on straight rays that start under water.
    light = t.math("MAXIMUM", path["Is Shadow Ray"], path["Is Diffuse Ray"])
    seen_from_air = _choose(t, below, ior, 1.0 / ior)  # the node inverts it once more
    lost = _choose(
        t, exact, _schlick(t, cosine, f, q), t.node("ShaderNodeFresnel", seen_from_air, normal)["Factor"]
    )
    straight = t.math("ABSOLUTE", to_eye.xyz()[2])
    refracted = t.math("SQRT", 1.0 - (1.0 - straight * straight) / (ior * ior))
    wet = below * path["Ray Length"] * straight / refracted
    passed = (1.0 - lost) * t.math("EXPONENT", -(k * wet))
    through = t.node("ShaderNodeBsdfTransparent", _gray(t, passed))
    surface = _mix(t, light, seen, through["BSDF"])

    dense = k * (1.0 - light)
    volume = t.node("ShaderNodeVolumeCoefficients")
    t.plug(volume.made.inputs["Absorption Coefficients"], _gray(t, dense))
    t.plug(volume.made.inputs["Scatter Coefficients"], 0.0)
    t.plug(volume.made.inputs["Emission Coefficients"], t.vector("MULTIPLY", color, dense))

    # EEVEE: from above over the ray in the water, from below over the way to the camera.
    into = t.vector("REFRACT", -to_eye, normal, scale=1.0 / ior)
    bent = t.node("ShaderNodeRaycast", geometry["Position"], into, FAR)
    unbent = t.node("ShaderNodeRaycast", geometry["Position"], -to_eye, FAR)
    bent_left = bent["Is Hit"] * t.math("EXPONENT", -(k * bent["Hit Distance"]))
    unbent_left = unbent["Is Hit"] * t.math("EXPONENT", -(k * unbent["Hit Distance"]))
    left_below = t.math("EXPONENT", -(k * t.node("ShaderNodeCameraData")["View Distance"]))
    bends = t.math("MAXIMUM", bent["Is Hit"], below)
    left = _choose(t, below, _choose(t, bends, unbent_left, bent_left), left_below)
    part_refracted = (1.0 - reflected) * left
    part_reflected = reflected * _choose(t, below, 1.0, left)
    part_water = (1.0 - left) * _choose(t, below, 1.0 - reflected, 1.0)
    refraction = t.node("ShaderNodeBsdfRefraction", _gray(t, part_refracted), 0.0)
    refraction.plug(None, None, _choose(t, bends, 1.0, ior), normal)
    reflection = t.node("ShaderNodeBsdfGlossy", _gray(t, part_reflected), 0.0)
    t.plug(reflection.made.inputs["Normal"], normal)
    glow = t.node("ShaderNodeEmission", color, part_water)
    drawn = _add(t, _add(t, refraction["BSDF"], reflection["BSDF"]), glow["Emission"])
    # Its shadow maps know no partial shadow without noise, and no distance: all light passes.
    clear_shadow = t.node("ShaderNodeBsdfTransparent", (1.0, 1.0, 1.0))
    eevee = _mix(t, path["Is Shadow Ray"], drawn, clear_shadow["BSDF"])
    # No thickness: refracted once, at this surface, and not a second time behind it.
    thickness = t.node("ShaderNodeValue", name="Thickness")
    thickness.made.outputs[0].default_value = 0.0
    t.outputs(surface, volume["Volume"], eevee, thickness["Value"])


def _build_wave(t: Tree) -> None:
    given = t.inputs()
    kx, ky, amplitude = given["Wave"].xyz()
    wave_vector = t.combine(kx, ky)
    angle = given["Position"].dot(wave_vector) + given["Phase"]
    t.outputs(given["Slope"] + wave_vector * (amplitude * t.math("COSINE", angle)))


def _build_normal(t: Tree) -> None:
    slope_x, slope_y, _ = t.inputs()["Slope"].xyz()
    turn = t.node(
        "ShaderNodeVectorTransform",
        (1.0, 0.0, 0.0),
        vector_type="VECTOR",
        convert_from="OBJECT",
        convert_to="WORLD",
    )
    heading = (turn["Vector"] * (1.0, 1.0, 0.0)).normalized()
    c, s, _ = heading.xyz()
    world = t.combine(s * slope_y - c * slope_x, -(s * slope_x) - c * slope_y, 1.0)
    t.outputs(world.normalized())


LAKE_WATER = GroupSpec("Lake Water", "ShaderNodeTree", 1, LAKE_WATER_SOCKETS, _build_lake_water)
WAVE_SLOPE = GroupSpec(
    "Sine Wave Slope",
    "ShaderNodeTree",
    1,
    (
        Socket("Slope", "NodeSocketVector", output=True),
        Socket("Slope", "NodeSocketVector", options={"description": "Of the waves before this one"}),
        Socket("Position", "NodeSocketVector", options={"description": "In the water frame (m)"}),
        Socket(
            "Wave",
            "NodeSocketVector",
            options={"description": "Wave vector x and y in the water frame (rad/m), amplitude (m)"},
        ),
        Socket(
            "Phase", "NodeSocketFloat", options={"description": "At the origin at the scene's time (rad)"}
        ),
    ),
    _build_wave,
)
WAVES_NORMAL = GroupSpec(
    "Sine Waves Normal",
    "ShaderNodeTree",
    1,
    (
        Socket("Normal", "NodeSocketVector", output=True),
        Socket("Slope", "NodeSocketVector", options={"description": "Of the surface, in the water frame"}),
    ),
    _build_normal,
)
