# SPDX-License-Identifier: GPL-3.0-or-later
"""Building node trees in code: formulas as Python expressions, sockets kept, groups with a version."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import bpy

GROUP = "lake_water_group"
"""Custom property of a node group that this package built: what it is, whatever its name has become."""
VERSION = "lake_water_version"
"""Custom property with the version of the code that built a node group or a material."""


@dataclass(frozen=True)
class Socket:
    """One socket of a group's interface. options: properties of the interface socket."""

    name: str
    kind: str
    output: bool = False
    options: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class GroupSpec:
    """A node group as the code of today builds it. build: fills an empty tree that has the interface."""

    name: str
    tree_type: str
    version: int
    sockets: Sequence[Socket]
    build: Callable[[Tree], None]


def ensure_group(spec: GroupSpec) -> bpy.types.NodeTree:
    """The file's node group of this kind: the one there is, brought up to date, or a new one."""
    found = groups_of(spec)
    if not found:
        tree = bpy.data.node_groups.new(spec.name, spec.tree_type)
        tree[GROUP] = spec.name
        rebuild(tree, spec)
        return tree
    upgrade(spec)
    return found[0]


def groups_of(spec: GroupSpec) -> list[bpy.types.NodeTree]:
    """The file's own (not linked) node groups of this kind; an appended one may stand beside another."""
    return [
        tree
        for tree in bpy.data.node_groups
        if tree.library is None and tree.bl_idname == spec.tree_type and tree.get(GROUP) == spec.name
    ]


def upgrade(spec: GroupSpec) -> None:
    """Build older groups of this kind anew, in place; one of a newer version is left as it is."""
    for tree in groups_of(spec):
        if tree.get(VERSION, 0) < spec.version:
            rebuild(tree, spec)


def rebuild(tree: bpy.types.NodeTree, spec: GroupSpec) -> None:
    """Replace the nodes of a tree. Sockets of the same name and type stay, and with them users' links."""
    tree.nodes.clear()
    _set_interface(tree, spec.sockets)
    builder = Tree(tree)
    spec.build(builder)
    builder.arrange()
    tree[VERSION] = spec.version


def _set_interface(tree: bpy.types.NodeTree, sockets: Sequence[Socket]) -> None:
    interface = tree.interface
    old = {(item.name, item.in_out): item for item in interface.items_tree if item.item_type == "SOCKET"}
    for position, socket in enumerate(sockets):
        in_out = "OUTPUT" if socket.output else "INPUT"
        item = old.pop((socket.name, in_out), None)
        if item is not None and item.socket_type != socket.kind:
            interface.remove(item)
            item = None
        if item is None:
            item = interface.new_socket(socket.name, in_out=in_out, socket_type=socket.kind)
        for name, value in socket.options.items():
            setattr(item, name, value)
        interface.move(item, position)
    for item in old.values():
        interface.remove(item)


class Value:
    """The output of a node, for use in formulas. Scalars and vectors mix as in Blender's nodes."""

    def __init__(self, tree: Tree, socket: bpy.types.NodeSocket) -> None:
        self.tree = tree
        self.socket = socket

    @property
    def _is_vector(self) -> bool:
        return self.socket.type == "VECTOR"

    def _binary(self, operation: str, other: Value | float, *, swapped: bool = False) -> Value:
        vectors = self._is_vector or (isinstance(other, Value) and other._is_vector)
        call = self.tree.vector if vectors else self.tree.math
        return call(operation, other, self) if swapped else call(operation, self, other)

    def __add__(self, other: Value | float) -> Value:
        return self._binary("ADD", other)

    def __radd__(self, other: float) -> Value:
        return self._binary("ADD", other, swapped=True)

    def __sub__(self, other: Value | float) -> Value:
        return self._binary("SUBTRACT", other)

    def __rsub__(self, other: float) -> Value:
        return self._binary("SUBTRACT", other, swapped=True)

    def __mul__(self, other: Value | float) -> Value:
        return self._binary("MULTIPLY", other)

    __rmul__ = __mul__

    def __truediv__(self, other: Value | float) -> Value:
        return self._binary("DIVIDE", other)

    def __rtruediv__(self, other: float) -> Value:
        return self._binary("DIVIDE", other, swapped=True)

    def __pow__(self, other: Value | float) -> Value:
        return self._binary("POWER", other)

    def __neg__(self) -> Value:
        return self * -1.0

    def dot(self, other: Value | Sequence[float]) -> Value:
        """The scalar product."""
        return self.tree.vector("DOT_PRODUCT", self, other)

    def cross(self, other: Value | Sequence[float]) -> Value:
        """The vector product."""
        return self.tree.vector("CROSS_PRODUCT", self, other)

    def length(self) -> Value:
        """The length of a vector."""
        return self.tree.vector("LENGTH", self)

    def normalized(self) -> Value:
        """A vector of length 1 in the same direction."""
        return self.tree.vector("NORMALIZE", self)

    def xyz(self) -> tuple[Value, Value, Value]:
        """The components of a vector."""
        return self.tree.node("ShaderNodeSeparateXYZ", self).values()


class Tree:
    """A node tree that is being built."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree
        self._columns: dict[bpy.types.Node, int] = {}

    def node(self, kind: str, *inputs: object, name: str = "", **settings: object) -> Node:
        """A new node; settings are its properties, inputs go to its sockets in order (None: as it is)."""
        made = self.tree.nodes.new(kind)
        if name:
            made.name = made.label = name
        for key, value in settings.items():
            setattr(made, key, value)
        self._columns[made] = 0
        node = Node(self, made)
        for socket, value in zip(made.inputs, inputs, strict=False):
            self.plug(socket, value)
        return node

    def group(self, tree: bpy.types.NodeTree, *inputs: object, name: str = "") -> Node:
        """A node that uses another group."""
        kind = "GeometryNodeGroup" if tree.bl_idname == "GeometryNodeTree" else "ShaderNodeGroup"
        node = self.node(kind, name=name, node_tree=tree)
        node.plug(*inputs)
        return node

    def plug(self, socket: bpy.types.NodeSocket, value: object) -> None:
        """Link a Value to an input, or set the input."""
        if value is None:
            return
        if isinstance(value, Value):
            self.tree.links.new(value.socket, socket)
            column = self._columns.get(value.socket.node, 0) + 1
            self._columns[socket.node] = max(self._columns.get(socket.node, 0), column)
        elif isinstance(value, tuple) and socket.type == "RGBA":
            socket.default_value = (*value, 1.0)
        elif isinstance(value, int | float) and socket.type == "VECTOR":
            socket.default_value = (value,) * len(socket.default_value)
        else:
            socket.default_value = value

    def math(self, operation: str, *inputs: Value | float) -> Value:
        """A scalar operation of the Math node."""
        return self.node("ShaderNodeMath", *inputs, operation=operation)["Value"]

    def vector(self, operation: str, *inputs: Value | float | Sequence[float], scale: object = None) -> Value:
        """An operation of the Vector Math node. scale: its fourth input (REFRACT's ratio of indices)."""
        node = self.node("ShaderNodeVectorMath", *inputs, operation=operation)
        if scale is not None:
            self.plug(node.made.inputs["Scale"], scale)
        scalar = operation in {"DOT_PRODUCT", "LENGTH", "DISTANCE"}
        return node["Value" if scalar else "Vector"]

    def combine(self, x: Value | float, y: Value | float, z: Value | float = 0.0) -> Value:
        """A vector from its components."""
        return self.node("ShaderNodeCombineXYZ", x, y, z)["Vector"]

    def inputs(self) -> Node:
        """The group's inputs."""
        return self.node("NodeGroupInput")

    def outputs(self, *values: Value) -> None:
        """The group's outputs, in order."""
        self.node("NodeGroupOutput", *values)

    def arrange(self) -> None:
        """Place the nodes in columns, each to the right of what it was given."""
        rows: dict[int, float] = {}
        for node, column in self._columns.items():
            node.location = (220.0 * column, rows.get(column, 0.0))
            rows[column] = rows.get(column, 0.0) - 60.0 - 24.0 * (len(node.inputs) + len(node.outputs))


class Node:
    """A node that was made, with its outputs as Values by name."""

    def __init__(self, tree: Tree, made: bpy.types.Node) -> None:
        self.tree = tree
        self.made = made

    def __getitem__(self, name: str) -> Value:
        socket = next(s for s in self.made.outputs if s.name == name and s.enabled)
        return Value(self.tree, socket)

    def values(self) -> tuple[Value, ...]:
        """All outputs in order."""
        return tuple(Value(self.tree, socket) for socket in self.made.outputs)

    def plug(self, *inputs: object) -> None:
        """Link or set the inputs in order (None: as it is)."""
        for socket, value in zip(self.made.inputs, inputs, strict=False):
            self.tree.plug(socket, value)
