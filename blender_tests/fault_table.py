#!/usr/bin/env python3
"""Disturb takes in every way that the project knows, and write what became of the files as a table.

  python blender_tests/fault_table.py [--groups GROUP ...] [--only WORD] [--out docs/faults.md]

Takes are broken off by an exception at every stage, by ESC at every tenth frame, by what is deleted,
renamed, hidden, moved, keyed or animated while they are made, by undo and redo, other files and the extension
switched off; disks are full or locked, and data linked, overridden or locked.  Afterwards a file must equal
what it was before, by all that Blender tells of it (``faults/everything.py``), or hold the whole take.  What
others have done to the file meanwhile is there in either case, as if no take had been under way, or as if it
had been made before or after.

The exit code is 1 where one case fails.
"""

from __future__ import annotations

import argparse
import collections
import json
import os
import sys
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
for folder in (HERE.parent, HERE, HERE / "faults"):
    sys.path.insert(0, str(folder))

import bpy  # noqa: F401 - first, as everywhere
from cases import GROUPS, Cases

import nsm_blender
from nsm_blender.leaving import leave


def main() -> int:
    """Run the cases, print and write the table; 1 where one fails."""
    options = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    options.add_argument("--groups", nargs="*", choices=GROUPS, default=(), help="only these")
    options.add_argument("--only", default="", help="only cases whose name holds this")
    options.add_argument("--out", type=Path, help="write the table there, as Markdown")
    options.add_argument(
        "--rows", type=Path, help="add what was seen to this file, and make the table of all in it"
    )
    asked = options.parse_args()
    nsm_blender.register()
    # Blender's own lines go elsewhere: it tells of every file that it opens.
    sys.stdout = os.fdopen(os.dup(1), "w", encoding="utf-8")
    with open(os.devnull, "w") as nowhere:
        os.dup2(nowhere.fileno(), 1)
    begun, rows = time.monotonic(), []
    if asked.rows and asked.rows.exists():
        rows = [tuple(row) for row in json.loads(asked.rows.read_text(encoding="utf-8"))]
    for case in Cases().all(asked.groups):
        if asked.only not in case.name:
            continue
        begin = time.monotonic()
        state, wrong = case.go()
        rows = [row for row in rows if row[:2] != (case.group, case.name)]
        rows.append((case.group, case.name, state, wrong))
        if wrong:
            spent = time.monotonic() - begin
            print(f"FAULT {case.group}: {case.name} ({spent:.1f} s)", *wrong, sep="\n    ", flush=True)
        if asked.rows:
            asked.rows.write_text(json.dumps(rows), encoding="utf-8")
    faults = sum(bool(wrong) for *_, wrong in rows)
    print(f"{len(rows)} cases, {faults} faults, {time.monotonic() - begun:.0f} s")
    if asked.out:
        asked.out.write_text(table(rows), encoding="utf-8")
    return 1 if faults else 0


def table(rows: list[tuple[str, str, str, list[str]]]) -> str:
    """The table as Markdown: sums by group, then every case."""
    asked = __doc__.split("\n\n")[2].splitlines()
    lines = [f"# {len(rows)} faults and what became of the file", "", *asked, ""]
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
