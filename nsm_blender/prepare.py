"""What a take needs of a scene: the character where it stands, what is around it, and the goals."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import bpy
import numpy as np
from mathutils import Matrix

from nsm_core.body.capsules import Figure
from nsm_core.body.key_reduction import Bound
from nsm_core.body.skeleton import OFFSETS
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest
from nsm_core.errors import GoalError, NsmError, SkeletonError
from nsm_core.rotations import Array
from nsm_core.world.actions import BY_KEY
from nsm_core.world.scene.stairs import RISERS, Stairs

from .animation.kept import SceneState
from .animation.made import all_or_nothing
from .animation.rate import scene_fps
from .begin import (
    BEGINNINGS,
    FILL,
    POSE,
    STAND,
    began_at,
    goes_on,
    noted_stand,
    others_of,
    reading_start,
    require_at_rest,
)
from .goals.closing import last_needed
from .goals.light_things import hold_what_stays
from .goals.resolve import make_goal_point, moved_by, place_after, require_possible, resolve, sought
from .goals.spec import GoalSpec
from .keys.objects import MovedObject, require_movable, rides_along
from .keys.style import HIPS, KeyStyle
from .progress import Progress, staged, waited
from .rigs.armature import Placement, read_pose, require_skeleton
from .rigs.mount import go_to
from .rigs.skin import Skin
from .world.beside import beside
from .world.evaluated import Snapshot
from .world.frame import WorldFrame, holds
from .world.ground import floor_under
from .world.moving import characters, keyed_bodies, movers, tracks
from .world.surroundings import Surroundings

_EVEN = 5  # decimals of metres and radians to which a start is taken


@dataclass
class TakeSpec:
    """What to generate: goals for a character, where the keys start, and with which chance numbers.

    ``begin``: "stand" begins with a quiet stand where the character is at ``start_frame``; "pose" goes on
    from the pose and the pace that it has there, and keeps what is animated before; "fill" leads from that
    pose, whatever it is, to a quiet stand a second later.  ``lead``: frames before a take that begins with a
    stand from which on the way there is filled in; the character stands where it was then.

    ``in_order``: goals are performed one after the other as they are asked for, even where two things could
    be carried at once.

    ``root_motion`` is one of ``keys.style.KINDS``; ``reduce`` how far the motion may be off for fewer keys,
    None for one in every frame; ``keep_edits`` whether the animator's keys in the take that plays now go into
    another one that begins with the same frame; ``variations`` how many seeds are tried, from ``seed`` on
    (``variations.generate_variations``).
    """

    character: bpy.types.Object
    goals: list[GoalSpec]
    name: str = ""
    start_frame: float = 1
    seed: int = 0
    contact_ik: bool = True
    in_order: bool = False
    begin: str = STAND
    root_motion: str = HIPS
    reduce: Bound | None = None
    keep_edits: bool = True
    variations: int = 1
    lead: int = 0

    def __post_init__(self) -> None:
        if self.begin not in BEGINNINGS:
            raise GoalError(f'A take cannot begin with "{self.begin}"; give "{POSE}", "{STAND}" or "{FILL}".')

    def style(self) -> KeyStyle:
        """How its keys are made."""
        return KeyStyle(self.root_motion, self.reduce, self.keep_edits)

    def title(self) -> str:
        """Name of the take and of its action: as asked for, else after its goals."""
        return self.name or ", ".join(f"{g.action} {g.label}" for g in self.goals[:3])


@dataclass
class Company:
    """All ``characters`` that act together, and what any of them moves: no part of what stands."""

    characters: list[bpy.types.Object]
    moving: list[bpy.types.Object]


def prepare(
    spec: TakeSpec, scene: bpy.types.Scene, company: Company | None = None, needs_goals: bool = True
) -> Generator[Progress, None, tuple[TakeRequest, WorldFrame, dict[str, MovedObject]]]:
    """Gather what a take needs from the scene as it is at the take's first frame, in slices; the current
    frame is put back.

    The last of the generator's value are the objects that it moves, by their names.  ``company`` are those
    who act with it.
    """
    require_character(spec.character, scene)
    if needs_goals and not spec.goals:
        raise GoalError("There is no goal to go to; add one to the list, or enable one.")
    state = SceneState(scene, spec.character)
    try:
        _go_to(scene, spec.start_frame - spec.lead)
        frame, start = start_of(spec.character, scene)
        _go_to(scene, spec.start_frame)
        continues = spec.begin == POSE and goes_on(spec.character, spec.start_frame)
        if not continues and began_at(spec.character, spec.start_frame):
            start = noted_stand(spec.character, frame) or start
        start = start[0].round(_EVEN), round(start[1], _EVEN)  # the same again, whatever it was read from
        moving = moved_by(spec.goals)
        moving_alone = [o for o in moving if not rides_along(o, moving)]
        require_possible(spec.goals, scene)
        for target in moving_alone:
            require_movable(target, spec.character)
        places = {o: o.matrix_world.copy() for o in (spec.character, *moving_alone)}
        held = [*moving, *(others_of(spec.character, scene) if spec.begin == POSE or spec.lead else ())]
        if company is not None:
            held += [*company.characters, *company.moving]
        look = tracks(scene, spec.character, held, spec.start_frame, scene_fps(scene))
        found = yield from staged("Looking for what moves", look)
        look_for = characters(scene, [spec.character, *held], spec.start_frame, scene_fps(scene))
        actors = yield from staged("Looking for who moves", look_for)
        _go_to(scene, spec.start_frame)
        around = yield from surroundings_of(
            spec, scene, frame, [*moving, *(m.owner for m in (*found, *actors))], company
        )
        about = movers(found, around.solids, frame) + keyed_bodies(actors, frame)
        goals = yield from staged(
            "Finding the goals",
            beside(lambda _: resolve_goals(spec, scene, frame, start, around), touches=True),
        )
        _go_to(scene, spec.start_frame)
        _require_still(places)
        aside = [o for o in around.left if o not in moving]  # which was found to be in the way
        things = {
            target.name: MovedObject.of(target, frame, around.left[target][0])
            for target in (*moving_alone, *aside)
        }
        environment, ground = around.query, around.ground
        figure = yield from figure_of(spec.character)
        motion = None
        if continues:
            require_at_rest(spec.character, scene, spec.start_frame)
            motion = yield from reading_start(spec.character, scene, frame, spec.start_frame, around)
    finally:
        state.restore()
    height = 0.0 if motion is None else float(motion.hips[-1, 2]) - float(OFFSETS[0, 2])
    stairs = _stairs(around, np.append(start[0], height), goals)
    request = TakeRequest(
        start_position=start[0],
        start_heading=start[1],
        goals=goals,
        environment=environment,
        seed=spec.seed,
        contact_ik=spec.contact_ik,
        in_order=spec.in_order,
        ground=ground,
        figure=figure,
        start=motion,
        movers=about,
        stairs=stairs,
    )
    return request, frame, things


def _stairs(around: Surroundings, start: Array, goals: list[Goal]) -> Stairs:
    """The flights that have to be walked from ``start`` (3,); they are looked for where anything is up
    there.
    """
    places = [g.position for g in goals if not (BY_KEY[g.action].moves or BY_KEY[g.action].seats)]
    if max(float(start[2]), *(float(place[2]) for place in places), 0.0) < RISERS[0]:
        return Stairs()
    return around.stairs.asked_for(start, places)


def _require_still(places: dict[bpy.types.Object, Matrix]) -> None:
    """Raise GoalError where something was moved while the scene was read: its take would miss it."""
    for target, before in places.items():
        pairs = zip(target.matrix_world, before, strict=True)
        each = (pair for rows in pairs for pair in zip(*rows, strict=True))
        if any(abs(a - b) > 1e-4 * max(1.0, abs(b)) for a, b in each):
            raise GoalError(
                f"{target.name} was moved while the scene was read, so nothing was keyed; generate again."
            )


def show_goal_points(
    spec: TakeSpec, scene: bpy.types.Scene
) -> Generator[Progress, None, tuple[list[bpy.types.Object], list[str]]]:
    """Show the goal points of a take's goals, reading the scene in slices: the points, and what is to be told
    of them.

    The goals are looked for in the scene as it is now.  One that has no point is told in its sentence, the
    others are shown.
    """
    state, points, told = SceneState(scene, spec.character), list[bpy.types.Object](), list[str]()
    found = []
    try:
        frame, start = start_of(spec.character, scene)
        now = replace(spec, start_frame=scene.frame_current + scene.frame_subframe)
        around = yield from surroundings_of(now, scene, frame, moved_by(spec.goals))
        for goal in spec.goals:
            steps = beside(lambda _, goal=goal: sought(goal, scene, frame, start, around), touches=True)
            try:
                found.append((goal, *(yield from staged("Finding the goals", steps))))
            except NsmError as error:
                told.append(str(error))
    finally:
        state.restore()
    with all_or_nothing():  # at the end: what is broken off before has made none
        for goal, aim, reason in found:
            try:
                points.append(make_goal_point(goal, scene, frame, around, aim, reason, told))
            except NsmError as error:
                told.append(str(error))
    return points, told


def surroundings_of(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    moving: list[bpy.types.Object],
    company: Company | None = None,
) -> Generator[Progress, None, Surroundings]:
    """Read what is solid around a take at its first frame: the meshes are copied in slices, the rest is done
    by a thread.
    """

    def evaluated() -> bpy.types.Depsgraph:
        _go_to(scene, spec.start_frame)  # whatever the window has done between two slices
        return bpy.context.evaluated_depsgraph_get()

    seen = yield from staged("Reading the scene", Snapshot.take(evaluated))
    around = Surroundings(scene, frame, spec.character, moving, seen)
    around.last_needed = last_needed(spec.goals)
    if company is not None:
        around.leave_out(company.characters, company.moving)
    goals = [o for g in spec.goals for o in (g.object, g.to) if o is not None and holds(scene, o)]
    yield from waited("Reading the scene", around.reading(*goals))
    _go_to(scene, spec.start_frame)
    return around


def _go_to(scene: bpy.types.Scene, frame: float) -> None:
    if scene.frame_current + scene.frame_subframe != frame:
        go_to(scene, frame)


def figure_of(character: bpy.types.Object) -> Generator[Progress, None, Figure]:
    """The body that a character's skin shows."""
    skin = yield from staged("Reading the body", Skin.reading(character, Placement.of(character)))
    return (yield from waited("Reading the body", lambda _: skin.figure()))


def resolve_goals(
    spec: TakeSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    start: tuple[Array, float],
    around: Surroundings,
) -> list[Goal]:
    """Build the core's goals in their order; each knows from where the character comes and what was moved by
    then.
    """
    goals: list[Goal] = []
    before = start
    for asked in spec.goals:
        goals.append(timed(resolve(asked, scene, frame, before, around), asked, spec, scene))
        before = place_after(goals[-1], before, around)
    hold_what_stays(around)
    return goals


def timed(goal: Goal, asked: GoalSpec, spec: TakeSpec, scene: bpy.types.Scene) -> Goal:
    """A goal that is to be reached at a frame of the scene, seconds from the take's first frame."""
    if asked.by is None:
        return goal
    seconds = (asked.by - spec.start_frame) / scene_fps(scene)
    if seconds <= 0:
        raise GoalError(
            f"{goal.name} is to be reached at frame {asked.by:g}, before the take begins at frame "
            f"{spec.start_frame:g}; choose a later frame."
        )
    return replace(goal, by=seconds)


def start_of(
    character: bpy.types.Object | None, scene: bpy.types.Scene
) -> tuple[WorldFrame, tuple[Array, float]]:
    """The character's frame, and its ground point (2,) and heading in it as posed now; SkeletonError if it
    cannot act.
    """
    require_character(character, scene)
    frame, pose = WorldFrame.of(character), read_pose(character)
    here = np.array((*pose.position[:2], frame.floor))
    frame = replace(frame, floor=floor_under(here, frame.scale, scene, own_objects(character, scene)))
    return frame, (frame.to_core(np.append(pose.position, 0.0))[:2].astype(np.float32), pose.heading)


def own_objects(character: bpy.types.Object, scene: bpy.types.Scene) -> set[bpy.types.Object]:
    """The character's armature, its children and every mesh that it deforms."""
    own = {character, *character.children_recursive}
    for candidate in scene.objects:
        if any(m.type == "ARMATURE" and m.object == character for m in candidate.modifiers):
            own.add(candidate)
    return own


def require_character(character: bpy.types.Object | None, scene: bpy.types.Scene) -> None:
    """Raise SkeletonError unless ``character`` is a usable armature in the scene."""
    if character is None:
        raise SkeletonError("No character is chosen; choose its armature, or add the bundled character.")
    if not holds(scene, character):
        raise SkeletonError(
            f"The character {character.name} is no longer in the scene; choose another one, or add the "
            "bundled character."
        )
    require_skeleton(character)
