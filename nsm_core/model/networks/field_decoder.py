"""The network that tells fields around a thing, as a torch module, with the latent codes of the scenes that
it learns (papers/002 section 4.2).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .field_config import BLOCK, BLOCKS, FieldConfig

CODE = 0.01  # deviation of latent codes before training (sigma of equation 8)


class FieldDecoder(nn.Module):
    """Parameters as ``FieldConfig.parameter_shapes`` has them; fields are told as shares of
    ``field_scale``, queries are divided by ``query_scale``.
    ``half``: fields are learnt with products in half precision.
    """

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        self.config, self.half = config, False
        self.values = nn.ParameterDict()
        for name, shape in config.parameter_shapes().items():
            values = torch.zeros(shape)
            if len(shape) == 2:
                nn.init.kaiming_normal_(values, nonlinearity="relu")
            self.values[name.replace(".", "/")] = nn.Parameter(values)
        for name in ("field_scale", "query_scale"):
            self.register_buffer(name, torch.ones(config.shapes()[name]))

    def forward(self, query: Tensor, code: Tensor) -> Tensor:
        """Fields (S, P, 3), shares, of queries (S, P, 7), in physical units, and codes (S, 128)."""
        kind = torch.bfloat16 if self.half and self.training else query.dtype
        x, code, config = (query / self.query_scale).to(kind), code.to(kind), self.config
        h = x[..., :0]
        for n in range(config.layers):
            bias = self._of(f"layer.{n}.bias", kind)
            y = F.linear(h, self._of(f"layer.{n}.weight", kind), bias) if n else bias
            if n in (0, config.again):
                own = F.linear(code, self._of(f"layer.{n}.code", kind))[:, None]
                y = y + own + F.linear(x, self._of(f"layer.{n}.query", kind))
            h = F.relu(y, inplace=True)
        return F.linear(h, self._of("out.weight", kind), self._of("out.bias", kind)).to(query.dtype)

    def guessed(self, seen: Tensor) -> Tensor:
        """Codes (S, 128) of what is seen of scenes (S, 8205), see ``field_numpy.seen_of``."""
        cells = BLOCKS * 2 * BLOCK**3
        blocks = seen[:, :cells].reshape(len(seen), BLOCKS, -1)
        h = F.relu(F.linear(blocks, self._of("block.weight"), self._of("block.bias")))
        h = torch.cat((h.flatten(1), seen[:, cells:]), 1)
        for n in range(3):
            h = F.linear(h, self._of(f"encoder.{n}.weight"), self._of(f"encoder.{n}.bias"))
            h = F.relu(h) if n < 2 else h
        return h

    def _of(self, name: str, kind: torch.dtype = torch.float32) -> Tensor:
        return self.values[name.replace(".", "/")].to(kind)


__all__ = ["CODE", "FieldDecoder"]
