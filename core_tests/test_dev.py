"""dev.py: its verbs, what they run, how they fail, and the extension that is staged."""

from __future__ import annotations

import ast
import importlib.util
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import dev
import dev_environments
import nsm_core


def cli(*arguments):
    return subprocess.run([sys.executable, str(ROOT / "dev.py"), *arguments], capture_output=True, text=True)


def test_standard_library_only():
    names = set()
    own = [ast.parse((ROOT / file).read_text(encoding="utf-8")) for file in ("dev.py", "dev_environments.py")]
    for node in (node for tree in own for node in ast.walk(tree)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.split(".")[0])
    assert names - {"dev_environments"} <= sys.stdlib_module_names


def test_help_names_every_verb():
    done = cli("--help")
    assert done.returncode == 0
    assert all(f"  {verb} " in done.stdout for verb in dev.VERBS)


def test_unknown_verb_lists_the_known():
    done = cli("dance")
    assert done.returncode == 2 and "demo" in done.stderr and "Traceback" not in done.stderr
    assert cli().returncode == 2


def test_failures_are_one_sentence(monkeypatch, capsys):
    # A machine without a Python that fits.
    monkeypatch.setattr(dev_environments, "version_of", lambda python: None)
    assert dev.main(["demo"]) == 1
    error = capsys.readouterr().err
    assert error.startswith("dev.py: ") and "3.11" in error and "3.13" in error and error.count("\n") == 1


def test_versions_agree():
    manifest = tomllib.loads((ROOT / "manifest.toml").read_text(encoding="utf-8"))
    assert manifest["version"] == nsm_core.__version__
    assert manifest["wheels"] == [f"./wheels/nsm_core-{nsm_core.__version__}-py3-none-any.whl"]
    assert min(tuple(map(int, v.split("."))) for v in dev_environments.wheels()) >= tuple(
        map(int, manifest["blender_version_min"].split("."))
    )


def test_manifest_obeys_the_store():
    manifest = tomllib.loads((ROOT / "manifest.toml").read_text(encoding="utf-8"))
    assert len(manifest["tagline"]) <= 64 and not manifest["tagline"].endswith(".")
    assert "blender" not in manifest["name"].lower()
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert all(len(reason) <= 64 and not reason.endswith(".") for reason in manifest["permissions"].values())


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


def test_a_pythonless_matrix_row_says_so(monkeypatch):
    monkeypatch.setattr(dev_environments, "version_of", lambda python: None)
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
