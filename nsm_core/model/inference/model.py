"""Load a trained network to be stepped: in numpy, which Blender has, or by its torch module, equal but for
rounding.
"""

from __future__ import annotations

from pathlib import Path

from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import layout_description
from nsm_core.model.networks.protocol import Model, Weights

from .network_of import network_of
from .torch_model import TorchModel
from .weights_file import load_weights

__all__ = ["BACKENDS", "BUNDLED", "Model", "load_model", "model_of"]

BUNDLED = Path(__file__).parents[2] / "weights" / "nsm.npz"
BACKENDS = ("auto", "numpy", "torch")


def load_model(path: str | Path | None = None, backend: str = "auto") -> Model:
    """Load a weights file, the bundled one without ``path``, for stepping; it says itself which network it
    holds.

    ``backend`` is "numpy", "torch" or "auto".  One character a step is bound by reading the weights, where
    numpy needs a fifth less time than torch and does not fight over threads, so "auto" means numpy; torch
    pays off in batches.
    The file's feature layout must be the program's own.  Raises WeightsError on a bad file, or if "torch" is
    asked for and missing.
    """
    if backend not in BACKENDS:
        raise WeightsError(f"There is no back end {backend}; choose one of {', '.join(BACKENDS)}.")
    model = model_of(load_weights(path or BUNDLED, layout_description()), backend)
    needed = type(model.config)().widths
    if model.config.widths != needed:
        raise WeightsError(
            f"The weights file's network is of other widths than its features, {needed}; copy or train it "
            "again."
        )
    return model


def model_of(weights: Weights, backend: str = "auto") -> Model:
    """Model of loaded weights; back ends and errors as ``load_model``."""
    kind, config = network_of(weights)
    if backend == "torch":
        try:
            return TorchModel(kind, config, weights)
        except (ImportError, OSError) as error:  # OSError: a torch whose libraries do not load
            raise WeightsError(
                "PyTorch is not usable here; install it or choose the numpy back end."
            ) from error
    return kind.numpy(config, weights)
