"""Rules that propose what a clip shows: actions with ramps and contacts, from speeds, heights and balance
alone.
"""

from __future__ import annotations

import numpy as np

from nsm_core.body.contacts import HEEL_FROM_ANKLE, TOES, detect_foot_contacts
from nsm_core.body.skeleton import FEET, HIPS, INDEX, TOE_HEIGHT
from nsm_core.conventions import CONTACTS, FPS, HAND_CONTACTS, HIP_CONTACT, STYLES
from nsm_core.distances import IDLE_TO_WALK, WALK_TO_RUN
from nsm_core.rotations import Array, quat_rotate, rotate_planar
from nsm_core.signals import gaussian_smooth, intervals

from .hand_rules import carries, reaches
from .measures import MeasuredMotion, Span, first_of, hold_while, inside_clip, rate

MIN_STATE = 0.4  # seconds that a pace lasts at least
MAX_RAMP = 0.75  # seconds on either side of a change of pace
# Share of the body's mass and where it lies: between two joints, by the fraction from the first.
_MASSES = (("Hips", "Neck", 0.5, 0.497), ("Neck", "Head", 1.0, 0.081)) + tuple(
    (side + a, side + b, at, share)
    for side in ("Right", "Left")
    for a, b, at, share in (
        ("Shoulder", "Elbow", 0.44, 0.028), ("Elbow", "Wrist", 0.7, 0.022),
        ("Hip", "Knee", 0.43, 0.1), ("Knee", "Ankle", 0.43, 0.0465), ("Ankle", "Toe", 0.5, 0.0145),
    )
)  # fmt: skip

Key = tuple[int, float]


def propose_actions(motion: MeasuredMotion) -> tuple[dict[str, list[Key]], list[Span], Array]:
    """Labels by rule: key frames of every style, the spans of actions with objects, and contacts (T,
    5) bool.
    """
    count = len(motion)
    actions: dict[str, list[Key]] = {name: [] for name in STYLES}
    contacts = np.zeros((count, len(CONTACTS)), bool)
    sits = _sits(motion)
    seated = np.zeros(count, bool)
    for span in sits:
        contacts[span.full : span.leave + 1, HIP_CONTACT] = True
        seated[span.start : span.end + 1] = True
    # The way of the hips to a seat and up again is no walk.
    planted = detect_foot_contacts(motion.positions).all(1)
    actions.update(_paces(np.where(seated, 0.0, motion.speed), planted))
    held = [s for s in carries(motion) if not seated[s.full : s.leave + 1].any()]
    busy = seated.copy()
    for span in held:
        contacts[span.full : span.leave + 1, HAND_CONTACTS] = True
        busy[span.start : span.end + 1] = True
    opens = [(s, hands) for s, hands in reaches(motion) if not busy[s.full : s.leave + 1].any()]
    for span, hands in opens:
        contacts[span.full : span.leave + 1, [HAND_CONTACTS[h] for h in hands]] = True
    climbs = [s for s in _climbs(motion) if not seated[s.full : s.leave + 1].any()]
    spans = sorted([*sits, *held, *(s for s, _ in opens), *climbs], key=lambda s: s.start)
    for span in spans:
        actions[span.action] += span_keys(span, count)
    contacts[:, -2:] = _feet(motion, climbs)
    return {name: tidy(keys) for name, keys in actions.items()}, spans, contacts


def span_keys(span: Span, count: int) -> list[Key]:
    """The four keys of a label's ramps; at a clip's ends there is no ramp."""
    keys = [] if span.start <= 0 and span.full <= 1 else [(span.start, 0.0)]
    keys += [(span.full, 1.0), (span.leave, 1.0)]
    return keys if span.leave >= count - 2 else [*keys, (span.end, 0.0)]


def tidy(keys: list[Key]) -> list[Key]:
    """Sort keys, one a frame (the higher value stays)."""
    best: dict[int, float] = {}
    for frame, value in keys:
        best[int(frame)] = max(float(value), best.get(int(frame), 0.0))
    return sorted(best.items())


def _paces(speed: Array, planted: Array) -> dict[str, list[Key]]:
    """Keys of idle, walk and run: states by speed with short ones taken back, and ramps where the speed
    changes.

    A ramp between two paces lies between the two speeds of its change; the state changes in their middle.
    A body that moves while both feet stay where they are (``planted`` (T,)) does not walk.
    """
    changes = [sum(pair) / 2 for pair in (IDLE_TO_WALK, WALK_TO_RUN)]
    state = np.digitize(speed, changes)
    for a, b in intervals(state == 1):
        if planted[a:b].mean() > 0.8:
            state[a:b] = 0
    while True:
        edges = np.flatnonzero(np.diff(state)) + 1
        runs = list(zip([0, *edges], [*edges, len(state)], strict=True))
        inner = [(b - a, a, b) for a, b in runs if b - a < MIN_STATE * FPS and len(runs) > 1]
        if not inner:
            break
        _, a, b = min(inner)
        state[a:b] = state[a - 1] if a > 0 else state[b]
    keys: dict[str, list[Key]] = {name: [] for name in STYLES[:3]}
    keys[STYLES[state[0]]].append((0, 1.0))
    for (first, edge), (_, last) in zip(runs, runs[1:], strict=False):
        before, after = int(state[edge - 1]), int(state[edge])
        low, high = IDLE_TO_WALK if min(before, after) == 0 else WALK_TO_RUN
        if abs(after - before) == 2:
            low, high = IDLE_TO_WALK[0], WALK_TO_RUN[1]
        rising = after > before
        room = round(MAX_RAMP * FPS)
        back, ahead = speed[max(first, edge - room) : edge], speed[edge : min(last, edge + room)]
        out = np.flatnonzero(back <= low if rising else back >= high)
        into = np.flatnonzero(ahead >= high if rising else ahead <= low)
        a = edge - len(back) + int(out[-1]) if len(out) else edge - min(len(back) // 2, room)
        b = edge + int(into[0]) if len(into) else edge + min(len(ahead) // 2, room)
        a, b = min(a, edge - 2), max(b, edge + 2)
        keys[STYLES[before]] += [(a, 1.0), (b, 0.0)]
        keys[STYLES[after]] += [(a, 0.0), (b, 1.0)]
    inside = {name: [(min(max(f, 0), len(speed) - 1), v) for f, v in found] for name, found in keys.items()}
    return {name: tidy(found) for name, found in inside.items()}


def _balance(motion: MeasuredMotion) -> Array:
    """How far (T,), metres, the centre of mass lies behind the hindmost heel."""
    p = motion.positions
    parts = (share * ((1 - at) * p[:, INDEX[a]] + at * p[:, INDEX[b]]) for a, b, at, share in _MASSES)
    centre = sum(parts, np.zeros_like(p[:, 0])) / sum(m[-1] for m in _MASSES)
    ankles = [foot[2] for foot in FEET]
    heels = p[:, ankles] + quat_rotate(
        motion.rotations[:, ankles], np.broadcast_to(HEEL_FROM_ANKLE, (len(p), 2, 3))
    )
    ahead = [
        rotate_planar(v[..., :2] - motion.root, -motion.heading)[..., 1]
        for v in (centre, heels[:, 0], heels[:, 1])
    ]
    return ahead[0] - np.maximum(ahead[1], ahead[2])  # heading 0 faces -Y, so behind is +Y


def _sits(motion: MeasuredMotion) -> list[Span]:
    """Seated where the hips are low and at rest and the body would fall over backwards without a seat."""
    height = gaussian_smooth(motion.positions[:, HIPS, 2], 2.0)
    feet = motion.positions[:, TOES, 2].min(1) - TOE_HEIGHT
    still = np.linalg.norm(rate(gaussian_smooth(motion.positions[:, HIPS], 2.0)), axis=1) < 0.2
    seated = (height - feet < 0.68) & (height - feet > 0.25) & still & (_balance(motion) > 0.02)
    spans: list[Span] = []
    for a, b in intervals(seated):
        if b - a < 5 or (spans and a <= spans[-1].leave):
            continue
        seat = float(np.median(height[a:b]))
        down, up = hold_while(height < seat + 0.03, a, -1), hold_while(height < seat + 0.03, b - 1, 1)
        # Up to where the hips begin to come down: the nearest higher place that is level, or the end of the
        # way up.
        start, end = _up_to_standing(height, down, -1), _up_to_standing(height, up, 1)
        if spans and start < spans[-1].end:
            start = spans[-1].end
        spans.append(Span("sit", min(start, down), down, up, max(end, up)))
    return spans


def _up_to_standing(height: Array, frame: int, step: int) -> int:
    """Frame at which the hips, followed from a seat, are within 3 cm of the height they come to, in at most 3
    s.
    """
    reach = height[frame::step][: 3 * FPS]
    top = (
        float(reach[: first_of(np.diff(reach) < -0.004, len(reach))].max())
        if len(reach) > 1
        else float(height[frame])
    )
    return frame + step * first_of(reach > top - 0.03, len(reach) - 1)


def _supports(motion: MeasuredMotion) -> list[tuple[int, int, int, float]]:
    """Where feet stand: (first, end, side, height of the ground under it, metres), by the time they begin."""
    found = []
    for side, toe in enumerate(TOES):
        p = gaussian_smooth(motion.positions[:, toe], 1.0)
        still = np.linalg.norm(rate(p), axis=1) < 0.3
        for a, b in intervals(still):
            if b - a >= 5:
                found.append((a, b, side, max(0.0, float(motion.positions[a:b, toe, 2].min()) - TOE_HEIGHT)))
    return sorted(found)


def _climbs(motion: MeasuredMotion, step: float = 0.1) -> list[Span]:
    """From where a foot leaves for ground that is higher or lower until both stand there, hips raised or
    lowered too.
    """
    supports = _supports(motion)
    hips = gaussian_smooth(motion.positions[:, HIPS, 2], 3.0)
    spans: list[Span] = []
    last: dict[int, tuple[int, int, int, float]] = {}
    ground = None
    for support in supports:
        a, b, side, height = support
        other = last.get(1 - side)
        if ground is not None and abs(height - ground) > step:
            left = last[side][1] if side in last else max(0, a - 15)
            before, after = hips[max(0, left - 5)], hips[min(len(hips) - 1, a + 20)]
            if (after - before) * np.sign(height - ground) > 0.5 * abs(height - ground):
                arrived = next(
                    (s[0] for s in supports if s[0] > a and s[2] != side and abs(s[3] - height) < step),
                    a + 15,
                )
                if arrived - a < 3 * FPS:
                    spans.append(Span("climb", left - 6, left + 4, max(arrived, left + 5), arrived + 10))
                ground = height
        elif ground is None or other is None or abs(height - other[3]) < step:
            ground = height
        last[side] = support
    merged: list[Span] = []
    for span in (inside_clip(s, len(motion)) for s in spans):
        if merged and span.start <= merged[-1].end + 10:
            old = merged.pop()
            span = Span("climb", old.start, old.full, max(old.leave, span.leave), max(old.end, span.end))
        merged.append(span)
    return merged


def _feet(motion: MeasuredMotion, climbs: list[Span]) -> Array:
    """Contacts (T, 2) of the feet: low and slow on the floor; in a clip that climbs, still at any height."""
    running = np.clip(motion.speed / 2.1, 0, 1.5)
    slow, fast = (detect_foot_contacts(motion.positions, speed=v) for v in (0.3, 0.9))
    on = np.where(running[:, None] > 1, fast, slow)
    for a, b, side, _ in _supports(motion) if climbs else ():
        on[a:b, side] = True
    return on
