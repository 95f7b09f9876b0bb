"""A keyed take as key reduction sees it, and the keys that it leaves."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.key_reduction import KeyedBody, KeyedChannels, Reduced
from nsm_core.body.skeleton import FEET, forward_kinematics
from nsm_core.rotations import Array

from ..rigs.armature import Placement
from ..rigs.mount import Mount
from .limb_controls import Channels
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
    pulled: Collection[int] = (),
) -> KeyedBody:
    """The keyed bones of a take as key reduction sees them, in metres of the character.

    ``hips`` (N, 3), world, and ``local`` (N, 23, 4) as keyed; ``turns`` and ``places`` (N, C) the values of
    channels by joint and ``modes`` their rotation modes; ``free`` joints whose bones do not turn with what
    carries them.  What carries the root, if anything does, is bone 0, so that joints are one further on.
    ``pulled`` joints have no keys of their own, and are where their controls are.
    """
    rig, scale = placement.keyed, placement.scale
    positions, _ = forward_kinematics(hips / scale, local, rig.offsets)
    _, rotations = rig.to_bones(hips / scale, local)
    channels = {}
    for j in set(rig.mapped) - set(pulled):
        axes = mounts[j].matrix[:, :3, :3] @ mounts[j].axes / scale if j in places else None
        channels[j] = KeyedChannels(turns[j], modes[j], places.get(j), axes)
    carriers = [-1 if j in pulled else c for j, c in enumerate(rig.carriers)]
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
    feet = [foot[k] + shift for foot in FEET for k in (2, 3) if foot[k] not in pulled]
    moving = frozenset(j + shift for j in free)
    return KeyedBody(carriers, positions, rotations, channels, moving, feet, rate)


def controls_of(
    controls: Mapping[str, Channels],
    mounts: Mapping[int | str, Mount],
    turns: Mapping[str, Array | None],
    modes: Mapping[str, str],
    scale: float,
    rate: float,
) -> KeyedBody:
    """The controls that pull limbs as key reduction sees them, bone by bone in their order: hands and feet
    keep to the bound with them, and poles do.  ``turns`` are the values of their rotations in ``modes``;
    ``scale`` world units to a metre of the character.
    """
    names = list(controls)
    channels = {}
    for n, (name, control) in enumerate(controls.items()):
        turn = turns[name]
        still = np.broadcast_to((1.0, 0.0, 0.0, 0.0), control.turn.shape)
        axes = None
        if control.location is not None:
            axes = mounts[name].matrix[:, :3, :3] @ mounts[name].axes / scale
        mode = "QUATERNION" if turn is None else modes[name]
        channels[n] = KeyedChannels(still if turn is None else turn, mode, control.location, axes)
    return KeyedBody(
        [names.index(c.carrier) if c.carrier else -1 for c in controls.values()],
        np.stack([c.place for c in controls.values()], axis=1) / scale,
        np.stack([c.turn for c in controls.values()], axis=1),
        channels,
        feet=[n for n, c in enumerate(controls.values()) if c.stands],
        fps=rate,
    )


def kept_of_controls(reduced: Reduced, controls: Mapping[str, Channels]) -> dict[str, KeptKeys]:
    """The keys of controls that stay, by their names; of those without rotations, the slopes of locations."""
    kept = {}
    for n, (name, control) in enumerate(controls.items()):
        slopes = reduced.slopes[n]
        kept[name] = KeptKeys(reduced.rows[n], slopes[:, -3:] if control.rotation is None else slopes)
    return kept


def joined(a: Reduced, b: Reduced) -> Reduced:
    """What two reductions do together to the motion; rows and slopes are those of the first."""
    return replace(
        a,
        before=a.before + b.before,
        after=a.after + b.after,
        mm=max(a.mm, b.mm),
        degrees=max(a.degrees, b.degrees),
        worst=a.worst if a.mm >= b.mm else b.worst,
    )


def kept_keys(reduced: Reduced, rooted: bool) -> dict[int, KeptKeys]:
    """The keys that stay, by joint, where the body is ``rooted`` those of what carries it under ``ROOT``."""
    shift = int(rooted)
    return {n - shift: KeptKeys(reduced.rows[n], reduced.slopes[n]) for n in reduced.rows}
