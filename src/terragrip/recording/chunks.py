"""The rows from which a long log's noise and held channels are learned: chunks of neighbouring rows, spread over the whole of it.

Chunks, because every k-th row would destroy rates, held values and noise. Every second, fourth, eighth ... chunk counts: they
can be chosen during the pass, before the log's length is known.
"""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Ints

CHUNK = 12_500
"""Rows of a chunk."""
CHUNKS = 16
"""Chunks that are kept at most, and more than half as many of a log that has more."""


def sampled_rows(rows: int) -> slice | Ints:
    """The sample of a log's ``rows``: all if they are `CHUNKS` chunks at most, else every 2^k-th chunk."""
    chunks, every = -(-rows // CHUNK), 1
    if chunks <= CHUNKS:
        return slice(None)
    while -(-chunks // every) > CHUNKS:
        every *= 2
    first = CHUNK * np.arange(0, chunks, every)
    result = (first[:, None] + np.arange(CHUNK)).ravel()
    return result[result < rows]
