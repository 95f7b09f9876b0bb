"""The overlays in the viewport: arrays become batches of the graphics card, and nothing else is done while
Blender draws.
"""

from __future__ import annotations

from typing import Any

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from .shapes import Shapes

_LINE, _TEXT = 1.6, 12  # pixels at a resolution scale of 1
_MARGIN = 24  # pixels between what lies flat and the edges of the viewport


class Drawn:
    """One overlay's batches, made when it is first drawn."""

    def __init__(self, shapes: Shapes, flat: bool) -> None:
        self.shapes, self.flat = shapes, flat
        self._batches: list[tuple[Any, Any]] | None = None

    def draw(self) -> None:
        """Draw triangles and lines, in the matrices that are set."""
        if self._batches is None:
            self._batches = list(self._made())
        for shader, batch in self._batches:
            shader.bind()
            if batch is not None and shader is _lines():
                shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
                shader.uniform_float("lineWidth", _LINE * _scale())
            batch.draw(shader)

    def _made(self) -> Any:
        s = self.shapes
        if len(s.triangles):
            shader = gpu.shader.from_builtin("FLAT_COLOR")
            yield shader, batch_for_shader(shader, "TRIS", {"pos": s.triangles, "color": s.triangle_colours})
        if len(s.lines):
            shader = _lines()
            yield shader, batch_for_shader(shader, "LINES", {"pos": s.lines, "color": s.line_colours})


_polyline: Any = None


def _lines() -> Any:
    global _polyline
    if _polyline is None:
        _polyline = gpu.shader.from_builtin("POLYLINE_FLAT_COLOR")
    return _polyline


def _scale() -> float:
    return bpy.context.preferences.system.ui_scale


_drawn: dict[str, Drawn] = {}
_scene = ""
_handles: list[Any] = []


def show(scene: bpy.types.Scene, key: str, shapes: Shapes | None, flat: bool) -> None:
    """Have the viewports that show ``scene`` draw an overlay, or no longer where it is None."""
    global _scene
    if scene.name_full != _scene:
        _drawn.clear()
        _scene = scene.name_full
    if shapes is None or not shapes:
        _drawn.pop(key, None)
    else:
        _drawn[key] = Drawn(shapes, flat)
    _install() if _drawn else uninstall()
    redraw()


def clear() -> None:
    """Draw nothing any more."""
    _drawn.clear()
    uninstall()
    redraw()


def uninstall() -> None:
    """Take the drawing out of the viewports."""
    while _handles:
        bpy.types.SpaceView3D.draw_handler_remove(_handles.pop(), "WINDOW")


def redraw() -> None:
    """Have all viewports drawn anew."""
    manager = getattr(bpy.context, "window_manager", None)
    for window in manager.windows if manager is not None else ():
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                area.tag_redraw()


def _install() -> None:
    if not _handles and not bpy.app.background:
        add = bpy.types.SpaceView3D.draw_handler_add
        _handles.append(add(_draw_in_scene, (), "WINDOW", "POST_VIEW"))
        _handles.append(add(_draw_flat, (), "WINDOW", "POST_PIXEL"))


def _wanted() -> bool:
    """Whether the viewport that is drawn now shows the scene, with overlays."""
    context = bpy.context
    shown = context.space_data is not None and context.space_data.overlay.show_overlays
    return bool(shown and context.scene is not None and context.scene.name_full == _scene)


def _draw_in_scene() -> None:
    if not _wanted():
        return
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(False)
    try:
        for drawn in _drawn.values():
            if not drawn.flat:
                drawn.draw()
    finally:
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("NONE")


def _draw_flat() -> None:
    if not _wanted():
        return
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    region, view = bpy.context.region, bpy.context.region_data
    gpu.state.blend_set("ALPHA")
    try:
        for drawn in _drawn.values():
            if not drawn.flat:
                for place, text, colour in drawn.shapes.words:
                    at = location_3d_to_region_2d(region, view, place)
                    if at is not None:
                        _write(at[0] + 8 * _scale(), at[1] + 8 * _scale(), text, colour, shadow=True)
                continue
            with gpu.matrix.push_pop():
                gpu.matrix.translate((_MARGIN, _MARGIN))
                gpu.matrix.scale_uniform(_scale())
                drawn.draw()
            for place, text, colour in drawn.shapes.words:
                _write(_MARGIN + place[0] * _scale(), _MARGIN + place[1] * _scale(), text, colour)
    finally:
        gpu.state.blend_set("NONE")


def _write(x: float, y: float, text: str, colour: Any, shadow: bool = False) -> None:
    blf.size(0, _TEXT * _scale())
    if shadow:
        blf.enable(0, blf.SHADOW)
        blf.shadow(0, 3, 0.0, 0.0, 0.0, 0.8)
    blf.color(0, *colour)
    blf.position(0, x, y, 0)
    blf.draw(0, text)
    if shadow:
        blf.disable(0, blf.SHADOW)
