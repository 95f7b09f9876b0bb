"""Where the user's own files lie: lists of bones and queues of goals, as small text files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy


def preferences() -> Any | None:
    """The add-on's preferences; None where it was registered by a script instead of being enabled."""
    entry = bpy.context.preferences.addons.get(__package__)
    return entry.preferences if entry is not None else None


def user_folder(kind: str) -> Path:
    """The folder for one ``kind`` of file, the one chosen in the preferences or Blender's own for the add-on;
    it may not exist yet.
    """
    chosen = getattr(preferences(), "folder", "")
    if chosen:
        return Path(bpy.path.abspath(chosen)) / kind
    if __package__.startswith("bl_ext."):
        return Path(bpy.utils.extension_path_user(__package__, path=kind))
    return Path(bpy.utils.user_resource("CONFIG", path=f"nsm_{kind}"))
