"""A small capture folder by computation: quiet stands, walks that start, turn and stop, and sits; and what is
composed of it.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import captures
import numpy as np

from nsm_core.body.ik.two_bone import place_limbs
from nsm_core.body.skeleton import FEET, INDEX, OFFSETS, TOE_HEIGHT, J
from nsm_core.data.captures import bvh_writer, sidecar
from nsm_core.data.export import export, take_arrays
from nsm_core.data.matching.source import Source
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.data.scenarios.take import ComposedTake
from nsm_core.data.storage import Dataset
from nsm_core.model.features.state import WINDOW
from nsm_core.rotations import heading_quat, heading_to_direction, quat_from_rotvec, quat_mul, quat_rotate

STANCE, CYCLE = 0.6, 32  # share of a cycle that a foot stands, frames of a cycle
LEGS = (FEET[0][:3], FEET[1][:3])
TOE = OFFSETS[FEET[0][3]].astype(float)
HEIGHT = 0.89  # of the hips when standing, metres


def _ease(x: np.ndarray) -> np.ndarray:
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x * x)


def _body(headings: np.ndarray) -> np.ndarray:
    """Upright local rotations (T, 23, 4) with the arms hanging."""
    local = np.zeros((len(headings), J, 4))
    local[..., 0] = 1
    local[:, 0] = heading_quat(headings)
    for side, sign in (("Right", -1.0), ("Left", 1.0)):
        local[:, INDEX[f"{side}Shoulder"]] = quat_from_rotvec(np.array((0, sign * 1.35, 0)))
        local[:, INDEX[f"{side}Elbow"]] = quat_from_rotvec(np.array((-0.2, 0, 0)))
    return local


def _legs(
    hips: np.ndarray, local: np.ndarray, toes: np.ndarray, pitch: np.ndarray, headings: np.ndarray
) -> np.ndarray:
    feet = quat_mul(heading_quat(headings), quat_from_rotvec(pitch[..., None] * np.array((1.0, 0, 0))))
    return place_limbs(hips, local, LEGS, toes - quat_rotate(feet, np.broadcast_to(TOE, toes.shape)), feet)


def _home(root: np.ndarray, heading: np.ndarray) -> np.ndarray:
    """Where the toe joints (T, 2, 2) stand, right and left, under a body at rest."""
    ahead = heading_to_direction(heading)
    left = np.stack((-ahead[:, 1], ahead[:, 0]), axis=-1)
    return np.stack([root + 0.1 * ahead + sign * 0.09 * left for sign in (-1, 1)], axis=1)


def walk(
    distance: float, turn: float, seconds: float, rest: float = 1.2, travel: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Stand, walk ``distance`` metres while turning by ``turn`` radians, and stand: hips (T, 3), local
    rotations (T, 23, 4).

    ``travel`` is the angle between the way that is walked and the way that is faced.
    """
    cycles = max(1, round(seconds * 30 / CYCLE))
    moving, still = cycles * CYCLE, round(rest * 30)
    t = np.arange(2 * still + moving + CYCLE)
    pace = np.clip(np.minimum(t - still, still + moving - t) / 20, 0, None).clip(0, 1)
    share = np.cumsum(pace) / pace.sum()
    heading = turn * share
    steps = np.gradient(distance * share)[:, None] * heading_to_direction(heading + travel)
    root = np.cumsum(steps, axis=0)
    phase = 0.05 + np.clip((t - still) / CYCLE, 0, cycles + 1)  # one more cycle brings the feet together
    toes, pitch, facing = np.zeros((len(t), 2, 3)), np.zeros((len(t), 2)), np.zeros((len(t), 2))

    def at(when: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Home of the feet and heading at fractional frames."""
        h = np.interp(when, t, heading)
        return _home(np.stack([np.interp(when, t, root[:, k]) for k in (0, 1)], axis=-1), h), h

    for side in (0, 1):
        cycle, p = np.divmod(phase + 0.5 * side, 1.0)
        swing = np.clip((p - STANCE) / (1 - STANCE), 0, 1)
        middle = still + (cycle - 0.5 * side - 0.05 + STANCE / 2) * CYCLE
        (before, turned), (after, turning) = at(middle), at(middle + CYCLE)
        w = (swing * swing * (3 - 2 * swing))[:, None]
        toes[:, side, :2] = before[:, side] * (1 - w) + after[:, side] * w
        toes[:, side, 2] = TOE_HEIGHT + 0.06 * np.sin(np.pi * swing) ** 2
        pitch[:, side] = 0.3 * np.sin(np.pi * swing)
        facing[:, side] = turned * (1 - w[:, 0]) + turning * w[:, 0]
    hips = np.concatenate((root, np.full((len(t), 1), HEIGHT)), axis=1)
    return hips, _legs(hips, _body(heading), toes, pitch, facing)


def stand(frames: int = 150) -> tuple[np.ndarray, np.ndarray]:
    """A quiet stand that sways by a few millimetres."""
    t = np.arange(frames)
    hips = np.stack((0.004 * np.sin(t / 17), 0.003 * np.sin(t / 23), HEIGHT + 0.002 * np.sin(t / 11)), axis=1)
    toes = np.concatenate(
        (_home(np.zeros((1, 2)), np.zeros(1)), np.full((1, 2, 1), TOE_HEIGHT)), axis=2
    ).repeat(frames, 0)
    return hips, _legs(hips, _body(np.zeros(frames)), toes, np.zeros((frames, 2)), np.zeros((frames, 2)))


def sit(height: float = 0.52, back: float = 0.42) -> tuple[np.ndarray, np.ndarray]:
    """Stand, sit down on nothing, stay, rise and stand; the feet stay."""
    t = np.arange(30 + 42 + 60 + 42 + 30)
    w = _ease((t - 30) / 42) - _ease((t - 132) / 42)
    hips = np.stack((np.zeros(len(t)), back * w, HEIGHT + (height - HEIGHT) * w), axis=1)
    local = _body(np.zeros(len(t)))
    lean = 0.6 * np.sin(np.pi * w) ** 2
    local[:, INDEX["Chest"]] = quat_from_rotvec(lean[:, None] * np.array((1.0, 0, 0)))
    toes = np.concatenate(
        (_home(np.zeros((1, 2)), np.zeros(1)), np.full((1, 2, 1), TOE_HEIGHT)), axis=2
    ).repeat(len(t), 0)
    return hips, _legs(hips, local, toes, np.zeros((len(t), 2)), np.zeros((len(t), 2)))


SITS = "[actions.sit]\n39 = 0\n63 = 1\n142 = 1\n165 = 0\n"  # what sidecars of ``sit`` say, and of ``pick_up``
TAKES = "".join(
    f"[{of}]\n77 = 0\n78 = 1\n"
    for of in ("actions.carry", *map("contacts.{}Wrist".format, ("Right", "Left")))
)


def used(motion: tuple[np.ndarray, np.ndarray], *gaits: str) -> str:
    """What a sidecar says of a motion that is used for ``gaits`` as a whole."""
    return "[use]\n" + "".join(f"{gait} = [[0, {len(motion[0]) - 1}]]\n" for gait in gaits)


def write_clip(path: Path, motion: tuple[np.ndarray, np.ndarray], says: str = "") -> None:
    """Write a capture, and a sidecar beside it if it is to say something."""
    path.parent.mkdir(parents=True, exist_ok=True)
    bvh_writer.write_bvh(path, *motion)
    if says:
        head = f'clip = "{path.stem}"\nframes = {len(motion[0])}\n'
        sidecar.sidecar_of(path).write_text(head + says, encoding="utf-8")


def write_pick_up(folder: Path) -> None:
    """Write a bend to a box beside the captures of ``write_captures``."""
    write_clip(folder / "monday" / "pick_up.bvh", pick_up(), TAKES)


def write_captures(folder: Path) -> Path:
    """Write the capture folder, with sidecars that say what its clips are used for; one is used for
    nothing.
    """
    write_clip(folder / "monday" / "stand.bvh", stand(), used(stand(), "walk") + "stand = 90\n")
    for n, (distance, turn, seconds) in enumerate(
        (
            (3.0, 0, 3.2),
            (4.2, 0.5, 4.3),
            (2.4, 1.2, 3.2),
            (1.8, 2.2, 3.2),
            (1.2, 0, 2),
            (0.7, 1.6, 2),
            (0, 1.2, 1.2),
            (0, 2.6, 2.2),
            (0.4, 0, 1.1),
        )
    ):
        _write_walk(folder, f"walk_{n:02d}", walk(distance, turn, seconds))
    _write_walk(folder, "walk_20", walk(0.5, 0.3, 1.2, travel=np.pi / 2))
    _write_walk(folder, "walk_21", walk(0.5, 0, 1.2, travel=np.pi))
    write_clip(folder / "thursday" / "hop_in_place.bvh", walk(0.5, 0, 1))
    write_clip(folder / "wednesday" / "sit_0.bvh", sit(), SITS)
    write_clip(folder / "wednesday" / "sit_1.bvh", sit(0.5, 0.4), SITS)
    return folder


def _write_walk(folder: Path, name: str, motion: tuple[np.ndarray, np.ndarray]) -> None:
    """Write a walk that is walked with, and run with too, so that runs are searched for as well."""
    write_clip(folder / "tuesday" / f"{name}.bvh", motion, used(motion, "walk", "run"))


def write_shipped(folder: Path, *names: str) -> list[Path]:
    """Write captures that go by names of those whose labels the program brings, made to show what these say.

    They lie without sidecars in folders of their sources, "cmu/cmu_07_01.bvh" for "cmu/cmu_07_01"; the paths.
    """
    paths = [folder / f"{name}.bvh" for name in names]
    for n, path in enumerate(paths):
        sheet = sidecar.read_sheet(sidecar.shipped(path))
        frames = np.arange(sheet.frames)
        if sheet.actions["sit"]:  # the way down and up of ``sit``, as often as the label asks for it
            value = np.interp(frames, *zip(*sheet.actions["sit"], strict=True))
            at, motion = np.where(np.gradient(value) < 0, 174 - 42 * value, 30 + 42 * value), sit()
        elif sheet.actions["carry"]:
            low = next(f for f, v in sheet.actions["carry"] if v)
            at, motion = frames - low + 78, pick_up()
        else:
            at, motion = frames, stand() if sheet.use.stand else walk(1.5 + 0.3 * n, 0.4 * n - 1, 2.1)
        write_clip(path, tuple(part[np.clip(np.round(at).astype(int), 0, len(part) - 1)] for part in motion))
    return paths


_made: dict[str, Path] = {}


def capture_folder(tmp_path_factory) -> Path:
    """The capture folder, written once per run of the tests."""
    if "captures" not in _made:
        _made["captures"] = write_captures(tmp_path_factory.mktemp("captures"))
    return _made["captures"]


def data_folder(tmp_path_factory) -> Path:
    """A minute and a half of training data composed from it, exported once per run of the tests."""
    if "data" not in _made:
        _made["data"] = export(
            str(capture_folder(tmp_path_factory)),
            tmp_path_factory.mktemp("data") / "set",
            1.5,
            seed=3,
            workers=1,
        )
    return _made["data"]


@cache
def source(folder: Path) -> Source:
    """The library read from the capture folder."""
    return load(str(folder))


@cache
def seeded(folder: Path) -> dict[int, ComposedTake]:
    """The first takes that the seeds from 0 compose, by seed: some with seats, some led along, some among
    furniture.
    """
    composer, found = Composer(source(folder), {"sit": 0.68, "walk": 0.27, "run": 0.05}), {}
    for seed in range(60):
        take = composer.compose(seed)
        if take is not None:
            found[seed] = take
        seats, pieces = (
            sum(len(getattr(t, kind)) for t in found.values()) for kind in ("things", "obstacles")
        )
        led = any(c.position is None for t in found.values() for c in t.commands)
        if len(found) > 2 and seats > 1 and pieces > 3 and led:
            return found
    raise AssertionError(f"60 seeds composed {len(found)} takes, and not enough to look at")


@cache
def exported(folder: Path, seed: int) -> ComposedTake:
    """The take that ``export`` composes of a seed."""
    take = Composer(source(folder)).compose(seed)
    assert take is not None
    return take


def takes(folder: Path) -> tuple[ComposedTake, ...]:
    """The takes of ``seeded``."""
    return tuple(seeded(folder).values())


@cache
def dataset(folder: Path) -> Dataset:
    """The exported data in memory."""
    return Dataset.open(folder)


def data_of(take: ComposedTake) -> Dataset:
    """One take as a data set of its own, as ``Dataset.open`` would give it."""
    arrays = take_arrays(take)
    return Dataset(arrays, np.arange(len(take) - WINDOW - 1))


def pick_up() -> tuple[np.ndarray, np.ndarray]:
    """Stand, squat with the trunk leant forward, and rise: hips (T, 3), local rotations (T, 23, 4)."""
    hips, local = captures.sit(0.5, 0.12)
    w = np.clip((captures.HEIGHT - hips[:, 2]) / (captures.HEIGHT - 0.5), 0, 1)
    local[:, INDEX["Chest"]] = quat_from_rotvec(1.1 * w[:, None] * np.array((1.0, 0, 0)))
    return hips, local
