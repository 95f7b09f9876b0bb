"""Containers: parts that open by one number, clear of what stands, and boards that they shut away."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.errors import GeometryError
from nsm_core.world.scene.containers import MovingPart, moving_part
from nsm_core.world.scene.containers.cupboards import CUPBOARDS, make_container
from nsm_core.world.scene.solids import Scene
from nsm_core.world.scene.wrist import TO_HELD

PLACE = (1.0, -2.0, 0.3, 0.7)


def points_in(part: MovingPart, count: int = 60) -> np.ndarray:
    """Points just inside a part's boxes, its frame when shut."""
    boxes = part.query.groups[0]
    share = np.random.default_rng(0).uniform(-0.98, 0.98, (count, 1, 3))
    return (boxes.centres + boxes.halves * share).reshape(-1, 3)


@pytest.fixture(scope="module")
def everything():
    rng = np.random.default_rng(1)
    made = [make_container(kind, rng).put(PLACE) for kind in CUPBOARDS for _ in range(3)]
    return [*made, make_container("wall cupboard", rng, sliding=1).put(PLACE)]


def test_parts_open_without_touching_what_stands_or_each_other(everything):
    kinds = set()
    for container in everything:
        standing = container.standing()
        for part in container.parts:
            kinds.add(part.kind)
            others = [p for p in container.parts if p is not part]
            points = points_in(part)
            for opening in (0.0, 0.1, 0.4, 0.7, 1.0):
                part.opening = opening
                world = part.to_world(points).astype(np.float32)
                assert standing.signed_distance(world, 0.1).min() > -1e-4, (
                    container.kind,
                    part.name,
                    opening,
                )
                assert all(o.signed_distance(world, 0.1).min() > -1e-4 for o in others)
                assert (part.signed_distance(world, 0.1) < 0).all()
            part.opening = 0.0
    assert kinds == {"hinged", "drawer", "sliding", "lid"}


def test_a_grip_follows_its_handle_and_comes_from_outside(everything):
    for container in everything:
        for part in container.parts:
            for opening in (0.0, 0.5, 1.0):
                grip = part.grip(opening)
                np.testing.assert_allclose(grip.held, part.to_world(part.handle, opening=opening), atol=1e-9)
                assert np.linalg.norm(grip.place - grip.held) == pytest.approx(TO_HELD)
                np.testing.assert_allclose(grip.rotation.T @ grip.rotation, np.eye(3), atol=1e-9)
                part.opening = opening
                near = part.signed_distance(np.stack((grip.held, grip.place)).astype(np.float32), 0.5)
                assert near[0] < 0.01 and near[1] > 0.05  # on the bar, and the wrist clear of the front
            part.opening = 0.0


def test_turning_and_sliding_follow_axis_and_travel():
    box = np.array(((0.0, 0.0, 0.0),)), np.array(((0.4, 0.02, 0.6),))
    bounds = box[0][0], box[1][0]
    door = moving_part("door", "hinged", box, bounds, (0, 0, -2), (0, 0, 0), np.pi / 2, (0.36, -0.04, 0.3))
    np.testing.assert_allclose(door.to_world((0.4, 0.0, 0.5), opening=1.0), (0, -0.4, 0.5), atol=1e-12)
    drawer = moving_part("drawer", "drawer", box, bounds, (0, -1, 0), (0, 0, 0), 0.3, (0.2, -0.04, 0.3))
    np.testing.assert_allclose(drawer.to_world((0.1, 0.0, 0.2), opening=0.5), (0.1, -0.15, 0.2), atol=1e-12)
    lid = moving_part("lid", "lid", box, bounds, (-1, 0, 0), (0, 0, 0), np.pi / 2, (0.2, -0.3, 0.0))
    np.testing.assert_allclose(lid.to_world((0.1, -0.3, 0.0), opening=1.0), (0.1, 0, 0.3), atol=1e-12)
    for part in (door, drawer, lid):
        part.opening, part.pose = 0.7, np.array(PLACE)
        points = np.random.default_rng(2).normal(size=(20, 3))
        np.testing.assert_allclose(part.to_local(part.to_world(points)), points, atol=1e-12)
        np.testing.assert_allclose(part.sensed().centre, part.to_world(part.volume.centre), atol=1e-5)
    with pytest.raises(GeometryError, match="Nothing opens as 'rolling'"):
        moving_part("shutter", "rolling", box, bounds, (0, 0, 1), (0, 0, 0), 1, (0, 0, 0))
    with pytest.raises(GeometryError, match="no axis or no way"):
        moving_part("door", "hinged", box, bounds, (0, 0, 0), (0, 0, 0), 1, (0, 0, 0))


def test_boards_are_free_and_told_apart_by_what_shuts_them(everything):
    for container in everything:
        standing = container.standing()
        for board in container.boards:
            assert (board.size > 0.1).all() and board.room > 0.05
            middle = np.array((*(board.low + board.high) / 2, board.height))
            above = container.to_world(middle + (0, 0, min(board.room / 2, 0.08)))
            assert standing.signed_distance(above[None].astype(np.float32), 0.5)[0] > 0.02
            inside = middle + (0.4 * board.size[0], 0, 0.05)
            shut = container.shut_by(board, inside)
            if container.kind in ("rack", "worktop"):
                assert shut == []
            else:
                assert len(shut) == 1
                if not board.rides:
                    container.part(shut[0]).opening = 1.0
                    assert container.shut_by(board, inside) == []
                    container.part(shut[0]).opening = 0.0


def test_a_part_is_a_prop_of_a_scene():
    drawers = make_container("drawers", np.random.default_rng(0)).put(PLACE)
    part = drawers.parts[0]
    scene = Scene(drawers.standing(), drawers.parts)
    part.opening = 1.0
    at = part.to_world(part.handle)[None].astype(np.float32)
    assert scene.but().signed_distance(at, 0.2)[0] < 0.01 < scene.but(part).signed_distance(at, 0.2)[0]
    near = scene.near(at[0, :2], 0.1, part)
    assert near.signed_distance(at, 0.2)[0] > 0.01


def test_containers_repeat_by_seed_and_refuse_what_they_do_not_know():
    a, b = (make_container("fridge", np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(a.piece.mins, b.piece.mins)
    with pytest.raises(GeometryError, match="no container of the kind 'safe'"):
        make_container("safe", np.random.default_rng(0))
    with pytest.raises(GeometryError, match="no measure colour"):
        make_container("rack", np.random.default_rng(0), colour=1)
    with pytest.raises(GeometryError, match="no window to open; it has door"):
        a.part("window")
