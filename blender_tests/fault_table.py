#!/usr/bin/env python3
"""Disturb takes in every way that the project knows, and write what became of the files as a table.

  python blender_tests/fault_table.py [--only WORD] [--out docs/faults.md]

Takes are broken off by an exception at every stage, by ESC at every tenth frame, by what is deleted,
renamed, hidden or moved while they are made, by undo and redo, other files and the extension switched off;
disks are full or locked, and data linked, overridden or locked.  Afterwards a file must equal what it was
before, by all that Blender tells of it (``faults/everything.py``), or hold the whole take.  The exit code is
1 where one case fails.
"""

from __future__ import annotations

import argparse
import collections
import os
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE, HERE / "faults"):
    sys.path.insert(0, str(folder))

import bpy  # noqa: F401 - first, as everywhere
from cases import Cases

import nsm_blender
from nsm_blender.leaving import leave


def main() -> int:
    """Run the cases, print and write the table; 1 where one fails."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--only", default="", help="cases whose group or name holds this")
    options.add_argument("--out", type=Path, help="write the table there, as Markdown")
    asked = options.parse_args()
    nsm_blender.register()
    # Blender's own lines go elsewhere: it tells of every file that it opens.
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    begun, rows = time.monotonic(), []
    for case in Cases().all():
        if asked.only in f"{case.group}: {case.name}":
            begin = time.monotonic()
            state, wrong = case.go()
            rows.append((case.group, case.name, state, wrong))
            if wrong:
                print(
                    f"FAULT {case.group}: {case.name} ({time.monotonic() - begin:.1f} s)",
                    *wrong,
                    sep="\n    ",
                    flush=True,
                )
    faults = sum(bool(wrong) for *_, wrong in rows)
    print(f"{len(rows)} cases, {faults} faults, {time.monotonic() - begun:.0f} s")
    if asked.out:
        asked.out.write_text(table(rows), encoding="utf-8")
    return 1 if faults else 0


def table(rows: list[tuple[str, str, str, list[str]]]) -> str:
    """The table as Markdown: sums by group, then every case."""
    lines = [f"# {len(rows)} faults and what became of the file", "", *__doc__.splitlines()[4:-1], ""]
    lines += ["| | cases | as before | the whole take | fault |", "|---|---|---|---|---|"]
    for group in dict.fromkeys(row[0] for row in rows):
        states = collections.Counter("fault" if wrong else state for g, _, state, wrong in rows if g == group)
        counts = [states[k] for k in ("as before", "the whole take", "fault")]
        lines.append(f"| {group} | {sum(counts)} | " + " | ".join(map(str, counts)) + " |")
    lines += ["", "| | case | the file then holds |", "|---|---|---|"]
    for group, name, state, wrong in rows:
        lines.append(f"| {group} | {name.replace('|', '/')} | {'**fault**' if wrong else state} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    leave(main())
