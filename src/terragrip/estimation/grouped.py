"""Estimates summed up by label: a row a soil (or an event), with what was driven there and the medians."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError

if TYPE_CHECKING:
    import pandas as pd

    from terragrip.estimation.estimates import Estimates


def quantities(estimates: Estimates) -> list[str]:
    """The columns that a summary reports: speed and resistance of the vehicle, slip, adhesion, traction and efficiency of each wheel."""
    named = ["ground_speed", "soil_resistance"]
    named += [
        f"{q}_{w}" for q in ("slip", "adhesion", "net_traction", "efficiency") for w in estimates.wheels
    ]
    return [name for name in named if name in estimates]


def medians(estimates: Estimates, rows: npt.NDArray[np.bool_]) -> dict[str, float]:
    """The median of each of `quantities` and of its standard deviation (``<name>_std``) over rows (n,); NaN of none."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a column may be all NaN
        return {
            column: float(np.nanmedian(estimates[column][rows])) if rows.any() else float("nan")
            for name in quantities(estimates)
            for column in (name, f"{name}_std")
            if column in estimates
        }


def summary_by(estimates: Estimates, by: str) -> pd.DataFrame:
    """A row for each text of the column ``by`` ("" is what has none): ``rows``, ``seconds``, ``metres`` there, and over its rows without an
    event the medians of `quantities` and of their standard deviations.

    Grouped by ``event`` the medians are over all rows of each. Raises InputError where ``by`` is no column of texts.
    """
    import pandas as pd

    texts = ["event", *estimates.labels]
    if by not in texts:
        raise InputError(f"there is no label {by!r} to sum up by", hint=f"take one of {', '.join(texts)}")
    labels, calm = estimates[by], estimates.event_codes == 0
    seconds = np.diff(estimates.time, append=estimates.time[-1:])
    seconds[estimates.during("gap")] = 0.0
    metres = (
        np.diff(estimates["distance"], append=estimates["distance"][-1:]) if "distance" in estimates else None
    )
    result = {}
    for label in sorted(set(labels.tolist())):
        rows = labels == label
        one = {"rows": int(rows.sum()), "seconds": float(seconds[rows].sum())}
        if metres is not None:
            one["metres"] = float(np.nansum(metres[rows]))
        result[label] = one | medians(estimates, rows if by == "event" else rows & calm)
    return pd.DataFrame.from_dict(result, orient="index").rename_axis(by)
