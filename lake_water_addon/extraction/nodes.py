# SPDX-License-Identifier: GPL-3.0-or-later
"""Walking shader node trees: links through reroutes, muted nodes and node groups."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

Stack = tuple[bpy.types.Node, ...]
MAX_STEPS = 1000  # trees have no cycles; a broken file might


@dataclass(frozen=True, eq=False)
class Source:
    """Where a socket's value comes from: an output of a node, or the default of an unlinked socket.

    stack: the group nodes that one is inside of, innermost first.
    """

    node: bpy.types.Node | None
    output: bpy.types.NodeSocket | None
    value: object
    stack: Stack

    def input(self, identifier: str) -> Source:
        """The source of one of the node's inputs, by identifier. Raises KeyError if it has none such."""
        return source_of(find_socket(self.node.inputs, identifier), self.stack)


def find_socket(sockets: bpy.types.bpy_prop_collection, identifier: str) -> bpy.types.NodeSocket:
    """The socket with an identifier, which unlike the name is unique in a node."""
    for socket in sockets:
        if socket.identifier == identifier:
            return socket
    raise KeyError(identifier)


def source_of(socket: bpy.types.NodeSocket, stack: Stack = ()) -> Source:
    """What drives an input socket; inside a group, the group node's inputs count."""
    for _step in range(MAX_STEPS):
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return Source(None, None, getattr(socket, "default_value", None), stack)
        node, output = link.from_node, link.from_socket
        if node.type == "REROUTE":
            socket = node.inputs[0]
        elif node.mute:
            inner = next((link for link in node.internal_links if link.to_socket == output), None)
            if inner is None:
                return Source(None, None, getattr(socket, "default_value", None), stack)
            socket = inner.from_socket
        elif node.type == "GROUP" and node.node_tree is not None:
            group_output = next(
                (n for n in node.node_tree.nodes if n.type == "GROUP_OUTPUT" and n.is_active_output), None
            )
            if group_output is None:
                return Source(node, output, None, stack)
            socket, stack = find_socket(group_output.inputs, output.identifier), (node, *stack)
        elif node.type == "GROUP_INPUT" and stack:
            socket, stack = find_socket(stack[0].inputs, output.identifier), stack[1:]
        else:
            return Source(node, output, None, stack)
    return Source(None, None, getattr(socket, "default_value", None), stack)
