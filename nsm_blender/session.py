"""A take that grows between redraws: stepped within a time budget, shown as it grows, taken back without a trace."""

from __future__ import annotations

import time

import bpy

from . import running
from .goals import moved_by
from .scene import Preview, SceneState
from .takes import Take, TakeSpec, generate


class Session:
    """One take under way in a scene; at most one runs at a time."""

    def __init__(self, spec: TakeSpec, scene: bpy.types.Scene) -> None:
        self.scene, self.character = scene, spec.character
        self.fraction, self.text = 0.0, "Starting"
        self._state = SceneState(scene, spec.character, moved_by(spec.goals))
        self._steps = generate(spec, scene)
        self._preview: Preview | None = None
        running.begin(scene, spec.character)

    def tick(self, budget: float) -> Take | None:
        """Step frames for up to ``budget`` seconds and pose the character as in the newest; the Take when done.

        Raises as ``takes.generate`` does; the scene is then as it was before the session.
        """
        deadline = time.perf_counter() + budget
        progress = None
        try:
            while progress is None or time.perf_counter() < deadline:
                progress = next(self._steps)
                if progress.stage == "Keying":  # the pose kept with the keys must be the animator's, not the preview's
                    self._state.restore()
                    break
        except StopIteration as stop:
            running.end()
            return stop.value
        except Exception:
            self.cancel()
            raise
        if progress.hips_world is not None:
            self._preview = self._preview or Preview(self.character)
            self._preview.show(progress.hips_world, progress.local_rotations, progress.moved)
        self.fraction = progress.fraction
        self.text = running.advance(progress.stage, progress.fraction)
        return None

    def cancel(self) -> None:
        """Stop and put frame and pose back; no key has been made."""
        self._steps.close()
        self._state.restore()
        running.end()
