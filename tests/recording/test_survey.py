"""What is known of a log after it has been gone through once, however it comes in blocks."""

from __future__ import annotations

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.recording import LogBlocks, Recording
from terragrip.recording.chunks import CHUNK, CHUNKS, sampled_rows
from terragrip.recording.survey import survey_of


def log_of(rows: int) -> Recording:
    time = np.arange(rows) / 10
    late = np.where(np.arange(rows) == rows - 1, 0.5, np.nan)  # one value, in the last row
    soil = np.where(np.arange(rows) % 2, "clay", "").astype(object)
    return Recording(
        time, {"ground_speed": 2.0 * time, "pitch": np.full(rows, np.nan), "roll": late}, {"soil": soil}
    )


@pytest.mark.parametrize("rows", [1, CHUNK * CHUNKS, CHUNK * CHUNKS + 1, CHUNK * 35 + 7])
@pytest.mark.parametrize("block", [40_001, 10_000_000])
def test_a_sample_is_the_same_chunks_however_the_log_is_cut(rows: int, block: int) -> None:
    log, done = log_of(rows), []
    known = survey_of(LogBlocks.of(log, block), done.append)
    expected = log.select(sampled_rows(rows))
    np.testing.assert_array_equal(known.sample.time, expected.time)
    np.testing.assert_array_equal(known.sample["ground_speed"], expected["ground_speed"])
    np.testing.assert_array_equal(known.sample["soil"], expected["soil"])
    assert (known.rows, known.empty) == (rows, ("pitch",))
    assert set(known.sample.channels) == {"ground_speed", "roll"}
    assert known.sample.notes == ("pitch has no value and is left out.",)
    assert done == [min(k + block, rows) for k in range(0, rows, block)]


def test_blocks_leave_out_what_is_empty_in_the_whole_log_alone() -> None:
    log = log_of(100)
    known = survey_of(LogBlocks.of(log, 30))
    blocks = [known.without_empty(block) for block in LogBlocks.of(log, 30).blocks()]
    assert [len(block) for block in blocks] == [30, 30, 30, 10]
    assert all(set(block.channels) == {"ground_speed", "roll"} for block in blocks)
    full = Recording(log.time, {"ground_speed": log.time})
    assert survey_of(LogBlocks.of(full)).without_empty(full) is full


def test_a_log_in_memory_is_one_block_unless_asked_otherwise() -> None:
    log = log_of(7)
    assert [len(block) for block in LogBlocks.of(log).blocks()] == [7]
    assert LogBlocks.of(log).rows == 7
    assert LogBlocks.of(log).from_disk is False
    assert list(LogBlocks.of(log.select(slice(0, 0))).blocks()) == []
    with pytest.raises(InputError, match="there is no row"):
        survey_of(LogBlocks.of(log.select(slice(0, 0))))
