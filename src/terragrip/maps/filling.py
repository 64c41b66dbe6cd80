"""Cells between the driven ones, by ordinary kriging with its variance."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Floats
from terragrip.errors import InputError, missing_package
from terragrip.maps.cells import Cells

NEIGHBOURS = 24
"""Driven cells that a filled one is made of."""
FITTED = 2000
"""Cells at most that the variogram is fitted to, drawn evenly."""
MOST = 2_000_000
"""Cells at most that are filled."""


def filled(cells: Cells, reach: float) -> Cells:
    """The cells and those within `reach` cell sizes of one, by ordinary kriging with an exponential variogram (pykrige).

    A filled cell has ``count`` and ``passes`` 0; its SD includes the kriging variance and the constants that all cells share. Raises
    InputError where pykrige is missing, there are too few cells to fit a variogram, or too many to fill.
    """
    from scipy.spatial import cKDTree

    if len(cells) < NEIGHBOURS:
        raise InputError(
            f"{len(cells)} cells are too few to fill between",
            place="--fill",
            hint="leave it out, or drive more",
        )
    place = np.column_stack([cells.column, cells.row]).astype(np.int64)
    low, high = place.min(axis=0) - int(reach), place.max(axis=0) + int(reach)
    if np.prod(high - low + 1.0) > 50 * MOST:
        raise InputError(
            "the runs are too far apart to fill between", place="--fill", hint="map them one by one"
        )
    tree = cKDTree(place)
    wanted = _near(tree, place, low, high, reach)
    if len(wanted) > MOST:
        raise InputError(
            f"{len(wanted)} cells would be filled", place="--fill", hint="choose larger cells with --cell"
        )
    value, variance = _kriged(place, cells.value, np.median(cells.std**2 - cells.constant**2), wanted)
    none = np.zeros(len(wanted), dtype=np.int64)
    nearest = tree.query(wanted)[1]
    constant = cells.constant[nearest]
    new = Cells(
        wanted[:, 0], wanted[:, 1], value, np.sqrt(variance + constant**2), cells.constants[nearest], none, none, cells.run[nearest],
        np.full(len(wanted), np.nan), cells.headland[nearest],
    )  # fmt: skip
    return Cells.joined([cells, new])


def _near(
    tree: Any, place: npt.NDArray[np.int64], low: Floats, high: Floats, reach: float
) -> npt.NDArray[np.int64]:
    """Cells of the box without a value, at most `reach` from a driven one, row by row because the box may be large."""
    held = set(map(tuple, place.tolist()))
    out = []
    for row in range(int(low[1]), int(high[1]) + 1):
        line = np.column_stack(
            [np.arange(low[0], high[0] + 1), np.full(int(high[0] - low[0]) + 1, row)]
        ).astype(np.int64)
        distance = tree.query(line, distance_upper_bound=np.nextafter(reach, np.inf))[
            0
        ]  # which must be nearer
        out += [cell for cell in map(tuple, line[np.isfinite(distance)].tolist()) if cell not in held]
    return np.array(out, dtype=np.int64).reshape(-1, 2)


def _kriged(
    place: npt.NDArray[np.int64], value: Floats, noise: float, wanted: npt.NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Values and variances at cells (m, 2). `noise`: the driven cells' own variance, the lower limit of the nugget."""
    try:
        from pykrige.ok import OrdinaryKriging
    except ImportError as error:
        raise missing_package("pykrige", "geo", "fill cells", place="--fill") from error
    if not len(wanted):
        return np.zeros(0), np.zeros(0)
    if np.ptp(value) == 0:  # no variation to fit a variogram to
        return np.full(len(wanted), value[0]), np.full(len(wanted), noise)
    centre, scale = float(value.mean()), max(float(value.std()), float(np.sqrt(noise)), 1e-9)
    unit = (value - centre) / scale  # the kriging system is ill-conditioned where variances are far from 1
    some = np.linspace(0, len(value) - 1, min(FITTED, len(value))).astype(int)
    settings = {"variogram_model": "exponential", "enable_statistics": False, "exact_values": False}
    fitted = OrdinaryKriging(*place[some].T.astype(float), unit[some], **settings).variogram_model_parameters
    sill, reach, nugget = fitted
    reach = min(float(reach), float(np.hypot(*np.ptp(place, axis=0))))
    parameters = [float(sill), reach, max(float(nugget), noise / scale**2, 1e-6)]
    model = OrdinaryKriging(*place.T.astype(float), unit, variogram_parameters=parameters, **settings)
    estimate, variance = model.execute(
        "points", *wanted.T.astype(float), n_closest_points=min(NEIGHBOURS, len(value)), backend="loop"
    )
    return centre + scale * np.asarray(estimate), scale**2 * np.maximum(np.asarray(variance), 0.0)
