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

import glob
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent
WINDOWS = os.name == "nt"
SUITES = ("core_tests", "blender_tests")
# A file's tests stay together; the order of the files is the conftest's.
WORKERS = ["-n", str(max(1, min(os.cpu_count() or 1, 8))), "--dist", "loadfile", "--no-loadscope-reorder"]


class Failure(Exception):
    """Something the user has to know, in one sentence."""


# ---------------------------------------------------------------- pins and Pythons


def project() -> dict:
    """pyproject.toml, the one place where versions are pinned."""
    import tomllib

    return tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def requirements(groups: tuple[str, ...], bpy: str | None) -> list[str]:
    """Pinned requirements of the named groups, with the bpy wheel if one is named."""
    extras = project()["project"]["optional-dependencies"]
    pins = sorted({pin for group in ("run", *groups) for pin in extras[group]})
    return pins + ([f"bpy=={bpy}"] if bpy else [])


def wheels() -> dict[str, str]:
    """Python version that each supported bpy wheel needs, in order of preference."""
    return project()["tool"]["nsm"]["blender"]


def version_of(python: str) -> str | None:
    """Full version of a Python executable that can make environments; None if it does not run."""
    code = "import sys, venv; print('.'.join(map(str, sys.version_info[:3])))"
    try:
        done = subprocess.run([python, "-c", code], capture_output=True, text=True, timeout=60)
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None


def pythons(short: str) -> list[str]:
    """Executables that may be Python ``short`` ("3.11"): this one, then PATH, the launcher, pyenv and uv."""
    this = getattr(sys, "_base_executable", sys.executable)
    found = [this, *(shutil.which(name) for name in (f"python{short}", "python3", "python"))]
    if WINDOWS and shutil.which("py"):
        asked = subprocess.run(
            ["py", f"-{short}", "-c", "import sys; print(sys.executable)"], capture_output=True, text=True
        )
        found.append(asked.stdout.strip() if asked.returncode == 0 else None)
    roots = [os.environ.get("PYENV_ROOT"), Path.home() / ".pyenv", Path.home() / ".pyenv" / "pyenv-win"]
    folders = [Path(root) / "versions" / f"{short}.*" for root in roots if root]
    folders += [
        Path.home() / ".local/share/uv/python" / f"cpython-{short}.*",
        Path("/opt/homebrew/opt") / f"python@{short}",
    ]
    for folder in folders:
        for name in ("python.exe",) if WINDOWS else (f"bin/python{short}", "bin/python"):
            found += sorted(glob.glob(str(folder / name)), reverse=True)
    return list(dict.fromkeys(str(python) for python in found if python))


def find_python(short: str) -> str | None:
    """First working Python ``short`` of this machine."""
    return next((python for python in pythons(short) if short_of(version_of(python)) == short), None)


def held_python(folder: Path, short: str) -> str | None:
    """Python of an environment that was made before, if it is still a ``short``."""
    inside = str(python_in(folder))
    return inside if short_of(version_of(inside)) == short else None


def short_of(version: str | None) -> str:
    """ "3.11" of "3.11.7"."""
    return (version or "").rpartition(".")[0]


def main_choice() -> tuple[str, str]:
    """bpy version and Python executable of .venv: the one it has, else this Python if a wheel fits it, else
    another.
    """
    made = version_of(str(python_in(ROOT / ".venv"))) or ".".join(map(str, sys.version_info[:3]))
    for bpy, short in sorted(wheels().items(), key=lambda item: item[1] != short_of(made)):
        python = held_python(ROOT / ".venv", short) or find_python(short)
        if python:
            return bpy, python
    raise Failure(
        f"Blender's wheels need Python {' or '.join(dict.fromkeys(wheels().values()))}; install one and run "
        "this again."
    )


# ---------------------------------------------------------------- environments


def python_in(folder: Path) -> Path:
    """The interpreter of a virtual environment."""
    return folder / ("Scripts/python.exe" if WINDOWS else "bin/python")


def ensure(folder: Path, python: str, pins: list[str]) -> Path:
    """Make the environment ``folder`` hold ``pins``; does nothing if its stamp says that it does."""
    stamp, inside = folder / "nsm-stamp.json", python_in(folder)
    fits = version_of(str(inside)) == version_of(python)
    try:
        held = set(json.loads(stamp.read_text(encoding="utf-8"))["pins"]) if fits else set()
    except (OSError, ValueError, KeyError):
        held = set()
    if fits and set(pins) <= held:
        return inside
    names = {name_of(pin) for pin in pins}
    stamp.unlink(missing_ok=True)  # until the new ones are in, nothing vouches for the folder
    if not fits:
        make_environment(folder, python)
    print(
        f"Installing into {folder.name}: {', '.join(sorted(names))} (the first time this takes a while)",
        flush=True,
    )
    install(inside, python, pins)
    kept = {pin for pin in held if name_of(pin) not in names}
    stamp.write_text(json.dumps({"pins": sorted({*kept, *pins})}, indent=1), encoding="utf-8")
    return inside


def name_of(pin: str) -> str:
    """Package that a requirement names."""
    return pin.partition("==")[0].partition(" ")[0]


def make_environment(folder: Path, python: str) -> None:
    """Create a virtual environment, without its own pip where the system's Python cannot give one."""
    print(f"Making {folder.name} with Python {version_of(python)}", flush=True)
    for extra in ([], ["--without-pip"]):
        done = subprocess.run(
            [python, "-m", "venv", "--clear", *extra, str(folder)], capture_output=True, text=True
        )
        if done.returncode == 0:
            return
    raise Failure(
        f"{python} cannot make a virtual environment; install its venv package (python3-venv on Debian and "
        "Ubuntu)."
    )


def install(inside: Path, python: str, pins: list[str]) -> None:
    """Install pins with the environment's own pip, or with the system's if it has none."""
    own = subprocess.run([str(inside), "-m", "pip", "--version"], capture_output=True).returncode == 0
    pip = [str(inside), "-m", "pip"] if own else [python, "-m", "pip", "--python", str(inside)]
    done = subprocess.run(
        [*pip, "install", "--disable-pip-version-check", "--no-input", *pins],
        stderr=subprocess.PIPE,
        text=True,
    )
    if done.returncode != 0:
        lines = done.stderr.splitlines()
        reason = (
            [line.removeprefix("ERROR: ") for line in lines if line.startswith("ERROR")]
            or lines
            or ["it gave no reason"]
        )[-1]
        names = ", ".join(sorted({name_of(pin) for pin in pins}))
        raise Failure(f"pip could not install {names} ({reason}); check the network and try again.")


def main_environment(*groups: str) -> Path:
    """Python of .venv with bpy and the named groups."""
    bpy, python = main_choice()
    return ensure(ROOT / ".venv", python, requirements(groups, bpy))


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


# ---------------------------------------------------------------- verbs


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
