"""The whole way of a take, from the click to the review, driven step by step as a window would; the rooms.

A take's motion is grown once and then shown again from memory, so that hundreds of faults take minutes; all
else is the real thing in every case.  ``Flow.to`` stops at a moment of the way, and the thread that makes the
motion waits there until it may go on.
"""

from __future__ import annotations

import copy
import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import ClassVar

import bpy
from everything import difference, digest
from modal import Modal, Window
from scenes import box, empty

import nsm_blender
from nsm_blender import takes
from nsm_blender.rigs.character import add_character
from nsm_blender.ui import running
from nsm_blender.ui.operators import modal as operator
from nsm_blender.ui.properties import queue_of
from nsm_core.control.take import TakeRunner
from nsm_core.errors import NsmError

MOMENTS = ("begun", "reading", "growing", "keying", "checking")
_STAGES = {"keying": "Making keys", "checking": "Checking"}
# What a take may change: these, and nothing else of the file.
_OF_A_TAKE = (
    "actions", "objects[Box]", "objects[Hero]", "objects[Mannequin", "scenes[Scene].nsm.active_take",
    "scenes[Scene].nsm.seed", "scenes[Scene].nsm.takes",
)  # fmt: skip
_PRETENDED = 4  # steps of a motion that is shown again


# ---------------------------------------------------------------- rooms


def build_carry() -> None:
    """A character with a past carries a box with a past to a table; much else has its state."""
    scene = _stage()
    hero = _hero((0, 0, 0))
    carried = box("Box", (0.25, -1.35, 0), (0.55, -1.1, 0.3))
    table = box("Table", (1.0, -1.6, 0), (1.7, -0.9, 0.72))
    _keyed(carried, "Old of box")
    track = carried.animation_data.nla_tracks.new()
    track.strips.new("below", 1, carried.animation_data.action)
    row = queue_of(scene).goals.add()
    row.action, row.object, row.destination, row.hold = "carry", carried, table, 0.1
    _settle(scene, hero)


def build_walk() -> None:
    """A character walks a metre: the shortest way on which a network acts."""
    scene = _stage()
    hero = _hero((0, 0, 0))
    row = queue_of(scene).goals.add()
    row.action, row.location, row.hold = "walk", (0.0, -0.8, 0.0), 0.0
    _settle(scene, hero)


def build_sit() -> None:
    """A character that nobody has animated sits down on a stool."""
    scene = _stage()
    hero = add_character((0, 0, 0))
    hero.name = "Hero"
    stool = box("Stool", (-0.25, -1.3, 0), (0.25, -0.9, 0.45))
    row = queue_of(scene).goals.add()
    row.action, row.object, row.hold = "sit", stool, 0.1
    _settle(scene, hero)


ROOMS: dict[str, Callable[[], None]] = {"carry": build_carry, "walk": build_walk, "sit": build_sit}


def _stage() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps = 30
    scene["shot"] = "7A"
    scene.world = bpy.data.worlds.new("World")
    scene.camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    scene.collection.objects.link(scene.camera)
    scene.timeline_markers.new("cue", frame=12)
    bpy.data.scenes.new("Other").collection.objects.link(empty("Elsewhere", (9, 9, 0)))
    bystander = empty("Bystander", (5, 5, 0))
    bystander["mood"] = "calm"
    bystander.keyframe_insert("location", frame=1)
    bystander.animation_data.action.name = "Bystanding"
    bystander.location.z = 0.5  # and not keyed
    bystander.driver_add("scale", 0).driver.expression = "frame / 7"
    return scene


def _hero(place: tuple[float, float, float]) -> bpy.types.Object:
    hero = add_character(place)
    hero.name, hero["age"] = "Hero", 33
    people = bpy.data.collections.new("People")
    bpy.context.scene.collection.children.link(people)
    for each in (hero, *hero.children):
        each.users_collection[0].objects.unlink(each)
        people.objects.link(each)
    hero.keyframe_insert("location", frame=1)
    hips = hero.pose.bones["Hips"]
    for frame in (1, 30):
        hips.keyframe_insert("location", frame=frame)
    hero.animation_data.action.name = "Old"
    hero.pose.bones["LeftElbow"].rotation_quaternion = (0.8, 0.6, 0, 0)  # and not keyed
    hero.pose.bones["Chest"]["strength"] = 2.5
    return hero


def _keyed(target: bpy.types.Object, name: str) -> None:
    for frame in (1, 30):
        target.keyframe_insert("location", frame=frame)
    target.animation_data.action.name = name


def _settle(scene: bpy.types.Scene, hero: bpy.types.Object) -> None:
    scene.nsm.character, scene.nsm.fill.method = hero, "interpolate"
    scene.frame_set(7, subframe=0.5)
    for each in scene.objects:
        each.select_set(each.name in ("Box", "Camera"))
    bpy.context.view_layer.objects.active = hero
    hero.pose.bones["LeftElbow"].rotation_quaternion = (0.8, 0.6, 0, 0)
    bpy.data.objects["Bystander"].location.z = 0.5
    bpy.context.view_layer.update()


class Rooms:
    """The rooms as files in a folder, each built once, and the motions that were made in them."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._motions: dict[str, TakeRunner] = {}
        self._wholes: dict[str, dict] = {}

    def file(self, name: str) -> Path:
        """The room's file."""
        path = self.folder / f"{name}.blend"
        if not path.exists():
            ROOMS[name]()
            bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=False)
        return path

    def open(self, name: str) -> None:
        """Open a room: exactly the same every time."""
        bpy.ops.wm.open_mainfile(filepath=str(self.file(name)))
        bpy.context.view_layer.update()

    def motion(self, name: str) -> TakeRunner:
        """The motion of a room, grown once."""
        if name not in self._motions:
            self.open(name)
            kept: list[TakeRunner] = []

            class Kept(TakeRunner):
                def __init__(self, *args, **named) -> None:
                    super().__init__(*args, **named)
                    kept.append(self)

            with growing_by(Kept):
                flow = Flow()
                flow.start()
                flow.finish()
            self._motions[name] = kept[-1]
        return self._motions[name]

    def whole(self, name: str) -> dict:
        """What the file holds after a take that nothing has disturbed."""
        if name not in self._wholes:
            with growing_by(again(self.motion(name))):
                self.open(name)
                before, flow = digest(), Flow()
                flow.start()
                assert flow.finish() == "whole", flow.told
                self._wholes[name] = digest()
                others = difference(before, self._wholes[name])
                others = [line for line in others if not line.startswith(_OF_A_TAKE)]
                assert not others, others
        return self._wholes[name]


# ---------------------------------------------------------------- how a motion grows


class growing_by:
    """Have takes grow by a runner of one's own inside."""

    def __init__(self, runner: Callable[..., TakeRunner]) -> None:
        self.runner = runner

    def __enter__(self) -> None:
        self.before, takes.TakeRunner = takes.TakeRunner, self.runner

    def __exit__(self, *_: object) -> None:
        takes.TakeRunner = self.before


class Gate:
    """Where the thread that makes a motion waits: at the frame number ``at``, until it may go on."""

    closed: ClassVar[list[Gate]] = []

    def __init__(self, at: float = float("inf")) -> None:
        self.at, self.reached, self._open = at, threading.Event(), threading.Event()
        self.closed.append(self)

    def open(self) -> None:
        self._open.set()

    def pass_by(self, frame: int) -> None:
        if frame >= self.at:
            self.reached.set()
            self._open.wait()  # ``clean_up`` opens it at the latest


def gated(gate: Gate) -> type[TakeRunner]:
    """The real runner, which waits at a gate."""

    class Gated(TakeRunner):
        def step(self) -> bool:
            gate.pass_by(self.frames)
            return super().step()

    return Gated


def again(motion: TakeRunner, gate: Gate | None = None) -> Callable[..., TakeRunner]:
    """A runner that shows a finished motion again; the real one where it is asked for something else."""

    class Again(TakeRunner):
        def __init__(self, names: dict[str, str]) -> None:
            self.__dict__.update(motion.__dict__)
            self.shown, self.names = 0, names
            self.director = copy.copy(motion.director)  # which has come to its end
            self.director.done = False

        def step(self) -> bool:
            if gate is not None:
                gate.pass_by(self.shown)
            self.shown += 1
            self.director.done = self.shown == _PRETENDED
            return not self.director.done

        def pose(self):
            return self._frames[len(self._frames) * self.shown // (2 * _PRETENDED)][:2]

        @property
        def progress(self) -> float:
            return self.shown / _PRETENDED

        def prop_poses(self):
            return {self.names[name]: pose for name, pose in super().prop_poses().items()}

        def result(self):
            result = copy.deepcopy(motion.result())
            result.props = {self.names[name]: poses for name, poses in result.props.items()}
            return result

    def make(model, request):
        props = list(dict.fromkeys(g.prop.name for g in request.goals if g.prop is not None))
        if len(props) != len(motion.props) or len(request.goals) != len(motion.request.goals):
            return TakeRunner(model, request)
        return Again(dict(zip(motion.props, props, strict=True)))

    return make


# ---------------------------------------------------------------- the way of a take


class Flow:
    """One take from the click on; every event is one small step of it."""

    def __init__(self, gate: Gate | None = None) -> None:
        operator._BUDGET = 0.0  # every tick one step
        self.modal, self.gate = Modal(Window()), gate
        self.broken: BaseException | None = None
        self.last: set[str] = set()

    def start(self) -> None:
        """Click on Generate."""
        self._safely(lambda: self.modal._start(self.modal.window))

    def tick(self, event: str = "TIMER") -> bool:
        """Send an event; whether the take goes on."""
        self._safely(lambda: self.modal.event(event))
        return self.last == {"RUNNING_MODAL"}

    @property
    def stage(self) -> str:
        """What is being done."""
        state = running.current()
        return state.text if state is not None else ""

    def to(self, moment: str) -> bool:
        """Go on to a moment; whether the take still runs there, or was refused before."""
        if moment == "begun":
            return self.last == {"RUNNING_MODAL"}
        if moment == "reading":
            return self.tick()
        if moment == "growing":
            return self._until(lambda: self.modal._session._shown)
        return self._until(lambda: self.stage.startswith(_STAGES[moment]))

    def finish(self) -> str:
        """Go on to the end; how it came: "whole", "refused" in a sentence, or "broken" by what was raised."""
        if self.gate is not None:
            self.gate.open()
        for _ in range(100_000):
            if self.last != {"RUNNING_MODAL"} or not self.tick():
                break
        else:
            raise AssertionError(f"the take has no end: {self.stage}")
        if self.broken is not None:
            return "broken"
        return "whole" if self.last == {"FINISHED"} else "refused"

    def escape(self) -> None:
        """Press ESC, with the motion's thread let go."""
        self._safely(lambda: self.modal.event("ESC"))
        if self.gate is not None:
            self.gate.open()

    @property
    def told(self) -> str:
        """The last sentence."""
        return self.modal.reports[-1][1] if self.modal.reports else ""

    def leftovers(self) -> list[str]:
        """What of a take that is over is still there."""
        left = []
        if running.current() is not None:
            left.append("a take counts as running")
        if self.modal.window.timers or self.modal.window.status is not None:
            left.append("the window still has its timer or status line")
        if hasattr(bpy.types.Scene, "nsm") and "being generated" in running.reason_not_ready(bpy.context):
            left.append("Generate is disabled")
        return left

    def _until(self, there: Callable[[], bool]) -> bool:
        for _ in range(100_000):
            assert self.last != {"FINISHED"}, "the take has come to its end before that"
            if self.last != {"RUNNING_MODAL"}:
                return False
            if there():
                return True
            self.tick()
        raise AssertionError(f"the take does not come there: {self.stage}")

    def _safely(self, call: Callable[[], set[str]]) -> None:
        try:
            self.last = call()
        except NsmError as error:
            self.broken, self.last = error, {"CANCELLED"}
        except BaseException as error:  # Blender ends an operator that raises
            self.broken, self.last = error, {"CANCELLED"}


def clean_up() -> None:
    """Have nothing of a case that failed disturb the next one."""
    while Gate.closed:
        Gate.closed.pop().open()
    with suppress(BaseException):
        running.interrupt("")
    running.end_take()
    nsm_blender.register()
