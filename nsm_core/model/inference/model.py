"""Step a trained network: one protocol, a numpy back end for Blender and a torch one, equal but for rounding."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Protocol

from nsm_core.errors import WeightsError
from nsm_core.model.features.layout import layout_description
from nsm_core.model.networks.config import NsmConfig
from nsm_core.rotations import Array

from .numpy_nsm import NumpyModel
from .sizes import layer_widths
from .torch_any import TorchModel
from .weights_file import Weights, load_weights

BUNDLED = Path(__file__).parents[2] / "weights" / "nsm.npz"
BACKENDS = ("auto", "numpy", "torch")


class Model(Protocol):
    """A network that can be stepped; features go in and out in physical units."""

    backend: str
    config: NsmConfig
    metadata: dict[str, Any]

    def predict(self, x: Array, gating: Array) -> tuple[Array, Array]:
        """Predict outputs (B, outputs) and expert coefficients (B, K), float32, from un-normalised inputs.

        ``x`` is (B, inputs): frame, goal, environment, interaction; ``gating`` is (B, gating).
        Normalisation happens inside (papers/000 section 3).  Raises ValueError on other widths.
        """
        ...






def load_model(path: str | Path | None = None, backend: str = "auto") -> Model:
    """Load a weights file, the bundled one without ``path``, for stepping.

    ``backend`` is "numpy", "torch" or "auto".  One character a step is bound by reading the weights, where numpy needs
    a fifth less time than torch and does not fight over threads, so "auto" means numpy; torch pays off in batches.
    The file's feature layout must be the program's own.  Raises WeightsError on a bad file, or if "torch" is asked for and missing.
    """
    if backend not in BACKENDS:
        raise WeightsError(f"There is no back end {backend}; choose one of {', '.join(BACKENDS)}.")
    model = model_of(load_weights(path or BUNDLED, layout_description()), backend)
    c = model.config
    if (*c.parts, c.gating, c.outputs) != layer_widths():
        raise WeightsError(f"The weights file's network is of other widths than its features, {layer_widths()}; copy or train it again.")
    return model


def model_of(weights: Weights, backend: str = "auto") -> Model:
    """Model of loaded weights; back ends and errors as ``load_model``."""
    if backend == "torch":
        try:
            return TorchModel(weights)
        except (ImportError, OSError) as error:  # OSError: a torch whose libraries do not load
            raise WeightsError("PyTorch is not usable here; install it or choose the numpy back end.") from error
    return NumpyModel(weights)




















