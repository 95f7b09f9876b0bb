"""From which side a take is looked at, moment by moment: where nothing stands before the body, changing sides
as little as it can.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from mathutils import Vector

from nsm_core.rotations import Array

from ..keys.keyed import KeyedTake
from ..prepare import own_objects
from ..rigs.bone_map import bone_map_of

# Bones whose heads should be in sight, where the character has them.
SEEN = ("Head", "Chest2", "Hips", "LeftWrist", "RightWrist", "LeftAnkle", "RightAnkle")
_SIDES, _FIRST_SIDE = 16, -np.pi / 3
_ELEVATIONS = np.radians((20.0, 50.0))
_EVERY = 0.5  # seconds between the moments at which a film looks around
# What a view is worth: all of the body in sight, near the wished side or else half from the front, not from
# high above.
_SIGHT, _WISH, _FRONT, _HIGH = 3.0, 0.6, 0.3, 0.4
# What a change costs: by one step to the side or up, and by a cut; pictures of a sheet stand for themselves.
_STEP, _CUT, _OTHER_TILE = 0.25, 4.0, 0.3
_GOOD = 0.75  # share of the body in sight, over a take, that is good enough


@dataclass(frozen=True)
class Views:
    """Where to look from at each frame of a take.

    ``directions`` (N, 3) unit vectors from the character to the camera; ``nearness`` 1 for the usual
    distance, less for a camera that has come into the room with a wider lens; ``cutaway``: what stands before
    the character is cut away.
    """

    directions: Array
    nearness: float = 1.0
    cutaway: bool = False


def choose_views(
    take: KeyedTake,
    scene: bpy.types.Scene,
    places: Array,
    facing: Array,
    distance: float,
    wish: Sequence[float] | None = None,
    frames: Sequence[int] | None = None,
) -> Views:
    """Choose a view for each frame of a take; the scene's current frame changes.

    ``places`` (N, 3) world, what the camera looks at, and ``facing`` (N, 2) are of every frame; ``distance``
    in Blender units is that of the camera.  ``wish`` (3,) is the side to look from wherever nothing blocks
    it.  With ``frames`` (of a sheet) each of these is looked at by itself; without, as in a film, the camera
    goes round and cuts only where it must.
    """
    own = own_objects(take.armature, scene)
    film = frames is None
    if film:
        frames = np.unique(
            np.linspace(take.first, take.last, 2 + int(len(places) / take.fps / _EVERY)).round().astype(int)
        )
    rows = np.asarray(frames) - take.first
    azimuth, elevation = _grid(wish)
    candidates = _direction(azimuth[:, None], elevation[None])  # (A, E, 3)
    merit = _merit(candidates, elevation, facing[rows], wish)
    # First from outside; then from within a closed room; then through its wall.
    for nearness, cutaway in ((1.0, False), (0.55, False), (1.0, True)):
        sight = np.zeros((len(rows), *candidates.shape[:2]))
        for k, frame in enumerate(frames):
            scene.frame_set(int(frame))
            sight[k] = _sight(
                take, scene, places[rows[k]], candidates * distance * nearness, own, 0.8 if cutaway else 0.0
            )
        picks = _cheapest(-_SIGHT * sight - merit, film)
        if sight[(np.arange(len(rows)), *picks)].mean() >= _GOOD:
            break
    a, e = azimuth[picks[0]], elevation[picks[1]]
    if film:
        directions = _glide(a, e, rows, len(places), take.fps)
    else:
        nearest = np.abs(np.arange(len(places))[:, None] - rows).argmin(1)
        directions = _direction(a, e)[nearest]
    return Views(directions, nearness, cutaway)


def _grid(wish: Sequence[float] | None) -> tuple[Array, Array]:
    """Azimuths (A,) and elevations (E,), radians, of the views to choose from; a wished one is among them."""
    first, elevations = _FIRST_SIDE, _ELEVATIONS
    if wish is not None:
        x, y, z = np.asarray(wish, dtype=np.float64) / np.linalg.norm(wish)
        first, elevations = (
            np.arctan2(y, x),
            np.array((np.arcsin(z), max(np.arcsin(z) + np.radians(25), _ELEVATIONS[1]))),
        )
    return first + np.arange(_SIDES) * (2 * np.pi / _SIDES), elevations


def _direction(azimuth: Array, elevation: Array) -> Array:
    """Unit vectors (..., 3) of angles that broadcast, radians."""
    azimuth, elevation = np.broadcast_arrays(azimuth, elevation)
    return np.stack(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)), axis=-1
    )


def _merit(candidates: Array, elevation: Array, facing: Array, wish: Sequence[float] | None) -> Array:
    """What the views (A, E, 3) are worth (N, A, E) at each moment, sight apart; ``facing`` is (N, 2)."""
    high = _HIGH * (elevation > elevation[0])
    if wish is not None:
        near = _WISH * (candidates @ (np.asarray(wish) / np.linalg.norm(wish)))
        return np.broadcast_to(near - high, (len(facing), *near.shape))
    return -_FRONT * np.abs(np.einsum("aed,nd->nae", candidates[..., :2], facing) - 0.6) - high


def _sight(
    take: KeyedTake,
    scene: bpy.types.Scene,
    place: Array,
    offsets: Array,
    own: set[bpy.types.Object],
    cut: float,
) -> Array:
    """Share (A, E) of the body in sight of cameras at ``place`` + ``offsets`` (A, E, 3), in the scene as it
    is now.

    With ``cut`` only what is nearer to the body than the camera by this share of its distance is looked at.
    """
    depsgraph = bpy.context.evaluated_depsgraph_get()
    armature = take.armature.evaluated_get(depsgraph)
    seen = bone_map_of(take.armature)
    bones = [armature.pose.bones[seen.seen(name)] for name in SEEN if name in seen.joints]
    points = [armature.matrix_world @ bone.head for bone in bones]
    seen = np.zeros(offsets.shape[:2])
    for at in np.ndindex(*seen.shape):
        camera = Vector(place + offsets[at] * (1 - cut))
        seen[at] = sum(_is_clear(scene, depsgraph, camera, point, own) for point in points)
    return seen / max(len(points), 1)


def _is_clear(
    scene: bpy.types.Scene,
    depsgraph: bpy.types.Depsgraph,
    camera: Vector,
    point: Vector,
    own: set[bpy.types.Object],
) -> bool:
    """Whether a picture shows the character where ``camera`` looks towards a ``point`` of it."""
    way = point - camera
    distance = way.length
    way.normalize()
    for _ in range(6):  # what no picture shows stands in no picture's way
        hit, place, _, _, found, _ = scene.ray_cast(depsgraph, camera, way, distance=distance)
        if not hit or found.original in own:
            return True
        if not found.hide_render:
            return False
        camera = place + way * (1e-4 * distance)
        distance = (point - camera).length
    return True


def _cheapest(cost: Array, film: bool) -> tuple[Array, Array]:
    """Indices (N,), (N,) of the views of least total cost: ``cost`` (N, A, E) of each, and of changing from
    one to the next.
    """
    count, sides, heights = cost.shape
    index = np.arange(sides * heights)
    around = np.abs(index[:, None] // heights - index // heights)
    steps = np.minimum(around, sides - around) + np.abs(index[:, None] % heights - index % heights)
    change = np.where(steps <= 1, _STEP * steps, _CUT) if film else np.where(steps > 0, _OTHER_TILE, 0.0)
    total, came = cost[0].ravel(), []
    for k in range(1, count):
        by = total[:, None] + change  # from row to column
        came.append(by.argmin(0))
        total = by.min(0) + cost[k].ravel()
    picks = [int(total.argmin())]
    for step in reversed(came):
        picks.append(int(step[picks[-1]]))
    return np.divmod(np.array(picks[::-1]), heights)


def _glide(azimuth: Array, elevation: Array, rows: Array, count: int, fps: float) -> Array:
    """Directions (count, 3) that lead softly through views at ``rows``, but for cuts, which fall half-way
    between two.
    """
    step = 2 * np.pi / _SIDES
    turns = np.angle(np.exp(1j * np.diff(azimuth)))
    cuts = np.flatnonzero(
        (np.abs(turns) > 1.5 * step) | ((np.abs(turns) > 0.5 * step) & (np.diff(elevation) != 0))
    )
    starts, ends = [0, *(cuts + 1)], [*(cuts + 1), len(rows)]
    edges = [0, *((rows[cuts] + rows[cuts + 1] + 1) // 2), count]
    out = np.empty((count, 3))
    for first, last, low, high in zip(starts, ends, edges[:-1], edges[1:], strict=True):
        at = np.arange(low, high)
        ways = np.unwrap(azimuth[first:last]), elevation[first:last]
        angles = np.stack([np.interp(at, rows[first:last], way) for way in ways], axis=-1)
        out[low:high] = _direction(*soften(angles, _EVERY * fps).T)
    return out


def soften(path: Array, frames: float) -> Array:
    """Low-pass a path (N, D) by a bell of ``frames`` standard deviation, ends held."""
    width = round(frames)
    if width < 1:
        return path.copy()
    kernel = np.exp(-0.5 * (np.arange(-2 * width, 2 * width + 1) / width) ** 2)
    padded = np.concatenate((np.repeat(path[:1], 2 * width, 0), path, np.repeat(path[-1:], 2 * width, 0)))
    return np.stack(
        [np.convolve(padded[:, i], kernel / kernel.sum(), "valid") for i in range(path.shape[1])], axis=-1
    )
