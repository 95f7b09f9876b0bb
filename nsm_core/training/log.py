"""The log of a training run: a table that survives a run killed in the middle of a line, and its plot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from nsm_core.files import output
from nsm_core.rotations import Array

COLUMNS = ("step", "minutes", "data", "rollout", "validation", "drift_m", "pose_error_m")


class Log:
    """A CSV file with one row every few hundred steps; rows are added to its end, so that reading forgives
    half a line there.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def begin(self, step: int = 0) -> None:
        """Start the table, or go on after ``step``: later rows are of a run that was killed before it saved,
        and come again.

        OutputError where it cannot be written.
        """
        rows = self.rows()
        with output(self.path, "The log of the training") as temporary:
            temporary.write_text(
                "".join((",".join(COLUMNS) + "\n", *map(_line, rows[rows[:, 0] <= step]))), encoding="utf-8"
            )

    def add(self, row: Sequence[float]) -> None:
        """Add a row of the ``COLUMNS``."""
        with self.path.open("a", encoding="utf-8", newline="") as file:
            file.write(_line(row))

    def rows(self) -> Array:
        """The rows (N, 7) that are whole; none where there is no file."""
        if not self.path.is_file():
            return np.empty((0, len(COLUMNS)))
        text = self.path.read_text(encoding="utf-8", errors="replace")
        # What has no line end was cut off: "0.0012" of "0.00123" is a number, too.
        whole = [
            row
            for line in text.splitlines(keepends=True)
            if line.endswith("\n") and (row := _numbers(line)) is not None
        ]
        return np.array(whole, dtype=np.float64).reshape(-1, len(COLUMNS))

    def plot(self) -> None:
        """Draw the losses beside the table; nothing where there are fewer than two rows."""
        rows = dict(zip(COLUMNS, self.rows().T, strict=True))
        if len(rows["step"]) < 2:
            return
        import matplotlib

        matplotlib.use("Agg")
        import matplotlib.pyplot as plt

        figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.5))
        for name in ("data", "rollout", "validation"):
            left.plot(rows["step"], rows[name], label=name)
        left.set(yscale="log", xlabel="step", ylabel="mean squared error, normalised")
        left.legend()
        for name in ("drift_m", "pose_error_m"):
            right.plot(rows["step"], rows[name], label=name)
        right.set(xlabel="step", ylabel="metres", title="roll-outs against the takes they left")
        right.legend()
        figure.tight_layout()
        try:
            with output(self.path.with_suffix(".png"), "The plot") as temporary:
                figure.savefig(temporary, dpi=90)
        finally:
            plt.close(figure)


def _line(row: Sequence[float]) -> str:
    return ",".join((f"{row[0]:.0f}", *(f"{value:.5g}" for value in row[1:]))) + "\n"


def _numbers(line: str) -> list[float] | None:
    """The numbers of a line; None where it is no row, such as the head or two halves that ran together."""
    try:
        values = [float(cell) for cell in line.split(",")]
    except ValueError:
        return None
    return values if len(values) == len(COLUMNS) and np.isfinite(values[0]) else None
