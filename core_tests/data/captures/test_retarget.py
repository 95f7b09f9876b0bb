"""Other hierarchies: the same walk, written with other names, axes, units and rest poses, reads back as it
was.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from captures import walk
from foreign_bvh import foreign

from nsm_core.body.clip import Clip
from nsm_core.body.skeleton import INDEX, JOINTS, forward_kinematics
from nsm_core.data.captures import reader
from nsm_core.data.captures.joint_map import load_mapping
from nsm_core.errors import CaptureError, SkeletonError
from nsm_core.rotations import quat_from_rotvec

LIMB = {
    "Collar": "Shoulder",
    "Shoulder": "Arm",
    "Elbow": "ForeArm",
    "Wrist": "Hand",
    "Hip": "UpLeg",
    "Knee": "Leg",
    "Ankle": "Foot",
}
MIXAMO = {
    side + ours: f"mixamorig:{side}{theirs}"
    for side in ("Left", "Right")
    for ours, theirs in (LIMB | {"Toe": "ToeBase"}).items()
}
MIXAMO |= {
    "Hips": "mixamorig:Hips",
    "Chest": "mixamorig:Spine",
    "Chest2": "mixamorig:Spine1",
    "Chest4": "mixamorig:Spine2",
}
MIXAMO |= {"Neck": "mixamorig:Neck", "Head": "mixamorig:Head"}
UNREAL_LIMB = {
    "Collar": "clavicle",
    "Shoulder": "upperarm",
    "Elbow": "lowerarm",
    "Wrist": "hand",
    "Hip": "thigh",
    "Knee": "calf",
}
UNREAL = {
    side + ours: f"{theirs}_{side[0].lower()}"
    for side in ("Left", "Right")
    for ours, theirs in UNREAL_LIMB.items()
}
UNREAL |= {
    side + ours: f"{name}_{side[0].lower()}"
    for side in ("Left", "Right")
    for ours, name in (("Ankle", "foot"), ("Toe", "ball"))
}
UNREAL |= {
    "Hips": "pelvis",
    "Chest": "spine_01",
    "Chest2": "spine_02",
    "Chest4": "spine_03",
    "Neck": "neck_01",
    "Head": "head",
}
CMU_LIMB = {
    "Collar": "clavicle",
    "Shoulder": "humerus",
    "Elbow": "radius",
    "Wrist": "wrist",
    "Hip": "femur",
    "Knee": "tibia",
}
CMU = {
    side + ours: f"{side[0].lower()}{name}" for side in ("Left", "Right") for ours, name in CMU_LIMB.items()
}
CMU |= {
    side + ours: f"{side[0].lower()}{name}"
    for side in ("Left", "Right")
    for ours, name in (("Ankle", "foot"), ("Toe", "toes"))
}
CMU |= {
    "Hips": "root",
    "Chest": "lowerback",
    "Chest2": "upperback",
    "Chest4": "thorax",
    "Neck": "lowerneck",
    "Head": "head",
}


@pytest.fixture(scope="module")
def motion() -> tuple[np.ndarray, np.ndarray]:
    """A walk that turns, with elbows that swing so that their hinges show; the spine is straight."""
    hips, local = walk(2.4, 0.8, 3.2, rest=0.3)
    swing = -0.7 - 0.5 * np.sin(np.arange(len(hips)) / 5)
    for side, sign in (("Right", 1.0), ("Left", -1.0)):
        local[:, INDEX[f"{side}Elbow"]] = quat_from_rotvec(swing[:, None] * np.array((0, 0, -sign)))
    return hips, local


def apart(clip: Clip, motion: tuple[np.ndarray, np.ndarray]) -> float:
    """Mean distance of joints, metres, after the hips' start is put in one place."""
    found, _ = clip.world()
    wanted, _ = forward_kinematics(*motion)
    found = found - found[0, 0] * (1, 1, 0)
    wanted = wanted[-len(found) :]
    return float(np.linalg.norm(found - (wanted - wanted[0, 0] * (1, 1, 0)), axis=-1).mean())


def test_mixamo_names_in_centimetres(tmp_path, motion):
    clip = reader.read_clip(foreign(tmp_path / "a.bvh", motion, MIXAMO))
    assert apart(clip, motion) < 0.012


def test_a_bigger_performer_in_inches_is_scaled_to_the_character(tmp_path, motion):
    clip = reader.read_clip(foreign(tmp_path / "a.bvh", motion, CMU, unit=0.0254, size=1.2))
    assert apart(clip, motion) < 0.012
    toes = clip.world()[0][:, [INDEX["RightToe"], INDEX["LeftToe"]], 2]
    assert abs(np.percentile(toes, 5) - 0.025) < 0.008


def test_z_up_without_collars_toes_and_neck(tmp_path, motion):
    names = {
        k: v
        for k, v in UNREAL.items()
        if "Collar" not in k and "Toe" not in k and k not in ("Neck", "Chest2", "Chest4")
    }
    clip = reader.read_clip(foreign(tmp_path / "a.bvh", motion, names, axes=np.eye(3)))
    assert apart(clip, motion) < 0.03


def test_twisted_joint_axes_with_the_t_pose_in_the_first_frame(tmp_path, motion):
    """Joints whose own axes point anywhere: the offsets are no T-pose, and the first frame says what is."""
    rng = np.random.default_rng(3)
    twists = {name: quat_from_rotvec(rng.normal(size=3)) for name in MIXAMO}
    path = foreign(tmp_path / "a.bvh", motion, MIXAMO, twists=twists, rest_frame=True)
    clip = reader.read_clip(path)
    assert len(clip) == len(motion[0])  # the rest pose is no part of the motion
    assert apart(clip, motion) < 0.012


def test_without_any_rest_pose_the_bending_joints_say_it(tmp_path, motion):
    rng = np.random.default_rng(4)
    twists = {name: quat_from_rotvec(rng.normal(size=3)) for name in MIXAMO}
    clip = reader.read_clip(foreign(tmp_path / "a.bvh", motion, MIXAMO, twists=twists))
    assert len(clip) == len(motion[0])
    assert apart(clip, motion) < 0.04


def mapping_of(tmp_path: Path, names: dict[str, str], more: str = "") -> Path:
    path = tmp_path / "odd.toml"
    path.write_text(
        more + "\n[joints]\n" + "\n".join(f'{ours} = "{theirs}"' for ours, theirs in names.items()) + "\n"
    )
    return path


def test_a_mapping_file_for_names_that_say_nothing(tmp_path, motion):
    names = {name: f"bone{n}" for n, name in enumerate(JOINTS)}
    path = foreign(
        tmp_path / "a.bvh", motion, names, unit=0.001, axes=np.array(((0, 1.0, 0), (-1.0, 0, 0), (0, 0, 1)))
    )
    with pytest.raises(
        SkeletonError, match=r"a\.bvh lacks the bones Hips, .*mapping file.*Hips = .*--mapping\.$"
    ):
        reader.read_clip(path)
    for more in ('rest = "offsets"\nup = "+Z"\nforward = "-X"', 'units = "mm"\nforward = "-X"'):
        assert (
            apart(reader.read_clip(path, mapping=load_mapping(mapping_of(tmp_path, names, more))), motion)
            < 0.012
        )


def test_sides_and_spine_of_a_mapping_file(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text(
        'spine = ["s1", "s2"]\n[joints]\nHips = "h"\nHead = "k"\n[sides]\n'
        + "\n".join(f'{n} = "{{side}}_{n}"' for n in ("Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle"))
    )
    mapping = load_mapping(path)
    assert (
        mapping.joints["LeftKnee"] == "Left_Knee" and mapping.spine == ("s1", "s2") and mapping.units is None
    )


@pytest.mark.parametrize(
    ("more", "names", "says"),
    [
        ("units = 'ell'", {}, "units must be"),
        ("up = 'Q'", {}, "up must be"),
        ("rest = 'first'", {}, "rest must be"),
        ("colour = 1", {}, "'colour' is not known"),
        ("spine = 3", {}, "spine must be a list"),
        ("up = ? ", {}, r"not valid TOML: .*line 1"),
        ("", {"Tail": "t"}, "Tail is not one of the 23"),
        ("", {"Head": None}, "names no joint for Head"),
    ],
)
def test_a_wrong_mapping_file_is_a_sentence(tmp_path, more, names, says):
    wanted = {k: v for k, v in ({n: n for n in JOINTS} | names).items() if v}
    with pytest.raises((CaptureError, SkeletonError), match=rf"odd\.toml.*{says}.*\.$"):
        load_mapping(mapping_of(tmp_path, wanted, more))


def test_a_mapping_that_does_not_fit_the_file(tmp_path, motion):
    path = foreign(tmp_path / "a.bvh", motion, MIXAMO)
    wrong = load_mapping(mapping_of(tmp_path, MIXAMO | {"Head": "skull"}))
    with pytest.raises(
        SkeletonError, match=r"a\.bvh has no joint skull, which odd\.toml names; it has mixamorig:Hips"
    ):
        reader.read_clip(path, mapping=wrong)
    late = load_mapping(mapping_of(tmp_path, MIXAMO, 'rest = "frame 9000"'))
    with pytest.raises(CaptureError, match="wants the rest pose at frame 9000"):
        reader.read_clip(path, mapping=late)


@pytest.mark.parametrize("line", ["OFFSET 1 2", "OFFSET a b c", "CHANNELS 1 Wrotation"])
def test_damage_in_the_hierarchy_has_its_line(tmp_path, motion, line):
    path = foreign(tmp_path / "a.bvh", motion, MIXAMO)
    lines = path.read_text().splitlines()
    where = next(k for k, text in enumerate(lines) if text.startswith(line.split()[0]) and k > 12)
    lines[where] = line
    path.write_text("\n".join(lines))
    with pytest.raises(CaptureError, match=rf"a\.bvh, line {where + 1}: .*\.$"):
        reader.read_clip(path)


def test_own_names_with_other_proportions_are_retargeted(tmp_path, motion):
    """The 23 names alone do not make a file one of ours: a performer half as tall again walks on the same
    floor.
    """
    clip = reader.read_clip(foreign(tmp_path / "a.bvh", motion, {n: n for n in JOINTS}, size=1.5))
    assert apart(clip, motion) < 0.012
