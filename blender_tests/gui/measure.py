#!/usr/bin/env python3
"""Measure how long the add-on keeps the window of the real, graphical Blender from answering; no part of the
test suites.

  python3 blender_tests/gui/measure.py [--zip dist/nsm_blender-0.1.0.zip] [--out out/gui] [--rooms
  room,centimetres]

It needs Blender 4.5 or newer ($BLENDER or `blender` on the path), and without a screen Xvfb; screenshots need
ImageMagick.
Where there is none it says so and ends with 0.  For each room it installs the zip into a profile of its own,
opens the NSM tab, fills the queue, presses Generate, and once more with ESC in the middle; `measured.json`
and pictures land in the output folder.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import window

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
ROOMS = ("room", "centimetres", "dense", "scatter")
IMPORT = 50.0  # milliseconds that it may take before anything of it is used
TEN = 6.0  # seconds from the click to a finished take of ten
LONGEST = 50.0  # milliseconds that the add-on may keep the window
_IMPORT = """
import sys, time
sys.dont_write_bytecode = False
import bpy, numpy
begin = time.process_time()
import nsm_blender
nsm_blender.register()
print(1000 * (time.process_time() - begin), flush=True)
from nsm_blender.leaving import leave
leave(0)
"""


def main() -> int:
    """Run all rooms; 0 where the window always answered in time or where there is nothing to measure with."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--zip", type=Path, default=newest_zip())
    options.add_argument("--out", type=Path, default=ROOT / "out" / "gui")
    options.add_argument("--rooms", default=",".join(ROOMS))
    options.add_argument("--timeout", type=int, default=600, help="seconds for a room")
    options.add_argument("--json", type=Path, help="file of a benchmark that the figures are added to")
    asked = options.parse_args()
    if asked.json:
        sys.path.insert(0, str(ROOT))
    until_there = importing()
    print(f"importing and registering the extension: {until_there:.0f} ms, aim {IMPORT:.0f}", flush=True)
    if asked.json:
        from nsm_core.evaluation.speed.record import add

        add(asked.json, "import_ms", {"import_and_register": until_there}, {"import_ms": until_there})
    reason = window.missing(tools=False)
    if reason:
        print(f"skipped: {reason}")
        return 0
    if asked.zip is None:
        print("There is no dist/nsm_blender-*.zip; run `python3 dev.py build` first.", file=sys.stderr)
        return 2
    asked.out.mkdir(parents=True, exist_ok=True)
    measured = {}
    for room in asked.rooms.split(","):
        measured[room] = measure(asked.zip, room, asked.out, asked.timeout)
        print(line(room, measured[room]), flush=True)
    (asked.out / "measured.json").write_text(json.dumps(measured, indent=1) + "\n", encoding="utf-8")
    if asked.json and all("error" not in m for m in measured.values()):
        longest = max(m["longest_block_cpu_ms"] for m in measured.values())
        add(asked.json, "window", measured, {"longest_block_ms": longest})
    return (
        0 if all("error" not in m and m["longest_block_cpu_ms"] <= LONGEST for m in measured.values()) else 1
    )


def importing() -> float:
    """Milliseconds of the processor until the add-on is there, nothing of it used: the least of four, each in
    a process of its own, with the numpy that Blender brings already loaded; NaN without the bpy package.
    """
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    with tempfile.TemporaryDirectory() as cache:  # the first of them compiles, as an installed one has once
        environment["PYTHONPYCACHEPREFIX"] = cache
        told = [
            subprocess.run(
                [sys.executable, "-c", _IMPORT], cwd=ROOT, env=environment, capture_output=True, text=True
            ).stdout
            for _ in range(4)
        ]
    times = [float(words.split()[-1]) for words in told if words.split()]
    return min(times, default=float("nan"))


def newest_zip() -> Path | None:
    """The extension that was built last."""
    return max((ROOT / "dist").glob("nsm_blender-*.zip"), key=lambda p: p.stat().st_mtime, default=None)


def measure(extension: Path, room: str, out: Path, timeout: int) -> dict:
    """Figures of one room, from a fresh profile."""
    # With the pictures: a Blender in a root of its own sees the project, and little else.
    with tempfile.TemporaryDirectory(dir=out) as profile:
        refused = window.install(extension.resolve(), Path(profile).resolve())
        if refused:
            return {"error": f"the extension could not be installed: {refused}"}
        figures = out.resolve() / f"{room}.json"
        figures.unlink(missing_ok=True)
        try:
            done = window.run(
                HERE / "in_window.py",
                Path(profile).resolve(),
                room,
                str(figures),
                options=("--enable-event-simulate",),
                timeout=timeout,
            )
        except subprocess.TimeoutExpired:
            return {"error": f"not done after {timeout} s"}
        (out / f"{room}.log").write_text(done.stdout + done.stderr, encoding="utf-8")
        if not figures.exists():
            return {"error": f"Blender ended with {done.returncode}; see {room}.log"}
        return json.loads(figures.read_text(encoding="utf-8"))


def line(room: str, m: dict) -> str:
    """One row for a person."""
    if "error" in m:
        return f"{room:12} {m['error']}"
    return (
        f"{room:12} {m['objects']:5} objects {m['triangles']:8} triangles: first motion "
        f"{m['first_motion_s']:.1f} s after the click, "
        f"again {m['first_motion_again_s']:.1f} s; {m['take_s']:.1f} s of keys "
        f"after {m['keys_s']:.1f} s, so 10 s after {10 * m['keys_s'] / m['take_s']:.1f} (aim {TEN:.0f}); "
        f"longest block "
        f"{m['longest_block_cpu_ms']:.0f} ms "
        f"({m['longest_block_ms']:.0f} ms by the clock, in {m['longest_block_in']}); ESC heard after "
        f"{m['escape_ms']:.0f} ms, "
        f"{'all put back' if m['put_back'] else 'NOT PUT BACK'}"
    )


if __name__ == "__main__":
    sys.exit(main())
