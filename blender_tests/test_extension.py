"""The built zip installs into a Blender that knows nothing of this repository, and works there."""

from __future__ import annotations

import io
import os
import subprocess
import sys
import tomllib
import zipfile
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


def require_small_and_whole(extension: Path) -> None:
    """The zip is small, brings its licence and credits, and neither PyTorch nor a wish for the network."""
    assert extension.stat().st_size < 60e6
    with zipfile.ZipFile(extension) as packed:
        names = packed.namelist()
        assert b"GNU GENERAL PUBLIC LICENSE" in packed.read("LICENSE")
        manifest = tomllib.loads(packed.read("blender_manifest.toml").decode())
        wheels = [name for name in names if name.endswith(".whl")]
        inner = zipfile.ZipFile(io.BytesIO(packed.read(wheels[0])))
    assert len(wheels) == 1 and "network" not in manifest["permissions"]
    credits = inner.read("nsm_core/weights/CREDITS.md").decode()
    assert "Carnegie Mellon" in credits and "CC BY" in credits
    assert "nsm_core/weights/nsm.npz" in inner.namelist()
    assert not any("torch" in Path(name).parts for name in (*names, *inner.namelist()))


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
    require_small_and_whole(tmp_path / "nsm.zip")
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
