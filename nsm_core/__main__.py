"""Command line of the core: python -m nsm_core COMMAND [arguments]; without a command it lists them."""

from __future__ import annotations

import importlib
import sys

from .errors import NsmError

# Imported only when asked for: bench must run where training's packages are missing.
COMMANDS = {
    "train": ("nsm_core.commands.train", "train the network from a capture folder"),
    "transitions": ("nsm_core.commands.transitions", "train the network that fills gaps"),
    "evaluate": ("nsm_core.commands.evaluate", "print the tables of figures and write them as JSON"),
    "rivals": ("nsm_core.commands.rivals", "train and judge the networks of the field and the ablations"),
    "rooms": ("nsm_core.commands.rooms", "try generated rooms by seed and draw the worst"),
    "kitchens": ("nsm_core.commands.kitchens", "look for grasps in generated kitchens and draw them"),
    "planner": ("nsm_core.commands.planner", "train the network that plans ways of hands"),
    "controller": ("nsm_core.commands.controller", "train the controller of picking and placing"),
    "containers": ("nsm_core.commands.containers", "propose what opens of furniture meshes"),
    "crowd": ("nsm_core.commands.crowd", "try scenes of several characters and print who got there"),
    "bench": ("nsm_core.commands.bench", "measure the speed of the network"),
    "annotate": ("nsm_core.commands.annotate", "propose labels, contacts, phases and goals of captures"),
    "pool": ("nsm_core.commands.pool", "convert a folder of furniture meshes to the object pool"),
    "augment": ("nsm_core.commands.augment", "put captured sit-downs on other seats"),
    "pack": ("nsm_core.commands.pack", "pack a training for another machine, and join its weights"),
    "decompress": ("nsm_core.commands.decompress", "keep a pose a second of a capture and make it whole"),
    "compose": ("nsm_core.commands.compose", "stitch performances for training from captures"),
}


def main(arguments: list[str]) -> int:
    """Run one command; returns the exit code.  Errors of the user's making come out as one sentence."""
    if not arguments or arguments[0] not in COMMANDS:
        print("usage: python -m nsm_core COMMAND [arguments]\n")
        for name, (_, purpose) in COMMANDS.items():
            print(f"  {name:10s}{purpose}")
        return 0 if arguments[:1] in (["-h"], ["--help"]) else 2
    name, rest = arguments[0], arguments[1:]
    try:
        return importlib.import_module(COMMANDS[name][0]).main(rest) or 0
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "nsm_core":
            raise
        print(
            f"{name} needs the package {error.name}; run it as `python3 dev.py {name}`, which installs it.",
            file=sys.stderr,
        )
    except NsmError as error:
        print(f"{name}: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print(f"{name}: stopped.", file=sys.stderr)
        return 130
    return 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
