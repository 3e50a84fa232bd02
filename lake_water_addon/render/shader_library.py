# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the GLSL of `gpu_shaders/`, expands its includes and keeps what is compiled.

A shader is described by a `ShaderSpec` beside the pass that uses it; `defines` give its
variants. Compiled on first use, never at import.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from gpu.types import GPUShader, GPUShaderCreateInfo, GPUStageInterfaceInfo

from .resources import Resources

SHADER_FOLDER = Path(__file__).resolve().parent.parent / "gpu_shaders"

_INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+(?:"([^"]+)"|(\w+))[ \t]*$', re.MULTILINE)
_CONDITION = re.compile(r"^[ \t]*#[ \t]*(ifdef|ifndef|else|endif)\b[ \t]*(\w*)")


class ShaderError(RuntimeError):
    """A shader file that is missing, or that the driver refuses."""


@dataclass(frozen=True)
class ShaderSpec:
    """What a shader takes and gives. Types are those of `GPUShaderCreateInfo`.

    Either vertex and fragment are files, or compute is one: then group is the size of its work groups.
    uniform_buffers: (struct type of uniforms_lib.glsl, name); samplers: (type, name); images, read and
    written: (format, type, name).
    """

    name: str
    vertex: str = ""
    fragment: str = ""
    compute: str = ""
    group: tuple[int, int] = (1, 1)
    vertex_in: tuple[tuple[str, str], ...] = ()
    varyings: tuple[tuple[str, str], ...] = ()
    outputs: tuple[tuple[str, str], ...] = (("VEC4", "out_color"),)
    uniform_buffers: tuple[tuple[str, str], ...] = ()
    samplers: tuple[tuple[str, str], ...] = ()
    images: tuple[tuple[str, str, str], ...] = ()
    push_constants: tuple[tuple[str, str], ...] = ()


def read_source(name: str, defines: dict[str, str] | None = None, folder: Path = SHADER_FOLDER) -> str:
    """The file's text with every `#include` replaced by its file, each file once.

    An include that is a name and not a string is looked up in `defines`. Includes inside an
    #ifdef whose name is not defined are left out, so that variants do not drag in what they
    don't declare. Raises ShaderError for a file that is missing.
    """
    return _expand(name, defines or {}, folder, set(), ())


def _expand(name: str, defines: dict[str, str], folder: Path, seen: set[str], chain: tuple[str, ...]) -> str:
    path = folder / name
    if not path.is_file():
        raise ShaderError(
            f"shader file {name} is missing{' (included by ' + chain[-1] + ')' if chain else ''}"
        )
    seen.add(name)
    lines = []
    active: list[bool] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if condition := _CONDITION.match(line):
            word, symbol = condition.groups()
            if word in ("ifdef", "ifndef"):
                active.append((symbol in defines) == (word == "ifdef"))
            elif word == "else":
                active[-1] = not active[-1]
            else:
                active.pop()
        include = _INCLUDE.match(line)
        if include is None:
            lines.append(line)
            continue
        if not all(active):
            continue
        quoted, symbol = include.groups()
        target = quoted or defines.get(symbol, "").strip('"')
        if not target:
            raise ShaderError(f"{name} includes {symbol}, which this variant does not define")
        if target not in seen:
            lines.append(_expand(target, defines, folder, seen, (*chain, name)))
    return "\n".join(lines) + "\n"


class ShaderLibrary:
    """Compiled shaders by spec and variant."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._shaders: dict[tuple[str, tuple[tuple[str, str], ...]], GPUShader] = {}

    def get(self, spec: ShaderSpec, defines: dict[str, str] | None = None) -> GPUShader:
        """The compiled variant. Raises ShaderError when the driver refuses it (its log is on stderr)."""
        defines = defines or {}
        key = (spec.name, tuple(sorted(defines.items())))
        if key not in self._shaders:
            self._shaders[key] = self._compile(spec, defines)
        return self._shaders[key]

    def _compile(self, spec: ShaderSpec, defines: dict[str, str]) -> GPUShader:
        info = GPUShaderCreateInfo()
        for symbol, value in defines.items():
            if not value.endswith(".glsl"):
                info.define(symbol, value)
        if spec.uniform_buffers:
            info.typedef_source(read_source("uniforms_lib.glsl"))
        for slot, (struct, name) in enumerate(spec.uniform_buffers):
            info.uniform_buf(slot, struct, name)
        for slot, (kind, name) in enumerate(spec.samplers):
            info.sampler(slot, kind, name)
        for slot, (pixel_format, kind, name) in enumerate(spec.images):
            info.image(slot, pixel_format, kind, name, qualifiers={"READ", "WRITE"})
        for kind, name in spec.push_constants:
            info.push_constant(kind, name)
        if spec.compute:
            info.local_group_size(*spec.group)
            info.compute_source(read_source(spec.compute, defines))
        else:
            self._describe_drawing(info, spec, defines)
        try:
            return self._resources.shader(info)
        except Exception as error:
            variant = ", ".join(defines) or "no defines"
            raise ShaderError(
                f"the graphics driver refused the shader {spec.name} ({variant}): {error}"
            ) from error

    @staticmethod
    def _describe_drawing(info: GPUShaderCreateInfo, spec: ShaderSpec, defines: dict[str, str]) -> None:
        for slot, (kind, name) in enumerate(spec.vertex_in):
            info.vertex_in(slot, kind, name)
        if spec.varyings:
            interface = GPUStageInterfaceInfo(f"lake_water_{spec.name}")
            for kind, name in spec.varyings:
                interface.smooth(kind, name)
            info.vertex_out(interface)
        for slot, (kind, name) in enumerate(spec.outputs):
            info.fragment_out(slot, kind, name)
        info.vertex_source(read_source(spec.vertex, defines))
        info.fragment_source(read_source(spec.fragment, defines))
