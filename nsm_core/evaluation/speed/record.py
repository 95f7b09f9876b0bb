"""Figures of a benchmark as JSON: several programs add theirs to one file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from nsm_core.errors import OutputError
from nsm_core.files import output

# What is asked of the ratios and figures: the least (">=") or the most ("<=") that they may be.
TARGETS: dict[str, tuple[str, float]] = {
    "network_over_memory_floor": ("<=", 1.5),
    "real_time_over_frame": (">=", 8.0),
    "fill_of_60_frames_s": ("<=", 0.5),
    "sensing_ms": ("<=", 1.5),
    "character_frames_per_s_64": (">=", 10_000.0),
    "memory_beside_blender_mb": ("<=", 600.0),
    "command_line_10_s_take_s": ("<=", 8.0),
    "ten_seconds_after_click_s": ("<=", 6.0),
    "import_ms": ("<=", 50.0),
    "steepest_growth": ("<=", 1.1),  # linear, and what measuring is off by
    "longest_block_ms": ("<=", 50.0),
    "real_time_over_frame_in_blender": (">=", 8.0),
}


def add(path: str | Path | None, part: str, figures: dict[str, Any], ratios: dict[str, float]) -> None:
    """Put the ``figures`` of a ``part`` and its named ``ratios`` into the JSON file at ``path`` (None:
    nowhere), beside what others have put there, and say which ratio misses its target.  Raises OutputError.
    """
    for name, value in ratios.items():
        print(f"  {name:34s}{value:12.4g}{aim(name, value)}")
    if path is None:
        return
    path = Path(path)
    try:
        held = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    except (OSError, ValueError) as error:
        raise OutputError(f"{path} holds no figures of a benchmark; name another file.") from error
    held[part] = figures
    held["ratios"] = held.get("ratios", {}) | ratios
    held["targets"] = {
        name: {"aim": f"{sign} {value:g}", "met": met(name, held["ratios"][name])}
        for name, (sign, value) in TARGETS.items()
        if name in held["ratios"]
    }
    with output(path, "The figures") as temporary:
        temporary.write_text(json.dumps(held, indent=1) + "\n", encoding="utf-8")


def met(name: str, value: float) -> bool:
    """Whether a figure is as it is asked for; one of which nothing is asked is."""
    sign, aimed = TARGETS.get(name, ("<=", float("inf")))
    return value <= aimed if sign == "<=" else value >= aimed


def aim(name: str, value: float) -> str:
    """What is asked of a figure, in words; empty where nothing is."""
    if name not in TARGETS:
        return ""
    sign, aimed = TARGETS[name]
    return f"   aim {sign} {aimed:g}" + ("" if met(name, value) else ", missed")
