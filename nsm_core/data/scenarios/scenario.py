"""What composing knows of an action: how often it is drawn, and how it is laid from captures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.segment import Segment

from .session import Episode, Session


@dataclass(frozen=True)
class Scenario:
    """How an action is composed.

    ``share`` is how often it is drawn, in proportion to the others.  ``lay(session)`` goes on with it, and is
    False where the draw did not work out.  ``segments(folder)`` are the captured pieces that it is laid from,
    and ``order`` their place in the library among those of the others: takes of a seed stay the same by it.
    ``alone(session)`` plays one captured piece; None where captures have none.  ``draws`` is the dataclass of
    what it draws at random, kept with training data.
    """

    share: float
    lay: Callable[[Session], bool]
    alone: Callable[[Session], bool] | None = None
    segments: Callable[[CaptureFolder], list[Segment]] | None = None
    order: int = 0
    draws: object = None


def episode(lay: Callable[[Session], Episode | None]) -> Callable[[Session], bool]:
    """``lay`` of a scenario whose episode shapes the motion later."""

    def laid(session: Session) -> bool:
        found = lay(session)
        if found is None:
            return False
        session.episodes.append(found)
        return True

    return laid


__all__ = ["Scenario", "episode"]
