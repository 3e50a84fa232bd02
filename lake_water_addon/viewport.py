# SPDX-License-Identifier: GPL-3.0-or-later
"""Draw handler: the water over whatever Blender's own engines show in a 3D viewport.

The passes into textures are the engine's; the water itself is drawn into the viewport, against
the depth of what Blender drew (or of the same scene drawn again, see `_leaves_depth`), in display
colours (see `display.py`).
"""

from __future__ import annotations

import time
import traceback
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager

import blf
import bpy
import gpu
from gpu.types import GPUTexture

from . import budget, handlers
from .borders import view_window
from .core.overlay import lay_over
from .core.plan import FramePlan
from .display import bake_view_transform, view_settings_key
from .engine import LakeWaterRenderEngine, viewport_statistics
from .extract import camera_from_view
from .host import Host, frame_settings
from .nodes.switching import shows_nodes
from .render.frame import PassTimer

TEXT_SIZE = 11.0
TEXT_MARGIN = 12.0
MAX_TABLES = 8  # view transforms kept: windows may show scenes that differ in theirs


class _State:
    """What lives between register() and unregister()."""

    def __init__(self) -> None:
        self.draw_handles: list = []
        self.listener: handlers.Listener | None = None
        self.host: Host | None = None
        self.pacing: budget.Pacing | None = None
        self.tables: OrderedDict[tuple, tuple[GPUTexture, tuple[float, float]]] = OrderedDict()
        self.wanted_table: tuple | None = None
        self.textures_of: tuple | None = None
        self.depth: GPUTexture | None = None  # of the scene, for fog and glow
        self.star: GPUTexture | None = None
        self.error: str | None = None

    def forget_scene(self) -> None:
        """Drop what was taken from the scene; GPU objects are freed with it."""
        self.host = self.pacing = None
        self.textures_of = self.depth = self.star = None
        self.wanted_table = None  # loading a file drops the timer that would bake it
        self.error = None


_state: _State | None = None


def _draws_in(context: bpy.types.Context) -> bool:
    """Whether the handler has anything to do in this viewport."""
    space, scene = context.space_data, context.scene
    if _state is None or space is None or space.type != "VIEW_3D" or not scene.lake_water.show_in_viewport:
        return False
    if _is_rendered_by_us(context) or shows_nodes(space, context.engine):
        return False
    return bool(handlers.waters(scene))


def _is_rendered_by_us(context: bpy.types.Context) -> bool:
    """Whether this viewport shows the picture of the engine LAKE_WATER, water and all."""
    rendered = context.space_data.shading.type == "RENDERED"
    return rendered and context.engine == LakeWaterRenderEngine.bl_idname


def _leaves_depth(context: bpy.types.Context) -> bool:
    """Whether the viewport's depth is that of what it shows, with no water in it.

    Workbench always leaves that. Material Preview's EEVEE leaves zeros where no overlay needs it.
    """
    space = context.space_data
    return space.shading.type != "MATERIAL" or space.overlay.show_overlays


@contextmanager
def _inside_border(context: bpy.types.Context) -> Iterator[None]:
    """Draw only where EEVEE and Cycles draw when the view has a render border."""
    region, space = context.region, context.space_data
    left, bottom, right, top = 0, 0, region.width, region.height
    if space.shading.type in {"MATERIAL", "RENDERED"}:
        depsgraph = context.evaluated_depsgraph_get()
        left, bottom, right, top = view_window(space, region, context.region_data, depsgraph)
    if (left, bottom, right, top) == (0, 0, region.width, region.height):
        yield
        return
    gpu.state.scissor_test_set(True)
    gpu.state.scissor_set(left, bottom, right - left, top - bottom)
    try:
        yield
    finally:
        gpu.state.scissor_test_set(False)


def _draw_water() -> None:
    """POST_VIEW: Blender's picture and its depth are in the bound framebuffer."""
    context = bpy.context
    if not _draws_in(context) or _state.error is not None:
        return
    try:
        _draw(context)
    except Exception as error:
        traceback.print_exc()
        # Say it once and stop, not at every redraw; the next change of the scene tries again.
        _state.error = f"Lake Water could not draw: {error}"


def _draw(context: bpy.types.Context) -> None:
    start = time.perf_counter()
    table = _table_of(context.scene)
    if table is None:
        return
    if _state.host is None:
        _state.host = Host()
        _state.pacing = budget.Pacing(_state.host)
    host, scene = _state.host, context.scene
    region = context.region
    host.begin((region.width, region.height))
    timer = PassTimer(enabled=scene.lake_water.show_statistics)
    framebuffer = gpu.state.active_framebuffer_get()
    pace = _state.pacing.of(region, scene)
    watch = budget.Watch(pace, lambda: budget.wait_for(framebuffer))
    snapshot = host.view_snapshot(context.evaluated_depsgraph_get(), context.space_data)
    settings = frame_settings(scene)
    if pace is not None:
        settings, snapshot = lay_over(settings, snapshot, pace.point.settings)
    plan = host.plan(snapshot, camera_from_view(context.region_data), scene, settings=settings)
    # Blender redraws for its own antialiasing and for a highlighted gizmo: then these are right already.
    textures_of = (
        snapshot.version,
        snapshot.time,
        plan.camera.view.tobytes(),
        plan.camera.projection.tobytes(),
        plan.settings,
        tuple(body.settings for body in snapshot.waters),
        (region.width, region.height),
    )
    redrawn = textures_of != _state.textures_of or timer.enabled  # whoever asks for times wants all of them
    if redrawn:
        _state.textures_of = None
        in_air, _ = host.renderer.draw_textures(plan, timer)
        depth = _draw_scene_depth(host, plan, timer, (region.width, region.height))
        if plan.glow.drawn:
            with timer.measure("glow", None):
                _state.star = host.renderer.draw_star(plan, depth, in_air.shadow_depth)
        _state.depth, _state.textures_of = depth, textures_of
    with _inside_border(context):
        if not _leaves_depth(context):
            host.renderer.draw_depth(plan, timer, framebuffer)
        host.renderer.draw_water(plan, timer, framebuffer, _state.depth, view_transform=table)
        if plan.glow.drawn:
            host.renderer.add_glow(plan, _state.star, table)
    if pace is not None:
        host.paced = budget.describe(pace)
        budget.publish(host.paced)
        if redrawn:
            watch.stop()
    host.finish(timer, time.perf_counter() - start)


def _draw_scene_depth(
    host: Host, plan: FramePlan, timer: PassTimer, size: tuple[int, int]
) -> GPUTexture | None:
    """Depth for the fog and the glow; None for a picture without. Blender's own cannot be read while one
    draws against it."""
    if plan.immersed is None and not plan.glow.drawn:
        return None
    host.renderer.draw_scene_depth(plan, timer, size)
    return host.renderer.scene_depth(size)


def _statistics(context: bpy.types.Context) -> list[str]:
    """The lines to show in this viewport."""
    if _state is None or not handlers.waters(context.scene):
        return []
    shown = context.scene.lake_water.show_statistics
    if _is_rendered_by_us(context):
        return viewport_statistics() if shown else []
    if not context.scene.lake_water.show_in_viewport or shows_nodes(context.space_data, context.engine):
        return []
    if _state.error is not None:
        return [_state.error]
    return _state.host.statistics() if shown and _state.host is not None else []


def _draw_statistics() -> None:
    """POST_PIXEL: frames per second and the time of each pass, or what went wrong."""
    context = bpy.context
    lines = _statistics(context)
    if not lines:
        return
    handlers.publish_statistics(lines)
    scale = context.preferences.system.ui_scale
    left, bottom = _free_corner(context.area, context.region)
    left, bottom = left + TEXT_MARGIN * scale, bottom + TEXT_MARGIN * scale
    blf.size(0, TEXT_SIZE * scale)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.8)
    for i, line in enumerate(reversed(lines)):
        blf.position(0, left, bottom + 1.5 * TEXT_SIZE * i * scale, 0.0)
        blf.draw(0, line)
    blf.disable(0, blf.SHADOW)


def _free_corner(area: bpy.types.Area, region: bpy.types.Region) -> tuple[float, float]:
    """Left and bottom of what toolbar, redo panel and asset shelf leave free of a viewport, in its pixels.

    Blender's own text is at the top.
    """
    left = bottom = 0
    for other in area.regions:
        right, top = other.x + other.width - region.x, other.y + other.height - region.y
        hidden = other.width <= 1 or other.height <= 1 or right <= 0 or top <= 0
        if hidden or other.x >= region.x + region.width or other.y >= region.y + region.height:
            continue
        if other.type == "TOOLS" and other.alignment == "LEFT":
            left = max(left, right)
        elif other.type in {"HUD", "ASSET_SHELF", "ASSET_SHELF_HEADER"}:
            bottom = max(bottom, top)
    return left, bottom


def _table_of(scene: bpy.types.Scene) -> tuple[GPUTexture, tuple[float, float]] | None:
    """The scene's view transform; while it is baked (never while drawing) the one before, or None."""
    key = view_settings_key(scene)
    if key in _state.tables:
        _state.tables.move_to_end(key)
    elif _state.wanted_table != key:
        _state.wanted_table = key
        bpy.app.timers.register(_bake_wanted_table, first_interval=0.0)
    return next(reversed(_state.tables.values()), None)


def _bake_wanted_table() -> None:
    """Timer: outside of drawing, where data-blocks can be made."""
    if _state is None or _state.wanted_table is None:
        return
    for scene in bpy.data.scenes:
        if view_settings_key(scene) == _state.wanted_table:
            display, lattice = bake_view_transform(scene)
            size = display.shape[0]
            data = gpu.types.Buffer("FLOAT", display.size, display.ravel())
            texture = gpu.types.GPUTexture((size, size, size), format="RGBA16F", data=data)
            texture.filter_mode(True)
            texture.extend_mode("EXTEND")
            _state.tables[_state.wanted_table] = (texture, lattice)
            while len(_state.tables) > MAX_TABLES:
                _state.tables.popitem(last=False)
            break
    _state.wanted_table = None
    _redraw_viewports()


def _redraw_viewports() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _note_updates(_scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    _state.error = None
    if _state.host is not None:
        _state.host.extractor.note_updates(depsgraph)
    _redraw_viewports()


def _forget() -> None:
    _state.forget_scene()


def _stopped(scene: bpy.types.Scene) -> None:
    """A picture at rest is drawn with the scene's own settings."""
    if scene.lake_water.budget == "TIME":
        _redraw_viewports()


def _undone() -> None:
    """Any data-block may be another now: read all again. What turns out equal is not uploaded again."""
    _state.error = None
    if _state.host is not None:
        _state.host.extractor.check_all()
    _redraw_viewports()


def register() -> None:
    """Start to draw. Without a window there is no viewport, and nothing to do."""
    global _state  # noqa: PLW0603 - the one piece of state, gone again after unregister()
    _state = _State()
    _state.listener = handlers.Listener(
        loaded=_forget,
        undone=_undone,
        updated=_note_updates,
        frame_changed=_note_updates,
        stopped=_stopped,
    )
    handlers.subscribe(_state.listener)
    if not bpy.app.background:
        add = bpy.types.SpaceView3D.draw_handler_add
        _state.draw_handles = [
            add(_draw_water, (), "WINDOW", "POST_VIEW"),
            add(_draw_statistics, (), "WINDOW", "POST_PIXEL"),
        ]


def unregister() -> None:
    """Stop drawing and free everything."""
    global _state  # noqa: PLW0603
    if _state is None:
        return
    for handle in _state.draw_handles:
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    if bpy.app.timers.is_registered(_bake_wanted_table):
        bpy.app.timers.unregister(_bake_wanted_table)
    handlers.unsubscribe(_state.listener)
    _state = None
