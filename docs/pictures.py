"""Make the pictures of these pages.  ``python docs/pictures.py [NAME ...]`` under the bpy wheel: all of them,
or those that are named, into docs/.

``panel.png`` is a picture of Blender's window and not among them.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from math import cos, pi, sin
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import fill_cases
import fills
import numpy as np
import strobe
import take as whole_take

import nsm_blender as nsm
from nsm_blender import demo
from nsm_blender.animation.channels import curves_in
from nsm_blender.animation.rate import scene_fps
from nsm_blender.demo_scene.room import place
from nsm_blender.fill.key_arrays import read_keys, taken, write_keys
from nsm_blender.fill.thin import thin_out
from nsm_blender.keys.keyed import discard_take
from nsm_blender.leaving import leave
from nsm_blender.outlook import outlook
from nsm_blender.overlays.picture import overlay_sheet
from nsm_blender.pictures.outputs import scratch_folder
from nsm_blender.pictures.render import join_tiles, read_png
from nsm_core.world.scene.furniture import make

HERE = Path(__file__).resolve().parent
TILE = (250, 210)  # pixels
GREY = (0.45, 0.52, 0.62, 1.0)  # of motions that are neither keyed nor made


def sheet(path: Path, take: nsm.Take, tiles: int = 6, columns: int = 6, view=None, frames=None) -> None:
    """A row of pictures of a take."""
    nsm.contact_sheet(take.keyed, path, tiles, columns, TILE, view, numbers=False, frames=frames)
    strobe.write(path, read_png(path))


def made(character: bpy.types.Object, goals: list[nsm.GoalSpec], **more) -> nsm.Take:
    """A take, with a line for each goal."""
    take = nsm.finish(nsm.generate(nsm.TakeSpec(character, goals, **more), bpy.context.scene))
    for goal in take.report["goals"]:
        print("  ", nsm.goal_line(goal))
    return take


def empty_scene() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def chair(name: str = "Chair", at: tuple[float, float] = (0.0, 0.0), turn: float = 0.0) -> bpy.types.Object:
    """A chair of the demo's."""
    return place(make("chair", np.random.default_rng(90001)), name, at, turn, "Oak", "Teal")


def overlays(path: Path) -> None:
    """What the sidebar's overlays show, in the demo's house."""
    house, character = demo.build_scene()
    goals = demo.goals_in(house)
    before = nsm.finish(outlook(nsm.TakeSpec(character, goals), bpy.context.scene))
    take = made(character, goals)
    overlay_sheet(take.keyed, path, demo.overlay_views(take), before, (330, 227), 3, house.view)


def curve(path: Path) -> None:
    """A walk along a curve, around a chair that stands on it."""
    empty_scene()
    data = bpy.data.curves.new("Path", "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.012  # so that it is seen
    spline = data.splines.new("POLY")
    points = [(3 * cos(a), 1.5 * sin(2 * a), 0.0) for a in np.linspace(0.9 * pi, 0.1 * pi, 24)]
    spline.points.add(len(points) - 1)
    for point, at in zip(spline.points, points, strict=True):
        point.co = (*at, 1.0)
    way = bpy.data.objects.new("Path", data)
    bpy.context.scene.collection.objects.link(way)
    chair("Chair", (0.05, 0.1))
    character = nsm.add_character((-3.3, 0.5, 0.0))
    sheet(path, made(character, [nsm.GoalSpec("walk", way, 0.5, along=True)]), view=(0.2, -1.0, 0.55))


def going_on(path: Path) -> None:
    """A second take goes on from where the first one has ended: seated."""
    empty_scene()
    first, second = chair("Chair", (0.0, 0.0)), chair("Stool", (2.4, 0.3), -1.2)
    character = nsm.add_character((-0.6, -1.8, 0.0))
    seated = made(character, [nsm.GoalSpec("sit", first, 0.6)], name="Sit")
    end = seated.keyed.frame_end
    take = made(
        character, [nsm.GoalSpec("sit", second, 0.6)], name="Sit elsewhere", start_frame=end, begin="pose"
    )
    before = seated.keyed.frame_start + np.array((0.35, 0.65)) * (end - seated.keyed.frame_start)
    after = end + np.array((0.25, 0.55, 1.0)) * (take.keyed.frame_end - end)
    frames = [*before.round().astype(int), end, *after.round().astype(int)]
    sheet(path, take, view=(0.3, -1.0, 0.35), frames=frames)


def fill(path: Path, method: str = "network") -> None:
    """A walk with a second missing in its middle: keyed poses and what was filled in."""
    empty_scene()
    character = nsm.add_character((-1.5, 0.0, 0.0))
    goals = [nsm.GoalSpec("walk", None, 0.0, location=(1.2, 0.0, 0.0)), nsm.GoalSpec("idle", hold=0.5)]
    made(character, goals)
    start, end = 45, 76
    thinned(character, start, end)
    spec = nsm.FillSpec(character, start, end, method=method)
    done = nsm.finish(nsm.fill_gap(spec, bpy.context.scene))
    print("  ", done.report)
    frames = [start - 8, start, *range(start + 5, end, 5), end, end + 8]
    coloured = [(f, strobe.MADE if start < f < end else strobe.KEYED) for f in frames]
    strobe.figures(character, coloured, 0.62, 0.0)
    wide = 0.62 * len(frames) + 0.3
    strobe.picture(path, (960, 280), (0.31 * (len(frames) - 1), 0.0, 0.9), wide, 0.03)


def thinned(character: bpy.types.Object, start: float, end: float) -> None:
    """Take the keys between two frames out of what a character plays."""
    for curve in curves_in(character.animation_data.action, character.animation_data.action_slot):
        keys = read_keys(curve)
        frames = keys["co"][:, 0]
        write_keys(curve, taken(keys, (frames <= start) | (frames >= end)))


def ground(path: Path) -> None:
    """A step onto a podium filled with the ground felt, and with none to feel."""
    case = fill_cases.podium()
    camera = fills.Camera(fills.Looker(case), 5)
    spec = nsm.FillSpec(case.character, case.start, case.end, replace=True)
    block, rows = bpy.data.objects["Podium"], []
    for felt in (True, False):
        if not felt:
            bpy.context.scene.collection.objects.unlink(block)
        done = nsm.finish(nsm.fill_gap(spec, bpy.context.scene))
        if not felt:
            bpy.context.scene.collection.objects.link(block)
        print("  ", done.report)
        rows += camera.row("side", strobe.MADE)
        discard_take(done.keyed)
    strobe.write(path, join_tiles(rows, len(camera.frames), 2))


def decompressed(path: Path) -> None:
    """A walk with a turn as it was, and as made again of a pose and its pace a second."""
    empty_scene()
    character, scene = nsm.add_character((-1.5, 0.0, 0.0)), bpy.context.scene
    goals = [nsm.GoalSpec("walk", None, 0.0, location=(1.2, 0.6, 0.0)), nsm.GoalSpec("idle", hold=0.5)]
    first = made(character, goals).keyed.first
    frames = range(first, first + 121, 8)
    second = round(scene_fps(scene))
    kept = [frame for frame in range(first, first + 121) if (frame - first) % second < 2]
    rows = [_strip(character, frames, kept, GREY)]
    thinned_out, counts = thin_out(character, scene)
    spec = nsm.FillSpec(character, first, thinned_out.last)
    print("  ", counts, nsm.finish(nsm.fill_gap(spec, scene)).report)
    rows.append(_strip(character, frames, kept, strobe.MADE))
    strobe.write(path, join_tiles(rows, 1, 2))


def _strip(character: bpy.types.Object, frames: range, kept: list[int], colour: tuple[float, ...]):
    """Pixels of a character at frames, spread apart; those ``kept`` as keyed, the others in a colour."""
    coloured = [(f, strobe.KEYED if f in kept else colour) for f in frames]
    copies = strobe.figures(character, coloured, 0.5, 0.0)
    with scratch_folder() as folder:
        wide = 0.5 * len(coloured) + 0.3
        part = folder / "strip.png"
        strobe.picture(part, (640, 172), (0.25 * (len(coloured) - 1), 0.0, 0.9), wide, 0.03)
        pixels = read_png(part)
    for copy in copies:
        bpy.data.objects.remove(copy)
    return pixels


def main_take(path: Path) -> None:
    """The demo's take at the moments that show its actions."""
    whole_take.main(path)


PICTURES: dict[str, Callable[[Path], None]] = {
    "take": main_take,
    "overlays": overlays,
    "curve": curve,
    "going_on": going_on,
    "fill": fill,
    "ground": ground,
    "decompressed": decompressed,
}


def main(names: list[str]) -> int:
    """Make pictures; returns the exit code."""
    unknown = [name for name in names if name not in PICTURES]
    if unknown:
        print(
            f"There is no picture {', '.join(unknown)}; take some of {', '.join(PICTURES)}.", file=sys.stderr
        )
        return 2
    for name in names or PICTURES:
        path = HERE / f"{name}.png"
        print(path.name, flush=True)
        PICTURES[name](path)
    return 0


if __name__ == "__main__":
    leave(main(sys.argv[1:]))
