"""A keyed take as key reduction sees it, and the keys that it leaves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.body.key_reduction import KeyedBody, KeyedChannels, Reduced
from nsm_core.body.skeleton import FEET, forward_kinematics
from nsm_core.rotations import Array

from ..rigs.armature import Placement
from ..rigs.mount import Mount
from .root_motion import RootChannels, RootWay

ROOT = -1  # what carries the root, among the joints


@dataclass(frozen=True)
class KeptKeys:
    """Keys of one bone that stay: ``rows`` (K,) of the frames, and slopes (K, C) of its rotation and location
    channels, a frame.
    """

    rows: Array
    slopes: Array


def body_of(
    placement: Placement,
    mounts: dict[int, Mount],
    hips: Array,
    local: Array,
    turns: dict[int, Array],
    places: dict[int, Array],
    modes: dict[int, str],
    free: set[int],
    root: tuple[RootWay, RootChannels] | None,
    rate: float,
) -> KeyedBody:
    """The keyed bones of a take as key reduction sees them, in metres of the character.

    ``hips`` (N, 3), world, and ``local`` (N, 23, 4) as keyed; ``turns`` and ``places`` (N, C) the values of
    channels by joint and ``modes`` their rotation modes; ``free`` joints whose bones do not turn with what
    carries them.  What carries the root, if anything does, is bone 0, so that joints are one further on.
    """
    rig, scale = placement.keyed, placement.scale
    positions, _ = forward_kinematics(hips / scale, local, rig.offsets)
    _, rotations = rig.to_bones(hips / scale, local)
    channels = {}
    for j in rig.mapped:
        axes = mounts[j].matrix[:, :3, :3] @ mounts[j].axes / scale if j in places else None
        channels[j] = KeyedChannels(turns[j], modes[j], places.get(j), axes)
    carriers = list(rig.carriers)
    shift = 0
    if root is not None:
        way, carrier = root
        shift = 1
        carriers = [-1, *(c + 1 for c in carriers)]  # what nothing carried is carried by it
        standing, turning = way.seen()
        positions = np.concatenate((standing[:, None] / scale, positions), axis=1)
        rotations = np.concatenate((turning[:, None], rotations), axis=1)
        channels = {j + 1: c for j, c in channels.items()}
        channels[0] = KeyedChannels(carrier.turns, carrier.mode, carrier.places, carrier.axes / scale)
    feet = [foot[k] + shift for foot in FEET for k in (2, 3)]
    moving = frozenset(j + shift for j in free)
    return KeyedBody(carriers, positions, rotations, channels, moving, feet, rate)


def kept_keys(reduced: Reduced, rooted: bool) -> dict[int, KeptKeys]:
    """The keys that stay, by joint, where the body is ``rooted`` those of what carries it under ``ROOT``."""
    shift = int(rooted)
    return {n - shift: KeptKeys(reduced.rows[n], reduced.slopes[n]) for n in reduced.rows}
