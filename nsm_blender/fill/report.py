"""The report of a fill: one dict for the sidebar, for batch jobs and for tests."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import bpy
import numpy as np

from nsm_core.body.skeleton import forward_kinematics
from nsm_core.evaluation.measures.motion import below_floor, foot_sliding
from nsm_core.rotations import Array

from ..keys.keyed import KeyedTake
from ..progress import Progress, staged
from ..rigs.armature import Placement, read_world_pose
from ..rigs.mount import over_frames
from ..world.frame import WorldFrame
from .gap import AskedGap
from .reading import Made
from .spec import FillSpec

_OFF = 0.01  # metres of the character from which what is seen is not what was made


def build_report(
    spec: FillSpec,
    scene: bpy.types.Scene,
    frame: WorldFrame,
    asked: AskedGap,
    made: list[Made],
    rows_of: list[tuple[Array, Array, Array]],
    keyed: KeyedTake,
    kept: dict[str, int],
) -> Generator[Progress, None, dict[str, Any]]:
    """Gather the figures of a fill, in the units their names end in, as plain values for JSON.

    ``rows_of`` are, of each gap, the frames keyed and the motion made there.  ``gap_before_blend_cm`` is by
    how much the method itself missed the pose after the gap; slide and penetration are measured on the bones
    that the scene shows, in the character's own metres.
    """
    placement, off, slide, deep = Placement.of(spec.character), 0.0, [0.0], [0.0]
    for one, (rows, hips, local) in zip(made, rows_of, strict=True):

        def read() -> tuple[Array, Array, Array]:
            joints, hips, local = read_world_pose(spec.character, placement)
            return frame.to_core(joints), frame.to_core(hips), local

        seen = yield from staged("Checking", over_frames(scene, rows.tolist(), read))
        joints, seen_hips, seen_local = (np.stack(each) for each in zip(*seen, strict=True))
        wanted, _ = forward_kinematics(frame.to_core(hips), local, placement.own_offsets.astype(np.float64))
        off = max(off, float(np.linalg.norm(joints - wanted, axis=-1).max()))
        slide.append(foot_sliding(joints, keyed.fps, weighted=True, ground=one.gap.ground))
        deep.append(below_floor(seen_hips, seen_local, one.gap.ground, one.gap.figure)["below_floor_cm"])
    notes = list(dict.fromkeys(note for one in made for note in one.filled.notes))
    if off > _OFF and not kept and spec.bones is None:
        notes.append(
            f"On screen a joint is up to {100 * off:.1f} cm from where it was made; mute what moves it and "
            "fill again."
        )
    return {
        "name": keyed.action.name,
        "from": asked.start,
        "to": asked.end,
        "frames": int(sum(len(stretch.frames) for stretch in asked.stretches)),
        "fps": round(keyed.fps, 4),
        "method": spec.method,
        "seed": spec.seed,
        "gap_before_blend_cm": round(100 * max(one.filled.gap_before_blend for one in made), 3),
        "slide_cm_s": round(max(slide), 3),
        "penetration_cm": round(max(deep), 3),
        "shown_off_cm": round(100 * off, 3),
        "bones": None if spec.bones is None else sorted(spec.bones),
        "kept": kept_sentence(kept),
        "notes": notes,
    }


def kept_sentence(kept: dict[str, int]) -> str:
    """What of the animator's keys in the gap was kept, for the animator; empty where there were none."""
    if not kept:
        return ""
    names, count = list(kept), sum(kept.values())
    told = ", ".join(names[:4]) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
    if count == 1:
        return f"Your key on {told} in the gap was kept; the new motion leads to it."
    return f"Your {count} keys on {told} in the gap were kept; the new motion leads to them."


def fill_lines(report: dict[str, Any]) -> list[tuple[str, bool]]:
    """Lines about a fill for the sidebar, each with whether it is good news."""
    count = report["frames"]
    whose = (
        ""
        if report["bones"] is None
        else f" of {len(report['bones'])} {'bone' if len(report['bones']) == 1 else 'bones'}"
    )
    text = (
        f"{count} {'frame' if count == 1 else 'frames'}{whose} filled between {report['from']:g} and "
        f"{report['to']:g}; feet that stand slide {report['slide_cm_s']:.1f} cm/s."
    )
    lines = [(text, True)]
    if report["kept"]:
        lines.append((report["kept"], True))
    return lines + [(note, False) for note in report["notes"]]
