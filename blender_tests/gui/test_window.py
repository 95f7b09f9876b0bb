"""The built extension in the real application: installed from its zip, worked by mouse and keys.

It takes about a minute, so it runs where it is asked for (``dev.py test --window`` or ``--matrix``) and the
machine has a graphical Blender; otherwise it says why not.  Pictures of the screen are kept in
``out/window``.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import window

import dev

OUT = window.ROOT / "out" / "window"


@pytest.fixture(scope="module")
def seen() -> dict:
    """What a run in the window has seen."""
    if not os.environ.get("NSM_WINDOW"):
        pytest.skip("the window is asked for by `dev.py test --window` or `--matrix`")
    reason = window.missing()
    if reason:
        pytest.skip(reason)
    pytest.importorskip("setuptools")
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    # The profile lies with the pictures: a Blender in a root of its own sees the project, and little else.
    profile, extension = OUT / "profile", OUT / "nsm.zip"
    python = Path(sys.executable)
    stage = dev.stage_extension(python, OUT / "scratch")
    build = [sys.executable, dev.extension_tool(python), "build", "--source-dir", stage]
    subprocess.run([*build, "--output-filepath", extension], check=True, capture_output=True)
    try:
        refused = window.install(extension, profile)
        done = window.run(Path(window.__file__).with_name("press.py"), profile, str(OUT), timeout=500)
        (OUT / "log.txt").write_text(done.stdout + done.stderr, encoding="utf-8")
    finally:
        for folder in (profile, OUT / "scratch"):
            shutil.rmtree(folder, ignore_errors=True)
    if "Unable to open a display" in done.stdout + done.stderr:
        pytest.skip("this Blender cannot open a window on the screen")
    assert not refused, refused
    assert (OUT / "seen.json").exists(), f"Blender ended with {done.returncode}; see {OUT / 'log.txt'}"
    return json.loads((OUT / "seen.json").read_text(encoding="utf-8"))


def test_the_way_of_a_take_by_mouse_and_keys(seen):
    assert "error" not in seen, seen["error"]
    assert seen["registered"] and seen["whole"]
    assert seen["character"] and seen["queue"] == [["sit", "Stool"]]  # the plus of each was clicked
    assert seen["started"] and seen["grew"] and seen["put_back"]  # Generate, and ESC in the middle
    assert any("sat down" in line for line in seen["results"]), seen["results"]
    assert len(seen["actions"]) == 1 and seen["offered"]


def test_undo_redo_and_files(seen):
    assert seen["undone"] and seen["redone"]
    assert seen["saved"] == seen["actions"] and seen["still_offered"] and seen["rejected"]


@pytest.mark.parametrize("what", ["another file", "scripts reloaded", "switched off"])
def test_what_ends_a_take_from_outside(seen, what):
    assert seen[what]
    assert seen["gone"]
