"""Draw what Fill makes of motions with a gap, and print how far it is off.

    python docs/fills.py FOLDER CAPTURES [NAME ...] [--rig FILE]

For each of the motions of ``fill_cases.py``, or those that are named, FOLDER gets a sheet: from the side and
from the front, the motion as it was, interpolated, and filled, poses that stay in magenta.  CAPTURES is a
folder of BVH files, FILE a .glb with Mixamo's names.  All figures are of the bones that the scene shows, at
its frames: means over joints for how far off, of feet that stand for the slide, the largest else.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np
from fill_cases import CASES, Case, Sources
from mathutils import Vector
from strobe import KEYED, MADE, write

import nsm_blender as nsm
from nsm_blender.animation.rate import scene_fps
from nsm_blender.keys.keyed import discard_take
from nsm_blender.leaving import leave
from nsm_blender.pictures.labels import stamp
from nsm_blender.pictures.outputs import scratch_folder
from nsm_blender.pictures.render import join_tiles, read_png, render_still
from nsm_blender.pictures.studio import studio
from nsm_blender.prepare import figure_of
from nsm_blender.rigs.armature import Placement, read_world_pose
from nsm_blender.rigs.skin import skins
from nsm_blender.world.below import ground_below, solids_near
from nsm_blender.world.colliders import solid_seen
from nsm_blender.world.evaluated import Snapshot
from nsm_blender.world.frame import WorldFrame
from nsm_core.body.capsules import penetration_depths
from nsm_core.errors import NsmError
from nsm_core.evaluation.measures.motion import below_floor, foot_sliding, jumps

TILES, TILE = 8, (150, 230)  # within the gap; pixels
TALL = 2.15  # metres of a tile's height
BESIDE = 4  # frames before and after the gap that are shown, too
HEAD = "| fill | frames | | off cm | slide cm/s | gap before blend cm | under ground cm | in things cm |" + (
    " jolt cm | turn a frame | s |\n|" + "---|" * 11
)


@dataclass
class Shown:
    """What the scene shows: joints (T, 23, 3), hips (T, 3), core frame, and rotations (T, 23, 4)."""

    joints: np.ndarray
    hips: np.ndarray
    local: np.ndarray


class Looker:
    """Looks at a case's character over its frames, and measures what it sees."""

    def __init__(self, case: Case) -> None:
        scene = bpy.context.scene
        self.case, self.fps = case, scene_fps(scene)
        self.frame, self.placement = WorldFrame.of(case.character), Placement.of(case.character)
        self.frames = range(case.start - BESIDE, case.end + BESIDE + 1)
        self.figure = nsm.finish(figure_of(case.character))
        self.before = self.shown()
        snapshot = nsm.finish(Snapshot.take(bpy.context.evaluated_depsgraph_get))
        seen, way = solid_seen(snapshot, scene, [case.character]), self.before.hips
        self.ground = ground_below(snapshot, scene, [case.character], self.frame, way, 0.0)
        self.solids = solids_near(seen, self.frame, way)

    def shown(self) -> Shown:
        """What the bones do now."""
        each = []
        for frame in self.frames:
            bpy.context.scene.frame_set(frame)
            joints, hips, local = read_world_pose(self.case.character, self.placement)
            each.append((self.frame.to_core(joints), self.frame.to_core(hips), local))
        return Shown(*(np.stack(column) for column in zip(*each, strict=True)))

    def row(self, name: str, method: str, missed: float | None, seconds: float | None) -> str:
        """A line of the table."""
        now = self.shown()
        gap = slice(BESIDE, -BESIDE)
        off = np.linalg.norm(now.joints - self.before.joints, axis=-1)[gap].mean()
        slide = foot_sliding(now.joints[gap], self.fps, weighted=True, ground=self.ground)
        under = below_floor(now.hips[gap], now.local[gap], self.ground, self.figure)["below_floor_cm"]
        deep = [penetration_depths(now.hips, now.local, each, self.figure)[gap].max() for each in self.solids]
        near = slice(BESIDE - 2, 2 - BESIDE)  # both seams among them
        pops = jumps(now.hips[near], now.local[near], self.figure.offsets)
        cells = [
            name, str(self.case.end - self.case.start - 1), method, f"{100 * off:.1f}", f"{slide:.1f}",
            "" if missed is None else f"{missed:.1f}", f"{under:.1f}", f"{100 * max(deep, default=0.0):.1f}",
            f"{pops['jolt_cm']:.1f}", f"{pops['turn_per_frame_deg']:.0f}",
            "" if seconds is None else f"{seconds:.2f}",
        ]  # fmt: skip
        return "| " + " | ".join(cells) + " |"


class Camera:
    """Draws rows of tiles of a case, the camera going evenly from the pose before the gap to the one after
    it, so that rows are comparable.
    """

    def __init__(self, looker: Looker, tiles: int = TILES) -> None:
        case, frames = looker.case, list(looker.frames)
        self.case = case
        self.frames = [frames[0], *np.linspace(case.start, case.end, tiles).round().astype(int), frames[-1]]
        rows = [frames.index(case.start), frames.index(case.end)]
        ends = looker.frame.to_world(looker.before.hips[rows])
        ends[:, 2] = looker.frame.to_world(looker.before.joints[rows])[..., 2].min(1) + 0.92
        self.ends = ends  # of what the camera looks at
        way = (ends[1] - ends[0])[:2]
        hip = looker.before.joints[BESIDE]
        across = hip[15] - hip[19]
        ahead = way if np.linalg.norm(way) > 0.4 else np.array((-across[1], across[0]))
        ahead = ahead / np.linalg.norm(ahead)
        self.views = {"side": (ahead[1], -ahead[0]), "front": tuple(ahead)}

    def row(self, view: str, colour: tuple[float, ...]) -> list[np.ndarray]:
        """Tiles of what the scene shows; frames within the gap in ``colour``."""
        scene, tiles = bpy.context.scene, []
        away = Vector((*self.views[view], 0.3)).normalized() * 20
        size = TILE  # smoothed by the renderer
        with scratch_folder() as folder, studio(scene, size, fast=True) as made:
            scene.render.image_settings.file_format = "PNG"
            made.camera.data.type, made.camera.data.ortho_scale = "ORTHO", TALL
            made.camera.data.clip_end = 60.0
            made.camera.rotation_euler = (-away).to_track_quat("-Z", "Y").to_euler()
            for frame in self.frames:
                inside = self.case.start < frame < self.case.end
                _paint(self.case.character, colour if inside else KEYED)
                scene.frame_set(int(frame))
                share = np.clip((frame - self.case.start) / (self.case.end - self.case.start), -0.2, 1.2)
                middle = self.ends[0] + share * (self.ends[1] - self.ends[0])
                made.camera.location = Vector(middle) + away
                path = folder / f"{frame:05d}.png"
                scene.render.filepath = str(path)
                render_still(path, scene)
                picture = read_png(path)
                stamp(picture, str(frame), size=1)
                tiles.append(picture)
        return tiles


def _paint(character: bpy.types.Object, colour: tuple[float, ...]) -> None:
    for body in skins(character):
        if not any(slot.material for slot in body.material_slots):
            body.data.materials.clear()
            body.data.materials.append(bpy.data.materials.new("Shown"))
        for slot in body.material_slots:
            if slot.material is not None:
                slot.material.diffuse_color = colour


def sheet(name: str, sources: Sources, folder: Path) -> list[str]:
    """Draw the sheet of a case; lines of its table."""
    case = CASES[name](sources)
    looker = Looker(case)
    camera = Camera(looker)
    rows = {view: [camera.row(view, KEYED)] for view in camera.views}
    lines = [looker.row(name, "as it was", None, None)]
    for method in ("interpolate", "network"):
        spec = nsm.FillSpec(case.character, case.start, case.end, replace=True, method=method)
        began = time.perf_counter()
        done = nsm.finish(nsm.fill_gap(spec, bpy.context.scene))
        took = time.perf_counter() - began
        missed = done.report["gap_before_blend_cm"] if method == "network" else None
        lines.append(looker.row(name, method, missed, took))
        for note in done.report["notes"]:
            print("  ", method, note)
        for view, drawn in rows.items():
            drawn.append(camera.row(view, MADE if method == "network" else (0.45, 0.52, 0.62, 1.0)))
        discard_take(done.keyed)
    tiles = [tile for drawn in rows.values() for row in drawn for tile in row]
    write(folder / f"fill_{name}.png", join_tiles(tiles, len(camera.frames), 2))
    return lines


def main(arguments: list[str]) -> int:
    """Draw sheets; returns the exit code."""
    parser = argparse.ArgumentParser(prog="fills", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("captures", type=Path)
    parser.add_argument("names", nargs="*", choices=[[], *CASES], metavar="NAME")
    parser.add_argument("--rig", type=Path, default=None)
    a = parser.parse_args(arguments)
    a.folder.mkdir(parents=True, exist_ok=True)
    sources, table = Sources(a.captures, a.rig), []
    for name in a.names or CASES:
        print(name, flush=True)
        try:
            table += sheet(name, sources, a.folder)
        except NsmError as error:
            print("  ", error)
    print("\n".join((HEAD, *table)))
    return 0


if __name__ == "__main__":
    leave(main(sys.argv[1:]))
