"""Reading scenes: what is read once, in slices beside the window, and of thousands of objects."""

from __future__ import annotations

import threading
import time

import bpy
import numpy as np
import pytest
from colliders_now import gather_colliders
from crates import crate
from mathutils import Matrix
from scenes import box, empty, furnish

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, prepare
from nsm_blender.world.beside import beside, freely
from nsm_blender.world.bvh_query import BVHQuery
from nsm_blender.world.evaluated import Snapshot
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.ground import floor_under
from nsm_blender.world.solids import READINGS, Solid, solids_of
from nsm_blender.world.surroundings import Surroundings
from nsm_core.errors import GoalError

pytestmark = pytest.mark.usefixtures("nothing_read_before")


class TestReadOnce:
    def test_the_next_take_reads_nothing_anew(self):
        seat, _ = furnish()
        crate("Crate", 2)
        spec = TakeSpec(add_character((3, -2, 0)), [GoalSpec("sit", seat)])
        first = finish(prepare(spec, bpy.context.scene))[0]
        read = len(READINGS)
        second = finish(prepare(spec, bpy.context.scene))[0]
        # Chair and crate, scene and goal alike.
        assert second.environment is first.environment and len(READINGS) == read == 2

    def test_a_moved_turned_or_scaled_object_is_not_read_again_but_stands_where_it_is(self):
        made = crate("Crate")
        gather_colliders(bpy.context.scene)
        read = len(READINGS)
        made.location, made.rotation_euler.z = (3, 1, 0), 0.7
        bpy.context.view_layer.update()
        query = gather_colliders(bpy.context.scene)
        assert len(READINGS) == read
        inside = made.matrix_world @ made.data.vertices[0].co.lerp(made.data.vertices[7].co, 0.5)
        assert query.signed_distance(
            np.array((inside, (0.4, 0.4, 0.4)), np.float32), 0.3
        ).tolist() == pytest.approx([-0.3, 0.3])

    def test_an_edit_is_seen(self):
        made = crate("Crate")
        point = np.array(((0.9, 0.4, 0.4),), np.float32)
        assert gather_colliders(bpy.context.scene).signed_distance(point, 0.5)[0] == pytest.approx(
            0.1, abs=1e-5
        )
        for v in made.data.vertices:
            if v.co.x > 0.5:
                v.co.x = 0.6
        made.data.update()
        bpy.context.view_layer.update()
        assert gather_colliders(bpy.context.scene).signed_distance(point, 0.5)[0] == pytest.approx(
            0.3, abs=1e-5
        )

    def test_the_cache_is_bounded(self):
        from nsm_core.world.geometry.mesh_reading import Reading, Readings

        few = Readings(100_000)
        for size in range(1, 30):
            few.get(
                (size,),
                lambda size=size: Reading.of(
                    np.array(((0, 0, 0), (size, 0, 0), (0, size, 0))), np.array(((0, 1, 2),))
                ),
            )
        assert 1 <= len(few) < 29 and few.get((29,), None) is not None


class TestBesideTheWindow:
    def test_the_reading_says_how_far_it_is(self):
        seat, _ = furnish()
        for i in range(12):
            made = box(f"Crate {i}", (2 + i, 3, 0), (2.4 + i, 3.5 + 0.01 * i, 0.9))
            made.modifiers.new("Dense", "SUBSURF").levels = 4
        steps = prepare(TakeSpec(add_character((1.5, -2, 0)), [GoalSpec("sit", seat)]), bpy.context.scene)
        seen = [(p.stage, p.fraction) for p in steps]
        stages = list(dict.fromkeys(stage for stage, _ in seen))
        assert stages[0] == "Reading the scene" and all(0 <= f <= 1 for _, f in seen)
        fractions = [f for stage, f in seen if stage == "Reading the scene"]
        assert fractions == sorted(fractions) and fractions[-1] > 0

    def test_it_reads_the_first_frame_whatever_the_window_shows_meanwhile(self):
        made, seat = crate("Mover", 4), furnish()[0]
        for frame, x in ((1, 0.0), (50, 5.0)):
            made.location.x = x
            made.keyframe_insert("location", frame=frame)
        scene = bpy.context.scene
        scene.frame_set(50)
        steps = prepare(TakeSpec(add_character((1.5, -2, 0)), [GoalSpec("sit", seat)], start_frame=1), scene)
        while True:
            try:
                next(steps)
                scene.frame_set(50)
            except StopIteration as stop:
                request = stop.value[0]
                break
        (mover,) = request.movers  # what moves is known by itself, where it is at the first frame
        there = np.array(((4.4, 0.4, 0.4),), np.float32)
        assert mover.distance_at(0, there, 0.3)[0] < 0 < mover.distance_at(60, there, 0.3)[0]
        assert scene.frame_current == 50

    def test_giving_up_ends_the_work_and_puts_the_frame_back(self):
        seat, _ = furnish()
        scene = bpy.context.scene
        scene.frame_set(7)
        steps = prepare(TakeSpec(add_character((1.5, -2, 0)), [GoalSpec("sit", seat)]), scene)
        next(steps)
        next(steps)
        steps.close()
        assert scene.frame_current == 7

    def test_what_the_work_raises_is_raised_where_it_is_waited_for(self):
        def work(_):
            raise GoalError("It cannot be done.")

        with pytest.raises(GoalError, match="cannot be done"):
            list(beside(work))

    def test_work_that_touches_blender_runs_only_while_the_window_waits(self):
        window, clashes, free = threading.Event(), [], []

        def work(tell):
            for i in range(20):
                for _ in range(50):
                    clashes.append(window.is_set())
                    time.sleep(0)
                with freely():
                    time.sleep(0.004)
                    free.append(window.is_set())
                tell(i / 20)
            return "made"

        steps, told = beside(work, touches=True), []
        while True:
            try:
                told.append(next(steps))
            except StopIteration as stop:
                assert stop.value == "made"
                break
            window.set()
            time.sleep(0.003)
            window.clear()
        assert not any(clashes) and any(free) and told == sorted(told) and len(told) > 3

    def test_work_that_nobody_waits_for_touches_nothing_more(self):
        after, reached = threading.Event(), threading.Event()

        def work(tell):
            with freely():
                reached.set()
                time.sleep(0.05)
            after.set()

        steps = beside(work, touches=True)
        while not reached.is_set():
            next(steps)
        steps.close()
        time.sleep(0.15)
        assert not after.is_set()

    def test_without_a_thread_freely_changes_nothing(self):
        with freely():
            assert BVHQuery([]).signed_distance(np.zeros((3, 3)), 0.2).tolist() == pytest.approx([0.2] * 3)


def test_a_snapshot_holds_what_was_there():
    made = crate("Crate")
    around = Surroundings(
        bpy.context.scene, WorldFrame(), snapshot=Snapshot.now(bpy.context.evaluated_depsgraph_get())
    )
    bpy.data.objects.remove(made)
    assert around.query.nearest(np.array(((0.4, 0.4, 0.4), (3, 3, 3))), 0.2) == ["Crate", None]


class TestThousandsOfObjects:
    def test_the_floor_is_that_under_the_rug_one_stands_on(self):
        rug = box("Rug", (-1, -1, 0), (1, 1, 0.03))
        for k in range(40):
            box(f"Tile {k}", (3 + k, 0, 0), (3.5 + k, 0.5, 0.03))
        empty("Mark", (0, 0, 0))
        bpy.context.view_layer.update()
        scene, here = bpy.context.scene, np.array((0.5, 0.5, 0.03))
        assert floor_under(here, 1.0, scene, ()) == pytest.approx(0.0, abs=1e-6)
        assert floor_under(here, 1.0, scene, [rug]) == pytest.approx(0.03)
        assert floor_under(np.array((2.0, 0.5, 0.03)), 1.0, scene, ()) == pytest.approx(0.03)
        rug.hide_set(True)
        assert floor_under(here, 1.0, scene, ()) == pytest.approx(0.03)

    def test_boxes_of_many_at_once_are_those_of_each(self):
        mesh = crate("Crate").data
        for k in range(30):
            copy = bpy.data.objects.new(f"Copy {k}", mesh)
            turn = Matrix.Rotation(0.3 * k, 4, (1, k, 2))
            copy.matrix_world = Matrix.Translation((k, 2 * k, 0.1 * k)) @ turn @ Matrix.Scale(1 + k / 7, 4)
            bpy.context.scene.collection.objects.link(copy)
        bpy.context.view_layer.update()
        seen = Snapshot.now(bpy.context.evaluated_depsgraph_get()).seen
        for solid in solids_of(seen, WorldFrame()):
            (low, high), corners = solid.bounds, solid.vertices
            assert (low <= corners.min(0) + 1e-6).all() and (high >= corners.max(0) - 1e-6).all()
            assert solid.top_at_least <= corners[:, 2].max() + 1e-6
            alone = Solid(solid.owner, solid.reading, solid.turn, solid.size, solid.origin)
            assert np.allclose(alone.bounds, solid.bounds) and alone.top_at_least == pytest.approx(
                solid.top_at_least
            )
