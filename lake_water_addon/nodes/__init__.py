# SPDX-License-Identifier: GPL-3.0-or-later
"""The same water for Blender's own engines: node groups, the material and the modifier that carry them."""
