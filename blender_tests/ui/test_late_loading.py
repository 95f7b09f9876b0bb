"""An add-on that is switched on and not used costs next to nothing: what computes is loaded when used."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# What menus and panels are made of.
SMALL = {
    "nsm_blender", "nsm_blender.animation", "nsm_blender.animation.identity",
    "nsm_blender.animation.rate", "nsm_blender.collecting", "nsm_blender.goals", "nsm_blender.goals.icons",
    "nsm_blender.goals.spec", "nsm_blender.overlays", "nsm_blender.overlays.layers", "nsm_blender.warm_up",
    "nsm_core", "nsm_core.earlier", "nsm_core.errors", "nsm_core.world", "nsm_core.world.actions",
}  # fmt: skip
CODE = """
import json, sys
import bpy
before = set(sys.modules)
import nsm_blender
nsm_blender.register()
print(json.dumps(sorted(set(sys.modules) - before)), flush=True)
from nsm_blender.leaving import leave
leave(0)
"""


def test_registering_loads_menus_and_panels_alone():
    done = subprocess.run([sys.executable, "-c", CODE], cwd=ROOT, capture_output=True, text=True)
    loaded = json.loads(done.stdout.splitlines()[-1])
    ours = {name for name in loaded if name.startswith(("nsm_core", "nsm_blender"))}
    more = {name for name in ours - SMALL if not name.startswith("nsm_blender.ui")}
    assert "nsm_blender.ui.panels" in ours
    assert not more, f"import these in the functions that use them: {sorted(more)}"
    assert "numpy" not in loaded
