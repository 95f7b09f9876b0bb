"""Show the whole path: rooms and a character by code, a take of every action, and its scene, pictures and
report.

``python nsm_blender/demo.py --out out/demo`` under the bpy wheel, or
``blender --background --python nsm_blender/demo.py -- --out out/demo``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

if not __package__:  # run as a script: make the repository importable and this file part of its package
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
    __package__ = "nsm_blender"

import bpy
from mathutils import Vector

from nsm_core.errors import GoalError, NsmError
from nsm_core.world.assets.tea_kitchen import TEA

from . import takes
from .demo_scene.house import House, build_house
from .demo_scene.kitchen import build_kitchen
from .demo_scene.kitchen_take import kitchen_goals
from .demo_scene.room import DemoRoom, build_room
from .goals.spec import GoalSpec
from .keys.report import goal_line
from .leaving import leave
from .outlook import outlook
from .overlays.picture import View, overlay_sheet
from .pictures import outputs, render
from .progress import finish
from .rigs.character import add_character

FPS = 30


def main(arguments: Sequence[str]) -> int:
    """Run the demo and return the exit code: 0 when the character reached all its goals, else 1."""
    options = _parser().parse_args(arguments)
    try:
        return make_demo(options) if options.kitchen is None else show_kitchen(options)
    except NsmError as error:
        print(f"The demo stopped: {error}", file=sys.stderr)
        return 1


def make_demo(options: argparse.Namespace) -> int:
    """Make room, character and take, write every file into ``options.out`` and print the report."""
    _require_writable(options, "demo")
    room, character = build_scene(options.second_seat, not options.two_seats)
    return perform(options, "demo", room, character, goals_in(room, options.hold))


def show_kitchen(options: argparse.Namespace) -> int:
    """Build the kitchen of a seed, everything shut, and have a character make tea, or bring things to its
    table; without a take it is saved as it is.
    """
    _require_writable(options, "kitchen")
    scene = _empty_scene()
    room, kitchen = build_kitchen(options.kitchen)
    _light_and_look(scene, room)
    parts = sum(len(c.parts) for c in kitchen.containers.values())
    furniture, things = len(kitchen.containers), len(kitchen.things)
    print(
        f"Kitchen {kitchen.seed}: {furniture} pieces of furniture, {parts} parts that open, {things} things."
    )
    if options.no_take:
        out = Path(options.out).absolute() / "kitchen.blend"
        outputs.save_blend(out, compress=True)
        print(f"  {out}")
        return 0
    character = add_character((*room.start, 0.0))
    bpy.context.view_layer.update()
    goals = kitchen_goals(kitchen, character, scene)
    if not goals:
        raise GoalError("No hand gets at anything that is shut away in this kitchen; choose another seed.")
    return perform(options, "kitchen", room, character, goals)


def _require_writable(options: argparse.Namespace, stem: str) -> None:
    for ending in ("blend", "png", "mp4", "json"):
        outputs.require_writable(Path(options.out).absolute() / f"{stem}.{ending}")


def perform(
    options: argparse.Namespace, stem: str, room: DemoRoom, character: bpy.types.Object, goals: list[GoalSpec]
) -> int:
    """Make the take of a room's goals, write its files, called ``stem``, into ``options.out`` and print the
    report.
    """
    began, out, scene = time.perf_counter(), Path(options.out).absolute(), bpy.context.scene
    plan = ", ".join(f"{goal.action} {goal.label}" for goal in goals)
    print(f"Room with {len(room.objects)} objects; {character.name} is to {plan}.", flush=True)
    spec = takes.TakeSpec(
        character,
        goals,
        name=stem.capitalize(),
        start_frame=1,
        seed=options.seed,
        contact_ik=not options.no_contact_ik,
    )
    lines = [Line("Take"), Line("Contact sheet"), Line("Video")]
    before = finish(outlook(spec, scene)) if options.overlays else None
    with lines[0] as line:
        take = _generate(spec, scene, line)
    scene.frame_start, scene.frame_end = take.keyed.frame_start, take.keyed.frame_end
    scene.frame_set(scene.frame_start)
    outputs.save_blend(out / f"{stem}.blend", compress=True)
    outputs.write_json(out / f"{stem}.json", take.report)
    with lines[1] as line:
        render.contact_sheet(
            take.keyed, out / f"{stem}.png", tiles=options.tiles, direction=room.view, progress=line
        )
    if options.overlays:
        overlay_sheet(take.keyed, out / "overlays.png", overlay_views(take), before, direction=room.view)
    if not options.no_video:
        with lines[2] as line:
            size = (options.width, options.width * 9 // 16)
            render.video(take.keyed, out / f"{stem}.mp4", size, options.video_step, room.view, progress=line)
    print_report(take.report)
    more = {f"{stem}.mp4": not options.no_video, "overlays.png": options.overlays}
    written = (f"{stem}.{ending}" for ending in ("blend", "png", "json"))
    for name in (*written, *(name for name, made in more.items() if made)):
        print(f"  {out / name}")
    parts = ", ".join(f"{line.label.lower()} {line.spent:.0f} s" for line in lines if line.spent)
    motion = take.report["frames"] / take.report["fps"]
    print(f"Done in {time.perf_counter() - began:.0f} s ({parts}) for {motion:.0f} s of motion.", flush=True)
    return 0 if all(goal["reached"] for goal in take.report["goals"]) else 1


def overlay_views(take: takes.Take) -> list[View]:
    """Moments of a take at which its overlays tell most: before it, on the way, at the first goal, and where
    something is held.
    """
    first, goals = take.keyed.frame_start, take.result.goals
    at = [first + (goal.start_frame + goal.end_frame) // 2 for goal in goals]
    seated = first + goals[0].end_frame
    held = next((first + g.taken.frame for g in goals if g.taken is not None and g.taken.frame > 0), at[-1])
    return [
        View(("colliders", "goals", "way"), first, whole=True),
        View(("environment",), at[0]),
        View(("trajectories", "gating"), at[0]),
        View(("interaction", "goals"), seated),
        View(("interaction", "goals"), held),
        View(("environment", "trajectories"), at[-1]),
    ]


def goals_in(room: DemoRoom, hold: float = 2.0) -> list[GoalSpec]:
    """What the character does in a room: the goals that come with it, or to sit on each seat.

    ``hold`` seconds are stayed where the room does not say how long.
    """
    if isinstance(room, House):
        return [replace(goal, hold=hold) if goal.hold == GoalSpec.hold else goal for goal in room.goals]
    return [GoalSpec("sit", bpy.data.objects[name], hold=hold) for name in room.seats]


def build_scene(second_seat: str = "armchair", all_actions: bool = True) -> tuple[DemoRoom, bpy.types.Object]:
    """Replace the open file by the demo's room with the character in it; returns room and armature.

    ``all_actions`` builds two rooms with a door, a box and a podium; without, one room with a chair and a
    ``second_seat``.
    """
    scene = _empty_scene()
    room = build_house() if all_actions else build_room(second_seat=second_seat)
    character = add_character((*room.start, 0.0))
    character.rotation_euler = (0, 0, room.start_heading)
    _light_and_look(scene, room)
    return room, character


def _empty_scene() -> bpy.types.Scene:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = FPS, 1.0
    return scene


def print_report(report: dict[str, Any]) -> None:
    """Print what a take's report says, goal by goal."""
    print(f"\n{report['name']}: {report['frames']} frames at {report['fps']} frames a second")
    for goal in report["goals"]:
        print(f"  {goal_line(goal)}")
        if isinstance(goal.get("hand_error_cm"), int | float):
            print(f"    hands {goal['hand_error_cm']:.2f} cm off where they take hold of it")
    for key, label, unit in (
        ("foot_sliding_cm_s", "foot sliding", "cm/s"),
        ("planted_share", "planted share", ""),
        ("top_speed_m_s", "hips at most", "m/s"),
        ("penetration_cm", "deepest contact", "cm"),
    ):
        if isinstance(report.get(key), int | float):
            print(f"  {label:15} {report[key]:6.2f} {unit}")
    stages = report.get("ms_per_frame", {})
    print(
        "  ms per frame    "
        + ", ".join(f"{stage} {ms:.1f}" for stage, ms in stages.items() if isinstance(ms, int | float))
    )


class Line:
    """A progress line with the time left; where the output is no terminal, a line every quarter."""

    def __init__(self, label: str) -> None:
        self.label, self.began, self.quarter, self.spent = label, 0.0, 0, 0.0
        self.live = sys.stdout.isatty()

    def __call__(self, fraction: float) -> None:
        """Show that ``fraction`` (0..1) is done."""
        spent = time.perf_counter() - self.began
        left = f", {spent / fraction * (1 - fraction):.0f} s left" if fraction > 0.02 else ""
        if self.live:
            bar = "#" * round(24 * fraction)
            print(f"\r{self.label:14} [{bar:24}] {fraction:4.0%}{left}    ", end="", flush=True)
        elif int(4 * fraction) > self.quarter:
            self.quarter = int(4 * fraction)
            print(f"{self.label}: {fraction:.0%}{left}", flush=True)

    def __enter__(self) -> Line:
        self.began = time.perf_counter()
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self.spent = time.perf_counter() - self.began
        end = f"{self.label:14} {'done' if kind is None else 'stopped'} after {self.spent:.1f} s"
        print(f"\r{end:70}" if self.live else end.strip(), flush=True)


def _generate(spec: takes.TakeSpec, scene: bpy.types.Scene, line: Line) -> takes.Take:
    steps = takes.generate(spec, scene)
    while True:
        try:
            line(next(steps).fraction)
        except StopIteration as stop:
            return stop.value


def _light_and_look(scene: bpy.types.Scene, room: DemoRoom) -> None:
    """A camera over the whole room, a sun, a bright world and coloured viewports, for whoever opens
    the file.
    """
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    direction = Vector(room.view).normalized()
    camera.data.lens = 32
    camera.location = Vector(room.middle) + direction * room.distance
    camera.rotation_euler = direction.to_track_quat("Z", "Y").to_euler()
    sun = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
    sun.data.energy = 3.0
    sun.rotation_euler = (0.6, 0.25, 0.4)
    for added in (camera, sun):
        scene.collection.objects.link(added)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.6, 0.63, 0.66)
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                shading = area.spaces.active.shading
                shading.color_type, shading.show_cavity, shading.show_shadows = "MATERIAL", True, True


def _parser() -> argparse.ArgumentParser:
    about = (
        "Build two rooms, have a character sit, open a door, carry a box, climb and run, "
        "and save scene, pictures and report."
    )
    parser = argparse.ArgumentParser(prog="demo", description=about)
    parser.add_argument(
        "--out", default="out/demo", help="folder for demo.blend, demo.png, demo.mp4 and demo.json"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--hold", type=float, default=2.0, help="seconds to stay on each seat")
    parser.add_argument(
        "--two-seats", action="store_true", help="a shorter take in one room: walk, and sit on two seats"
    )
    parser.add_argument(
        "--second-seat",
        default="armchair",
        choices=("armchair", "bench", "stool", "sofa"),
        help="with --two-seats",
    )
    parser.add_argument(
        "--kitchen",
        type=int,
        nargs="?",
        const=TEA,
        metavar="SEED",
        help="build a kitchen instead, and make tea there, or bring things to its table that are shut away",
    )
    parser.add_argument("--no-take", action="store_true", help="with --kitchen: build it, and no more")
    parser.add_argument("--no-contact-ik", action="store_true", help="show the network alone")
    parser.add_argument("--tiles", type=int, default=15, help="pictures on the contact sheet")
    parser.add_argument("--no-video", action="store_true")
    parser.add_argument(
        "--overlays", action="store_true", help="also render what the character senses and plans"
    )
    parser.add_argument("--width", type=int, default=384, help="width of the video, pixels")
    parser.add_argument(
        "--video-step",
        type=int,
        default=2,
        help="render every so many frames; 1 is the smoothest and slowest",
    )
    return parser


if __name__ == "__main__":
    given = (
        sys.argv[sys.argv.index("--") + 1 :]
        if "--" in sys.argv
        else []
        if bpy.app.binary_path
        else sys.argv[1:]
    )
    leave(main(given))
