"""The pages: links and pictures are there, sentences that are explained are ones that the product says."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([*DOCS.glob("*.md"), ROOT / "README.md"])
MOST_OF_PICTURES = 3_000_000  # bytes


def anchors(page: Path) -> set[str]:
    """What links within a page may lead to."""
    heads = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", head).strip().lower().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_pictures_of_a_page_are_there(page):
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.S)
    links = [to for to in re.findall(r"\]\(([^)\s]+)\)", text) if not re.match(r"[a-z]+:", to)]
    for link in links:
        target, _, anchor = link.partition("#")
        found = (page.parent / target).resolve() if target else page
        assert found.is_file(), f"{page.name} leads to {target}, which is not there"
        assert found.is_relative_to(ROOT)
        if anchor:
            assert anchor in anchors(found), f"{page.name} leads to #{anchor}, which {found.name} lacks"


def test_every_page_and_picture_is_led_to():
    texts = {page: page.read_text(encoding="utf-8") for page in PAGES}
    for wanted in (*DOCS.glob("*.md"), *DOCS.glob("*.png")):
        if wanted.name != "README.md":
            assert any(f"{wanted.name})" in t or f"{wanted.name}#" in t for t in texts.values()), wanted.name


def test_pictures_stay_small():
    assert sum(picture.stat().st_size for picture in DOCS.glob("*.png")) < MOST_OF_PICTURES


def sentences() -> str:
    """All texts of the product, what is filled in left out, one a line."""
    said = []
    for path in (*(ROOT / "nsm_core").rglob("*.py"), *(ROOT / "nsm_blender").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = (v.value if isinstance(v, ast.Constant) else "\0" for v in node.values)
                said.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                said.append(node.value)
    return "\n".join(said)


def test_what_is_explained_is_said():
    page = (DOCS / "troubleshooting.md").read_text(encoding="utf-8").partition("## It looks wrong")[0]
    rows = [line.split("|")[1] for line in page.splitlines() if line.startswith("| `")]
    phrases = {
        part.strip(" ,")
        for row in rows
        for quoted in re.findall(r"`([^`]+)`", row)
        for part in quoted.split("…")
    }
    assert len(phrases) > 80
    said = sentences()
    assert not sorted(phrase for phrase in phrases if phrase and phrase not in said), (
        "nothing says so any more"
    )
