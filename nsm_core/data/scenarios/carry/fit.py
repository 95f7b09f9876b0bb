"""A carried box in composed motion: its way from rest to rest, and the hands that hold it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from nsm_core.body.clip import smoothed_root
from nsm_core.body.ik.reach import bending, into_reach
from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import ARM_LENGTH, ARMS, FEET, forward_kinematics
from nsm_core.conventions import CARRY, HAND_CONTACTS
from nsm_core.data.scenarios.hands import COMFORT, lead, place_hands
from nsm_core.data.scenarios.motion import Motion
from nsm_core.data.scenarios.take import Placed, Thing, TimedCommand
from nsm_core.distances import WRIST_BEHIND, WRIST_BELOW, WRIST_OFF_SIDE
from nsm_core.rotations import Array, heading_to_direction, rotate_planar, wrap_angle
from nsm_core.signals import ease, gaussian_smooth

from .pick_up import Bend

if TYPE_CHECKING:
    from .carried import CarryEpisode

# Metres: wrists over the floor, box beyond where it stood when it was lifted.
HOLDING_HEIGHT, HOLDING_AHEAD = 1.0, 0.05
_BENT = 0.9 * ARM_LENGTH  # how far arms stretch at most while walking
_CLEARANCE = 0.05  # metres that a box is lifted over what it rested on
# Share of the pelvis' movement up and down that a box follows, and metres at most.
_BOB, _MOST_BOB = 0.6, 0.04
_HANGING = 0.1  # metres that wrists of hanging arms keep off the near face
_LEAD, _OFF = 20, 17  # frames for the hands to reach a box, and to come off it
_SHOULDERS, _WRISTS = [arm[0] for arm in ARMS], [arm[2] for arm in ARMS]
_LEGS, _ANKLES = [leg[:3] for leg in FEET], [leg[2] for leg in FEET]
_LIFT = 22  # frames in which a box is lifted where the body hardly rises


def label(carry: CarryEpisode, motion: Motion) -> None:
    """Set labels, contacts, phase keys and commands of a carry; add its box, at rest as yet, and what is
    under it.
    """
    t, p = carry.taken.bend, carry.put.bend
    motion.ramp(CARRY, t.start, t.touch, p.touch, min(p.touch + _OFF, p.end))
    motion.contacts[t.touch : p.touch, HAND_CONTACTS] = 1
    for bend in (t, p):
        motion.land(bend.start, bend.touch, bend.end)
        motion.phase_keys += [bend.start, bend.touch, bend.end]
    carry.thing = len(motion.things)
    held = np.zeros(len(motion), bool)
    held[t.touch : p.touch] = True
    motion.things.append(Thing(carry.piece, np.zeros((len(motion), 4)), held))
    for mark, spot in [(carry.fetch, carry.taken), *((m, carry.put) for m in carry.bring)]:
        asked = motion.commands[mark]
        motion.commands[mark] = TimedCommand(
            asked.frame, asked.action, spot.centre.astype(np.float32), spot.facing, carry.thing
        )
    for k, command in enumerate(motion.commands):
        # Led along with the box: the goal is the root itself, the box stays the thing it is about.
        if command.action == "walk+carry" and command.thing < 0 and t.touch < command.frame < p.touch:
            motion.commands[k] = TimedCommand(command.frame, command.action, thing=carry.thing)
    spots = [carry.taken] if carry.put.support is carry.taken.support else [carry.taken, carry.put]
    motion.obstacles += [
        Placed(s.support.piece, s.position, s.heading) for s in spots if s.support is not None
    ]


def fit_hands(carry: CarryEpisode, motion: Motion) -> None:
    """Move the box of a labelled carry and the hands with it; lean the body where arms are too short."""
    t, p = carry.taken.bend, carry.put.bend
    first, last = max(t.start - 5, 0), min(p.end + 25, len(motion))
    span = slice(first, last)
    hips, rotations = motion.hips[span], motion.rotations[span]
    poses = box_poses(carry, hips, rotations, first)
    motion.things[carry.thing].poses[:first] = poses[0]
    motion.things[carry.thing].poses[span] = poses
    motion.things[carry.thing].poses[last:] = poses[-1]
    facing = poses[:, 3] + carry.face
    own = np.broadcast_to(carry.box.learned_grasps(carry.face), (len(poses), 2, 3))
    grasps = rotate_planar(own, poses[:, None, 3]) + poses[:, None, :3]
    n = np.arange(first, last)
    coming = min(_LEAD, t.touch - t.start)
    progress = np.minimum((n - t.touch + coming) / coming, (p.touch + _OFF - n) / _OFF).clip(0, 1)
    hips, rotations = bend_into_reach(hips, rotations, grasps, progress, facing)
    motion.hips[span] = hips
    # Arms that hang from a bent body stay behind the near face of the box until they are led to its sides.
    bent = [ease((n - b.start) / 10) * ease((b.end - n) / 10) for b in (t, p)]
    near = carry.box.across(carry.face)[1] / 2 - WRIST_BEHIND + _HANGING
    motion.rotations[span] = place_hands(hips, rotations, grasps, progress, facing, (np.maximum(*bent), near))


def bend_into_reach(
    hips: Array, rotations: Array, grips: Array, progress: Array, facing: Array
) -> tuple[Array, Array]:
    """Bend a motion (T, ...) over where arms are too short for ``grips`` (T, 2, 3), or on their way there
    (``progress`` and ``facing`` (T,), see ``hands.lead``); the feet stay.  New hips and rotations.
    """
    positions, world = forward_kinematics(hips, rotations)
    places = lead(positions[:, _WRISTS], grips, progress, facing)
    reach = np.maximum(COMFORT, np.linalg.norm(places - positions[:, _SHOULDERS], axis=-1))
    reach = COMFORT + (1 - ease(progress))[:, None] * (reach - COMFORT)
    hips, bent = into_reach(hips, rotations, ARMS, places, reach, bending())
    if bent is rotations:
        return hips, rotations
    return hips, place_limbs(hips, bent, _LEGS, positions[:, _ANKLES], world[:, _ANKLES])


def box_poses(carry: CarryEpisode, hips: Array, rotations: Array, first: int) -> Array:
    """Poses (n, 4) of the box over a body's motion (n, ...), whose frame 0 is frame ``first`` of the take."""
    t, p = carry.taken.bend, carry.put.bend
    positions, _ = forward_kinematics(hips, rotations)
    root, heading = (v.astype(np.float64) for v in smoothed_root(positions))
    n = np.arange(first, first + len(hips))
    shoulders = gaussian_smooth(positions[:, _SHOULDERS, 2].mean(1).astype(np.float64), 2.0)
    up, down = _lifted(shoulders, n, t), _lifted(shoulders[::-1], -n[::-1], _reversed(p))[::-1]
    s = np.minimum(up, down)
    walking = slice(t.end - first, max(p.start - first, t.end - first + 1))
    ahead = carry.box.stand_off(carry.face) + HOLDING_AHEAD
    held = np.empty((len(n), 4))
    held[:, :2] = root + ahead * heading_to_direction(heading)
    held[:, 2] = holding_height(carry, float(np.median(shoulders[walking])), ahead)
    held[:, 3] = heading - carry.face
    held[:, 2] += _extra(carry, held)
    bob = gaussian_smooth(hips[:, 2].astype(np.float64), 1.5)
    held[:, 2] += np.clip(_BOB * (bob - np.median(bob[walking])), -_MOST_BOB, _MOST_BOB)
    # Up first and then back; down last.
    along = ease((s - 0.15) / 0.85)
    middle = (t.end + p.start) // 2 - first
    poses = np.empty_like(held)
    for part, spot, at in (
        (slice(None, middle), carry.taken, t.touch),
        (slice(middle, None), carry.put, p.touch),
    ):
        rest = np.append(spot.centre, spot.facing - carry.face)
        rest[3] = held[at - first, 3] + wrap_angle(rest[3] - held[at - first, 3])
        weight = np.stack((along, along, s, along), axis=-1)[part]
        poses[part] = rest + weight * (held[part] - rest)
    return poses


def holding_height(carry: CarryEpisode, shoulders: float, ahead: float) -> float:
    """Height of the box's centre while walking: wrists about a metre up, higher where arms would have to
    stretch.
    """
    width, _ = carry.box.across(carry.face)
    forward, aside = ahead - WRIST_BEHIND, width / 2 + WRIST_OFF_SIDE - 0.175
    drop = np.sqrt(max(_BENT**2 - forward**2 - aside**2, 0.0))
    return float(np.clip(shoulders - drop, HOLDING_HEIGHT, 1.3)) + WRIST_BELOW * float(carry.box.size[2])


def _extra(carry: CarryEpisode, held: Array) -> Array:
    """Metres (n,) that the box is held higher near what it is taken from or put on."""
    extra = np.zeros(len(held))
    for spot in (carry.taken, carry.put):
        need = max(0.0, spot.centre[2] + _CLEARANCE - held[:, 2].min())
        away = np.linalg.norm(held[:, :2] - spot.centre[:2], axis=1)
        np.maximum(extra, need * (1 - ease((away - 0.3) / 0.6)), out=extra)
    return extra


def _lifted(shoulders: Array, n: Array, bend: Bend) -> Array:
    """How far (n,) 0..1 the box has been lifted: as the shoulders (n,) rise, or by time where they
    hardly do.
    """
    inside = (n >= bend.touch) & (n < bend.end)
    after = ease((n - bend.touch - 3) / _LIFT)
    if not inside.any():
        return after
    low, high = shoulders[inside].min(), shoulders[inside][-3:].mean()
    body = np.where(
        n < bend.rise,
        0.0,
        np.where(n >= bend.end, 1.0, np.clip((shoulders - low) / max(high - low, 1e-3), 0, 1)),
    )
    body = np.maximum.accumulate(body)
    share = float(np.clip((high - low - 0.1) / 0.1, 0, 1))
    mixed = gaussian_smooth(share * body + (1 - share) * after, 2.5)
    # At rest until the hands have closed.
    return np.clip(mixed, 0, 1) * ease((n - bend.touch - 1) / 6)


def _reversed(bend: Bend) -> Bend:
    """A bend as seen backward in time: it ends with the hands on the box as a lift begins."""
    down_ends = 2 * bend.touch - bend.rise
    return Bend(-bend.end, -bend.touch, -down_ends, -bend.start)


__all__ = ["bend_into_reach", "box_poses", "fit_hands", "label"]
