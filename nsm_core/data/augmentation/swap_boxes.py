"""Other boxes for the carries of composed takes: near face and bottom stay where they were, the hands hold
the new sides.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.body.skeleton import ARMS, FEET, forward_kinematics
from nsm_core.body.thin_capsules import thin_spheres
from nsm_core.conventions import FOOT_CONTACTS, HAND_CONTACTS
from nsm_core.data.scenarios.take import ComposedTake, Thing
from nsm_core.distances import CRATE_SIDE
from nsm_core.rotations import Array, heading_to_direction, rotate_planar
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import Furniture, box_mesh, carried_box, cuboids
from nsm_core.world.scene.props import Box

from .contact_transfer import embed, switch, transfer
from .soundness import AROUND, ASTRAY, DEEPER, depth_in_solids, no_faster

MOST_WIDER = 0.06  # metres that a box grows sideways and in depth, lest it stands out over what it rests on
SLIPS = (
    0.005  # metres that wrists are further from their places on a box, or boxes deeper in things, than before
)
_WRISTS, _TOES = [arm[2] for arm in ARMS], [leg[3] for leg in FEET]


def switch_box(
    take: ComposedTake, number: int, pool: Pool, seeds: Array, shares: tuple[float, ...]
) -> ComposedTake | None:
    """The take with another box for the carry that command ``number`` begins; None where none that the
    ``seeds`` draw fits.

    ``shares`` tells what is left, in each attempt, of the difference in size between the box drawn and that
    of the take.
    """
    index, count = take.commands[number].thing, len(take)
    thing = take.things[index]
    if thing.held is None:
        return None
    held = np.flatnonzero(thing.held)
    e = embed(take.hips, take.rotations, take.contacts, thing.furniture, thing.poses)
    if not len(held) or not e.touch[held][:, HAND_CONTACTS].all():
        return None
    frames = slice(max(int(held[0]) - AROUND, 0), min(int(held[-1]) + AROUND + 1, count))
    quarter = np.pi / 2
    face = float(np.round((take.commands[number].heading - thing.poses[0, 3]) / quarter) * quarter)
    old = _Hold(take, index, face, frames, thing.held)
    for seed, share in zip(seeds, shares, strict=True):
        piece = _resized(switch(pool, "crate", int(seed)), thing.furniture, share)
        box, before = carried_box(piece), carried_box(thing.furniture)
        further = (box.across(face)[1] - before.across(face)[1]) / 2 * heading_to_direction(np.float64(face))
        offset = np.append(further, (box.size[2] - before.size[2]) / 2)
        poses = thing.poses.copy()
        poses[:, :3] += rotate_planar(np.broadcast_to(offset, (count, 3)), poses[:, 3])
        hips, rotations = transfer(e.cut(frames), piece, poses[frames])
        other = Thing(piece, poses, thing.held)
        if old.allows(hips, rotations, other):
            return _with(take, index, frames, hips, rotations, other, offset)
    return None


def _resized(piece: Furniture, old: Furniture, share: float) -> Furniture:
    """A piece about its centre with only a ``share`` of its difference in size from another."""
    size = old.size + share * (np.clip(piece.size, *CRATE_SIDE) - old.size)
    size[:2] = np.minimum(size[:2], old.size[:2] + MOST_WIDER)
    mins, maxs = (
        ((m - piece.centre) * size / piece.size).astype(np.float32) for m in (piece.mins, piece.maxs)
    )
    return Furniture("crate", *box_mesh(mins, maxs), mins, maxs, None)


class _Hold:
    """What a body may do while it carries another box, measured while it carries its own."""

    def __init__(self, take: ComposedTake, index: int, face: float, frames: slice, held: Array) -> None:
        self.take, self.thing, self.face, self.frames = take, take.things[index], face, frames
        self.held = held[frames]
        still = [(o.furniture, o.position, o.heading) for o in take.obstacles]
        things = [t for n, t in enumerate(take.things) if n != index]
        middle = (frames.start + frames.stop) // 2
        poses = [t.track(len(take))[middle] for t in things]
        self.rest = cuboids(
            still + [(t.furniture, p[:3], float(p[3])) for t, p in zip(things, poses, strict=True)]
        )
        self.before = self._measured(take.hips[frames], take.rotations[frames], self.thing)

    def _measured(self, hips: Array, rotations: Array, thing: Thing) -> tuple[Array, Array, float, float]:
        """Joints; depths of the body in the box and of body and box in what is about them; how far wrists
        slip, metres.
        """
        joints = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))[0]
        poses = thing.poses[self.frames]
        centres, radii = thin_spheres(hips[::2], rotations[::2])
        seen = rotate_planar(
            centres - poses[::2, None, :3], np.broadcast_to(-poses[::2, None, 3], centres.shape[:2])
        )
        inside = depth_in_solids((seen, radii), cuboids([(thing.furniture, np.zeros(3), 0.0)]))
        low, high = np.stack((thing.furniture.mins.min(0), thing.furniture.maxs.max(0))).astype(np.float64)
        grid = np.stack(np.meshgrid(*np.linspace(low, high, 4).T, indexing="ij"), axis=-1).reshape(1, -1, 3)
        swept = rotate_planar(
            np.repeat(grid, len(poses[::4]), axis=0), np.repeat(poses[::4, None, 3], grid.shape[1], axis=1)
        )
        meets = depth_in_solids((swept + poses[::4, None, :3], np.zeros(grid.shape[1])), self.rest)
        box: Box = carried_box(thing.furniture)
        grasps = rotate_planar(
            np.repeat(box.learned_grasps(self.face)[None], len(poses), axis=0),
            np.repeat(poses[:, None, 3], 2, axis=1),
        )
        slips = np.linalg.norm(joints[:, _WRISTS] - grasps - poses[:, None, :3], axis=-1)[self.held].max()
        return joints, np.array((inside, depth_in_solids((centres, radii), self.rest))), meets, slips

    def allows(self, hips: Array, rotations: Array, other: Thing) -> bool:
        """Whether the motion with another box is as sound as with its own: hands hold it, feet stay, nothing
        jumps or is hit.
        """
        joints, depths, meets, slips = self._measured(hips, rotations, other)
        old, old_depths, old_meets, old_slips = self.before
        stands = np.asarray(self.take.contacts)[self.frames][:, FOOT_CONTACTS] > 0.5
        moved = np.linalg.norm((joints - old)[:, _TOES], axis=-1)[stands].max(initial=0)
        return bool(
            slips < old_slips + SLIPS
            and moved < ASTRAY
            and (depths <= old_depths + DEEPER).all()
            and meets <= old_meets + SLIPS
            and no_faster(joints, old)
        )


def _with(
    take: ComposedTake, index: int, frames: slice, hips: Array, rotations: Array, other: Thing, offset: Array
) -> ComposedTake:
    """The take with another box, whose centre is moved by ``offset`` (3,) in its frame, and the goals with
    it.
    """
    new_hips, new_rotations = take.hips.copy(), take.rotations.copy()
    new_hips[frames], new_rotations[frames] = hips, rotations
    things, commands = list(take.things), list(take.commands)
    ends = take.things[index].poses[[0, -1]]
    for n, c in enumerate(commands):
        if c.thing == index and c.position is not None:
            heading = ends[
                0 if c.action == "carry" else 1, 3
            ]  # one put back lies where it lay, turned a little
            commands[n] = replace(
                c, position=(c.position + rotate_planar(offset, np.float64(heading))).astype(np.float32)
            )
    things[index] = other
    return replace(take, hips=new_hips, rotations=new_rotations, things=things, commands=commands)
