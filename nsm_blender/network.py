"""The bundled network, loaded once a session."""

from __future__ import annotations

import threading
from contextlib import suppress
from functools import lru_cache

from nsm_core.errors import NsmError
from nsm_core.model.inference.model import Model, load_model


@lru_cache(maxsize=2)
def shipped_model(path: str | None = None) -> Model:
    """Load the bundled network, once per session; WeightsError says what to do when it is missing."""
    return load_model(path)


_loading: threading.Thread | None = None


def load_network() -> threading.Thread:
    """Have the bundled network loaded: the thread that does it.  What goes wrong is told where the network is
    needed.
    """
    global _loading

    def load() -> None:
        with suppress(NsmError):
            shipped_model()

    if _loading is None or not _loading.is_alive():
        _loading = threading.Thread(target=load, daemon=True)
        _loading.start()
    return _loading
