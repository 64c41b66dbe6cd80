"""Rows before a gap are flagged alike in one block and in many."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.estimation.forward import GAP, flag_before_gaps


@pytest.mark.parametrize("cut", range(1, 9))
def test_blocks_are_flagged_as_the_whole(cut: int) -> None:
    codes = np.array([0, 1, GAP, GAP, 0, 0, GAP, 2, GAP], np.uint8)
    whole = codes.copy()
    flag_before_gaps(whole)
    # the row before each run of gaps, and no other
    assert whole.tolist() == [0, GAP, GAP, GAP, 0, GAP, GAP, GAP, GAP]
    first, second = codes[:cut].copy(), codes[cut:].copy()
    flag_before_gaps(first)
    flag_before_gaps(second, first)
    assert [*first, *second] == whole.tolist()
