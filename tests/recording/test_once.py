"""What checks share is made once of each log."""

import gc

import numpy as np

from terragrip.recording import Recording
from terragrip.recording.once import _MADE, once


@once
def _scaled(recording: Recording, name: str, by: list[float], *, minus: bool = False) -> np.ndarray:
    return recording.channels[name] * by[0] - minus


def _log(value: float) -> Recording:
    return Recording(np.arange(3.0), {"a": np.full(3, value), "b": np.full(3, 2 * value)})


def test_the_same_of_a_log_is_made_once_and_all_else_anew() -> None:
    log, by = _log(1.0), [3.0]
    first = _scaled(log, "a", by)
    assert _scaled(log, "a", by) is first
    assert _scaled(log, "".join(["", "a"]), by) is first  # a name, not the object that holds it
    assert _scaled(log, "b", by)[0] == 6.0
    assert _scaled(log, "a", [4.0])[0] == 4.0
    assert _scaled(log, "a", by, minus=True)[0] == 2.0
    assert _scaled(_log(5.0), "a", by)[0] == 15.0


def test_another_object_never_has_the_result_of_one_that_is_gone() -> None:
    log = _log(1.0)
    assert [_scaled(log, "a", [float(k)])[0] for k in range(100)] == list(range(100))


def test_what_was_made_goes_with_its_log() -> None:
    log = _log(1.0)
    _scaled(log, "a", [1.0])
    before = len(_MADE)
    del log
    gc.collect()
    assert len(_MADE) < before
