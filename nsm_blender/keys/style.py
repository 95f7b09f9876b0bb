"""How a take is keyed: what carries its root motion, how many of its keys stay, and whose keys go into it."""

from __future__ import annotations

from dataclasses import dataclass

from nsm_core.body.key_reduction import Bound

HIPS, OBJECT, BONE, IN_PLACE = "hips", "object", "bone", "in_place"
KINDS = (HIPS, OBJECT, BONE, IN_PLACE)


@dataclass(frozen=True)
class KeyStyle:
    """``root_motion``: one of ``KINDS``; ``reduce``: how far the motion may be off for the sake of
    fewer keys, None for one in every frame; ``keep_edits``: whether the animator's keys in
    the take that this is another try of go into it.
    """

    root_motion: str = HIPS
    reduce: Bound | None = None
    keep_edits: bool = True


PLAIN = KeyStyle()
