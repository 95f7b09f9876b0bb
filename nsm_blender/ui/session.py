"""A take that grows between redraws: stepped within a time budget, shown as it grows, taken back without a
trace.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import bpy

from nsm_core.errors import NsmError

from ..collecting import PutOff
from . import running
from .watch import Watch, install

if TYPE_CHECKING:
    from ..animation.kept import Kept, SceneState
    from ..keys.preview import Preview
    from ..prepare import TakeSpec
    from ..progress import Progress

_NOT_KEYED = "Generate stopped and nothing was keyed"  # in the sentences of ``watch``, too
_FORGETTING = 0.9  # a step, from which the length of the longest to come is guessed


class TakeSession:
    """One take under way in a scene; at most one runs at a time.

    However it ends, the scene is as it was or holds the whole take, and nothing counts as running.  ``why``
    then says in a sentence what ended it without a take; ``ended``, if given, is called once at that moment,
    whoever ends it.
    """

    def __init__(
        self,
        spec: TakeSpec,
        scene: bpy.types.Scene,
        ended: Callable[[], None] | None = None,
        steps: Callable[[TakeSpec, bpy.types.Scene], Generator[Progress, None, Any]] | None = None,
        stopped: str = _NOT_KEYED,
    ) -> None:
        """Start a take; NsmError while another one is under way, SkeletonError and GoalError as for its
        goals.

        Other ``steps`` than a take's, as of ``prepare.show_goal_points``, are watched in the same way;
        ``stopped`` says in their sentences what did not come about.
        """
        from ..animation.meanwhile import Meanwhile
        from ..takes import generate

        if running.current() is not None:
            raise NsmError(running.reason_busy())
        self.scene, self.character = scene, spec.character
        self.fraction, self.text = 0.0, "Starting"
        self.over, self.why = False, ""
        self.posed = False  # whether the last tick has changed what the scene looks like
        self._ended = ended
        self._watch, states = self._watching(spec, scene)
        self._others = Meanwhile(scene, states)
        self._told = ""  # what others have changed, in the words of ``Meanwhile.look``
        # What plays on the character and its things before they are keyed, and while a file is saved.
        self._before: Kept | None = None
        self._aside: Kept | None = None
        self._steps, self._stopped = (steps or generate)(spec, scene), stopped
        self._value: Any = None
        self._preview: Preview | None = None
        self._shown, self._longest = False, 0.0
        install()
        self._others.left()
        self._collecting = PutOff()
        running.begin_take(scene, spec.character, self._stop, self._step_aside)

    def _watching(self, spec: TakeSpec, scene: bpy.types.Scene) -> tuple[Watch, list[SceneState]]:
        """What the take stands on, and what it may disturb."""
        from ..animation.kept import SceneState
        from ..goals.resolve import moved_by

        return Watch(spec, scene), [SceneState(scene, spec.character, moved_by(spec.goals))]

    def tick(self, budget: float, show: bool = True) -> Any:
        """Step frames for up to ``budget`` seconds and, with ``show``, pose the character as in the newest;
        the Take (or the value of the other steps) when done, None before.

        Raises NsmError with one sentence, as ``takes.generate`` does, or where something that the take needs
        is gone; the scene is then as it was before the session.
        """
        if self.over:
            raise NsmError(self.why or "This take has ended; generate again.")
        try:
            changed = self._watch.changed() or self._changed()
            if changed:
                raise NsmError(self._worded(changed))
            if self._aside is not None:
                self._aside.put_on()
                self._aside = None
            self.posed = False
            progress = self._step(time.perf_counter() + budget)
            if progress is None:
                self._close()
                return self._value
            self.fraction = max(progress.fraction, 0.0)
            self.text = running.note_progress(progress.stage, progress.fraction)
            if show or not self._shown:
                self._show(progress)
            self._others.left()
            return None
        except NsmError as error:
            self._stop(str(error))
            raise
        except Exception as error:
            why = self._worded(self._watch.changed()) or self.unforeseen(error)
            self._stop(why)
            raise NsmError(why) from error
        except BaseException:
            self.cancel()
            raise

    def cancel(self) -> None:
        """Stop and put frame, pose and places back; no key has been made.  Does nothing where the take has
        ended.
        """
        self._stop(f"{self._stopped.partition(' stopped')[0]} was cancelled; everything is as it was.")

    def _step(self, deadline: float) -> Progress | None:
        """Take steps while the next one can be expected to end before ``deadline``; the newest progress, None
        when all are done.
        """
        while True:
            begin = time.perf_counter()
            try:
                progress = next(self._steps)
            except StopIteration as stop:
                self._value = stop.value
                return None
            end = time.perf_counter()
            self._longest = max(self._longest * _FORGETTING, end - begin)
            if progress.stage == "Keying":
                self._put_back()  # the pose kept with the keys must be the animator's, not the preview's
                self._before = self._before or self._playing()
                return progress
            if progress.waits or end + self._longest > deadline:
                return progress

    def _show(self, progress: Progress) -> None:
        from ..keys.preview import Preview

        if progress.hips_world is None:
            return
        self._preview = self._preview or Preview(self.character)
        self._shown = self.posed = True
        self._preview.show(progress.hips_world, progress.local_rotations, progress.moved)

    def _changed(self) -> str:
        """What others have changed, as a sentence with what to do; empty where the take can go on."""
        self._told = self._told or self._others.look()
        return f"{self._told} meanwhile, so {_NOT_KEYED}; generate again." if self._told else ""

    def _put_back(self) -> None:
        if self._shown:
            self._shown, self.posed = False, True
            self._others.restore()

    def _step_aside(self) -> None:
        """Have the scene look as if no take was made of it, until the next tick."""
        self._changed()
        self._put_back()
        if self._before is not None and self._aside is None and self._others.keyed:
            self._aside = self._playing(self._before.actions)
            self._before.put_on()
        self._others.left()

    def _playing(self, replaced: Iterable[bpy.types.Action] = ()) -> Kept:
        from ..animation.kept import Kept

        return Kept(self.scene, self._others.targets, replaced)

    def _stop(self, why: str) -> None:
        """End without a take: whatever still exists is put back."""
        if self.over:
            return
        self.why = self._worded(why)
        for step in (self._changed, self._steps.close):  # what others have changed stays
            try:
                step()
            except Exception:  # what a generator does on its way out may meet what is gone, too
                import logging

                logging.getLogger(__name__).debug("The take's steps did not close", exc_info=True)
        self._others.settle()
        self._close()

    def _close(self) -> None:
        self.over = True
        running.end_take()
        if self._ended is not None:
            with suppress(ReferenceError):
                self._ended()
        self._others.go_to_chosen()
        self._collecting.end()

    def _worded(self, why: str) -> str:
        """A sentence about a take that stopped, in the words of these steps."""
        return why.replace(_NOT_KEYED, self._stopped)

    def unforeseen(self, error: Exception) -> str:
        """A sentence about an error that nobody has thought of; the console tells where it was raised."""
        if isinstance(error, ReferenceError):
            why = (
                "Something that the take reads was deleted or undone meanwhile, so Generate stopped and "
                "nothing was keyed; try again."
            )
        else:
            import logging

            logging.getLogger(__name__).error("Generate met an error that it does not know", exc_info=error)
            what = f"{type(error).__name__}: {error}".rstrip(": ")
            why = f"{_NOT_KEYED}, because of an error in the add-on ({what}); the console tells more."
        return self._worded(why)
