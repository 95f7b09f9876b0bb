"""Phases without labels: a small Periodic Autoencoder over the velocities of the joints.

After DeepPhase (Starke et al., 2022), which papers/002 section 5 takes its phases from: a window of motion is
encoded into a few channels, each is replaced by the sinusoid whose frequency, amplitude and offset its
spectrum gives and whose shift a small layer reads, and the window is decoded from those sinusoids alone.
"""

from __future__ import annotations

import time

import numpy as np
import torch
from torch import nn

from nsm_core.body.clip import Clip, smoothed_root
from nsm_core.body.skeleton import J
from nsm_core.conventions import FPS, RUN, WALK
from nsm_core.data.annotation.proposal import Annotation
from nsm_core.errors import CaptureError
from nsm_core.rotations import Array, rotate_planar
from nsm_core.signals import gaussian_smooth

SPAN, STRIDE = 61, 2  # frames of a window, two seconds, of which every second is looked at
WINDOW = SPAN // STRIDE + 1
_EDGE = 20  # frames from whose speed the phase goes on towards a clip's ends
_HIDDEN, _RATE = 16, 3e-3


class PeriodicAutoencoder(nn.Module):
    """Windows (B, 3J, WINDOW) of joint velocities to windows alike, through ``channels`` sinusoids.

    ``forward`` returns the decoded windows, and phase (B, C) in cycles at the middle frame, frequency (B, C)
    in Hz and amplitude (B, C).
    """

    def __init__(self, channels: int = 1, inputs: int = 3 * J) -> None:
        super().__init__()
        pad = (WINDOW - 1) // 2
        # Joints are mixed first, then time is looked at: the same as one wide convolution, at a tenth of its
        # cost.
        self.encode = nn.Sequential(
            nn.Conv1d(inputs, _HIDDEN, 1),
            nn.Conv1d(_HIDDEN, _HIDDEN, WINDOW, padding=pad),
            nn.BatchNorm1d(_HIDDEN),
            nn.Tanh(),
            nn.Conv1d(_HIDDEN, channels, WINDOW, padding=pad),
        )
        self.shift = nn.ModuleList(nn.Linear(WINDOW, 2) for _ in range(channels))
        self.settle = nn.ModuleList(nn.BatchNorm1d(2) for _ in range(channels))
        self.decode = nn.Sequential(
            nn.Conv1d(channels, _HIDDEN, WINDOW, padding=pad), nn.BatchNorm1d(_HIDDEN), nn.Tanh(),
            nn.Conv1d(_HIDDEN, _HIDDEN, WINDOW, padding=pad), nn.Conv1d(_HIDDEN, inputs, 1),
        )  # fmt: skip
        self.register_buffer("times", torch.arange(WINDOW, dtype=torch.float32).sub(pad) * STRIDE / FPS)
        self.register_buffer("bands", torch.fft.rfftfreq(WINDOW, STRIDE / FPS)[1:])

    def forward(self, windows: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor, torch.Tensor]:
        latent = self.encode(windows)
        spectrum = torch.fft.rfft(latent, dim=-1)
        power = spectrum[..., 1:].abs().square()
        total = power.sum(-1).clamp_min(1e-9)
        frequency = (power * self.bands).sum(-1) / total
        amplitude = 2 * total.sqrt() / WINDOW
        offset = spectrum[..., 0].real / WINDOW
        turns = [
            settle(layer(latent[:, c]))
            for c, (layer, settle) in enumerate(zip(self.shift, self.settle, strict=True))
        ]
        phase = torch.stack([torch.atan2(t[:, 1], t[:, 0]) for t in turns], dim=1) / (2 * np.pi)
        angle = 2 * np.pi * (frequency[..., None] * self.times + phase[..., None])
        signal = amplitude[..., None] * torch.sin(angle) + offset[..., None]
        return self.decode(signal), phase, frequency, amplitude


def velocities(clip: Clip) -> Array:
    """Joint velocities (T, 3J), m/s, in the root frame, less the root's own: what the body does, not where it
    goes.
    """
    positions, _ = clip.world()
    return local_velocities(positions, *smoothed_root(positions))


def local_velocities(positions: Array, root: Array, heading: Array) -> Array:
    """As ``velocities``, of world joints (T, J, 3) whose roots are (T, 2) and (T,)."""
    local = positions.copy()
    local[..., :2] -= root[:, None]
    local = rotate_planar(local, -heading[:, None])
    return gaussian_smooth(np.gradient(local, axis=0) * FPS, 1.0).reshape(len(local), -1).astype(np.float32)


def train(
    motions: list[Array], minutes: float, seed: int = 0, channels: int = 1, most: int = 4000, batch: int = 128
) -> tuple[PeriodicAutoencoder, float]:
    """Fit an autoencoder to (T, 3J) velocities for at most ``minutes`` or ``most`` steps; returns it and its
    last loss.

    The loss is the mean squared error of windows divided by the deviation of all values; 1 is a mean.
    """
    long = [m for m in motions if len(m) >= SPAN]
    if not long:
        raise CaptureError(
            f"the autoencoder needs clips of at least {SPAN / FPS:.0f} seconds; the folder has none."
        )
    torch.manual_seed(seed)
    rng = np.random.default_rng(seed)
    windows = [torch.from_numpy(np.ascontiguousarray(m.T)) for m in long]
    starts = np.array([(k, s) for k, m in enumerate(long) for s in range(len(m) - SPAN + 1)])
    model = PeriodicAutoencoder(channels)
    optimizer = torch.optim.AdamW(model.parameters(), lr=_RATE, weight_decay=1e-4)
    begin, loss = time.monotonic(), float("nan")
    for step in range(most):
        used = max((time.monotonic() - begin) / 60 / minutes, step / most)
        if used >= 1:
            break
        for group in optimizer.param_groups:
            group["lr"] = _RATE * (0.02 + 0.98 * (1 - used))
        chosen = starts[rng.integers(len(starts), size=batch)]
        wanted = torch.stack([windows[k][:, s : s + SPAN : STRIDE] for k, s in chosen])
        error = (model(wanted)[0] - wanted).square().mean() / wanted.square().mean().clamp_min(1e-9)
        optimizer.zero_grad()
        error.backward()
        optimizer.step()
        loss = 0.98 * loss + 0.02 * float(error.detach()) if loss == loss else float(error.detach())
    return model.eval(), loss


@torch.no_grad()
def phases(model: PeriodicAutoencoder, motion: Array) -> tuple[Array, Array, Array]:
    """Phase (T, C) in cycles, frequency (T, C) in Hz and amplitude (T, C) of every frame.

    Windows lie inside the clip; nearer to its ends than half a window the phase goes on as fast as it last
    did.
    """
    half = SPAN // 2
    if len(motion) < SPAN:
        motion, inside = np.pad(motion, ((half, half), (0, 0)), mode="edge"), slice(0, len(motion))
    else:
        inside = slice(half, len(motion) - half)
    windows = torch.from_numpy(
        np.lib.stride_tricks.sliding_window_view(motion, SPAN, axis=0)[..., ::STRIDE].copy()
    )
    found = [model(part)[1:] for part in windows.split(512)]
    phase, frequency, amplitude = (
        torch.cat(part).numpy().astype(np.float64) for part in zip(*found, strict=True)
    )
    if inside.start == 0:
        return phase, frequency, amplitude
    steps = (np.diff(phase, axis=0) + 0.5) % 1.0 - 0.5
    near = [
        np.median(s[:_EDGE] if k == 0 else s[-_EDGE:], axis=0) if len(s) else frequency[0] / FPS
        for k, s in enumerate((steps, steps))
    ]
    away = np.arange(1, half + 1)[:, None]
    phase = np.concatenate((phase[:1] - away[::-1] * near[0], phase, phase[-1:] + away * near[1]))
    ends = ((half, half), (0, 0))
    return phase, np.pad(frequency, ends, mode="edge"), np.pad(amplitude, ends, mode="edge")


def unwrapped(phase: Array, frequency: Array, amplitude: Array, floor: float) -> Array:
    """One phase (T,) in cycles that only grows, from the strongest channel; at 1 Hz where nothing moves
    (amplitude < floor).
    """
    best = int(np.argmax(amplitude.mean(0)))
    steps = (np.diff(phase[:, best]) + 0.5) % 1.0 - 0.5
    expected = frequency[1:, best] / FPS
    moves = np.clip(amplitude[1:, best] / floor, 0, 1)
    # A step far from what the frequency says is a slip of the angle.
    steps = np.where(np.abs(steps - expected) > 0.15, expected, steps)
    steps = moves * np.clip(steps, 0.2 / FPS, 4.0 / FPS) + (1 - moves) / FPS
    return (phase[0, best] % 1.0 + np.concatenate(((0.0,), np.cumsum(steps)))).astype(np.float32)


def measure(
    clips: list[Clip], annotations: list[Annotation], minutes: float = 2.0, seed: int = 0, most: int = 4000
) -> list[dict[str, Array]]:
    """Train on clips and their mirror images; returns "phase" and "phase_mirrored" (T,) in cycles for every
    clip.

    The origin of the learnt phase, which is arbitrary, is put at the left landings of the annotations.
    """
    motions = [[velocities(c), velocities(c.mirrored())] for c in clips]
    model, loss = train([m for pair in motions for m in pair], minutes, seed, most=most)
    found = [[phases(model, m) for m in pair] for pair in motions]
    floor = 0.3 * float(np.median(np.concatenate([a.max(1) for pair in found for *_, a in pair])))
    result = [
        dict(zip(("phase", "phase_mirrored"), (unwrapped(p, f, a, floor) for p, f, a in pair), strict=True))
        for pair in found
    ]
    gaps = []
    for phase, annotation in zip(result, annotations, strict=True):
        moving = annotation.style[:, [WALK, RUN]].sum(1) > 0.9
        for name, rule in (("phase", annotation.phase), ("phase_mirrored", annotation.phase_mirrored)):
            gaps.append(np.exp(2j * np.pi * (phase[name] - rule))[moving])
    shift = float(np.angle(np.concatenate(gaps).sum())) / (2 * np.pi) if gaps else 0.0
    print(f"autoencoder: error {loss:.2f} of the velocities' variance")
    return [{name: (p - shift + 1.0).astype(np.float32) for name, p in phase.items()} for phase in result]


def compare(annotations: list[Annotation], measured: list[Array]) -> str:
    """One line: cycles a minute on walks and runs, correlation of speeds, and how far apart the two phases
    are.
    """
    rule_rate: dict[int, list[Array]] = {WALK: [], RUN: []}
    own_rate: dict[int, list[Array]] = {WALK: [], RUN: []}
    apart: list[Array] = []
    for annotation, phase in zip(annotations, measured, strict=True):
        rates = (
            [_smooth(np.gradient(p)) * FPS * 60 for p in (annotation.phase, phase)]
            if len(phase) > SPAN
            else []
        )
        for label in (WALK, RUN):
            on = annotation.style[:, label] > 0.9
            if rates and on.sum() > FPS:
                rule_rate[label].append(rates[0][on])
                own_rate[label].append(rates[1][on])
                if label == WALK:
                    apart.append(np.abs((phase - annotation.phase + 0.5) % 1.0 - 0.5)[on])
    parts = []
    for label, name in ((WALK, "walks"), (RUN, "runs")):
        if rule_rate[label]:
            rule, own = np.concatenate(rule_rate[label]), np.concatenate(own_rate[label])
            parts.append(f"{name} {own.mean():.1f} cycles a minute (rule {rule.mean():.1f})")
    rule_frames, own_frames = (
        np.concatenate([v for label in (WALK, RUN) for v in rates[label]] or [np.zeros(2)])
        for rates in (rule_rate, own_rate)
    )
    rule_clips, own_clips = (
        np.array([np.mean(v) for label in (WALK, RUN) for v in rates[label]])
        for rates in (rule_rate, own_rate)
    )
    if len(rule_clips) > 2:
        parts.append(
            f"correlation of phase speed {np.corrcoef(rule_frames, own_frames)[0, 1]:.2f} by frame, "
            f"{np.corrcoef(rule_clips, own_clips)[0, 1]:.2f} by clip"
        )
        apart_by = np.median(np.abs(rule_clips - own_clips))
        parts.append(f"clips differ by {apart_by:.1f} cycles a minute (median)")
    if apart:
        parts.append(
            f"on walks the phases are {np.concatenate(apart).mean():.3f} cycles apart on average (0.25 is "
            "chance)"
        )
    return "autoencoder against rule: " + ("; ".join(parts) or "no clip walks or runs")


def _smooth(values: Array, half: int = 7) -> Array:
    window = np.hanning(2 * half + 3)[1:-1]
    return np.convolve(np.pad(values, half, mode="edge"), window / window.sum(), mode="valid")
