"""What is used today instead of a network, stepped by the same controller: captured motion played back.

Both play the composed performances, which are captured frames found by motion matching and stitched to
actions.  *Clips*: the one that fits best is chosen when the goal changes and played to its end, its root
warped so that it arrives where the goal is.  *Matching*: every few frames the whole database is searched for
what goes on from the present pose towards the goal, and the root is steered by as much as feet allow.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.conventions import CARRY, DT, GOAL_ACTIONS, OPEN, SIT
from nsm_core.data.matching.search import MARGIN, MAX_DRIFT, MAX_TURN, SWITCH
from nsm_core.data.storage import Dataset, described
from nsm_core.model.features.codec import SensorReading, build_inputs, build_targets, no_object
from nsm_core.model.features.layout import ENVIRONMENT, FRAME, GOAL, INPUT, OUTPUT, Inputs
from nsm_core.model.features.state import PIVOT
from nsm_core.model.networks.config import Memory, NetworkConfig
from nsm_core.model.networks.protocol import Info
from nsm_core.rotations import Array, direction_to_heading, rotate_planar, wrap_angle

KEEPS = 0.85  # share of a pose's difference from what is played that is left after a frame
EVERY = 5  # frames between searches
LOST = 0.3  # metres between a clip that has arrived and its goal, from which on another is chosen
PACE = {"run": 2.8, "walk": 1.2}  # metres that a second brings one nearer to a far goal
FAR = 2.0  # metres from which on a goal only has a direction
STEPPING = 0.25  # m/s of the hips from which on feet are taken to step, so that a root may be steered
_LIMBS = [INDEX[f"{side}{joint}"] for side in ("Right", "Left") for joint in ("Ankle", "Wrist")]
_MOVING = [INDEX["RightAnkle"], INDEX["LeftAnkle"], HIPS]
# What a frame is found by, and how much a deviation of each counts.
_WEIGHTS = {
    "limbs": 1.0, "speeds": 1.0, "labels": 1.5, "goal": 2.5, "facing": 2.0, "action": 6.0,
    "ahead": 2.0,
}  # fmt: skip
_CHUNK = 1000
_LABELS = [CARRY, OPEN, SIT]
_ACTIONS = [GOAL_ACTIONS.index(name) for name in ("carry", "open", "sit")]


@dataclass(frozen=True)
class CapturedConfig(NetworkConfig):
    """Sizes of what plays captures: it remembers which frame it plays and how long ago it has searched."""

    network: ClassVar[str] = "captured"

    @property
    def memory_sizes(self) -> dict[str, int]:
        """The frame that is played, -1 for none yet, and frames since the last search."""
        return {"frame": 1, "since": 1}


def _block(x: Array, part: str, layout: Any, name: str) -> Array:
    return layout.get(x[:, INPUT.slices[part]], name)


def _goal(x: Array) -> tuple[Array, Array]:
    """Place (B, 3) and heading (B,) of the goal in the root's frame."""
    place = _block(x, "goal", GOAL, "goal_position")[:, PIVOT]
    return place, direction_to_heading(_block(x, "goal", GOAL, "goal_direction")[:, PIVOT])


def _found_by(x: Array) -> dict[str, Array]:
    """What frames are compared by, (B, n) each, of network inputs (B, 4018)."""
    place, heading = _goal(x)
    away = np.linalg.norm(place[:, :2], axis=1, keepdims=True)
    place = np.concatenate((place[:, :2] * np.minimum(1, FAR / np.maximum(away, 1e-6)), place[:, 2:]), axis=1)
    near = np.exp(-away / FAR)
    flat = (len(x), -1)
    return {
        "limbs": _block(x, "frame", FRAME, "joint_position")[:, _LIMBS].reshape(flat),
        "speeds": _block(x, "frame", FRAME, "joint_velocity")[:, _MOVING].reshape(flat),
        "labels": _block(x, "frame", FRAME, "trajectory_style")[:, PIVOT],
        "goal": place,
        "facing": near * np.stack((np.sin(heading), np.cos(heading)), axis=1),
        "action": _block(x, "goal", GOAL, "goal_action")[:, PIVOT],
        "ahead": _block(x, "frame", FRAME, "trajectory_position")[:, -1],
    }


def _wanted(x: Array) -> dict[str, Array]:
    """What a frame is looked for by: as ``_found_by``, but nearer to the goal in a second."""
    place, _ = _goal(x)
    runs = _block(x, "goal", GOAL, "goal_action")[:, PIVOT, GOAL_ACTIONS.index("run")] > 0.5
    away = np.linalg.norm(place[:, :2], axis=1)
    pace = np.where(runs, PACE["run"], PACE["walk"])
    ahead = place[:, :2] * (np.minimum(away, pace) / np.maximum(away, 1e-6))[:, None]
    return _found_by(x) | {"ahead": ahead}


class CapturedModel:
    """Composed data played back, by "clips" or by "matching"; a ``Model``."""

    backend = "numpy"

    def __init__(self, data: Dataset, metadata: dict[str, Any], kind: str) -> None:
        """Index the frames of ``data``; ``metadata`` is what a weights file of them would say."""
        self.data, self.kind, self.config = data, kind, CapturedConfig()
        self.metadata = metadata | {"training": {"rollout": {"blending": _NO_BLENDING}}}
        self._candidates = data.frames[:: 2 if len(data.frames) > 20000 else 1]
        parts = [
            _found_by(self._inputs(self._candidates[k : k + _CHUNK]))
            for k in range(0, len(self._candidates), _CHUNK)
        ]
        found = {name: np.concatenate([p[name] for p in parts]) for name in _WEIGHTS}
        self._scale = {
            name: np.float32(weight / np.sqrt(values.shape[1]) / max(float(values.std(axis=0).mean()), 1e-3))
            for (name, weight), values in zip(_WEIGHTS.items(), found.values(), strict=True)
        }
        self._features = self._scaled(found)
        self._sizes = (self._features**2).sum(axis=1)
        self._usable = np.zeros(len(data.arrays["end"]), bool)
        self._usable[data.frames] = True
        self._arrives = _arrivals(data)

    @classmethod
    def open(cls, folder: str | Path, kind: str) -> CapturedModel:
        """Play back the composed data in a folder."""
        stance = described(folder)["stance"]
        shown = json.loads((Path(folder) / "data.json").read_text(encoding="utf-8"))
        return cls(Dataset.open(folder), {"stance": stance, "meaning": shown.get("meaning")}, kind)

    def start(self, batch: int = 1) -> Memory:
        """No frame is played yet."""
        return {name: values - 1 for name, values in self.config.start(batch).items()}

    def step(self, inputs: Inputs[Array], memory: Memory) -> tuple[Array, Memory, Info]:
        """Predict as ``Model.step`` says: the frame that follows the one that is played, warped to the
        goal.
        """
        x, _ = self.config.checked(inputs, memory)
        frame, since = memory["frame"][:, 0].astype(np.int64), memory["since"][:, 0].astype(np.int64)
        frame, anew = self._chosen(x, frame, since)
        onward = self._goes_on(x, frame)
        following = np.where(onward, frame + 1, frame)
        state, after = self.data.state(frame), self.data.state(following)
        y = build_targets(state, after, self.data.arrays["contact"][following])
        self._carry_pose(x, y, self._inputs(frame))
        shift, turn = self._warp(x, frame)
        _steer(y, shift * onward[:, None], turn * onward)
        memory = {"frame": following, "since": np.where(anew, 0, since + 1)}
        return y, {k: v[:, None].astype(np.float32) for k, v in memory.items()}, {}

    def _inputs(self, frames: Array) -> Array:
        """Network inputs (B, 4018) of frames, sensors left out."""
        state = self.data.state(frames)
        nothing = SensorReading(np.zeros((len(frames), ENVIRONMENT), np.float32), *no_object(state.root))
        return build_inputs(state, nothing).features

    def _scaled(self, found: dict[str, Array]) -> Array:
        return np.concatenate([self._scale[n] * v for n, v in found.items()], axis=1).astype(np.float32)

    def _chosen(self, x: Array, frame: Array, since: Array) -> tuple[Array, Array]:
        """The frames (B,) to play now, and for which characters that was searched for."""
        other = frame < 0
        known = np.where(other, 0, frame)
        asked = _block(x, "goal", GOAL, "goal_action")[:, PIVOT] > 0.5
        mine = self.data.arrays["goal_action"][known][:, PIVOT] > 0.5
        other |= (asked != mine).any(axis=1)
        ended = ~self._usable[np.minimum(known + 1, len(self._usable) - 1)]
        if self.kind == "clips":  # it has arrived, and the goal is somewhere else by now
            off = np.linalg.norm(self._off(x, known)[0], axis=1)
            ended |= (self._arrives[known] <= known) & (off > LOST)
        anew = other | (ended if self.kind == "clips" else ended | (since >= EVERY - 1))
        rows = np.flatnonzero(anew)
        if len(rows):
            features = self._scaled(_wanted(x[rows]))
            costs = self._sizes - 2 * features @ self._features.T
            best = costs.argmin(axis=1)
            cost = costs[np.arange(len(rows)), best] + (features**2).sum(axis=1)
            going = self._scaled(_found_by(self._inputs(known[rows])))
            stays = ((going - features) ** 2).sum(axis=1)
            better = (cost < SWITCH * stays - MARGIN) | other[rows] | ended[rows]
            frame = frame.copy()
            frame[rows] = np.where(better, self._candidates[best], frame[rows])
        return frame, anew

    def _goes_on(self, x: Array, frame: Array) -> Array:
        """Which characters play on: one whose capture leaves what is still asked for holds its frame."""
        goals = self.data.arrays["goal_action"]
        following = np.minimum(frame + 1, len(goals) - 1)
        leaves = (np.abs(goals[following][:, PIVOT] - goals[frame][:, PIVOT]) > 0.5).any(axis=1)
        return self._usable[following] & ~leaves

    def _carry_pose(self, x: Array, y: Array, played: Array) -> None:
        """Let what differs between the body and the frame that is played die away; changes ``y``."""
        for name in ("joint_position", "joint_forward", "joint_up"):
            block = OUTPUT.get(y, name)
            block += KEEPS * (_block(x, "frame", FRAME, name) - _block(played, "frame", FRAME, name))
        now = _block(x, "frame", FRAME, "joint_position")
        OUTPUT.get(y, "joint_velocity")[:] = (OUTPUT.get(y, "joint_position") - now) / DT

    def _off(self, x: Array, frame: Array) -> tuple[Array, Array]:
        """How far (B, 2) and by what turn (B,) the goal is elsewhere than that of the frame that is played,
        in the root's frame.
        """
        place, heading = _goal(x)
        there, faces = _goal(self._inputs(frame))
        turn = wrap_angle(heading - faces)
        # The goal as it would be seen from a root that is turned so.
        return place[:, :2] - rotate_planar(there[:, :2], turn), turn

    def _warp(self, x: Array, frame: Array) -> tuple[Array, Array]:
        """By how much (B, 2), (B,) the root is moved and turned in this frame, in its own frame."""
        shift, turn = self._off(x, frame)
        left = np.maximum(self._arrives[frame] - frame, 0)
        if self.kind == "clips":
            share = np.where(left > 0, 1 / np.maximum(left, 1), 0.0)
            return shift * share[:, None], turn * share
        speed = np.linalg.norm(_block(x, "frame", FRAME, "joint_velocity")[:, HIPS, :2], axis=1)
        most = np.clip(speed / STEPPING, 0, 1) * (left > 0)
        away = np.linalg.norm(shift, axis=1)
        shift = shift * (np.minimum(away, MAX_DRIFT * DT) / np.maximum(away, 1e-6) * most)[:, None]
        return shift, np.clip(turn, -MAX_TURN * DT, MAX_TURN * DT) * most


_NO_BLENDING = {"goal_centric": False, "future_pose": False}


def _arrivals(data: Dataset) -> Array:
    """Of each frame (N,) the one in which what is asked for in it is reached: its label is complete, or
    something else is asked for.
    """
    a = data.arrays
    asked = a["goal_action"][:, PIVOT] > 0.5
    label = a["style"][:, _LABELS].max(axis=1) > 0.9
    n = np.arange(len(asked))
    changes = np.zeros(len(n), bool)
    changes[:-1] = (asked[1:] != asked[:-1]).any(axis=1)
    ends = changes | (n == a["end"] - 1) | (label & asked[:, _ACTIONS].any(axis=1))
    at = np.where(ends, n, len(n))
    return np.minimum(np.minimum.accumulate(at[::-1])[::-1], a["end"] - 1)


def _steer(y: Array, shift: Array, turn: Array) -> None:
    """Move and turn everything that an output says of the next frame by a planar shift (B, 2) and turn (B,);
    changes ``y``.
    """
    for name in ("joint_position", "joint_forward", "joint_up", "joint_velocity", "future_joint_position"):
        block = OUTPUT.get(y, name)
        block[:] = rotate_planar(block, turn[:, None])
        if name == "joint_position":
            block[..., :2] += shift[:, None]
        if name == "joint_velocity":
            block[..., :2] += shift[:, None] / DT
    for name in ("trajectory_position", "trajectory_direction"):
        block = OUTPUT.get(y, name)
        block[:] = rotate_planar(block, turn[:, None])
    OUTPUT.get(y, "trajectory_position")[:] += shift[:, None]
