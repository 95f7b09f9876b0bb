"""Sheets are drawn at the promised width, show every pose once, and say what is wrong."""

from __future__ import annotations

import numpy as np
import pytest
from walks import synthetic_walk

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.control.goals import Goal
from nsm_core.control.take import TakeRequest, TakeResult
from nsm_core.errors import GeometryError, OutputError
from nsm_core.evaluation.pictures.drawing import box_corners
from nsm_core.evaluation.pictures.figures import VIEWS, figure_sheet, path_sheet
from nsm_core.evaluation.pictures.sheets import prop_corners, sheet
from nsm_core.rotations import heading_to_direction
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene import furniture
from nsm_core.world.scene.furniture import carried_box

image = pytest.importorskip("matplotlib.image")


@pytest.fixture(scope="module")
def walk() -> np.ndarray:
    hips, local, _ = synthetic_walk(90, heading=0.7)
    return forward_kinematics(hips, local)[0]


def is_near(pixels: np.ndarray, rgb: tuple[int, int, int]) -> np.ndarray:
    return np.abs(pixels[..., :3] - np.array(rgb) / 255).max(-1) < 0.03


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("follow", [True, False])
def test_sheet_shows_every_pose(walk, tmp_path, view, follow):
    boxes = box_corners(walk[40, 0, :2], 0.7, np.array(((-0.3, -0.3, 0),)), np.array(((0.3, 0.3, 0.45),)))
    path = figure_sheet(
        walk,
        tmp_path / "a" / "sheet.png",
        every=9,
        view=view,
        boxes=boxes,
        tiles=5,
        follow=follow,
        title="walk",
    )
    pixels = image.imread(path)
    assert pixels.shape[1] in (1599, 1600, 1601)
    top = 30
    red = is_near(pixels, (0xD9, 0x38, 0x1E))
    height = (pixels.shape[0] - top) / 2
    for tile in range(10):
        row, column = divmod(tile, 5)
        part = red[int(top + row * height) : int(top + (row + 1) * height), column * 320 : (column + 1) * 320]
        assert part.sum() > 20, f"tile {tile} holds no right limb"


def test_right_limbs_are_on_our_left_seen_from_the_front(walk, tmp_path):
    pixels = image.imread(figure_sheet(walk[:1], tmp_path / "front.png", view="front", camera="character"))
    red, blue = is_near(pixels, (0xD9, 0x38, 0x1E)), is_near(pixels, (0x1F, 0x6F, 0xB4))
    assert np.nonzero(red)[1].mean() < np.nonzero(blue)[1].mean()


def test_contacts_draw_rings(walk, tmp_path):
    plain = image.imread(figure_sheet(walk, tmp_path / "a.png", every=30))
    ringed = image.imread(figure_sheet(walk, tmp_path / "b.png", every=30, contacts=np.ones((len(walk), 5))))
    assert plain.shape == ringed.shape and not np.array_equal(plain, ringed)


def test_plan_shows_feet_furniture_and_goals(walk, tmp_path):
    boxes = np.array((((1.0, -1, 0), (1.5, -0.5, 0.5)),))
    pixels = image.imread(
        path_sheet(walk, tmp_path / "plan.png", boxes=boxes, goals=np.array((2.0, -2.0, 0.0)), title="plan")
    )
    assert is_near(pixels, (0xD9, 0x38, 0x1E)).sum() > 50 and is_near(pixels, (0x1F, 0x6F, 0xB4)).sum() > 50
    assert is_near(pixels, (0xF4, 0xB4, 0x00)).sum() > 10


def test_box_corners_turn_with_the_object():
    corners = box_corners(np.array((1.0, 2.0)), np.pi / 2, np.array((0.0, -1, 0)), np.array((1.0, 0, 1)))
    assert corners.shape == (1, 8, 3)
    assert np.allclose(corners.min((0, 1)), (1, 2, 0)) and np.allclose(corners.max((0, 1)), (2, 3, 1))


def test_colliders_can_be_drawn_as_they_are(walk, tmp_path):
    where, low, high = np.array((1.0, 2.0)), np.array((-0.3, -0.2, 0)), np.array((0.3, 0.2, 0.5))
    as_corners = figure_sheet(
        walk, tmp_path / "a.png", every=30, follow=False, boxes=box_corners(where, 0.4, low, high)
    )
    as_query = figure_sheet(
        walk, tmp_path / "b.png", every=30, follow=False, boxes=Cuboids([(where, 0.4, low, high)])
    )
    assert np.allclose(image.imread(as_corners), image.imread(as_query), atol=0.02)


def test_what_moves_is_drawn_where_it_is(walk, tmp_path):
    box = carried_box(furniture.make("crate", np.random.default_rng(0)), (*walk[0, 0, :2], 0.6, 0.7))
    poses = np.repeat(box.pose[None], len(walk), 0)
    poses[:, :2] = walk[:, 0, :2] + 0.4 * heading_to_direction(np.array(0.7))
    corners = prop_corners(box, poses)
    assert corners.shape == (len(walk), 1, 8, 3)
    assert np.allclose(corners.mean((1, 2)), poses[:, :3]) and np.allclose(
        np.ptp(corners[0, 0], 0)[2], box.size[2], atol=1e-5
    )
    purple = (0x7A, 0x3F, 0xA0)
    for view in ("side", "front"):
        held = image.imread(
            figure_sheet(walk, tmp_path / "held.png", every=30, tiles=3, view=view, moving=corners)
        )
        left = corners.copy()
        left[31:] += 5.0  # out of the window from then on
        gone = image.imread(
            figure_sheet(walk, tmp_path / "gone.png", every=30, tiles=3, view=view, moving=left)
        )
        thirds = [slice(k * held.shape[1] // 3, (k + 1) * held.shape[1] // 3) for k in range(3)]
        assert all(is_near(held[:, t], purple).sum() > 5 for t in thirds)
        assert [is_near(gone[:, t], purple).sum() > 5 for t in thirds] == [True, True, False]
    with pytest.raises(GeometryError, match="moves"):
        figure_sheet(walk, tmp_path / "x.png", moving=corners[:3])


def test_one_sheet_shows_side_and_front(walk, tmp_path):
    hips, local, contacts = synthetic_walk(90, heading=0.7)
    still = furniture.cuboids([(furniture.make("table", np.random.default_rng(0)), np.array((2.0, 0)), 0.0)])
    asked = TakeRequest(np.zeros(2), 0.7, [Goal("walk", "place", np.array((2.0, -2.0, 0)), 0.7)], still)
    contacts = np.concatenate((np.zeros((90, 3)), contacts), axis=1)
    root = np.concatenate((hips[:, :2], np.full((90, 1), 0.7)), axis=1)
    take = TakeResult(hips, local, hips, local, contacts, root, np.zeros((90, 7)), np.zeros((90, 8)), [], {})
    pixels = image.imread(sheet(asked, take, tmp_path / "walk.png", "walk", rows=1))
    single = image.imread(figure_sheet(walk, tmp_path / "one.png", tiles=12, rows=1, title="walk"))
    assert abs(pixels.shape[1] - 1600) < 2 and pixels.shape[0] > 1.5 * single.shape[0]
    assert [p.name for p in sorted(tmp_path.iterdir())] == ["one.png", "walk.png"]


def test_wrong_input_is_said_plainly(walk, tmp_path):
    with pytest.raises(GeometryError, match="side, front"):
        figure_sheet(walk, tmp_path / "x.png", view="back")
    with pytest.raises(GeometryError, match="23"):
        figure_sheet(walk[0], tmp_path / "x.png")
    with pytest.raises(GeometryError, match="corners"):
        figure_sheet(walk, tmp_path / "x.png", boxes=np.zeros((1, 5)))
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match="folder"):
        figure_sheet(walk[:1], tmp_path / "file" / "x.png")
