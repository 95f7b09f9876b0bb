"""Motions with a gap, for ``fills.py``: each a scene with a character that is animated all through, and the
frames that are to be made anew.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np

import nsm_blender as nsm
from nsm_blender.demo_scene.room import place
from nsm_blender.keys.keying import key_take
from nsm_core.body.clip import Clip
from nsm_core.data.captures.reader import read_clip
from nsm_core.errors import CaptureError
from nsm_core.rotations import heading_quat, quat_mul, rotate_planar
from nsm_core.world.scene.furniture import make

PLAIN, DARK, WOOD = (0.66, 0.67, 0.68, 1.0), (0.50, 0.52, 0.54, 1.0), (0.62, 0.50, 0.36, 1.0)
_SQUARE = 0.25  # metres of the floor's pattern


@dataclass
class Case:
    """A ``character``, and the poses at ``start`` and ``end`` between which its frames are made anew."""

    character: bpy.types.Object
    start: int
    end: int


class Sources:
    """Where motions come from: a folder of ``captures``, and a file with a ``rig`` of another maker's."""

    def __init__(self, captures: Path, rig: Path | None) -> None:
        self.captures, self.rig = captures, rig

    def clip(self, name: str) -> Clip:
        """A capture by its file's name without the ending; CaptureError where there is none."""
        found = next(iter(self.captures.rglob(f"{name}.bvh")), None)
        if found is None:
            raise CaptureError(f"{self.captures} holds no {name}.bvh; give the folder of the captures.")
        return read_clip(found)


def walk(sources: Sources) -> Case:
    """Four strides of a person's walk, a second of them missing."""
    return _captured(sources.clip("male2_walk"), 40, 71)


def run(sources: Sources) -> Case:
    """A run, two thirds of a second of it missing."""
    return _captured(sources.clip("male2_run"), 20, 41)


def turn(sources: Sources) -> Case:
    """A turn by 135 degrees in a walk, a second and a half of it missing."""
    return _captured(sources.clip("male2_walk_turn_right_135"), 78, 124)


def rise(sources: Sources) -> Case:
    """Who sits rises and stands, a second and a half of it missing."""
    _empty(30)
    seat = place(make("chair", np.random.default_rng(90001)), "Chair", (0.0, 0.0), 0.0, "Oak", "Teal")
    character = nsm.add_character((-0.3, -1.2, 0.0))
    _floor((-0.2, -0.4))
    sat = _take(character, [nsm.GoalSpec("sit", seat, 0.5)])
    end = sat.keyed.frame_end
    goals = [nsm.GoalSpec("idle", hold=1.0)]
    stood = _take(character, goals, start_frame=end, begin="pose")
    hips = [_hips(character, f) for f in range(stood.keyed.first, stood.keyed.last + 1)]
    height = np.array([place[2] for place in hips])
    middle = int(np.abs(height - (height[0] + height.max()) / 2).argmin())
    start = stood.keyed.first + max(middle - 22, 0)
    return Case(character, start, start + 45)


def stairs(sources: Sources) -> Case:
    """A person goes up four steps, a second and a half of it missing."""
    case = _captured(sources.clip("nimble_stairs_up"), 44, 90)
    risers = (0.35, 0.64, 0.92, 1.20, 2.2)
    for k, height in enumerate((0.155, 0.31, 0.463, 0.618)):
        _box(f"Step {k + 1}", (risers[k], -0.7, 0.0), (risers[k + 1] if k < 3 else 2.2, 0.6, height))
    return case


def obstacle(sources: Sources) -> Case:
    """A person comes down from a block, over the floor and onto another one, a second and a half missing."""
    case = _captured(sources.clip("cmu_03_01"), 30, 76)
    _box("Block", (-0.6, -0.86, 0.0), (0.5, 0.6, 0.245))
    _box("Other block", (-0.6, -2.6, 0.0), (0.5, -1.3, 0.13))
    return case


def two_takes(sources: Sources) -> Case:
    """A walk is cut to a run that begins with another foot and half a metre further on: half a second on
    both sides of the cut is made anew.
    """
    first, second = sources.clip("male2_walk")[20:75], sources.clip("male2_run")[8:60]
    places, headings = first.root()
    begin, heading = (both[0] for both in second.root())
    angle = headings[-1] - heading
    ahead = (places[-1] - places[-6]) / np.linalg.norm(places[-1] - places[-6])
    hips = second.hips_position - np.append(begin, 0.0)
    hips = rotate_planar(hips.astype(np.float64), np.float64(angle)) + np.append(
        places[-1] + 0.5 * ahead, 0.0
    )
    local = second.local_rotations.astype(np.float64).copy()
    local[:, 0] = quat_mul(np.broadcast_to(heading_quat(np.array(angle)), local[:, 0].shape), local[:, 0])
    whole = Clip(
        "two takes",
        np.concatenate((first.hips_position, hips)).astype(np.float32),
        np.concatenate((first.local_rotations, local)).astype(np.float32),
    )
    return _captured(whole, len(first) - 12, len(first) + 13)


def mixamo(sources: Sources) -> Case:
    """A rig with Mixamo's names walks at 24 frames a second, a second of it missing."""
    if sources.rig is None:
        raise CaptureError("There is no rig with Mixamo's names; give its file with --rig.")
    _empty(24)
    known = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(sources.rig))
    made = [thing for thing in bpy.data.objects if thing not in known]
    for thing in made:
        if thing.name.startswith("Icosphere") or thing.type in ("CAMERA", "LIGHT"):  # shapes of bones
            bpy.data.objects.remove(thing)
    character = next(thing for thing in bpy.data.objects if thing.type == "ARMATURE")
    bpy.context.scene.render.fps = 24
    _floor((0.0, -1.5))
    goals = [nsm.GoalSpec("walk", None, 0.0, location=(0.0, -4.0, 0.0)), nsm.GoalSpec("idle", hold=0.5)]
    take = _take(character, goals)
    middle = round((take.keyed.first + take.keyed.last) / 2)
    return Case(character, middle - 12, middle + 13)


def podium() -> Case:
    """A take onto a podium of 35 cm, a second and a third around its step missing."""
    _empty(30)
    top = _box("Podium", (-0.7, -3.2, 0.0), (0.7, -1.7, 0.35))
    character = nsm.add_character((0.0, 0.0, 0.0))
    _floor((0.0, -1.5))
    take = _take(character, [nsm.GoalSpec("climb", top), nsm.GoalSpec("idle", hold=0.5)])
    height = np.array([_hips(character, f)[2] for f in range(take.keyed.first, take.keyed.last + 1)])
    middle = take.keyed.first + int(np.abs(height - (height[0] + height[-1]) / 2).argmin())
    return Case(character, middle - 20, middle + 21)


CASES: dict[str, Callable[[Sources], Case]] = {
    "walk": walk,
    "run": run,
    "turn": turn,
    "rise": rise,
    "stairs": stairs,
    "obstacle": obstacle,
    "two_takes": two_takes,
    "mixamo": mixamo,
}


def _captured(clip: Clip, start: int, end: int) -> Case:
    """A capture keyed on the bundled character, frame 1 the first, in a scene of 30 frames a second."""
    _empty(30)
    character = nsm.add_character((0.0, 0.0, 0.0))
    key_take(character, clip.hips_position.astype(np.float64), clip.local_rotations, 1, name=clip.name)
    _floor(clip.hips_position[:, :2].mean(0))
    return Case(character, start, end)


def _take(character: bpy.types.Object, goals: list[nsm.GoalSpec], **more) -> nsm.Take:
    return nsm.finish(nsm.generate(nsm.TakeSpec(character, goals, **more), bpy.context.scene))


def _hips(character: bpy.types.Object, frame: int) -> np.ndarray:
    bpy.context.scene.frame_set(frame)
    return np.array(character.matrix_world @ character.pose.bones["Hips"].head)


def _empty(fps: int) -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = fps


def _floor(middle: np.ndarray | tuple[float, float]) -> None:
    """A floor of squares, by which is seen how far a foot goes."""
    each, start = 48, np.round(np.asarray(middle) / _SQUARE) - 24
    corners = [((start[0] + i) * _SQUARE, (start[1] + k) * _SQUARE, 0.0) for k in range(each + 1)
               for i in range(each + 1)]  # fmt: skip
    faces = [(n, n + 1, n + each + 2, n + each + 1)
             for n in (k * (each + 1) + i for k in range(each) for i in range(each))]  # fmt: skip
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata(corners, [], faces)
    for name, colour in (("Light", PLAIN), ("Dark", DARK)):
        paint = bpy.data.materials.new(name)
        paint.diffuse_color = colour
        mesh.materials.append(paint)
    mesh.polygons.foreach_set("material_index", [(n // each + n % each) % 2 for n in range(each * each)])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Floor", mesh))
    bpy.context.view_layer.update()


def _box(name: str, low: tuple[float, float, float], high: tuple[float, float, float]) -> bpy.types.Object:
    """A box with these corners, metres."""
    bpy.ops.mesh.primitive_cube_add(location=tuple((np.array(low) + high) / 2), size=1.0)
    made = bpy.context.object
    made.name, made.scale = name, tuple(np.array(high) - low)
    paint = bpy.data.materials.new("Wood")
    paint.diffuse_color = WOOD
    made.data.materials.append(paint)
    bpy.context.view_layer.update()
    return made
