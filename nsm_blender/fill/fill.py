"""Fill a gap, from the scene to the keys: a generator that the panel, batch jobs and tests all drive."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import bpy
import numpy as np

from nsm_core.control.inbetween import fill
from nsm_core.errors import NsmError
from nsm_core.model.inference.transition_model import TransitionModel, load_transitions
from nsm_core.rotations import Array

from ..animation.channels import assign, copied_channels
from ..animation.kept import Kept, SceneState, restored_on_failure
from ..animation.rate import scene_fps
from ..keys.keyed import KeyedTake, pose_of
from ..keys.layers import require_keyable
from ..keys.switches import set_switches
from ..prepare import require_character, start_of
from ..progress import Progress, staged, waited
from ..rigs.armature import Placement
from ..rigs.bone_map import bone_map_of
from ..rigs.mount import Mount, go_to, over_frames
from ..world.frame import WorldFrame
from .gap import BONES, AskedGap, body_bones, body_curves, find, own_channels
from .keys import GapKeys, require_open
from .reading import Made, reading
from .report import build_report
from .spec import INTERPOLATE, FillSpec
from .values import limb_bones, moves_of, path_of, read_mounts


@dataclass
class FilledGap:
    """A filled stretch: its keys as a take's, and its report."""

    keyed: KeyedTake
    report: dict[str, Any]


@lru_cache(maxsize=1)
def _network() -> TransitionModel:
    """The bundled network, once a session."""
    return load_transitions()


def fill_gap(spec: FillSpec, scene: bpy.types.Scene) -> Generator[Progress, None, FilledGap]:
    """Make the missing frames of a character's animation and key them into a copy of its action, which then
    plays; keys outside the gap are the same.  Yields every few milliseconds.

    The action that played stays in the file, and is given back by Reject or ``keys.keyed.discard_take``.
    Raises GapError, SkeletonError and WeightsError with a sentence for the animator; whatever is raised, or
    where the generator is closed, the file is then as it was.
    """
    try:
        return (yield from _filled(spec, scene))
    except NsmError as error:
        words = str(error).replace("generate again", "fill again")
        raise (error if words == str(error) else type(error)(words)) from error


def _filled(spec: FillSpec, scene: bpy.types.Scene) -> Generator[Progress, None, FilledGap]:
    character, fps = spec.character, scene_fps(scene)
    require_character(character, scene)
    require_keyable(character)
    channels = own_channels(character)
    asked = find(spec, channels, scene.frame_current + scene.frame_subframe, fps)
    if asked.again and spec.bones is None and (before := channels.action.get(BONES, "")):
        spec = replace(spec, bones=frozenset(before.split("\n")))
    curves = body_curves(character, channels)
    above = {b.name for b in character.data.bones[bone_map_of(character).hips].parent_recursive}
    for name in sorted((curves.keys() & (spec.bones or body_bones(character))) - above - {""}):
        require_open(curves[name], character.name)
    network = None
    if spec.method != INTERPOLATE:
        network = yield from waited("Loading the network", lambda _: _network())
    state = SceneState(scene, character)
    try:
        go_to(scene, asked.stretches[0].start)
        frame, _ = start_of(character, scene)
        sides = yield from reading(character, scene, frame, asked, fps)
    finally:
        state.restore()
    made: list[Made] = []
    for number, stretch in enumerate(asked.stretches):
        gap = sides.gap(number, made, spec.seed)
        steps = waited("Filling", lambda _, gap=gap: fill(gap, network))
        made.append(Made(stretch, gap, (yield from steps)))
    yield Progress("Keying", 1.0)
    return (yield from _keyed(spec, scene, frame, asked, made, fps))


def _keyed(
    spec: FillSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    asked: AskedGap,
    made: list[Made],
    fps: float,
) -> Generator[Progress, None, FilledGap]:
    """Key the motions, look at what the scene shows of them, and report: all or nothing."""
    character = spec.character
    before = Kept(scene, [character])
    with restored_on_failure(before):
        pose, state = pose_of(character), SceneState(scene, character)
        playing = own_channels(character)
        fake_user = playing.action.use_fake_user
        playing.action.use_fake_user = True  # or it would be lost with the file's next save
        base = playing.action.name.partition(" filled ")[0]
        title = spec.name or f"{base} filled {asked.start:g}-{asked.end:g}"
        channels = copied_channels(playing, title)
        keys = GapKeys(character, channels, (asked.start, asked.end), spec.replace)
        if asked.again:
            keys.take_out()
        assign(character, channels.action, channels.slot)
        _touch(character)
        keyed_rows = []
        for one in made:
            keyed_rows.append((yield from _key_stretch(keys, scene, frame, one, spec.bones)))
        keys.note(asked, spec.bones)
        state.restore(always=True)
        _touch(character)
        keyed = KeyedTake(
            character,
            channels.action,
            channels.slot,
            int(asked.stretches[0].frames[0]),
            int(asked.stretches[-1].frames[-1]),
            fps,
            playing.action,
            playing.slot,
            fake_user,
            pose,
        )
        report = yield from build_report(spec, scene, frame, asked, made, keyed_rows, keyed, keys.kept)
        return FilledGap(keyed, report)


def _key_stretch(
    keys: GapKeys,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    made: Made,
    bones: frozenset[str] | None,
) -> Generator[Progress, None, tuple[Array, Array, Array]]:
    """Key one gap; its frames (N,) with both poses, hips (N, 3), world, and rotations (N, 23, 4) there."""
    character = keys.character
    stretch = made.stretch
    keys.start, keys.end = stretch.start, stretch.end
    rows = np.concatenate(([stretch.start], stretch.frames, [stretch.end]))
    hips, local = made.at((rows - stretch.start) / (stretch.end - stretch.start))
    hips = frame.to_world(hips)
    placement, bone_map = Placement.of(character), bone_map_of(character)

    def read() -> dict[int | str, Mount]:
        return read_mounts(character, placement, bone_map)

    every = yield from staged("Making keys", over_frames(scene, rows.tolist(), read))
    mounts = {k: Mount.over([each[k] for each in every]) for k in every[0]}
    switches = [
        (bone, _switch_path(character, bone, key), float(value), float(_now(character, bone, key)))
        for bone, values in bone_map.switches.items()
        for key, value in values.items()
        if _now(character, bone, key) is not None
    ]
    shown = SceneState(scene, character)
    for bone, values in bone_map.switches.items():
        set_switches(character.pose.bones[bone], values)
    moves = list(moves_of(character, placement, bone_map, mounts, hips, local))
    shown.restore(always=True)
    changed = [keys.switched(path, value, now) for _, path, value, now in switches]
    free = any(start for start, _ in changed), any(end for _, end in changed)
    limbs = limb_bones(bone_map)
    for number, each in enumerate(moves):
        if bones is not None and each.bone not in bones:
            continue
        keys.key(each, rows, free if each.bone in limbs else (False, False))
        yield Progress("Making keys", number / len(moves))
    for switch in switches if bones is None or bones & limbs else ():
        keys.switch(*switch)
    _touch(character)
    return rows, hips, local


def _switch_path(character: bpy.types.Object, bone: str, key: str) -> str:
    custom = f'["{bpy.utils.escape_identifier(key)}"]'
    if key in character.pose.bones[bone]:
        return path_of(bone, "")[:-1] + custom
    return path_of(bone, key)


def _now(character: bpy.types.Object, bone: str, key: str) -> float | None:
    """The value of a property that has controls obey keys; None where the rig lacks it."""
    posed = character.pose.bones.get(bone)
    if posed is None:
        return None
    value = posed[key] if key in posed else getattr(posed, key, None)
    return value if isinstance(value, bool | int | float) else None


def _touch(target: bpy.types.Object) -> None:
    """Show an object's new keys at the current frame."""
    target.update_tag(refresh={"TIME"})
    bpy.context.view_layer.update()
