"""Pins that agree with one another, Pythons that are found, environments that are made, reused, refreshed."""

from __future__ import annotations

import json
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import dev_environments as environments


def test_everything_is_pinned():
    extras = environments.project()["project"]["optional-dependencies"]
    pins = [pin for group in extras.values() for pin in group]
    assert pins and all("==" in pin.partition(";")[0] for pin in pins)
    names = {}
    for pin in pins:
        name, _, version = pin.partition(";")[0].strip().partition("==")
        names.setdefault(name, set()).add(version)
    assert all(len(versions) == 1 for name, versions in names.items() if name != "numpy")


def test_no_module_of_ours_is_let_off_its_types():
    entries = environments.project()["tool"]["mypy"]["overrides"]
    assert not [m for entry in entries for m in entry["module"] if m.startswith("nsm")]


def test_running_needs_no_torch():
    assert not any(
        "torch" in pin
        for pin in environments.requirements((), "4.5.15") + environments.requirements(("test",), "4.5.15")
    )
    assert any("torch==" in pin for pin in environments.requirements(("train",), None))
    assert "bpy==4.5.15" in environments.requirements((), "4.5.15")


def test_this_python_is_preferred_and_found():
    short = f"{sys.version_info[0]}.{sys.version_info[1]}"
    assert environments.find_python(short) == getattr(sys, "_base_executable", sys.executable)
    assert environments.find_python("2.0") is None
    assert environments.version_of(str(ROOT / "no-such-python")) is None


def tiny_wheel(folder: Path, version: str) -> str:
    """A package of one line as a wheel; returns its requirement."""
    path = folder / f"tiny-{version}-py3-none-any.whl"
    info = f"tiny-{version}.dist-info"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("tiny.py", f"VERSION = {version!r}\n")
        archive.writestr(f"{info}/METADATA", f"Metadata-Version: 2.1\nName: tiny\nVersion: {version}\n")
        archive.writestr(
            f"{info}/WHEEL", "Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        archive.writestr(f"{info}/RECORD", "")
    return f"tiny @ {path.as_uri()}"


@pytest.mark.slow
def test_environments_are_made_reused_and_refreshed(tmp_path, capsys):
    folder = tmp_path / "env"
    first, second = tiny_wheel(tmp_path, "1.0"), tiny_wheel(tmp_path, "2.0")

    def version(python):
        return subprocess.run(
            [python, "-c", "import tiny; print(tiny.VERSION)"], capture_output=True, text=True
        ).stdout.strip()

    python = environments.ensure(folder, sys.executable, [first])
    assert version(python) == "1.0"
    assert environments.ensure(folder, sys.executable, [first]) == python
    assert capsys.readouterr().out.count("Installing") == 1  # the second time nothing was done
    environments.ensure(folder, sys.executable, [second])
    assert version(python) == "2.0"
    stamp = folder / "nsm-stamp.json"
    assert json.loads(stamp.read_text())["pins"] == [second]
    python.unlink()  # its Python is gone: all is made anew
    environments.ensure(folder, sys.executable, [first])
    assert version(python) == "1.0"
    with pytest.raises(environments.Failure, match="could not install"):
        environments.ensure(
            folder, sys.executable, [f"tiny @ {(tmp_path / 'gone-1.0-py3-none-any.whl').as_uri()}"]
        )
    assert not stamp.exists()  # a half-made environment is not taken for a whole one
