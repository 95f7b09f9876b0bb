"""Command: put captured sit-downs on other seats by the five steps of ``contact_transfer``; writes each as BVH with a picture."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core.body.clip import Clip
from nsm_core.body.ik.foot_lock import detect_foot_contacts
from nsm_core.body.skeleton import forward_kinematics
from nsm_core.conventions import CONTACTS, FOOT_CONTACTS, HAND_CONTACTS, HIP_CONTACT
from nsm_core.data.captures import bvh_writer
from nsm_core.data.matching.database import SitDown, gaussian_smooth, load_sits
from nsm_core.data.scenarios.sit.episode import SEATS
from nsm_core.errors import CaptureError, OutputError
from nsm_core.rotations import Array
from nsm_core.world.affordances.arm_rests import arm_rests, hands_on_arm_rests
from nsm_core.world.assets.pool import Pool
from nsm_core.world.scene.furniture import Furniture, cuboids, make

from .contact_transfer import align, embed, fit_template, switch, transfer

REACH = 0.5  # metres from the middle of a seat beyond which hands leave its arm rests alone: those of a sofa

@dataclass(frozen=True)
class Switched:
    """A sit-down on another seat: the clip, the seat, its pose (4,), and contacts (T, 5) as embedded in the template."""

    clip: Clip
    piece: Furniture
    pose: Array
    contacts: Array


def switch_seat(sit: SitDown, pool: Pool, kind: str, seed: int) -> Switched:
    """Put a sit-down on the seat of ``kind`` that ``seed`` draws; hands go to arm rests where that seat has some."""
    piece = switch(pool, kind, seed)
    rests = all(rest is not None and np.linalg.norm(rest[:2] - piece.seat.point[:2]) < REACH for rest in arm_rests(piece))
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
        rotations = hands_on_arm_rests(hips, rotations, weight, slice(0, len(hips)), template, goal, float(pose[3]))
        contacts[weight > 0.99, HAND_CONTACTS[0]] = contacts[weight > 0.99, HAND_CONTACTS[1]] = 1
    there = align(template, pose, piece)
    hips, rotations = transfer(embed(hips, rotations, contacts, template, pose), piece, there)
    name = sit.clip.name.replace("/", "-").replace("@", "-")
    return Switched(Clip(f"{name}-{kind}-{seed}", hips.astype(np.float32), rotations.astype(np.float32)), piece, there, contacts)


def switch_all(captures: str | Path, pool: Pool, count: int, seed: int) -> list[Switched]:
    """Put the sit-downs of a capture folder on ``count`` seats, one after the other; CaptureError where nobody sits."""
    sits = load_sits(captures)
    if not sits:
        raise CaptureError(f"nobody sits down and rises again in {captures}; run `python -m nsm_core annotate` and look at its labels.")
    kinds = sorted(set(SEATS))
    return [switch_seat(sits[n % len(sits)], pool, kinds[n % len(kinds)], seed + n) for n in range(count)]


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core augment``."""
    from nsm_core.evaluation.pictures.figures import contact_sheet

    parser = argparse.ArgumentParser(prog="python -m nsm_core augment", description=__doc__)
    parser.add_argument("captures", help="folder with BVH captures")
    parser.add_argument("--objects", default=None, help="folder of furniture meshes to put beside the parametric pieces")
    parser.add_argument("--out", type=Path, default=Path("runs/augmented"))
    parser.add_argument("--count", type=int, default=12)
    parser.add_argument("--seed", type=int, default=0)
    a = parser.parse_args(arguments)
    try:
        a.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{a.out} cannot be made ({error.strerror}); choose a folder you may write to.") from error
    pool = Pool() if a.objects is None else Pool.load(a.objects, cache=a.out / "objects.npz").training()
    for done in switch_all(a.captures, pool, a.count, a.seed):
        clip, path = done.clip, a.out / f"{done.clip.name}.bvh"
        bvh_writer.write(path, clip.hips_position, clip.local_rotations)
        solid = cuboids([(done.piece, done.pose[:3], float(done.pose[3]))])
        seat = f"seat {done.piece.seat.height:.2f} m high"
        contact_sheet(clip.world()[0], path.with_suffix(".png"), boxes=solid, title=f"{clip.name}, {seat}", camera="character", rows=2)
        x, y, _, heading = done.pose
        print(f"{path.name}: {seat}, at {x:.3f}, {y:.3f}, turned by {np.degrees(heading):.1f} degrees")
    return 0
