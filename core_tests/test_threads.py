"""The thread count of numpy's matrix library is lowered inside the block and comes back after it, errors
included.
"""

from __future__ import annotations

import pytest

from nsm_core import threads


def test_count_is_one_inside_and_restored():
    functions = threads._openblas()
    if functions is None:
        pytest.skip("this numpy uses another matrix library than OpenBLAS")
    get, put = functions
    before = get()
    put(2)
    try:
        with pytest.raises(ZeroDivisionError), threads.one_thread():
            assert get() == 1
            raise ZeroDivisionError
        assert get() == 2
    finally:
        put(before)
