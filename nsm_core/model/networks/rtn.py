"""Transition networks as torch modules: the Recurrent Transition Network and what is made of its parts
(papers/001 section 4).
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from nsm_core.model.transitions.layout import OFFSET, POSE, TARGET

from .deferred import DeferredLinear
from .rtn_config import TransitionConfig

SLOPE = 0.01  # of the leaky rectifier below zero
State = tuple[Tensor, Tensor]  # output and cell of the recurrent layer, (B, hidden) each


class TransitionNetwork(nn.Module):
    """All vectors are standardised; ``step`` is one frame, what it is made of may be called by itself for
    many frames at once.
    """

    def __init__(self, config: TransitionConfig) -> None:
        super().__init__()
        self.config = config
        c, h = config, config.hidden
        self.encode = _layers((c.seen, c.encoder, c.encoder)) if c.encoder else None
        self.target = _layers((TARGET.size, c.future, c.future)) if c.future else None
        self.offset = _layers((OFFSET.size, c.future, c.future)) if c.future else None
        self.feed = DeferredLinear(c.encoder or c.seen, 4 * h)
        self.recur = DeferredLinear(h, 4 * h, bias=False)
        self.condition = DeferredLinear(c.context, 4 * h, bias=False) if c.future else None
        between = (c.decoder, c.decoder_second) if c.decoder else ()
        self.decode = _layers((h, *between, POSE.size))
        self.initial = _layers((POSE.size, h, 2 * h)) if c.initial == "first_frame" else None
        if c.initial == "common":
            self.common = nn.Parameter(torch.zeros(2 * h))
        rectified = nn.init.calculate_gain("leaky_relu", SLOPE)
        for layers in (self.encode, self.target, self.offset, self.initial, self.decode[:-1]):
            # By torch's own beginning two layers let through a sixth of what differs: all behind them learns
            # slowly.
            for layer in layers or ():
                nn.init.orthogonal_(layer.weight, rectified)
                nn.init.zeros_(layer.bias)
        with torch.no_grad():
            nn.init.orthogonal_(self.recur.weight)
            self.feed.bias[h : 2 * h] = 1.0  # remembering is what is learnt first
            self.decode[-1].weight *= 0.1  # of a residual network: stay as you are
        for name, shape in config.shapes().items():
            if name.endswith(("_mean", "_std")):
                self.register_buffer(name, torch.full(shape, float(name.endswith("_std"))))

    def begin(self, first: Tensor) -> State:
        """What the recurrent layer begins a sequence with, of its first poses (B, 69) (equation 14)."""
        if self.initial is not None:
            state = self.initial[1](F.leaky_relu(self.initial[0](first), SLOPE))
        elif self.config.initial == "common":
            state = self.common.expand(len(first), -1)
        else:
            state = first.new_zeros((len(first), 2 * self.config.hidden))
        output, cell = state.chunk(2, dim=-1)
        return output, cell

    def encoded(self, pose: Tensor, patch: Tensor | None) -> Tensor:
        """Frames as the recurrent layer takes them, of poses (..., 69), patches (..., 169) (equation 2)."""
        x = torch.cat((pose, patch), dim=-1) if patch is not None else pose
        return x if self.encode is None else _through(self.encode, x)

    def encoded_target(self, target: Tensor) -> Tensor | None:
        """Of targets (B, 138) (equation 3); None without future context."""
        return None if self.target is None else _through(self.target, target)

    def encoded_future(self, target: Tensor | None, offset: Tensor, extra: Tensor | None) -> Tensor | None:
        """Future contexts f_t (..., 256) of encoded targets (..., 128), offsets (..., 69) (equation 4) and
        what is added to both: arrival and noise.
        """
        if self.offset is None or target is None:
            return None
        context = torch.cat((target, _through(self.offset, offset)), dim=-1)
        return context if extra is None else context + extra

    def gates(self, frame: Tensor, context: Tensor | None) -> Tensor:
        """What frames and future give the gates, W h^E + C f + b, (..., 2048)."""
        out = self.feed(frame)
        return out if self.condition is None or context is None else out + self.condition(context)

    def remembered(self, gates: Tensor, state: State) -> State:
        """The recurrent layer (equations 5 to 11)."""
        output, cell = state
        come, stay, new, tell = (gates + self.recur(output)).chunk(4, dim=-1)
        cell = torch.sigmoid(stay) * cell + torch.sigmoid(come) * torch.tanh(new)
        return torch.sigmoid(tell) * torch.tanh(cell), cell

    def told(self, output: Tensor, pose: Tensor) -> Tensor:
        """The next poses (B, 69) (equations 12, 13), of the last ones, or of the next on the way home."""
        for layer in self.decode[:-1]:
            output = F.leaky_relu(layer(output), SLOPE)
        out: Tensor = self.decode[-1](output)
        return pose + out if self.config.residual else out


def _layers(widths: tuple[int, ...]) -> nn.ModuleList:
    return nn.ModuleList(DeferredLinear(a, b) for a, b in zip(widths[:-1], widths[1:], strict=True))


def _through(layers: nn.ModuleList, x: Tensor) -> Tensor:
    for layer in layers:
        x = F.leaky_relu(layer(x), SLOPE)
    return x


__all__ = ["SLOPE", "State", "TransitionNetwork"]
