"""The interaction sensor: an 8 x 8 x 8 volume over an object that tells where it is solid (section 4.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from nsm_core.errors import GeometryError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.world.geometry.distance import DistanceQuery

RESOLUTION = 8
# A flat object, a sheet on the floor say, still gets cells with some volume.
_LEAST_SIZE = 0.01


def _unit_cells() -> Array:
    step = (np.arange(RESOLUTION) + 0.5) / RESOLUTION - 0.5
    z, y, x = np.meshgrid(step, step, step, indexing="ij")
    return np.stack((x, y, z), axis=-1).reshape(-1, 3).astype(np.float32)


UNIT_CELLS = _unit_cells()  # (512, 3) in -0.5..0.5: height outermost, then Y, then X


@dataclass
class InteractionVolume:
    """What the interaction sensor has read.

    ``centre`` (3,) world metres; ``size`` (3,) metres along the object's axes; ``heading`` of the object,
    radians; ``occupancy`` (512,) float32 in 0..1 in the order of ``UNIT_CELLS``.
    """

    centre: Array
    size: Array
    heading: float
    occupancy: Array

    def cells_world(self) -> Array:
        """Centres (512, 3) of the cells, world metres, float32."""
        return cells_world(self.centre, self.size, self.heading)


def cells_world(centre: Array, size: Array, heading: float) -> Array:
    """Centres (512, 3) of a volume's cells, world metres, float32; ``centre`` and ``size`` (3,) metres,
    heading radians.
    """
    cells = rotate_planar(UNIT_CELLS * np.asarray(size, dtype=np.float32), np.float32(heading))
    return cells + np.asarray(centre, dtype=np.float32)


def interaction_sensor(query: DistanceQuery, centre: Array, size: Array, heading: float) -> InteractionVolume:
    """Read the interaction sensor over one object (section 4.3).

    ``query`` knows this object alone; ``centre`` (3,) world metres and ``size`` (3,) metres are those of its
    bounding box turned by ``heading``, radians.  A cell reads 1 where its centre is inside, else 1 - distance
    / diagonal of the cell, not below 0.  (The paper drops to 0 at once where a cell touches nothing; the ramp
    goes on here, so that readings have no jumps.)  Raises GeometryError on a size or place that is not finite
    or is negative.
    """
    centre, size = np.asarray(centre, dtype=np.float32), np.asarray(size, dtype=np.float32)
    if (
        not (np.isfinite(centre).all() and np.isfinite(size).all() and np.isfinite(heading))
        or (size < 0).any()
    ):
        raise GeometryError("The goal object has no usable bounding box; repair its mesh or its scale.")
    size = np.maximum(size, _LEAST_SIZE)
    diagonal = np.float32(np.linalg.norm(size) / RESOLUTION)
    distance = query.signed_distance(cells_world(centre, size, heading), float(diagonal))
    return InteractionVolume(centre, size, float(heading), np.clip(1 - distance / diagonal, 0, 1))
