"""Joint names as programs and devices give them, by family."""

from __future__ import annotations

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
