"""Everything that a file holds, in values that can be compared: the stated comparison of the fault table.

``digest`` walks all that Blender tells of every datablock: transforms and matrices, poses, actions with
their curves and keys, animation data with its NLA, custom properties, meshes, constraints, drivers, names,
users, the settings of scenes with the current frame, selection, modes and the add-on's own queue and list of
takes.  Left out are the lines of the last result, which tell what happened, and what belongs to windows.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

# Of windows and of the program, and what is another number after every load.
_NOT_THE_FILES = {
    "all_ids",  # all others once more, from Blender 5.2 on

    "brushes", "cache_files", "fonts", "libraries", "palettes", "screens", "window_managers", "workspaces",
}  # fmt: skip
_LEFT_OUT = {
    "animation_data_ensure", "bl_rna", "evaluated_depsgraph", "id_data", "is_evaluated", "is_missing",
    "is_runtime_data", "original", "preview", "results", "rna_type", "session_uid", "tag", "depsgraph",
    "is_embedded_data", "tool_settings", "eevee", "display", "cycles", "sequencer_colorspace_settings",
    "view_settings", "display_settings", "grease_pencil_settings", "safe_areas", "bound_box",
    "particle_systems", "previous_slot",
    "active_clip", "statistics", "is_dirty", "is_updated", "is_updated_data", "node_tree",
    "colorspace_settings", "ffmpeg", "linear_colorspace_settings", "keying_sets_all", "image_settings",
}  # fmt: skip
_COMPUTED = {
    "dimensions", "head", "length", "matrix", "matrix_basis", "matrix_channel", "matrix_local",
    "matrix_world", "tail",
}  # fmt: skip
# Long collections of numbers, and which of these are hashed.
_LONG = {
    "keyframe_points": ("co", "handle_left", "handle_right"),
    "vertices": ("co",),
    "edges": ("vertices",),
    "loops": ("vertex_index",),
}
_SKIPPED_OF_MESHES = {
    "attributes", "color_attributes", "corner_normals", "loop_triangles", "loop_triangle_polygons",
    "polygons", "polygon_normals", "vertex_normals", "uv_layers", "skin_vertices", "vertex_colors",
    "edge_keys",
}  # fmt: skip


def digest() -> dict[str, Any]:
    """All of the open file as plain values, by a path that names each.

    What Blender computes of objects that the window does not show is left out: it is as old as may be.
    """
    flat: dict[str, Any] = {}
    bpy.context.view_layer.update()
    for kind in bpy.data.bl_rna.properties:
        if kind.type == "COLLECTION" and kind.identifier not in _NOT_THE_FILES:
            blocks = getattr(bpy.data, kind.identifier)
            flat[kind.identifier] = sorted(block.name_full for block in blocks)
            for block in blocks:
                hidden = isinstance(block, bpy.types.Object) and not _evaluated(block)
                _Walk(flat, _COMPUTED | _driven(block) if hidden else set()).struct(
                    f"{kind.identifier}[{block.name_full}]", block
                )
    flat |= _window()
    return flat


def _evaluated(shown: bpy.types.Object) -> bool:
    """Whether Blender computes anew what follows of an object, and of the bones that one has."""
    return bpy.context.view_layer.objects.get(shown.name_full) == shown and shown.mode != "EDIT"


def _driven(block: bpy.types.Object) -> set[str]:
    return {curve.data_path for curve in block.animation_data.drivers} if block.animation_data else set()


def _window() -> dict[str, Any]:
    scene, layer = bpy.context.scene, bpy.context.view_layer
    return {
        "scene": scene.name,
        "mode": bpy.context.mode,
        "active": layer.objects.active and layer.objects.active.name_full,
        "selected": sorted(o.name_full for o in layer.objects if o.select_get()),
        "hidden": sorted(o.name_full for o in layer.objects if o.hide_get()),
    }


class _Walk:
    """One datablock, with all that is its own."""

    def __init__(self, flat: dict[str, Any], left_out: set[str]) -> None:
        self.flat, self.left_out, self.seen = flat, _LEFT_OUT | left_out, set()

    def struct(self, path: str, struct: bpy.types.bpy_struct) -> None:
        mark = (struct.as_pointer(), struct.bl_rna.identifier)
        if mark in self.seen:
            return
        self.seen.add(mark)
        for prop in struct.bl_rna.properties:
            name = prop.identifier
            if name in self.left_out or (isinstance(struct, bpy.types.Mesh) and name in _SKIPPED_OF_MESHES):
                continue
            try:
                value = getattr(struct, name)
            except (AttributeError, RuntimeError, ValueError):  # what this kind of thing has not
                continue
            self.value(f"{path}.{name}", prop, value)
        for key, value in _own(struct):
            self.flat[f"{path}[{key!r}]"] = value

    def value(self, path: str, prop: bpy.types.Property, value: Any) -> None:
        if prop.type == "COLLECTION":
            self.collection(path, prop.identifier, value)
        elif prop.type == "POINTER":
            if value is None or isinstance(value, bpy.types.ID):
                self.flat[path] = value and f"{value.bl_rna.identifier} {value.name_full}"
                if value is not None and value.is_embedded_data:
                    self.struct(path, value)
            else:
                self.struct(path, value)
        elif prop.type == "ENUM" and prop.is_enum_flag:
            self.flat[path] = tuple(sorted(value))
        elif getattr(prop, "is_array", False):
            self.flat[path] = tuple(np.array(value).ravel().tolist())
        else:
            self.flat[path] = value

    def collection(self, path: str, name: str, items: Any) -> None:
        self.flat[f"{path}.length"] = len(items)
        if not len(items):
            return
        if name in _LONG:
            self.flat[path] = tuple(_numbers(items, which) for which in _LONG[name])
            return
        if isinstance(items[0], bpy.types.ID):
            self.flat[path] = tuple(item.name_full if item else None for item in items)
            return
        for number, item in enumerate(items):
            self.struct(f"{path}[{number}]", item)


def _numbers(items: Any, which: str) -> int:
    size = len(np.atleast_1d(np.array(getattr(items[0], which))))
    kind = (
        np.intc if isinstance(np.atleast_1d(getattr(items[0], which))[0], (int, np.integer)) else np.float32
    )
    numbers = np.empty(size * len(items), kind)
    items.foreach_get(which, numbers)
    return zlib.crc32(numbers.tobytes())


def _own(struct: bpy.types.bpy_struct) -> Iterator[tuple[str, Any]]:
    """The custom properties."""
    if not isinstance(struct, (bpy.types.ID, bpy.types.PoseBone, bpy.types.Bone)):
        return
    for key in struct.keys():
        if key not in ("nsm", "nsm_rig", "nsm_queue"):
            value = struct[key]
            if isinstance(value, bpy.types.ID):
                yield key, f"{value.bl_rna.identifier} {value.name_full}"
                continue
            plain = getattr(value, "to_dict", getattr(value, "to_list", lambda value=value: value))()
            yield key, "drawn" if key == "nsm_take" else str(plain)  # a mark drawn by chance for each take


def difference(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """What differs of two digests, a line each."""
    lines = []
    for path in [*before, *(p for p in after if p not in before)]:
        a, b = before.get(path, "nothing"), after.get(path, "nothing")
        if a != b and not (a != a and b != b):
            lines.append(f"{path}: {a} -> {b}"[:300])
    return lines
