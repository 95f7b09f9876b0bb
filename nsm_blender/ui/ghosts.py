"""Variations beside each other: copies of the character, each playing a take of its own, that stand in a
collection of theirs until one is picked.

A copy shares armature data and meshes with the character; it is not rendered, and nobody walks around it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

if TYPE_CHECKING:
    from ..keys.keyed import KeyedTake


NAME = "NSM Variations"
_APART = 1.2  # metres of the character from one to the next
_COLOURS = (
    (0.9, 0.45, 0.2, 1.0),
    (0.25, 0.55, 0.9, 1.0),
    (0.45, 0.75, 0.3, 1.0),
    (0.8, 0.35, 0.7, 1.0),
    (0.9, 0.8, 0.2, 1.0),
)


def show_ghosts(scene: bpy.types.Scene, takes: Sequence[KeyedTake], labels: Sequence[str]) -> None:
    """Put a copy of the character beside it for each take, named by its label.

    Whatever is raised, no copy is left.
    """
    from ..animation.made import all_or_nothing

    remove_ghosts(scene)
    if not takes:
        return
    with all_or_nothing():
        collection = bpy.data.collections.new(NAME)
        collection.hide_render = True
        scene.collection.children.link(collection)
        armature = takes[0].armature
        aside = _aside(armature)
        for number, (take, label) in enumerate(zip(takes, labels, strict=True)):
            colour = _COLOURS[number % len(_COLOURS)]
            _copy(armature, scene, collection, take, label, (number + 1) * aside, colour)
        bpy.context.view_layer.update()


def remove_ghosts(scene: bpy.types.Scene, actions: Collection[bpy.types.Action] | None = None) -> None:
    """Remove all copies, or those that play one of ``actions``.

    All that may fail comes before the first one is removed.
    """
    gone: dict[bpy.types.Object, None] = {}
    empty = []
    for collection in _collections(scene):
        ghosts = [o for o in collection.objects if o.type == "ARMATURE"]
        going = [ghost for ghost in ghosts if actions is None or action_of(ghost) in actions]
        for ghost in going:
            gone.update(dict.fromkeys((*ghost.children_recursive, ghost)))
        if len(going) == len(ghosts):
            gone.update(dict.fromkeys(collection.objects))
            empty.append(collection)
    for ghost in gone:
        bpy.data.objects.remove(ghost)
    for collection in empty:
        bpy.data.collections.remove(collection)


def ghosts_of(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """The armatures of the copies."""
    return [o for collection in _collections(scene) for o in collection.objects if o.type == "ARMATURE"]


def ghost_at(scene: bpy.types.Scene, clicked: bpy.types.Object | None) -> bpy.types.Object | None:
    """The copy that an object is, or is part of."""
    ghosts = ghosts_of(scene)
    while clicked is not None and clicked not in ghosts:
        clicked = clicked.parent
    return clicked


def action_of(target: bpy.types.Object) -> bpy.types.Action | None:
    """The action that an object plays."""
    return target.animation_data.action if target.animation_data else None


def _collections(scene: bpy.types.Scene) -> list[bpy.types.Collection]:
    return [c for c in scene.collection.children if c.name.partition(".")[0] == NAME]


def _copy(
    armature: bpy.types.Object,
    scene: bpy.types.Scene,
    collection: bpy.types.Collection,
    take: KeyedTake,
    label: str,
    aside: Vector,
    colour: Sequence[float],
) -> None:
    from ..animation.channels import assign
    from ..prepare import own_objects

    copies: dict[bpy.types.Object, bpy.types.Object] = {}
    own = own_objects(armature, scene)
    for one in sorted(own, key=lambda o: len(_line(o))):  # what carries others first
        copy = copies[one] = one.copy()
        collection.objects.link(copy)
        copy["nsm_collider"], copy.color = False, colour
        copy.hide_select = False
        if one != armature:
            carrier = copies.get(one.parent)
            if carrier is not None:
                copy.parent = carrier
                copy.matrix_parent_inverse = one.matrix_parent_inverse
            else:  # bent by the armature alone: it goes along, too
                copy.parent, copy.parent_type = copies[armature], "OBJECT"
                copy.matrix_parent_inverse = armature.matrix_world.inverted_safe()
    for copy in copies.values():
        _lead(copy, copies)
    ghost = copies[armature]
    ghost.name, ghost.show_name = label, True
    turn = ghost.parent.matrix_world.to_3x3().inverted_safe() if ghost.parent else Matrix.Identity(3)
    ghost.delta_location = ghost.delta_location + turn @ aside
    assign(ghost, take.action, take.slot)


def _lead(copy: bpy.types.Object, copies: dict[bpy.types.Object, bpy.types.Object]) -> None:
    """Have what a copy follows be the copies of what the original follows."""
    owners: list[Any] = [*copy.modifiers, *copy.constraints]
    if copy.pose is not None:
        owners += [constraint for bone in copy.pose.bones for constraint in bone.constraints]
    for owner in owners:
        for name in _object_pointers(owner):
            if getattr(owner, name) in copies:
                setattr(owner, name, copies[getattr(owner, name)])
        for target in getattr(owner, "targets", ()):
            if target.target in copies:
                target.target = copies[target.target]
    for driver in copy.animation_data.drivers if copy.animation_data else ():
        for variable in driver.driver.variables:
            for target in variable.targets:
                if target.id in copies:
                    target.id = copies[target.id]


def _object_pointers(owner: Any) -> Iterable[str]:
    """Names of the properties that are objects."""
    for prop in owner.bl_rna.properties:
        if prop.type == "POINTER" and prop.fixed_type.identifier == "Object" and not prop.is_readonly:
            yield prop.identifier


def _line(one: bpy.types.Object) -> list[bpy.types.Object]:
    """What an object hangs on, one after the other."""
    line = []
    while one.parent is not None:
        one = one.parent
        line.append(one)
    return line


def _aside(armature: bpy.types.Object) -> Vector:
    """From one copy to the next: to the right of the character as it stands now."""
    from nsm_core.body.skeleton import INDEX

    from ..rigs.armature import Placement, read_world_pose

    placement = Placement.of(armature)
    joints, _, _ = read_world_pose(armature, placement)
    right = joints[INDEX["RightHip"]] - joints[INDEX["LeftHip"]]
    right[2] = 0
    return Vector(right / max(np.linalg.norm(right), 1e-9)) * (_APART * placement.scale)
