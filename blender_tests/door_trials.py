"""Doors as people have them: open, ajar, double, with loose handles, low ones and stray hinges; each is
passed and measured.

``python blender_tests/door_trials.py [--sheets FOLDER] [NAME ...]`` prints for each how deep the body goes
into leaf and wall.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np
from scenes import LEAF, box, door, empty, mesh_of_boxes

from nsm_blender.goals.points import HANDLE, SWING, goal_point_of
from nsm_blender.goals.resolve import show_goal_point
from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import Take, TakeSpec, finish, generate, prepare
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.capsules import Body, penetration_depths
from nsm_core.errors import NsmError
from nsm_core.evaluation.measures.objects import prop_depths
from nsm_core.rotations import rotate_planar
from nsm_core.world.scene.props import Leaf


@dataclass
class Trial:
    """A door in a scene: its ``leaf``, where one starts (2,), and which side (the sign of y) one should end
    on.
    """

    leaf: bpy.types.Object
    start: tuple[float, float] = (0.9, -2.0)
    ends: float = 1.0
    follow: list[bpy.types.Object] = field(default_factory=list)  # what must turn with the leaf
    goals: list[GoalSpec] | None = None


def ordinary(swing: int = 1, **options) -> Trial:
    """A shut leaf: ``swing`` 1 opens towards +Y (pushed), -1 towards -Y (pulled)."""
    leaf = door(aside=0.0, **options)
    mark_swing(leaf, swing)
    return Trial(leaf)


def mark_swing(leaf: bpy.types.Object, swing: int) -> None:
    """Mark the way a leaf opens on its hinge point."""
    hinge = show_goal_point(
        GoalSpec("open", leaf), bpy.context.scene, WorldFrame(), (np.array((0.4, -2.0)), 0.0)
    )
    hinge[SWING] = swing


def standing_open(degrees: float, start: tuple[float, float] = (0.9, -2.0)) -> Trial:
    """A leaf that was left open; positive degrees stand beyond the wall, seen from the start."""
    leaf = door()
    leaf.rotation_euler.z = math.radians(degrees)
    bpy.context.view_layer.update()
    return Trial(leaf, start, -math.copysign(1, start[1]))


def keyed_open() -> Trial:
    """A leaf that the animator has opened with keys, over before the take starts."""
    trial = standing_open(80)
    for frame, turn in ((-40, 0.0), (-5, 80.0)):
        trial.leaf.rotation_euler.z = math.radians(turn)
        trial.leaf.keyframe_insert("rotation_euler", frame=frame)
    return trial


def shut_at_an_angle() -> Trial:
    """A leaf whose shut rotation is no zero: its wall runs askew, its mesh does not."""
    leaf = door(turn=math.radians(25), handle=True)
    mark_swing(leaf, 1)
    return Trial(leaf, (1.2, -1.8))


def double_leaves() -> Trial:
    """Two leaves without handles, origins in their middles."""
    return Trial(pair()[0], (0.4, -2.0))


def pair(origin: float = 0.0) -> tuple[bpy.types.Object, bpy.types.Object]:
    """Two leaves of 0.8 m between jambs at x 0 and 1.605; ``origin`` metres from their middles towards where
    they meet.
    """
    made = []
    for name, x, towards in (("Left", 0.3975, 1), ("Right", 1.2025, -1)):
        shift = towards * origin
        made.append(
            mesh_of_boxes(
                name, [((-0.3975 - shift, -0.02, -1), (0.3975 - shift, 0.02, 1))], (x + shift, 0, 1.005)
            )
        )
    parts = [
        ((-1.5, -0.07, 0), (-0.005, 0.07, 2.5)),
        ((1.605, -0.07, 0), (3.1, 0.07, 2.5)),
        ((-0.005, -0.07, 2.02), (1.605, 0.07, 2.5)),
    ]
    mesh_of_boxes("Wall", parts)
    return made[0], made[1]


def loose_handle(swing: int = -1) -> Trial:
    """A handle as an object of its own beside the leaf, not parented."""
    w = LEAF[0]
    leaf = door(handle=False)
    levers = [((-0.06, s * 0.05 - 0.015, -0.015), (0.06, s * 0.05 + 0.015, 0.015)) for s in (-1, 1)]
    handle = mesh_of_boxes("Lever", [*levers, ((0.04, -0.05, -0.01), (0.06, 0.05, 0.01))], (w - 0.08, 0, 1.0))
    mark_swing(leaf, swing)
    return Trial(leaf, follow=[handle])


def stray_hinge() -> Trial:
    """A pin proud of the leaf, marked by an empty, and hardware of the leaf whose name holds the word."""
    leaf = door(handle=True)
    empty("Door Hinge", (-0.005, -0.03, 1.0))
    for name, x in (("Leaf.Hinge plate", 0.03), ("hinge cover", LEAF[0] - 0.05)):
        plate = box(name, (x - 0.03, -0.026, 0.4), (x + 0.03, -0.02, 0.5))
        plate.parent, plate.matrix_parent_inverse = leaf, leaf.matrix_world.inverted()
    bpy.context.view_layer.update()
    return Trial(leaf)


def low_handle(height: float, swing: int = -1) -> Trial:
    """A handle as low as old and children's doors have it."""
    leaf = door(handle=False)
    mark_swing(leaf, swing)
    goal_point_of(bpy.context.scene, leaf, HANDLE).location.z += height - 1.0
    return Trial(leaf)


TRIALS: dict[str, Callable[[], Trial]] = {
    "pushed": lambda: ordinary(1),
    "pulled": lambda: ordinary(-1),
    "stands open, beyond": lambda: standing_open(85),
    "stands open, before": lambda: standing_open(-80),
    "stands open, coming back": lambda: standing_open(85, (0.4, 2.2)),
    "ajar 15, pushed": lambda: standing_open(15),
    "ajar 35, pushed": lambda: standing_open(35),
    "ajar 55, pushed": lambda: standing_open(55),
    "ajar 15, pulled": lambda: standing_open(-15),
    "ajar 35, pulled": lambda: standing_open(-35),
    "ajar 55, pulled": lambda: standing_open(-55),
    "opened by keys": keyed_open,
    "shut at an angle": shut_at_an_angle,
    "double leaves": double_leaves,
    "loose handle": loose_handle,
    "stray hinge": stray_hinge,
    "handle at 0.65 m, pulled": lambda: low_handle(0.65),
    "handle at 0.75 m, pulled": lambda: low_handle(0.75),
    "handle at 0.85 m, pulled": lambda: low_handle(0.85),
    "handle at 0.65 m, pushed": lambda: low_handle(0.65, 1),
}


def run(trial: Trial, seed: int = 0) -> tuple[Take, dict[str, float | bool | str]]:
    """Pass a door and measure: centimetres of the body inside leaf and wall, and by which part in the leaf,
    and when.
    """
    scene, leaf = bpy.context.scene, trial.leaf
    character = add_character((*trial.start, 0.0))
    spec = TakeSpec(character, trial.goals or [GoalSpec("open", leaf, 0.5)], seed=seed)
    request = finish(prepare(spec, scene))[0]
    prop = request.goals[0].prop
    assert isinstance(prop, Leaf)
    take = finish(generate(spec, scene))
    body, poses = (take.result.hips_position, take.result.local_rotations), take.result.props[prop.name]
    depth = prop_depths(*body, prop, poses)
    figures = {
        "reached": all(g["reached"] for g in take.report["goals"])
        and take.result.hips_position[-1, 1] * trial.ends > 0,
        "leaf_cm": float(100 * depth.max()),
        "leaf_at": int(depth.argmax()),
        "leaf_part": part_inside(body, prop, poses, int(depth.argmax())),
        "wall_cm": float(100 * penetration_depths(*body, request.environment).max()),
        "open_deg": float(np.degrees(abs(poses[-1, 3] - prop.closed))),
        "seconds": len(body[0]) / 30,
        "step_deg": float(np.degrees(np.abs(np.diff(poses[:, 3])).max())),
    }
    return take, figures


def part_inside(body: tuple[np.ndarray, np.ndarray], leaf: Leaf, poses: np.ndarray, frame: int) -> str:
    """Name of the body's capsule that is deepest in the leaf in a frame."""
    one = slice(frame, frame + 1)
    seen = Body.of(body[0][one], body[1][one])
    local = rotate_planar(seen.centres[0] - poses[frame, :3], np.float64(-poses[frame, 3]))
    distance = leaf.query.signed_distance(local.astype(np.float32), 0.3)
    return seen.names[int((seen.radii[0] - distance).argmax())]


def main(arguments: list[str]) -> int:
    """Run the trials and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="of trials; all without any")
    parser.add_argument("--sheets", default=None, help="folder for a contact sheet of each")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--tiles", type=int, default=15)
    a = parser.parse_args(arguments)
    print(
        "| door | through | leaf cm (part, frame) | wall cm | open deg | fastest deg/frame | s "
        "|\n|---|---|---|---|---|---|---|"
    )
    failed = 0
    for name in a.names or TRIALS:
        for seed in range(a.seeds):
            bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
            try:
                take, f = run(TRIALS[name](), seed)
            except NsmError as error:
                print(f"| {name} | {type(error).__name__}: {error} |")
                failed += 1
                continue
            failed += not f["reached"]
            print(
                f"| {name} | {'yes' if f['reached'] else 'NO'} | {f['leaf_cm']:.1f} ({f['leaf_part']}, "
                f"{f['leaf_at']}) "
                f"| {f['wall_cm']:.1f} | {f['open_deg']:.0f} | {f['step_deg']:.1f} | {f['seconds']:.1f} |",
                flush=True,
            )
            if a.sheets:
                from nsm_blender.pictures.render import contact_sheet

                path = Path(a.sheets) / f"{name.replace(' ', '_').replace(',', '')}_{seed}.png"
                contact_sheet(take.keyed, path, a.tiles, size=(300, 280), direction=(-0.9, -0.55, 0.75))
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
