"""The bundled character: the 23-joint armature and the mannequin on it."""

from __future__ import annotations

import bpy

from .armature import build_armature
from .mannequin.build import build_mannequin

CHARACTER = "Character"


def add_character(
    location: tuple[float, float, float] | None = None, name: str = CHARACTER
) -> bpy.types.Object:
    """Add the bundled character in its T-pose, facing -Y, at ``location`` (3,) metres or at the 3D cursor.

    Returns the armature object, named ``name`` (Blender adds a number where that is taken), active and
    selected;
    the mannequin is its child.  Must be called in object mode.
    """
    if location is None:
        location = tuple(bpy.context.scene.cursor.location)
    armature = build_armature(name, location)
    build_mannequin(armature)
    if hasattr(armature, "nsm_queue"):
        # Before anyone links it: Blender 5.2 keeps the queue of an override where its source has one.
        armature.nsm_queue.active_goal = 0
    return armature
