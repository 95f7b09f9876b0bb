"""Captured sit-downs on other seats, by the five steps of ``contact_transfer``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.contacts import detect_foot_contacts
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.conventions import CONTACTS, FOOT_CONTACTS, HAND_CONTACTS, HIP_CONTACT
from nsm_core.data.captures.folder import CaptureFolder
from nsm_core.data.matching.segment import SitDown
from nsm_core.data.matching.selection import load_sits
from nsm_core.data.scenarios.hands import hands_on_arm_rests
from nsm_core.data.scenarios.sit.draws import SITS
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array
from nsm_core.signals import gaussian_smooth
from nsm_core.world.affordances.arm_rests import arm_rests
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import Furniture, make

from .contact_transfer import align, embed, fit_template, switch, transfer

REACH = 0.5  # metres from the middle of a seat beyond which hands leave its arm rests alone: those of a sofa


@dataclass(frozen=True)
class Switched:
    """A sit-down on another seat: the clip, the seat, its pose (4,), and contacts (T, 5) as embedded in the
    template.
    """

    clip: Clip
    piece: Furniture
    pose: Array
    contacts: Array


def switch_seat(sit: SitDown, pool: Pool, kind: str, seed: int) -> Switched:
    """Put a sit-down on the seat of ``kind`` that ``seed`` draws; hands go to arm rests where that seat has
    some.
    """
    piece = switch(pool, kind, seed)
    rests = all(
        rest is not None and np.linalg.norm(rest[:2] - piece.require_seat().point[:2]) < REACH
        for rest in arm_rests(piece)
    )
    template = make("armchair" if rests else "stool", np.random.default_rng(0))
    hips, rotations = sit.clip.hips_position, sit.clip.local_rotations
    template, pose = fit_template(hips, rotations, (sit.down + sit.up) // 2, template)
    contacts = np.zeros((len(hips), len(CONTACTS)))
    contacts[:, FOOT_CONTACTS] = detect_foot_contacts(forward_kinematics(hips, rotations)[0])
    contacts[sit.down : sit.up, HIP_CONTACT] = 1
    if rests:
        height = gaussian_smooth(hips[:, 2], 3.0)
        low, high = float(np.median(height[sit.down : sit.up])), float(max(height[0], height[-1]))
        weight = np.clip((high - 0.05 - height) / max(high - 0.07 - low, 0.1), 0, 1)
        goal = hips[sit.down : sit.up].mean(0)
        rotations = hands_on_arm_rests(
            hips, rotations, weight, slice(0, len(hips)), template, goal, float(pose[3])
        )
        contacts[weight > 0.99, HAND_CONTACTS[0]] = contacts[weight > 0.99, HAND_CONTACTS[1]] = 1
    there = align(template, pose, piece)
    hips, rotations = transfer(embed(hips, rotations, contacts, template, pose), piece, there)
    name = sit.clip.name.replace("/", "-").replace("@", "-")
    return Switched(
        Clip(f"{name}-{kind}-{seed}", hips.astype(np.float32), rotations.astype(np.float32)),
        piece,
        there,
        contacts,
    )


def switch_all(captures: str | Path, pool: Pool, count: int, seed: int) -> list[Switched]:
    """Put the sit-downs of a capture folder on ``count`` seats, one after the other; CaptureError where
    nobody sits.
    """
    sits = load_sits(CaptureFolder(captures))
    if not sits:
        raise CaptureError(
            f"nobody sits down and rises again in {captures}; run `python -m nsm_core annotate` and look at "
            "its labels."
        )
    kinds = sorted(set(SITS.kinds))
    return [switch_seat(sits[n % len(sits)], pool, kinds[n % len(kinds)], seed + n) for n in range(count)]
