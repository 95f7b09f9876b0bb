"""Sizes of the network that tells fields around a thing (papers/002 sections 4.2 and 8.1)."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, ClassVar

from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import Layout

from .sizes import whole_sizes

# c: height of the thing over the floor, metres, the hand (0 right, 1 left), whether it places (else picks),
# whether it leaves (else approaches).
CONDITION = Layout(height=(1,), left=(1,), places=(1,), leaves=(1,))
FIELDS = Layout(target=(1,), obstacles=(1,), arrival=(1,))
# What is asked of a way, seen from the thing as PLACE: where the wrist ends, the way (unit) that the hand
# then points, and where it comes from.
TASK = Layout(end=(3,), towards=(3,), begin=(3,))
# Cells along each side of what the encoder sees of the known fields, and of the blocks that it takes them in.
COARSE, BLOCK = 16, 4
BLOCKS = (COARSE // BLOCK) ** 3
PLACE = Layout(place=(3,))  # x, from the thing, in a frame that is turned as what it stands in


@dataclass(frozen=True)
class FieldConfig:
    """``layers`` of ``width`` units, the query put in again before layer ``again``; ``latent`` numbers z of a
    scene.  ``encoder`` units of each of two layers that guess z from what is known, the fields among it in
    blocks of which each becomes ``block`` numbers by the same weights (beyond the paper, so that z is found
    sooner).
    """

    network: ClassVar[str] = "hand_fields"

    width: int = 256
    layers: int = 6
    again: int = 3
    latent: int = 128
    encoder: int = 256
    block: int = 24

    @property
    def query(self) -> int:
        """Numbers of a query: condition and place."""
        return CONDITION.size + PLACE.size

    def parameter_shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters: of each layer what it makes of the layer before, ``weight``, of
        the latent code, ``code``, and of the query, ``query``, where it is given them.
        """
        shapes: dict[str, tuple[int, ...]] = {}
        for n in range(self.layers):
            if n:
                shapes[f"layer.{n}.weight"] = (self.width, self.width)
            if n in (0, self.again):
                shapes[f"layer.{n}.code"] = (self.width, self.latent)
                shapes[f"layer.{n}.query"] = (self.width, self.query)
            shapes[f"layer.{n}.bias"] = (self.width,)
        wide = (BLOCKS * self.block + CONDITION.size + TASK.size, self.encoder, self.encoder, self.latent)
        shapes["block.weight"], shapes["block.bias"] = (self.block, 2 * BLOCK**3), (self.block,)
        for n in range(len(wide) - 1):
            shapes[f"encoder.{n}.weight"], shapes[f"encoder.{n}.bias"] = (
                (wide[n + 1], wide[n]),
                (wide[n + 1],),
            )
        return shapes | {"out.weight": (FIELDS.size, self.width), "out.bias": (FIELDS.size,)}

    def shapes(self) -> dict[str, tuple[int, ...]]:
        """Names and shapes of all parameters and statistics."""
        return self.parameter_shapes() | {"field_scale": (FIELDS.size,), "query_scale": (self.query,)}

    def to_dict(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> FieldConfig:
        """Read back what ``to_dict`` wrote; WeightsError on values that no network has."""
        known = whole_sizes(cls, values)
        if not known["again"] < known["layers"]:
            raise WeightsError("The weights file puts its query in after the last layer; train it again.")
        return cls(**known)


def field_layout() -> dict[str, dict[str, list[int]]]:
    """Names and shapes of all blocks, for the metadata of weights."""
    vectors = {"condition": CONDITION, "place": PLACE, "task": TASK, "fields": FIELDS}
    return {name: {n: list(s) for n, s in v.shapes.items()} for name, v in vectors.items()}


__all__ = ["BLOCK", "BLOCKS", "COARSE", "CONDITION", "FIELDS", "PLACE", "TASK", "FieldConfig", "field_layout"]
