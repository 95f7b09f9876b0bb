"""Runs inside the graphical Blender for measure.py: builds a room, presses Generate, notes every moment the
add-on takes.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bl_ext.user_default.nsm_blender as nsm
import bpy

PACKAGE = nsm.__name__
ROOM, FIGURES = sys.argv[sys.argv.index("--") + 1 :]
FIGURES = Path(FIGURES)
_LATE = 280  # seconds after which a take is given up


def part(name: str):
    """A module of the installed add-on."""
    __import__(f"{PACKAGE}.{name}")
    return sys.modules[f"{PACKAGE}.{name}"]


# ---------------------------------------------------------------- rooms


def build(kind: str) -> tuple[bpy.types.Object, list[tuple[bpy.types.Object, str]]]:
    """Lay out a room; the character, and goals as objects with actions."""
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    bpy.context.view_layer.update()
    room = part("demo_scene.room").build_room()
    character = part("rigs.character").add_character((*room.start, 0.0))
    character.rotation_euler.z = room.start_heading
    seats = [bpy.data.objects[name] for name in room.seats]
    if kind == "centimetres":
        for each in bpy.context.scene.objects:
            if each.parent is None:
                each.location, each.scale = each.location * 100, each.scale * 100
        bpy.context.scene.unit_settings.scale_length = 0.01
    if kind == "dense":
        subdivide(seats, 1_200_000)
    if kind == "scatter":
        scatter(8000)
    bpy.context.view_layer.update()
    return character, [(seats[0], "sit")]


def subdivide(targets: list[bpy.types.Object], triangles: int) -> None:
    """Raise the triangles of objects, their shapes unchanged, to ``triangles`` in all or a little less."""
    for target in targets:
        modifier = target.modifiers.new("Dense", "SUBSURF")
        modifier.subdivision_type, modifier.levels = "SIMPLE", 0
        while 4 * count(target) <= triangles:
            modifier.levels += 1
        triangles -= count(target)


def scatter(blades: int) -> None:
    """Strew instances of a small mesh over a lawn beside the room."""
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -0.02))
    lawn = bpy.context.object
    lawn.name = "Lawn"
    mesh = bpy.data.meshes.new("Blade")
    mesh.from_pydata(
        [(-0.005, 0, 0), (0.005, 0, 0), (0, 0.01, 0), (0, 0, 0.06)],
        [],
        [(0, 1, 2), (0, 1, 3), (1, 2, 3), (2, 0, 3)],
    )
    blade = bpy.data.objects.new("Blade", mesh)
    bpy.context.scene.collection.objects.link(blade)
    blade.location, blade.hide_render = (50, 50, 0), True
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    new, link = tree.nodes.new, tree.links.new
    source, result = new("NodeGroupInput"), new("NodeGroupOutput")
    points, each, what = (
        new("GeometryNodeDistributePointsOnFaces"),
        new("GeometryNodeInstanceOnPoints"),
        new("GeometryNodeObjectInfo"),
    )
    join = new("GeometryNodeJoinGeometry")
    what.inputs["Object"].default_value, what.inputs["As Instance"].default_value = blade, True
    points.inputs["Density"].default_value = blades / 400
    link(source.outputs[0], points.inputs["Mesh"])
    link(points.outputs["Points"], each.inputs["Points"])
    link(what.outputs["Geometry"], each.inputs["Instance"])
    link(each.outputs[0], join.inputs[0])
    link(source.outputs[0], join.inputs[0])
    link(join.outputs[0], result.inputs[0])
    lawn.modifiers.new("Scatter", "NODES").node_group = tree


def count(target: bpy.types.Object) -> int:
    """Triangles of an object as it is evaluated now."""
    bpy.context.view_layer.update()
    evaluated = target.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    mesh.calc_loop_triangles()
    number = len(mesh.loop_triangles)
    evaluated.to_mesh_clear()
    return number


# ---------------------------------------------------------------- what is measured


class Log:
    """Every moment that the add-on spends on the window's own thread, and every redraw."""

    def __init__(self) -> None:
        self.rows: list[
            tuple[str, float, float, float]
        ] = []  # what, begin, seconds by the clock, seconds of this thread's processor
        self.stage: list[str] = []
        self.motion: float | None = None

    def watch(self, owner: object, name: str, what: str) -> None:
        """Have a function note how long it takes."""
        inner = getattr(owner, name)

        def timed(*args):
            begin, processor = time.perf_counter(), time.thread_time()
            try:
                return inner(*args)
            finally:
                state = part("ui.running").current()
                where = (
                    f"tick, {state.text.rpartition(' ')[0] if '%' in state.text else state.text}"
                    if what == "tick" and state
                    else what
                )
                self.rows.append((where, begin, time.perf_counter() - begin, time.thread_time() - processor))

        # Blender counts the arguments of what it calls.
        draws = what == "sidebar"
        setattr(
            owner,
            name,
            (lambda self, context: timed(self, context))
            if draws
            else lambda self, context, e: timed(self, context, e),
        )

    def note_motion(self) -> None:
        """Have the preview note when it first shows a pose."""
        preview, inner = part("keys.preview").Preview, part("keys.preview").Preview.show

        def show(*args, **named):
            inner(*args, **named)
            self.motion = self.motion or time.perf_counter()

        preview.show = show

    def own(self) -> list[tuple[str, float, float, float]]:
        return [row for row in self.rows if not row[0].startswith("redraw")]

    def between_redraws(self) -> float:
        """Longest sum of the add-on's own processor time between two redraws, seconds."""
        longest = total = 0.0
        for what, _, _, processor in sorted(self.rows, key=lambda row: row[1]):
            total = 0.0 if what.startswith("redraw") else total + processor
            longest = max(longest, total)
        return longest

    def figures(self) -> dict[str, object]:
        """What all rows say, milliseconds; ``cpu`` is this thread's own time, which a busy machine does not
        lengthen.
        """
        own = self.own()
        what, _, seconds, _ = max(own, key=lambda row: row[3])
        ticks = [row for row in own if row[0].startswith("tick")]
        return {
            "longest_block_cpu_ms": 1000 * max(row[3] for row in own),
            "longest_block_ms": 1000 * seconds,
            "longest_block_in": what,
            "longest_clock_ms": 1000 * max(row[2] for row in own),
            "between_redraws_cpu_ms": 1000 * self.between_redraws(),
            "longest_silence_ms": 1000 * self.silence(),
            "redraws": sum(row[0] == "redraw" for row in self.rows),
            "ticks": len(ticks),
            "in_ticks_s": sum(row[2] for row in ticks),
            "in_ticks_cpu_s": sum(row[3] for row in ticks),
            "worst": [
                (w, round(1000 * s), round(1000 * c))
                for w, _, s, c in sorted(own, key=lambda row: -row[3])[:12]
            ],
        }

    def since(self, begun: float) -> list[tuple[str, int, int]]:
        """What has happened since ``begun``: what, after how many milliseconds, and how many it took."""
        return [
            (w, round(1000 * (at - begun)), round(1000 * s))
            for w, at, s, _ in sorted(self.rows, key=lambda r: r[1])
            if at >= begun
        ]

    def silence(self) -> float:
        """Longest time by the clock between two redraws, seconds."""
        times = [begin for what, begin, _, _ in self.rows if what.startswith("redraw")]
        return max((b - a for a, b in zip(times, times[1:], strict=False)), default=0.0)


# ---------------------------------------------------------------- one run


def steps(log: Log):
    """The run, a generator: yields the seconds until it wants to go on."""
    window = bpy.context.window_manager.windows[0]
    area = max((a for a in window.screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width * a.height)
    view = next(r for r in area.regions if r.type == "WINDOW")
    with bpy.context.temp_override(window=window, area=area, region=view):
        character, goals = build(ROOM)
    area.spaces.active.show_region_ui = True
    settings = bpy.context.scene.nsm
    settings.character = character
    for target, action in goals:
        row = settings.goals.add()
        row.object, row.action, row.hold = target, action, 1.0
    yield 1.0
    sidebar = next(r for r in area.regions if r.type == "UI")
    sidebar.active_panel_category = "NSM"
    with bpy.context.temp_override(window=window, area=area, region=view):
        bpy.ops.view3d.view_all(use_all_regions=False)
    yield 2.0
    picture("1-ready")
    operator = part("ui.operators.generate").NSM_OT_generate
    for name in ("modal", "invoke"):
        log.watch(operator, name, "tick" if name == "modal" else "click")
    for kind in part("ui.panels").CLASSES:
        if issubclass(kind, bpy.types.Panel):
            log.watch(kind, "draw", "sidebar")
    log.note_motion()
    bpy.types.SpaceView3D.draw_handler_add(
        lambda: log.rows.append(("redraw", time.perf_counter(), 0, 0)), (), "WINDOW", "POST_PIXEL"
    )
    bpy.types.SpaceView3D.draw_handler_add(
        lambda: log.rows.append(("redraw", time.perf_counter(), 0, 0)), (), "UI", "POST_PIXEL"
    )
    running = part("ui.running")
    figures = {
        "blender": bpy.app.version_string,
        "objects": len(bpy.context.scene.objects),
        "triangles": sum(count(o) for o in bpy.context.scene.objects if o.type == "MESH"),
        "instances": sum(1 for i in bpy.context.evaluated_depsgraph_get().object_instances if i.is_instance),
    }
    before = pose(character)
    yield 1.0

    clicked = press(window, area, view)
    while running.current() is not None and log.motion is None and time.perf_counter() - clicked < _LATE:
        yield 0.1
    figures["first_motion_s"] = (log.motion or time.perf_counter()) - clicked
    figures["until_motion"] = log.since(clicked)
    yield 1.0
    picture("2-growing")
    while running.current() is not None and time.perf_counter() - clicked < _LATE:
        yield 0.1
    figures["keys_s"] = time.perf_counter() - clicked
    start, end = bpy.data.actions[0].frame_range
    figures["take_s"] = (end - start) / (bpy.context.scene.render.fps / bpy.context.scene.render.fps_base)
    figures["results"] = [row.text for row in settings.results]
    figures["first_take"] = log.figures()
    FIGURES.with_suffix(".part.json").write_text(json.dumps(figures, indent=1), encoding="utf-8")
    yield 0.5
    picture("3-done")

    with bpy.context.temp_override(window=window, area=area, region=view):
        bpy.ops.nsm.take_reject()
    figures["rejected"] = pose(character) == before and not bpy.data.actions
    yield 1.0  # the window shows that before one presses again
    log.motion = None
    clicked = press(window, area, view)
    while running.current() is not None and log.motion is None and time.perf_counter() - clicked < _LATE:
        yield 0.1
    figures["first_motion_again_s"] = (log.motion or time.perf_counter()) - clicked
    figures["until_motion_again"] = log.since(clicked)
    yield 0.5
    pressed = time.perf_counter()
    window.event_simulate(type="ESC", value="PRESS", x=640, y=360)
    window.event_simulate(type="ESC", value="RELEASE", x=640, y=360)
    while running.current() is not None and time.perf_counter() - pressed < 20:
        yield 0.0
    figures["escape_ms"] = 1000 * (time.perf_counter() - pressed)
    figures["until_escape"] = log.since(pressed)
    figures["put_back"] = pose(character) == before and not bpy.data.actions and running.current() is None
    yield 0.5
    picture("4-escaped")
    figures |= log.figures()
    FIGURES.write_text(json.dumps(figures, indent=1), encoding="utf-8")


def press(window: bpy.types.Window, area: bpy.types.Area, region: bpy.types.Region) -> float:
    """Press Generate; the moment of the click."""
    clicked = time.perf_counter()
    with bpy.context.temp_override(window=window, area=area, region=region):
        bpy.ops.nsm.generate("INVOKE_DEFAULT")
    return clicked


def pose(character: bpy.types.Object) -> list[tuple[float, ...]]:
    """All bones' channels."""
    return [tuple(v for row in bone.matrix_basis for v in row) for bone in character.pose.bones]


def picture(name: str) -> None:
    """Photograph the screen without waiting for it."""
    if shutil.which("import"):
        subprocess.Popen(["import", "-window", "root", str(FIGURES.with_name(f"{ROOM}-{name}.png"))])


def drive(run) -> None:
    """Have Blender's timer go through the run, and quit."""

    def go() -> float | None:
        try:
            return next(run)
        except StopIteration:
            pass
        except Exception:
            FIGURES.write_text(json.dumps({"error": traceback.format_exc()[-1500:]}), encoding="utf-8")
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(go, first_interval=1.0, persistent=True)


bpy.context.preferences.view.show_splash = False
bpy.context.preferences.system.viewport_aa = (
    "OFF"  # which draws every picture eight times over: too slow without a graphics card
)
drive(steps(Log()))
