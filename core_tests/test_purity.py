"""The core needs no Blender anywhere and no torch to be stepped, and no import runs up from a room to one
above it.
"""

from __future__ import annotations

import ast
import subprocess
import sys
from collections import Counter
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / "nsm_core"
FILES = sorted(CORE.rglob("*.py"))
BLENDER = {"bpy", "mathutils", "bmesh", "gpu", "blf", "bpy_extras", "nsm_blender"}
# Rooms that may import torch at the top of a file; everywhere else only inside a function.
TORCH_ROOMS = (
    "model/networks/", "training/", "evaluation/",
    *(f"commands/{command}.py" for command in ("train", "transitions", "planner", "controller")),
)  # fmt: skip
# What a take in Blender, its report and its files import; none of it may pull in torch, scipy or anything
# else that Blender lacks.
STEPPING_ROOMS = ("world", "body", "model", "control", "data/captures", "evaluation/measures")
ASIDE = (
    "world/assets/", "model/networks/nsm.py", "model/networks/trainable.py", "model/networks/allocator.py",
    *(f"model/networks/{module}.py" for module in ("encoded", "mlp", "lstm", "gated")),
    *(f"model/networks/{module}.py" for module in ("deferred", "rtn", "rtn_rollout", "field_decoder")),
    *(f"model/networks/{module}.py" for module in ("delta", "gap_torch", "way_diffusion", "handling")),
    "model/networks/environment_code.py",
    "evaluation/measures/data_baseline.py", "__main__.py",
)  # fmt: skip
# Floors of the house from below; a file directly in nsm_core belongs to the ground.  Rooms of one floor do
# not know each other.
FLOORS = [
    ("ground",),
    ("world",),
    ("body",),
    ("model",),
    ("control", "data"),
    ("training", "evaluation"),
    ("commands", "nsm_blender"),
]


def module_of(path: Path) -> str:
    """Dotted name of a file."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def inside(path: Path, room: str) -> bool:
    """Whether a file of the core lies in a room, such as "world" or "model/networks"."""
    return path.relative_to(CORE).as_posix().startswith(room)


STEPPING = [
    module_of(path)
    for path in FILES
    if (path.parent == CORE or any(inside(path, room + "/") for room in STEPPING_ROOMS))
    and not any(inside(path, a) for a in ASIDE)
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
        elif isinstance(node, ast.Call) and ast.unparse(node.func) in (
            "__import__",
            "import_module",
            "importlib.import_module",
        ):
            if node.args and isinstance(node.args[0], ast.Constant):
                yield str(node.args[0].value).split(".")[0]
        nodes.extend(ast.iter_child_nodes(node))


def arrows(paths: list[Path]):
    """(module, imported module) for every import of ours, lazy and typing ones too; names are left off."""
    known = {module_of(path) for path in paths}
    for path in paths:
        here = module_of(path)
        package = here.split(".") if path.stem == "__init__" else here.split(".")[:-1]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = []
            if isinstance(node, ast.Import):
                named = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                start = package[: len(package) - node.level + 1] if node.level else []
                base = ".".join([*start, *([node.module] if node.module else [])])
                named = [
                    f"{base}.{alias.name}" if f"{base}.{alias.name}" in known else base
                    for alias in node.names
                ]
            yield from ((here, name) for name in named if name.split(".")[0] in ("nsm_core", "nsm_blender"))


def floor(module: str) -> tuple[int, str]:
    """Number of the floor a module is on, and the part of it."""
    parts = module.split(".")
    part = parts[0] if parts[0] == "nsm_blender" else parts[1] if len(parts) > 1 else "ground"
    return next(((n, part) for n, names in enumerate(FLOORS) if part in names), (0, "ground"))


def room(module: str) -> str:
    """The first two parts of its path below the package; the ground is one room."""
    parts = module.split(".")
    if parts[0] == "nsm_core":
        return "ground" if floor(module)[1] == "ground" else ".".join(parts[1:3])
    return ".".join(parts[:2])


EVERYTHING = sorted([*FILES, *(ROOT / "nsm_blender").rglob("*.py")])
# What scripts and the command line come in by: they know every room, and no room knows them.
DOORS = ("nsm_core", "nsm_core.__main__")
ARROWS = [(a, b) for a, b in arrows(EVERYTHING) if a not in DOORS]


def test_the_walk_finds_imports():
    tree = ast.parse(
        "import a.b\nfrom c import d\ndef f():\n    import e\nimportlib.import_module('g.h')\nfrom . import i"
    )
    assert set(imports(tree)) == {"a", "c", "e", "g"} and set(imports(tree, top_level=True)) == {
        "a",
        "c",
        "g",
    }
    assert len(FILES) > 10
    assert ("nsm_core.control.take", "nsm_core.control.director") in ARROWS
    assert ("nsm_blender.takes", "nsm_blender.goals.resolve") in ARROWS


def test_no_import_runs_up():
    wrong = []
    for a, b in ARROWS:
        (below, mine), (above, theirs) = floor(a), floor(b)
        if above > below or above == below and mine != theirs:
            wrong.append(f"{a} imports {b}")
    assert not wrong, "\n".join(wrong)


def test_no_room_comes_in_by_the_front_door():
    assert not [f"{a} imports {b}" for a, b in ARROWS if b in DOORS]


def test_rooms_have_no_circle():
    graph: dict[str, set[str]] = {}
    for a, b in ARROWS:
        if room(a) != room(b):
            graph.setdefault(room(a), set()).add(room(b))
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"rooms that import each other: {' -> '.join(reversed(error.args[1]))}")


def test_a_class_has_a_name_of_its_own():
    names = Counter(
        node.name
        for path in EVERYTHING
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    )
    assert not [name for name, count in names.items() if count > 1 and not name.startswith("_")]


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(CORE)))
def test_no_blender_in_the_core(path):
    found = BLENDER & set(imports(ast.parse(path.read_text(encoding="utf-8"))))
    assert not found, f"{path.name} imports {found}"


@pytest.mark.parametrize("path", FILES, ids=lambda p: str(p.relative_to(CORE)))
def test_torch_only_where_the_plan_allows(path):
    if not any(inside(path, room) for room in TORCH_ROOMS):
        assert "torch" not in set(imports(ast.parse(path.read_text(encoding="utf-8")), top_level=True))


def test_stepping_imports_nothing_that_blender_lacks():
    assert {
        "nsm_core.model.inference.model",
        "nsm_core.control.take",
        "nsm_core.data.captures.bvh_writer",
    } <= set(STEPPING)
    code = (
        "import sys\n"
        "class Refuse:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        "        if name.split('.')[0] in {'torch', 'scipy', 'matplotlib', 'trimesh', 'tqdm', 'bpy', "
        "'mathutils'}:\n"
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
        "y, h, info = m.step((np.ones((1, m.config.inputs)), np.ones((1, m.config.gating))), m.start())\n"
        "assert np.isfinite(y).all() and h == {} and info['experts'].shape == (1, 8)\n"
        "print(m.backend)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "numpy"
