"""From the network's motion to the one that is kept: the whole take is solved at once when it is complete.

While a take grows, its frames are noted with what they ask for: hands on props, hips on seats, feet that
stand.  Then feet are planted from landing to lift-off, and body and limbs follow with the least change, out
of everything solid.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, field

import numpy as np

from nsm_core.body.capsules import BUNDLED, Figure
from nsm_core.body.contacts import ANKLES, TOES
from nsm_core.body.ik.clearance import Clearance, Obstacle
from nsm_core.body.ik.foot_clearance import keep_clear
from nsm_core.body.ik.footsteps import FootGround, footsteps
from nsm_core.body.ik.seating import settle
from nsm_core.body.ik.solver import Pose, Task, solve
from nsm_core.body.ik.stiffness import stiffness
from nsm_core.body.ik.tasks import PointTask, TurnTask
from nsm_core.body.ik.toes import bent_up
from nsm_core.body.ik.two_bone import place_on
from nsm_core.body.inertialization import BLEND_FRAMES, soften_places, soften_seam, soften_turns
from nsm_core.body.skeleton import FEET, HIPS, INDEX, TOE_HEIGHT
from nsm_core.body.tree import HUMAN
from nsm_core.conventions import FOOT_CONTACTS, HIP_CONTACT
from nsm_core.rotations import Array, quat_conjugate, quat_mul, quat_to_rotvec
from nsm_core.signals import smooth_step
from nsm_core.world.geometry.distance import Cuboids, DistanceQuery
from nsm_core.world.scene.props import Prop
from nsm_core.world.scene.terrain import Terrain

from .actions.base import Grasp, SeatTarget
from .actions.hold import Lead, SeenBody
from .actions.seat_manner import SeatedManner
from .bending import bent
from .elbows import with_room
from .gaze import looking
from .goals import Moment
from .hands import hands_of
from .load import leant
from .seated import sat
from .start import Start

# Standard deviations that are left to what is asked, metres and radians.
SEAT, SEAT_TURN, HEAD_TURN = 0.003, 0.03, 0.1
JUMP = 0.08  # metres in a frame that hips go at most for a hand that would miss
OFF_HOLD = 0.02  # metres off what it holds from which on a hand is missed
GRASPS = (0.6, 1.0)  # share of its way over which a hand comes to touch what it holds
# Metres by which a hand that holds a thing may be inside it, and the forearm along it.
INSIDE, ALONG = 0.3, 0.02
# Radians between the pose a take goes on from and its own from which on the ease takes longer, by so many
# frames at most.
FAR, SLOWER = np.radians((40, 130)), 16
_FLOOR = Cuboids([((0.0, 0.0, 0.0), 0.0, ((-500.0, -500.0, -2.0),), ((500.0, 500.0, 0.0),))])
_LIMBS = tuple(leg[:3] for leg in FEET)


@dataclass
class Note:
    """What a frame asks for beside the pose: see ``PostProcess.note``."""

    hips: Array
    local: Array
    contacts: Array
    heading: float
    seat: SeatTarget | None
    level: float
    leads: list[Lead]
    # By the prop's name, how far either hand touches it, 0..1, and whether forearms lie along it.
    touching: dict[str, tuple[float, float, bool]]
    # Kilograms that hands bear, and their middle (3,), world.
    load: tuple[float, Array]
    manner: SeatedManner | None = None  # in which the seat is taken


@dataclass
class PostProcess:
    """The notes of one take, and what its motion is solved among: ``still`` solids, ``terrain`` that feet
    stand on, ``low`` what of it one walks over.  ``figure`` is the character's own body, at the network's
    height of hips.
    """

    still: DistanceQuery
    terrain: Terrain
    low: Terrain
    figure: Figure = BUNDLED
    start: Start | None = None  # what the motion goes on from
    notes: list[Note] = field(default_factory=list)
    # Metres (T, 2, 3) by which wrists lie beside where they were led, once solved.
    beside: Array = field(init=False)

    def note(
        self,
        hips: Array,
        local: Array,
        moment: Moment,
        seat: SeatTarget | None,
        grasps: Sequence[Grasp],
        level: float,
        manner: SeatedManner | None = None,
    ) -> None:
        """Note a frame: the network's ``hips`` (3,), ``local`` rotations (23, 4) and ``moment``, on a floor
        at the height ``level``; ``seat`` what is sat on, and in which ``manner``.  The ``grasps``
        go on by a frame and move their props.
        """
        seen = SeenBody(hips.astype(np.float64), local.astype(np.float64), moment.wrists)
        leads: list[Lead] = []
        touching = {}
        for grasp in grasps:
            grasp.apply(seen, moment.root.astype(np.float64), moment.contacts)
            leads += grasp.leads
            if grasp.prop is not None:
                shares = {lead.hand: lead.share for lead in grasp.leads}
                right, left = (shares.get(h, 0.0) if grasp.touches(h) else 0.0 for h in (0, 1))
                touching[grasp.prop.name] = right, left, grasp.forearms
        borne = [(grasp.bears, grasp.prop.pose[:3].copy()) for grasp in grasps if grasp.prop is not None]
        mass = sum(kilograms for kilograms, _ in borne)
        load = mass, sum((m * at for m, at in borne), np.zeros(3)) / max(mass, 1e-9)
        self.notes.append(
            Note(hips, local, moment.contacts, moment.heading, seat, level, leads, touching, load, manner)
        )

    def solve(
        self, props: Sequence[tuple[Prop, Array]], others: Sequence[Obstacle] = ()
    ) -> Generator[None, None, tuple[Array, Array]]:
        """Return hips (T, 3) and local rotations (T, 23, 4) of the take; yields now and then.

        ``props`` are what moves, with the poses (T, 4) that it has had; ``others`` who else moves.
        """
        notes = self.notes
        contacts = np.stack([n.contacts for n in notes])
        hips, local, seated = settle(
            np.stack([n.hips for n in notes]).astype(np.float64),
            np.stack([n.local for n in notes]).astype(np.float64),
            headings := np.array([n.heading for n in notes]),
            contacts[:, HIP_CONTACT],
            [n.seat for n in notes],
        )
        pose = looking(Pose(self.figure.tree, hips, local), [n.leads for n in notes])
        yield
        ground = FootGround(self.terrain, self.low, np.array([n.level for n in notes]))
        solids = [*self._solids(props), *others]
        labels, sole = contacts[:, FOOT_CONTACTS], self.figure.sole
        # Feet go where the network has them, whatever legs they hang on.
        toes = HUMAN.forward(hips, local)[0][:, TOES] + (0, 0, sole.toe_height - TOE_HEIGHT)
        before = None if self.start is None else Pose(self.figure.tree, *self.start.second())
        first = None if before is None else (before.positions[-1, TOES], before.world[-1, ANKLES])
        feet = footsteps(toes, pose.world[:, ANKLES], labels, ground, sole, first)
        yield
        yield from keep_clear(feet, pose, solids, self.figure.spheres)
        yield
        pose = leant(pose, *(np.array(column) for column in zip(*[n.load for n in notes], strict=True)))
        pose, laid = sat(pose, [n.manner for n in notes], self.figure)
        pose = yield from bent(pose, [n.leads for n in notes], self.figure, headings, feet, solids)
        hands = hands_of([n.leads or own for n, own in zip(notes, laid, strict=True)], pose, self.figure)
        self.beside = hands.beside
        # Arms go first, so that the trunk gives no more than what they lack.
        pose = Pose(pose.tree, pose.hips, hands.led(pose, np.sign(hands.firm), hands.turns))
        pose = with_room(pose, [n.leads for n in notes], solids, self.figure)
        yield
        tasks = [*feet.tasks(), *_sit(pose, seated), *hands.tasks(), *hands.trunk(pose)]
        tasks.append(TurnTask(INDEX["Head"], pose.world[:, INDEX["Head"]], np.full(len(notes), HEAD_TURN)))
        spheres = self.figure.spheres
        limit = Clearance([*solids, self._floor()], spheres.foot, spheres)
        pose = yield from solve(pose, [*tasks, limit], stiffness())
        if any(lead.bends for n in notes for lead in n.leads) and hands.lack(pose) > OFF_HOLD:
            # Who bends among furniture may need twice as many rounds, unless hips would jump for it.
            more = yield from solve(pose, [*tasks, limit], stiffness())
            if _fastest(more) <= max(_fastest(pose), JUMP):
                pose = more
        pose = Pose(pose.tree, pose.hips, hands.twisted(hands.led(pose, hands.firm)))
        if before is not None and len(notes) > 3:
            hips, local = _gone_on(before, pose, feet.ankles, feet.rotations)
        else:
            hips = pose.hips
            local = place_on(pose.tree, hips, pose.local, _LIMBS, feet.ankles, feet.rotations)
        return hips, local if sole.tip is not None else bent_up(self.figure, hips, local, ground)

    def _floor(self) -> Obstacle:
        """The floor, off which all but feet keep."""
        return Obstacle(_FLOOR)

    def _solids(self, props: Sequence[tuple[Prop, Array]]) -> list[Obstacle]:
        solids, spheres = [Obstacle(self.still)], self.figure.spheres
        for prop, poses in props:
            touching = np.array([n.touching.get(prop.name, (0.0, 0.0, False)) for n in self.notes])
            share = smooth_step((touching[:, :2] - GRASPS[0]) / (GRASPS[1] - GRASPS[0]))
            free = np.zeros((len(poses), len(spheres.radii)))
            for side in (0, 1):
                free += INSIDE * share[:, side, None] * (spheres.hand == side)
                free += ALONG * (share[:, side] * touching[:, 2])[:, None] * (spheres.forearm == side)
            solids.append(Obstacle(prop.query, poses, free if free.any() else None))
        return solids


def _gone_on(before: Pose, pose: Pose, ankles: Array, turns: Array) -> tuple[Array, Array]:
    """Hips (T, 3) and local rotations (T, 23, 4) of a motion with feet at ``ankles`` (T, 2, 3) and ``turns``
    (T, 2, 4), whose first frame is the last one of what was ``before``: the way from there fades
    (``inertialization``).
    """

    def joined(old: Array, new: Array) -> Array:
        return np.concatenate((old[-2:], new[1:]))

    hips, local = joined(before.hips, pose.hips), joined(before.local, pose.local)
    far = quat_to_rotvec(quat_mul(pose.local[0], quat_conjugate(before.local[-1])))
    share = float(smooth_step((np.linalg.norm(far, axis=-1).max() - FAR[0]) / (FAR[1] - FAR[0])))
    soften_seam(hips, local, 2, BLEND_FRAMES + round(share * SLOWER))
    ankles = joined(before.positions[:, ANKLES], ankles)
    turns = joined(before.world[:, ANKLES], turns)
    soften_places(ankles, 2)
    soften_turns(turns, 2)
    legs = [j for leg in _LIMBS for j in leg]
    eased = place_on(pose.tree, hips, local, _LIMBS, ankles, turns)
    # Legs that were stretched further than the solver does are let go as slowly.
    eased[:2] = before.local[-2:]
    soften_turns(part := eased[:, legs], 2)
    eased[:, legs] = part
    return hips[1:], eased[1:]


def _fastest(pose: Pose) -> float:
    """Metres that the hips of a motion go in a frame at most."""
    return float(np.linalg.norm(np.diff(pose.hips, axis=0), axis=1).max(initial=0.0))


def _sit(pose: Pose, weight: Array) -> list[Task]:
    if not weight.any():
        return []
    share = np.where(weight > 0, 1 / np.maximum(weight, 1e-3), np.inf)
    faces = TurnTask(HIPS, pose.world[:, HIPS].copy(), SEAT_TURN * share)
    return [PointTask(HIPS, pose.hips.copy(), SEAT * share), faces]


__all__ = ["Note", "PostProcess"]
