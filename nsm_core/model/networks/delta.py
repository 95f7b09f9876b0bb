"""The delta transformer as a torch module."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.transitions.layout import PAST, POSE, TARGET_FRAMES

from .delta_config import DeltaConfig
from .gap_config import LONGEST


class DeltaLayer(nn.Module):
    """Attention over all frames of a gap and a feed-forward part, each added to what comes in."""

    def __init__(self, config: DeltaConfig) -> None:
        super().__init__()
        w, self.heads = config.width, config.heads
        self.before, self.after = nn.LayerNorm(w), nn.LayerNorm(w)
        self.ask, self.answer = nn.Linear(w, 3 * w), nn.Linear(w, w)
        self.widen, self.narrow = nn.Linear(w, config.feed * w), nn.Linear(config.feed * w, w)
        # Heads begin by looking near, each half as far as the one before it.
        slopes = 2.0 ** -torch.arange(self.heads, dtype=torch.float32)
        self.near = nn.Parameter(-slopes[:, None] * torch.arange(-LONGEST, LONGEST + 1).abs())

    def forward(self, x: Tensor, apart: Tensor) -> Tensor:
        """Of frames (B, T, width), ``apart`` (T, T) from one to the other as ``near`` counts them."""
        count, frames, width = x.shape
        asked = self.ask(self.before(x)).view(count, frames, 3, self.heads, -1).permute(2, 0, 3, 1, 4)
        queries, keys, values = asked.unbind(0)
        score = queries @ keys.transpose(-1, -2) / math.sqrt(width // self.heads) + self.near[:, apart]
        found = (score.softmax(-1) @ values).transpose(1, 2).reshape(count, frames, width)
        x = x + self.answer(found)
        out: Tensor = x + self.narrow(F.relu(self.widen(self.after(x))))
        return out


class DeltaNetwork(nn.Module):
    """Tells all missing frames of gaps at once; all vectors are standardised."""

    def __init__(self, config: DeltaConfig) -> None:
        super().__init__()
        self.config = config
        self.half = False  # whether training multiplies in half precision
        self.read = nn.Linear(config.seen, config.width)
        self.layers = nn.ModuleList(DeltaLayer(config) for _ in range(config.layers))
        self.last = nn.LayerNorm(config.width)
        self.tell = nn.Linear(config.width, POSE.size)
        with torch.no_grad():  # untrained it interpolates
            self.tell.weight.zero_()
            self.tell.bias.zero_()
        for name, shape in config.shapes().items():
            if name.endswith(("_mean", "_std")):
                self.register_buffer(name, torch.full(shape, float(name.endswith("_std"))))

    def forward(self, tokens: Tensor, extra: Tensor) -> Tensor:
        """What is added to missing frames and target (B, frames + 1, 69), in units of their reach, of
        ``tokens`` (B, T, seen) and what is added to them when they are read (T, width) or (B, T, width).
        """
        place = torch.arange(tokens.shape[1])
        apart = (place[None] - place[:, None]).clamp(-LONGEST, LONGEST) + LONGEST
        with torch.autocast("cpu", torch.bfloat16, enabled=self.half and self.training):
            x = self.read(tokens) + extra
            for layer in self.layers:
                x = layer(x, apart)
        # Places come of what is told: half precision would round them.
        out: Tensor = self.tell(self.last(x[:, PAST : -TARGET_FRAMES + 1].float()))
        return out


__all__ = ["DeltaNetwork"]
