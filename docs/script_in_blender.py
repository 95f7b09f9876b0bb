"""A take by script: the bundled character sits down on a crate, and keys, report and picture are saved in the
folder that is named.

``python docs/script_in_blender.py out`` with the bpy package.  In a Blender that has the extension, the first
import is ``from bl_ext.user_default import nsm_blender as nsm``, and the scene is the one that is open.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy

import nsm_blender as nsm

out = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
bpy.ops.mesh.primitive_cube_add(location=(0.0, 0.0, 0.22), scale=(0.25, 0.25, 0.22))
crate = bpy.context.object
character = nsm.add_character((0.8, -1.2, 0.0))

spec = nsm.TakeSpec(character, [nsm.GoalSpec("sit", crate, hold=1.0)], name="Sit", start_frame=1, seed=0)
take = nsm.finish(nsm.generate(spec, bpy.context.scene))  # or step through the generator to see its progress

for goal in take.report["goals"]:
    print(nsm.goal_line(goal))
nsm.write_json(out / "sit.json", take.report)
nsm.contact_sheet(take.keyed, out / "sit.png", tiles=4, columns=4)
nsm.save_blend(out / "sit.blend")
