"""Nothing stands in the product that only tests use, or nobody: every name is read somewhere else, or is
public.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

import nsm_core

ROOT = Path(__file__).resolve().parents[1]
PRODUCT = sorted(path for folder in ("nsm_core", "nsm_blender") for path in (ROOT / folder).rglob("*.py"))
USERS = [*PRODUCT, ROOT / "dev.py", ROOT / "dev_environments.py", ROOT / "docs" / "take.py"]
# Called or read by Blender, by Python or by a file format, each by its name.
CALLED_FROM_OUTSIDE = {
    "register",
    "unregister",
    "draw",
    "draw_header_preset",
    "draw_item",
    "execute",
    "invoke",
    "modal",
    "poll",
    "description",
    "filter_glob",
    "filter_items",
    "check_existing",
}
CALLED_FROM_OUTSIDE |= {"create_module", "exec_module"}
Span = tuple[Path, int, int]


def definitions(path: Path, tree: ast.Module):
    """(name, span) of functions, classes, constants, methods and fields of a file."""
    for holder in (tree, *(node for node in tree.body if isinstance(node, ast.ClassDef))):
        for node in holder.body:
            named = []
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                named = [node.name]
            elif isinstance(node, ast.Assign | ast.AnnAssign):
                targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                named = [t.id for target in targets for t in ast.walk(target) if isinstance(t, ast.Name)]
            for name in named:
                if not (name.startswith("__") or name.startswith("bl_") or name == "_"):
                    yield name, (path, node.lineno, node.end_lineno or node.lineno)


def uses(path: Path, tree: ast.Module):
    """(name, line) of everything that a file reads, also under another name, or spells in a string (fields
    are read so too).
    """
    renamed = {
        alias.asname: alias.name.split(".")[-1]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
        if alias.asname
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
            yield renamed.get(node.id, node.id), node.lineno
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Load):
            yield node.attr, node.lineno
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.isidentifier():
            yield node.value, node.lineno


def unused(files: list[Path], users: list[Path]) -> list[str]:
    """What ``files`` define and no line of ``users`` outside of the definition itself reads."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in users}
    read: dict[str, list[tuple[Path, int]]] = defaultdict(list)
    for path, tree in trees.items():
        for name, line in uses(path, tree):
            read[name].append((path, line))
    return [
        f"{path.name}:{first}: {name}"
        for each in files
        for name, (path, first, last) in definitions(each, trees[each])
        if all(p == path and first <= line <= last for p, line in read[name])
    ]


def test_the_search_finds_what_is_not_used(tmp_path):
    path = tmp_path / "some.py"
    path.write_text(
        "USED = DEAD = 1\ndef again(n):\n    return again(n - USED)\nclass Kind:\n    left: int = 0\n"
        "    def size(self):\n        return self.left\nprint(Kind())\n"
    )
    assert [line.partition(": ")[2] for line in unused([path], [path])] == ["DEAD", "again", "size"]


def test_every_name_is_used():
    public = {kept.rpartition(":")[2] for kept in nsm_core._KEPT.values()}
    dead = [
        line for line in unused(PRODUCT, USERS) if line.rpartition(" ")[2] not in public | CALLED_FROM_OUTSIDE
    ]
    assert not dead, "used by nobody, or by tests alone; delete it:\n" + "\n".join(dead)
