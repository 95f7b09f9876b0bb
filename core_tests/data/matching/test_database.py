"""What the composer takes from capture folders: what sidecars say, by labels or outright, nothing else."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import captures
import numpy as np
import pytest

from nsm_core.__main__ import main
from nsm_core.body.clip import Clip
from nsm_core.body.ik.two_bone import place_limbs, place_wrists
from nsm_core.body.skeleton import FEET, INDEX, forward_kinematics
from nsm_core.data.captures import bvh_writer, reader, sidecar, sidecar_writer
from nsm_core.data.captures.folder import CaptureFolder, Labelled
from nsm_core.data.captures.sheet import Use
from nsm_core.data.matching.labelled import grasps, sit_downs, walks_and_runs
from nsm_core.data.matching.selection import load_runs, load_sits, load_walks, neutral, stance
from nsm_core.data.scenarios.carry import episode as carry_episode
from nsm_core.data.scenarios.composer import Composer, load
from nsm_core.errors import CaptureError
from nsm_core.rotations import quat_from_rotvec


def lift() -> tuple[np.ndarray, np.ndarray]:
    """A walk, a bend with both hands to the floor, and a walk with what they hold before the chest."""
    there, held = captures.walk(1.5, 0.0, 2.2), captures.walk(1.5, 0.0, 2.2)
    hips, local = there[0][-1:].repeat(80, 0), there[1][-1:].repeat(80, 0)
    t = np.arange(80)
    w = captures._ease(t / 38) - captures._ease((t - 42) / 38)
    feet, turned = forward_kinematics(hips, local)
    hips[:, 2] -= 0.3 * w
    hips[:, 1] += 0.15 * w
    local[:, INDEX["Chest"]] = quat_from_rotvec(0.9 * w[:, None] * np.array((1.0, 0, 0)))
    ankles = [leg[2] for leg in FEET]
    local = place_limbs(hips, local, captures.LEGS, feet[:, ankles], turned[:, ankles])
    held[0][:, :2] += hips[-1, :2]
    carried = len(there[0]) + 40
    hips, local = (np.concatenate((there[k], (hips, local)[k], held[k])) for k in (0, 1))
    root = hips[:, :2].copy()
    root[len(there[0]) : len(there[0]) + 80] = there[0][-1, :2]
    share = np.clip((np.arange(len(hips)) - carried) / 38, 0, 1)
    for side, sign in ((0, -1.0), (1, 1.0)):
        low, high = np.array((sign * 0.17, -0.42, 0.45)), np.array((sign * 0.17, -0.35, 1.05))
        target = low + captures._ease(share)[:, None] * (high - low)
        target[:, :2] += root
        wrist = forward_kinematics(hips, local)[0][:, INDEX["RightWrist" if side == 0 else "LeftWrist"]]
        reach = captures._ease((np.arange(len(hips)) - carried + 38) / 36)[:, None]
        local = place_wrists(hips, local, side, wrist + reach * (target - wrist))
    return hips, local


def write(path: Path, motion: tuple[np.ndarray, np.ndarray]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    bvh_writer.write_bvh(path, *motion)


def rename(path: Path) -> None:
    """Give the joints of a file other names."""
    words = {"Hips": "hoofte", "Shoulder": "schulta", "Knee": "gnie"}
    text = path.read_text()
    for old, new in words.items():
        text = text.replace(old, new)
    path.write_text(text)


@pytest.fixture(scope="module")
def studio(tmp_path_factory) -> Path:
    """Captures in folders and under names of their own, of two hierarchies, annotated."""
    folder = tmp_path_factory.mktemp("studio")
    for n, (distance, turn, seconds) in enumerate(
        ((3.0, 0, 3.2), (2.4, 1.2, 3.2), (1.2, 0, 2), (0.7, 1.6, 2), (0, 2.6, 2.2))
    ):
        write(folder / f"take {n}.bvh", captures.walk(distance, turn, seconds))
    write(folder / "monday" / "a.bvh", captures.walk(4.2, 0.5, 4.3))
    rename(folder / "monday" / "a.bvh")
    own = {"Hips": "hoofte"} | {
        s + n: s + m for s in ("Right", "Left") for n, m in (("Shoulder", "schulta"), ("Knee", "gnie"))
    }
    required = (
        "Head",
        *(s + n for s in ("Right", "Left") for n in ("Elbow", "Wrist", "Hip", "Ankle", "Toe")),
    )
    lines = [f'{k} = "{v}"' for k, v in (own | {n: n for n in required}).items()]
    (folder / "monday" / "mapping.toml").write_text("\n".join(("[joints]", *lines)) + "\n")
    write(folder / "monday" / "deep" / "b.bvh", captures.sit())
    rename(folder / "monday" / "deep" / "b.bvh")
    write(folder / "stand.bvh", captures.stand(120))
    write(folder / "box.bvh", lift())
    with pytest.raises(CaptureError, match=r"no level walk was found .*annotate.*\.$"):
        load(str(folder))
    assert main(["annotate", str(folder), "--no-pictures"]) == 0
    return folder


@pytest.fixture(scope="module")
def source(studio):
    return load(str(studio))


def test_takes_of_captures_under_any_name_and_hierarchy(source):
    composer = Composer(source, {"sit": 0.7, "walk": 0.3})
    takes = [t for t in map(composer.compose, range(8)) if t is not None]
    actions = {c.action for t in takes for c in t.commands}
    assert {"sit", "walk", "idle"} <= actions
    used = {name.rstrip("~").split("@")[0] for t in takes for name, *_ in t.provenance}
    assert {"monday/deep/b", "monday/a", "take 0"} <= used and "box" not in actions
    sat = next(t for t in takes if t.things)
    assert sat.things[0].furniture.seat is not None and np.isfinite(sat.hips).all()


def test_labels_choose_stretches(studio, source):
    walks = {c.name: c for c in load_walks(CaptureFolder(studio))}
    assert {n.split("@")[0] for n in walks} >= {"take 0", "take 4", "stand", "monday/a", "box"}
    assert not load_runs(CaptureFolder(studio))
    joints = np.concatenate(
        [forward_kinematics(c.hips_position, c.local_rotations)[0] for c in walks.values()]
    )
    hands = joints[:, [INDEX["RightWrist"], INDEX["LeftWrist"]], 2]
    assert hands.max() < 1.0 and joints[:, 0, 2].min() > 0.8  # neither carried nor bent
    assert len(source.segments["sit"]) == 2 and len(source.segments["carry"]) == 4  # with mirror images
    assert stance(CaptureFolder(studio))["hips_height"] == pytest.approx(captures.HEIGHT, abs=0.01)
    assert neutral(CaptureFolder(studio)).name.startswith("stand")


def test_grasps_become_bends(studio):
    box = next(p for p in CaptureFolder(studio).labelled if p.clip.name == "box")
    motion, (grasp,) = box.clip.world()[0], grasps(box)
    assert abs(grasp - int(motion[:, INDEX["RightWrist"], 2].argmin())) < 20
    for half in carry_episode.segments(CaptureFolder(studio)):
        chest = half.clip.world()[0][:, INDEX["Chest4"], 2]
        assert chest[0] > chest[-1] + 0.3 and chest.argmax() < 5


def edited(studio: Path, tmp_path: Path, change) -> Path:
    """A copy of the folder whose sidecars went through ``change``."""
    folder = tmp_path / "edited"
    shutil.copytree(studio, folder)
    for path in folder.rglob("*" + sidecar.SUFFIX):
        sidecar_writer.write_sheet(path, change(sidecar.read_sheet(path)))
    return folder


def test_a_sit_that_is_taken_out_is_not_composed(studio, tmp_path):
    folder = edited(studio, tmp_path, lambda s: s.with_section("actions.sit", []))
    assert load_sits(CaptureFolder(folder)) == []
    # It is no idling either.
    assert min(c.hips_position[:, 2].min() for c in load_walks(CaptureFolder(folder))) > 0.8
    composer = Composer(load(str(folder)), {"sit": 0.5, "walk": 0.5})
    takes = [t for t in map(composer.compose, range(6)) if t is not None]
    assert takes and all(c.action != "sit" for t in takes for c in t.commands)


def test_edits_take_effect(studio, tmp_path):
    def change(s):
        if s.clip == "take 0":
            return s.with_section("actions.other", [(0, 1.0)])
        if s.clip == "take 1":
            return replace(s, actions={})
        return s.with_section("actions.sit", [(f + 3, v) for f, v in s.actions["sit"]])

    folder = edited(studio, tmp_path, change)
    assert not {"take 0", "take 1"} & {c.name.split("@")[0] for c in load_walks(CaptureFolder(folder))}
    (before,), (after,) = load_sits(CaptureFolder(studio)), load_sits(CaptureFolder(folder))

    def number(s):
        return int(s.clip.name.split("@")[1])

    assert number(after) == number(before) + 3 and (after.down, after.up) == (before.down, before.up)


def test_runs_take_what_leads_to_them():
    clip = Clip("made", *(a.astype(np.float32) for a in captures.walk(6.0, 0.0, 6.4)))
    n = len(clip)
    keys = {
        "idle": [(0, 1.0), (40, 0.0)],
        "walk": [(0, 0.0), (40, 1.0), (90, 1.0), (100, 0.0)],
        "run": [(90, 0.0), (100, 1.0)],
    }
    sheet = sidecar.Sheet("made", n, keys, {}, [], [], [])
    walks, runs = walks_and_runs(Labelled(clip, sheet))
    assert [c.name for c in walks] == ["made@0"] and 90 <= len(walks[0]) <= 91
    assert [c.name for c in runs] == ["made@51"] and len(runs[0]) == n - 51


def test_sits_that_begin_or_end_seated_or_walk_are_left_out():
    clip = Clip("made", *(a.astype(np.float32) for a in captures.sit()))

    def sits(clip, keys):
        return sit_downs(Labelled(clip, sidecar.Sheet("made", len(clip), {"sit": keys}, {}, [], [], [])))

    keys = [(30, 0.0), (72, 1.0), (132, 1.0), (174, 0.0)]
    (found,) = sits(clip, keys)
    assert (found.clip.name, found.down, found.up, len(found.clip)) == ("made@30", 42, 102, 145)
    assert not sits(clip, [(0, 1.0), *keys[2:]]) and not sits(clip, keys[:3])
    assert not sits(clip, [(60, 0.0), *keys[1:]])  # not upright before
    drift = np.linspace(0, 0.6, len(clip), dtype=np.float32)[:, None] * (1, 0, 0)
    assert not sits(Clip("made", clip.hips_position + drift, clip.local_rotations), keys)


def test_a_sidecar_of_another_length_is_told(studio, tmp_path):
    folder = edited(studio, tmp_path, lambda s: replace(s, frames=s.frames + 1) if s.clip == "stand" else s)
    with pytest.raises(
        CaptureError, match=r"stand\.nsm\.toml speaks of 121 frames, stand\.bvh has 120 .*\.$"
    ):
        load(str(folder))


def test_what_a_sidecar_names_is_taken_as_it_is_and_clips_without_one_are_not(tmp_path_factory, tmp_path):
    known = captures.capture_folder(tmp_path_factory)
    names = ["monday/stand", *(f"tuesday/walk_{n:02d}" for n in (*range(9), 20, 21))]
    walks = load_walks(CaptureFolder(known))
    assert [c.name for c in walks] == names
    assert [c.name for c in load_runs(CaptureFolder(known))] == names[1:]
    for clip in walks:
        raw = reader.read_clip(known / f"{clip.name}.bvh")
        np.testing.assert_array_equal(clip.hips_position, raw.hips_position)
        np.testing.assert_array_equal(clip.local_rotations, raw.local_rotations)
    sits = [s.clip.name for s in load_sits(CaptureFolder(known))]
    assert sits == ["wednesday/sit_0@39", "wednesday/sit_1@39"]
    other = tmp_path / "copy"
    shutil.copytree(known, other)
    write(other / "unknown.bvh", captures.walk(2.0, 0.3, 3.2))
    write(other / "clips" / "cmu" / "cmu_09_01.bvh", captures.walk(2.0, 0.3, 3.2))  # a name says nothing
    a, b = captures.source(known), load(str(other))
    for name in ("hips", "rotations", "root", "pose", "contacts"):
        np.testing.assert_array_equal(getattr(a.library, name), getattr(b.library, name))


def with_uses(studio: Path, tmp_path: Path, name: str, lines: str) -> CaptureFolder:
    """A copy of the folder in which one sidecar says what its clip is used for, and was annotated again."""
    folder = tmp_path / "used"
    shutil.copytree(studio, folder)
    path = folder / f"{name}{sidecar.SUFFIX}"
    head, rest = path.read_text(encoding="utf-8").split("\n\n[", 1)
    path.write_text(f"{head}\n\n[use]\n{lines}\n\n[{rest}", encoding="utf-8")
    assert main(["annotate", str(folder), "--no-pictures"]) == 0
    return CaptureFolder(folder)


def of(clips, name: str) -> list[tuple[str, int]]:
    return [(c.name, len(c)) for c in clips if c.name.split("@")[0] == name]


def test_stretches_that_are_named_are_used_whatever_labels_say(studio, tmp_path):
    folder = with_uses(studio, tmp_path, "take 0", "walk = [[10, 49], [60, 99]]\nrun = [[60, 99]]")
    assert of(load_walks(folder), "take 0") == [("take 0@10", 40), ("take 0@60", 40)]
    assert of(load_runs(folder), "take 0") == [("take 0@60", 40)]
    assert of(load_walks(folder), "take 1") == of(load_walks(CaptureFolder(studio)), "take 1")


def test_a_clip_is_left_out_and_a_stand_is_chosen(studio, tmp_path):
    assert of(load_walks(CaptureFolder(studio)), "box")
    folder = with_uses(studio, tmp_path, "box", "walk = []\nstand = 5")
    assert not of(load_walks(folder), "box") and len(carry_episode.segments(folder)) == 2
    assert neutral(folder).name == "box" and len(neutral(folder)) == 1
    box = next(p for p in folder.labelled if p.clip.name == "box")
    np.testing.assert_array_equal(neutral(folder).local_rotations[0], box.clip.local_rotations[5])


def test_other_leaves_sits_and_grasps_out_too(studio, tmp_path):
    folder = edited(studio, tmp_path, lambda s: s.with_section("actions.other", [(0, 1.0)]))
    assert load_sits(CaptureFolder(folder)) == [] and carry_episode.segments(CaptureFolder(folder)) == []
    assert load_walks(CaptureFolder(folder)) == []


def test_a_sit_in_a_stretch_that_is_named_may_move_its_feet():
    clip = Clip("made", *(a.astype(np.float32) for a in captures.sit()))
    drift = np.linspace(0, 0.6, len(clip), dtype=np.float32)[:, None] * (1, 0, 0)
    clip = Clip("made", clip.hips_position + drift, clip.local_rotations)
    keys = {"sit": [(30, 0.0), (72, 1.0), (132, 1.0), (174, 0.0)]}

    def sits(*stretches):
        sheet = sidecar.Sheet("made", len(clip), keys, {}, [], [], [], use=Use(sit=stretches or None))
        return [(s.clip.name, s.down, s.up) for s in sit_downs(Labelled(clip, sheet))]

    assert sits() == [] and sits((40, 203)) == []
    assert sits((30, 174)) == sits((0, 20), (25, 203)) == [("made@30", 42, 102)]
