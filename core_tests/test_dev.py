"""dev.py: verbs, pins that agree with one another, environments that are reused, the staged extension."""

from __future__ import annotations

import ast
import importlib.util
import json
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import dev
import nsm_core


def cli(*arguments):
    return subprocess.run([sys.executable, str(ROOT / "dev.py"), *arguments], capture_output=True, text=True)


def test_standard_library_only():
    names = set()
    for node in ast.walk(ast.parse((ROOT / "dev.py").read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.split(".")[0])
    assert names <= sys.stdlib_module_names


def test_help_names_every_verb():
    done = cli("--help")
    assert done.returncode == 0
    assert all(f"  {verb} " in done.stdout for verb in dev.VERBS)


def test_unknown_verb_lists_the_known():
    done = cli("dance")
    assert done.returncode == 2 and "demo" in done.stderr and "Traceback" not in done.stderr
    assert cli().returncode == 2


def test_failures_are_one_sentence(monkeypatch, capsys):
    monkeypatch.setattr(dev, "version_of", lambda python: None)  # a machine without a Python that fits
    assert dev.main(["demo"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("dev.py: ") and "3.11" in error and "3.13" in error and error.count("\n") == 1


def test_everything_is_pinned():
    extras = dev.project()["project"]["optional-dependencies"]
    pins = [pin for group in extras.values() for pin in group]
    assert pins and all("==" in pin.partition(";")[0] for pin in pins)
    names = {}
    for pin in pins:
        name, _, version = pin.partition(";")[0].strip().partition("==")
        names.setdefault(name, set()).add(version)
    assert all(len(versions) == 1 for name, versions in names.items() if name != "numpy")


def test_no_module_of_ours_is_let_off_its_types():
    entries = dev.project()["tool"]["mypy"]["overrides"]
    assert not [m for entry in entries for m in entry["module"] if m.startswith("nsm")]


def test_running_needs_no_torch():
    assert not any(
        "torch" in pin for pin in dev.requirements((), "4.5.15") + dev.requirements(("test",), "4.5.15")
    )
    assert any("torch==" in pin for pin in dev.requirements(("train",), None))
    assert "bpy==4.5.15" in dev.requirements((), "4.5.15")


def test_versions_agree():
    manifest = tomllib.loads((ROOT / "manifest.toml").read_text(encoding="utf-8"))
    assert manifest["version"] == nsm_core.__version__
    assert manifest["wheels"] == [f"./wheels/nsm_core-{nsm_core.__version__}-py3-none-any.whl"]
    assert min(tuple(map(int, v.split("."))) for v in dev.wheels()) >= tuple(
        map(int, manifest["blender_version_min"].split("."))
    )


def test_manifest_obeys_the_store():
    manifest = tomllib.loads((ROOT / "manifest.toml").read_text(encoding="utf-8"))
    assert len(manifest["tagline"]) <= 64 and not manifest["tagline"].endswith(".")
    assert "blender" not in manifest["name"].lower()
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert all(len(reason) <= 64 and not reason.endswith(".") for reason in manifest["permissions"].values())


def test_this_python_is_preferred_and_found():
    short = f"{sys.version_info[0]}.{sys.version_info[1]}"
    assert dev.find_python(short) == getattr(sys, "_base_executable", sys.executable)
    assert dev.find_python("2.0") is None
    assert dev.version_of(str(ROOT / "no-such-python")) is None


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], ["core_tests", "blender_tests"]),
        (["-k", "sit"], ["core_tests", "blender_tests"]),
        (["core_tests/test_dev.py", "-x"], ["core_tests"]),
        (["./blender_tests"], ["blender_tests"]),
    ],
)
def test_suites_named_by_arguments(arguments, expected):
    assert dev.suites(arguments) == expected


@pytest.mark.slow
def test_a_failing_suite_fails_the_command(tmp_path, monkeypatch, capsys):
    (tmp_path / "core_tests").mkdir()
    (tmp_path / "core_tests" / "test_a.py").write_text(
        "def test_good(): pass\ndef test_bad(): assert False\n"
    )
    monkeypatch.setattr(dev, "ROOT", tmp_path)

    def outcome(*arguments: str) -> str:
        return dev.run_suite(Path(sys.executable), "core_tests", "here", ["-q", *arguments])[1]

    assert outcome().startswith("FAILED")
    assert outcome("-n0", "-k", "good") == "passed"
    assert outcome("-n0", "-k", "nothing").startswith("skipped")


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

    python = dev.ensure(folder, sys.executable, [first])
    assert version(python) == "1.0"
    assert dev.ensure(folder, sys.executable, [first]) == python
    assert capsys.readouterr().out.count("Installing") == 1  # the second time nothing was done
    dev.ensure(folder, sys.executable, [second])
    assert version(python) == "2.0"
    stamp = folder / "nsm-stamp.json"
    assert json.loads(stamp.read_text())["pins"] == [second]
    python.unlink()  # its Python is gone: all is made anew
    dev.ensure(folder, sys.executable, [first])
    assert version(python) == "1.0"
    with pytest.raises(dev.Failure, match="could not install"):
        dev.ensure(folder, sys.executable, [f"tiny @ {(tmp_path / 'gone-1.0-py3-none-any.whl').as_uri()}"])
    assert not stamp.exists()  # a half-made environment is not taken for a whole one


def test_a_pythonless_matrix_row_says_so(monkeypatch):
    monkeypatch.setattr(dev, "version_of", lambda python: None)
    [(where, outcome)] = dev.matrix_row("5.2.3", "3.13", "3.11", [])
    assert "5.2.3" in where and outcome == "skipped, this machine has no Python 3.13"


def test_every_blender_runs_all_its_tests_and_another_python_the_core_tests_that_are_not_slow(monkeypatch):
    ran = []
    monkeypatch.setattr(dev, "held_python", lambda folder, short: sys.executable)
    monkeypatch.setattr(dev, "ensure", lambda folder, python, pins: Path(sys.executable))
    monkeypatch.setattr(dev, "run", lambda *command: ran.append(command) or 0)
    rows = dev.matrix_row("5.2.3", "3.13", "3.11", []) + dev.matrix_row("5.0.1", "3.11", "3.11", [])
    assert all(outcome == "passed" for _, outcome in rows)
    assert [command[-1] for command in ran] == ["core_tests", "blender_tests", "blender_tests"]
    assert ["not slow" in command for command in ran] == [True, False, False]


@pytest.mark.slow
def test_staged_extension(tmp_path):
    pytest.importorskip("setuptools")
    stage = dev.stage_extension(Path(sys.executable), tmp_path)
    names = {path.name for path in stage.iterdir()}
    assert {
        "__init__.py",
        "blender_manifest.toml",
        "LICENSE",
        "wheels",
    } <= names and "manifest.toml" not in names
    [wheel] = (stage / "wheels").iterdir()
    packed = set(zipfile.ZipFile(wheel).namelist())
    sources = {str(path.relative_to(ROOT).as_posix()) for path in (ROOT / "nsm_core").rglob("*.py")}
    assert sources <= packed and "nsm_core/weights/CREDITS.md" in packed
    assert not [name for name in packed if "test" in name.lower() or "__pycache__" in name]
    if importlib.util.find_spec("bpy"):
        tool = dev.extension_tool(Path(sys.executable))
        done = subprocess.run(
            [sys.executable, str(tool), "validate", str(stage)], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr


def test_missing_weights_stop_the_build(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(dev, "ROOT", tmp_path)
    monkeypatch.setattr(dev, "main_environment", lambda *groups: Path(sys.executable))
    assert dev.main(["build"]) == 1
    assert "weights" in capsys.readouterr().err


def test_core_commands_are_listed_and_errors_are_short(tmp_path):
    def core(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "nsm_core", *arguments], cwd=ROOT, capture_output=True, text=True
        )

    done = core("--help")
    assert done.returncode == 0 and all(
        name in done.stdout for name in ("train", "evaluate", "bench", "compose")
    )
    assert core("dance").returncode == 2
    done = core("bench", "--weights", str(tmp_path / "none.npz"))
    assert done.returncode == 1 and "no weights file" in done.stderr and "Traceback" not in done.stderr
