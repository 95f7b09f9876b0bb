"""Tables 2 to 4 and Figure 5 of papers/001 on our captures, with the paper's values beside them, and what is
asked beyond: error by length.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from nsm_core.data.transitions.gaps import Gaps, GapSource, statistics_of
from nsm_core.data.transitions.windows import Windows
from nsm_core.model.inference.weights_file import load_weights
from nsm_core.model.networks.gap_kinds import transition_config
from nsm_core.model.networks.gap_torch import GapNetwork, filled, gap_network
from nsm_core.model.networks.rtn_rows import ROWS, SHIPPED, TABLES
from nsm_core.model.transitions.layout import PAST, TARGET_FRAMES, layout_description
from nsm_core.rotations import Array, rotate_planar

from .measures import Errors, errors, interpolation

MOST = 400  # gaps that an error is the mean of
LENGTHS = (5, 10, 20, 30, 45, 60, 90)
INT = (0.210, 6.726)  # of the paper
SHOWN = (1, 5, 10, 15, 20, 25, 30)  # frames of Figure 5


def read(path: Path) -> GapNetwork:
    """The network of a weights file, to be stepped over many gaps at once."""
    weights = load_weights(path, layout_description(), transition_config)
    net = gap_network(transition_config(weights.network).from_dict(weights.config))
    arrays = {**weights.parameters, **weights.statistics}
    net.load_state_dict({name: torch.from_numpy(values) for name, values in arrays.items()})
    return net.eval()


class Judge:
    """Gaps of actors held out, standardised alike for all networks."""

    def __init__(self, windows: Windows) -> None:
        self.windows = windows
        self.sources = {faced: GapSource(windows, True, faced) for faced in (False, True)}
        drawn = statistics_of(GapSource(windows, False, False), [30] * 4, np.random.default_rng(0))
        self.mean, self.deviation = drawn["pose_mean"], drawn["pose_std"]

    def gaps(self, frames: int, among: Array | None = None) -> Gaps:
        """Gaps in windows spread over all, or over those ``among`` which they are to be, seen alike."""
        return self.sources[False].fixed(frames, MOST, among)

    def seen(self, net: GapNetwork, frames: int, among: Array | None = None) -> Gaps:
        """The same gaps as ``net`` sees them."""
        return self.sources[net.config.faced].fixed(frames, MOST, among)

    def told(self, net: GapNetwork, seen: Gaps, gaps: Gaps) -> Array:
        """World joints (B, frames + 1, 23, 3) that a network tells of what it has ``seen``, as ``gaps`` are
        turned.
        """
        with torch.no_grad():
            joints = filled(net, seen).joints.numpy()
        joints = joints.reshape(*joints.shape[:2], -1, 3)
        return rotate_planar(joints, (gaps.angle - seen.angle)[:, None, None])

    def judged(self, net: GapNetwork | None, frames: int) -> Errors:
        """Of a network, or of interpolation without one."""
        gaps = self.gaps(frames)
        joints = (
            interpolation(self.windows, gaps) if net is None else self.told(net, self.seen(net, frames), gaps)
        )
        return errors(gaps, joints, self.mean, self.deviation)


def measured(windows: Windows, folder: Path, shipped: Path) -> dict[str, Any]:
    """Errors of interpolation, of every row of ROWS that ``folder`` holds weights of (NAME-SEED/fill.npz),
    mean over seeds, the weights ``shipped`` for its row; and by length of the first of those that were
    trained on many.
    """
    judge = Judge(windows)
    rows: dict[str, Any] = {}
    any_length: dict[str, GapNetwork | None] = {"int": None}
    for name, row in ROWS.items():
        paths = sorted(folder.glob(f"{name}-*/fill.npz"))
        if name == SHIPPED and shipped.exists():
            paths = [shipped]
        frames = 60 if row.settings.shortest == 60 else 30
        found = [judge.judged(read(path), frames) for path in paths]
        if found:
            rows[name] = _mean(found) | {"seeds": len(found)}
            if row.settings.shortest < row.settings.longest:
                any_length[name] = read(paths[0])
    rows["int"] = _mean([judge.judged(None, 30)])
    lengths = {
        str(frames): {name: _mean([judge.judged(net, frames)]) for name, net in any_length.items()}
        for frames in LENGTHS
        if len(any_length) > 1 and windows.chosen(True, PAST + frames + TARGET_FRAMES).size
    }
    return {"rows": rows, "lengths": lengths, "held_out": windows.about["held_out"]}


def _mean(found: list[Errors]) -> dict[str, Any]:
    names = ("mse", "aco", "gap", "slide", "true_slide")
    out: dict[str, Any] = {name: float(np.mean([getattr(e, name) for e in found])) for name in names}
    out["profile"] = np.mean([e.profile for e in found], axis=0).tolist()
    return out


def text(result: Mapping[str, Any]) -> str:
    """All tables as text."""
    rows = result["rows"]
    lines = [f"Actors held out: {', '.join(result['held_out'])}"]
    head = f"{'':18s}{'MSE':>8s}{'paper':>8s}{'cm off':>8s}{'paper':>8s}{'gap cm':>8s}{'slide':>8s}"
    for title, names in TABLES.items():
        lines += ["", title, head]
        if title.startswith("Table 2"):
            lines.append(_line("int", rows["int"], *INT))
        for name in names:
            row = ROWS[name]
            lines.append(_line(name, rows.get(name), row.mse, row.aco))
    lines.append(f"{'captures':18s}{'':40s}{rows['int']['true_slide']:8.1f}")
    lines += ["", "Figure 5, cm off at frame", f"{'':18s}" + "".join(f"{n:8d}" for n in SHOWN)]
    for name in ("int", *TABLES["Table 2, 30 frames"]):
        if name in rows:
            profile = rows[name]["profile"]
            lines.append(f"{name:18s}" + "".join(f"{profile[n - 1]:8.2f}" for n in SHOWN))
    if lengths := result["lengths"]:
        for what, measure in (("cm off", "aco"), ("Slide", "slide"), ("cm from the target", "gap")):
            lines += ["", f"{what} by frames missing", f"{'':18s}" + "".join(f"{n:>8s}" for n in lengths)]
            for name in next(iter(lengths.values())):
                values = "".join(f"{found[name][measure]:8.2f}" for found in lengths.values())
                lines.append(f"{name:18s}{values}")
    return "\n".join(lines)


def _line(name: str, row: Mapping[str, Any] | None, mse: float | None, aco: float | None) -> str:
    def cell(value: float | None, digits: int) -> str:
        return f"{'-':>8s}" if value is None else f"{value:8.{digits}f}"

    if row is None:
        return f"{name:18s}{'-':>8s}{cell(mse, 3)}{'-':>8s}{cell(aco, 2)}   not trained"
    return (
        f"{name:18s}{row['mse']:8.3f}{cell(mse, 3)}{row['aco']:8.2f}{cell(aco, 2)}{row['gap']:8.2f}"
        f"{row['slide']:8.1f}"
    )


__all__ = ["Judge", "measured", "read", "text"]
