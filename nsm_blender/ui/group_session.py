"""The takes of several characters under way in one scene, as ``TakeSession`` has one."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import bpy

from .session import TakeSession
from .watch import Watch

if TYPE_CHECKING:
    from ..animation.kept import SceneState
    from ..keys.preview import Preview
    from ..progress import Progress
    from ..together import GroupSpec


class GroupSession(TakeSession):
    """Several takes under way; however it ends, the scene is as it was or holds them all."""

    def __init__(
        self, group: GroupSpec, scene: bpy.types.Scene, ended: Callable[[], None] | None = None
    ) -> None:
        from ..together import generate_together

        self._previews: dict[bpy.types.Object, Preview] = {}
        super().__init__(group, scene, ended, generate_together)

    def _watching(self, spec: GroupSpec, scene: bpy.types.Scene) -> tuple[_Watches, list[SceneState]]:
        from ..animation.kept import SceneState
        from ..goals.resolve import moved_by

        return (
            _Watches([Watch(take, scene) for take in spec.takes]),
            [SceneState(scene, take.character, moved_by(take.goals)) for take in spec.takes],
        )

    def _show(self, progress: Progress) -> None:
        from ..keys.preview import Preview

        for shown in progress.cast:
            preview = self._previews.setdefault(shown.character, Preview(shown.character))
            self._shown = self.posed = True
            preview.show(shown.hips_world, shown.local_rotations, shown.moved)


class _Watches:
    def __init__(self, watches: list[Watch]) -> None:
        self.watches = watches

    def changed(self) -> str:
        """The first thing that was deleted, exchanged or renamed of any take."""
        return next((found for watch in self.watches if (found := watch.changed())), "")
