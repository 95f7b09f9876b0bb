"""Batches of training: frames of the data with noise, and states of the network's own roll-outs.

One-step training never comes to rest in roll-out.  A pool of characters is therefore stepped by the network
as it trains, by the very functions the product steps with; each of its states is trained towards the true
next frame, reached by undoing the drift little by little instead of at once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from nsm_core.body.skeleton import INDEX
from nsm_core.conventions import DT, FOOT_CONTACTS, INTERACTIONS
from nsm_core.data.storage import Dataset
from nsm_core.model.features.codec import build_inputs, build_targets, read_outputs
from nsm_core.model.features.layout import FRAME, INPUT, OUTPUT
from nsm_core.model.features.rollout_step import Blending, advance
from nsm_core.model.features.state import FUTURE, KEY_STEP, State
from nsm_core.rotations import Array, rotate_planar, wrap_angle

_FEET = tuple([INDEX[f"{side}Ankle"], INDEX[f"{side}Toe"]] for side in ("Right", "Left"))


_WRISTS = [INDEX["RightWrist"], INDEX["LeftWrist"]]


@dataclass(frozen=True)
class RolloutSettings:
    """How roll-outs are run and corrected."""

    length: int = 60  # frames a roll-out lasts at most
    root_rate: float = 0.08  # share of the root's drift that the target undoes per frame
    pose_rate: float = 0.12  # the same for the pose in the root frame
    planted_rate: float = 0.02  # the same for feet that stand: they are put right in their next swing
    furthest: float = 0.6  # metres of root drift, or of mean joint error times four, that end a roll-out
    turned: float = 0.9  # radians of heading drift that end it
    teacher: float = 0.0  # share of its frames at which a roll-out is put back onto the data, by chance
    blending: Blending = Blending()  # of the bi-directional scheme, as takes of the network are stepped

    @classmethod
    def one_step(cls) -> RolloutSettings:
        """The paper's training: none of its own frames comes back to the network."""
        return cls(length=1)


def _rigid(state: State, shift: Array, turn: Array, decay: Array) -> State:
    """Move a true state by a planar drift about its own root: ``shift`` (B, 2), ``turn`` (B,); keys ahead by
    ``decay`` (6,).
    """
    root = state.root
    new_root = root.copy()
    new_root[:, :2] += shift
    new_root[:, 2] += turn

    def points(p: Array) -> Array:
        moved = p - np.pad(root[:, None, :2], ((0, 0), (0, 0), (0, 1)))
        moved = rotate_planar(moved, turn[:, None])
        moved[..., :2] += new_root[:, None, :2]
        return moved.astype(np.float32)

    future = state.root_future.copy()
    future[..., :2] += decay[None, :, None] * shift[:, None]
    future[..., 2] += decay[None] * turn[:, None]
    past = state.root_past.copy()
    past[:, -1] = new_root
    return replace(
        state,
        joint_position=points(state.joint_position),
        joint_forward=rotate_planar(state.joint_forward, turn[:, None]).astype(np.float32),
        joint_up=rotate_planar(state.joint_up, turn[:, None]).astype(np.float32),
        joint_velocity=rotate_planar(state.joint_velocity, turn[:, None]).astype(np.float32),
        root_past=past,
        root_future=future.astype(np.float32),
    )


def _local(state: State) -> Array:
    p = state.joint_position.copy()
    p[..., :2] -= state.root[:, None, :2]
    return rotate_planar(p, -state.root[:, None, 2])


class Batches:
    """Builds inputs, gating inputs and targets, physical units."""

    def __init__(
        self,
        data: Dataset,
        frames: Array,
        rng: np.random.Generator,
        pool: int,
        settings: RolloutSettings,
        share: slice = slice(None),
        own: np.random.Generator | None = None,
    ) -> None:
        """``frames`` (n,) are those to draw from; a roll-out ends where it leaves them.

        Of a training by several processes, all draw from ``rng`` alike; this one keeps its ``share`` of the
        pool, whose roll-outs start anew at frames drawn from its ``own``.
        """
        self.rng, self.settings, self._own = rng, settings, own or rng
        self._draw_from(data, frames)
        self.pool_frames = self.draw(pool)[share]
        self.pool_age = rng.integers(0, settings.length, pool)[share]
        self.pool_state = data.state(self.pool_frames)
        self.drift = np.zeros(2)

    def _draw_from(self, data: Dataset, frames: Array) -> None:
        self.data, self.frames = data, frames
        self._usable = np.zeros(len(data.arrays["end"]), bool)
        self._usable[frames] = True
        weight = np.ones(len(frames))
        # Sitting down, reaching and the like are short: draw them more often than their share of the time.
        label = data.arrays["style"][frames][:, INTERACTIONS]
        weight[((label > 0.02) & (label < 0.98)).any(axis=1)] = 3.0
        self._cumulative = np.cumsum(weight) / weight.sum()

    def replace(self, data: Dataset, frames: Array, gone: slice) -> None:
        """Go on with ``data`` whose frames ``gone`` show something else now: roll-outs in them start anew."""
        self._draw_from(data, frames)
        rows = np.flatnonzero((self.pool_frames >= gone.start) & (self.pool_frames < gone.stop))
        if len(rows):
            self._restart(rows, self.pool_state)
            self._give_goals(self.pool_state)

    def draw(self, count: int, rng: np.random.Generator | None = None) -> Array:
        """Random frames (count,), from ``rng`` where it is given."""
        at = np.searchsorted(self._cumulative, (rng or self.rng).random(count))
        return self.frames[at.clip(0, len(self.frames) - 1)]

    def after(self, frames: Array) -> tuple[Array, Array]:
        """The frames that follow ``frames`` (B,) in their takes, and which of them (B,) begin anew elsewhere,
        since none follows that may be drawn.
        """
        following = frames + 1
        anew = ~self._usable[following]
        following[anew] = self.draw(int(anew.sum()))
        return following, anew

    def from_data(self, frames: Array) -> tuple[Array, Array, Array]:
        """Inputs (B, 4018), gating (B, 650) and targets (B, 605) of true ``frames`` (B,)."""
        state = self.data.state(frames)
        x, g = build_inputs(state, self.data.surroundings(frames, state.root))
        return (
            x,
            g,
            build_targets(state, self.data.state(frames + 1), self.data.arrays["contact"][frames + 1]),
        )

    def from_pool(self) -> tuple[Array, Array, Array]:
        """The same for the pool's present states, whose targets lead back to the true takes."""
        s, state, frames = self.settings, self.pool_state, self.pool_frames
        true, following = self.data.state(frames), self.data.state(frames + 1)
        shift, turn = state.root[:, :2] - true.root[:, :2], wrap_angle(state.root[:, 2] - true.root[:, 2])
        keep = 1 - s.root_rate
        decay = keep ** (1 + KEY_STEP * np.arange(1, FUTURE + 1, dtype=np.float32)) / keep
        target = _rigid(following, keep * shift, keep * turn, decay)
        # What remains is the pose error in the root frame.
        error = _local(state) - _local(true)
        world = rotate_planar(error, state.root[:, None, 2]).astype(np.float32)
        position = self._hold_feet(target.joint_position + (1 - s.pose_rate) * world, true, following, turn)
        axes_forward = target.joint_forward + (1 - s.pose_rate) * (
            state.joint_forward - _turned(true.joint_forward, turn)
        )
        axes_up = target.joint_up + (1 - s.pose_rate) * (state.joint_up - _turned(true.joint_up, turn))
        velocity = (position - state.joint_position) / DT
        target = replace(
            target,
            joint_position=position,
            joint_velocity=velocity,
            joint_forward=_unit(axes_forward),
            joint_up=_unit(axes_up),
        )
        # Phase drifts too; the targets' updates are those of the data plus a pull towards its phase.
        x, g = build_inputs(state, self.data.surroundings(frames, state.root, (shift, turn)))
        y = build_targets(state, target, self.data.arrays["contact"][frames + 1])
        slip = (true.phase_past[:, -1] - state.phase_past[:, -1] + 0.5) % 1.0 - 0.5
        steps = build_phase_updates(true, following)
        y[:, OUTPUT.slices["phase_update"]] = steps + s.pose_rate * slip[:, None]
        self._error = np.linalg.norm(error, axis=-1).mean(axis=1)
        self._shift, self._turn = np.linalg.norm(shift, axis=1), np.abs(turn)
        return x, g, y

    def _hold_feet(self, position: Array, true: State, following: State, turn: Array) -> Array:
        """Let feet that stand in the take stand where the roll-out has put them; changes and returns
        ``position`` (B, J, 3).
        """
        contact = self.data.arrays["contact"]
        stands = (contact[self.pool_frames][:, FOOT_CONTACTS] > 0.5) & (
            contact[self.pool_frames + 1][:, FOOT_CONTACTS] > 0.5
        )
        moved = _turned(following.joint_position - true.joint_position, turn)
        for side, joints in enumerate(_FEET):
            kept = self.pool_state.joint_position[:, joints] + moved[:, joints]
            rate = np.where(stands[:, side], self.settings.planted_rate, 1.0)[:, None, None]
            position[:, joints] = kept + rate * (position[:, joints] - kept)
        return position

    def step_pool(self, outputs: Array) -> None:
        """Advance the pool by the network's outputs (B, 605), physical units; worn-out roll-outs
        start anew.
        """
        s = self.settings
        state = advance(self.pool_state, read_outputs(outputs, self.pool_state), s.blending)
        self.pool_frames = self.pool_frames + 1
        self.pool_age += 1
        self.drift = 0.98 * self.drift + 0.02 * np.array((self._shift.mean(), self._error.mean()))
        over = (self.pool_age >= s.length) | ~self._usable[self.pool_frames]
        over |= (self._shift > s.furthest) | (self._turn > s.turned) | (4 * self._error > s.furthest)
        over |= ~np.isfinite(state.joint_position).all(axis=(1, 2))
        rows = np.flatnonzero(over)
        if len(rows):
            self._restart(rows, state)
        if s.teacher > 0:  # what it remembers goes on
            told = np.flatnonzero(~over & (self._own.random(len(over)) < s.teacher))
            if len(told):
                state.assign(told, self.data.state(self.pool_frames[told]))
        self._give_goals(state)
        self.pool_state = state

    def _restart(self, rows: Array, state: State) -> None:
        self.pool_frames[rows] = self.draw(len(rows), self._own)
        self.pool_age[rows] = 0
        state.assign(rows, self.data.state(self.pool_frames[rows]))

    def _give_goals(self, state: State) -> None:
        a = self.data.arrays
        state.goal_position = a["goal_position"][self.pool_frames]
        state.goal_heading = a["goal_heading"][self.pool_frames]
        state.goal_action = a["goal_action"][self.pool_frames]


def _turned(v: Array, turn: Array) -> Array:
    return rotate_planar(v, turn[:, None]).astype(np.float32)


def _unit(v: Array) -> Array:
    return (v / np.maximum(np.linalg.norm(v, axis=-1, keepdims=True), 1e-6)).astype(np.float32)


def build_phase_updates(state: State, following: State) -> Array:
    """Cumulative phase updates (B, 7) from ``state`` to the keys of ``following``."""
    phases = np.concatenate(
        (state.phase_past[:, -1:], following.phase_past[:, -1:], following.phase_future), axis=1
    )
    steps = np.diff(phases, axis=1)
    return np.cumsum(steps - np.round(steps), axis=1)


def loss_weights(feet: float = 3.0, hands: float = 4.0) -> Array:
    """Weights (605,) of the outputs, mean 1: places and speeds of ankles and toes count ``feet`` times, of
    wrists ``hands`` times.
    """
    weights = np.ones(OUTPUT.size, np.float32)
    for name in ("joint_position", "joint_velocity"):
        block = OUTPUT.get(weights[None], name)[0]
        for joints in _FEET:
            block[joints] = feet
        block[_WRISTS] = hands
    return weights / weights.mean()


def statistics(batches: Batches, count: int = 20000) -> dict[str, Array]:
    """Means and deviations of inputs, gating and outputs over random frames; sensor blocks share one
    deviation.

    A sensor cell that was hardly ever hit would otherwise be blown up in a scene where it is.
    """
    parts = [batches.from_data(batches.draw(1000)) for _ in range(count // 1000)]
    x, g, y = (np.concatenate([p[k] for p in parts]) for k in range(3))
    result = {}
    for name, values in (("input", x), ("gating", g), ("output", y)):
        result[f"{name}_mean"], result[f"{name}_std"] = values.mean(axis=0), values.std(axis=0)
    std = result["input_std"]
    environment, interaction = INPUT.slices["environment"], INPUT.slices["interaction"]
    std[environment] = np.sqrt((std[environment] ** 2).mean())
    half = interaction.start + 3 * (interaction.stop - interaction.start) // 4
    for block in (slice(interaction.start, half), slice(half, interaction.stop)):
        std[block] = np.sqrt((std[block] ** 2).mean())
    for layout, offset, names in ((FRAME, 0, ("joint_forward", "joint_up", "trajectory_style")),):
        for n in names:
            block = slice(offset + layout.slices[n].start, offset + layout.slices[n].stop)
            std[block] = np.maximum(std[block], 0.05)
    goal = INPUT.slices["goal"]
    std[goal] = np.maximum(std[goal], 0.1)
    std[: FRAME.size] = np.maximum(std[: FRAME.size], 0.01)
    result["gating_std"] = np.maximum(result["gating_std"], 0.1)
    out = result["output_std"]
    for n in ("joint_forward", "joint_up", "trajectory_style", "goal_action", "contact"):
        out[OUTPUT.slices[n]] = np.maximum(out[OUTPUT.slices[n]], 0.05)
    result["output_std"] = np.maximum(out, 0.005)
    return result
