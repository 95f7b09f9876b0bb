"""The training log goes on, and is drawn, whatever a killed run has left of it."""

from __future__ import annotations

import numpy as np
import pytest

from nsm_core.training.log import COLUMNS, Log

ROWS = [(step, step / 100, 0.5 / step, 0.7 / step, 0.6 / step, 0.012, 0.034) for step in (200, 400, 600)]


@pytest.fixture
def log(tmp_path):
    log = Log(tmp_path / "log.csv")
    log.begin()
    for row in ROWS:
        log.add(row)
    return log


def test_rows_come_back(log):
    assert log.path.read_text().splitlines()[0] == ",".join(COLUMNS)
    assert np.allclose(log.rows(), ROWS, rtol=1e-4)


def test_cut_at_any_byte_the_whole_rows_are_read_and_the_next_run_goes_on(log):
    data = log.path.read_bytes()
    ends = [at + 1 for at, byte in enumerate(data) if byte == ord("\n")]
    for cut in range(len(data) + 1):
        log.path.write_bytes(data[:cut])
        whole = max(sum(end <= cut for end in ends) - 1, 0)
        assert len(log.rows()) == whole
        log.begin(400)
        log.add(ROWS[2])
        assert np.allclose(log.rows(), [*ROWS[: min(whole, 2)], ROWS[2]], rtol=1e-4)


def test_steps_keep_all_their_digits(log):
    log.add((1234567, *ROWS[0][1:]))
    log.begin(1234567)
    assert log.rows()[-1, 0] == 1234567


def test_rows_later_than_the_checkpoint_come_once(log):
    log.begin(200)
    log.add(ROWS[1])
    assert log.rows()[:, 0].tolist() == [200, 400]


@pytest.mark.parametrize(
    "damage",
    [b"", b"\xff\xfe\x00garbage", b"800,1,2\n", b"600,1,2,3800,1,2,3,4,5,6\n", b"\n\nnan,1,1,1,1,1,1\n"],
)
def test_what_is_no_row_is_passed_over(log, damage):
    log.path.write_bytes(log.path.read_bytes() + damage)
    assert log.rows()[:, 0].tolist() == [200, 400, 600]


def test_an_older_run_appended_after_half_a_line(log):
    log.path.write_bytes(log.path.read_bytes()[:-9])
    log.add((800, 8, 1, 1, 1, 1, 1))
    assert log.rows()[:, 0].tolist() == [200, 400]  # the halves that ran together are no row
    pytest.importorskip("matplotlib", reason="plots need matplotlib")
    log.plot()
    assert log.path.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
