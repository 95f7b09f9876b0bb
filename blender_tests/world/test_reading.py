"""Reading scenes: what looks solid, what is read once, in slices beside the window, and what copies cost."""

from __future__ import annotations

import threading
import time

import bpy
import numpy as np
import pytest
from colliders_now import collider_shapes, gather_colliders
from mathutils import Matrix
from scenes import box, empty, furnish

from nsm_blender.goals.spec import GoalSpec
from nsm_blender.rigs.character import add_character
from nsm_blender.takes import TakeSpec, finish, generate, prepare
from nsm_blender.world import colliders
from nsm_blender.world.beside import beside, freely
from nsm_blender.world.bvh_query import BVHQuery
from nsm_blender.world.evaluated import MeshData, Snapshot
from nsm_blender.world.frame import WorldFrame
from nsm_blender.world.ground import floor_under
from nsm_blender.world.solids import READINGS, Solid, solids_of
from nsm_blender.world.surroundings import Surroundings
from nsm_core.errors import GeometryError, GoalError
from nsm_core.world.geometry.distance import Cuboids


@pytest.fixture(autouse=True)
def nothing_read_before():
    READINGS.clear()
    colliders.forget()


def names():
    bpy.context.view_layer.update()
    return sorted(s.owner for s in collider_shapes(bpy.context.scene, bpy.context.evaluated_depsgraph_get()))


def material(name, surface, volume):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    for wanted, kind, socket in (
        (surface, "ShaderNodeBsdfDiffuse", "Surface"),
        (volume, "ShaderNodeVolumePrincipled", "Volume"),
    ):
        if wanted:
            tree.links.new(tree.nodes.new(kind).outputs[0], output.inputs[socket])
    return made


def crate(name, x=0.0):
    return box(name, (x, 0, 0), (x + 0.8, 0.8, 0.8))


class TestWhatIsSolid:
    def test_what_is_seen_as_solid_in_the_viewport(self):
        looks = {
            "wire": lambda o: setattr(o, "display_type", "WIRE"),
            "bounds": lambda o: setattr(o, "display_type", "BOUNDS"),
            "fog": lambda o: o.data.materials.append(material("Fog", False, True)),
            "glass with fog": lambda o: o.data.materials.append(material("Both", True, True)),
            "glass beside fog": lambda o: [
                o.data.materials.append(material(n, n == "a", n == "b")) for n in "ab"
            ],
            "without a material": lambda o: o.data.materials.append(None),
            "held out": lambda o: setattr(o, "is_holdout", True),
            "not in renders": lambda o: setattr(o, "hide_render", True),
            "not for the camera": lambda o: setattr(o, "visible_camera", False),
            "hidden": lambda o: o.hide_set(True),
        }
        for i, (name, change) in enumerate(looks.items()):
            change(crate(name, i))
        assert names() == sorted(looks.keys() - {"wire", "bounds", "fog", "hidden"})

    def test_the_animators_word_wins_over_looks(self):
        for said in (True, False):
            for i, look in enumerate(("SOLID", "WIRE")):
                made = crate(f"{look} {said}", 2 * i + said)
                made.display_type, made["nsm_collider"] = look, said
        crate("hidden eye", 5)["nsm_collider"] = True
        crate("hidden screen", 6)["nsm_collider"] = 1
        bpy.data.objects["hidden eye"].hide_set(True)
        bpy.data.objects["hidden screen"].hide_viewport = True
        assert names() == ["SOLID True", "WIRE True", "hidden eye", "hidden screen"]
        d = gather_colliders(bpy.context.scene).signed_distance(
            np.array(((5.9, 0.4, 0.4), (5.4, 0.4, 0.4)), np.float32), 0.5
        )
        np.testing.assert_allclose(d, (0.1, -0.4), atol=1e-5)

    def test_the_message_names_what_stands_in_the_way(self):
        seat, _ = furnish()
        helper = box("Helper", (-1, -1.2, -0.1), (1, 1.2, 2.2))
        spec = TakeSpec(add_character((2.5, -2, 0)), [GoalSpec("sit", seat)])
        with pytest.raises(GoalError, match="'Helper' stands in it.*nsm_collider"):
            finish(generate(spec, bpy.context.scene))
        helper["nsm_collider"] = False
        assert (
            finish(prepare(spec, bpy.context.scene))[0].environment.signed_distance(
                np.array(((1.0, 0, 1),), np.float32), 0.1
            )
            > 0
        )


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


def scatter(source, places, parent=None):
    """Copies of an object at places (N, 4, 4), as a collection instance each."""
    collection = bpy.data.collections.new(source.name)
    for other in source.users_collection:
        other.objects.unlink(source)
    collection.objects.link(source)
    for i, place in enumerate(places):
        made = empty(f"{source.name} {i}", (0, 0, 0))
        made.instance_type, made.instance_collection = "COLLECTION", collection
        made.matrix_world = Matrix(place.tolist())
    bpy.context.view_layer.update()


def places(count, seed=0, spread=6.0, sizes=(0.5, 1.5), z=0.0):
    """Places (N, 4, 4) that lie apart: turned, tilted and scaled as chance has it."""
    rng, rows = np.random.default_rng(seed), int(np.ceil(np.sqrt(count)))
    out = []
    for i in range(count):
        turn = Matrix.Rotation(rng.uniform(-3, 3), 4, "Z") @ Matrix.Rotation(rng.uniform(-0.2, 0.2), 4, "X")
        at = Matrix.Translation((*(spread * (2 * np.array(divmod(i, rows)) / rows - 1)), z))
        out.append(np.array(at @ turn @ Matrix.Scale(rng.uniform(*sizes), 4)))
    return out


class TestCopies:
    def test_copies_share_a_reading_and_each_stands_where_it_is(self):
        stone = box("Stone", (-0.2, -0.15, 0), (0.2, 0.15, 0.4))
        at = places(60, spread=5.0)
        scatter(stone, at)
        query = gather_colliders(bpy.context.scene)
        assert len(query.solids) == 60 and len(READINGS) <= 8  # sizes between 0.5 and 1.5 in steps of 1.19
        exact = []
        for place in at:
            size = np.linalg.norm(place[:3, 0])
            q = np.array(Matrix((place[:3, :3] / size).tolist()).to_quaternion())
            exact.append(
                Cuboids(
                    [
                        (
                            place[:3, 3],
                            q,
                            [np.array((-0.2, -0.15, 0)) * size],
                            [np.array((0.2, 0.15, 0.4)) * size],
                        )
                    ]
                )
            )
        points = np.random.default_rng(5).uniform((-6, -6, 0), (6, 6, 0.7), (1500, 3)).astype(np.float32)
        truth = np.min([e.signed_distance(points, 0.3) for e in exact], axis=0)
        ours = query.signed_distance(points, 0.3)
        np.testing.assert_allclose(np.maximum(ours, 0), np.maximum(truth, 0), atol=1e-4)
        assert ((ours < 0) == (truth < 0))[np.abs(truth) > 1e-3].all() and (truth < -0.01).sum() > 20

    def test_large_copies_share_their_tree(self):
        bpy.ops.mesh.primitive_uv_sphere_add(segments=96, ring_count=80, radius=0.4)
        ball = bpy.context.object
        scatter(ball, places(8, spread=3, z=0.4))
        query = gather_colliders(bpy.context.scene)
        assert len(query.solids) == 8 and not query._chunks
        centres = np.array([s.origin for s in query.solids])
        sizes = np.array([s.size * (s.reading.high - s.reading.low).mean() / 2 for s in query.solids])
        points = np.random.default_rng(5).uniform((-3, -3, 0), (3, 3, 1), (800, 3)).astype(np.float32)
        truth = np.clip((np.linalg.norm(points[:, None] - centres, axis=2) - sizes).min(1), -0.3, 0.3)
        np.testing.assert_allclose(query.signed_distance(points, 0.3), truth, atol=0.01)

    def test_grass_and_pebbles_are_no_obstacles_unless_said(self):
        things = {
            "Grass": (0.01, 0.01, 0.3),
            "Pebble": (0.06, 0.06, 0.05),
            "Baluster": (0.02, 0.02, 0.9),
            "Rock": (0.3, 0.3, 0.3),
        }
        for name, high in things.items():
            scatter(box(name, (0, 0, 0), high), places(2, spread=1, sizes=(1, 1)))
        box("Peg", (3, 3, 0), (3.01, 3.01, 0.1))  # one that the animator has put there by hand is no litter
        assert {n.split()[0] for n in names()} == {"Baluster", "Rock", "Peg"}
        bpy.data.objects["Grass 0"]["nsm_collider"] = True
        assert "Grass 0" in names() and "Grass 1" not in names()


def _sphere(segments: int, rings: int, radius: float, centre: tuple[float, float, float]) -> None:
    """A sphere of quads in the scene; Blender's own operator takes twenty seconds for one as dense."""
    across = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    down = np.linspace(0, np.pi, rings + 1)[1:-1, None]
    sides = np.stack(
        (np.sin(down) * np.cos(across), np.sin(down) * np.sin(across), np.cos(down) + 0 * across), -1
    )
    points = np.concatenate((sides.reshape(-1, 3), ((0, 0, 1), (0, 0, -1)))) * radius + centre
    at = np.arange(len(down) * segments).reshape(len(down), segments)
    beside = np.roll(at, -1, axis=1)
    quads = np.stack((at[:-1], at[1:], beside[1:], beside[:-1]), -1).reshape(-1, 4)
    top, bottom = np.full(segments, at.size), np.full(segments, at.size + 1)
    caps = [np.stack((top, at[0], beside[0]), -1), np.stack((bottom, beside[-1], at[-1]), -1)]
    mesh = bpy.data.meshes.new("Sphere")
    mesh.from_pydata(points.tolist(), [], [*quads.tolist(), *np.concatenate(caps).tolist()])
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Sphere", mesh))


class TestDense:
    def test_a_dense_mesh_is_thinned_within_millimetres(self):
        _sphere(segments=400, rings=300, radius=0.3, centre=(0, 0, 0.5))
        query = gather_colliders(bpy.context.scene)
        assert len(query.solids[0].triangles) < 200_000
        points = (
            np.random.default_rng(1).uniform((-0.6, -0.6, 0), (0.6, 0.6, 1), (2000, 3)).astype(np.float32)
        )
        truth = np.clip(np.linalg.norm(points - (0, 0, 0.5), axis=1) - 0.3, -0.2, 0.2)
        off = np.abs(query.signed_distance(points, 0.2) - truth)
        # Slivers that thinning folds over may take a point near them for outside; they are few.
        assert (off < 0.003).mean() > 0.999 and (
            np.abs(off[off >= 0.003] - 2 * np.abs(truth[off >= 0.003])) < 0.003
        ).all()

    def test_faces_of_all_kinds_cover_what_blender_draws(self):
        """Triangles, quads, flat and concave larger faces of a mesh that is too dense to ask Blender for its
        triangles.
        """
        bpy.ops.mesh.primitive_grid_add(x_subdivisions=90, y_subdivisions=90, size=2, location=(0, 0, 1))
        grid = bpy.context.object.data
        vertices = [v.co.copy() for v in grid.vertices]
        faces = [tuple(p.vertices) for p in grid.polygons]
        faces = [t for i, f in enumerate(faces) for t in ((f[:3], (f[0], *f[2:])) if i % 3 == 0 else (f,))]
        start = len(vertices)
        outline = [(3, 0), (5, 0), (5, 1), (4, 1), (4, 2), (3, 2)]  # an L, and a star that bends twice
        star = [
            (6 + (0.5 + 0.5 * (i % 2)) * np.cos(i * np.pi / 5), (0.5 + 0.5 * (i % 2)) * np.sin(i * np.pi / 5))
            for i in range(10)
        ]
        vertices += [(x, y, 0.3) for x, y in outline + star]
        faces += [tuple(range(start, start + 6)), tuple(range(start + 6, start + 16))]
        mesh = bpy.data.meshes.new("Mixed")
        mesh.from_pydata(vertices, [], faces)
        data = MeshData(mesh)
        assert data._made is None
        ours, triangles = data.faces

        def area(corners):
            return (
                np.linalg.norm(
                    np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
                ).sum()
                / 2
            )

        mesh.calc_loop_triangles()
        theirs = np.array([t.vertices[:] for t in mesh.loop_triangles])
        places_ = np.array([v.co for v in mesh.vertices])
        assert len(triangles) == len(theirs)
        assert area(ours[triangles]) == pytest.approx(area(places_[theirs]), rel=1e-6)
        normal = np.cross(
            ours[triangles][:, 1] - ours[triangles][:, 0], ours[triangles][:, 2] - ours[triangles][:, 0]
        )
        assert (normal[:, 2] > 0).all()  # none is folded over

    def test_numbers_that_are_none_are_told_with_the_name(self):
        made = crate("Broken")
        made.data.vertices[0].co.x = float("nan")
        made.data.update()
        bpy.context.view_layer.update()
        with pytest.raises(GeometryError, match="Broken has coordinates that are not numbers"):
            gather_colliders(bpy.context.scene)


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
