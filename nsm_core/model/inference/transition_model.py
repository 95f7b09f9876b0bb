"""Load a trained transition network, to be stepped in numpy (papers/001)."""

from __future__ import annotations

from pathlib import Path

from nsm_core.errors import WeightsError

FILL = Path(__file__).parents[2] / "weights" / "fill.npz"


def load_transitions(path: str | Path | None = None) -> None:
    """Load a weights file, the bundled one without ``path``; WeightsError where it cannot be used."""
    raise WeightsError(
        f"There are no weights of transitions at {path or FILL}; train them, or fill by interpolation."
    )


__all__ = ["load_transitions"]
