# SPDX-License-Identifier: GPL-3.0-or-later
"""The geometry node group *Sine Waves*: `core/waves.py` and `core/snapshot.py`'s water body as a mesh.

The group sums rows as `core.waves.pack` gives them, in the water frame: (kx, ky, amplitude) and
the phase at the scene's time. The phases are driven (see `drivers.py`): in float64, from the scene's
time, because a product of hours and a frequency has no digits left in the float32 of nodes.

It leaves attributes on the vertices. For the material: where they are in the water frame, in metres, and
the slope that the mesh itself has there. For `extraction/`: where the mesh's own vertices were before.
"""

from __future__ import annotations

from ..core.waves import MAX_WAVES
from .trees import GroupSpec, Socket, Tree, Value

FRAME_ATTRIBUTE = "lake_water_frame"
SLOPE_ATTRIBUTE = "lake_water_slope"
FLAT_ATTRIBUTE = "lake_water_flat"
MAX_TILT = 1e-3  # rad; as in extraction: more is ignored, and water lies flat
MIN_UP = 1e-3  # of the mesh's own normal, as in the vertex shader


def wave_socket(number: int) -> str:
    """Name of the input with wave vector and amplitude of wave 1, 2, …"""
    return f"Wave {number}"


def phase_socket(number: int) -> str:
    """Name of the input with the phase of wave 1, 2, …"""
    return f"Phase {number}"


def _sockets() -> list[Socket]:
    def driven(name: str, kind: str, description: str, **options: object) -> Socket:
        return Socket(name, kind, options={"description": description, "hide_in_modifier": True, **options})

    sockets = [
        Socket("Geometry", "NodeSocketGeometry", output=True),
        Socket(
            "Geometry", "NodeSocketGeometry", options={"description": "The flat surface around its origin"}
        ),
        Socket(
            "Grid",
            "NodeSocketBool",
            options={
                "description": "Make a grid over the bounds of the geometry, and do not use its vertices",
                "default_value": True,
            },
        ),
        Socket(
            "Resolution",
            "NodeSocketInt",
            options={
                "description": "Vertices along each side of the grid",
                "default_value": 49,
                "min_value": 2,
            },
        ),
        Socket("Material", "NodeSocketMaterial", options={"description": "Of all faces"}),
        driven("Waves", "NodeSocketInt", "How many of the waves count", min_value=0, max_value=MAX_WAVES),
    ]
    for number in range(1, MAX_WAVES + 1):
        sockets.append(
            driven(
                wave_socket(number),
                "NodeSocketVector",
                "Wave vector x and y in the water frame (rad/m), amplitude (m)",
            )
        )
        sockets.append(
            driven(phase_socket(number), "NodeSocketFloat", "Phase at the origin at the scene's time (rad)")
        )
    return sockets


def _build(t: Tree) -> None:
    given = t.inputs()
    frame = _WaterFrame(t)
    grid, grid_point = _grid(t, given, frame)
    position = t.node("GeometryNodeInputPosition")["Position"]
    mesh_point = frame.from_local(position)
    up = frame.normal_from_local(t.node("GeometryNodeInputNormal")["Normal"])
    up_x, up_y, up_z = up.xyz()
    turn = t.math("SIGN", up_z) / t.math("MAXIMUM", t.math("ABSOLUTE", up_z), MIN_UP)

    mesh = _store(t, given["Geometry"], FLAT_ATTRIBUTE, position)
    mesh = _store(t, mesh, SLOPE_ATTRIBUTE, t.combine(-(up_x * turn), -(up_y * turn)))
    # Faces that look down would have the water above them: Cycles asks on which side a ray is.
    downward = t.math("LESS_THAN", up_z, 0.0)
    flipped = t.node("GeometryNodeFlipFaces", mesh, downward)["Mesh"]

    flat = t.node("GeometryNodeSwitch", given["Grid"], flipped, grid, input_type="GEOMETRY")["Output"]
    point = t.node("GeometryNodeSwitch", given["Grid"], mesh_point, grid_point, input_type="VECTOR")["Output"]
    framed = _store(t, flat, FRAME_ATTRIBUTE, point)

    point = _attribute(t, FRAME_ATTRIBUTE)
    height, slope, highest = _sum(t, given, point)
    raised = frame.to_local(point + t.combine(0.0, 0.0, height))
    shape = t.node("GeometryNodeSetPosition", framed, None, raised)["Geometry"]
    smooth = t.node("GeometryNodeSetShadeSmooth", shape)["Mesh"]
    slope_x, slope_y, _ = (slope + _attribute(t, SLOPE_ATTRIBUTE)).xyz()
    normals = t.node("GeometryNodeSetMeshNormal", smooth, mode="FREE", domain="POINT")
    normal = frame.normal_to_local(t.combine(-slope_x, -slope_y, 1.0))
    t.plug(normals.made.inputs["Custom Normal"], normal)
    surface = t.node("GeometryNodeSetMaterial", normals["Mesh"], None, given["Material"])["Geometry"]
    t.outputs(_with_camera_inside(t, surface, frame, highest))


def _store(t: Tree, geometry: Value, name: str, value: Value) -> Value:
    """The geometry with a vector attribute of its vertices."""
    node = t.node("GeometryNodeStoreNamedAttribute", data_type="FLOAT_VECTOR", domain="POINT")
    node.plug(geometry, None, name, value)
    return node["Geometry"]


def _attribute(t: Tree, name: str) -> Value:
    """A vector attribute of the vertices, 0 where there is none."""
    return t.node("GeometryNodeInputNamedAttribute", name, data_type="FLOAT_VECTOR")["Attribute"]


class _WaterFrame:
    """From the object's space to the water frame and back: `extraction.waters` with nodes.

    The water frame has the object's origin and heading, in metres. x, y, z: columns of the linear part of
    the object's matrix; flat_x, flat_y, flat_z: the same without a tilt.
    """

    def __init__(self, t: Tree) -> None:
        self.t = t
        me = t.node("GeometryNodeSelfObject")["Self Object"]
        info = t.node("GeometryNodeObjectInfo", me, transform_space="ORIGINAL")
        matrix = info["Transform"]
        self._origin = info["Location"]
        cells = t.node("FunctionNodeSeparateMatrix", matrix)
        self.x, self.y, self.z = (
            t.combine(*(cells[f"Column {column} Row {row}"] for row in (1, 2, 3))) for column in (1, 2, 3)
        )
        self._inverse = t.node("FunctionNodeInvertMatrix", matrix)["Matrix"]
        self.ahead = (self.x * (1.0, 1.0, 0.0)).normalized()  # the frame's x axis in world axes
        self.left = t.combine(0.0, 0.0, 1.0).cross(self.ahead)
        across = self.x.cross(self.y)
        tilt = (across * (1.0, 1.0, 0.0)).length() / across.length()
        tilted = t.math("GREATER_THAN", tilt, MAX_TILT)

        def level(column: Value, flat: Value) -> Value:
            node = t.node("GeometryNodeSwitch", tilted, input_type="VECTOR")
            node.plug(None, column, flat * column.length())
            return node["Output"]

        self.flat_x = level(self.x, self.ahead)
        self.flat_y = level(self.y, self.left)
        self.flat_z = level(self.z, t.combine(0.0, 0.0, 1.0))

    def _turned_in(self, world: Value) -> Value:
        """A vector in world axes, in those of the frame."""
        return self.t.combine(world.dot(self.ahead), world.dot(self.left), world.xyz()[2])

    def _turned_out(self, framed: Value) -> Value:
        """A vector in the axes of the frame, in those of the world."""
        x, y, z = framed.xyz()
        return self.ahead * x + self.left * y + self.t.combine(0.0, 0.0, z)

    def from_world(self, world: Value) -> Value:
        """A point of the world in the water frame."""
        return self._turned_in(world - self._origin)

    def from_local(self, local: Value) -> Value:
        """A point of the object's space in the water frame."""
        x, y, z = local.xyz()
        return self._turned_in(self.flat_x * x + self.flat_y * y + self.flat_z * z)

    def to_local(self, framed: Value) -> Value:
        """A point of the water frame in the object's space."""
        node = self.t.node("FunctionNodeTransformDirection", self._turned_out(framed), self._inverse)
        return node["Direction"]

    def normal_from_local(self, local: Value) -> Value:
        """A normal of the object's space in the water frame: by the cofactors. Its length is not kept."""
        x, y, z = local.xyz()
        a, b, c = self.flat_x, self.flat_y, self.flat_z
        return self._turned_in(b.cross(c) * x + c.cross(a) * y + a.cross(b) * z).normalized()

    def normal_to_local(self, framed: Value) -> Value:
        """A normal of the water frame in the object's space: by the transposed matrix. Unit."""
        world = self._turned_out(framed)
        return self.t.combine(world.dot(self.x), world.dot(self.y), world.dot(self.z)).normalized()


def _with_camera_inside(t: Tree, surface: Value, frame: _WaterFrame, highest: Value) -> Value:
    """The surface, with a loose vertex below the scene's camera while that is under water.

    Cycles looks for volumes around the camera only where an object's bounds reach it.
    """
    camera = t.node("GeometryNodeInputActiveCamera")["Active Camera"]
    info = t.node("GeometryNodeObjectInfo", camera, transform_space="ORIGINAL")
    place = frame.from_world(info["Location"])
    exists = t.math("GREATER_THAN", info["Scale"].length(), 0.0)
    under = exists * t.math("LESS_THAN", place.xyz()[2], highest)
    vertex = t.node("GeometryNodeMeshLine", 1, None, frame.to_local(place - (0.0, 0.0, 1.0)))["Mesh"]
    join = t.node("GeometryNodeJoinGeometry")
    for part in (vertex, surface):
        t.plug(join.made.inputs[0], part)
    node = t.node("GeometryNodeSwitch", under, surface, join["Geometry"], input_type="GEOMETRY")
    return node["Output"]


def _grid(t: Tree, given, frame: _WaterFrame) -> tuple[Value, Value]:
    """`WaterBody.grid` as a mesh, and where its vertices are in the water frame."""
    box = t.node("GeometryNodeBoundBox", given["Geometry"])
    (x0, y0, _), (x1, y1, _) = box["Min"].xyz(), box["Max"].xyz()
    lows, highs = [], []
    for axis in (frame.ahead, frame.left):
        along_x, along_y = frame.flat_x.dot(axis), frame.flat_y.dot(axis)
        ends = [(along_x * x0, along_x * x1), (along_y * y0, along_y * y1)]
        lows.append(t.math("MINIMUM", *ends[0]) + t.math("MINIMUM", *ends[1]))
        highs.append(t.math("MAXIMUM", *ends[0]) + t.math("MAXIMUM", *ends[1]))
    size = [high - low for low, high in zip(lows, highs, strict=True)]
    center = [0.5 * (high + low) for low, high in zip(lows, highs, strict=True)]
    count = given["Resolution"]
    mesh = t.node("GeometryNodeMeshGrid", *size, count, count)["Mesh"]
    return mesh, t.node("GeometryNodeInputPosition")["Position"] + t.combine(*center)


def _sum(t: Tree, given, point: Value) -> tuple[Value, Value, Value]:
    """h = sum a sin(kx x + ky y + phase), its gradient and its bound: as in `core.waves`."""
    first = t.node("GeometryNodeRepeatInput")
    last = t.node("GeometryNodeRepeatOutput")
    first.made.pair_with_output(last.made)
    last.made.repeat_items.clear()
    last.made.repeat_items.new("FLOAT", "Height")
    last.made.repeat_items.new("VECTOR", "Slope")
    last.made.repeat_items.new("FLOAT", "Highest")
    first.plug(given["Waves"])

    def chosen(kind: str, names: list[str]) -> Value:
        node = t.node("GeometryNodeIndexSwitch", data_type=kind)
        while len(node.made.index_switch_items) < len(names):
            node.made.index_switch_items.new()
        node.plug(first["Iteration"], *(given[name] for name in names))
        return node["Output"]

    numbers = range(1, MAX_WAVES + 1)
    kx, ky, amplitude = chosen("VECTOR", [wave_socket(n) for n in numbers]).xyz()
    wave_vector = t.combine(kx, ky)
    angle = point.dot(wave_vector) + chosen("FLOAT", [phase_socket(n) for n in numbers])
    height = first["Height"] + amplitude * t.math("SINE", angle)
    slope = first["Slope"] + wave_vector * (amplitude * t.math("COSINE", angle))
    last.plug(height, slope, first["Highest"] + t.math("ABSOLUTE", amplitude))
    return last["Height"], last["Slope"], last["Highest"]


SINE_WAVES = GroupSpec("Sine Waves", "GeometryNodeTree", 1, _sockets(), _build)
