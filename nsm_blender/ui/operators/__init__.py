"""Operators: each gathers its context, calls one function and reports."""

from __future__ import annotations

from . import bones, character, check, export, generate, goal_list, help, review, timeline

CLASSES = (
    *character.CLASSES,
    *bones.CLASSES,
    *goal_list.CLASSES,
    *check.CLASSES,
    *generate.CLASSES,
    *review.CLASSES,
    *timeline.CLASSES,
    *export.CLASSES,
    *help.CLASSES,
)
