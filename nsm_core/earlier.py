"""Modules by the names they had before the rooms were laid out, so that scripts written for those go on
working.

Each such import warns with the name to write instead.  To be taken out with the next minor version.
"""

from __future__ import annotations

import importlib
import importlib.util
import sys
import warnings
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

# Earlier name -> where its names are now; several where they were divided.
MOVED: dict[str, tuple[str, ...]] = {
    "nsm_core.bvh": ("nsm_core.data.captures.reader", "nsm_core.data.captures.bvh_file"),
    "nsm_core.bvh_mapping": ("nsm_core.data.captures.joint_map",),
    "nsm_core.bvh_write": ("nsm_core.data.captures.bvh_writer",),
    "nsm_core.clip": ("nsm_core.body.clip",),
    "nsm_core.features": ("nsm_core.model.features.layout", "nsm_core.model.features.codec"),
    "nsm_core.inference": ("nsm_core.model.inference.model", "nsm_core.model.inference.network_of"),
    "nsm_core.networks": ("nsm_core.model.networks",),
    "nsm_core.networks.config": ("nsm_core.model.networks.nsm_config", "nsm_core.model.networks.config"),
    "nsm_core.skeleton": ("nsm_core.body.skeleton",),
    "nsm_core.weights_file": ("nsm_core.model.inference.weights_file",),
    "nsm_blender.armature": ("nsm_blender.rigs.armature",),
    "nsm_blender.channels": ("nsm_blender.animation.channels",),
    "nsm_blender.character": ("nsm_blender.rigs.character",),
    "nsm_blender.colliders": ("nsm_blender.world.colliders", "nsm_blender.world.bvh_query"),
    "nsm_blender.doors": ("nsm_blender.goals.open",),
    "nsm_blender.house": ("nsm_blender.demo_scene.house",),
    "nsm_blender.keying": (
        "nsm_blender.keys.keying",
        "nsm_blender.keys.keyed",
        "nsm_blender.keys.pose_channels",
        "nsm_blender.keys.switches",
    ),
    "nsm_blender.outputs": ("nsm_blender.pictures.outputs",),
    "nsm_blender.render": ("nsm_blender.pictures.render",),
    "nsm_blender.report": ("nsm_blender.keys.report",),
    "nsm_blender.room": ("nsm_blender.demo_scene.room",),
    "nsm_blender.running": ("nsm_blender.ui.running",),
    "nsm_blender.scene": ("nsm_blender.world.frame", "nsm_blender.keys.preview"),
    "nsm_blender.session": ("nsm_blender.ui.session",),
    "nsm_blender.surroundings": ("nsm_blender.world.surroundings",),
    "nsm_blender.things": ("nsm_blender.keys.objects",),
}
RENAMED = {
    "Session": "TakeSession",
    "Surroundings": "SensorReading",
    "Thing": "MovedObject",
    "advance": "note_progress",
    "begin": "begin_take",
    "end": "end_take",
    "read": "read_clip",
    "read_all": "read_clips",
    "write": "write_bvh",
}


class _Divided(ModuleType):
    """An earlier module: its names are looked up where they are now, and set there."""

    def __getattr__(self, name: str) -> object:
        if not name.startswith("__"):
            for target in MOVED[self.__name__]:
                module = importlib.import_module(target)
                for known in (name, RENAMED.get(name, name)):
                    if hasattr(module, known):
                        return getattr(module, known)
        raise AttributeError(f"module {self.__name__!r} has no attribute {name!r}")

    def __setattr__(self, name: str, value: object) -> None:
        if name.startswith("__"):
            super().__setattr__(name, value)
            return
        for target in MOVED[self.__name__]:
            module = importlib.import_module(target)
            for known in (name, RENAMED.get(name, name)):
                if hasattr(module, known):
                    setattr(module, known, value)
                    return
        super().__setattr__(name, value)


class _Earlier:
    # No subclass of importlib's own: these take longer to load than all else of the package's start.

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """The earlier module ``name``; None for every other."""
        if name not in MOVED:
            return None
        loader: Any = self
        below = any(other.startswith(name + ".") for other in MOVED)
        return importlib.util.spec_from_loader(name, loader, is_package=below)

    def create_module(self, spec: ModuleSpec) -> ModuleType:
        """An empty one: names are looked up when they are asked for."""
        return _Divided(spec.name)

    def exec_module(self, module: ModuleType) -> None:
        """Say what to write instead."""
        now = " or ".join(MOVED[module.__name__])
        warnings.warn(
            f"{module.__name__} is now {now}; import it from there.", DeprecationWarning, stacklevel=2
        )


def keep_names() -> None:
    """Let the earlier names be imported; a second call changes nothing."""
    if not any(isinstance(finder, _Earlier) for finder in sys.meta_path):
        sys.meta_path.append(_Earlier())
