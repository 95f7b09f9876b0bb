"""The one place that names every slice of the controller's input and output vectors."""

from __future__ import annotations

import numpy as np

from nsm_core.body.skeleton import ARMS, HIPS, J
from nsm_core.model.features.layout import Layout
from nsm_core.model.features.state import FUTURE, KEYS, PIVOT
from nsm_core.rotations import Array

from .tasks import TASKS

CHANNELS = 8  # of the Periodic Autoencoder
# Key joints with a place and a turn; the root on the floor is the fourth (section 5.1).
KEY_JOINTS = (HIPS, ARMS[0][2], ARMS[1][2])
SOLID = 9  # numbers of one: place, and the axes ahead and up of its frame
LABELS = 1 + 2 * TASKS  # whether hips walk, and the task of the right and the left hand, one-hot
AHEAD = FUTURE + 1  # the pivot and the keys ahead
_POSE = {"joint_position": (J, 3), "joint_forward": (J, 3), "joint_up": (J, 3), "joint_velocity": (J, 3)}
_WAVE = (CHANNELS, 2)  # A cos 2 pi S, A sin 2 pi S
INPUT = Layout(
    **_POSE,
    root=(KEYS, 4),
    joints=(KEYS, len(KEY_JOINTS), SOLID),
    label=(LABELS,),
    goal_root=(KEYS, 4),
    goal_joints=(KEYS, len(KEY_JOINTS), SOLID),
    goal_label=(KEYS, LABELS),
    wave=_WAVE,
    frequency=(CHANNELS,),
    goal_wave=_WAVE,
    goal_frequency=(CHANNELS,),
)
OUTPUT = Layout(
    **_POSE,
    root=(AHEAD, 4),
    joints=(AHEAD, len(KEY_JOINTS), SOLID),
    goalward_root=(AHEAD, 4),
    goalward_joints=(AHEAD, len(KEY_JOINTS), SOLID),
    goal_root=(KEYS, 4),
    goal_joints=(KEYS, len(KEY_JOINTS), SOLID),
    goal_wave=_WAVE,
    goal_frequency=(CHANNELS,),
    control=(3, CHANNELS),
    contact=(2,),
)
# What tells of the goal's phase in the input: a controller without it never sees it.
GOAL_PHASE = ("goal_wave", "goal_frequency")


def _columns(name: str, key: int | None = None) -> Array:
    """Columns of a block of the input, of one key of it where that is said."""
    numbers = np.arange(INPUT.size)[INPUT.slices[name]]
    return numbers if key is None else numbers.reshape(INPUT.shapes[name][0], -1)[key]


# What the gating network compares: key joints and phases, now and at the goal (figure 4).
GATE = np.concatenate(
    [_columns("joints", PIVOT), _columns("label"), _columns("wave"), _columns("frequency")]
    + [_columns(name, PIVOT) for name in ("goal_root", "goal_joints", "goal_label")]
    + [_columns(name) for name in GOAL_PHASE]
)
UNSEEN = np.concatenate([_columns(name) for name in GOAL_PHASE])


def layout_description() -> dict[str, dict[str, list[int]]]:
    """Names and shapes of all blocks, for the metadata of weights."""
    return {
        name: {n: list(s) for n, s in v.shapes.items()} for name, v in (("input", INPUT), ("output", OUTPUT))
    }


__all__ = [
    "AHEAD", "CHANNELS", "GATE", "INPUT", "KEY_JOINTS", "LABELS", "OUTPUT", "SOLID", "UNSEEN",
    "layout_description",
]  # fmt: skip
