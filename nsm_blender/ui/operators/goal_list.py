"""The queue of goals: add, remove, move, and goal points to edit."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import bpy
from bpy.props import EnumProperty

from nsm_core.errors import NsmError
from nsm_core.world.actions import ACTIONS, Aim

from ..properties import GOAL_TYPES, NsmGoal, action_of, queue_of, settings_of, spec_of_row
from ..queue import flow_on
from ..session import TakeSession
from .modal import Modal
from .reporting import WhileIdle, telling

if TYPE_CHECKING:
    from ...prepare import TakeSpec
    from ...world.frame import WorldFrame


class NSM_OT_goal_add(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.goal_add"
    bl_label = "Add Goal"
    bl_description = (
        "Add the selected objects as goals, with the actions that their shapes ask for: a seat is sat on, a "
        "door opened, a crate carried (onto the active object, when that is a table), a step climbed. With "
        "nothing selected, a place to walk to at the 3D cursor"
    )

    def execute(self, context: bpy.types.Context) -> set[str]:
        from ...goals.guess import asked_of
        from ...goals.points import POINT_LINK
        from ...prepare import own_objects

        settings = settings_of(context.scene)
        queue = queue_of(context.scene)
        own = own_objects(settings.character, context.scene) if settings.character else set()
        taken = {goal.object for goal in queue.goals}
        free = [
            o for o in context.selected_objects if o.type in GOAL_TYPES and o not in own and o not in taken
        ]
        chosen = [o for o in free if POINT_LINK not in o]
        for asked in asked_of(chosen, _frame_of(settings.character, context.scene), context.active_object):
            goal = queue.goals.add()
            goal.object, goal.action, goal.destination = asked.target, asked.action, asked.to
            flow_on(goal)
        if not chosen:
            goal = queue.goals.add()
            goal.action = next(a.key for a in ACTIONS if a.aim is Aim.PLACE)
            goal.location = context.scene.cursor.location
            flow_on(goal)
        queue.active_goal = len(queue.goals) - 1
        return {"FINISHED"}


class _OnGoal(WhileIdle, bpy.types.Operator):
    """Shared by the operators that need an active row."""

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        return "The list of goals is empty; add one first." if not len(queue_of(context.scene).goals) else ""


class NSM_OT_goal_remove(_OnGoal):
    bl_idname = "nsm.goal_remove"
    bl_label = "Remove Goal"
    bl_description = "Remove the chosen goal from the list; its object stays"

    def execute(self, context: bpy.types.Context) -> set[str]:
        queue = queue_of(context.scene)
        queue.goals.remove(min(queue.active_goal, len(queue.goals) - 1))
        queue.active_goal = max(min(queue.active_goal, len(queue.goals) - 1), 0)
        return {"FINISHED"}


class NSM_OT_goal_move(_OnGoal):
    bl_idname = "nsm.goal_move"
    bl_label = "Move Goal"
    bl_description = "Do the chosen goal earlier or later"

    direction: EnumProperty(items=(("UP", "Up", "Earlier"), ("DOWN", "Down", "Later")), name="Direction")

    def execute(self, context: bpy.types.Context) -> set[str]:
        queue = queue_of(context.scene)
        here = queue.active_goal
        there = here + (-1 if self.direction == "UP" else 1)
        if not 0 <= there < len(queue.goals):
            self.report({"INFO"}, f"It is the {'first' if self.direction == 'UP' else 'last'} goal already.")
            return {"CANCELLED"}
        queue.goals.move(here, there)
        queue.active_goal = there
        return {"FINISHED"}


class NSM_OT_goal_to_cursor(_OnGoal):
    bl_idname = "nsm.goal_to_cursor"
    bl_label = "To the 3D Cursor"
    bl_description = "Take the place of the 3D cursor for the chosen goal"

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        reason, goal = super().reason_not(context), _active_goal(context)
        if not reason and (goal is None or goal.object is not None or not _is_place(goal)):
            return "The chosen goal has no place of its own; choose one to walk or run and clear its object."
        return reason

    def execute(self, context: bpy.types.Context) -> set[str]:
        _active_goal(context).location = context.scene.cursor.location
        return {"FINISHED"}


class NSM_OT_goal_points(WhileIdle, Modal, bpy.types.Operator):
    bl_idname = "nsm.goal_points"
    bl_label = "Show Goal Points"
    bl_description = (
        "Show where each goal was found on its object as an empty, and select it: move it, or turn it so "
        "that its -Y axis "
        "points where the character will face. A door has two: its hinge, which also holds the way it "
        "swings, and its handle. "
        "Takes use them as they stand; delete one to have its place found anew"
    )

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        if settings_of(context.scene).character is None:
            return "No character is chosen; choose its armature, or add the bundled character."
        if not any(goal.enabled and goal.object for goal in queue_of(context.scene).goals):
            return "No enabled goal has an object; add an object to the list first."
        return ""

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Show them in one go: scripts and background mode, where no timer runs."""
        from ...prepare import show_goal_points
        from ...progress import finish

        scene = context.scene
        try:
            return self._keep(scene, finish(show_goal_points(_asked(scene), scene)))
        except NsmError as error:
            return self._fail(scene, str(error))

    def _open(self, context: bpy.types.Context, ended: Callable[[], None]) -> TakeSession:
        from ...prepare import show_goal_points

        stopped = "Show Goal Points stopped and no point was made"
        return TakeSession(_asked(context.scene), context.scene, ended, show_goal_points, stopped)

    def _keep(self, _scene: bpy.types.Scene, shown: tuple[list[bpy.types.Object], list[str]]) -> set[str]:
        points, told = shown
        for sentence in told:
            self.report({"WARNING"} if points else {"ERROR"}, sentence)
        _select(bpy.context, points)
        return {"FINISHED"} if points else {"CANCELLED"}

    def _fail(self, _scene: bpy.types.Scene, sentence: str) -> set[str]:
        self.report({"ERROR"}, sentence)  # the sidebar's lines tell of the last take, and stay
        return {"CANCELLED"}


def _asked(scene: bpy.types.Scene) -> TakeSpec:
    """The enabled goals that have an object; GoalError on a row whose stored action is unknown."""
    from ...prepare import TakeSpec

    settings = settings_of(scene)
    rows = [(n, goal) for n, goal in enumerate(queue_of(scene).goals, 1) if _has_point(goal)]
    return TakeSpec(settings.character, [spec_of_row(row, number) for number, row in rows])


class NSM_OT_door_swing(WhileIdle, bpy.types.Operator):
    bl_idname = "nsm.door_swing"
    bl_label = "Swing to the Other Side"
    bl_description = (
        "Have the door of the chosen goal open to its other side. Its hinge point, made where it has none, "
        "keeps the choice as "
        "the property nsm_swing: 1 turns the leaf counter-clockwise seen from above, -1 clockwise"
    )

    @classmethod
    def reason_not(cls, context: bpy.types.Context) -> str:
        from ...goals.registry import FINDERS

        goal = _active_goal(context)
        action = action_of(goal) if goal is not None and goal.object is not None else None
        if action is None or not FINDERS[action.key].swings:
            return "The chosen goal opens no door; choose one that does."
        return ""

    @telling
    def execute(self, context: bpy.types.Context) -> None:
        from ...goals.points import HINGE, SWING, goal_point_of
        from ...goals.resolve import show_goal_point
        from ...prepare import start_of

        spec = spec_of_row(_active_goal(context))
        # The scene is read for a door without one alone.
        hinge = goal_point_of(context.scene, spec.object, HINGE)
        if hinge is None:
            frame, start = start_of(settings_of(context.scene).character, context.scene)
            hinge = show_goal_point(spec, context.scene, frame, start)
        hinge[SWING] = -1 if int(hinge.get(SWING) or 1) > 0 else 1


def _frame_of(character: bpy.types.Object | None, scene: bpy.types.Scene) -> WorldFrame:
    """The size by which objects are judged: the character's, or that of a person in the scene's units."""
    from ...prepare import require_character
    from ...world.frame import WorldFrame

    try:
        require_character(character, scene)
        return WorldFrame.of(character)
    except NsmError:
        return WorldFrame(scale=1.0 / max(scene.unit_settings.scale_length, 1e-6))


def _has_point(goal: NsmGoal) -> bool:
    """Whether a row asks for something at an object; one whose action is unknown is told when it is read."""
    return goal.enabled and goal.object is not None and getattr(action_of(goal), "aim", None) is not Aim.HERE


def _is_place(goal: NsmGoal) -> bool:
    return getattr(action_of(goal), "aim", None) is Aim.PLACE


def _active_goal(context: bpy.types.Context) -> NsmGoal | None:
    queue = queue_of(context.scene)
    return queue.goals[queue.active_goal] if 0 <= queue.active_goal < len(queue.goals) else None


def _select(context: bpy.types.Context, objects: list[bpy.types.Object]) -> None:
    """Select these objects alone, where the mode and their visibility let them be."""
    seen = [o for o in objects if o.visible_get()]
    if context.mode != "OBJECT" or not seen:
        return
    for selected in context.selected_objects:
        selected.select_set(False)
    for chosen in seen:
        chosen.select_set(True)
    context.view_layer.objects.active = seen[-1]


CLASSES = (
    NSM_OT_goal_add,
    NSM_OT_goal_remove,
    NSM_OT_goal_move,
    NSM_OT_goal_to_cursor,
    NSM_OT_goal_points,
    NSM_OT_door_swing,
)
