"""What a take needs, loaded by a thread while the sidebar is looked at: no click waits for it."""

from __future__ import annotations

import atexit
import threading
from importlib import import_module

# Each brings what it stands on.
_MODULES = ("takes", "keys.preview", "keys.fewer", "goals.registry", "outlook")
_LAST = 5.0  # seconds that the end of the program waits for a module that is being loaded

_modules: threading.Thread | None = None
_network: threading.Thread | None = None
_ended = False


def begin(network: bool) -> None:
    """Have the modules of a take loaded and, where one seems near, the ``network``; what has been begun goes
    on.
    """
    global _modules, _network
    if _modules is None:
        _modules = threading.Thread(target=_load_modules, daemon=True)
        _modules.start()
    if network and _network is None:
        _network = threading.Thread(target=_load_network, daemon=True)
        _network.start()


def _load_modules() -> None:
    for name in _MODULES:
        if not _ended:
            import_module(f".{name}", __package__)


def _load_network() -> None:
    import_module(".network", __package__).load_network().join()


def _end() -> None:
    """Have the program end after the module that is being loaded, not in the middle of it."""
    global _ended
    _ended = True
    for thread in (_modules, _network):
        if thread is not None:
            thread.join(_LAST)


atexit.register(_end)
