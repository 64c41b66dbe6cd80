"""Clock time of a log: its own seconds beside the calendar's."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats

if TYPE_CHECKING:
    import pandas as pd


LATEST = 7.25e9
"""s since 1970, in 2199: what is beyond is a clock in another unit."""
_UNITS = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"))  # and the least stamp of each since 1970


def clock_index(time: Floats, start: datetime) -> pd.DatetimeIndex:
    """The index ``clock`` (n,) of a log's ``time`` (n,) [s] whose 0 was at ``start``: UTC, to the microsecond."""
    import pandas as pd

    return pd.DatetimeIndex(clock_times(time, start), name="clock").tz_localize("UTC")


def clock_times(time: Floats, start: datetime) -> npt.NDArray[np.datetime64]:
    """A log's ``time`` (n,) [s] whose 0 was at ``start`` as dates (n,) in UTC, to the microsecond."""
    zero = np.datetime64(start.astimezone(UTC).replace(tzinfo=None), "us")
    return zero + np.round(1e6 * np.asarray(time)).astype("timedelta64[us]")


def clock_text(when: float) -> str:
    """A time [s since 1970] in ISO 8601, UTC, to the microsecond; as a number of seconds where that is no date."""
    try:
        return datetime.fromtimestamp(when, UTC).isoformat()
    except (ValueError, OverflowError, OSError):
        return f"{when:.6g} s"


def clock_unit(stamp: float) -> str | None:
    """The unit of a stamp that counts from 1970 and is too large for seconds; None where seconds will do, or it is a date in digits."""
    if is_date_in_digits(stamp):
        return None
    return next((unit for least, unit in _UNITS if least < stamp < np.inf), None)


def is_date_in_digits(stamp: float) -> bool:
    """Whether a number is a date and a time of day as yyyymmddhhmmss, with milliseconds in three more digits or none."""
    digits = f"{stamp:.0f}"
    return (
        re.fullmatch(
            r"(19|20|21)\d\d(0[1-9]|1[0-2])([0-2]\d|3[01])([01]\d|2[0-3])([0-5]\d){2}(\d{3})?", digits
        )
        is not None
    )
