"""A take without Blender: a character walks to a chair, sits down, and the motion is saved.  ``python
docs/script.py sit.bvh``.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # not needed where nsm_core is installed

import numpy as np

import nsm_core as nsm

model = nsm.load_model()  # the shipped weights

# What stands there: pieces made of cuboids, and cuboids of one's own.  Metres, Z up, heading 0 faces -Y.
chair = nsm.make_furniture("chair", np.random.default_rng(1), seat_height=0.45)
# Place, heading, low and high corners about the place, metres.
wall = ((0.0, 1.0), 0.0, [(-2.0, -0.1, 0.0)], [(2.0, 0.1, 2.5)])
solids = nsm.Cuboids([((0.0, 0.0), 0.0, chair.mins, chair.maxs), wall])

# What is wanted: to sit on the chair for a second, then to stand a step away from it.
goals = [
    nsm.sit_goal(chair, np.zeros(2), 0.0, hold=1.0),
    nsm.Goal("walk", "away", (0.8, -1.2, 0.0), heading=0.5, hold=0.5),
]

take = nsm.roll(model, nsm.TakeRequest((1.0, -1.5), 0.3, goals, solids, seed=0))
for goal in take.goals:
    print(
        f"{goal.action} {goal.object}: {'reached' if goal.reached else 'not reached'}, "
        f"{goal.position_error_cm:.1f} cm off"
    )
nsm.write_bvh(sys.argv[1] if len(sys.argv) > 1 else "sit.bvh", take.hips_position, take.local_rotations)
