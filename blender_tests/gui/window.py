"""The graphical Blender of this machine: where it is, why there is none, and a screen for it."""

from __future__ import annotations

import os
import shutil
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
_TOOLS = {"xdotool": "xdotool presses keys", "import": "ImageMagick photographs the screen"}


def blender() -> str | None:
    """Its command: $BLENDER, or the one on the path."""
    return os.environ.get("BLENDER") or ("blender" if shutil.which("blender") else None)


def missing(tools: bool = True) -> str:
    """Why no window can be opened here, as a sentence; empty where one can."""
    if not blender():
        return "there is no graphical Blender: set BLENDER to one, or have it on the path"
    if not os.environ.get("DISPLAY") and not shutil.which("xvfb-run"):
        return "there is no screen and no xvfb-run that makes one"
    lacking = [why for name, why in _TOOLS.items() if tools and not shutil.which(name)]
    if lacking:
        return f"a tool is missing: {lacking[0]}"
    try:
        asked = subprocess.run([blender(), "--version"], capture_output=True, text=True, timeout=60)
        words = asked.stdout.split()
        version = tuple(int(n) for n in words[words.index("Blender") + 1].split(".")[:2])
    except (OSError, subprocess.TimeoutExpired, ValueError, IndexError):
        return f"{blender()} does not start"
    return "" if version >= (4, 5) else f"{blender()} is {version[0]}.{version[1]}; 4.5 or newer is needed"


def install(extension: Path, profile: Path) -> str:
    """Install a built extension into a profile; what went wrong, else empty."""
    command = [
        blender(),
        "--command",
        "extension",
        "install-file",
        "-r",
        "user_default",
        "-e",
        str(extension),
    ]
    done = subprocess.run(command, env=_environment(profile), capture_output=True, text=True)
    return f"{done.stdout[-300:]}{done.stderr[-300:]}" if done.returncode else ""


def run(script: Path, profile: Path, *arguments: str, options: tuple[str, ...] = (), timeout: float = 600):
    """Run a script in a Blender of 1280 x 960 on the screen, or on one of its own; the finished process."""
    command = [blender(), *options, "--window-geometry", "0", "0", "1280", "960"]
    command += ["--python", str(script), "--", *arguments]
    if not os.environ.get("DISPLAY"):
        command = ["xvfb-run", "-a", "-s", "-screen 0 1280x960x24", *command]
    return subprocess.run(command, env=_environment(profile), capture_output=True, text=True, timeout=timeout)


def _environment(profile: Path) -> dict[str, str]:
    return {**os.environ, "BLENDER_USER_RESOURCES": str(profile), "LIBGL_ALWAYS_SOFTWARE": "1"}
