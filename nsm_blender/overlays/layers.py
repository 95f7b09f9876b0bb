"""The overlays, a record each: what they are called, what they show, and by which function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ..outlook import Outlook
from . import scene_layers, take_layers
from .kept import RememberedTake
from .shapes import Shapes


@dataclass(frozen=True)
class Layer:
    """One overlay.

    ``before`` makes it of what is known before a take, ``during`` of a take at one of its frames;
    ``flat`` lies on the screen, in pixels, instead of in the scene.
    """

    key: str
    label: str
    description: str
    icon: str
    before: Callable[[Outlook], Shapes] | None = None
    during: Callable[[RememberedTake, int], Shapes] | None = None
    flat: bool = False


LAYERS = (
    Layer(
        "colliders",
        "Solid Things",
        "What the character walks around (orange), and what it steps on (green)",
        "MOD_PHYSICS",
        before=scene_layers.colliders,
    ),
    Layer(
        "goals",
        "Goals and Contacts",
        "Where each goal was found, and in a take which of hips, hands and feet hold something",
        "PIVOT_CURSOR",
        before=scene_layers.goals,
        during=take_layers.contacts,
    ),
    Layer(
        "way",
        "Planned Way",
        "The way over the floor from goal to goal",
        "CURVE_PATH",
        before=scene_layers.planned_way,
    ),
    Layer(
        "environment",
        "Surroundings Sensor",
        "What the character senses around itself in this frame of its take: spheres, from blue to red the "
        "fuller they are",
        "MESH_CYLINDER",
        during=take_layers.environment,
    ),
    Layer(
        "interaction",
        "Object Sensor",
        "What the character senses of the object that it is after, in this frame of its take",
        "MESH_GRID",
        during=take_layers.interaction,
    ),
    Layer(
        "trajectories",
        "Steered Paths",
        "The second ahead as seen from the character (orange) and from its goal (blue), and the way that was "
        "gone (white)",
        "TRACKING_FORWARDS_SINGLE",
        during=take_layers.trajectories,
    ),
    Layer(
        "gating",
        "Experts at Work",
        "Which experts of the network make this frame, and over two seconds before and after it",
        "GRAPH",
        during=take_layers.gating,
        flat=True,
    ),
)
