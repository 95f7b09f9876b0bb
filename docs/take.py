"""Render docs/take.png: the demo's take at the moments that show its actions.  ``python docs/take.py`` under
the bpy wheel.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy
import numpy as np

from nsm_blender import demo
from nsm_blender.pictures import render
from nsm_blender.takes import Take, TakeSpec, finish, generate
from nsm_core.conventions import CLIMB, HAND_CONTACTS, SIT

HERE = Path(__file__).resolve().parent


def moments(take: Take) -> list[int]:
    """Frames of a take of the demo that show what it does, in their order."""
    result, goals = take.result, take.result.goals
    sit, door, box, podium, run = goals
    turned = np.abs(np.unwrap(result.props["Door"][:, 3]) - result.props["Door"][0, 3])
    height = result.props["Box"][:, 2] - result.props["Box"][0, 2]
    held = result.contacts[:, HAND_CONTACTS].min(1) > 0.5
    hips = result.hips_position
    speed = np.append(np.linalg.norm(np.diff(hips[:, :2], axis=0), axis=1), 0)

    def first(there: np.ndarray, after: int) -> int:
        """The first frame from ``after`` on where something holds."""
        return after + int(np.argmax(there[after:]))

    seated = first(result.action[:, SIT] > 0.95, 0)
    grasp = first(held, box.start_frame)
    lifted = first(height > 0.3, grasp)
    climbing = first(result.action[:, CLIMB] > 0.5, podium.start_frame)
    down = first(hips[:, 2] < hips[run.start_frame, 2] - 0.2, run.start_frame)
    picks = [
        seated // 2,
        seated + 20,
        first(turned > np.radians(8), door.start_frame),
        first(turned > np.radians(55), door.start_frame),
        (door.end_frame + grasp) // 2,
        grasp,
        (lifted + box.end_frame) // 2 - 15,
        first(~held, lifted) - 4,
        climbing + 26,
        podium.end_frame,
        down,
        down + int(np.argmax(speed[down:])),
    ]
    return [take.keyed.frame_start + frame for frame in picks]


def main(path: Path = HERE / "take.png") -> None:
    """Make the take and its picture."""
    house, character = demo.build_scene()
    spec = TakeSpec(character, demo.goals_in(house), name="Demo")
    take = finish(generate(spec, bpy.context.scene))
    render.contact_sheet(
        take.keyed,
        path,
        columns=4,
        size=(320, 264),
        direction=house.view,
        frames=moments(take),
        numbers=False,
    )


if __name__ == "__main__":
    main()
