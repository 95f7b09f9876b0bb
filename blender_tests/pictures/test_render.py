"""Pictures of a take: the files, what is on them, and the scene afterwards."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import bpy
import numpy as np
import pytest

from nsm_blender.demo_scene.room import build_room
from nsm_blender.demo_scene.room_props import box
from nsm_blender.keys.keyed import KeyedTake
from nsm_blender.keys.keying import key_take
from nsm_blender.pictures import render
from nsm_blender.pictures.camera import path_of
from nsm_blender.pictures.labels import stamp
from nsm_blender.pictures.viewpoint import Views, choose_views
from nsm_blender.rigs.character import add_character
from nsm_core.body.skeleton import J
from nsm_core.errors import OutputError

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def take() -> KeyedTake:
    """A character that slides two metres in a third of a second."""
    character = add_character()
    bpy.context.scene.render.fps = 30
    local = np.zeros((11, J, 4))
    local[..., 0] = 1
    hips = np.column_stack((np.linspace(0, 2, 11), np.zeros(11), np.full(11, 0.97)))
    return key_take(character, hips, local, frame_start=20)


def settings(scene: bpy.types.Scene) -> dict:
    """Everything of a scene's settings that could be seen to change."""
    found = {}
    render, display = scene.render, scene.display
    owners = (
        scene,
        render,
        render.image_settings,
        render.ffmpeg,
        display,
        display.shading,
        scene.view_settings,
    )
    for owner in owners:
        label = type(owner).__name__
        for prop in owner.bl_rna.properties:
            if prop.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"} and not prop.is_readonly:
                value = getattr(owner, prop.identifier)
                found[label, prop.identifier] = tuple(value) if getattr(prop, "is_array", False) else value
    return found


def data_counts() -> dict[str, int]:
    """How many datablocks a render could leave behind; Blender's own "Render Result" aside."""
    counts = {name: len(getattr(bpy.data, name)) for name in ("objects", "cameras", "worlds", "actions")}
    return counts | {"images": sum(image.type != "RENDER_RESULT" for image in bpy.data.images)}


def test_a_contact_sheet_shows_the_character_in_every_tile(take, tmp_path):
    heard = []
    path = render.contact_sheet(
        take, tmp_path / "new folder" / "sheet", tiles=3, columns=3, size=(96, 80), progress=heard.append
    )
    assert path == tmp_path / "new folder" / "sheet.png"
    pixels = render.read_png(path)
    assert pixels.shape == (80, 3 * 96 + 2 * 4, 4)
    for k in range(3):
        tile = pixels[:60, k * 100 : k * 100 + 96, :3]  # below the label
        figure = np.abs(tile - tile[0, 0]).max(axis=-1) > 0.05
        assert figure[:, 38:58].mean() > 0.2, "the character is not in the middle"
        assert figure[:, :8].mean() < 0.05 and figure[:, -8:].mean() < 0.05, "the character is cut off"
    assert heard == pytest.approx([1 / 3, 2 / 3, 1])


def test_a_video_is_written_at_the_scene_rate(take, tmp_path):
    heard = []
    path = render.video(take, tmp_path / "take.mp4", size=(96, 54), step=2, progress=heard.append)
    assert path.read_bytes()[4:8] == b"ftyp"
    clip = bpy.data.movieclips.load(str(path))
    assert clip.frame_duration == 6 and clip.fps == pytest.approx(15, abs=0.01)
    assert tuple(clip.size) == (96, 54)
    assert heard[-1] == 1 and len(heard) == 6


def test_the_scene_is_as_it_was(take, tmp_path):
    scene = bpy.context.scene
    scene.frame_set(7)
    scene.render.resolution_percentage = 50
    scene.render.filepath = "//mine"
    before, camera, world = settings(scene), scene.camera, scene.world
    counts = data_counts()
    render.contact_sheet(take, tmp_path / "sheet.png", tiles=2, size=(64, 64))
    render.video(take, tmp_path / "take.mp4", size=(64, 64), step=5)
    assert settings(scene) == before
    assert (scene.camera, scene.world, scene.frame_current) == (camera, world, 7)
    assert data_counts() == counts


def test_a_place_that_cannot_be_written_is_refused_before_rendering(take, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(OutputError, match="cannot be written"):
        render.contact_sheet(take, tmp_path / "file" / "sheet.png")
    with pytest.raises(OutputError, match="choose another folder"):
        render.video(take, tmp_path / "file" / "take.mp4")


def views(take: KeyedTake, **how) -> Views:
    """Where a take is looked at from, at the usual distance."""
    scene = bpy.context.scene
    hips, facing = path_of(take, scene)
    return choose_views(take, scene, hips, facing, 5.0, **how)


def test_the_camera_avoids_walls(take):
    # Walls to -Y and to +X.
    for name, low, high in (("A", (-3, -1.2, 0), (4, -1.0, 3)), ("B", (2.6, -1.2, 0), (2.8, 4, 3))):
        box(name, low, high, None)
    bpy.context.view_layer.update()
    for seen in (views(take), views(take, frames=[20, 25, 30])):
        assert (seen.directions[:, 1] > -0.2).all() and (seen.directions[:, 0] < 0.3).all()
        assert seen.nearness == 1 and not seen.cutaway


def test_a_wished_side_is_kept_until_a_moving_board_stands_there(take):
    board = box("Board", (-3, -1.3, 0), (4, -1.2, 3), None)
    for frame, away in ((20, -21), (24, -21), (25, -1.2), (30, -1.2)):  # a leaf that swings before the camera
        board.location.y = away
        board.keyframe_insert("location", frame=frame)
    wish = (0.0, -1.0, 0.4)
    seen = views(take, wish=wish, frames=[20, 23, 27, 30])
    np.testing.assert_allclose(
        seen.directions[:4], np.tile(np.array(wish) / np.linalg.norm(wish), (4, 1)), atol=1e-6
    )
    assert (seen.directions[7:, 1] > -0.2).all()
    np.testing.assert_allclose(np.linalg.norm(views(take, wish=wish).directions, axis=1), 1, atol=1e-6)


def test_a_film_goes_round_softly(take):
    box("Wall", (-3, -1.2, 0), (4, -1.0, 3), None)
    bpy.context.view_layer.update()
    steps = np.linalg.norm(np.diff(views(take, wish=(1.0, -0.2, 0.3)).directions, axis=0), axis=1)
    assert (steps < 0.06).all(), "the camera jumps where it need not"


@pytest.mark.parametrize("half, cutaway", [(3.4, False), (1.2, True)], ids=["closed room", "closet"])
def test_who_is_shut_in_is_seen_from_within_or_through_a_wall(take, half, cutaway):
    box("Shell", (1 - half, -half, -0.1), (1 + half, half, 2.6), None)
    bpy.context.view_layer.update()
    seen = views(take, frames=[20, 25, 30])
    assert (seen.nearness < 1, seen.cutaway) == (not cutaway, cutaway)


def test_what_no_picture_shows_is_looked_through(take):
    wall = box("Helper", (-3, -1.2, 0), (4, -1.0, 3), None)
    wall.hide_render = True
    bpy.context.view_layer.update()
    wish = np.array((0.2, -1.0, 0.4)) / np.linalg.norm((0.2, -1.0, 0.4))
    np.testing.assert_allclose(views(take, wish=wish, frames=[25]).directions[5], wish, atol=1e-6)


def test_the_room_has_its_seats_in_reach_and_the_table_in_the_way():
    room = build_room()
    chair, table = bpy.data.objects["Chair"], bpy.data.objects["Table"]
    assert set(room.seats) <= set(room.objects) <= set(bpy.data.objects.keys())
    start, end = np.array(room.start), np.array(chair.location[:2])
    assert np.linalg.norm(end - start) == pytest.approx(4, abs=0.2)
    along = np.linspace(start, end, 50)
    inside = np.abs(along - np.array(table.location[:2])) < np.array(table.dimensions[:2]) / 2 - 0.1
    assert inside.all(axis=1).any(), "the straight way leads through the table"
    assert all(o.data.materials for o in bpy.data.objects if o.type == "MESH")


def test_only_what_the_driver_says_in_vain_is_kept_from_the_terminal():
    code = """import os, sys
from nsm_blender.pictures.studio import quiet
with quiet():
    os.write(2, b"EGL Error (0x3009): EGL_BAD_MATCH\\nout of memory\\n"); os.write(1, b"Fra:1 Mem:2\\n")
    print("said"); print("told", file=sys.stderr)
"""
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=True
    )
    assert "said\n" in done.stdout and "Fra:1" not in done.stdout
    assert "EGL" not in done.stderr and {"out of memory", "told"} <= set(done.stderr.splitlines())


def test_labels_are_written_dark_on_the_picture():
    picture = np.ones((40, 80, 4), np.float32)
    stamp(picture, "12.5s", size=2)
    assert 20 < (picture[..., 0] < 0.5).sum() < 1000 and picture[:15].min() == 1
