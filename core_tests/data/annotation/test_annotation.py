"""Annotation: what the rules propose for motions whose labels are known, and that a person's edits stand."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from captures import LEGS, sit, stand, walk

from nsm_core.__main__ import main
from nsm_core.body.clip import Clip
from nsm_core.body.ik.two_bone import place_limbs, place_wrists
from nsm_core.body.skeleton import HIPS, INDEX
from nsm_core.conventions import (
    CARRY,
    CLIMB,
    FOOT_CONTACTS,
    HAND_CONTACTS,
    HIP_CONTACT,
    IDLE,
    OPEN,
    RUN,
    SIT,
    WALK,
)
from nsm_core.data.annotation.phases import keys_of_phase, phase_of_keys, rule_keys
from nsm_core.data.annotation.proposal import arrays_of, propose
from nsm_core.data.captures import bvh_writer, sidecar, sidecar_writer
from nsm_core.errors import CaptureError
from nsm_core.rotations import heading_to_direction


def clip_of(motion: tuple[np.ndarray, np.ndarray], name: str = "made") -> Clip:
    return Clip(name, motion[0].astype(np.float32), motion[1].astype(np.float32))


def annotated(motion):
    clip = clip_of(motion)
    sheet, _ = propose(clip)
    return clip, sheet, arrays_of(sheet)


def holding(distance: float = 3.0) -> tuple[np.ndarray, np.ndarray]:
    """A walk with both hands held still before the chest."""
    hips, local = walk(distance, 0.0, 4.0)
    for side, sign in ((0, -1.0), (1, 1.0)):
        heading = np.zeros(len(hips))
        ahead = heading_to_direction(heading) * 0.35
        target = np.stack(
            (hips[:, 0] + ahead[:, 0] + sign * 0.17, hips[:, 1] + ahead[:, 1], np.full(len(hips), 1.05)),
            axis=-1,
        )
        local = place_wrists(hips, local, side, target)
    return hips, local


def test_a_walk_between_two_stands():
    _, sheet, a = annotated(walk(4.0, 0.0, 4.3))
    assert a.style[5, IDLE] == 1 and a.style[-5, IDLE] == 1
    assert (a.style[70:120, WALK] == 1).all() and not a.style[:, [RUN, CARRY, OPEN, SIT, CLIMB]].any()
    np.testing.assert_allclose(a.style[:, [IDLE, WALK, RUN]].sum(1), 1, atol=1e-6)
    change = np.abs(np.diff(a.style[:, WALK]))
    assert 1 / 30 < change[change > 1e-6].mean() < 0.2  # a ramp, not a step
    stands = a.contact[70:120, FOOT_CONTACTS]
    assert (stands.max(1) == 1).mean() > 0.95 and 0.4 < stands.mean() < 0.8
    assert not a.contact[:, [HIP_CONTACT, *HAND_CONTACTS]].any()
    assert not sheet.goals  # ways are drawn: no goal of a walk would be read


def test_phase_ends_a_cycle_where_the_left_foot_lands_and_never_stops():
    _, _, a = annotated(walk(4.0, 0.0, 4.3))
    landings = np.flatnonzero(np.diff(a.contact[:, FOOT_CONTACTS[1]]) > 0) + 1
    inside = [f for f in landings if a.style[f, WALK] > 0.9]
    assert len(inside) >= 2
    gap = (a.phase[inside] + 0.5) % 1 - 0.5
    np.testing.assert_allclose(gap, 0, atol=1e-3)
    np.testing.assert_allclose(np.diff(a.phase[inside]), 1, atol=1e-3)
    speed = np.diff(a.phase) * 30
    assert speed.min() > 0.4 and speed.max() < 3
    assert abs(speed[:20].mean() - 1) < 0.15  # 1 Hz while standing


def test_a_sit_down_and_rise():
    clip, sheet, a = annotated(sit())
    seated = a.style[:, SIT] > 0.99
    first, last = np.flatnonzero(seated)[[0, -1]]
    assert 55 < first < 80 and 125 < last < 145  # captures.sit: down from 30 to 72, up from 132 to 174
    assert (a.contact[first:last, HIP_CONTACT] == 1).all() and not a.contact[:25, HIP_CONTACT].any()
    assert a.style[10, IDLE] == 1 and a.style[100, [IDLE, WALK]].sum() == 0
    goal = next(g for g in sheet.goals if g.action == "sit")
    np.testing.assert_allclose(goal.place, clip.world()[0][100, HIPS], atol=0.02)
    after = [g for g in sheet.goals if g.frame > goal.frame]
    assert abs(after[0].frame - last) <= 1 and after[0].action == "idle"
    start = np.flatnonzero(a.style[:, SIT] > 0)[0] - 1
    assert any(abs(k - start) <= 1 for k, _ in sheet.phase) and any(
        abs(k - first) <= 1 for k, _ in sheet.phase
    )


def test_a_squat_is_no_sit():
    """Hips as low as on a seat, but over the feet."""
    assert not annotated(sit(0.5, 0.05))[2].style[:, SIT].any()


def test_hands_that_hold_while_walking_carry():
    _, sheet, a = annotated(holding())
    assert (a.style[60:110, CARRY] == 1).all() and (a.style[60:110, WALK] == 1).all()
    assert (a.contact[60:110, HAND_CONTACTS] == 1).all()
    assert not sheet.goals  # boxes are drawn
    assert not annotated(walk(3.0, 0.0, 4.0))[2].style[:, CARRY].any()


def test_hands_folded_while_standing_do_not():
    hips, local = stand()
    for side, sign in ((0, -1.0), (1, 1.0)):
        target = hips + np.array((sign * 0.15, -0.3, 0.2))
        local = place_wrists(hips, local, side, target)
    assert not annotated((hips, local))[2].style[:, [CARRY, OPEN]].any()


def test_a_hand_at_a_handle_opens():
    hips, local = stand()
    w = np.clip((np.arange(len(hips)) - 40) / 25, 0, 1) * np.clip((130 - np.arange(len(hips))) / 25, 0, 1)
    hang = clip_of((hips, local)).world()[0][:, INDEX["RightWrist"]]
    target = hang + (w * w * (3 - 2 * w))[:, None] * (hips + np.array((-0.1, -0.5, 0.15)) - hang)
    a = annotated((hips, place_wrists(hips, local, 0, target)))[2]
    assert (a.style[80:95, OPEN] == 1).all() and not a.style[:20, OPEN].any()
    assert a.contact[85, HAND_CONTACTS].tolist() == [1, 0]


def test_onto_a_platform_and_off_it_climbs():
    """The floor is 0.3 m higher along the middle of the way; feet and hips go with it."""
    hips, local = walk(6.0, 0.0, 6.4)
    ankles = clip_of((hips, local)).world()[0][:, [leg[2] for leg in LEGS]].astype(float)

    def floor(way: np.ndarray, edge: float) -> np.ndarray:
        return 0.3 * np.clip((way - 1.2) / edge, 0, 1) * np.clip((4.6 + edge - way) / edge, 0, 1)

    ankles[..., 2] += floor(-ankles[..., 1], 0.3)
    raised = hips + np.array((0, 0, 1.0)) * floor(-hips[:, 1], 0.4)[:, None]
    a = annotated((raised, place_limbs(raised, local, LEGS, ankles)))[2]
    climbs = a.style[:, CLIMB]
    assert climbs.max() == 1 and climbs[10] == 0 and climbs[-10] == 0
    assert (np.diff((climbs > 0.5).astype(int)) == 1).sum() == 2  # up, then down; a walk between them


def test_the_mirrored_annotation_swaps_sides_and_has_its_own_phase():
    clip = clip_of(walk(4.0, 0.5, 4.3))
    sheet, _ = propose(clip)
    a, m = arrays_of(sheet), arrays_of(propose(clip.mirrored())[0])
    flipped = a.mirrored()
    assert (flipped.contact[:, FOOT_CONTACTS] == a.contact[:, FOOT_CONTACTS[::-1]]).all()
    np.testing.assert_allclose(flipped.contact, m.contact)
    moving = a.style[:, WALK] > 0.9
    np.testing.assert_allclose(
        np.exp(2j * np.pi * flipped.phase)[moving], np.exp(2j * np.pi * m.phase)[moving], atol=0.05
    )
    assert np.abs((a.phase - flipped.phase + 0.5) % 1 - 0.5)[moving].mean() > 0.3  # half a cycle apart
    seated = clip_of(sit())
    one, other = (
        arrays_of(propose(seated)[0]).mirrored().goals,
        arrays_of(propose(seated.mirrored())[0]).goals,
    )
    assert [g.action for g in one] == [g.action for g in other] == ["sit", "idle"]
    np.testing.assert_allclose((*one[0].place, one[0].facing), (*other[0].place, other[0].facing), atol=0.02)
    assert flipped.mirrored().contact.tolist() == a.contact.tolist()


def test_keys_of_a_phase_give_it_back():
    rng = np.random.default_rng(0)
    phase = np.cumsum(rng.uniform(0.01, 0.06, 200)) + 0.3
    back = phase_of_keys(keys_of_phase(phase), 200)
    np.testing.assert_allclose(back, phase - np.floor(phase[0]), atol=0.05)


def test_landings_that_no_contact_shows_are_filled_in():
    foot = np.zeros(200)
    for start in (10, 40, 100, 130, 160):  # 70 is missing
        foot[start : start + 12] = 1
    keys = [k for k, _ in rule_keys(foot, np.ones(200, bool), [])]
    assert any(abs(k - 70) <= 1 for k in keys) and {40, 100, 130, 160} <= set(keys)


@pytest.fixture
def folder(tmp_path):
    bvh_writer.write_bvh(tmp_path / "walk.bvh", *walk(2.0, 0.0, 2.2))
    (tmp_path / "deep").mkdir()
    bvh_writer.write_bvh(tmp_path / "deep" / "sit.bvh", *sit())
    return tmp_path


def test_the_command_writes_sidecars_and_pictures_and_keeps_edits(folder, capsys):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    assert main(["annotate", str(folder)]) == 0
    path = folder / "walk.nsm.toml"
    assert (folder / "walk.nsm.png").stat().st_size > 10_000 and (folder / "deep" / "sit.nsm.toml").exists()
    first = path.read_text()
    assert first.startswith("#") and "[actions.walk]" in first
    assert sidecar.read_sheet(path).edited() == []
    assert main(["annotate", str(folder), "--no-pictures"]) == 0
    assert path.read_text() == first  # the same proposal, the same file
    capsys.readouterr()

    sheet = sidecar.read_sheet(path)
    mine = first.replace(
        "[actions.carry]", "# a tray, unseen\n[actions.carry]\n20=0\n30 = 1.0\n60 = 1\n70 = 0"
    )
    path.write_text(mine.replace("[contacts.Hips]", "[contacts.Hips]\n5 = 1\n9 = 0"))
    for _ in range(2):  # still known as theirs the second time
        assert main(["annotate", str(folder), "--no-pictures"]) == 0
        assert "walk.bvh: 5.6 s" in (said := capsys.readouterr().out) or "kept your" in said
        assert "kept your actions.carry, contacts.Hips" in said
        again = sidecar.read_sheet(path)
        assert again.actions["carry"] == [(20, 0.0), (30, 1.0), (60, 1.0), (70, 0.0)]
        assert again.actions["walk"] == sheet.actions["walk"]
    a = arrays_of(sidecar.read_sheet(path))
    assert a.style[45, CARRY] == 1 and a.contact[6, HIP_CONTACT] == 1 and a.contact[10, HIP_CONTACT] == 0
    assert main(["annotate", str(folder), "--no-pictures", "--overwrite"]) == 0
    assert path.read_text() == first


def test_a_deleted_section_stays_deleted(folder):
    main(["annotate", str(folder), "--no-pictures"])
    path = folder / "deep" / "sit.nsm.toml"
    sheet = sidecar.read_sheet(path)
    sidecar_writer.write_sheet(path, replace(sheet, actions=sheet.actions | {"sit": []}))
    main(["annotate", str(folder), "--no-pictures"])
    assert not arrays_of(sidecar.read_sheet(path)).style[:, SIT].any()
    assert all(g.action != "sit" for g in sidecar.read_sheet(path).goals)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[actions.walk]", "[actions.dance]", r"\[actions.dance\] is not known"),
        ("[actions.walk]", "[actions.walk]\n9999 = 1", "'9999' is no frame of this clip"),
        ("[actions.walk]", "[actions.walk]\n3 = 7", "frame 3 has the value 7"),
        ("[actions.walk]", "[actions.walk]\n3 = = 1", r"not valid TOML: .*line \d+"),
        (
            "\n[proposal]",
            "\n[[goals]]\nframe = 3\naction = 'fly'\n[proposal]",
            "'fly' is no action of a goal",
        ),
        (
            "\n[proposal]",
            "\n[[goals]]\nframe = 3\naction = 'sit'\nkind = 'fixed'\n[proposal]",
            "kind must be static or dynamic",
        ),
        (
            "\n[proposal]",
            "\n[[goals]]\nframe = 3\naction = 'sit'\nkind = 'static'\n[proposal]",
            r"needs `place = \[x, y, z\]`",
        ),
        ("frames = ", "frame = ", "must say how many frames"),
    ],
)
def test_a_broken_sidecar_is_a_sentence_and_is_left_alone(folder, capsys, old, new, says):
    main(["annotate", str(folder), "--no-pictures"])
    path = folder / "walk.nsm.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(CaptureError, match=rf"walk\.nsm\.toml.*{says}.*\.$"):
        sidecar.read_sheet(path)
    assert main(["annotate", str(folder), "--no-pictures"]) == 1
    assert "walk.bvh: walk.nsm.toml" in capsys.readouterr().err
    assert path.read_text() == text.replace(old, new, 1)


def test_broken_captures_are_named_and_the_others_done(folder, capsys):
    (folder / "bad.bvh").write_text("HIERARCHY\n")
    assert main(["annotate", str(folder), "--no-pictures"]) == 1
    captured = capsys.readouterr()
    assert "bad.bvh: " in captured.err and "2 clips annotated, 1 not read" in captured.out


def test_a_sidecar_of_another_length_and_an_empty_folder(folder, tmp_path_factory, capsys):
    main(["annotate", str(folder), "--no-pictures"])
    bvh_writer.write_bvh(folder / "walk.bvh", *walk(2.0, 0.0, 3.2))
    assert main(["annotate", str(folder), "--no-pictures"]) == 1
    assert "--overwrite" in capsys.readouterr().err
    assert main(["annotate", str(tmp_path_factory.mktemp("none"))]) == 1
    assert "no BVH file lies in" in capsys.readouterr().err
