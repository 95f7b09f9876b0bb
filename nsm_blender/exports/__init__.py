"""A take for other programs: as BVH and as GLB."""
