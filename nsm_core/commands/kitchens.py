"""The benchmark of kitchens: how much of them a hand can take, and pictures of them."""

from __future__ import annotations

import argparse
from collections import Counter
from pathlib import Path

import numpy as np

from nsm_core.evaluation.kitchens import KITCHENS, Taking, fields_of, least_gap, take_thing
from nsm_core.evaluation.pictures.kitchens import kitchen_picture
from nsm_core.world.assets.kitchen import Kitchen, make_kitchen


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core kitchens``."""
    parser = argparse.ArgumentParser(prog="kitchens", description="Look for grasps in generated kitchens.")
    parser.add_argument("--seeds", default=f"0:{KITCHENS}", help="FIRST:LAST, the last one not included")
    parser.add_argument("--things", type=int, default=8, help="of each kitchen for which grasps are sought")
    parser.add_argument("--draw", type=int, default=3, help="kitchens that are drawn")
    parser.add_argument("--out", default="out/kitchens", help="folder of the pictures")
    a = parser.parse_args(arguments)
    first, last = (int(n) for n in a.seeds.split(":"))
    rows, gaps, counts, marched = [], [], [], []
    for seed in range(first, last):
        kitchen = make_kitchen(seed)
        gaps.append(least_gap(kitchen))
        counts.append(len(kitchen.things))
        taken = [take_thing(kitchen, name) for name in chosen(kitchen, a.things)]
        rows += taken
        held = [t for t in taken if t.grasp is not None]
        marched += [fields_of(kitchen, t) for t in held[:1]]
        if seed - first < a.draw:
            print(f"Wrote {kitchen_picture(kitchen, taken, Path(a.out) / f'kitchen_{seed}.png')}.")
    gap = min(gaps) * 1000
    print(f"{last - first} kitchens, {np.mean(counts):.0f} things each, at least {gap:.0f} mm apart")
    print(table(rows))
    if marched:
        seconds, reached = np.mean(marched, axis=0)
        print(f"Fields: {seconds * 1000:.0f} ms each; a hand arrives at {reached:.0%} of the cells.")
    return 0


def chosen(kitchen: Kitchen, count: int) -> list[str]:
    """Names of things that are tried: blocked ones first, then by chance of the kitchen's seed."""
    names = list(kitchen.things)
    order = np.random.default_rng(kitchen.seed).permutation(len(names))
    names = sorted((names[k] for k in order), key=lambda n: not kitchen.things[n].blockers)
    half = count // 2
    blocked = [n for n in names if kitchen.things[n].blockers][:half]
    return blocked + [n for n in names if not kitchen.things[n].blockers][: count - len(blocked)]


def table(rows: list[Taking]) -> str:
    """A table of conditions: things, with a grasp that has room, that one reaches standing, and how it is
    held.
    """
    lines = ["| condition | things | grasp with room | reached | held by | seconds |", "|" + 6 * "---|"]
    for condition in ("open", "shut", "blocked"):
        some = [r for r in rows if r.condition == condition]
        if not some:
            continue
        kinds = Counter(r.grasp.kind for r in some if r.grasp is not None)
        lines.append(
            f"| {condition} | {len(some)} | {np.mean([bool(r.grasps) for r in some]):.0%} "
            f"| {np.mean([r.reach is not None for r in some]):.0%} "
            f"| {', '.join(f'{k} {n}' for k, n in kinds.most_common())} "
            f"| {np.mean([r.seconds for r in some]):.2f} |"
        )
    return "\n".join(lines)
