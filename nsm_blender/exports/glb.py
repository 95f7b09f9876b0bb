"""A take as GLB, by Blender's own exporter: the character, its meshes and what it moves, with their keys."""

from __future__ import annotations

import contextlib
import io
import secrets
import struct
from collections.abc import Iterable, Iterator
from pathlib import Path

import bpy

from nsm_core.errors import OutputError

from ..animation.kept import frame_kept
from ..pictures.outputs import written
from ..prepare import own_objects


def export_glb(
    path: Path,
    armature: bpy.types.Object,
    things: Iterable[bpy.types.Object],
    scene: bpy.types.Scene,
    what: str = "",
) -> None:
    """Write ``armature`` with what it wears and the ``things`` it has moved, and one animation: the actions
    that they have now, from frame zero on.

    What else is in the scene stays out, and other actions do.  The animation bears the name of the
    character's action.  Raises OutputError, about ``what``, where the file cannot be written.
    """
    if "gltf" not in dir(bpy.ops.export_scene):
        raise OutputError(
            "Blender's own add-on glTF 2.0 is switched off; switch it on in Preferences > Add-ons and export "
            "again."
        )
    action = armature.animation_data.action if armature.animation_data else None
    wanted = [*own_objects(armature, scene), *things]
    with (
        frame_kept(scene),
        _gathered(wanted, scene) as name,
        written(path, what, glb_is_whole) as temporary,
        contextlib.redirect_stdout(io.StringIO()),  # it tells of every step
    ):
        bpy.ops.export_scene.gltf(
            filepath=str(temporary),
            export_format="GLB",
            collection=name,
            export_animation_mode="ACTIVE_ACTIONS",
            export_nla_strips_merged_animation_name=action.name if action else "Animation",
            export_frame_range=False,  # of the scene, which may be another and begins at 0 at the earliest
            export_anim_slide_to_zero=True,
            export_force_sampling=True,  # constraints and controls too
            export_optimize_animation_size=False,
        )


@contextlib.contextmanager
def _gathered(wanted: Iterable[bpy.types.Object], scene: bpy.types.Scene) -> Iterator[str]:
    """A collection of some objects while a file is written, its name: unlike a selection, it may hold what is
    hidden, and nothing has to be put back.
    """
    gathered = bpy.data.collections.new(f"NSM {secrets.token_hex(6)}")
    try:
        for each in dict.fromkeys(wanted):
            gathered.objects.link(each)
        scene.collection.children.link(gathered)
        bpy.context.view_layer.update()
        yield gathered.name
    finally:
        bpy.data.collections.remove(gathered)


def glb_is_whole(path: Path) -> bool:
    """Whether a GLB is as long as its head says."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(12)
    return len(head) == 12 and head[:4] == b"glTF" and struct.unpack("<I", head[8:])[0] == path.stat().st_size
