"""What dev.py runs the project in: versions that are pinned, Pythons of this machine, virtual environments.
Standard library only.
"""

from __future__ import annotations

import glob
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
WINDOWS = os.name == "nt"


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
