"""Runs inside the graphical Blender for test_window.py: works the sidebar by real events of mouse and keys.

xdotool moves the pointer and presses, as a hand would; the buttons are found in a picture of the screen by
the colour that this profile's theme gives them.  What was seen is written as JSON beside pictures of it.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
import traceback
from pathlib import Path

import bl_ext.user_default.nsm_blender as nsm
import bpy
import numpy as np

PACKAGE = nsm.__name__
OUT = Path(sys.argv[sys.argv.index("--") + 1])
COLOUR = (1.0, 0.0, 0.6)  # of buttons that do something, and of nothing else on the screen
_LATE = 240  # seconds after which a take is given up


def part(name: str):
    """A module of the installed add-on."""
    __import__(f"{PACKAGE}.{name}")
    return sys.modules[f"{PACKAGE}.{name}"]


class Hand:
    """Mouse, keys and eye."""

    def __init__(self) -> None:
        self.pictures, self.last = 0, ""

    def photograph(self, name: str) -> Path:
        """A picture of the whole screen."""
        if name != self.last:
            self.pictures, self.last = self.pictures + 1, name
        path = OUT / f"{self.pictures}-{name}.png"
        subprocess.run(["import", "-window", "root", str(path)], check=True)
        return path

    def buttons(self, picture: Path) -> list[tuple[int, int, int, int]]:
        """Buttons on a picture as x, y, width, height, from top to bottom."""
        image = bpy.data.images.load(str(picture))
        width, height = image.size
        pixels = np.array(image.pixels[:], np.float32).reshape(height, width, -1)[::-1, :, :3]
        bpy.data.images.remove(image)
        like = (pixels[..., 0] > 0.75) & (pixels[..., 1] < 0.25) & (abs(pixels[..., 2] - COLOUR[2]) < 0.2)
        return boxes(like)

    def click(self, x: float, y: float):
        """Press the mouse at a place, as a person does: move there, wait, press."""
        for command in (["mousemove", str(int(x)), str(int(y))], ["click", "1"]):
            subprocess.Popen(["xdotool", *command])
            yield 0.4

    def key(self, name: str):
        """Press a key."""
        subprocess.Popen(["xdotool", "key", name])
        yield 0.4


def boxes(like: np.ndarray) -> list[tuple[int, int, int, int]]:
    """Rectangles of the runs of marked pixels: x, y, width, height."""
    found: list[list[int]] = []
    for y in np.flatnonzero(like.any(1)):
        row = np.flatnonzero(like[y])
        for run in np.split(row, np.flatnonzero(np.diff(row) > 3) + 1):
            left, right = int(run[0]), int(run[-1])
            if right - left < 8:
                continue
            # Letters and icons cut a button in pieces.
            reach = (b for b in found if y - b[3] <= 4 and left <= b[2] + 24 and right >= b[0] - 24)
            near = next(reach, None)
            if near is None:
                found.append([left, int(y), right, int(y)])
            else:
                near[0], near[2], near[3] = min(near[0], left), max(near[2], right), int(y)
    return [(a, b, c - a + 1, d - b + 1) for a, b, c, d in found if d - b > 8]


def lay_out() -> None:
    """A stool, and the cursor where the character will stand."""
    for each in list(bpy.data.objects):
        bpy.data.objects.remove(each)
    bpy.ops.mesh.primitive_cube_add(size=1)
    stool = bpy.context.object
    stool.name, stool.scale, stool.location = "Stool", (0.45, 0.45, 0.45), (0.0, -1.4, 0.225)


def select(name: str) -> None:
    """Select one object alone."""
    for each in bpy.context.view_layer.objects:
        each.select_set(each.name == name)
    bpy.context.view_layer.objects.active = bpy.data.objects[name]


def pose(character: bpy.types.Object) -> list[tuple[float, ...]]:
    """All bones' channels."""
    return [tuple(v for row in bone.matrix_basis for v in row) for bone in character.pose.bones]


def queue() -> list:
    """The goals that the sidebar shows."""
    return part("ui.properties").queue_of(bpy.context.scene).goals


def wait_for(what, seconds: float):
    """Wait until something is so, or too long."""
    until = time.perf_counter() + seconds
    while not what() and time.perf_counter() < until:
        yield 0.1


def steps(seen: dict):
    """The run, a generator: yields the seconds until it wants to go on."""
    hand, running, reviews = Hand(), part("ui.running"), part("ui.reviews")
    window = bpy.context.window_manager.windows[0]
    area = max((a for a in window.screen.areas if a.type == "VIEW_3D"), key=lambda a: a.width * a.height)
    view = next(r for r in area.regions if r.type == "WINDOW")
    in_view = {"window": window, "area": area, "region": view}
    with bpy.context.temp_override(**in_view):
        lay_out()
    area.spaces.active.show_region_ui = True
    yield 1.0
    sidebar = next(r for r in area.regions if r.type == "UI")
    sidebar.active_panel_category = "NSM"
    with bpy.context.temp_override(**in_view):
        bpy.ops.ed.undo_push(message="laid out")
    yield 1.5
    seen["blender"] = bpy.app.version_string
    seen["registered"] = hasattr(bpy.types, "NSM_OT_generate")

    def is_before() -> bool:
        hero = bpy.data.objects.get("Character")
        same = hero is not None and pose(hero) == before and not bpy.data.actions
        return same and running.current() is None

    # ------- a character and the queue: the first two small square buttons are the plus of each
    def buttons(name: str, wide: bool):
        """The sidebar's small buttons, or the high wide ones, once panels stand still and there are some."""
        found, before, top = [], None, window.height - sidebar.y - sidebar.height
        while not found or found != before:
            yield 0.6
            before, picture = found, hand.photograph(name)
            found = [b for b in hand.buttons(picture) if sidebar.x <= b[0] < sidebar.x + sidebar.width]
            found = [b for b in found if b[1] > top and (b[2] > 150 and b[3] > 24 if wide else b[2] < 40)]
        return found

    def press(button: tuple[int, int, int, int]):
        x, y, width, height = button
        yield from hand.click(x + width / 2, y + height / 2)

    small = yield from buttons("empty", wide=False)
    yield from press(small[0])
    yield from wait_for(lambda: "Character" in bpy.data.objects, 5)
    character = bpy.data.objects["Character"]
    seen["character"] = bpy.context.scene.nsm.character == character
    before = pose(character)
    select("Stool")
    with bpy.context.temp_override(**in_view):
        bpy.ops.view3d.view_all(use_all_regions=False)
    yield 0.7
    small = yield from buttons("character", wide=False)
    yield from press(small[1])
    yield from wait_for(lambda: len(queue()), 5)
    seen["queue"] = [(row.action, row.object and row.object.name) for row in queue()]
    queue()[0].hold = 0.2
    with bpy.context.temp_override(**in_view):
        bpy.ops.wm.save_as_mainfile(filepath=str(OUT / "window.blend"))
    yield 0.7

    def generate():
        wide = yield from buttons("queue", wide=True)
        yield from press(wide[0])
        yield from wait_for(lambda: running.current() is not None, 10)

    # ------- ESC in the middle
    yield from generate()
    seen["started"] = running.current() is not None
    while (state := running.current()) is not None and (pose(character) == before or state.fraction < 0.3):
        yield 0.1
    hand.photograph("growing")
    seen["grew"] = running.current() is not None and pose(character) != before
    yield from hand.key("Escape")
    yield from wait_for(lambda: running.current() is None, 10)
    seen["put_back"] = is_before()
    yield 0.5
    hand.photograph("escaped")

    # ------- a whole take
    begun = time.perf_counter()
    yield from generate()
    yield from wait_for(lambda: running.current() is None, _LATE)
    seen["take_s"] = time.perf_counter() - begun
    yield 1.0
    scene = bpy.context.scene
    seen["results"] = [row.text for row in scene.nsm.results]
    seen["actions"] = [action.name for action in bpy.data.actions]
    seen["offered"] = reviews.pending(scene) is not None
    hand.photograph("done")

    # ------- undo and redo, by keys over the view
    middle = area.x + 200, window.height - area.y - area.height // 2
    subprocess.Popen(["xdotool", "mousemove", *map(str, middle)])
    yield 0.5
    yield from hand.key("ctrl+z")
    yield 1.5
    seen["undone"] = is_before()
    hand.photograph("undone")
    yield from hand.key("ctrl+shift+z")
    yield 1.5
    seen["redone"] = [action.name for action in bpy.data.actions] == seen["actions"]
    hand.photograph("redone")

    # ------- save by a key, open again
    yield from hand.key("ctrl+s")
    yield 1.5
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.wm.open_mainfile(filepath=str(OUT / "window.blend"))
    yield 1.5
    scene = bpy.context.scene
    seen["saved"] = [action.name for action in bpy.data.actions]
    seen["still_offered"] = reviews.pending(scene) is not None
    hand.photograph("opened")
    bpy.ops.nsm.take_reject()
    yield 0.5
    seen["rejected"] = is_before()
    hand.photograph("rejected")

    # ------- what ends a take from outside, in the real program
    for name, event in (
        ("another file", lambda: bpy.ops.wm.read_homefile(use_empty=False)),
        ("scripts reloaded", lambda: bpy.ops.script.reload()),
        ("switched off", lambda: bpy.ops.preferences.addon_disable(module=PACKAGE)),
    ):
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            bpy.ops.wm.open_mainfile(filepath=str(OUT / "window.blend"))
        yield 1.0
        running = part("ui.running")
        if reviews_pending := part("ui.reviews").pending(bpy.context.scene):
            part("ui.reviews").reject(bpy.context.scene, reviews_pending)
        window = bpy.context.window_manager.windows[0]
        area = next(a for a in window.screen.areas if a.type == "VIEW_3D")
        with bpy.context.temp_override(
            window=window, area=area, region=next(r for r in area.regions if r.type == "WINDOW")
        ):
            bpy.ops.nsm.generate("INVOKE_DEFAULT")
        hero = bpy.data.objects["Character"]
        yield from wait_for(lambda hero=hero: pose(hero) != before, 60)
        grew = running.current() is not None
        refused = False
        with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
            try:
                event()
            except RuntimeError as error:  # Blender itself lets nobody reload scripts in the middle of this
                refused = "running modal operators" in str(error)
        if refused:
            yield from hand.key("Escape")
        yield 1.0
        seen[name] = grew and running.current() is None and (name == "another file" or is_before())
    hand.photograph("switched-off")
    seen["gone"] = not hasattr(bpy.types, "NSM_OT_generate")
    seen["whole"] = True


def drive() -> None:
    """Have Blender's timer go through the run, write what was seen, and quit."""
    seen: dict = {"whole": False}
    run = steps(seen)

    def go() -> float | None:
        try:
            return next(run)
        except StopIteration:
            pass
        except Exception:
            seen["error"] = traceback.format_exc()[-1500:]
        (OUT / "seen.json").write_text(json.dumps(seen, indent=1), encoding="utf-8")
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(go, first_interval=1.0, persistent=True)


theme = bpy.context.preferences.themes[0].user_interface
for colours in (theme.wcol_tool, theme.wcol_toolbar_item):
    colours.inner = (*COLOUR, 1.0)
theme.wcol_toolbar_item.inner = (0.2, 0.2, 0.2, 1.0)
bpy.context.preferences.view.show_splash = False
bpy.context.preferences.system.use_region_overlap = False  # nothing stands behind the sidebar
bpy.context.preferences.system.viewport_aa = "OFF"
drive()
