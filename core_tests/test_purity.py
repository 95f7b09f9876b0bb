"""The core needs no Blender anywhere and no torch to be stepped."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / "nsm_core"
FILES = sorted(CORE.rglob("*.py"))
BLENDER = {"bpy", "mathutils", "bmesh", "gpu", "blf", "bpy_extras", "nsm_blender"}
# Rooms that may import torch at the top of a file; everywhere else only inside a function.
TORCH_ROOMS = ("networks", "training", "evaluation")
ASIDE = ("nsm", "memory", "bench", "__main__")  # files outside those rooms that a take does not import
# What a take in Blender imports; none of it may pull in torch, scipy or anything else that Blender lacks.
STEPPING = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for path in FILES
    if path.relative_to(CORE).parts[0] not in ("training", "evaluation", "dataset") and path.stem not in ASIDE
]


def imports(tree: ast.AST, top_level: bool = False):
    """Names of absolutely imported top packages; with ``top_level`` without those inside functions."""
    nodes = [tree]
    while nodes:
        node = nodes.pop()
        if top_level and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if top_level and isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module.split(".")[0]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in ("__import__", "import_module", "importlib.import_module"):
            if node.args and isinstance(node.args[0], ast.Constant):
                yield str(node.args[0].value).split(".")[0]
        nodes.extend(ast.iter_child_nodes(node))


def test_the_walk_finds_imports():
    tree = ast.parse("import a.b\nfrom c import d\ndef f():\n    import e\nimportlib.import_module('g.h')\nfrom . import i")
    assert set(imports(tree)) == {"a", "c", "e", "g"} and set(imports(tree, top_level=True)) == {"a", "c", "g"}
    assert len(FILES) > 10


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(CORE)))
def test_no_blender_in_the_core(path):
    found = BLENDER & set(imports(ast.parse(path.read_text(encoding="utf-8"))))
    assert not found, f"{path.name} imports {found}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(CORE)))
def test_torch_only_where_the_plan_allows(path):
    if path.relative_to(CORE).parts[0] not in TORCH_ROOMS:
        assert "torch" not in set(imports(ast.parse(path.read_text(encoding="utf-8")), top_level=True))


def test_stepping_imports_nothing_that_blender_lacks():
    assert "nsm_core.model.inference.model" in STEPPING
    code = (
        "import sys\n"
        "class Refuse:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'torch', 'scipy', 'matplotlib', 'trimesh', 'tqdm', 'bpy', 'mathutils'}:\n"
        "            raise ImportError('refused: ' + name)\n"
        "sys.meta_path.insert(0, Refuse())\n"
        "import importlib\n"
        f"for name in {STEPPING!r}:\n"
        "    importlib.import_module(name)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_numpy_back_end_steps_without_torch(full_weights):
    code = (
        "import sys, numpy as np\n"
        "sys.modules['torch'] = None\n"  # makes any import of torch fail
        "from nsm_core.model.inference.model import load_model\n"
        f"m = load_model({str(full_weights)!r})\n"
        "y, c = m.predict(np.ones((1, m.config.inputs)), np.ones((1, m.config.gating)))\n"
        "assert np.isfinite(y).all() and c.shape == (1, 8)\n"
        "print(m.backend)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "numpy"
