"""The network that tells fields around a thing, as a torch module, with the latent codes of the scenes that
it learns (papers/002 section 4.2).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from .field_config import FieldConfig

CODE = 0.01  # deviation of latent codes before training (sigma of equation 8)


class FieldDecoder(nn.Module):
    """Parameters as ``FieldConfig.parameter_shapes`` has them; fields are told as shares of
    ``field_scale``, queries are divided by ``query_scale``.
    """

    def __init__(self, config: FieldConfig) -> None:
        super().__init__()
        self.config = config
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
        x, config = query / self.query_scale, self.config
        h = x.new_zeros(())
        for n in range(config.layers):
            y = self._of(f"layer.{n}.bias") + (F.linear(h, self._of(f"layer.{n}.weight")) if n else 0)
            if n in (0, config.again):
                y = y + F.linear(x, self._of(f"layer.{n}.query"))
                y = y + F.linear(code, self._of(f"layer.{n}.code"))[:, None]
            h = F.relu(y)
        return F.linear(h, self._of("out.weight"), self._of("out.bias"))

    def guessed(self, seen: Tensor) -> Tensor:
        """Codes (S, 128) of what is seen of scenes (S, 1028), see ``field_numpy.seen_of``."""
        h = F.relu(F.linear(seen, self._of("encoder.0.weight"), self._of("encoder.0.bias")))
        return F.linear(h, self._of("encoder.1.weight"), self._of("encoder.1.bias"))

    def _of(self, name: str) -> Tensor:
        return self.values[name.replace(".", "/")]


__all__ = ["CODE", "FieldDecoder"]
