"""Rules that propose what a clip shows: actions with ramps and contacts, from speeds, heights and balance alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..clip import Clip
from ..control.foot_lock import HEEL_FROM_ANKLE, TOES, detect_foot_contacts, intervals
from ..conventions import CONTACTS, FPS, HAND_CONTACTS, HIP_CONTACT, STYLES
from ..rotations import Array, quat_rotate, rotate_planar
from ..skeleton import FEET, HIPS, INDEX, TOE_HEIGHT
from .library import gaussian_smooth, smoothed_root

# A ramp between two paces lies between these speeds, metres a second; the state changes in their middle.
IDLE_WALK, WALK_RUN = (0.12, 0.47), (1.8, 2.5)
MIN_STATE = 0.4  # seconds that a pace lasts at least
MAX_RAMP = 0.75  # seconds on either side of a change of pace
_REACH = round(0.5 * FPS)  # frames over which the labels of hands and steps come and go
_WRISTS = [INDEX["RightWrist"], INDEX["LeftWrist"]]
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


@dataclass(frozen=True)
class Span:
    """An action with an object: the label rises over ``start``..``full`` and falls over ``leave``..``end`` (frames)."""

    action: str
    start: int
    full: int
    leave: int
    end: int


@dataclass(frozen=True)
class Motion:
    """What the rules look at: ``positions`` and ``rotations`` in the world, root, and ``speed`` (T,), metres a second."""

    positions: Array
    rotations: Array
    root: Array
    heading: Array
    speed: Array

    def __len__(self) -> int:
        return len(self.positions)


def motion_of(clip: Clip) -> Motion:
    """Measure a clip once for all rules."""
    positions, rotations = clip.world()
    root, heading = smoothed_root(positions)
    speed = np.linalg.norm(_rate(root), axis=1)
    return Motion(positions, rotations, root, heading, gaussian_smooth(speed, 6.0))


def _rate(values: Array) -> Array:
    return np.gradient(values, axis=0) * FPS if len(values) > 1 else np.zeros_like(values)


def propose_actions(motion: Motion) -> tuple[dict[str, list[Key]], list[Span], Array]:
    """Labels by rule: key frames of every style, the spans of actions with objects, and contacts (T, 5) bool."""
    count = len(motion)
    actions: dict[str, list[Key]] = {name: [] for name in STYLES}
    contacts = np.zeros((count, len(CONTACTS)), bool)
    sits = _sits(motion)
    seated = np.zeros(count, bool)
    for span in sits:
        contacts[span.full : span.leave + 1, HIP_CONTACT] = True
        seated[span.start : span.end + 1] = True
    # The way of the hips to a seat and up again is no walk.
    actions.update(_paces(np.where(seated, 0.0, motion.speed)))
    carries = [s for s in _carries(motion) if not seated[s.full : s.leave + 1].any()]
    busy = seated.copy()
    for span in carries:
        contacts[span.full : span.leave + 1, HAND_CONTACTS] = True
        busy[span.start : span.end + 1] = True
    opens = [(s, hands) for s, hands in _reaches(motion) if not busy[s.full : s.leave + 1].any()]
    for span, hands in opens:
        contacts[span.full : span.leave + 1, [HAND_CONTACTS[h] for h in hands]] = True
    climbs = [s for s in _climbs(motion) if not seated[s.full : s.leave + 1].any()]
    spans = sorted([*sits, *carries, *(s for s, _ in opens), *climbs], key=lambda s: s.start)
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


def _paces(speed: Array) -> dict[str, list[Key]]:
    """Keys of idle, walk and run: states by speed with short ones taken back, and ramps where the speed changes."""
    changes = [sum(pair) / 2 for pair in (IDLE_WALK, WALK_RUN)]
    state = np.digitize(speed, changes)
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
        low, high = IDLE_WALK if min(before, after) == 0 else WALK_RUN
        if abs(after - before) == 2:
            low, high = IDLE_WALK[0], WALK_RUN[1]
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


def _balance(motion: Motion) -> Array:
    """How far (T,), metres, the centre of mass lies behind the hindmost heel."""
    p = motion.positions
    centre = sum(share * ((1 - at) * p[:, INDEX[a]] + at * p[:, INDEX[b]]) for a, b, at, share in _MASSES)
    centre = centre / sum(m[-1] for m in _MASSES)
    ankles = [foot[2] for foot in FEET]
    heels = p[:, ankles] + quat_rotate(motion.rotations[:, ankles], np.broadcast_to(HEEL_FROM_ANKLE, (len(p), 2, 3)))
    ahead = [rotate_planar(v[..., :2] - motion.root, -motion.heading)[..., 1] for v in (centre, heels[:, 0], heels[:, 1])]
    return ahead[0] - np.maximum(ahead[1], ahead[2])  # heading 0 faces -Y, so behind is +Y


def _sits(motion: Motion) -> list[Span]:
    """Seated where the hips are low and at rest and the body would fall over backwards without a seat."""
    height = gaussian_smooth(motion.positions[:, HIPS, 2], 2.0)
    feet = motion.positions[:, TOES, 2].min(1) - TOE_HEIGHT
    still = np.linalg.norm(_rate(gaussian_smooth(motion.positions[:, HIPS], 2.0)), axis=1) < 0.2
    seated = (height - feet < 0.68) & (height - feet > 0.25) & still & (_balance(motion) > 0.02)
    spans: list[Span] = []
    for a, b in intervals(seated):
        if b - a < 5 or (spans and a <= spans[-1].leave):
            continue
        seat = float(np.median(height[a:b]))
        down, up = _while(height < seat + 0.03, a, -1), _while(height < seat + 0.03, b - 1, 1)
        # Up to where the hips begin to come down: the nearest higher place that is level, or the end of the way up.
        start, end = _up_to_standing(height, down, -1), _up_to_standing(height, up, 1)
        if spans and start < spans[-1].end:
            start = spans[-1].end
        spans.append(Span("sit", min(start, down), down, up, max(end, up)))
    return spans


def _while(flags: Array, frame: int, step: int) -> int:
    """Last frame from ``frame`` on, in steps, up to which ``flags`` hold."""
    while 0 <= frame + step < len(flags) and flags[frame + step]:
        frame += step
    return frame


def _up_to_standing(height: Array, frame: int, step: int) -> int:
    """Frame at which the hips, followed from a seat, are within 3 cm of the height they come to, in at most 3 s."""
    reach = height[frame::step][: 3 * FPS]
    top = float(reach[: _first(np.diff(reach) < -0.004, len(reach))].max()) if len(reach) > 1 else float(height[frame])
    return frame + step * _first(reach > top - 0.03, len(reach) - 1)


def _first(flags: Array, otherwise: int) -> int:
    found = np.flatnonzero(flags)
    return int(found[0]) if len(found) else otherwise


def _hands(motion: Motion) -> Array:
    """Wrists (T, 2, 3) in the root frame: x to the left, -y ahead, z up."""
    local = motion.positions[:, _WRISTS].copy()
    local[..., :2] -= motion.root[:, None]
    return rotate_planar(local, -motion.heading[:, None])


def _windowed(values: Array, half: int, function) -> Array:
    """``function`` over the 2 half + 1 frames around each, along the last axis of windows."""
    padded = np.pad(values, (half, half), mode="edge")
    return function(np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1), axis=-1)


def _carries(motion: Motion) -> list[Span]:
    """Both hands in front at one height and a distance that does not change, elbows bent: they hold something."""
    hands = _hands(motion)
    apart = np.linalg.norm(hands[:, 0] - hands[:, 1], axis=-1)
    ahead = -hands[..., 1]
    rigid = _windowed(apart, 8, np.ptp) < 0.07
    level = (np.abs(hands[:, 0, 2] - hands[:, 1, 2]) < 0.16) & (np.abs(ahead[:, 0] - ahead[:, 1]) < 0.16)
    bent = np.min([_elbow(motion, side) for side in ("Right", "Left")], axis=0) > np.radians(35)
    pair = rigid & level & (ahead.min(1) > 0.05) & (apart > 0.12) & (apart < 0.7)
    held = pair & bent & (hands[..., 2].min(1) > 0.7)
    spans: list[Span] = []
    height = gaussian_smooth(hands[..., 2].mean(1), 2.0)
    for a, b in intervals(_closed(held, 6)):
        if b - a < 0.5 * FPS:
            continue
        same = (np.abs(apart - np.median(apart[a:b])) < 0.1) & level & (ahead.min(1) > 0.03)
        first, last = _while(same, a, -1), _while(same, b - 1, 1)
        # A lift starts, and a box is let go, where the hands are lowest.
        grasp = first + int(np.argmin(height[first : a + 1])) if height[first : a + 1].min() < height[a] - 0.1 else a
        release = b - 1 + int(np.argmin(height[b - 1 : last + 1])) if height[b - 1 : last + 1].min() < height[b - 1] - 0.1 else b - 1
        # Hands that only rest before a standing body hold nothing that could be told.
        walks = float((motion.speed[a:b] > 0.6).sum()) > 0.5 * FPS
        if not walks and min(height[grasp], height[release]) > 0.72:
            continue
        if spans and grasp <= spans[-1].leave + FPS:  # a grip is not let go for a moment
            old = spans.pop()
            spans.append(Span("carry", old.start, old.full, release, release + _REACH))
            continue
        spans.append(Span("carry", grasp - _REACH, grasp, release, release + _REACH))
    return [_inside(s, len(motion)) for s in spans]


def _closed(flags: Array, gap: int) -> Array:
    """Flags with gaps of up to ``gap`` frames filled."""
    filled = flags.copy()
    for a, b in intervals(~flags):
        if b - a <= gap and a > 0 and b < len(flags):
            filled[a:b] = True
    return filled


def _inside(span: Span, count: int) -> Span:
    """A span cut at the clip's ends; what begins or ends there has no ramp."""
    start, end = max(span.start, 0), min(span.end, count - 1)
    return Span(span.action, start, max(span.full, start), min(span.leave, end), end)


def _elbow(motion: Motion, side: str) -> Array:
    """Bend (T,) of an elbow, radians; 0 is straight."""
    s, e, w = (motion.positions[:, INDEX[side + n]] for n in ("Shoulder", "Elbow", "Wrist"))
    cosine = np.sum((e - s) * (w - e), axis=-1) / np.maximum(np.linalg.norm(e - s, axis=-1) * np.linalg.norm(w - e, axis=-1), 1e-9)
    return np.arccos(np.clip(cosine, -1, 1))


def _reaches(motion: Motion) -> list[tuple[Span, list[int]]]:
    """One hand far ahead at the height of a handle while the other is not, or both pushing with straight arms."""
    hands = _hands(motion)
    ahead, height = -hands[..., 1], hands[..., 2]
    speed = np.stack([np.linalg.norm(_rate(gaussian_smooth(motion.positions[:, w], 1.5)), axis=1) for w in _WRISTS], axis=1)
    level = (height > 0.75) & (height < 1.4)
    found: list[tuple[Span, list[int]]] = []

    def add(flags: Array, seconds: float, which: list[int]) -> None:
        for a, b in intervals(_closed(flags, 4)):
            if b - a >= seconds * FPS:
                found.append((_inside(Span("open", a - _REACH, a, b - 1, b - 1 + _REACH), len(motion)), which))

    for hand in (0, 1):
        alone = (ahead[:, hand] > 0.33) & level[:, hand] & (speed[:, hand] < 0.6) & (ahead[:, 1 - hand] < 0.2)
        add(alone & (motion.speed < 0.6), 0.3, [hand])
    straight = np.max([_elbow(motion, side) for side in ("Right", "Left")], axis=0) < np.radians(30)
    add(straight & level.all(1) & (ahead.min(1) > 0.55), 1.0, [0, 1])
    return found


def _supports(motion: Motion) -> list[tuple[int, int, int, float]]:
    """Where feet stand: (first, end, side, height of the ground under it, metres), by the time they begin."""
    found = []
    for side, toe in enumerate(TOES):
        p = gaussian_smooth(motion.positions[:, toe], 1.0)
        still = np.linalg.norm(_rate(p), axis=1) < 0.3
        for a, b in intervals(still):
            if b - a >= 5:
                found.append((a, b, side, max(0.0, float(motion.positions[a:b, toe, 2].min()) - TOE_HEIGHT)))
    return sorted(found)


def _climbs(motion: Motion, step: float = 0.1) -> list[Span]:
    """From where a foot leaves for ground that is higher or lower until both stand there, hips raised or lowered too."""
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
                arrived = next((s[0] for s in supports if s[0] > a and s[2] != side and abs(s[3] - height) < step), a + 15)
                if arrived - a < 3 * FPS:
                    spans.append(Span("climb", left - 6, left + 4, max(arrived, left + 5), arrived + 10))
                ground = height
        elif ground is None or other is None or abs(height - other[3]) < step:
            ground = height
        last[side] = support
    merged: list[Span] = []
    for span in (_inside(s, len(motion)) for s in spans):
        if merged and span.start <= merged[-1].end + 10:
            old = merged.pop()
            span = Span("climb", old.start, old.full, max(old.leave, span.leave), max(old.end, span.end))
        merged.append(span)
    return merged


def _feet(motion: Motion, climbs: list[Span]) -> Array:
    """Contacts (T, 2) of the feet: low and slow on the floor; in a clip that climbs, still at any height."""
    running = np.clip(motion.speed / 2.1, 0, 1.5)
    slow, fast = (detect_foot_contacts(motion.positions, speed=v) for v in (0.3, 0.9))
    on = np.where(running[:, None] > 1, fast, slow)
    for a, b, side, _ in _supports(motion) if climbs else ():
        on[a:b, side] = True
    return on
