# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's evaluated depsgraph to plain data: a module for each kind, `scene` joins them."""
