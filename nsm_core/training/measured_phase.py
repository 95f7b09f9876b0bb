"""Composed takes with a phase that was measured of their motion instead of told by landings and labels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nsm_core.data.storage import Dataset

from .periodic_phase import local_velocities, phases, train, unwrapped


def with_measured_phase(data: Dataset, minutes: float = 2.0, seed: int = 0, most: int = 4000) -> Dataset:
    """The data with the phase of a Periodic Autoencoder that is trained on them for at most ``minutes`` or
    ``most`` steps.
    """
    a = data.arrays
    starts = np.unique(a["start"])
    takes = [slice(int(s), int(a["end"][s])) for s in starts]
    motions = [
        local_velocities(a["joint_position"][take], a["root"][take, :2], a["root"][take, 2]) for take in takes
    ]
    model, loss = train(motions, minutes, seed, most=most)
    found = [phases(model, motion) for motion in motions]
    floor = 0.3 * float(np.median(np.concatenate([amplitude.max(1) for *_, amplitude in found])))
    phase = np.zeros(len(a["phase"]), np.float32)
    for take, (p, frequency, amplitude) in zip(takes, found, strict=True):
        phase[take] = unwrapped(p, frequency, amplitude, floor)
    print(f"autoencoder: error {loss:.2f} of the velocities' variance", flush=True)
    return replace(data, arrays={**a, "phase": phase})
