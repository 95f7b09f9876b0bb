"""Make the takes of a job file without a window.

    blender --background --python nsm_blender/batch.py -- job.toml
    python nsm_blender/batch.py job.toml                        (with the bpy wheel)

Each take starts from a fresh load of the scene.  A take that fails says why in its report and on its own
line, and the others go on.  Exit code: 0 when all takes were made and reached their goals, 1 when one was
not, 2 when the job file is of no use.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":  # run as a script: make this folder importable as the package that it is
    _FOLDER = Path(__file__).resolve().parent
    sys.path.insert(0, str(_FOLDER.parent))
    __package__ = _FOLDER.name
    importlib.import_module(__package__)

import bpy

from nsm_core import bvh_write
from nsm_core.errors import GoalError, JobError, NsmError, OutputError, SkeletonError

from .goals import GoalSpec
from .jobs import Job, JobTake, read_job
from .render import contact_sheet, video
from .takes import Take, TakeSpec, generate

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

_SAY_EVERY = 2.0  # seconds between two progress lines of a take


def main(arguments: Sequence[str], say: Callable[[str], None] | None = None) -> int:
    """Run the job file named by ``arguments``; return the exit code described above."""
    say = say or _say
    if len(arguments) != 1:
        say("Error: give one job file, as in: batch.py job.toml")
        return 2
    try:
        job = read_job(arguments[0])
    except NsmError as error:
        say(f"Error: {error}")
        return 2
    failed = sum(not run_take(job, take, f"[{i}/{len(job.takes)}] {take.name}", say) for i, take in enumerate(job.takes, 1))
    say(f"{len(job.takes) - failed} of {len(job.takes)} takes are as asked for.")
    return 1 if failed else 0


def run_take(job: Job, entry: JobTake, title: str, say: Callable[[str], None]) -> bool:
    """Make one take of a job and write its files; what goes wrong goes to its report and to ``say``."""
    report: dict[str, Any] = {"name": entry.name}
    try:
        if entry.error:
            raise JobError(entry.error)
        _require_writable(entry)
        take = _make(job, entry, title, say)
        report = {**take.report, "name": entry.name}
        missed = [g for g in report["goals"] if not g["reached"]]
        if missed:
            report["error"] = (
                f"{len(missed)} of {len(report['goals'])} goals were not reached ({', '.join(g['object'] for g in missed)}); "
                "clear the way to them, start nearer, or try another seed."
            )
        _write(take, entry, title, say)
    except NsmError as error:
        report["error"] = str(error)
    except Exception as error:  # a defect in one take must not lose the others
        report["error"] = f"The take broke off with {type(error).__name__}: {error}; please report this."
    try:
        _write_report(report, entry)
    except NsmError as error:
        report.setdefault("error", str(error))
    if "error" in report:
        say(f"{title}: Error: {report['error']}")
    return "error" not in report


def _make(job: Job, entry: JobTake, title: str, say: Callable[[str], None]) -> Take:
    scene = _open(job.scene)
    spec = TakeSpec(
        character=_armature(scene, entry.character),
        goals=[GoalSpec(g.action, _target(scene, g.object), g.hold, g.location, _target(scene, g.to, "to")) for g in entry.goals],
        name=entry.name,
        start_frame=entry.start_frame,
        seed=entry.seed,
        contact_ik=entry.contact_ik,
    )
    steps, begun, said = generate(spec, scene), time.monotonic(), time.monotonic()
    frames = 0
    while True:
        try:
            progress = next(steps)
        except StopIteration as stop:
            take = stop.value
            break
        frames += progress.hips_world is not None
        if time.monotonic() - said > _SAY_EVERY:
            said = time.monotonic()
            say(f"{title}: {progress.stage} {progress.fraction:.0%}, {frames} frames")
    scene.frame_start, scene.frame_end = take.keyed.frame_start, take.keyed.frame_end
    say(f"{title}: {take.report['frames']} frames in {time.monotonic() - begun:.1f} s")
    return take


def _open(path: Path) -> bpy.types.Scene:
    if not path.is_file():
        raise JobError(f"The scene {path} does not exist; correct 'scene' in the job file.")
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False)
    except RuntimeError as error:
        raise JobError(
            f"The scene {path} cannot be opened by Blender {bpy.app.version_string}; save it again with this version."
        ) from error
    scene = bpy.context.scene
    bpy.context.view_layer.update()
    return scene


def _armature(scene: bpy.types.Scene, name: str) -> bpy.types.Object:
    found = scene.objects.get(name)
    if found is None:
        there = [o.name for o in scene.objects if o.type == "ARMATURE"]
        raise SkeletonError(f"The scene has no character '{name}'; its armatures are {', '.join(there) or 'none'}: correct 'character'.")
    return found


def _target(scene: bpy.types.Scene, name: str | None, key: str = "object") -> bpy.types.Object | None:
    if name is None:
        return None
    found = scene.objects.get(name)
    if found is None:
        there = sorted(o.name for o in scene.objects if o.type in {"MESH", "EMPTY"})
        listed = ", ".join(there[:12]) + (", ..." if len(there) > 12 else "")
        raise GoalError(f"The scene has no object '{name}'; it has {listed or 'none'}: correct '{key}'.")
    return found


def _require_writable(entry: JobTake) -> None:
    """Raise OutputError before the work begins where a file could not be written at its end."""
    for key, path in entry.outputs.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise OutputError(f"The folder {path.parent} for '{key}' cannot be made ({error.strerror}); choose another one.") from error
        if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
            raise OutputError(f"'{key}' cannot be written to {path}; choose another folder or file name.")


def _write(take: Take, entry: JobTake, title: str, say: Callable[[str], None]) -> None:
    """Write what the take's entry asks for."""
    outputs = entry.outputs
    if "bvh" in outputs:
        bvh_write.write(outputs["bvh"], take.result.hips_position, take.result.local_rotations)
    if "out" in outputs:
        try:
            bpy.ops.wm.save_as_mainfile(filepath=str(outputs["out"]), copy=True, relative_remap=True)
        except RuntimeError as error:
            raise OutputError(f"'out' cannot be written to {outputs['out']}; choose another folder or file name.") from error
    for key in ("sheet", "video"):
        if key in outputs:
            say(f"{title}: rendering {outputs[key].name}")
            (contact_sheet if key == "sheet" else video)(take.keyed, outputs[key])


def _write_report(report: dict[str, Any], entry: JobTake) -> None:
    path = entry.outputs.get("report")
    if path is None:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(report, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"'report' cannot be written to {path} ({error.strerror}); choose another folder or file name.") from error


def _say(line: str) -> None:
    print(line, flush=True)


if __name__ == "__main__":
    _arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    sys.exit(main(_arguments))
