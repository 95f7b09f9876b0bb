"""Frames and seconds of a scene."""

from __future__ import annotations

import bpy


def scene_fps(scene: bpy.types.Scene) -> float:
    """Frames per second that the scene plays, its base included."""
    return scene.render.fps / scene.render.fps_base
