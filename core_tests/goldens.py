"""Golden takes and golden composed data: what is made today, in digests that tell which joint and which frame
came to differ.

A digest keeps every ``EVERY``-th frame of a take: of the keyed pose and of the network's own pose each
joint's place and where it faces, over 10 cm, so that a twist shows too, the roots, labels, contacts, phase,
props and what became of the goals; of composed data the arrays that are written for training and the
network's own features and targets by name. Everything is made by code with fixed seeds: the scenes below, the
shipped weights and the captures of ``captures``.

The tolerance is 4 mm, of other values 0.004, and no frame more or less.  What floats make of it was measured:
starts moved by 1e-6 m and rad, OpenBLAS kernels for AVX2 and for processors without
(``OPENBLAS_CORETYPE=Haswell`` and ``Nehalem``, numpy's own AVX2 and FMA switched off), a processor with
AVX-512, and numpy 2.5.5 instead of 1.26.4 move no joint and no prop by more than 0.02 mm, no label or phase
by more than 0.0001, no feature by more than 0.0002 and no goal by a frame: noise does not grow in these
takes, since contacts and goals hold them, so their length is bounded by the time they cost alone.  Much
longer or freer takes may do otherwise.  Composing chooses among captured frames, and where two are nearly as
good noise may choose the other: the seeds are such that captures off by 2e-6 m choose the same (joints then
move by 0.02 mm, on seats by 0.8 mm; kernels alone by a hundredth of that).

They stay as they are through every change that is to change no motion.  After one that is meant to change it,
look at the motion (``evaluate``, contact sheets), then write them anew and say in the commit what changed and
why:

    python core_tests/goldens.py            # compares all, as the tests do
    python core_tests/goldens.py --write    # writes all anew and tells how far each moved; names may follow:
    --write sit open

Never write them to make a test pass that nobody expected to fail.
"""

from __future__ import annotations

import json
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
for folder in (HERE, HERE.parent):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import captures

from nsm_core.body.skeleton import JOINTS, forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeRunner
from nsm_core.conventions import CONTACTS, STYLES
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.evaluation.trials import carry, climb, sit
from nsm_core.evaluation.trials import open as doors
from nsm_core.model.features.codec import build_inputs, build_targets
from nsm_core.model.features.layout import FRAME, GOAL, INPUT, OUTPUT
from nsm_core.model.inference.model import load_model
from nsm_core.rotations import quat_rotate
from nsm_core.world.scene import furniture
from nsm_core.world.scene.door import make_door

FOLDER = HERE / "golden"
Digest = dict[str, np.ndarray]

EVERY = {"take": 12, "data": 30}  # frames between those that are kept
FEATURE_FRAMES = 3  # frames of composed data whose features are kept
POOLED = 64  # neighbours in the sensors' readings that are kept as their mean
UNIT = 1e-3  # what is stored counts in these: millimetres, or thousandths
AHEAD = np.array((0.0, -0.1, 0.0))  # of a joint, in its own frame: a tenth of a radian is a centimetre
POINTS = ("joints", "facing", "network_joints", "network_facing")  # places; compared by their distance

TOLERANCE = 0.004  # by which a value may be off: metres, or parts of one, with the rounding to UNIT in it

# --- scenes of the takes ---


def _free(action: str, *goal: float, still: tuple = (), hold: float = 0.3) -> TakeRequest:
    facing = float(np.arctan2(goal[0], -goal[1])) if any(goal) else 0.0
    there = Goal(action, "place", np.append(goal, 0.0), facing, hold)
    return TakeRequest(np.zeros(2), 0.4, [there], furniture.cuboids(still))


def _walk() -> TakeRequest:
    """Around a cabinet that stands in the way."""
    cabinet = furniture.make("cabinet", np.random.default_rng(1))
    return _free("walk", 0.3, -2.6, still=((cabinet, np.array((0.1, -1.3)), 0.3),))


def _sit() -> TakeRequest:
    chair = furniture.make("chair", np.random.default_rng(7))
    return sit.request(sit.SitTrial(0, chair, np.array((0.5, -1.0)), 0.3), hold=0.3)


def _carry() -> TakeRequest:
    """From the floor onto a low table."""
    rng = np.random.default_rng(3)
    crate = furniture.make("crate", rng, width=0.3, depth=0.28, height=0.26)
    facing = 0.5
    top, still = carry.support(rng, (0.5, 0.5), crate, np.array((1.3, 0.9)), facing, None)
    box, goal = np.array((0, 0, 0.13, 0.2)), np.array((1.3, 0.9, top + 0.13, facing))
    return carry.request(
        carry.CarryTrial(0, "", np.array((0.1, 0.9)), 0.2, crate, box, goal, facing, tuple(still)), hold=0.3
    )


def _open(push: bool) -> TakeRequest:
    door = make_door(np.random.default_rng(5), width=0.85, near=2.0, far=2.0)
    return doors.request(
        doors.DoorTrial(0, "", np.array((0.5, -1.0)), 2.8, door, np.zeros(4), 1.0 if push else -1.0), hold=0.2
    )


def _climb() -> TakeRequest:
    step = furniture.make("step", np.random.default_rng(2), width=1.2, depth=0.7, height=0.3)
    return climb.request(climb.ClimbTrial(0, "", np.array((0.2, -1.2)), 2.9, step, 0.2), hold=0.3)


SCENES: dict[str, Callable[[], TakeRequest]] = {
    "idle": lambda: _free("idle", 0.0, 0.0, hold=1.5),
    "walk": _walk,
    "run": lambda: _free("run", 2.0, -4.0),
    "sit": _sit,
    "carry": _carry,
    "push": lambda: _open(True),
    "pull": lambda: _open(False),
    "climb": _climb,
}
LONGEST = 400  # frames

# --- composed data: the share that is drawn, and a seed whose take is short and noise does not change ---

COMPOSED: dict[str, int] = {"walk": 11, "run": 2, "sit": 11, "carry": 2, "open": 12, "climb": 3}

# --- digests ---


def _turned(angles: np.ndarray) -> np.ndarray:
    """Angles (...,) as sine and cosine (..., 2), so that no comparison meets a full turn."""
    return np.stack((np.sin(angles), np.cos(angles)), axis=-1)


def _posed(prefix: str, hips: np.ndarray, rotations: np.ndarray) -> Digest:
    joints, world = forward_kinematics(hips.astype(np.float64), rotations.astype(np.float64))
    return {
        f"{prefix}joints": joints,
        f"{prefix}facing": quat_rotate(world, np.broadcast_to(AHEAD, joints.shape)),
    }


@cache
def _model() -> object:
    return load_model(backend="numpy")


def take(name: str, change: Callable[[TakeRequest, object], None] | None = None) -> Digest:
    """Roll the take ``name`` out and digest it; ``change`` may alter the request before it starts and see the
    model.
    """
    asked = SCENES[name]()
    if change is not None:
        change(asked, _model())
    runner = TakeRunner(_model(), asked)
    phase = [runner.state.phase_past[0, -1]]
    while runner.frames < LONGEST and runner.step():
        if len(phase) < runner.frames:
            phase.append(runner.state.phase_past[0, -1])
    made = runner.result()
    kept = slice(0, None, EVERY["take"])
    digest = _posed("", made.hips_position[kept], made.local_rotations[kept])
    digest |= _posed("network_", made.network_hips[kept], made.network_rotations[kept])
    digest |= {
        "root": np.concatenate((made.root[kept, :2], _turned(made.root[kept, 2])), axis=-1),
        "labels": made.action[kept],
        "contacts": made.contacts[kept],
        "phase": _turned(2 * np.pi * np.array(phase)[kept]),
    }
    for prop, poses in made.props.items():
        digest[f"prop_{prop}"] = np.concatenate((poses[kept, :3], _turned(poses[kept, 3])), axis=-1)
    return digest | {
        "frames": np.array((len(made.root),)),
        "goals": np.array([(g.reached, g.start_frame, g.end_frame) for g in made.goals], dtype=np.float64),
    }


@cache
def source() -> object:
    """What composing reads: the computed captures with a pick-up and runs beside them."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = captures.write_captures(Path(scratch))
        captures.write_pick_up(folder)
        for n, (distance, turn) in enumerate(((4.5, 0), (5.0, 0.5), (4.0, 1.0))):
            motion = captures.walk(distance, turn, 2.1)
            captures.write_clip(folder / "thursday" / f"run_{n}.bvh", motion, captures.used(motion, "run"))
        return load(str(folder))


def composed(name: str, source: object = None) -> Digest:
    """Compose the take of an action's seed and digest it as training data."""
    made = Composer(globals()["source"]() if source is None else source, {name: 1.0}).compose(COMPOSED[name])
    if made is None:
        raise ValueError(
            f"Seed {COMPOSED[name]} composes no take of {name} any more; put another into COMPOSED."
        )
    data = captures.data_of(made)
    arrays, kept = data.arrays, slice(0, None, EVERY["data"])
    digest = _posed("", made.hips[kept], made.rotations[kept])
    digest |= {
        "root": np.concatenate((arrays["root"][kept, :2], _turned(arrays["root"][kept, 2])), axis=-1),
        "labels": arrays["style"][kept],
        "contacts": arrays["contact"][kept],
        "phase": arrays["phase"][kept, None],
        "goal_position": arrays["goal_position"][kept, 6],
        "goal_heading": _turned(arrays["goal_heading"][kept, 6]),
        "goal_action": arrays["goal_action"][kept, 6],
        "thing": arrays["object"][kept, None],
        "thing_pose": np.concatenate(
            (arrays["object_pose"][kept, :3], _turned(arrays["object_pose"][kept, 3])), axis=-1
        ),
        "held": arrays["held"][kept, None],
    }
    obstacles = [(*o.position[:2], o.heading, *o.furniture.size) for o in made.obstacles]
    return (
        digest
        | {f"feature_{k}": v for k, v in _features(data).items()}
        | {
            "frames": np.array((len(made),)),
            "commands": np.array([(c.frame, c.thing) for c in made.commands], dtype=np.float64),
            "pieces": np.array([(p.first, p.last, p.frames) for p in made.provenance], dtype=np.float64),
            "obstacles": np.array(obstacles, dtype=np.float64).reshape(-1, 6),
        }
    )


def _features(data: object) -> Digest:
    """Input and target of the network by their names at a few frames spread over a take; sensors as means of
    neighbours.
    """
    frames = np.linspace(0, len(data.frames) - 2, FEATURE_FRAMES).astype(int)
    state, following = data.state(frames), data.state(frames + 1)
    x, gating = build_inputs(state, data.surroundings(frames, state.root))
    y = build_targets(state, following, data.arrays["contact"][frames + 1])
    found = {f"frame.{n}": FRAME.get(INPUT.get(x, "frame"), n) for n in FRAME.shapes}
    found |= {f"goal.{n}": GOAL.get(INPUT.get(x, "goal"), n) for n in GOAL.shapes}
    found |= {f"target.{n}": OUTPUT.get(y, n) for n in OUTPUT.shapes}
    found = {n: v.reshape(len(frames), -1) for n, v in found.items()}
    for name, values in (
        ("environment", INPUT.get(x, "environment")),
        ("interaction", INPUT.get(x, "interaction")),
        ("gating", gating),
    ):
        spans = np.arange(0, values.shape[1], POOLED)
        found[name] = np.add.reduceat(values, spans, axis=1) / np.diff(np.append(spans, values.shape[1]))
    return found


ROWS = {
    "goals": ("reached", "start_frame", "end_frame"),
    "commands": ("frame", "thing"),
    "pieces": ("first", "last", "frames"),
    "obstacles": ("x", "y", "heading", "width", "depth", "height"),
}

# --- stored, compared and written ---


def path_of(kind: str, name: str) -> Path:
    """File of a golden take (``kind`` "take") or of golden data ("data")."""
    return FOLDER / f"{kind}_{name}.npz"


def write(kind: str, name: str, digest: Digest) -> None:
    """Store a digest as whole numbers of ``UNIT``, all in one array, since every array of a file costs its
    head.
    """
    layout = json.dumps({k: np.shape(v) for k, v in digest.items()})
    values = np.concatenate(
        [np.round(np.ravel(v).astype(np.float64) / UNIT) for v in digest.values()]
    ).astype(np.int32)
    # Bytes of the same weight together are packed better.
    np.savez_compressed(
        path_of(kind, name), layout=np.array(layout), values=values.view(np.uint8).reshape(-1, 4).T
    )


def read(kind: str, name: str) -> Digest:
    """The golden digest, in metres and the like again."""
    with np.load(path_of(kind, name)) as file:
        layout, values = (
            json.loads(str(file["layout"])),
            np.ascontiguousarray(file["values"].T).view(np.int32).ravel() * UNIT,
        )
    ends = np.cumsum([int(np.prod(shape)) for shape in layout.values()])
    return {
        k: part.reshape(shape)
        for (k, shape), part in zip(layout.items(), np.split(values, ends[:-1]), strict=True)
    }


def apart(golden: Digest, now: Digest) -> dict[str, np.ndarray]:
    """How far two digests are apart by name: of places their distance in metres, of other values the
    difference.
    """
    off = {}
    for name in golden.keys() & now.keys():
        a, b = np.asarray(golden[name], dtype=np.float64), np.asarray(now[name], dtype=np.float64)
        if a.shape[1:] == b.shape[1:]:
            n = min(len(a), len(b))
            off[name] = np.linalg.norm(a[:n] - b[:n], axis=-1) if name in POINTS else np.abs(a[:n] - b[:n])
    return off


def differences(kind: str, golden: Digest, now: Digest) -> list[str]:
    """What came to differ by more than is allowed: a sentence for each name, with the first and the largest
    deviation.
    """
    found = [f"{name} is new; write the goldens anew." for name in sorted(now.keys() - golden.keys())]
    found += [f"{name} is not made any more." for name in sorted(golden.keys() - now.keys())]
    off = apart(golden, now)
    for name in golden:
        if name not in now:
            continue
        a, b = golden[name], now[name]
        if a.shape != b.shape:
            found.append(f"{name} was {a.shape} and is {b.shape} large.")
            if name not in off:
                continue
        wrong = np.argwhere(~(off[name] <= TOLERANCE))
        if len(wrong):
            most = np.array(np.unravel_index(np.nan_to_num(off[name], nan=np.inf).argmax(), off[name].shape))
            first, most = (
                f"{_where(kind, name, at)} by {off[name][tuple(at)]:.4f}" for at in (wrong[0], most)
            )
            found.append(
                f"{name} is off in {len(wrong)} of {off[name].size} values, first {first}, most {most} "
                f"(allowed: {TOLERANCE:g})."
            )
    return found


def _where(kind: str, name: str, at: np.ndarray) -> str:
    """Say in words which value of a digest an index is: the frame, and the joint or column."""
    row, *rest = (int(i) for i in at)
    if name in ROWS:
        return f"in row {row}, {ROWS[name][rest[0]]}"
    if name == "frames":
        return "in all"
    if name.startswith("feature_"):
        return f"in sampled state {row}, value {rest[0]}"
    if name in POINTS:
        column = JOINTS[rest[0]]
    elif name == "labels":
        column = STYLES[rest[0]]
    elif name == "contacts":
        column = CONTACTS[rest[0]]
    else:
        column = f"value {rest[0]}" if rest else "all"
    return f"in frame {EVERY[kind] * row} {column}"


def made(kind: str, name: str) -> Digest:
    """The digest of what is made now."""
    return take(name) if kind == "take" else composed(name)


ALL = [*(("take", name) for name in SCENES), *(("data", name) for name in COMPOSED)]


def main(arguments: list[str]) -> int:
    """Compare or write the goldens that are named, all without a name; returns the exit code."""
    names = [a for a in arguments if not a.startswith("-")]
    FOLDER.mkdir(exist_ok=True)
    failed = False
    for kind, name in ALL:
        if names and name not in names:
            continue
        now, path = made(kind, name), path_of(kind, name)
        problems = differences(kind, read(kind, name), now) if path.exists() else ["It is not there."]
        print(f"{kind} {name}, {int(now['frames'][0])} frames{'' if problems else ': as it was'}", flush=True)
        for problem in problems:
            print(f"    {problem}")
        failed |= bool(problems)
        if "--write" in arguments:
            write(kind, name, now)
    return int(failed and "--write" not in arguments)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
