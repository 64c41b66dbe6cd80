"""Blocks of half a second of a drive: the level of rho_s, mu and slip, and their variation within the block.

Both identify a soil: its level and its roughness. Blocks count from a fixed instant, so a drive gives the same blocks
sample by sample as at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Bools, Floats
from terragrip.errors import InputError

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.vehicle import Vehicle


PERIOD = 0.5
"""Seconds of a block: several times the filter's own memory of noise, and short beside a border's crossing."""
SETTLING = 4
"""Blocks after a standstill, a stuck spell or a gap in which the estimates still swing in."""
LEAST_ROWS = 4
"""Fewest usable rows that show how much a block varies."""
LARGEST_SLIP = 0.6
"""Slip beyond which the ground cannot be read: the vehicle digs (and the paper's bins end)."""
FLOOR = 1e-4
"""Added to standard deviations before their logarithm, so that held values stay finite."""
_LONGEST_SKIP = 4
"""Periods (2 s) without a row that do not end a streak: logs of 1 Hz have none in every second period. A gap is an event of its own."""
_USABLE = ("", "immobilization", "outlier")
_AGAIN = "write the estimates again with 'terragrip estimate'"


@dataclass(frozen=True)
class Blocks:
    """Blocks of one drive, arrays of shape (blocks,) or, by driven wheel, (blocks, wheels). NaN: no usable data in the block.

    `number` counts periods since `origin`; a gap skips numbers. `start`, `end` [s]: its first row, and the first row after it;
    `rows`: the number of rows; `usable`: of these without an event, moving and with slips up to 60 %; `streak`: the number of consecutive
    blocks, up to and including this one, of which half the rows are usable. `travelled` [m]: distance at its last row.
    `resistance` rho_s, `adhesion`, `slip`: means of usable rows; the `_variance` of each: mean square of the estimates' own SD.
    `roughness` (blocks, 2): ln of the SD within the block of rho_s, and of mu (the wheels' mean); `slip_sd`: the same of slip. `curve_a`:
    its mean (NaN where the table has none). `share`: the wheels' shares of the load.
    """

    number: NDArray[np.int64]
    start: Floats
    end: Floats
    rows: NDArray[np.int64]
    usable: NDArray[np.int64]
    streak: NDArray[np.int64]
    travelled: Floats
    resistance: Floats
    resistance_variance: Floats
    adhesion: Floats
    adhesion_variance: Floats
    roughness: Floats
    curve_a: Floats
    slip: Floats
    slip_sd: Floats
    slip_variance: Floats
    share: Floats

    def __len__(self) -> int:
        return len(self.number)

    @property
    def known(self) -> Bools:
        """The blocks that identify the ground, (blocks,): the estimates have settled since the vehicle stood or spun."""
        return (self.streak > SETTLING) & np.isfinite(self.resistance) & np.isfinite(self.mean_adhesion)

    @property
    def mean_adhesion(self) -> Floats:
        """mu, the wheels' mean by load (blocks,)."""
        return np.asarray((self.adhesion * self.share).sum(axis=1))

    @property
    def mean_slip(self) -> Floats:
        """Slip, the wheels' mean by load (blocks,)."""
        return np.asarray((self.slip * self.share).sum(axis=1))

    def __getitem__(self, rows: Any) -> Blocks:
        """The blocks of a slice, mask or index array."""
        return Blocks(**{one.name: getattr(self, one.name)[rows] for one in fields(self)})


def wheel_loads(columns: Mapping[str, Any], axle_of: Mapping[str, str]) -> dict[str, Floats]:
    """The columns that weight the wheels: the load of each wheel's axle; ones where the table has none."""
    rows = len(np.asarray(columns["time"]))
    return {
        wheel: np.asarray(columns.get(f"vertical_load_{axle}", np.ones(rows)), dtype=float)
        for wheel, axle in axle_of.items()
    }


def needed_columns(wheels: Sequence[str]) -> tuple[str, ...]:
    """The columns from which blocks are made."""
    each = [f"{name}_{w}" for w in wheels for name in ("adhesion", "slip")]
    return ("time", "distance", "event", "soil_resistance", *each)


def blocks_of(
    columns: Mapping[str, Any],
    axle_of: Mapping[str, str],
    origin: float | None = None,
    before: tuple[int, int] | None = None,
    file: str | None = None,
) -> Blocks:
    """Cut a table of estimates into blocks.

    columns: those of `needed_columns`, (rows,) each; if available, their `_std` (else they count as exact) and
    `vertical_load_<axle>`. `axle_of`: the driven wheels and their axles. `origin` [s]: where the count starts (default: the first row).
    `before`: number and streak of the block before, when a drive continues. InputError where a column, a distance or every row is missing.
    """
    wheels = tuple(axle_of)
    time, distance = _checked(columns, wheels, file)
    first = float(time[0]) if origin is None else origin
    count = np.floor((time - first) / PERIOD + 1e-9).astype(np.int64)
    begin = np.flatnonzero(np.concatenate(([True], count[1:] != count[:-1])))
    size = np.diff(np.append(begin, time.size))

    slip, adhesion = _matrix(columns, "slip_{}", wheels), _matrix(columns, "adhesion_{}", wheels)
    resistance = np.asarray(columns["soil_resistance"], dtype=float)[:, None]
    good = np.isin(np.asarray(columns["event"], dtype=object), _USABLE)
    good &= np.isfinite(slip).all(axis=1) & (np.abs(slip) <= LARGEST_SLIP).all(axis=1)
    good &= np.isfinite(adhesion).all(axis=1) & np.isfinite(resistance[:, 0])
    rows = _Rows(good, begin, size, np.add.reduceat(good.astype(np.int64), begin))

    def column(name: str, absent: float) -> Floats:
        return np.asarray(columns.get(name, np.full(time.size, absent)), dtype=float)

    def variance(*names: str) -> Floats:
        return rows.mean(np.column_stack([column(name, 0.0) for name in names]) ** 2)

    load = rows.mean(np.column_stack(list(wheel_loads(columns, axle_of).values())))
    load = np.where(np.isfinite(load) & (load > 0), load, 1.0)
    level, mu, level_of_slip = rows.mean(resistance), rows.mean(adhesion), rows.mean(slip)
    within = rows.spread(resistance, level)[:, 0], rows.spread(adhesion, mu).mean(axis=1)
    return Blocks(
        number=count[begin],
        start=time[begin],
        end=np.append(time[begin[1:]], time[-1]),
        rows=size,
        usable=rows.usable,
        streak=_streak(count[begin], 2 * rows.usable >= size, before),
        travelled=distance[begin + size - 1],
        resistance=level[:, 0],
        resistance_variance=variance("soil_resistance_std")[:, 0],
        adhesion=mu,
        adhesion_variance=variance(*(f"adhesion_{w}_std" for w in wheels)),
        roughness=np.log(np.column_stack(within) + FLOOR),
        curve_a=rows.mean(column("curve_a", np.nan)[:, None])[:, 0],
        slip=level_of_slip,
        slip_sd=np.log(rows.spread(slip, level_of_slip).mean(axis=1) + FLOOR),
        slip_variance=variance(*(f"slip_{w}_std" for w in wheels)),
        share=load / load.sum(axis=1, keepdims=True),
    )


def _checked(columns: Mapping[str, Any], wheels: Sequence[str], file: str | None) -> tuple[Floats, Floats]:
    """Time and distance (rows,) of columns that are all there."""
    for name in needed_columns(wheels):
        if name not in columns:
            raise InputError("is missing", file=file, place=f"column {name}", hint=_AGAIN)
    time = np.asarray(columns["time"], dtype=float)
    if not time.size:
        raise InputError("holds no row", file=file, hint="estimate a log that is not empty")
    distance = np.asarray(columns["distance"], dtype=float)
    if not np.isfinite(distance).all():
        row = int(np.argmin(np.isfinite(distance)))
        raise InputError(
            f"{distance[row]} is no distance", file=file, place=f"column distance, row {row}", hint=_AGAIN
        )
    return time, distance


@dataclass(frozen=True)
class _Rows:
    """Rows of a drive, cut where each block begins; `usable` of the `size` rows of a block are `good`."""

    good: Bools
    begin: NDArray[np.int64]
    size: NDArray[np.int64]
    usable: NDArray[np.int64]

    def mean(self, values: Floats) -> Floats:
        """Of the good rows (rows, n), by block (blocks, n); NaN where there is none."""
        total = np.add.reduceat(np.where(self.good[:, None], values, 0.0), self.begin, axis=0)
        usable = self.usable[:, None]
        return np.asarray(np.where(usable > 0, total / np.maximum(usable, 1), np.nan))

    def spread(self, values: Floats, level: Floats) -> Floats:
        """SD of the good rows (rows, n) about the `level` of their block (blocks, n); NaN where they are few."""
        off = np.where(self.good[:, None], values - np.repeat(level, self.size, axis=0), 0.0)
        square = np.add.reduceat(off**2, self.begin, axis=0) / np.maximum(self.usable - 1, 1)[:, None]
        return np.asarray(np.where(self.usable[:, None] >= LEAST_ROWS, np.sqrt(square), np.nan))


def driven_wheels(vehicle: Vehicle) -> dict[str, str]:
    """The driven wheels and the axle of each; all wheels where none is driven."""
    driven = vehicle.driven_wheels or vehicle.wheels
    return {w: name for name, axle in vehicle.axles.items() for w in axle.wheels if w in driven}


def estimates_blocks(estimates: Estimates, rows: Bools | None = None, file: str | None = None) -> Blocks:
    """The blocks of a table of estimates; with `rows` (rows,), the others count as unusable.

    Raises InputError as `blocks_of`, and where the table has no vehicle.
    """
    if not estimates.has_adhesion:
        raise InputError(
            "has slip but no adhesion: the ground is recognised by adhesion and soil resistance, which need drive torques",
            file=file,
            hint="estimate a log with torques; slip alone changes with the pull, on one and the same ground",
        )
    columns = {name: estimates[name] for name in estimates.names}
    if rows is not None:
        columns["event"][~rows] = "gap"
    return blocks_of(columns, driven_wheels(estimates.vehicle), file=file)


def _streak(number: NDArray[np.int64], good: Bools, before: tuple[int, int] | None) -> NDArray[np.int64]:
    """The number of consecutive good blocks up to and including each block, (blocks,); more skipped than `_LONGEST_SKIP` end a streak."""
    last, run = before or (int(number[0]) - 1, 0)
    follows = number <= np.concatenate(([last], number[:-1])) + _LONGEST_SKIP
    out = np.empty(len(number), dtype=np.int64)
    for k in range(len(number)):
        run = (run + 1 if follows[k] else 1) if good[k] else 0
        out[k] = run
    return out


def _matrix(columns: Mapping[str, Any], name: str, wheels: Sequence[str]) -> Floats:
    return np.column_stack([np.asarray(columns[name.format(w)], dtype=float) for w in wheels])
