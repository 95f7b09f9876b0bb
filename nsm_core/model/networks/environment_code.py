"""What stands around a thing in 16 numbers: an autoencoder of three convolutions with pooling and three with
upscaling (papers/002 section 6.1), by which goals are matched.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

CODE = 16
_WIDTHS, _POOLS = (8, 16, 2), (4, 2, 2)  # of 32 cells a side 2 are left, with 2 numbers each


class EnvironmentCode(nn.Module):
    """Fields (S, N, N, N) to codes (S, 16), and back; N is 32."""

    def __init__(self) -> None:
        super().__init__()
        sizes = list(zip((1, *_WIDTHS[:-1]), _WIDTHS, strict=True))
        self.down = nn.ModuleList(nn.Conv3d(i, o, 3, padding=1) for i, o in sizes)
        self.up = nn.ModuleList(nn.ConvTranspose3d(o, i, 3, padding=1) for i, o in reversed(sizes))

    def encode(self, fields: Tensor) -> Tensor:
        """Codes (S, 16) of fields (S, N, N, N)."""
        h = fields[:, None]
        for k, (layer, pool) in enumerate(zip(self.down, _POOLS, strict=True)):
            h = nn.functional.max_pool3d(layer(h), pool)
            h = nn.functional.relu(h) if k < len(self.down) - 1 else h
        return h.flatten(1)

    def forward(self, fields: Tensor) -> Tensor:
        """What is told again (S, N, N, N) from codes of fields (S, N, N, N)."""
        h = self.encode(fields).reshape(len(fields), _WIDTHS[-1], 2, 2, 2)
        for k, (layer, pool) in enumerate(zip(self.up, reversed(_POOLS), strict=True)):
            h = layer(nn.functional.interpolate(h, scale_factor=pool, mode="trilinear"))
            h = nn.functional.relu(h) if k < len(self.up) - 1 else h
        return torch.as_tensor(h[:, 0])


__all__ = ["CODE", "EnvironmentCode"]
