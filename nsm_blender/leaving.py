"""End a process that has Blender as a package, without its last steps."""

from __future__ import annotations

import os
import shutil
import sys

import bpy


def leave(code: int) -> None:
    """End the process with ``code``; the application itself is left only where that is not 0, as by every
    script.

    As a package Blender may wait for ever in its C++ destructors, once its thread that closes files late has
    begun (seen with 4.5.15).  All our files are whole by then, so these steps are left out; only the
    session's folder is removed.
    """
    if bpy.app.binary_path:
        if code:
            sys.exit(code)
        return
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):  # nobody reads it any more
            code = code or 1
    shutil.rmtree(bpy.app.tempdir, ignore_errors=True)
    os._exit(code)
