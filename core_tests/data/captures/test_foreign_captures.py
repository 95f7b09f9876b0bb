"""Captures as devices and programs write them: any spelling of the format, names of any family, any
way up.
"""

from __future__ import annotations

import re

import numpy as np
import pytest
from captures import walk
from foreign_bvh import Y_UP, foreign

from nsm_core.body.skeleton import INDEX
from nsm_core.data.captures import reader
from nsm_core.data.captures.joint_names import bodies
from nsm_core.errors import CaptureError, NsmError, SkeletonError
from nsm_core.rotations import quat_from_rotvec, quat_mul

TRUNK = ("Hips", "Chest", "Chest2", "Chest4", "Neck", "Head")
LIMBS = ("Collar", "Shoulder", "Elbow", "Wrist", "Hip", "Knee", "Ankle", "Toe")


def family(pattern: str, trunk: str, limbs: str) -> dict[str, str]:
    """Names by joint: ``trunk`` and ``limbs`` are words, ``pattern`` holds * and one of {Left}, {left}, {L},
    {l} for the side.
    """
    names = dict(zip(TRUNK, trunk.split(), strict=True))
    for side in ("Left", "Right"):
        marks = {"{Left}": side, "{left}": side.lower(), "{L}": side[0], "{l}": side[0].lower()}
        for ours, word in zip(LIMBS, limbs.split(), strict=True):
            name = pattern
            for mark, text in marks.items():
                name = name.replace(mark, text)
            names[side + ours] = name.replace("*", word)
    return {k: v.replace("~", " ") for k, v in names.items()}


MIXAMO = family(
    "{Left}*", "Hips Spine Spine1 Spine2 Neck Head", "Shoulder Arm ForeArm Hand UpLeg Leg Foot ToeBase"
)
RIGIFY = "shoulder upper_arm forearm hand thigh shin foot toe"
CALF = "clavicle upperarm lowerarm hand thigh calf foot ball"
BIPED = "Clavicle UpperArm Forearm Hand Thigh Calf Foot Toe0"
HUMANOID = "Shoulder UpperArm LowerArm Hand UpperLeg LowerLeg Foot Toes"
ANATOMY = "Collar Shoulder Elbow Wrist Hip Knee Ankle Foot"


def prefixed(names: dict[str, str], before: str = "", behind: str = "") -> dict[str, str]:
    return {k: before + v + behind for k, v in names.items()}


FAMILIES = {
    "Mixamo": prefixed(MIXAMO, "mixamorig:"),
    "Mixamo, a second character": prefixed(MIXAMO, "mixamorig1:"),
    "Mixamo without a colon": prefixed(MIXAMO, "mixamorig"),
    "Mixamo without a colon, a second": prefixed(MIXAMO, "mixamorig2"),
    "HumanIK": prefixed(MIXAMO, "Character1_"),
    "Perception Neuron": prefixed(MIXAMO, "Robot_"),
    "joints with an ending": prefixed(MIXAMO, behind="_joint"),
    "numbered": {k: f"{v}_{n:02d}" for n, (k, v) in enumerate(MIXAMO.items())},
    "capitals": {k: v.upper() for k, v in MIXAMO.items()},
    "Rigify metarig": family("*.{L}", "spine spine.001 spine.002 spine.003 spine.004 spine.006", RIGIFY),
    "Rigify basic": family("*.{L}", "spine spine.001 spine.002 spine.003 spine.004 spine.005", RIGIFY),
    "Rigify deform": family(
        "DEF-*.{L}", "DEF-spine DEF-spine.001 DEF-spine.002 DEF-spine.003 DEF-spine.004 DEF-spine.006", RIGIFY
    ),
    "Rigify original": family(
        "ORG-*.{L}", "ORG-spine ORG-spine.001 ORG-spine.002 ORG-spine.003 ORG-spine.004 ORG-spine.006", RIGIFY
    ),
    "mocopi": family(
        "{l}_*",
        "root torso_1 torso_4 torso_7 neck_1 head",
        "shoulder up_arm low_arm hand up_leg low_leg foot toes",
    ),
    "DeepMotion": family(
        "{l}_*_JNT",
        "hips_JNT spine_JNT spine1_JNT spine2_JNT neck_JNT head_JNT",
        "shoulder arm forearm hand upleg leg foot toebase",
    ),
    "SOMA": family(
        "{Left}*", "Hips Spine1 Spine2 Chest Neck1 Head", "Shoulder Arm ForeArm Hand Leg Shin Foot ToeBase"
    ),
    "iPi": family(
        "{L}*",
        "Hip LowerSpine MiddleSpine Chest Neck Head",
        "Clavicle Shoulder Forearm Hand Thigh Shin Foot Toe",
    ),
    "Xsens": family(
        "{Left}*", "Pelvis L5 T12 T8 Neck Head", "Shoulder UpperArm ForeArm Hand UpperLeg LowerLeg Foot Toe"
    ),
    "Rokoko": family(
        "{Left}*", "Hips Spine1 Spine2 Spine4 Neck Head", "Shoulder Arm ForeArm Hand Thigh Shin Foot Toe"
    ),
    "Motive": prefixed(
        family("{L}*", "Hip Ab Spine Chest Neck Head", "Shoulder UArm FArm Hand Thigh Shin Foot Toe"),
        "Skeleton1_",
    ),
    "Theia": family(
        "{l}_*", "pelvis abdomen torso thorax neck head", "clavicle uarm larm hand thigh shank foot toes"
    ),
    "Unreal": family("*_{l}", "pelvis spine_01 spine_02 spine_03 neck_01 head", CALF),
    "VRoid": family(
        "J_Bip_{L}_*",
        "J_Bip_C_Hips J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest J_Bip_C_Neck J_Bip_C_Head",
        HUMANOID,
    ),
    "VRM 1": family("{left}*", "hips spine chest upperChest neck head", HUMANOID),
    "VRM in Blender": family(
        "*.{L}",
        "hips spine chest upper_chest neck head",
        "shoulder upper_arm lower_arm hand upper_leg lower_leg foot toes",
    ),
    "MakeHuman": family(
        "*.{L}",
        "root spine05 spine03 spine01 neck01 head",
        "clavicle upperarm01 lowerarm01 wrist upperleg01 lowerleg01 foot toe1-1",
    ),
    "Auto-Rig Pro": family(
        "*.{l}",
        "root.x spine_01.x spine_02.x spine_03.x neck.x head.x",
        "shoulder arm_stretch forearm_stretch hand thigh_stretch leg_stretch foot toes_01",
    ),
    "Character Creator": prefixed(
        family(
            "{L}_*",
            "Hip Waist Spine01 Spine02 NeckTwist01 Head",
            "Clavicle Upperarm Forearm Hand Thigh Calf Foot ToeBase",
        ),
        "CC_Base_",
    ),
    "SMPL": family("{L}_*", "Pelvis Spine1 Spine2 Spine3 Neck Head", ANATOMY),
    "SMPL with the body's name": prefixed(
        family("{L}_*", "Pelvis Spine1 Spine2 Spine3 Neck Head", ANATOMY), "m_avg_"
    ),
    "SMPL-X": family("{left}_*", "pelvis spine1 spine2 spine3 neck head", ANATOMY.lower()),
    "Kinect": family(
        "*_{Left}",
        "PELVIS SPINE_NAVAL SPINE_MID SPINE_CHEST NECK HEAD",
        ANATOMY.replace("Collar", "CLAVICLE").upper(),
    ),
    "CMU": family(
        "{l}*",
        "root lowerback upperback thorax lowerneck head",
        "clavicle humerus radius wrist femur tibia foot toes",
    ),
    "Biped": prefixed(family("{L}~*", "Pelvis Spine Spine1 Spine2 Neck Head", BIPED), "Bip01 "),
    "Biped with bars": prefixed(family("{L}_*", "Pelvis Spine Spine1 Spine2 Neck Head", BIPED), "Bip001_"),
    "Valve": prefixed(family("{L}_*", "Pelvis Spine Spine1 Spine2 Neck1 Head1", BIPED), "ValveBiped.Bip01_"),
    "Daz 3 and 8": family(
        "{l}*",
        "hip abdomenLower abdomenUpper chestLower neckLower head",
        "Collar ShldrBend ForearmBend Hand ThighBend Shin Foot Toe",
    ),
    "Daz 9": family(
        "{l}_*", "hip spine1 spine2 spine3 neck1 head", "shoulder upperarm forearm hand thigh shin foot toes"
    ),
    "Poser": family(
        "{l}*", "hip abdomen waist chest neck head", "Collar Shldr ForeArm Hand Thigh Shin Foot Toe"
    ),
    "Second Life": family("m*{Left}", "mPelvis mTorso mSpine mChest mNeck mHead", ANATOMY),
    "Roblox": family("{Left}*", "LowerTorso Waist UpperTorso Chest Neck Head", HUMANOID),
    "Advanced Skeleton": family(
        "*_{L}",
        "Root_M Spine1_M Spine2_M Chest_M Neck_M Head_M",
        "Scapula Shoulder Elbow Wrist Hip Knee Ankle Toes",
    ),
    "MikuMikuDance": family(
        "*_{L}",
        "center upper~body upper~body~2 upper~body~3 neck head",
        "shoulder arm elbow wrist leg knee ankle toe",
    ),
}


@pytest.fixture(scope="module")
def motion():
    hips, local = walk(1.2, 0.4, 1.2, rest=0.3)
    return hips[::3], local[::3]


@pytest.fixture(scope="module")
def plain(tmp_path_factory, motion) -> tuple[str, reader.Clip]:
    """The text of a capture in Mixamo's names, and its clip."""
    path = foreign(tmp_path_factory.mktemp("plain") / "a.bvh", motion, MIXAMO)
    return path.read_text(), reader.read_clip(path)


def same(clip: reader.Clip, other: reader.Clip, frames: int | None = None) -> None:
    np.testing.assert_allclose(clip.hips_position, other.hips_position[:frames], atol=2e-3)
    np.testing.assert_allclose(
        np.abs((clip.local_rotations * other.local_rotations[:frames]).sum(-1)), 1, atol=1e-3
    )


@pytest.mark.parametrize("name", FAMILIES)
def test_names_of_rigs_and_devices(tmp_path, motion, plain, name):
    path = foreign(tmp_path / "a.bvh", motion, FAMILIES[name])
    same(reader.read_clip(path), plain[1])
    ((_, mapping),) = bodies(reader.parse(path))
    # Of a trunk without a pelvis the lowest joint counts as that.
    assert len(mapping.joints) == 19 and len(mapping.spine) in (2, 3)


def rows(text: str, change) -> str:
    """Change every row of numbers of a capture."""
    head, _, body = text.rpartition("Frame Time: 0.0333333\n")
    return head + "Frame Time: 0.0333333\n" + "".join(change(row) + "\n" for row in body.splitlines())


FORGIVEN = {
    "doubled carriage returns": lambda t: t.replace("\n", "\r\r\n"),
    "old carriage returns": lambda t: t.replace("\n", "\r"),
    "blank lines everywhere": lambda t: t.replace("\n", "\n \t\n"),
    "no colons": lambda t: t.replace("Frames:", "Frames").replace("Time:", "Time"),
    "colons apart": lambda t: t.replace("Frames:", "Frames :").replace("Time: ", "Time:\t"),
    "small letters": lambda t: re.sub(
        "[A-Z]{3,}|Frames|Frame Time|Site|[XYZ](?=rot|pos)", lambda m: m[0].lower(), t
    ),
    "large letters": lambda t: re.sub("Frames|Frame Time|Site|rotation|position", lambda m: m[0].upper(), t),
    "tabs": lambda t: t.replace(" ", "\t").replace("Frame\tTime", "Frame Time"),
    "wide spaces": lambda t: rows(t, lambda r: "   " + r.replace(" ", "    ") + "  "),
    "brackets behind names": lambda t: t.replace("\n{", " {"),
    "a remark on top": lambda t: "# exported by a program\n" + t,
    "no line end": lambda t: t.rstrip("\n"),
    "head the other way round": lambda t: re.sub(r"(Frames: \d+)\n(Frame Time: .*)\n", r"\2\n\1\n", t),
    "decimal commas": lambda t: t.replace(".", ","),
    "commas between numbers": lambda t: rows(t, lambda r: r.replace(" ", ", ")),
    "semicolons and decimal commas": lambda t: rows(t, lambda r: r.replace(".", ",").replace(" ", ";")),
    "powers of ten": lambda t: rows(t, lambda r: " ".join(f"{float(w):+.8E}" for w in r.split())),
    "rows over several lines": lambda t: rows(t, lambda r: "\n".join(r.rsplit(" ", 20))),
    "no count": lambda t: re.sub(r"Frames: \d+\n", "", t),
}


@pytest.mark.parametrize("name", FORGIVEN)
def test_what_other_readers_open_is_read_without_a_word(tmp_path, plain, name):
    text, clip = plain
    changed = FORGIVEN[name](text)
    assert changed != text
    (tmp_path / "a.bvh").write_bytes(changed.encode())
    found = reader.read_clip(tmp_path / "a.bvh")
    same(found, clip)
    assert len(found) == len(clip) and found.notes == ()


@pytest.mark.parametrize(
    "encoding", ["utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1", "cp1252", "utf-32"]
)
def test_encodings(tmp_path, plain, encoding):
    text, clip = plain
    (tmp_path / "a.bvh").write_bytes(text.replace("LeftToeBase", "LinkerFuß").encode(encoding))
    same(reader.read_clip(tmp_path / "a.bvh")[:1], clip, 1)


def count(text: str, more: int) -> str:
    return re.sub(r"Frames: (\d+)", lambda m: f"Frames: {int(m[1]) + more}", text)


NOTED = {
    "one frame too many announced": (lambda t: count(t, 1), 0, "are announced, .* are there"),
    "one frame too few announced": (lambda t: count(t, -1), 0, "are announced, .* are there"),
    "half of them announced": (lambda t: count(t, -12), 0, "are announced, .* are there"),
    "a count that was never filled in": (
        lambda t: re.sub(r"Frames: \d+", "Frames: 0", t),
        0,
        "0 frames are announced",
    ),
    "a last row that is cut off": (lambda t: t[:-100], 1, "the last row is cut off"),
    "a last number that is cut off": (lambda t: t.rsplit(" ", 1)[0] + " -", 1, "the last row is cut off"),
    "no frame time": (lambda t: re.sub("Frame Time.*\n", "", t), 0, "no Frame Time is said"),
    "a frame time of zero": (lambda t: t.replace("0.0333333", "0"), 0, "no Frame Time is said"),
    "a word behind the end": (lambda t: t + "END\n", 0, "behind the last frame"),
    "zeros behind the end": (lambda t: t + "\0\0", 0, "behind the last frame"),
    "more numbers than channels": (lambda t: rows(t, lambda r: r + " 0.0 1.0"), 0, "the last 2 are left out"),
}


@pytest.mark.parametrize("name", NOTED)
def test_what_is_mended_is_told(tmp_path, plain, name):
    text, clip = plain
    change, lost, says = NOTED[name]
    (tmp_path / "a.bvh").write_text(change(text))
    found = reader.read_clip(tmp_path / "a.bvh")
    assert (
        len(found) == len(clip) - lost
        and len(found.notes) == 1
        and re.search(rf"^a\.bvh.*{says}.*\.$", found.notes[0])
    )
    same(found, clip, len(found))


REFUSED = {
    "milliseconds": (
        lambda t: t.replace("0.0333333", "33.333"),
        "33.333 seconds from one frame to the next; .*rate = 30",
    ),
    "a rate for a time": (lambda t: t.replace("0.0333333", "120"), "120 seconds from one frame to the next"),
    "an hour": (lambda t: t.replace("0.0333333", "3600"), "3600 seconds"),
    "a time beyond measure": (lambda t: t.replace("0.0333333", "1e308"), "1e.308 seconds"),
    "no time at all": (lambda t: t.replace("0.0333333", "1e-300"), "frames a second"),
    "time backwards": (lambda t: t.replace("0.0333333", "-0.03"), "no motion"),
    "time that is no number": (lambda t: t.replace("0.0333333", "nan"), "no motion"),
    "endless time": (lambda t: t.replace("0.0333333", "inf"), "no motion"),
    "a milliard frames": (
        lambda t: re.sub(r"Frames: \d+", "Frames: 1000000000", t),
        "1000000000 frames are announced, .* are there",
    ),
    "more frames than numbers": (lambda t: re.sub(r"Frames: \d+", "Frames: 1e300", t), "no motion"),
    "fewer than none": (lambda t: re.sub(r"Frames: \d+", "Frames: -3", t), "no motion"),
    "no rows": (lambda t: t.split("Frame Time")[0] + "Frame Time: 0.0333333\n", "are announced, 0 are there"),
    "values beyond measure": (lambda t: t.rsplit(" ", 1)[0] + " 1e300\n", "a value is beyond"),
    "a forest of joints": (
        lambda t: t.replace("End Site", "JOINT a\n{\n}\n" * 5000 + "End Site", 1),
        "more than 4000 joints",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_makes_no_motion_is_refused_before_it_is_computed(tmp_path, plain, name):
    change, says = REFUSED[name]
    (tmp_path / "a.bvh").write_text(change(plain[0]))
    with pytest.raises(CaptureError, match=rf"^a\.bvh.*{says}.*\.$"):
        reader.read_clip(tmp_path / "a.bvh")


def test_many_joints_times_many_frames_are_refused(tmp_path):
    """Frames of a body without channels cost no letters in the file: the whole is what counts."""
    joints = "JOINT a\n{\nOFFSET 0 1 0\n}\n" * 3900
    head = (
        "HIERARCHY\nROOT Hips\n{\nOFFSET 0 0 0\nCHANNELS 1 Yposition\n"
        + joints
        + "}\nMOTION\nFrames: 3000\nFrame Time: 0.01\n"
    )
    (tmp_path / "a.bvh").write_text(head + "0\n" * 3000)
    with pytest.raises(CaptureError, match=r"3000 frames of 3901 joints, too much to read at once; .*\.$"):
        reader.read_clip(tmp_path / "a.bvh")


def test_legs_without_length_are_refused(tmp_path, plain):
    (tmp_path / "a.bvh").write_text(re.sub("OFFSET.*", "OFFSET 0 0 0", plain[0]))
    with pytest.raises(SkeletonError, match=r"legs of the file have no length; .*\.$"):
        reader.read_clip(tmp_path / "a.bvh")


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


def test_every_refusal_is_one_sentence(tmp_path):
    for content in (b"", b"\0" * 100, b"HIERARCHY", b"MOTION\n", b"\x89PNG\r\n", "größe".encode("utf-16")):
        (tmp_path / "a.bvh").write_bytes(content)
        with pytest.raises(NsmError, match=r"^a\.bvh.*\.$"):
            reader.read_clip(tmp_path / "a.bvh")
