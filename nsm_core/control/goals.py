"""What an animator asks for, and what became of it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from nsm_core.body.capsules import BUNDLED, Figure
from nsm_core.conventions import CONTACTS
from nsm_core.distances import RUN_AT, WALKED
from nsm_core.errors import GoalError
from nsm_core.rotations import Array, heading_to_direction, rotate_planar, wrap_angle
from nsm_core.world.actions import BY_KEY, require_action
from nsm_core.world.affordances.picking import Picking
from nsm_core.world.affordances.pulling import Pulling
from nsm_core.world.scene.props import Box, Leaf, LightThing, Prop
from nsm_core.world.scene.terrain import Terrain
from nsm_core.world.sensors.interaction import InteractionVolume

MOST_OFF_SEAT = 0.15  # metres by which bulk holds hips off a seat
SQUEEZE = 0.1  # metres by which a body may be wider than a door: who passes turns a little
MOST_OFF_BOX, MOST_OFF_PALM = 0.25, 0.1  # and a box off the body, and wrists off its sides
_Kind = TypeVar("_Kind", bound=Prop)
# m/s that a goal may ask for, by action: those of the training data, and beside them what takes keep to.
SPEEDS = {"walk": (min(0.5, WALKED[0]), max(1.6, WALKED[1])), "run": (min(2.0, RUN_AT[0]), RUN_AT[1])}


LOADS = ("down", "along")  # a box in the hands is set down first, or carried along


@dataclass
class Steering:
    """What one who is steered should do now, changed by whoever steers: ``velocity`` (2,) m/s, and the
    ``heading`` to face where one stands, radians (None: as one stands); world.
    """

    velocity: Array = field(default_factory=lambda: np.zeros(2))
    heading: float | None = None

    @property
    def speed(self) -> float:
        """Metres a second that are wanted."""
        return float(np.linalg.norm(self.velocity))


@dataclass
class Both:
    """Two ``things`` that are carried at once, one in either hand, and the ``pickings`` by which, in the
    order in which they are taken; ``leads`` names the one that is put down first, whose goal takes both.

    They are taken, and put down, from one place ``at_once`` where that says so.  ``hands`` are those at work,
    by the names of things, written by its stage.
    """

    things: tuple[LightThing, LightThing]
    pickings: tuple[Picking, Picking]
    leads: str
    at_once: tuple[bool, bool] = (False, False)
    hands: dict[str, Any] = field(default_factory=dict)


@dataclass
class Goal:
    """One entry of the queue.

    ``position`` (3,) world metres: for sit the hip joint's place when seated (seat surface plus
    ``skeleton.HIP_OVER_SEAT``); for carry where the centre of the box is set down; for place where the foot
    of the thing is; for climb where one stands at the end, on top of the object (z is its height) or, behind
    a low wall, on the floor; for open the middle of the opening, or of a front, on the floor; else a point on
    the ground.
    ``heading`` the way to face there, radians (for open and place it is ignored: the side one comes from
    decides, and the hand);
    ``hold`` seconds to stay once it is reached; ``interaction`` the sensed object of sit and climb; ``prop``
    what is moved: the box of carry, the leaf or front of open; ``terrain`` the heights of what a climb
    stands on (probed from the scene where None).  Of walk and run: ``way`` (N, 2) a line over the floor that
    is followed from its first point to its last, which is the position; ``speed`` m/s, drawn where None;
    ``steering`` that leads instead of a place, until something else is asked for.
    ``picking`` is how a thing is taken and put down, planned where None; ``pulling`` how a front of furniture
    is moved, to the ``opening``, 0 shut to 1.  ``first`` are goals that belong to it and are done before:
    fronts that are opened to get at a thing, things that are put aside for it; ``then`` those that are done
    after it, fronts that are shut again.  ``both`` tells of two goals that their things are carried at once
    (``scheduling``).
    ``by`` seconds from the take's beginning at which it is to be reached, as soon as it can be where None;
    ``load``, one of LOADS: what becomes of a box that is in the hands when the goal begins.  Who walks, runs
    or stands can carry it along.
    ``wait`` seconds of standing, or whatever was done before, until it is begun, and ``pace`` the speed of
    its ways as a share of the usual one, bring that about (``timing``).
    """

    action: str
    name: str
    position: Array
    heading: float
    hold: float = 2.0
    interaction: InteractionVolume | None = None
    prop: Prop | None = None
    terrain: Terrain | None = None
    way: Array | None = None
    speed: float | None = None
    by: float | None = None
    wait: float = 0.0
    pace: float = 1.0
    steering: Steering | None = None
    load: str = "down"
    picking: Picking | None = None
    pulling: Pulling | None = None
    opening: float = 1.0
    first: tuple[Goal, ...] = ()
    then: tuple[Goal, ...] = ()
    both: Both | None = field(default=None, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.load not in LOADS:
            known = " or ".join(LOADS)
            raise GoalError(f"The goal '{self.name}' has {self.load} for its load; write {known}.")
        action = require_action(self.action)
        self.position = np.asarray(self.position, dtype=np.float32)
        if (
            self.position.shape != (3,)
            or not np.isfinite(self.position).all()
            or not np.isfinite(self.heading)
        ):
            raise GoalError(
                f"The goal '{self.name}' has no usable place; give it three finite coordinates and a heading."
            )
        if not np.isfinite(self.hold) or self.hold < 0:
            raise GoalError(
                f"The goal '{self.name}' has a hold of {self.hold} seconds; give it zero or more."
            )
        if self.speed is not None:
            require_speed(self.action, self.speed)
        if action.prop is not None and not isinstance(self.prop, action.prop):
            raise GoalError(f"The goal '{self.name}' has nothing to {self.action}; choose {action.handles}.")

    def fitting(self, figure: Figure) -> Goal:
        """The same for a body that is thicker or thinner than the bundled one: hips off seats by as much, a
        box off body and palms.  GoalError where a body is wider than the door it is to pass.
        """
        if figure is BUNDLED:
            return self
        if isinstance(self.prop, Leaf) and figure.width > self.prop.width + SQUEEZE:
            raise GoalError(
                f"Head or trunk of the character is {figure.width / self.prop.width:.1f} times as wide as "
                f"{self.name}; choose a wider door, or scale this one."
            )
        if isinstance(self.prop, Box):
            off, palm = np.subtract((figure.front, figure.palm), (BUNDLED.front, BUNDLED.palm))
            off, palm = np.clip((off, palm), 0.0, (MOST_OFF_BOX, MOST_OFF_PALM)).tolist()
            return replace(self, prop=replace(self.prop, off=off, palm=palm))
        if not BY_KEY[self.action].seats:
            return self
        behind, under = np.subtract(figure.seat, BUNDLED.seat)
        ahead = np.clip(behind, 0.0, MOST_OFF_SEAT) * heading_to_direction(np.array(self.heading))
        place = self.position + np.append(ahead, np.clip(under, -MOST_OFF_SEAT / 3, MOST_OFF_SEAT))
        return replace(self, position=place)

    @property
    def parts(self) -> tuple[Goal, ...]:
        """What is done for it, in this order: what comes first, the goal itself, what comes then."""
        return (*self.first, self, *self.then)

    def moves(self, kind: type[_Kind]) -> _Kind:
        """What is moved, a ``kind`` of prop; GoalError where that is no such thing."""
        if not isinstance(self.prop, kind):
            raise GoalError(f"The goal '{self.name}' has nothing to {self.action}; choose another object.")
        return self.prop


def require_speed(action: str, speed: float) -> None:
    """Raise GoalError unless one can go at ``speed`` (m/s) as the action asks."""
    low, high = SPEEDS.get(action, (np.inf, -np.inf))
    if low > high:
        raise GoalError(f"A goal to {action} has no speed; remove it, or choose to walk or run.")
    if not low <= speed <= high:
        raise GoalError(
            f"A goal to {action} asks for {speed:g} m/s; the network has learned to {action} at {low:g} to "
            f"{high:g} m/s: choose a speed between, or the other gait."
        )


@dataclass
class Taken:
    """Where hands should be on a prop at the moment when they take it.

    ``hands`` 0 right, 1 left; ``places`` (N, 3) of their wrists in the prop's frame, metres; ``frame`` of the
    take, -1 unknown.  ``beside`` (N, 3) metres, world, by which wrists lie beside these places, with what
    they hold across the palm.
    """

    hands: list[int]
    places: Array
    frame: int = -1
    beside: Array | None = None

    def errors(self, wrists: Array, pose: Array) -> tuple[float, float]:
        """Mean centimetres of wrists (2, 3), right and left, from their places on the prop at ``pose`` (4,),
        world frame.

        And, for two hands, degrees by which their axis is turned about the vertical; nan for one.
        """
        places = rotate_planar(np.asarray(self.places, dtype=np.float64), np.float64(pose[3])) + pose[:3]
        if self.beside is not None:
            places = places + self.beside
        held = np.asarray(wrists, dtype=np.float64)[self.hands]
        away = 100 * float(np.linalg.norm(held - places, axis=1).mean())
        if len(held) < 2:
            return away, float("nan")
        turns = [np.arctan2(*(p[1] - p[0])[[1, 0]]) for p in (places, held)]
        return away, float(np.degrees(abs(wrap_angle(turns[1] - turns[0]))))


@dataclass
class GoalResult:
    """What became of a goal; errors at the end of its transition, of the pose that is keyed and of the
    network alone.

    For carry, ``position_error_cm`` and ``rotation_error_deg`` are the box's, where it was set down.  The
    hands' errors are those at the end of the grasp (carry: mean of both wrists and the turn of their axis;
    open: the one hand); nan elsewhere.
    ``line`` (N, 2) is what was to be followed, and ``line_cm`` are mean and largest distance from it to the
    root's ground track, nan elsewhere; ``remarks`` are sentences on how it was done; ``late`` seconds by
    which it was reached after the time that was asked for.
    ``reason``: why it was given up, a sentence, where in the middle of a take no way led to it; empty where
    its time ran out.  ``place`` and ``facing`` are what the errors were measured to, over the first ``axes``
    axes; None where nothing was measured.  ``taken`` is what the hands' were measured to.
    """

    object: str
    action: str
    reached: bool = False
    seconds: float = 0.0
    position_error_cm: float = float("nan")
    rotation_error_deg: float = float("nan")
    network_position_error_cm: float = float("nan")
    network_rotation_error_deg: float = float("nan")
    start_frame: int = 0
    end_frame: int = 0
    hand_error_cm: float = float("nan")
    hand_rotation_deg: float = float("nan")
    network_hand_error_cm: float = float("nan")
    network_hand_rotation_deg: float = float("nan")
    line: Array | None = None
    line_cm: tuple[float, float] = (float("nan"), float("nan"))
    remarks: list[str] = field(default_factory=list)
    late: float = 0.0
    reason: str = ""
    place: Array | None = None
    facing: float = 0.0
    axes: int = 3
    taken: Taken | None = None


@dataclass
class Moment:
    """What the director sees of a character.

    ``root`` (3,), ``hips`` (3,) world, ``heading``, hip ``speed`` m/s, labels ``style`` (7,), the network's
    ``wrists`` (2, 3) right and left, world, and its ``contacts`` (5,); ``turning`` how fast the heading
    changes, rad/s.
    """

    root: Array
    hips: Array
    heading: float
    speed: float
    style: Array = field(repr=False)
    wrists: Array = field(repr=False, default_factory=lambda: np.zeros((2, 3)))
    contacts: Array = field(repr=False, default_factory=lambda: np.zeros(len(CONTACTS)))
    turning: float = 0.0
