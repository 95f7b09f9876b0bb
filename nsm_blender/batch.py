"""Make the takes of a job file without a window.

    blender --background --python nsm_blender/batch.py -- job.toml
    python nsm_blender/batch.py job.toml                        (with the bpy wheel)

``--shard 2/5`` makes every fifth take, from the second on; ``--scheduler tcp://10.0.0.5:8786`` has the
workers of a dask scheduler make them.  Each take starts from a fresh load of the scene.  A take that fails
says why in its report and on its own line, and the others go on.  Exit code: 0 when all takes were made and
reached their goals, 1 when one was not, 2 when the job file is of no use.
"""

from __future__ import annotations

import importlib
import sys
import time
import traceback
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

if __name__ == "__main__":  # run as a script: make this folder importable as the package that it is
    _FOLDER = Path(__file__).resolve().parent
    sys.path.insert(0, str(_FOLDER.parent))
    __package__ = _FOLDER.name
    importlib.import_module(__package__)

import bpy

from nsm_core.errors import JobError, NsmError, OutputError

from . import register, unregister
from .exports.bvh import export_bvh
from .exports.glb import export_glb
from .fill.fill import FilledGap, fill_gap
from .jobs.farm import end_with_worker, run_on
from .jobs.job import Job, JobTake
from .jobs.options import of_shard, read_options
from .jobs.paths import refuse_used
from .jobs.read import read_job
from .jobs.spec import fill_of, group_of, merged, open_scene, spec_of
from .leaving import leave
from .pictures.outputs import require_writable, save_blend, write_json
from .pictures.render import contact_sheet, video
from .takes import Take, generate
from .together import generate_together

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

_SAY_EVERY = 2.0  # seconds between two progress lines of a take


def main(arguments: Sequence[str], say: Callable[[str], None] | None = None) -> int:
    """Run the job file named by ``arguments``; return the exit code described above."""
    say = say or _say
    try:
        options = read_options(arguments)
        job = read_job(options.job)
        takes = of_shard(job.takes, options.shard)
        if options.worker:
            end_with_worker()
        if options.scheduler:
            failed = run_on(options.scheduler, job, takes, say, lambda take, why: _lost(take, why, say))
        else:
            with _switched_on():
                failed = sum(
                    not run_take(job, take, f"[{i}/{len(job.takes)}] {take.name}", say, options.worker)
                    for i, take in takes
                )
    except NsmError as error:
        say(f"Error: {error}")
        return 2
    say(f"{len(takes) - failed} of {len(takes)} takes are as asked for.")
    return 1 if failed else 0


@contextmanager
def _switched_on() -> Iterator[None]:
    """Have the add-on registered, as it is in Blender: what a scene keeps of it, such as lists of bones, is
    read then.
    """
    theirs = hasattr(bpy.types.Armature, "nsm_rig")
    if not theirs:
        register()
    try:
        yield
    finally:
        if not theirs:
            unregister()


def run_take(job: Job, entry: JobTake, title: str, say: Callable[[str], None], worker: str = "") -> bool:
    """Make one take of a job and write its files; what goes wrong goes to its report and to ``say``.

    The report tells the ``worker`` that has made it, where there is one.
    """
    by = {"worker": worker} if worker else {}
    report: dict[str, Any] = {"name": entry.name, **by}
    try:
        if entry.error:
            raise JobError(entry.error)
        _require_writable(entry)
        take = _make(job, entry, title, say)
        report = {**take.report, "name": entry.name, "seed": entry.seed, **by}
        missed = [g for g in report.get("goals", ()) if not g["reached"]]
        if missed:
            report["error"] = (
                f"{len(missed)} of {len(report['goals'])} goals were not reached "
                f"({', '.join(g['object'] for g in missed)}); "
                "clear the way to them, start nearer, or try another seed."
            )
        _write(take, entry, title, say)
    except NsmError as error:
        report["error"] = str(error)
    except Exception as error:  # a defect in one take must not lose the others
        report |= _broken(entry, error)
    try:
        _write_report(report, entry)
    except NsmError as error:
        report.setdefault("error", str(error))
    except Exception as error:
        report = _broken(entry, error)
    if "error" in report:
        say(f"{title}: Error: {report['error']}")
    return "error" not in report


def _lost(entry: JobTake, why: str, say: Callable[[str], None]) -> None:
    """Report a take that was lost with its worker, as often as it was tried."""
    error = f"Take '{entry.name}' was not made, since {why}; look at that machine and run it again."
    say(f"{entry.name}: Error: {error}")
    try:
        _write_report({"name": entry.name, "error": error}, entry)
    except NsmError as problem:
        say(f"{entry.name}: Error: {problem}")


def _broken(entry: JobTake, error: Exception) -> dict[str, str]:
    """What a report says of a defect; the traceback goes to the error stream as well."""
    trace = "".join(traceback.format_exception(error))
    print(trace, file=sys.stderr, flush=True)
    return {
        "error": f"Take '{entry.name}' broke off with {type(error).__name__}: {error}; please report this.",
        "traceback": trace,
    }


def _make(job: Job, entry: JobTake, title: str, say: Callable[[str], None]) -> Take | FilledGap:
    scene = open_scene(job.scene, job.scripts)
    refuse_used(entry, bpy.utils.blend_paths(absolute=True))
    if bpy.app.autoexec_fail:
        blocked = bpy.app.autoexec_fail_message
        say(
            f"{title}: scripts in the scene did not run ({blocked}); where you trust it, say `scripts = "
            "true` in the job file."
        )
    group = group_of(entry, scene) if entry.characters else None
    if entry.fill is not None:
        steps = fill_gap(fill_of(entry, entry.fill, scene), scene)
    elif group is None:
        steps = generate(spec_of(entry, scene), scene)
    else:
        steps = generate_together(group, scene)
    begun = said = time.monotonic()
    frames = 0
    while True:
        try:
            progress = next(steps)
        except StopIteration as stop:
            take = stop.value if group is None else merged(stop.value, group)
            break
        frames += progress.hips_world is not None or bool(progress.cast)
        if time.monotonic() - said > _SAY_EVERY:
            said = time.monotonic()
            say(f"{title}: {progress.stage} {progress.fraction:.0%}, {frames} frames")
    if entry.fill is None:
        scene.frame_start, scene.frame_end = take.keyed.frame_start, take.keyed.frame_end
    say(f"{title}: {take.report['frames']} frames in {time.monotonic() - begun:.1f} s")
    return take


def _require_writable(entry: JobTake) -> None:
    """Raise OutputError before the work begins where a file could not be written at its end."""
    for key, path in entry.outputs.items():
        require_writable(path, what=f"'{key}'")


def _write(take: Take | FilledGap, entry: JobTake, title: str, say: Callable[[str], None]) -> None:
    """Write what the take's entry asks for; what fails keeps the others from nothing.  Raises OutputError
    with all that failed.
    """
    keyed, armature, scene = take.keyed, take.keyed.armature, bpy.context.scene
    writers: dict[str, Callable[[Path], object]] = {
        "out": lambda path: save_blend(path, "'out'"),
        "bvh": lambda path: export_bvh(path, armature, keyed.first, keyed.last, scene),
        "glb": lambda path: export_glb(path, armature, [t.object for t in keyed.things], scene, "'glb'"),
        "sheet": lambda path: contact_sheet(keyed, path),
        "video": lambda path: video(keyed, path),
    }
    failed = []
    for key, write in writers.items():
        if key not in entry.outputs:
            continue
        if key in ("sheet", "video"):
            say(f"{title}: rendering {entry.outputs[key].name}")
        try:
            write(entry.outputs[key])
        except NsmError as error:
            failed.append(str(error))
    if failed:
        raise OutputError(" ".join(failed))


def _write_report(report: dict[str, Any], entry: JobTake) -> None:
    if "report" in entry.outputs:
        write_json(require_writable(entry.outputs["report"], what="'report'"), report, "'report'")


def _say(line: str) -> None:
    try:
        print(line, flush=True)
    except UnicodeEncodeError:  # a terminal that lacks letters of a name
        print(line.encode("ascii", "backslashreplace").decode(), flush=True)


if __name__ == "__main__":
    _arguments = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:]
    leave(main(_arguments))
