"""The built zip installs into a Blender that knows nothing of this repository, and works there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import bpy
import pytest

import dev

CODE = """
import bpy, sys
install = bpy.ops.extensions.package_install_files
assert install(filepath=sys.argv[1], repo="user_default", enable_on_install=True) == {"FINISHED"}
import nsm_core
assert "extensions" in nsm_core.__file__, nsm_core.__file__
assert [a for a in bpy.context.preferences.addons.keys() if a.endswith(".nsm_blender")]
assert bpy.ops.nsm.add_character() == {"FINISHED"}
assert len(bpy.data.objects["Character"].data.bones) >= 23
bpy.ops.preferences.addon_disable(module="bl_ext.user_default.nsm_blender")
assert not hasattr(bpy.types, "NSM_OT_add_character")
print("all well")
"""


@pytest.mark.skipif(
    bool(bpy.app.binary_path), reason="installs into the bpy package, not into a running application"
)
def test_the_zip_validates_installs_and_works_away_from_the_repository(tmp_path):
    pytest.importorskip("setuptools")
    python = Path(sys.executable)
    stage = dev.stage_extension(python, tmp_path / "scratch")
    tool = [sys.executable, str(dev.extension_tool(python))]
    for verb in (
        ["validate", str(stage)],
        ["build", "--source-dir", str(stage), "--output-filepath", str(tmp_path / "nsm.zip")],
    ):
        done = subprocess.run([*tool, *verb], capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    home = tmp_path / "home"
    home.mkdir()
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"} | {
        "BLENDER_USER_RESOURCES": str(home)
    }
    done = subprocess.run(
        [sys.executable, "-c", CODE, str(tmp_path / "nsm.zip")],
        cwd=home,
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0 and "all well" in done.stdout, done.stdout + done.stderr
