"""Colliders from evaluated Blender meshes: what is solid, where it is, and how well it agrees with exact
boxes.
"""

from __future__ import annotations

import math

import bpy
import numpy as np
import pytest
from colliders_now import collider_shapes, gather_colliders

from nsm_blender.world.bodies import GoalBody
from nsm_blender.world.bvh_query import BVHQuery
from nsm_blender.world.frame import WorldFrame
from nsm_core.errors import GeometryError
from nsm_core.world.affordances.seat import find_seat
from nsm_core.world.geometry.distance import Cuboids
from nsm_core.world.geometry.voxels import merge, voxelise
from nsm_core.world.scene.furniture import cuboids, make
from nsm_core.world.sensors.environment import SPHERE_RADIUS, environment_sensor
from nsm_core.world.sensors.interaction import interaction_sensor

CUBE = np.array([(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
CUBE_QUADS = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]


def add(name, vertices, faces, location=(0, 0, 0), collection=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(
        np.asarray(vertices).tolist(),
        [],
        [tuple(f) for f in np.asarray(faces).tolist()] if len(faces) else [],
    )
    obj = bpy.data.objects.new(name, mesh)
    obj.location = location
    (collection or bpy.context.scene.collection).objects.link(obj)
    return obj


def add_cube(name="Cube", location=(0, 0, 0.5), **kwargs):
    return add(name, CUBE, CUBE_QUADS, location, **kwargs)


def gather(**kwargs):
    bpy.context.view_layer.update()
    return gather_colliders(bpy.context.scene, bpy.context.evaluated_depsgraph_get(), **kwargs)


def distance(query, *points, limit=0.5):
    return query.signed_distance(np.array(points, dtype=np.float32), limit)


def names():
    bpy.context.view_layer.update()
    return sorted(s.owner for s in collider_shapes(bpy.context.scene, bpy.context.evaluated_depsgraph_get()))


def mesh_of(target):
    """World vertices (V, 3) and triangles (F, 3) of an object and its children, as a goal's are read."""
    body = GoalBody.of(target, WorldFrame())
    return body.to_core(body.vertices).astype(np.float64), body.triangles


def test_distances_of_a_cube_are_exact_outside_and_inside():
    add_cube()
    d = distance(
        gather(),
        (0.7, 0, 0.5),
        (0, 0, 1.3),
        (0.6, 0.6, 0.5),
        (0, 0, 0.5),
        (0.49, 0, 0.5),
        (0, 0.3, 0.5),
        (5, 5, 5),
    )
    np.testing.assert_allclose(d, (0.2, 0.3, math.sqrt(0.02), -0.5, -0.01, -0.2, 0.5), atol=1e-5)


def test_nothing_is_farther_than_the_limit_and_deep_points_stay_inside():
    add_cube()
    query = gather()
    points = np.random.default_rng(0).uniform(-2, 2, (3000, 3)).astype(np.float32)
    for limit in (0.05, SPHERE_RADIUS, 0.6):
        d = query.signed_distance(points, limit)
        assert d.dtype == np.float32 and (np.abs(d) <= limit + 1e-6).all()
        np.testing.assert_array_equal(d < -1e-4, (np.abs(points - (0, 0, 0.5)) < 0.5 - 1e-4).all(1))


def test_every_point_gets_the_distance_that_brute_force_finds():
    furniture = make("armchair", np.random.default_rng(3))
    add("Armchair", furniture.vertices, furniture.triangles, (0.4, -0.2, 0))
    query, exact = gather(), cuboids([(furniture, (0.4, -0.2), 0.0)])
    points = np.random.default_rng(1).uniform((-1, -1, -0.2), (1.5, 1, 1.4), (4000, 3)).astype(np.float32)
    for limit in (0.1, SPHERE_RADIUS, 0.4):
        outside = exact.signed_distance(points, limit) > 0
        bvh = np.maximum(query.signed_distance(points, limit), 0)
        np.testing.assert_allclose(bvh[outside], exact.signed_distance(points, limit)[outside], atol=2e-5)


@pytest.mark.parametrize(
    "kind", ["chair", "armchair", "sofa", "stool", "bench", "table", "cabinet", "box", "wall"]
)
def test_bvh_and_voxel_cuboids_agree_within_a_voxel_diagonal(kind):
    """Each point of a surface voxel lies within the voxel's diagonal of the mesh, and the voxels hold the
    whole mesh.
    """
    rng = np.random.default_rng(5)
    furniture = make(kind, rng)
    position, heading = np.array((0.7, -0.4, 0.0)), 0.6
    obj = add(kind, furniture.vertices, furniture.triangles, position)
    obj.rotation_euler.z = heading
    grid = voxelise(furniture.vertices, furniture.triangles)
    voxels = Cuboids([(position, heading, *merge(grid))])
    query = gather()
    tolerance = grid.diagonal / SPHERE_RADIUS
    differences = []
    for _ in range(20):
        root, facing = position[:2] + rng.uniform(-1.5, 1.5, 2), rng.uniform(-3, 3)
        differences.append(environment_sensor(voxels, root, facing) - environment_sensor(query, root, facing))
    assert np.abs(differences).max() <= tolerance + 1e-4
    assert np.abs(differences).mean() < 0.02
    centre = position + (0, 0, furniture.size[2] / 2)
    ours, theirs = (interaction_sensor(q, centre, furniture.size, heading) for q in (query, voxels))
    assert (
        np.abs(ours.occupancy - theirs.occupancy).max()
        <= grid.diagonal * 8 / np.linalg.norm(furniture.size) + 1e-4
    )


@pytest.mark.parametrize(
    "damage", ["holes", "flipped", "all flipped", "loose", "lid off", "doubled", "split"]
)
def test_broken_meshes_keep_their_place(damage):
    """Outside the voxels of the surface, a damaged crate reads as the whole one; the lid's loss alone opens
    it.
    """
    rng = np.random.default_rng(2)
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, 0, 0.5))
    obj = bpy.context.active_object
    subdivide = obj.modifiers.new("Subdivide", "SUBSURF")
    subdivide.subdivision_type, subdivide.levels = "SIMPLE", 4
    bpy.context.view_layer.update()
    whole_v, whole_t = mesh_of(obj)
    vertices, triangles = whole_v, whole_t
    if damage == "holes":  # single triangles of 6 cm legs: narrower than a voxel once voxelised
        triangles = np.delete(triangles, rng.choice(len(triangles), 25, replace=False), axis=0)
    elif damage == "flipped":
        triangles = triangles.copy()
        some = rng.random(len(triangles)) < 0.4
        triangles[some] = triangles[some][:, ::-1]
    elif damage == "all flipped":
        triangles = triangles[:, ::-1]
    elif damage == "loose":
        vertices = np.concatenate((vertices, rng.uniform(-9, 9, (50, 3))))
    elif damage == "lid off":
        triangles = triangles[(vertices[triangles][..., 2] < 1 - 1e-4).any(1)]
    elif damage == "doubled":
        triangles = np.concatenate((triangles, triangles[::3]))
    elif damage == "split":
        vertices, triangles = vertices[triangles].reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)
    bpy.data.objects.remove(obj)
    add("Broken", vertices, triangles)
    query, whole = gather(), BVHQuery.from_triangles(whole_v, whole_t)
    points = rng.uniform((-1, -1, -0.5), (1, 1, 1.5), (4000, 3)).astype(np.float32)
    ours, theirs = query.signed_distance(points, 0.2), whole.signed_distance(points, 0.2)
    outside = theirs > 0
    assert (ours[outside] >= 0).all()
    near = outside & (points[:, 2] < 0.8) if damage == "lid off" else outside
    assert np.abs(ours - theirs)[near].max() < 0.07
    deep = np.abs(points - (0, 0, 0.5)).max(1) < 0.45
    assert (ours[deep] > 0).all() if damage == "lid off" else (ours[deep] < 0).all()


def test_an_open_sheet_is_a_thin_wall_from_both_sides():
    add("Screen", [(-1, 0, 0), (1, 0, 0), (1, 0, 2), (-1, 0, 2)], [(0, 1, 2, 3)])
    np.testing.assert_allclose(
        distance(gather(), (0, -0.1, 1), (0, 0.1, 1), (0, 0.01, 1)), (0.1, 0.1, 0.01), atol=1e-5
    )


def test_ngons_and_concave_faces_are_cut_as_blender_draws_them():
    outline = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
    add("L", [(x, y, 1.0) for x, y, _ in outline], [tuple(range(6))])
    d = distance(gather(), (0.5, 1.5, 1.1), (1.5, 0.5, 1.1), (1.5, 1.5, 1.0))
    np.testing.assert_allclose(d, (0.1, 0.1, 0.5), atol=1e-5)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (-2, 1, 0.5), (1, -1, -1), (-1, -1, -1)])
def test_mirrored_and_stretched_objects_stay_solid_where_they_are(scale):
    obj = add("Corner", CUBE + 0.5, CUBE_QUADS)
    obj.location, obj.scale = (1, 2, 0.6), scale
    centre = np.array((1, 2, 0.6)) + 0.5 * np.array(scale)
    query = gather()
    half = np.abs(scale[0]) / 2
    assert distance(query, centre)[0] < 0
    np.testing.assert_allclose(
        distance(query, centre + (half + 0.1, 0, 0), centre + (half - 0.02, 0, 0)), (0.1, -0.02), atol=1e-5
    )


def test_modifiers_parents_and_animated_parents_count():
    obj = add_cube(location=(1, 0, 0.5))
    array = obj.modifiers.new("Array", "ARRAY")
    array.use_relative_offset, array.use_constant_offset = False, True
    array.constant_offset_displace, array.count = (0, 3, 0), 2
    empty = bpy.data.objects.new("Carrier", None)
    bpy.context.scene.collection.objects.link(empty)
    obj.parent = empty
    for frame, x in ((1, 0.0), (21, 4.0)):
        empty.location.x = x
        empty.keyframe_insert("location", frame=frame)
    for frame, x in ((1, 0.0), (21, 4.0)):
        bpy.context.scene.frame_set(frame)
        np.testing.assert_allclose(
            distance(gather(), (x + 1.7, 0, 0.5), (x + 1.7, 3, 0.5), (x + 1, 3, 0.5)),
            (0.2, 0.2, -0.5),
            atol=1e-4,
        )


def test_collection_instances_count_each_and_belong_to_their_empty():
    source = bpy.data.collections.new("Source")
    add_cube("Hidden original", location=(0, 0, 0.5), collection=source)
    for i, x in enumerate((3.0, -3.0)):
        empty = bpy.data.objects.new(f"Instance {i}", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", source, (x, 0, 0)
        bpy.context.scene.collection.objects.link(empty)
    bpy.data.objects["Instance 1"].scale = (-1, 1, 1)
    assert names() == ["Instance 0", "Instance 1"]
    d = distance(gather(), (3.6, 0, 0.5), (-3.6, 0, 0.5), (0, 0, 0.5), (-2.51, 0, 0.5))
    np.testing.assert_allclose(d, (0.1, 0.1, 0.5, -0.01), atol=1e-5)
    assert (
        gather(exclude=[bpy.data.objects["Instance 0"]]).signed_distance(np.array([(3, 0, 0.5)]), 0.2)[0] > 0
    )
    bpy.context.view_layer.update()
    vertices, _ = mesh_of(bpy.data.objects["Instance 0"])
    np.testing.assert_allclose((vertices.min(0), vertices.max(0)), ((2.5, -0.5, 0), (3.5, 0.5, 1)), atol=1e-6)


def test_geometry_node_and_vertex_instances_count():
    tree = bpy.data.node_groups.new("Place", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    cube, place = tree.nodes.new("GeometryNodeMeshCube"), tree.nodes.new("GeometryNodeInstanceOnPoints")
    cube.inputs["Size"].default_value = (0.4, 0.4, 0.4)
    tree.links.new(start.outputs[0], place.inputs["Points"])
    tree.links.new(cube.outputs["Mesh"], place.inputs["Instance"])
    tree.links.new(place.outputs[0], end.inputs[0])
    points = add("Points", [(0, 0, 1), (2, 0, 1)], [])
    points.modifiers.new("Nodes", "NODES").node_group = tree
    carrier = add("Carrier", [(-3, 0, 1), (-5, 0, 1)], [])
    leaf = add_cube("Leaf", location=(0, 0, 0))
    leaf.parent, carrier.instance_type = carrier, "VERTS"
    d = distance(gather(), (0.3, 0, 1), (2.3, 0, 1), (2, 0, 1), (-3.6, 0, 1), (-5.6, 0, 1))
    np.testing.assert_allclose(d, (0.1, 0.1, -0.2, 0.1, 0.1), atol=1e-5)


def test_curves_and_metaballs_are_solid_and_counted_once():
    curve = bpy.data.curves.new("Pipe", "CURVE")
    curve.dimensions, curve.bevel_depth, curve.use_fill_caps = "3D", 0.1, True
    spline = curve.splines.new("POLY")
    spline.points.add(1)
    spline.points[0].co, spline.points[1].co = (0, 0, 0, 1), (0, 0, 2, 1)
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Pipe", curve))
    ball = bpy.data.metaballs.new("Ball")
    ball.elements.new().radius = 0.8
    bpy.context.scene.collection.objects.link(bpy.data.objects.new("Ball", ball))
    bpy.data.objects["Ball"].location = (4, 0, 2)
    d = distance(gather(), (0.3, 0, 1), (0, 0, 1), (4, 0, 2))
    assert d[0] == pytest.approx(0.2, abs=0.01) and d[1] < 0 and d[2] < 0
    assert names() == ["Ball", "Pipe"]


def test_floors_hidden_marked_and_other_objects_are_left_out():
    add("Ground", [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)], [(0, 1, 2, 3)])
    slab = add_cube("Slab", location=(0, 0, -0.05))
    slab.scale = (8, 8, 0.1)
    rug = add_cube("Rug", location=(0, 0, 0.01))
    rug.scale = (2, 2, 0.02)
    add_cube("Eye").hide_set(True)
    add_cube("Viewport").hide_viewport = True
    add_cube("Seen in the viewport alone").hide_render = True
    add_cube("Ghost")["nsm_collider"] = False
    add_cube("Marked")["nsm_collider"] = True
    off = bpy.data.collections.new("Off")
    bpy.context.scene.collection.children.link(off)
    add_cube("Excluded", collection=off)
    bpy.context.view_layer.layer_collection.children["Off"].exclude = True
    for data in (bpy.data.cameras.new("Camera"), bpy.data.lights.new("Light", "POINT"), None):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new("Other", data))
    add("Empty mesh", [], [])
    add("Vertices alone", [(0, 0, 1)], [])
    assert names() == ["Marked", "Seen in the viewport alone"]


def test_the_floor_height_moves_with_the_character():
    rug = add_cube("Carpet", location=(0, 0, 2.01))
    rug.scale = (2, 2, 0.02)
    assert distance(gather(), (0, 0, 2.1))[0] == pytest.approx(0.08, abs=1e-5)
    assert distance(gather(frame=WorldFrame(floor=2.0)), (0, 0, 2.1))[0] == 0.5


def test_a_character_is_left_out_with_its_body_and_props():
    rig = bpy.data.objects.new("Rig", bpy.data.armatures.new("Rig"))
    bpy.context.scene.collection.objects.link(rig)
    add_cube("Child").parent = rig
    add_cube("Prop").parent = bpy.data.objects["Child"]
    add_cube("Body").modifiers.new("Armature", "ARMATURE").object = rig
    add_cube("Chair", location=(4, 0, 0.5))
    d = distance(gather(exclude=[rig]), (0, 0, 0.5), (4, 0, 0.5))
    assert d[0] == 0.5 and d[1] < 0


def test_a_closed_room_does_not_swallow_the_character():
    """A room modelled as one closed box, facing in or out: walls are felt, its floor and its air are not."""
    for faces in (CUBE_QUADS, [f[::-1] for f in CUBE_QUADS]):
        room = add("Room", CUBE * (6, 5, 2.6), faces, (0, 0, 1.3))
        query = gather()
        values = environment_sensor(query, (0, 0), 0.3)
        assert values.max() == 0
        d = distance(query, (0, 0, 1), (0, 0, 0.0), (2.9, 0, 1), (2.98, 0, 1))
        np.testing.assert_allclose(d, (0.5, 0.5, 0.1, 0.02), atol=1e-5)
        bpy.data.objects.remove(room)


def test_an_empty_scene_reads_empty():
    assert environment_sensor(gather(), (0, 0), 0).max() == 0


def test_the_seat_of_a_turned_and_mirrored_chair_is_found_through_children():
    chair = make("chair", np.random.default_rng(1))
    parent = bpy.data.objects.new("Imported", None)
    bpy.context.scene.collection.objects.link(parent)
    obj = add("Part", chair.vertices, chair.triangles)
    obj.parent, obj.scale = parent, (-1, 1, 1)
    parent.location, parent.rotation_euler.z = (2, 1, 0), math.radians(90)
    bpy.context.view_layer.update()
    vertices, triangles = mesh_of(parent)
    seat = find_seat(vertices, triangles)
    assert seat.height == pytest.approx(chair.seat.height, abs=0.01)
    assert seat.heading == pytest.approx(math.pi / 2, abs=0.05)
    expected = np.array((2 - chair.seat.point[1], 1))
    np.testing.assert_allclose(seat.point[:2], expected, atol=0.03)


def test_a_goal_without_faces_says_what_to_do():
    for obj in (add("Bare", [], []), bpy.data.objects.new("Null", None)):
        if not obj.users_collection:
            bpy.context.scene.collection.objects.link(obj)
        bpy.context.view_layer.update()
        with pytest.raises(GeometryError, match=f"{obj.name} has no visible faces.*add faces"):
            mesh_of(obj)


def test_a_mesh_with_values_that_are_not_numbers_is_named():
    obj = add_cube("Wrecked")
    obj.data.vertices[3].co.x = float("nan")
    with pytest.raises(GeometryError, match="Wrecked.*not numbers"):
        gather()


def test_hundreds_of_small_objects_in_a_wide_scene_are_all_found():
    rng = np.random.default_rng(4)
    centres = rng.uniform((-40, -40, 0.3), (40, 40, 1.5), (150, 3))
    mesh = add_cube("First", location=centres[0]).data
    for centre in centres[1:]:
        obj = bpy.data.objects.new("More", mesh)
        obj.location = centre
        bpy.context.scene.collection.objects.link(obj)
    bpy.context.scene.objects["First"].scale = (1, 1, 1)
    d = gather().signed_distance(centres + (0.6, 0, 0), 0.2)
    exact = Cuboids([(c, 0.0, [(-0.5, -0.5, -0.5)], [(0.5, 0.5, 0.5)]) for c in centres]).signed_distance(
        centres + (0.6, 0, 0), 0.2
    )
    np.testing.assert_allclose(np.maximum(d, 0), np.maximum(exact, 0), atol=2e-5)
