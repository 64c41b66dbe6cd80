"""The rows that a long log is judged by are whole chunks from all over it."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.recording.chunks import CHUNK, CHUNKS, sampled_rows


@pytest.mark.parametrize("rows", [0, 1, CHUNK, CHUNK * CHUNKS - 1, CHUNK * CHUNKS])
def test_a_log_of_so_many_chunks_counts_whole(rows: int) -> None:
    assert sampled_rows(rows) == slice(None)


@pytest.mark.parametrize("rows", [CHUNK * CHUNKS + 1, CHUNK * 33, CHUNK * 47 + 5, CHUNK * 200 - 1])
def test_a_longer_one_by_every_2_to_the_k_th_chunk(rows: int) -> None:
    got = sampled_rows(rows)
    assert isinstance(got, np.ndarray)
    chunks = -(-rows // CHUNK)
    every = next(2**k for k in range(1, 20) if -(-chunks // 2**k) <= CHUNKS)
    np.testing.assert_array_equal(got, [r for r in range(rows) if r // CHUNK % every == 0])
    assert CHUNKS // 2 < len(np.unique(got // CHUNK)) <= CHUNKS
