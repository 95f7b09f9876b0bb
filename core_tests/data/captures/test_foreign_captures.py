"""Captures as devices and programs write them: names of any family, any way up."""

from __future__ import annotations

import re

import numpy as np
import pytest
from foreign_bvh import Y_UP, foreign, same
from rig_families import FAMILIES, MIXAMO

from nsm_core.body.skeleton import INDEX
from nsm_core.data.captures import reader
from nsm_core.data.captures.joint_names import bodies
from nsm_core.errors import SkeletonError
from nsm_core.rotations import quat_from_rotvec, quat_mul


@pytest.mark.parametrize("name", FAMILIES)
def test_names_of_rigs_and_devices(tmp_path, motion, plain, name):
    path = foreign(tmp_path / "a.bvh", motion, FAMILIES[name])
    same(reader.read_clip(path), plain[1])
    ((_, mapping),) = bodies(reader.parse(path))
    # Of a trunk without a pelvis the lowest joint counts as that.
    assert len(mapping.joints) == 19 and len(mapping.spine) in (2, 3)


def pose(kind: str) -> tuple[np.ndarray, np.ndarray]:
    """A motion of 40 frames that lies, crawls or stands on its head: hips (T, 3) and local rotations (T, 23,
    4), facing -Y.
    """
    t = np.arange(40)
    local = np.zeros((40, 23, 4))
    local[..., 0] = 1
    for side, sign in (("Right", 1.0), ("Left", -1.0)):
        local[:, INDEX[f"{side}Shoulder"]] = quat_from_rotvec(np.array((0, -sign * 1.2, 0)))
        local[:, INDEX[f"{side}Elbow"]] = quat_from_rotvec(
            -(0.5 + 0.3 * np.sin(t / 5))[:, None] * np.array((0, 0, -sign))
        )
    turns = {
        "supine": (-np.pi / 2, 0),
        "side": (0, np.pi / 2),
        "crawling": (1.4, 0),
        "head down": (np.pi, 0),
        "standing": (0, 0),
    }
    local[:, 0] = quat_mul(quat_from_rotvec(np.array((*turns[kind], 0.0))), local[:, 0])
    if kind == "crawling":
        for side in ("Right", "Left"):
            local[:, INDEX[f"{side}Hip"]] = quat_from_rotvec(np.array((-1.4, 0, 0)))
            local[:, INDEX[f"{side}Knee"]] = quat_from_rotvec(np.array((1.5, 0, 0)))
    heights = {"supine": 0.55, "side": 0.3, "crawling": 0.6, "head down": 1.0, "standing": 0.95}
    hips = np.stack((0.004 * t, -0.01 * t, np.full(40, heights[kind])), axis=1)
    return hips, local


@pytest.mark.parametrize("axes", [Y_UP, np.eye(3)], ids=["Y up", "Z up"])
@pytest.mark.parametrize("kind", ["supine", "side", "crawling", "head down", "standing"])
def test_who_lies_stays_lying(tmp_path, kind, axes):
    """The file's offsets say what is up, whatever the body does; and who never stands keeps the height of the
    bed.
    """
    hips, local = pose(kind)
    clip = reader.read_clip(foreign(tmp_path / "a.bvh", (hips, local), MIXAMO, axes=axes))
    (found, _), (wanted, _) = (
        clip.world(),
        reader.Clip("", hips.astype(np.float32), local.astype(np.float32)).world(),
    )
    shift = found[:, 0] - wanted[:, 0]
    np.testing.assert_allclose(found - shift[:, None], wanted, atol=0.03)
    # Standing soles are brought to the floor.
    assert np.abs(shift[:, 2]).max() < (0.06 if kind != "standing" else 0.12)


@pytest.mark.parametrize("start", [(0.0, 0.0), (0.3, -0.4)])
def test_a_root_that_turns_offsets_upright(tmp_path, motion, start):
    """Offsets that stand along Z in a world with Y up, as of armatures that were turned: walking stays
    walking.
    """
    hips, local = motion
    path = foreign(tmp_path / "a.bvh", (hips + (*start, 0), local), MIXAMO, axes=np.eye(3))
    head, _, body = path.read_text().partition("Frame Time: 0.0333333\n")
    head = head.replace(
        "CHANNELS 6 Xposition Yposition Zposition", "CHANNELS 7 Xposition Yposition Zposition Xrotation", 1
    )
    numbers = [row.split() for row in body.splitlines()]
    turned = [" ".join((x, z, str(-float(y)), "-90", *rest)) for x, y, z, *rest in numbers]
    path.write_text(head + "Frame Time: 0.0333333\n" + "\n".join(turned) + "\n")
    found = reader.read_clip(path).world()[0]
    assert (found[:, INDEX["Head"], 2] - found[:, INDEX["RightAnkle"], 2] > 1.1).all()
    assert np.percentile(found[:, INDEX["RightToe"], 2], 5) == pytest.approx(0.025, abs=0.02)


def test_the_hint_names_a_likely_joint(tmp_path, motion):
    names = MIXAMO | {"LeftKnee": "Unterschenkel1", "RightKnee": "Unterschenkel2"}
    with pytest.raises(SkeletonError, match=r'such as RightKnee = "Unterschenkel2"'):
        reader.read_clip(foreign(tmp_path / "a.bvh", motion, names))
    with pytest.raises(SkeletonError, match=r'such as Hips = "Becken"'):
        reader.read_clip(foreign(tmp_path / "a.bvh", motion, MIXAMO | {"Hips": "Becken"}))
    with pytest.raises(SkeletonError, match=r'such as RightWrist = "RightHandle"'):
        reader.read_clip(foreign(tmp_path / "a.bvh", motion, MIXAMO | {"RightWrist": "RightHandle"}))


def test_fingers_twists_and_props_do_not_mislead(tmp_path, motion):
    """Joints beside the body's own whose names sound alike."""
    text = foreign(tmp_path / "a.bvh", motion, FAMILIES["Unreal"]).read_text()
    reference = reader.read_clip(tmp_path / "a.bvh")
    for side in "lr":
        extra = "".join(
            f"JOINT {n}_{side}\n{{\nOFFSET 1 0 0\n}}\n"
            for n in ("lowerarm_twist_01", "hand_prop", "index_01", "ik_foot")
        )
        text = re.sub(rf"(JOINT hand_{side}\n{{\nOFFSET.*\nCHANNELS.*\n)", rf"\g<1>{extra}", text)
    (tmp_path / "b.bvh").write_text(text)
    same(reader.read_clip(tmp_path / "b.bvh"), reference)
