"""What opens of furniture, found from its parts: the furniture of known parts is the truth."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.commands.containers import told, whole_objects
from nsm_core.errors import GeometryError
from nsm_core.world.affordances.opening_parts import opening_parts
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.scene.containers.cupboards import CUPBOARDS, make_container
from nsm_core.world.scene.furniture import box_mesh


def mesh_of(part, skip=slice(None)):
    boxes = part.query.groups[0]
    return box_mesh((boxes.centres - boxes.halves)[skip], (boxes.centres + boxes.halves)[skip])


def parts_of(container, rename=str):
    body = ("body", container.piece.vertices, container.piece.triangles)
    return [body, *((rename(p.name), *mesh_of(p)) for p in container.parts)]


def containers():
    rng = np.random.default_rng(3)
    made = [make_container(kind, rng) for kind in CUPBOARDS for _ in range(2)]
    return [c for c in [*made, make_container("wall cupboard", rng, sliding=1)] if c.parts]


@pytest.mark.parametrize("named", [True, False])
def test_axes_handles_and_ranges_are_found_again(named):
    for container in containers():
        if not named and container.kind in ("oven", "bin"):
            continue  # a lid is told from a worktop by its name alone
        names = str if named else (lambda name: f"Cube.{sum(map(ord, name)):03d}")
        found = opening_parts(parts_of(container, names))
        assert len(found) == len(container.parts), container.kind
        for truth, one in zip(container.parts, found, strict=True):
            part = one.part
            assert part.kind == truth.kind and one.names == [names(truth.name)]
            np.testing.assert_allclose(part.axis, truth.axis, atol=1e-9)
            np.testing.assert_allclose(part.handle, truth.handle, atol=0.025)
            assert 0.75 * truth.travel < part.travel < 1.25 * truth.travel
            if part.turns:  # the same line, wherever on it the pivot is
                off = part.pivot - truth.pivot
                assert np.linalg.norm(off - (off @ truth.axis) * truth.axis) < 0.01


def test_handles_of_their_own_go_with_their_front_and_tell_its_hinge():
    cupboard = make_container("floor cupboard", np.random.default_rng(1), width=0.45)
    door = cupboard.parts[0]
    parts = [("body", cupboard.piece.vertices, cupboard.piece.triangles)]
    parts += [("Cube.001", *mesh_of(door, slice(0, 1))), ("Knob", *mesh_of(door, slice(1, None)))]
    (found,) = opening_parts(parts)
    assert found.names == ["Cube.001", "Knob"]
    np.testing.assert_allclose(found.part.axis, door.axis)
    np.testing.assert_allclose(found.part.handle, door.handle, atol=0.025)
    # Without a handle, the side is told by the name.
    for name, hinge in (("door left", -1), ("DoorRight", 1)):
        (found,) = opening_parts([parts[0], (name, *mesh_of(door, slice(0, 1)))])
        assert found.part.axis[2] == hinge


def test_a_part_goes_no_farther_than_it_can():
    fridge = make_container("fridge", np.random.default_rng(2))
    truth = fridge.parts[0]
    parts, edge = parts_of(fridge), float(truth.pivot[0])
    free = opening_parts(parts)[0].part.travel
    # A wall well off the hinge leaves it its way; a table before it does not.
    beside = Cuboids([((edge + np.sign(edge) * 0.4, 0), 0.0, [(-0.05, -2, 0)], [(0.05, 0.5, 2)])])
    table = Cuboids([((0, -0.8), 0.0, [(-0.4, -0.1, 0)], [(0.4, 0.1, 1.0)])])
    assert opening_parts(parts, beside)[0].part.travel == pytest.approx(free)
    assert opening_parts(parts, table)[0].part.travel < 0.5 * free


def test_what_does_not_open_is_told_and_materials_are_joined():
    rack = make_container("rack", np.random.default_rng(0))
    with pytest.raises(GeometryError, match="Nothing of it looks as if it opened"):
        opening_parts(parts_of(rack))
    drawers = make_container("drawers", np.random.default_rng(0))
    body, first = parts_of(drawers)[:2]
    half = len(body[2]) // 2
    apart = [("body_a1b2c3", body[1], body[2][:half]), ("body_00ff00", body[1], body[2][half:]), first]
    joined = whole_objects(apart)
    assert [name for name, _, _ in joined] == ["body", first[0]] and len(joined[0][2]) == len(body[2])
    (found,) = opening_parts(joined)
    assert told(found.part).startswith("drawer, opens ") and " cm, handle at " in told(found.part)
