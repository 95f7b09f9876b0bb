"""Checkpoints of trainings: written whole or not at all, read by plain types and tensors alone.

A checkpoint is a dictionary of torch's: by name the state of every part of a training (networks, optimiser,
codes that are learnt with them) and its numbers, such as "step".
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeAlias

import torch

from nsm_core.errors import WeightsError
from nsm_core.files import output

Part: TypeAlias = torch.nn.Module | torch.optim.Optimizer


def write_checkpoint(path: Path, parts: Mapping[str, Part], numbers: Mapping[str, float]) -> None:
    """Write the state of ``parts``, and ``numbers``, by name; OutputError where that fails."""
    state = {**{name: part.state_dict() for name, part in parts.items()}, **numbers}
    with output(path, "The checkpoint") as temporary:
        try:
            torch.save(state, temporary)
        except RuntimeError as error:  # how torch says that a disk is full
            raise OSError("the disk may be full") from error


def read_checkpoint(path: str | Path) -> dict[str, Any]:
    """What ``write_checkpoint`` wrote; WeightsError where a file is none, or holds no numbers."""
    if Path(path).exists() and not Path(path).is_file():  # a pipe would be waited for
        raise WeightsError(f"{path} is no file; choose a checkpoint of this project.")
    try:
        state = torch.load(path, weights_only=True, map_location="cpu")
        networks = [state[name] for name in ("net", "average") if name in state]
        sound = isinstance(state.get("step", 0), int) and state.get("step", 0) >= 0 and networks
        sound = sound and all(torch.isfinite(v).all() for network in networks for v in network.values())
    except FileNotFoundError as error:
        raise WeightsError(f"There is no checkpoint at {path}; check the path.") from error
    except Exception as error:  # torch raises a dozen kinds: of zip, of pickle, of sizes
        raise WeightsError(
            f"{path} is no checkpoint of this project, or damaged; take another one, or train anew."
        ) from error
    if not sound:
        raise WeightsError(f"{path} holds values that are not numbers; take an earlier one, or train anew.")
    return state


def restore(path: Path, parts: Mapping[str, Part], numbers: Iterable[str]) -> dict[str, Any]:
    """Give ``parts`` the state that a checkpoint holds of them; returns all that it holds, the ``numbers``
    at least.

    WeightsError where it is no checkpoint, or of other parts; what was read before stays read then.
    """
    state = read_checkpoint(path)
    try:
        for name, part in parts.items():
            part.load_state_dict(state[name])
        _ = [state[name] for name in numbers]
    except (LookupError, TypeError, ValueError, RuntimeError, AttributeError) as error:
        raise WeightsError(
            f"{path} is of another network or of other data, or damaged; choose another folder with --run, "
            "or delete it."
        ) from error
    return state


__all__ = ["Part", "read_checkpoint", "restore", "write_checkpoint"]
