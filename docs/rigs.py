"""Try the add-on on a folder of rigs and on the bundled character at several sizes, and write docs/rigs.md.

    python docs/rigs.py FOLDER [NAME ...] [--only ACTION ...] [--sheets FOLDER]

FOLDER holds .glb, .vrm and .blend files; with names only the files whose name holds one of them are tried,
with --only those actions, and their lines take the place of the old ones.  With --sheets every take is
rendered from the side and from the front.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rig_trials import STAGES, Outcome, bundled, perform, worst_limb

import nsm_blender
from nsm_blender.leaving import leave
from nsm_blender.pictures import render
from nsm_blender.rigs.armature import Placement
from nsm_blender.rigs.bone_map import require_map
from nsm_blender.rigs.skin import skins
from nsm_core.body.skeleton import J
from nsm_core.errors import NsmError

HERE = Path(__file__).resolve().parent
SIZES = (1.0, 1.3, 1.6, 1.9, 2.2)
BODIES = {  # height, arms, legs and bulk of the bundled character
    **{f"bundled, {size} m": (size, 1.0, 1.0, 1.0) for size in SIZES},
    "bundled, long arms": (1.75, 1.25, 1.0, 1.0),
    "bundled, short legs": (1.75, 1.0, 0.8, 1.0),
    "bundled, bulky": (1.75, 1.0, 1.0, 1.4),
}
VIEWS = {"side": (1.0, 0.0, 0.25), "front": (0.2, -1.0, 0.25)}
HEAD = """# Rigs

What `python docs/rigs.py FOLDER` made of a folder of rigs, and of the bundled character at other sizes and
proportions.  Furniture, box, door and podium are scaled with the legs of each.

## What is found

- *Size*: metres of the rig to a metre of the network's body, by the height of the hips.
- *Fit*: how well the bones that were found fit a body.
- *Limbs*: largest angle between a limb as evaluated and as in a motion through a wide range of poses.

| Rig | Bones by | Joints | Fit | Size | Limbs |
|---|---|---|---|---|---|
"""
ACTIONS = """
## How actions end

Measured on the bones, the skin and the things that the scene shows; lengths in the scene's centimetres.

- *Hips*: how far they are from where they should be when the goal is judged; of a carry, the box.
- *Hands*: how far wrists are from where they take hold.
- *Slide*: a second, by which toe joints move that are within a centimetre of their lowest.
- *Under*: how deep the skin comes under the floor at any moment, feet, fingers and all.
- *Inside*: how deep the body, as the capsules fitted to its skin, is inside anything solid.

| Rig | Action | Reached | Hips | Hands | Slide | Under | Inside |
|---|---|---|---|---|---|---|---|
"""


def load(path: Path, scratch: Path) -> list[bpy.types.Object]:
    """Open a file of its own; its armatures."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    if path.suffix == ".blend":
        bpy.ops.wm.open_mainfile(filepath=str(path))
    else:
        copied = scratch / f"{path.stem}.glb"  # a .vrm is a .glb by another name
        shutil.copy(path, copied)
        bpy.ops.import_scene.gltf(filepath=str(copied))
    scene = bpy.context.scene
    scene.render.fps, scene.render.fps_base = 30, 1.0
    for thing in list(bpy.data.objects):
        if thing.type in ("CAMERA", "LIGHT") or thing.name.startswith("Icosphere"):  # shapes of bones
            bpy.data.objects.remove(thing)
    return [thing for thing in bpy.data.objects if thing.type == "ARMATURE"]


def characters(
    folder: Path, names: list[str], scratch: Path
) -> Iterator[tuple[str, Callable[[], bpy.types.Object]]]:
    """Every character by its name, with what brings it into a scene of its own."""
    for path in sorted(folder.iterdir()):
        wanted = path.suffix in (".glb", ".vrm", ".blend") and (
            not names or any(n in path.name for n in names)
        )
        for number in range(len(load(path, scratch)) if wanted else 0):
            yield (
                f"{path.name} {load(path, scratch)[number].name}",
                lambda p=path, n=number: _only(load(p, scratch), n),
            )
    for name, measures in BODIES.items():
        if not names or any(n in name for n in names):
            yield name, lambda m=measures: _bundled(*m)


def _only(rigs: list[bpy.types.Object], number: int) -> bpy.types.Object:
    """One of a file's armatures; the others are removed, and what they wear."""
    for other in rigs[:number] + rigs[number + 1 :]:
        for thing in [*skins(other), other]:
            bpy.data.objects.remove(thing)
    return rigs[number]


def _bundled(height: float, arms: float, legs: float, bulk: float) -> bpy.types.Object:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.render.fps = 30
    return bundled(height, arms, legs, bulk)


def found(name: str, rig: bpy.types.Object) -> str:
    """A line on what is found of a rig."""
    try:
        bone_map, scale = require_map(rig), Placement.of(rig).scale
    except NsmError as error:
        return f"| {name} | {error} | | | | |"
    by = f"{bone_map.family} | {len(bone_map.joints)} of {J} | {bone_map.score:.2f}"
    return f"| {name} | {by} | {scale:.2f} | {worst_limb(rig, bone_map, scale):.1f}° |"


def acted(name: str, make: Callable[[], bpy.types.Object], action: str, sheets: Path | None) -> str:
    """A line on how an action ends."""
    try:
        take, o = perform(make(), action)
    except NsmError as error:
        return f"| {name} | {action} | {error} | | | | | |"
    if sheets is not None:
        for view, direction in VIEWS.items():
            path = sheets / f"{name.replace(' ', '_')}_{action}_{view}.png"
            render.contact_sheet(take.keyed, path, tiles=10, columns=5, size=(300, 260), direction=direction)
    return f"| {name} | {action} | {'yes' if o.reached else 'no'} | {_told(o)} |"


def _told(o: Outcome) -> str:
    cells = [f"{o.hips:.1f}" if o.hips is not None else "", f"{o.hands:.1f}" if o.hands is not None else ""]
    return " | ".join([*cells, f"{o.feet:.1f}", f"{o.under:.1f}", f"{o.solids:.1f}"])


def main(folder: str, names: list[str], sheets: str | None, only: list[str]) -> None:
    """Try every character and write the tables."""
    nsm_blender.register()
    path, rows = HERE / "rigs.md", [[], []]
    with tempfile.TemporaryDirectory() as scratch:
        for name, make in characters(Path(folder), names, Path(scratch)):
            rows[0].append(found(name, make()))
            print(rows[0][-1], flush=True)
            for action in only or STAGES:
                rows[1].append(acted(name, make, action, Path(sheets) if sheets else None))
                print(rows[1][-1], flush=True)
            if names or only:
                text = renewed(path.read_text(encoding="utf-8"), [*rows[0], *rows[1]])
                path.write_text(text, encoding="utf-8")
    if not (names or only):
        text = HEAD + "\n".join(rows[0]) + "\n" + ACTIONS + "\n".join(rows[1]) + "\n"
        path.write_text(text, encoding="utf-8")


def renewed(text: str, lines: list[str]) -> str:
    """The page with these lines in the place of those that begin alike; others have no place."""
    out = text.split("\n")
    for line in lines:
        cells = line.split(" | ")
        alike = 2 if cells[1] in STAGES else 1
        for number, row in enumerate(out):
            own = row.split(" | ")
            if own[:alike] == cells[:alike] and (own[1] in STAGES) == (cells[1] in STAGES):
                out[number] = line
    return "\n".join(out)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--sheets")
    parser.add_argument("--only", nargs="+", choices=STAGES, default=[], metavar="ACTION")
    options = parser.parse_args()
    main(options.folder, options.names, options.sheets, options.only)
    sys.stdout.flush()
    leave(0)
