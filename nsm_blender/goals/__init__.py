"""From objects, empties and actions of a scene to goals of the core."""

from .spec import GoalSpec

__all__ = ["GoalSpec"]
