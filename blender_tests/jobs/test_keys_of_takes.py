"""What a take of a job file may ask for beyond its goals: variations, a bone map, how it begins
and how it is keyed.
"""

from __future__ import annotations

import json
from pathlib import Path

import bpy
import pytest
from foreign_rigs import MIXAMO, foreign_rig

from nsm_blender import batch
from nsm_blender.animation.channels import curves_in
from nsm_blender.jobs.read import read_job
from nsm_blender.rigs.bone_map import BoneMap
from nsm_blender.rigs.character import add_character
from nsm_blender.rigs.presets import save_preset
from nsm_core.body.key_reduction import Bound

IDLE = "goals = [{ action = 'idle', hold = 0.2 }]\n"


def write_job(folder: Path, *takes: str) -> Path:
    path = folder / "job.toml"
    path.write_text("\n".join(['scene = "room.blend"', *("[[take]]\n" + take for take in takes)]))
    return path


def take_of(folder: Path, text: str):
    return read_job(write_job(folder, text)).takes[0]


class TestVariations:
    def test_each_has_a_seed_and_files_of_its_own(self, tmp_path):
        job = write_job(
            tmp_path,
            'name = "sit"\nseed = 7\nvariations = 3\nout = "made/sit.blend"\nreport = "sit.json"\n' + IDLE,
            'name = "other"\n' + IDLE,
        )
        takes = read_job(job).takes
        assert [(t.name, t.seed, t.error) for t in takes] == [
            ("sit 1", 7, None), ("sit 2", 8, None), ("sit 3", 9, None), ("other", 0, None)
        ]  # fmt: skip
        assert [t.outputs["out"].name for t in takes[:3]] == ["sit-1.blend", "sit-2.blend", "sit-3.blend"]
        assert takes[1].outputs["report"] == tmp_path / "sit-2.json"

    def test_a_file_of_theirs_that_another_take_writes_is_refused(self, tmp_path):
        first, second = (
            'name = "a"\nvariations = 2\nreport = "a.json"\n' + IDLE,
            'name = "b"\nreport = "a-2.json"\n' + IDLE,
        )
        takes = read_job(write_job(tmp_path, first, second)).takes
        assert [t.error is None for t in takes] == [True, True, False]
        assert "the same file as 'report' of take 'a 2'" in takes[2].error

    @pytest.mark.parametrize(
        ("line", "words"),
        [
            ("variations = 0", "'variations' in take 'a' is 0; it must be a whole number from 1"),
            ("variations = 2.5", "'variations' in take 'a'"),
            ("variations = true", "'variations' in take 'a' is true"),
            ("variation = 2", "'variation' in take 'a' is unknown; the keys are name, character, "),
        ],
    )
    def test_what_is_wrong_is_one_take_with_one_sentence(self, tmp_path, line, words):
        takes = read_job(write_job(tmp_path, f'name = "a"\n{line}\n{IDLE}')).takes
        assert len(takes) == 1 and words in takes[0].error


class TestRig:
    @pytest.fixture
    def room(self, tmp_path) -> Path:
        """A rig whose names nothing tells."""
        foreign_rig({joint: f"b{i}" for i, joint in enumerate(MIXAMO)}, extra=False)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
        return tmp_path

    def run(self, folder: Path, rig: str) -> dict:
        text = f'name = "a"\ncharacter = "Rig"\nrig = "{rig}"\nreport = "a.json"\nout = "a.blend"\n{IDLE}'
        code = batch.main([str(write_job(folder, text))], [].append)
        report = json.loads((folder / "a.json").read_text())
        assert code == (1 if "error" in report else 0)
        return report

    def test_a_file_says_which_bones_they_are(self, room):
        joints = {joint: f"b{i}" for i, joint in enumerate(MIXAMO)}
        del joints["LeftToe"], joints["RightToe"]
        save_preset(room / "maps" / "mine.toml", BoneMap(joints))
        assert "error" not in self.run(room, "maps/mine.toml")
        bpy.ops.wm.open_mainfile(filepath=str(room / "a.blend"))
        data = bpy.data.objects["Rig"].animation_data
        moved = {curve.data_path for curve in curves_in(data.action, data.action_slot)}
        # The bones of the list have keys, and no others.
        assert moved and all(any(f'"{bone}"' in path for bone in joints.values()) for path in moved)

    @pytest.mark.parametrize(
        ("rig", "words"),
        [
            ("none", "There is no bone map 'none'; take one of"),
            ("none.toml", "none.toml cannot be read"),
            ("rigify_generated", "By the bone map rigify_generated: No bone of Rig was found for"),
        ],
    )
    def test_what_does_not_fit_is_told_in_a_sentence(self, room, rig, words):
        assert words in self.run(room, rig)["error"]


class TestStart:
    @pytest.mark.parametrize("line", ['start = "sitting"', "start = 3", "start = ['pose']"])
    def test_another_word_is_refused(self, tmp_path, line):
        error = take_of(tmp_path, f'name = "a"\n{line}\n{IDLE}').error
        assert error.startswith("'start' in take 'a' is") and error.endswith(
            'it must be "stand", "pose" or "fill".'
        )

    def test_pose_goes_on_from_the_pose_at_the_start_frame(self, tmp_path):
        character = add_character((0.0, 0.0, 0.0))
        head = character.pose.bones["Head"]
        head.rotation_mode = "XYZ"
        head.rotation_euler = (0.0, 0.6, 0.0)
        head.keyframe_insert("rotation_euler", frame=10)
        character.pose.bones["Hips"].keyframe_insert("location", frame=10)
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
        turned = {}
        for start in ("stand", "pose"):
            line = f'name = "a"\nstart_frame = 10\nstart = "{start}"\nout = "{start}.blend"\n'
            assert batch.main([str(write_job(tmp_path, line + IDLE))], [].append) == 0
            bpy.ops.wm.open_mainfile(filepath=str(tmp_path / f"{start}.blend"))
            bpy.context.scene.frame_set(10)
            turned[start] = bpy.data.objects["Character"].pose.bones["Head"].matrix.to_3x3()
        assert (turned["pose"].inverted() @ turned["stand"]).to_quaternion().angle > 0.4


class TestKeys:
    def test_root_motion_and_the_bound_of_fewer_keys(self, tmp_path):
        for text, reduce in (
            ("8", Bound(8.0)),
            ("{ mm = 2.5, degrees = 3 }", Bound(2.5, 3.0)),
            ("{}", Bound()),
        ):
            take = take_of(tmp_path, f'name = "a"\nroot_motion = "object"\nreduce = {text}\n{IDLE}')
            assert (take.error, take.root_motion, take.reduce) == (None, "object", reduce)
        assert take_of(tmp_path, f'name = "a"\n{IDLE}').reduce is None

    @pytest.mark.parametrize(
        ("line", "words"),
        [
            ('root_motion = "legs"', '"hips", "object", "bone" or "in_place"'),
            ("reduce = true", "'reduce' in take 'a' is true; it must be a number"),
            ("reduce = 0", "'reduce' in take 'a' is 0"),
            ("reduce = { cm = 1 }", "'cm' in 'reduce' in take 'a' is unknown; the keys are mm, degrees"),
            ("reduce = { degrees = 400 }", "'degrees' of 'reduce' in take 'a' is 400"),
        ],
    )
    def test_what_is_wrong_with_them_is_told_in_a_sentence(self, tmp_path, line, words):
        assert words in take_of(tmp_path, f'name = "a"\n{line}\n{IDLE}').error

    def test_they_come_to_the_keys(self, tmp_path):
        add_character((0.0, 0.0, 0.0))
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
        line = 'name = "a"\nroot_motion = "object"\nreduce = 5\nout = "a.blend"\n'
        assert batch.main([str(write_job(tmp_path, line + IDLE))], [].append) == 0
        bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
        data = bpy.data.objects["Character"].animation_data
        curves = list(curves_in(data.action, data.action_slot))
        assert "location" in {curve.data_path for curve in curves}
        first, last = data.action.frame_range
        assert min(len(curve.keyframe_points) for curve in curves) < (last - first) / 2
