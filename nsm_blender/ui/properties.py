"""What the add-on keeps in a scene: the character, the queue of goals, the settings and the last results."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
)

from nsm_core.errors import GoalError
from nsm_core.world.actions import ACTIONS, BY_KEY, Action, Aim

from ..animation.rate import scene_fps
from ..goals.icons import ICONS
from ..goals.spec import GoalSpec
from .options import NsmFillOptions, NsmKeyOptions
from .queue import hand_over
from .queue import queue_of as queue_of
from .rig_properties import NsmBone, NsmRig
from .running import unknown_action
from .take_properties import NsmKeyed, NsmResult, NsmTake

# What can evaluate to a mesh, and empties: markers, collection instances and parents of parts.
GOAL_TYPES = {"MESH", "CURVE", "SURFACE", "META", "FONT", "EMPTY"}
# The queue of a character that is a library override can be edited, and is kept with the override.
OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}
# Files keep the numbers: an action's is its place among all.
_ACTION_ITEMS = [(a.key, a.label, a.description, ICONS[a.key], number) for number, a in enumerate(ACTIONS)]

BEGINS = (
    (
        "POSE",
        "Its Pose",
        "Go on from the pose and pace that the character has at the start frame, seated too, and "
        "keep what is animated before; a character in its rest pose begins with a quiet stand",
    ),
    ("STAND", "A Quiet Stand", "Begin with a quiet stand where the character is at the start frame"),
    (
        "FILL",
        "Its Pose, Filled",
        "Lead from the pose at the start frame, whatever it is, to a quiet stand a second later; what is "
        "animated before is kept",
    ),
)


def _acts(_self: bpy.types.PropertyGroup, candidate: bpy.types.Object) -> bool:
    """Whether an object can be picked as the character: an armature, or a mesh that one moves."""
    return armature_of(candidate) is not None


def _picked(settings: NsmSettings, _context: bpy.types.Context) -> None:
    """Have a body that was picked stand for its armature."""
    picked = settings.character
    armature = armature_of(picked) if picked is not None else None
    if armature is not None and armature != picked:
        settings.character = armature
    else:
        from .preferences import begin_scene  # which show the same options

        begin_scene(settings)
        hand_over(settings)


def armature_of(body: bpy.types.Object) -> bpy.types.Object | None:
    """Return the armature that an object is, or is moved by as a modifier or a parent; None without one."""
    return body if body.type == "ARMATURE" else body.find_armature()


def _is_goal(_self: bpy.types.PropertyGroup, candidate: bpy.types.Object) -> bool:
    return candidate.type in GOAL_TYPES


def _held_frames(row: NsmGoal) -> int:
    return round(row.hold * scene_fps(bpy.context.scene))


def _hold_frames(row: NsmGoal, frames: int) -> None:
    row.hold = frames / scene_fps(bpy.context.scene)


def _goal_picked(_owner: bpy.types.PropertyGroup, context: bpy.types.Context) -> None:
    from .overlays import goal_picked  # which read these very settings

    goal_picked(context.scene)


class NsmGoal(bpy.types.PropertyGroup):
    """One row of the queue: an object or a place, and what to do there."""

    enabled: BoolProperty(
        name="Enabled", description="Whether the next take does this goal", default=True, override=OVERRIDABLE
    )
    object: PointerProperty(
        name="Object",
        description="What the character goes to",
        type=bpy.types.Object,
        poll=_is_goal,
        override=OVERRIDABLE,
        update=_goal_picked,
    )
    action: EnumProperty(
        name="Action",
        description="What the character does there",
        items=_ACTION_ITEMS,
        override=OVERRIDABLE,
    )
    hold: FloatProperty(
        name="Stay",
        description="How long the character stays before the next goal, in seconds; 0: it goes on into the "
        "next one without coming to rest",
        default=2.0,
        min=0.0,
        soft_max=20.0,
        max=600.0,
        unit="TIME_ABSOLUTE",
        override=OVERRIDABLE,
    )
    at_frame: BoolProperty(
        name="At a Frame",
        description="Have the goal reached at a given frame: the character waits before it, and goes slower "
        "or faster",
        default=False,
        override=OVERRIDABLE,
    )
    by: IntProperty(
        name="Reached at",
        description="The frame at which the goal is to be reached: seated, arrived, set down. What cannot be "
        "so soon is told",
        default=120,
        override=OVERRIDABLE,
    )
    hold_frames: IntProperty(
        name="Stay in Frames",
        description="How long the character stays before the next goal, in frames of the scene",
        get=_held_frames,
        set=_hold_frames,
        min=0,
    )
    destination: PointerProperty(
        name="To",
        description="Where a carried object goes: set down on top of this one, a light one also on a "
        "board of it, or in the place of this empty",
        type=bpy.types.Object,
        poll=_is_goal,
        override=OVERRIDABLE,
    )
    close_after: BoolProperty(
        name="Close After",
        description="Shut the doors and drawers that are opened to get at the thing again, once it is put "
        "down and no later goal needs them open",
        default=True,
        override=OVERRIDABLE,
    )
    own_mass: BoolProperty(
        name="Own Weight",
        description="Give what is carried a weight that you choose; off, it weighs as its size says",
        override=OVERRIDABLE,
    )
    mass: FloatProperty(
        name="Weight",
        description="Kilograms of what is carried, for a character of average size: who carries it leans "
        "back against it, and goes slower with more than seven",
        default=5.0,
        min=0.0,
        soft_max=25.0,
        max=60.0,
        step=50,
        precision=1,
        override=OVERRIDABLE,
    )
    follow: BoolProperty(
        name="Go Along",
        description="Go along the curve, as it runs, from its start to its end; a closed one around from "
        "where it is nearest. Off: go to it, as to other objects. Only its way over the floor counts, not "
        "its height; Switch Direction (Edit Mode, Segments) turns it around",
        default=True,
        override=OVERRIDABLE,
    )
    rounds: IntProperty(
        name="Rounds",
        description="How often to go around a closed curve",
        default=1,
        min=1,
        max=100,
        override=OVERRIDABLE,
    )
    own_speed: BoolProperty(
        name="Own Speed",
        description="Go at a speed that you choose; off, each take draws one that suits the gait",
        override=OVERRIDABLE,
    )
    speed: FloatProperty(
        name="Speed",
        description="Speed on the way, of a character of average height, in metres a second: 0.5 to 1.6 to "
        "walk, 2.0 to 3.6 to run. Tight bends are gone slower. Other styles than these two gaits are not in "
        "what the network has learned from",
        default=1.2,
        min=0.5,
        max=3.6,
        step=10,
        precision=2,
        override=OVERRIDABLE,
    )
    location: FloatVectorProperty(
        name="Place",
        description="Where to go when no object is chosen",
        subtype="TRANSLATION",
        size=3,
        override=OVERRIDABLE,
    )


class NsmQueue(bpy.types.PropertyGroup):
    """The goals of one character, kept with its armature object; see ``queue.queue_of``."""

    goals: CollectionProperty(type=NsmGoal, override={"LIBRARY_OVERRIDABLE", "USE_INSERTION"})
    active_goal: IntProperty(name="Goal", default=0, min=0, override=OVERRIDABLE, update=_goal_picked)


class NsmSettings(bpy.types.PropertyGroup):
    """Everything the sidebar shows for a scene."""

    character: PointerProperty(
        name="Character",
        description="Who acts: an armature. Pick its body, and the armature that moves it is taken",
        type=bpy.types.Object,
        poll=_acts,
        update=_picked,
    )
    # What is asked for before there is a character: see ``queue.queue_of``.
    goals: CollectionProperty(type=NsmGoal)
    active_goal: IntProperty(name="Goal", default=0, min=0, update=_goal_picked)
    start_frame: IntProperty(
        name="Start Frame",
        description="The frame of the first key",
        default=1,
    )
    begin: EnumProperty(
        name="Start From",
        description="How the take begins",
        items=BEGINS,
        default="POSE",
    )
    seed: IntProperty(
        name="Variation",
        description="Another number gives another performance of the same goals; the same one gives the "
        "same again",
        default=0,
        min=0,
    )
    contact_ik: BoolProperty(
        name="Plant Feet and Hands",
        description="Plant the feet, seat the hips, put hands on what they hold and keep the body out of "
        "furniture, over the whole take; off leaves the raw motion, in which feet slide",
        default=True,
    )
    in_order: BoolProperty(
        name="Strictly in Order",
        description="Bring one thing after the other as the list asks for them; off, two are carried at "
        "once, one in either hand, and things are brought in another order, where that saves ways",
        default=False,
    )
    results: CollectionProperty(type=NsmResult)
    takes: CollectionProperty(type=NsmTake)
    active_take: IntProperty(name="Take", default=0, min=0)
    keys: PointerProperty(type=NsmKeyOptions)
    fill: PointerProperty(type=NsmFillOptions)


CLASSES = (
    NsmGoal,
    NsmQueue,
    NsmResult,
    NsmKeyed,
    NsmTake,
    NsmBone,
    NsmRig,
    NsmKeyOptions,
    NsmFillOptions,
    NsmSettings,
)


def settings_of(scene: bpy.types.Scene) -> NsmSettings:
    """Return the add-on's settings in a scene."""
    return scene.nsm


def action_of(row: NsmGoal) -> Action | None:
    """Return the action of a row; None where the number in the file is of another version."""
    return BY_KEY.get(row.action)


def goes_along(row: NsmGoal) -> bool:
    """Whether a row asks to go along its object, a curve."""
    from nsm_core.control.goals import SPEEDS

    return row.follow and row.action in SPEEDS and row.object is not None and row.object.type == "CURVE"


def spec_of_row(row: NsmGoal, number: int = 1) -> GoalSpec:
    """Return what row ``number`` of the queue asks for; GoalError where its stored action is unknown."""
    from nsm_core.control.goals import SPEEDS

    action = action_of(row)
    if action is None:
        raise GoalError(unknown_action(number, row.object.name if row.object else ""))
    if action.aim is Aim.HERE:  # has no place of its own, whatever the row was before
        return GoalSpec(row.action, hold=row.hold)
    speed = row.speed if row.own_speed and row.action in SPEEDS else None
    by = row.by if row.at_frame else None
    if goes_along(row):
        return GoalSpec(row.action, row.object, row.hold, along=True, rounds=row.rounds, speed=speed, by=by)
    to = row.destination if action.needs_destination else None
    place = tuple(row.location) if row.object is None else None
    mass = row.mass if row.own_mass and to is not None else None
    return GoalSpec(
        row.action,
        row.object,
        row.hold,
        place,
        to,
        speed=speed,
        by=by,
        mass=mass,
        close_after=row.close_after,
    )


def show_results(settings: NsmSettings, lines: list[tuple[str, bool]]) -> None:
    """Replace the result lines in the sidebar; each is a sentence and whether it is good news."""
    settings.results.clear()
    for text, good in lines:
        row = settings.results.add()
        row.text, row.good = text, good
