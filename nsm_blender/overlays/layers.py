"""The overlays, a record each: what they are called, what they show, and by which function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ..outlook import Outlook
    from .kept import RememberedTake
    from .shapes import Shapes


@dataclass(frozen=True)
class Layer:
    """One overlay.

    ``before`` makes it of what is known before a take, ``during`` of a take at one of its frames;
    ``follows``: what it shows is drawn where it is by then, as things move from frame to frame;
    ``flat`` lies on the screen, in pixels, instead of in the scene.
    """

    key: str
    label: str
    description: str
    icon: str
    before: Callable[[Outlook], Shapes] | None = None
    during: Callable[[RememberedTake, int], Shapes] | None = None
    flat: bool = False
    follows: bool = False


def _scene_layers() -> Any:
    """Loaded when one is drawn: the toggles are there before anything is computed."""
    from . import scene_layers

    return scene_layers


def _take_layers() -> Any:
    from . import take_layers

    return take_layers


LAYERS = (
    Layer(
        "colliders",
        "Solid Things",
        "What the character walks around (orange), and what it steps on (green)",
        "MOD_PHYSICS",
        before=lambda found: _scene_layers().colliders(found),
        follows=True,
    ),
    Layer(
        "goals",
        "Goals and Contacts",
        "Where each goal was found, and in a take which of hips, hands and feet hold something",
        "PIVOT_CURSOR",
        before=lambda found: _scene_layers().goals(found),
        during=lambda take, t: _take_layers().contacts(take, t),
    ),
    Layer(
        "way",
        "Planned Way",
        "The way over the floor from goal to goal",
        "CURVE_PATH",
        before=lambda found: _scene_layers().planned_way(found),
    ),
    Layer(
        "environment",
        "Surroundings Sensor",
        "What the character senses around itself in this frame of its take: spheres, from blue to red the "
        "fuller they are",
        "MESH_CYLINDER",
        during=lambda take, t: _take_layers().environment(take, t),
    ),
    Layer(
        "interaction",
        "Object Sensor",
        "What the character senses of the object that it is after, in this frame of its take",
        "MESH_GRID",
        during=lambda take, t: _take_layers().interaction(take, t),
    ),
    Layer(
        "trajectories",
        "Steered Paths",
        "The second ahead as seen from the character (orange) and from its goal (blue), and the way that was "
        "gone (white)",
        "TRACKING_FORWARDS_SINGLE",
        during=lambda take, t: _take_layers().trajectories(take, t),
    ),
    Layer(
        "gating",
        "Experts at Work",
        "Which experts of the network make this frame, and over two seconds before and after it",
        "GRAPH",
        during=lambda take, t: _take_layers().gating(take, t),
        flat=True,
    ),
)
