"""What opens of furniture meshes: proposals of axes, handles and ranges, one line each."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array
from nsm_core.world.affordances.opening_parts import opening_parts
from nsm_core.world.assets.glb import read_parts
from nsm_core.world.scene.containers import MovingPart

# What readers add to the name of a mesh of several materials, which makes parts of one object.
_MATERIAL = re.compile(r"_[0-9a-f]{5,}$")


def main(arguments: list[str]) -> int:
    """Entry of ``python -m nsm_core containers``."""
    parser = argparse.ArgumentParser(prog="containers", description="Propose what opens of furniture meshes.")
    parser.add_argument("meshes", nargs="+", help="GLB files of furniture, front -Y once Z is up")
    for mesh in parser.parse_args(arguments).meshes:
        try:
            found = opening_parts(whole_objects(read_parts(Path(mesh))))
        except GeometryError as error:
            print(f"{Path(mesh).name}: {error}")
            continue
        for one in found:
            print(f"{Path(mesh).name}: {one.part.name} ({len(one.names)} parts) {told(one.part)}")
    return 0


def told(part: MovingPart) -> str:
    """A part's kind, range and handle, in words."""
    far = f"{np.degrees(part.travel):.0f} degrees" if part.turns else f"{part.travel * 100:.0f} cm"
    at = ", ".join(f"{x:.2f}" for x in part.handle)
    return f"{part.kind}, opens {far}, handle at {at} m"


def whole_objects(parts: list[tuple[str, Array, Array]]) -> list[tuple[str, Array, Array]]:
    """Join the parts of one object that a file has apart for their materials."""
    joined: dict[str, tuple[str, Array, Array]] = {}
    for name, vertices, triangles in parts:
        stem = _MATERIAL.sub("", name)
        if stem in joined:
            _, v, f = joined[stem]
            joined[stem] = stem, np.concatenate((v, vertices)), np.concatenate((f, triangles + len(v)))
        else:
            joined[stem] = stem, vertices, triangles
    return list(joined.values())
