"""The planner's network at run time: the latent code of a scene is looked for until the fields that are known
of it are told right; what it then tells of arrival is the way of a hand (papers/002 section 4.2).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nsm_core.model.networks.field_config import CONDITION, FieldConfig, field_layout
from nsm_core.model.networks.field_numpy import NumpyFields, cells_of, seen_of
from nsm_core.model.networks.protocol import Weights
from nsm_core.rotations import Array

from .network_of import load_network

PRIOR = 1e-4  # weight of the squared code beside mean errors, for 1 / sigma^2 of equation 9
RATES = 0.02, 0.004  # of the descent (Adam) at its beginning: from chance, and from a guess, which is near
ENOUGH = 0.002  # of its mean error by which it must become better in LOOKED steps to go on
LOOKED = 5
STEPS = 15  # of the descent, at most


@dataclass(frozen=True)
class KnownFields:
    """What is known of a scene before a hand's way is: ``points`` (N, N, N, 3) metres from the thing, in a
    frame that is turned as what it stands in; ``target`` and ``obstacles`` (N, N, N) there (equations 3, 4);
    and the arrival (M,) at ``prior`` (M, 3): none in solids, and what a way like this one has near the thing.
    """

    points: Array
    target: Array
    obstacles: Array
    prior: Array
    arrival: Array


@dataclass(frozen=True)
class FoundCode:
    """``code`` (128,) and the mean ``errors`` of all steps that led to it."""

    code: Array
    errors: tuple[float, ...]


class FieldModel:
    """A network and what its numbers mean; ``metadata`` is that of the weights file."""

    def __init__(self, config: FieldConfig, weights: Weights) -> None:
        self.config, self.metadata = config, weights.metadata
        self._net, self._statistics = NumpyFields(config, weights), weights.statistics
        without = (weights.metadata or {}).get("settings", {}).get("without", "")
        self._told = np.array([name != without for name in ("target", "obstacles")], np.float32)

    def find_code(
        self,
        known: KnownFields,
        condition: Array,
        task: Array,
        steps: int = STEPS,
        points: int = 1024,
        guess: bool = True,
        seed: int = 0,
    ) -> FoundCode:
        """Look for the code of a scene (equation 9) in at most so many ``steps``, each of so many ``points``
        by chance; ``guess`` begins where the encoder says, else at chance.

        ``condition`` (4,) as ``field_config.CONDITION`` and ``task`` (9,) as ``TASK``.
        """
        rng, net, scale = np.random.default_rng(seed), self._net, self._statistics["field_scale"]
        if guess:
            cells = cells_of(self._told[0] * known.target, self._told[1] * known.obstacles, scale)
            code = net.guessed(seen_of(cells, condition, task, self._statistics["query_scale"]))
        else:
            code = rng.normal(0, 0.01, self.config.latent).astype(np.float32)
        places = known.points.reshape(-1, 3)
        wanted = np.stack((known.target.ravel(), known.obstacles.ravel()), 1) / scale[:2]
        arrival = known.arrival / scale[2]
        mean, square, errors = np.zeros_like(code), np.zeros_like(code), []
        best, least = code, np.inf
        for step in range(steps):
            some = rng.integers(len(places), size=points)
            priors = rng.integers(len(known.prior), size=min(points // 2, len(known.prior)))
            query = queries(np.concatenate((places[some], known.prior[priors])), condition)
            told, passed = net.told(query, code)
            off = (told[:points, :2] - wanted[some]) * self._told
            late = told[points:, 2] - arrival[priors]
            error = float(np.abs(off).sum(1).mean() + (late**2).mean())
            errors.append(error)
            if error < least:
                best, least = code, error
            if step >= 2 * LOOKED:
                before, now = np.mean(errors[-2 * LOOKED : -LOOKED]), np.mean(errors[-LOOKED:])
                if before - now < ENOUGH * before:
                    break
            ahead = np.zeros_like(told)
            ahead[:points, :2] = np.sign(off) / points
            ahead[points:, 2] = 2 * late / len(late)
            slope = net.by_code(query, code, ahead, passed) + 2 * PRIOR * code
            mean, square = 0.9 * mean + 0.1 * slope, 0.99 * square + 0.01 * slope**2
            rate = RATES[guess] * 0.5 * (1 + np.cos(np.pi * step / steps))
            unbiased = mean / (1 - 0.9 ** (step + 1)), square / (1 - 0.99 ** (step + 1))
            code = (code - rate * unbiased[0] / (np.sqrt(unbiased[1]) + 1e-8)).astype(np.float32)
        return FoundCode(best, tuple(errors))

    def arrival(self, places: Array, condition: Array, code: Array) -> tuple[Array, Array]:
        """Arrival field (P,), one over seconds, at places (P, 3) from the thing, and its slope (P, 3)."""
        told, slope = self._net.by_place(queries(places, condition), code)
        scale = float(self._statistics["field_scale"][2])
        return told[:, 2] * scale, slope * scale

    def fields(self, places: Array, condition: Array, code: Array) -> Array:
        """All three fields (P, 3) at places (P, 3) from the thing."""
        return self._net.values(queries(places, condition), code) * self._statistics["field_scale"]


def queries(places: Array, condition: Array) -> Array:
    """Queries (P, 7), float32, of places (P, 3) under a condition (4,)."""
    given = np.broadcast_to(np.asarray(condition, dtype=np.float32), (len(places), CONDITION.size))
    return np.concatenate((given, places.astype(np.float32)), axis=1)


def load_fields(path: str | Path) -> FieldModel:
    """Load a weights file; WeightsError where it cannot be used."""
    return FieldModel(*load_network(path, field_layout(), FieldConfig, "that of a hand's ways"))


__all__ = ["FieldModel", "FoundCode", "KnownFields", "load_fields", "queries"]
