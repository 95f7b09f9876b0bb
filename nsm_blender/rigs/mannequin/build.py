"""Build the mannequin's mesh object and skin it to an armature."""

from __future__ import annotations

import bpy
import numpy as np

from nsm_core.body.skeleton import JOINTS

from .loft import LoftPart
from .loft_mesh import loft_mesh
from .parts import mannequin_parts

# Name, viewport and base colour (linear RGB), roughness; in the order of the parts' material numbers.
MATERIALS = (
    ("NSM Mannequin", (0.87, 0.70, 0.50), 0.45),
    ("NSM Joints", (0.055, 0.10, 0.14), 0.35),
    ("NSM Shoes", (0.42, 0.115, 0.075), 0.5),
)


def material(name: str, colour: tuple[float, float, float], roughness: float) -> bpy.types.Material:
    """Find or make a plain material that looks alike in Workbench, EEVEE and Cycles."""
    found = bpy.data.materials.get(name)
    if found is not None and found.library is None:
        return found
    made = bpy.data.materials.new(name)
    made.diffuse_color = (*colour, 1.0)
    made.roughness = roughness
    if made.node_tree is None:  # before 5.0 a material starts without nodes
        made.use_nodes = True
    shader = next(n for n in made.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    return made


def build_mannequin(armature: bpy.types.Object, name: str = "Mannequin") -> bpy.types.Object:
    """Add the mannequin as a child of ``armature``, skinned by weights that sum to one at every vertex."""
    parts = mannequin_parts()
    mesh = loft_mesh(name, parts, [material(*entry) for entry in MATERIALS], smooth=True)
    mesh.validate()
    mesh.update()
    body = bpy.data.objects.new(name, mesh)
    for collection in armature.users_collection:
        collection.objects.link(body)
    body.parent = armature
    _weigh(body, parts)
    modifier = body.modifiers.new("Armature", "ARMATURE")
    modifier.object = armature
    return body


def _weigh(body: bpy.types.Object, parts: list[LoftPart]) -> None:
    starts = np.cumsum([0] + [len(p.vertices) for p in parts])
    groups = {joint: body.vertex_groups.new(name=joint) for joint in JOINTS}
    for part, start in zip(parts, starts, strict=False):
        for joint, weights in part.weights.items():
            if np.all(weights == 1):
                groups[joint].add(range(int(start), int(start) + len(weights)), 1.0, "REPLACE")
                continue
            for i in np.flatnonzero(weights > 1e-6):
                groups[joint].add([int(start + i)], float(weights[i]), "REPLACE")
