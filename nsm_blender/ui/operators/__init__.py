"""Operators: each gathers its context, calls one function and reports."""

from __future__ import annotations

from . import (
    bones,
    character,
    check,
    example,
    export,
    fill,
    generate,
    generate_all,
    goal_list,
    help,
    pick,
    queues,
    review,
    steer,
    timeline,
    variations,
    what_opens,
)

CLASSES = (
    *character.CLASSES,
    *bones.CLASSES,
    *goal_list.CLASSES,
    *check.CLASSES,
    *pick.CLASSES,
    *what_opens.CLASSES,
    *queues.CLASSES,
    *example.CLASSES,
    *generate.CLASSES,
    *generate_all.CLASSES,
    *fill.CLASSES,
    *steer.CLASSES,
    *review.CLASSES,
    *variations.CLASSES,
    *timeline.CLASSES,
    *export.CLASSES,
    *help.CLASSES,
)
