"""The cases of the fault table: each opens a room, disturbs one take, and says what is wrong afterwards."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
from disks import disk_cases
from events import AS_SHOWN, EVENTS, OF_THE_FILE, show, shown
from everything import difference, digest
from flow import MOMENTS, Flow, Gate, Rooms, again, clean_up, gated, growing_by
from injected import ERRORS, counted, injected
from states import STATES

import nsm_blender
from nsm_core.errors import NsmError

GROUPS = (
    "escapes", "events", "raised", "states", "reviews", "characters", "points", "fills", "disks",
)  # fmt: skip
AS_BEFORE, WHOLE = "as before", "the whole take"


@dataclass
class Case:
    """One fault: its group, what it is, and how it goes: what the file then holds, and what is wrong."""

    group: str
    name: str
    run: Callable[[], tuple[str, list[str]]]

    def go(self) -> tuple[str, list[str]]:
        """Run it; a defect of the case itself is a fault, too."""
        try:
            return self.run()
        except Exception as error:
            return "", [f"{type(error).__name__}: {error}"]
        finally:
            clean_up()


class Cases:
    """All cases, over rooms of their own."""

    def __init__(self, folder: Path | None = None, rooms: tuple[str, ...] = ("walk", "carry", "sit")) -> None:
        self.escaped = rooms  # where ESC is pressed at every tenth frame
        self.rooms = Rooms(folder or Path(tempfile.mkdtemp()))
        self._states: dict[Any, dict[str, Any]] = {}

    def all(self, groups: Sequence[str] = ()) -> Iterator[Case]:
        """Every case of these groups, of all where none is named."""
        for name in groups or GROUPS:
            yield from getattr(self, name)()

    # ------------------------------------------------------------ ESC

    def escapes(self) -> Iterator[Case]:
        for room in self.escaped:
            for frame in range(1, self.rooms.motion(room).frames, 10):
                yield Case("ESC", f"{room}, at frame {frame}", lambda r=room, f=frame: self._escape(r, f))
            for moment in MOMENTS:
                yield Case("ESC", f"{room}, {moment}", lambda r=room, m=moment: self._escape(r, moment=m))

    def _escape(self, room: str, frame: int | None = None, moment: str = "") -> tuple[str, list[str]]:
        gate = Gate(2 if frame is None else frame)
        runner = again(self.rooms.motion(room), gate) if frame is None else gated(gate)
        with growing_by(runner):
            before, flow = self._begun(room, gate)
            if frame is not None:
                flow._until(gate.reached.is_set)
                flow.tick()
            else:
                if moment in ("keying", "checking"):
                    gate.open()
                flow.to(moment)
            flow.escape()
            return self._judged(flow, room, [before])

    # ------------------------------------------------------------ what happens meanwhile

    def events(self) -> Iterator[Case]:
        for name in EVENTS:
            for moment in MOMENTS:
                yield Case("meanwhile", f"{name}, {moment}", lambda n=name, m=moment: self._event(n, m))

    def _event(self, name: str, moment: str) -> tuple[str, list[str]]:
        room, gate = "carry", Gate(2)
        with growing_by(again(self.rooms.motion(room), gate)):
            self._open(room, name)
            before, flow = digest(), Flow(gate)
            flow.start()
            if moment in ("keying", "checking"):
                gate.open()
            flow.to(moment)
            seen = shown() if name == AS_SHOWN else ()
            EVENTS[name]()
            flow.finish()

            # What is keyed shows at once or with the next frame.
            shows = (False, True) if seen else (False,)

            def after(take: str = "") -> list[Callable[[], dict[str, Any]]]:
                return [lambda now=now: self._after(room, name, take, seen, now) for now in shows]

            # What was done meanwhile stays, whether the take came about or not; but for what undoes or leaves
            # the file, of which nothing was done by others.
            allowed, whole = after(), [*after("first"), *after("last")]
            if name in OF_THE_FILE:
                allowed, whole = [*allowed, lambda: before], [*whole, lambda: self.rooms.whole(room)]
            return self._judged(flow, room, allowed, whole, _one_name if "renamed" in name else lambda d: d)

    def _after(self, room: str, name: str, take: str, seen: tuple, now: bool) -> dict[str, Any]:
        """The room after an event alone, or with a take that nothing disturbs before or after it; ``seen`` is
        the pose that the event keys, and ``now``, whether what it has keyed already shows.
        """
        key = room, name, take, seen, now
        if key not in self._states:
            with growing_by(again(self.rooms.motion(room))):
                self._open(room, name)
                if take == "first":
                    self._take()
                looks = shown()
                if seen:
                    show(seen)
                EVENTS[name]()
                if seen:
                    show(looks)
                if now:
                    bpy.data.objects["Hero"].update_tag(refresh={"TIME"})
                if take == "last" and hasattr(bpy.types.Scene, "nsm"):
                    self._take()
                self._states[key] = digest()
                clean_up()
        return self._states[key]

    def _take(self) -> None:
        flow = Flow()
        flow.start()
        flow.finish()

    def _open(self, room: str, event: str) -> None:
        self.rooms.open(room)
        if event in ("undo", "redo"):
            bpy.ops.ed.undo_push(message="laid out")
            bpy.data.objects["Bystander"]["mood"] = "tense"
            bpy.ops.ed.undo_push(message="changed")
            if event == "redo":
                bpy.ops.ed.undo()

    # ------------------------------------------------------------ exceptions

    def raised(self) -> Iterator[Case]:
        """An exception at the first, and at a middle call of every function that a take calls."""
        number = 0
        for room, replayed in (("carry", True), ("walk", False)):
            motion = self.rooms.motion(room)
            self.rooms.open(room)
            with growing_by(again(motion)) if replayed else growing_by(type(motion).__mro__[1]):
                flow = Flow()
                with counted() as calls:
                    flow.start()
                    flow.finish()
            for (file, name), count in calls.items():
                if replayed == file.startswith("nsm_core/control"):
                    continue
                if not replayed and not file.startswith(
                    ("nsm_core/control", "nsm_core/model", "nsm_core/body")
                ):
                    continue
                for call in sorted({1, (count + 1) // 2} if replayed else {1}):
                    error = ERRORS[number % len(ERRORS)]
                    number += 1
                    title = f"{type(error).__name__} in {file[:-3]}.{name}" + (
                        f", call {call}" if call > 1 else ""
                    )
                    point = (file, name, call)
                    yield Case(
                        "exception",
                        title,
                        lambda r=room, p=point, e=error, a=replayed: self._raise(r, p, e, a),
                    )

    def _raise(self, room: str, point, error: BaseException, replayed: bool) -> tuple[str, list[str]]:
        motion = self.rooms.motion(room)
        with growing_by(again(motion)) if replayed else growing_by(type(motion).__mro__[1]):
            before, flow = self._begun(room, start=False)
            with injected(point, error) as raised:
                flow.start()
                flow.finish()
            outcome = self._judged(flow, room, [before], [lambda: self.rooms.whole(room)])
            if not raised and point[2] > 1:  # how often it is called goes by the clock: an earlier call
                return self._raise(room, (*point[:2], point[2] // 2), error, replayed)
            if not raised:
                outcome[1].append("nothing was raised")
            return outcome

    # ------------------------------------------------------------ states of files

    def states(self) -> Iterator[Case]:
        for name in STATES:
            for what in (
                "rejected",
                "ESC while growing",
                "ESC while keying",
                "ESC while checking",
                "error at the end",
            ):
                yield Case("state", f"{name}, {what}", lambda n=name, w=what: self._state(n, w))

    def _state(self, name: str, what: str) -> tuple[str, list[str]]:
        room, gate = "carry", Gate(2)
        with growing_by(again(self.rooms.motion(room), gate)):
            self.rooms.file(room).chmod(0o644)
            self.rooms.open(room)
            STATES[name]()
            bpy.context.view_layer.update()
            before, flow = digest(), Flow(gate)
            if what == "error at the end":
                with injected(("keys/report.py", "build_report", 1), RuntimeError("injected")):
                    flow.start()
                    flow.finish()
            elif what == "rejected":
                flow.start()
                if flow.finish() == "whole":
                    if not nsm_blender.ui.reviews.pending(bpy.context.scene):
                        return "", ["the take is not offered for review"]
                    bpy.ops.nsm.take_reject()
            else:
                flow.start()
                if what != "ESC while growing":
                    gate.open()
                flow.to(what.removeprefix("ESC while "))
                flow.escape()
            return self._judged(flow, room, [before])

    # ------------------------------------------------------------ reviews

    def reviews(self) -> Iterator[Case]:
        """An exception at every function of Reject, and of a second take in the place of the first."""
        for what in ("reject", "accept", "another take"):
            self._reviewed(what, prepare=True)
            with counted() as calls:
                self._review(what)
            names = [
                k
                for k in calls
                if what != "another take" or k[0].endswith(("reviews.py", "generate.py", "kept.py"))
            ]
            for number, (file, name) in enumerate(names):
                error = ERRORS[number % len(ERRORS)]
                yield Case(
                    "review",
                    f"{what}, {type(error).__name__} in {file[:-3]}.{name}",
                    lambda w=what, p=(file, name, 1), e=error: self._reviewed(w, p, e),
                )

    def _reviewed(self, what: str, point=None, error=None, prepare: bool = False):
        room = "carry"
        with growing_by(again(self.rooms.motion(room))):
            self.rooms.open(room)
            self._take()
            if prepare:
                return None
            before = digest()
            with injected(point, error) as raised:
                self._review(what)
            after = digest()
            if ("review", what) not in self._states:
                self.rooms.open(room)
                self._take()
                self._review(what)
                self._states["review", what] = digest()
            wrong = [] if raised else ["nothing was raised"]
            if not difference(before, after):
                return AS_BEFORE, wrong
            lines = difference(self._states["review", what], after)
            return WHOLE, wrong + (lines and [*difference(before, after)[:6], "or", *lines[:6]])

    def _review(self, what: str) -> None:
        try:
            if what == "another take":
                with growing_by(again(self.rooms.motion("carry"))):
                    self._take()
            else:
                getattr(bpy.ops.nsm, f"take_{what}")()
        except (
            RuntimeError,
            NsmError,
            KeyboardInterrupt,
        ):  # what the operator has raised, as Blender tells it
            pass

    # ------------------------------------------------------------ adding a character, goal points

    def characters(self) -> Iterator[Case]:
        yield from self._of_operator("Add Character", bpy.ops.nsm.add_character, "walk")
        yield from self._of_operator("Example Scene", bpy.ops.nsm.example, "walk")

    def points(self) -> Iterator[Case]:
        yield from self._of_operator("Show Goal Points", bpy.ops.nsm.goal_points, "carry")

    def fills(self) -> Iterator[Case]:
        yield from self._of_operator("Fill", bpy.ops.nsm.fill, "walk")

    def _of_operator(self, title: str, call: Callable[[], object], room: str) -> Iterator[Case]:
        for _ in range(2):  # what is kept in memory from the first one is not done again
            self.rooms.open(room)
            with counted() as calls:
                call()
        chosen = list(calls)[:: max(1, len(calls) // 24)]
        for number, (file, name) in enumerate(chosen):
            error = ERRORS[number % len(ERRORS)]
            yield Case(
                title,
                f"{type(error).__name__} in {file[:-3]}.{name}",
                lambda p=(file, name, 1), e=error: self._operator(call, room, p, e),
            )

    def _operator(self, call, room: str, point, error) -> tuple[str, list[str]]:
        self.rooms.open(room)
        before = digest()
        with injected(point, error) as raised:
            try:
                call()
            except (RuntimeError, KeyboardInterrupt):
                pass
        after = digest()
        wrong = [] if raised else ["nothing was raised"]
        if not difference(before, after):
            return AS_BEFORE, wrong
        if (room, call) not in self._states:
            self.rooms.open(room)
            call()
            self._states[room, call] = digest()
        lines = difference(self._states[room, call], after)
        return WHOLE, wrong + (lines and [*difference(before, after)[:6], "or", *lines[:6]])

    # ------------------------------------------------------------ disks

    def disks(self) -> Iterator[Case]:
        """Full and locked disks, and exceptions in a batch job."""
        return (Case("disk", name, run) for name, run in disk_cases(self.rooms))

    # ------------------------------------------------------------ what all have

    def _begun(self, room: str, gate: Gate | None = None, start: bool = True) -> tuple[dict[str, Any], Flow]:
        self.rooms.open(room)
        before, flow = digest(), Flow(gate)
        if start:
            flow.start()
        return before, flow

    def _judged(
        self, flow: Flow, room: str, before: list, whole: list = (), seen=lambda d: d
    ) -> tuple[str, list[str]]:
        """What the file holds now, and what is wrong with it; ``seen`` through what digests are compared."""
        wrong, after = flow.leftovers(), seen(digest())
        closest: list[str] = []
        for name, states in ((AS_BEFORE, before), (WHOLE, whole)):
            for state in states:
                lines = difference(seen(state() if callable(state) else state), after)
                if not lines:
                    return name, wrong
                closest = lines if not closest or len(lines) < len(closest) else closest
        return "", [*wrong, *closest[:8]]


def _one_name(held: dict[str, Any]) -> dict[str, Any]:
    """A digest with the old names: actions are named after what something was called by then."""
    return {str(k).replace(" renamed", ""): str(v).replace(" renamed", "") for k, v in held.items()}
