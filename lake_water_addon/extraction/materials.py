# SPDX-License-Identifier: GPL-3.0-or-later
"""The diffuse part of Blender materials: what a Principled or Diffuse BSDF is coloured and cut out by.

What the renderer cannot follow is replaced by what comes closest, with a note that says so.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field

import bpy
import numpy as np

from ..core.snapshot import Material
from .nodes import Source, source_of

DEFAULT_BASE_COLOR = (0.8, 0.8, 0.8)  # Blender's for faces without a material
DEFAULT_ALPHA_THRESHOLD = 0.5
SUPPORTED_BLENDS = {"MIX", "MULTIPLY", "ADD"}  # of two constants
COLOR_ADJUSTMENTS = {"HUE_SAT", "BRIGHTCONTRAST", "GAMMA", "CURVE_RGB", "INVERT"}


@dataclass(frozen=True, eq=False)
class ReadMaterial:
    """A material and what it needs of the meshes that it is on.

    uv_name, color_name: UV map and colour attribute, "" for the mesh's default, None for none.
    """

    material: Material
    uv_name: str | None = None
    color_name: str | None = None
    notes: tuple[str, ...] = ()


@dataclass
class _Color:
    """A colour socket's meaning: an image, a colour attribute or a constant (None: not known)."""

    constant: np.ndarray | None = None
    image: Source | None = None
    attribute: str | None = None


@dataclass
class _Reader:
    name: str
    notes: list[str] = field(default_factory=list)

    def note(self, text: str) -> None:
        self.notes.append(f'Material "{self.name}": {text}')

    def color(self, source: Source) -> _Color:
        node = source.node
        if node is None:
            return _Color(constant=_rgb(source.value))
        kind = node.type
        if kind == "RGB":
            return _Color(constant=_rgb(source.output.default_value))
        if kind == "VALUE":
            return _Color(constant=np.full(3, source.output.default_value, dtype=np.float64))
        if kind == "TEX_IMAGE" and source.output.identifier == "Color":
            return _Color(image=source)
        if kind == "VERTEX_COLOR" and source.output.identifier == "Color":
            return _Color(attribute=node.layer_name)
        if kind == "ATTRIBUTE" and node.attribute_type == "GEOMETRY" and source.output.identifier == "Color":
            return _Color(attribute=node.attribute_name)
        if kind == "MIX" and node.data_type == "RGBA":
            return self._mix(source)
        if kind in COLOR_ADJUSTMENTS:
            self.note(f'"{node.bl_label}" is ignored')
            return self.color(source.input("Color"))
        if kind == "VALTORGB":
            self.note("the middle of the color ramp is taken")
            return _Color(constant=_rgb(node.color_ramp.evaluate(0.5)))
        return _Color()

    def _mix(self, source: Source) -> _Color:
        node = source.node
        factor_socket = "Factor_Float" if node.factor_mode == "UNIFORM" else "Factor_Vector"
        factor_source = source.input(factor_socket)
        a = self.color(source.input("A_Color"))
        b = self.color(source.input("B_Color"))
        factor = None
        if factor_source.node is None:
            factor = np.asarray(factor_source.value, dtype=np.float64) * np.ones(3)
            if node.clamp_factor:
                factor = np.clip(factor, 0.0, 1.0)
        if factor is not None and (factor == 0.0).all():
            return a
        if factor is not None and (factor == 1.0).all() and node.blend_type == "MIX":
            return b
        if a.constant is not None and b.constant is not None and node.blend_type in SUPPORTED_BLENDS:
            if factor is None:
                self.note("a textured mix factor is taken as one half")
                factor = np.full(3, 0.5)
            blended = {"MIX": b.constant, "MULTIPLY": a.constant * b.constant, "ADD": a.constant + b.constant}
            return _Color(constant=(1.0 - factor) * a.constant + factor * blended[node.blend_type])
        b_prevails = factor is not None and node.blend_type == "MIX" and factor[0] > 0.5
        first, second = (b, a) if b_prevails else (a, b)
        chosen = next((c for c in (first, second) if c.image or c.attribute is not None), None)
        chosen = chosen or (first if first.constant is not None else second)
        self.note("of mixed base colors only one is taken")
        return chosen

    def alpha_threshold(self, source: Source, image_node: bpy.types.Node | None) -> float | None:
        """The alpha below which the base colour's image is cut out, from the source of an alpha value."""
        found = self._alpha_test(source)
        if found is None:
            if source.node is not None:
                self.note("this kind of transparency is not supported, drawn opaque")
            elif float(source.value) < 1.0:
                self.note("is partly transparent, drawn opaque")
            return None
        node, threshold, keeps_above = found
        if not keeps_above:
            self.note("keeps what the image makes transparent, which is not supported, drawn opaque")
            return None
        if image_node is None or node.image != image_node.image:
            self.note("is cut out by another image than that of its base color, drawn opaque")
            return None
        return threshold

    def _alpha_test(self, source: Source) -> tuple[bpy.types.Node, float, bool] | None:
        """(image node, threshold, keeps alpha above it) of an alpha value; None if it is no alpha test."""
        node = source.node
        if node is None:
            return None
        if node.type == "TEX_IMAGE" and source.output.identifier == "Alpha":
            return node, DEFAULT_ALPHA_THRESHOLD, True
        if node.type != "MATH":
            return None
        first = source.input("Value")
        if node.operation == "ROUND":
            return self._alpha_test(first)
        if node.operation not in {"GREATER_THAN", "LESS_THAN", "SUBTRACT"}:
            return None
        second = source.input("Value_001")
        if node.operation == "SUBTRACT":  # 1 - test
            inner = self._alpha_test(second) if first.node is None and first.value == 1.0 else None
            return None if inner is None else (inner[0], inner[1], not inner[2])
        tested, limit, above = first, second, node.operation == "GREATER_THAN"
        if first.node is None:
            tested, limit, above = second, first, not above
        inner = self._alpha_test(tested) if limit.node is None else None
        return None if inner is None else (inner[0], float(limit.value), above)

    def uv_name(self, source: Source) -> str | None:
        """The UV map that an image is looked up through, from the image node's source; None if by none."""
        vector = source.input("Vector")
        while vector.node is not None and vector.node.type == "MAPPING":
            if not _is_identity(vector):
                self.note("the Mapping of its image is ignored")
            vector = vector.input("Vector")
        node = vector.node
        if node is None:
            return ""
        if node.type == "UVMAP":
            return node.uv_map
        if node.type == "TEX_COORD" and vector.output.identifier == "UV":
            return ""
        if node.type == "ATTRIBUTE" and node.attribute_type == "GEOMETRY":
            return node.attribute_name
        return None

    def shader(self, source: Source) -> tuple[Source, Source | None] | None:
        """The BSDF that gives the colour, and the source of its alpha; None if there is none."""
        node = source.node
        if node is None:
            return None
        if node.type == "BSDF_PRINCIPLED":
            return source.input("Base Color"), source.input("Alpha")
        if node.type == "BSDF_DIFFUSE":
            return source.input("Color"), None
        if node.type == "MIX_SHADER":
            factor = source.input("Fac")
            first, second = source.input("Shader"), source.input("Shader_001")
            if _is_transparent(first):
                found = self.shader(second)
                return None if found is None else (found[0], factor)
            if _is_transparent(second):
                found = self.shader(first)
                if found is not None:
                    self.note("transparency as the second shader of a mix is not supported, drawn opaque")
                return found
            if factor.node is None and factor.value > 0.5:
                first, second = second, first
            self.note("of mixed shaders only one is taken")
            return self.shader(first) or self.shader(second)
        if node.type == "ADD_SHADER":
            self.note("of added shaders only one is taken")
            return self.shader(source.input("Shader")) or self.shader(source.input("Shader_001"))
        return None


def default_material() -> Material:
    """What faces without a material are drawn with."""
    return Material(key=("material", 0), base_color=np.array(DEFAULT_BASE_COLOR))


def read_material(material: bpy.types.Material, key: Hashable) -> ReadMaterial:
    """Read an evaluated material.

    Base colour: a constant, an image through a UV map, or a colour attribute, from the
    Principled or Diffuse BSDF of the material output; else the material's viewport colour.
    """
    reader = _Reader(material.name)
    fallback = _rgb(material.diffuse_color)
    cull = material.use_backface_culling
    tree = material.node_tree
    output = tree.get_output_node("ALL") if tree is not None else None
    if output is None:
        if tree is not None:
            reader.note("has no material output, its viewport color is taken")
        return ReadMaterial(Material(key, fallback, cull_back_faces=cull), notes=tuple(reader.notes))
    found = reader.shader(source_of(output.inputs["Surface"]))
    if found is None:
        reader.note("has no Principled or Diffuse BSDF, its viewport color is taken")
        return ReadMaterial(Material(key, fallback, cull_back_faces=cull), notes=tuple(reader.notes))
    color_source, alpha_source = found
    color = reader.color(color_source)
    image_node = uv_name = threshold = None
    if color.image is not None:
        uv_name = reader.uv_name(color.image)
        problem = image_problem(color.image.node.image)
        if uv_name is None:
            problem = "is not looked up through a UV map"
        if problem is None:
            image_node = color.image.node
        else:
            uv_name = None
            reader.note(f"its base color's image {problem}, its viewport color is taken")
    elif color.constant is None and color.attribute is None:
        reader.note(
            f'its base color comes from "{color_source.node.bl_label}", which is not supported; '
            "its viewport color is taken"
        )
    if alpha_source is not None:
        threshold = reader.alpha_threshold(alpha_source, image_node)
    return ReadMaterial(
        Material(
            key=key,
            base_color=color.constant if color.constant is not None else fallback,
            image=image_node.image.name if image_node is not None else None,
            use_color_attribute=color.attribute is not None,
            alpha_threshold=threshold,
            cull_back_faces=cull,
        ),
        uv_name=uv_name,
        color_name=color.attribute,
        notes=tuple(reader.notes),
    )


def image_problem(image: bpy.types.Image | None) -> str | None:
    """Why an image cannot be used, to follow "the image ...", or None. Loads the file if need be."""
    if image is None:
        return "is not chosen"
    if image.source not in {"FILE", "GENERATED"}:
        return f'"{image.name}" is of the kind {image.source.lower()}, which is not supported'
    if 0 in image.size:
        return f'"{image.name}" has no pixels (file missing?: {image.filepath})'
    return None


def same_material(a: Material, b: Material) -> bool:
    """Whether two materials have the same content."""
    return (
        a.key == b.key
        and np.array_equal(a.base_color, b.base_color)
        and (a.image, a.use_color_attribute, a.alpha_threshold, a.cull_back_faces)
        == (b.image, b.use_color_attribute, b.alpha_threshold, b.cull_back_faces)
    )


def _rgb(value: object) -> np.ndarray:
    return np.array(value[:3], dtype=np.float64) if hasattr(value, "__len__") else np.full(3, float(value))


def _is_transparent(source: Source) -> bool:
    return source.node is not None and source.node.type == "BSDF_TRANSPARENT"


def _is_identity(source: Source) -> bool:
    expected = {"Location": (0.0, 0.0, 0.0), "Rotation": (0.0, 0.0, 0.0), "Scale": (1.0, 1.0, 1.0)}
    for name, value in expected.items():
        if name not in {s.identifier for s in source.node.inputs}:  # Location is absent for some types
            continue
        given = source.input(name)
        if given.node is not None or tuple(given.value) != value:
            return False
    return True
