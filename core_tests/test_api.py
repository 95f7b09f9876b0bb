"""What a script needs stands in nsm_core itself, costs nothing until it is used, and does what docs/script.py
shows.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

import nsm_core
from nsm_core.data.captures.reader import read_clip

ROOT = Path(__file__).resolve().parents[1]
FRONT = ROOT / "nsm_core" / "__init__.py"


def python(code: str, *arguments: str) -> str:
    """What a fresh interpreter that lacks all that Blender lacks prints when it runs ``code``."""
    refuse = (
        "import sys\n"
        "class Refuse:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'torch', 'scipy', 'matplotlib', 'trimesh', 'tqdm', 'bpy'}:\n"
        "            raise ImportError('refused: ' + name)\n"
        "sys.meta_path.insert(0, Refuse())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", refuse + code, *arguments], cwd=ROOT, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_importing_loads_nothing_and_asking_loads_what_is_needed():
    code = "import nsm_core\nprint(sorted(m for m in sys.modules if m.startswith(('nsm_core', 'numpy'))))\n"
    assert python(code).strip() == "['nsm_core', 'nsm_core.earlier']"
    assert "nsm_core.control" not in python(code + "nsm_core.Cuboids\n" + code).splitlines()[1]


def test_public_names_are_told_to_type_checkers_too():
    told = {
        alias.asname or alias.name
        for node in ast.parse(FRONT.read_text(encoding="utf-8")).body
        if isinstance(node, ast.If)
        for line in node.body
        if isinstance(line, ast.ImportFrom)
        for alias in line.names
    }
    assert told == set(nsm_core.__all__) == set(nsm_core._KEPT)
    for name in nsm_core.__all__:
        assert getattr(nsm_core, name).__doc__, name
    assert set(nsm_core.__all__) <= set(dir(nsm_core))


def test_an_unknown_name_is_an_error_as_in_any_module():
    with pytest.raises(AttributeError, match="'Goul'"):
        nsm_core.Goul  # noqa: B018
    with pytest.raises(ImportError):
        from nsm_core import Goul  # noqa: F401


def test_the_script_of_the_documents(tmp_path):
    out = tmp_path / "sit.bvh"
    said = python("import runpy\nrunpy.run_path('docs/script.py')\n", str(out)).splitlines()
    assert (
        len(said) == 2
        and said[0].startswith("sit chair: reached")
        and said[1].startswith("walk away: reached")
    )
    assert 5 < len(read_clip(out).hips_position) / 30 < 60
