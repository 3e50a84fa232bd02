# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs functions of `gpu_shaders/*.glsl` on arrays of inputs, to hold them against `core/`.

The libraries are the files that the add-on itself compiles, read by its own loader. Inputs come from an
RGBA32F texture, one column a case, and results go to an RGBA32F image: nothing is rounded but by the GLSL.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

COLUMNS = 1024
"""Cases in a row of the textures."""

_COMPONENTS = {"bool": 1, "int": 1, "float": 1, "vec2": 2, "vec3": 3, "vec4": 4, "mat4": 16}
_SWIZZLE = {"float": "x", "vec2": "xy", "vec3": "xyz", "vec4": "xyzw"}


def single(values) -> np.ndarray:
    """float64 values that float32 holds exactly: what the GPU gets and what the twin must get, too."""
    return np.asarray(values, dtype=np.float32).astype(np.float64)


def evaluate(
    sources: Sequence[str],
    results: Mapping[str, tuple[str, str]],
    *,
    statements: str = "",
    prelude: str = "",
    defines: Mapping[str, str] | None = None,
    uniform_buffers: Mapping[str, tuple[str, object]] | None = None,
    samplers: Mapping[str, tuple[str, object]] | None = None,
    constants: Mapping[str, tuple[str, Sequence[float]]] | None = None,
    **inputs: np.ndarray,
) -> dict[str, np.ndarray]:
    """Evaluate GLSL expressions over the inputs; every result (n,) or (n, components), float32.

    sources: files of gpu_shaders/. results: name -> (type, expression). statements: GLSL that runs before,
    prelude: GLSL outside main, before the sources. inputs: (n,) float, (n, 2..4) vectors or (n, 4, 4)
    matrices, under the names that the expressions use. uniform_buffers: name -> (struct, buffer);
    samplers: name -> (type, texture); constants: name -> (type, values).
    """
    import gpu
    from gpu.types import Buffer, GPUShaderCreateInfo, GPUTexture

    from lake_water_addon.render.resources import Resources
    from lake_water_addon.render.shader_library import read_source

    count = len(next(iter(inputs.values())))
    rows = -(-count // COLUMNS)
    texels, reads = [], []
    for name, given in inputs.items():
        values = np.asarray(given, dtype=np.float32)
        if values.ndim == 3:
            kind, columns = "mat4", values.transpose(0, 2, 1).reshape(count, 4, 4)
            slots = range(len(texels), len(texels) + 4)
            texels += [columns[:, i] for i in range(4)]
            reads.append(f"mat4 {name} = mat4({', '.join(f'lw_input({s})' for s in slots)});")
            continue
        components = values.size // count
        kind = {1: "float", 2: "vec2", 3: "vec3", 4: "vec4"}[components]
        padded = np.zeros((count, 4), np.float32)
        padded[:, :components] = values.reshape(count, components)
        reads.append(f"{kind} {name} = lw_input({len(texels)}).{_SWIZZLE[kind]};")
        texels.append(padded)

    data = np.zeros((len(texels), rows * COLUMNS, 4), np.float32)
    for slot, texel in enumerate(texels):
        data[slot, :count] = texel
    # Row r of slot s lies at y = s * rows + r.
    flat = np.ascontiguousarray(data.ravel())
    source_texture = GPUTexture(
        (COLUMNS, len(texels) * rows), format="RGBA32F", data=Buffer("FLOAT", flat.size, flat)
    )
    out = GPUTexture((COLUMNS, len(results) * rows), format="RGBA32F")

    info = GPUShaderCreateInfo()
    for symbol, value in (defines or {}).items():
        if not value.endswith(".glsl"):
            info.define(symbol, value)
    info.typedef_source(read_source("uniforms_lib.glsl"))
    for slot, (name, (struct, _)) in enumerate((uniform_buffers or {}).items()):
        info.uniform_buf(slot, struct, name)
    info.sampler(0, "FLOAT_2D", "lw_inputs")
    for slot, (name, (kind, _)) in enumerate((samplers or {}).items(), start=1):
        info.sampler(slot, kind, name)
    for name, (kind, _) in (constants or {}).items():
        info.push_constant(kind, name)
    info.image(0, "RGBA32F", "FLOAT_2D", "lw_results", qualifiers={"WRITE"})
    info.local_group_size(64, 1, 1)
    stores = []
    for slot, (kind, expression) in enumerate(results.values()):
        value = {
            "float": f"vec4({expression}, 0.0, 0.0, 0.0)",
            "bool": f"vec4({expression} ? 1.0 : 0.0, 0.0, 0.0, 0.0)",
            "vec2": f"vec4({expression}, 0.0, 0.0)",
            "vec3": f"vec4({expression}, 0.0)",
            "vec4": expression,
        }[kind]
        stores.append(f"imageStore(lw_results, lw_at + ivec2(0, {slot * rows}), {value});")
    newline = "\n"
    info.compute_source(
        f"""{prelude}
{"".join(read_source(name, dict(defines or {})) for name in sources)}
ivec2 lw_at;
vec4 lw_input(int slot) {{ return texelFetch(lw_inputs, lw_at + ivec2(0, slot * {rows}), 0); }}
void main()
{{
  lw_at = ivec2(gl_GlobalInvocationID.xy);
{newline.join(reads)}
{statements}
{newline.join(stores)}
}}
"""
    )
    shader = Resources().shader(info)
    shader.bind()
    for name, (_, buffer) in (uniform_buffers or {}).items():
        shader.uniform_block(name, buffer)
    shader.uniform_sampler("lw_inputs", source_texture)
    for name, (_, texture) in (samplers or {}).items():
        shader.uniform_sampler(name, texture)
    for name, (kind, values) in (constants or {}).items():
        (shader.uniform_int if kind == "INT" else shader.uniform_float)(name, values)
    shader.image("lw_results", out)
    gpu.compute.dispatch(shader, COLUMNS // 64, rows, 1)
    gpu.shader.unbind()  # it is freed on return, and Blender crashes over one that is still bound
    pixels = np.asarray(out.read(), dtype=np.float32).reshape(len(results), rows * COLUMNS, 4)
    answer = {}
    for slot, (name, (kind, _)) in enumerate(results.items()):
        answer[name] = pixels[slot, :count, : _COMPONENTS[kind]]
        if _COMPONENTS[kind] == 1:
            answer[name] = answer[name][:, 0]
    return answer


def data_texture(values: np.ndarray, *, smooth: bool = False, pixel_format: str | None = None):
    """A texture of (h, w) or (h, w, 4) values, rows from the bottom, edges repeated."""
    from gpu.types import Buffer, GPUTexture

    values = np.ascontiguousarray(values, dtype=np.float32)
    pixel_format = pixel_format or ("R32F" if values.ndim == 2 else "RGBA32F")
    texture = GPUTexture(
        (values.shape[1], values.shape[0]),
        format=pixel_format,
        data=Buffer("FLOAT", values.size, values.ravel()),
    )
    texture.filter_mode(smooth)
    texture.extend_mode("EXTEND")
    return texture


def read_texture(texture) -> np.ndarray:
    """(h, w, channels) float32, rows from the bottom."""
    return np.asarray(texture.read(), dtype=np.float32).reshape(texture.height, texture.width, -1)
