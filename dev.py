#!/usr/bin/env python3
"""One door to the project: python3 dev.py VERB [arguments].  Standard library only; Linux, macOS, Windows.

  demo       furnish two rooms, let the character sit, open a door, carry a box, climb and run; writes
  out/demo
             (a .blend, a picture, a video); --two-seats: walk and sit alone
  test       run all tests; --matrix adds every Blender version this machine has a Python for, and
             --matrix and --window the built extension in the graphical Blender, where there is one;
             other arguments go to pytest (for example: test core_tests/model/networks/test_nsm.py -k
             gradient); whole suites run on all cores, a file to a process (-n 0: one after the other)
  build      write the extension for Blender to dist/
  train      train the network from a capture folder (arguments: see `train --help`)
  annotate   propose labels, contacts, phases and goals of captures (arguments: see `annotate --help`)
  evaluate   print the tables of figures (arguments: see `evaluate --help`)
  bench      measure the speed of the network and of takes, by stage, in Blender too, of the import of
             the add-on and, where there is a graphical Blender, how long its window does not answer;
             --json FILE keeps the figures, their named ratios and what misses its target
  lint       check the style of all code with ruff, then the types of nsm_core with mypy; arguments go to ruff
  (lint --fix)

The first run makes .venv and installs pinned packages; later runs reuse it.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from dev_environments import (
    Failure,
    ensure,
    find_python,
    held_python,
    main_choice,
    main_environment,
    requirements,
    short_of,
    version_of,
    wheels,
)

ROOT = Path(__file__).resolve().parent
SUITES = ("core_tests", "blender_tests")
# A file's tests stay together; the order of the files is the conftest's.
WORKERS = ["-n", str(max(1, min(os.cpu_count() or 1, 8))), "--dist", "loadfile", "--no-loadscope-reorder"]


def run(*command: object) -> int:
    """Run a command in the project folder and return its exit code."""
    environment = {**os.environ, "PYTHONNOUSERSITE": "1", "PYTHONUTF8": "1"}
    # A process a core leaves no core for threads that wait for each other.
    if "pytest" in command and "-n" in command:
        environment |= {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    try:
        return subprocess.run([str(part) for part in command], cwd=ROOT, env=environment).returncode
    except KeyboardInterrupt:
        return 130


def demo(arguments: list[str]) -> int:
    """Run the demo on the bundled weights."""
    # A later --out wins.
    return run(main_environment(), "nsm_blender/demo.py", "--out", "out/demo", *arguments)


def test(arguments: list[str]) -> int:
    """Run the suites, each in a process of its own, in .venv and with --matrix under the other wheels."""
    rest = [a for a in arguments if a not in ("--matrix", "--window")]
    if len(rest) < len(arguments):
        os.environ["NSM_WINDOW"] = "1"  # asked for in blender_tests/gui/test_window.py
    bpy, python = main_choice()
    folder = ROOT / ".venv"
    try:
        inside = ensure(folder, python, requirements(("test", "train", "farm", "build"), bpy))
    except Failure as failure:
        if "torch" not in str(failure):
            raise
        print(f"Going on without PyTorch, its tests are skipped: {failure}", flush=True)
        inside = ensure(folder, python, requirements(("test", "farm", "build"), bpy))
    results = [run_suite(inside, suite, f"bpy {bpy}", rest) for suite in suites(rest)]
    os.environ.pop("NSM_WINDOW", None)  # once is enough: the window's Blender is its own, not a wheel
    if "--matrix" in arguments:
        results += [
            line
            for other, short in wheels().items()
            if other != bpy
            for line in matrix_row(other, short, wheels()[bpy], rest)
        ]
    print("\nSummary")
    for where, outcome in results:
        print(f"  {where}: {outcome}")
    return 0 if all(outcome == "passed" or outcome.startswith("skipped") for _, outcome in results) else 1


def matrix_row(bpy: str, short: str, main_short: str, rest: list[str]) -> list[tuple[str, str]]:
    """Blender tests under another bpy wheel, whole, and the core tests if its Python is another too.

    Of the core tests those marked slow are left out (pyproject.toml says which and why): they have run under
    the first Python, and what they look at is compared under this one by the goldens.
    """
    where = f"bpy {bpy} on Python {short}"
    folder = ROOT / ".venvs" / f"bpy-{bpy}"
    python = held_python(folder, short) or find_python(short)
    if not python:
        return [(where, f"skipped, this machine has no Python {short}")]
    try:
        inside = ensure(folder, python, requirements(("test", "build"), bpy))
    except Failure as failure:
        return [(where, f"skipped, {failure}")]
    return [
        run_suite(inside, suite, where, rest, () if suite == "blender_tests" else ("-m", "not slow"))
        for suite in suites(rest)
        if suite == "blender_tests" or short != main_short
    ]


def suites(arguments: list[str]) -> list[str]:
    """Suites that the arguments name; all if they name none."""
    return [s for s in SUITES if any(s in a for a in arguments)] or list(SUITES)


def run_suite(
    python: Path, suite: str, where: str, rest: list[str], chosen: tuple[str, ...] = ()
) -> tuple[str, str]:
    """Run one suite under pytest, of it what ``chosen`` selects; returns where and how it went."""
    print(f"\n== {suite} with {where}", flush=True)
    others = [s for s in SUITES if s != suite]
    own = [a for a in rest if not any(a.replace("\\", "/").startswith(s) for s in others)]
    named = any(suite in a for a in own)
    workers = [] if named or any(a.startswith("-n") for a in own) else WORKERS
    code = run(python, "-m", "pytest", *workers, *chosen, *own, *([] if named else [suite]))
    if code == 5 and rest:
        return f"{suite} with {where}", "skipped, no test matches"
    return f"{suite} with {where}", "passed" if code == 0 else f"FAILED (exit code {code})"


def build(arguments: list[str]) -> int:
    """Write dist/nsm_blender-VERSION.zip, validated by Blender's own tool."""
    inside = main_environment("build")
    if not (ROOT / "nsm_core" / "weights" / "nsm.npz").exists():
        raise Failure(
            "The network's weights are missing (nsm_core/weights/nsm.npz); run `dev.py train` or check them "
            "out again."
        )
    with tempfile.TemporaryDirectory() as scratch:
        stage = stage_extension(inside, Path(scratch))
        (ROOT / "dist").mkdir(exist_ok=True)
        for verb in (["validate", stage], ["build", "--source-dir", stage, "--output-dir", ROOT / "dist"]):
            if run(inside, extension_tool(inside), *verb) != 0:
                raise Failure("Blender's extension tool refused the add-on for the reasons above.")
    return 0


def stage_extension(inside: Path, scratch: Path) -> Path:
    """Lay out the extension as Blender wants it: the add-on, nsm_core as a wheel, blender_manifest.toml."""
    ignore = shutil.ignore_patterns("__pycache__", "*.pyc")
    stage, source = scratch / "stage", scratch / "source"
    shutil.copytree(ROOT / "nsm_blender", stage, ignore=ignore)
    # A copy: setuptools litters where it builds.
    shutil.copytree(ROOT / "nsm_core", source / "nsm_core", ignore=ignore)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    shutil.copy(ROOT / "LICENSE", stage / "LICENSE")
    shutil.copy(ROOT / "manifest.toml", stage / "blender_manifest.toml")
    # No settings tool and no network: everything the wheel needs is here.
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet", "--wheel-dir", stage / "wheels"]
    if run(inside, "-m", "pip", "wheel", *options, source) != 0:
        raise Failure("nsm_core could not be packed as a wheel; see above.")
    import tomllib

    named = tomllib.loads((ROOT / "manifest.toml").read_text(encoding="utf-8"))["wheels"]
    made = [f"./wheels/{path.name}" for path in (stage / "wheels").iterdir()]
    if named != made:
        raise Failure(
            f"manifest.toml names the wheel {named} but {made} was built; give nsm_core and manifest.toml "
            "the same version."
        )
    return stage


def extension_tool(inside: Path) -> Path:
    """blender_ext.py of the bpy wheel in an environment."""
    found = sorted(inside.parent.parent.rglob("bl_pkg/cli/blender_ext.py"))
    if not found:
        raise Failure("The bpy wheel lacks its extension tool; delete .venv and run this again.")
    return found[0]


def core(verb: str, arguments: list[str]) -> int:
    """Run a verb of `python -m nsm_core` with everything that training uses."""
    return run(main_environment("train"), "-m", "nsm_core", verb, *arguments)


def bench(arguments: list[str]) -> int:
    """Measure the network and takes and, unless only the network is asked for, the add-on: its takes, until
    it is there, and in the window of the graphical Blender where there is one.
    """
    code = core("bench", arguments)
    if code or "--no-takes" in arguments or any(a in ("-h", "--help") for a in arguments):
        return code
    file = [*arguments, ""][arguments.index("--json") + 1] if "--json" in arguments else ""
    also = ["--json", file] if file else []
    os.environ |= {name: "1" for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}
    code = run(main_environment(), "nsm_blender/bench_takes.py", *also)
    if code:
        return code
    build([])
    return run(main_environment(), "blender_tests/gui/measure.py", "--rooms", "room", *also)


def lint(arguments: list[str]) -> int:
    """Check the style of all code, and the types of nsm_core where numpy is the one that its types are
    written against.
    """
    inside = main_environment("test", "lint")
    code = run(
        inside,
        "-m",
        "ruff",
        "check",
        *arguments,
        *([] if any(not a.startswith("-") for a in arguments) else ["."]),
    )
    _, first = next(iter(wheels().items()))
    if short_of(version_of(str(inside))) != first:
        print(
            f"Types are checked under Python {first} alone: numpy's own differ from one version to the next."
        )
        return code
    return run(inside, "-m", "mypy") or code


VERBS = {
    "demo": demo,
    "test": test,
    "build": build,
    "train": lambda arguments: core("train", arguments),
    "annotate": lambda arguments: core("annotate", arguments),
    "evaluate": lambda arguments: core("evaluate", arguments),
    "bench": bench,
    "lint": lint,
}


def main(arguments: list[str]) -> int:
    """Run a verb; returns the exit code."""
    if sys.version_info < (3, 11):  # noqa: UP036 - told here, since nothing has checked it before
        print("dev.py needs Python 3.11 or newer; this is " + sys.version.split()[0] + ".", file=sys.stderr)
        return 2
    if not arguments or arguments[0] in ("-h", "--help", "help"):
        print(__doc__)
        return 0 if arguments else 2
    if arguments[0] not in VERBS:
        print(f"dev.py knows no verb {arguments[0]}; choose one of {', '.join(VERBS)}.", file=sys.stderr)
        return 2
    try:
        return VERBS[arguments[0]](arguments[1:])
    except Failure as failure:
        print(f"dev.py: {failure}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("dev.py: stopped.", file=sys.stderr)
        return 130


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
