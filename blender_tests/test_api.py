"""What a script in Blender needs stands in nsm_blender itself and does what docs/script_in_blender.py
shows.
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import nsm_blender
from nsm_blender.pictures.outputs import blend_is_whole, png_is_whole

ROOT = Path(__file__).resolve().parents[1]


def test_public_names_are_told_to_type_checkers_too():
    told = {
        alias.asname or alias.name
        for node in ast.parse(Path(nsm_blender.__file__).read_text(encoding="utf-8")).body
        if isinstance(node, ast.If)
        for line in node.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    assert told == set(nsm_blender._KEPT) == set(nsm_blender.__all__) - {"register", "unregister"}
    assert all(callable(getattr(nsm_blender, name)) for name in nsm_blender.__all__)
    assert not hasattr(nsm_blender, "Gaol")


def test_the_script_of_the_documents(tmp_path):
    done = subprocess.run(
        [sys.executable, str(ROOT / "docs" / "script_in_blender.py"), str(tmp_path)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert "sat down after" in done.stdout
    report = json.loads((tmp_path / "sit.json").read_text(encoding="utf-8"))
    assert [g["reached"] for g in report["goals"]] == [True]
    assert png_is_whole(tmp_path / "sit.png") and blend_is_whole(tmp_path / "sit.blend")
