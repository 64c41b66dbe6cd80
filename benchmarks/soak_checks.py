"""The promises of docs/live.md that a soak checks: what the record holds against what was sent, and against a run without faults."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
import pyarrow.parquet as pq

from terragrip.estimation import TractionEstimator
from terragrip.live.record_folder import last_snapshot, load_snapshot
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

if TYPE_CHECKING:
    from soak import Soak

LOST = 0.1  # s of arrivals that a kill may cost (docs/live.md)
SAME = 0.1  # of a state's own SD: what a user could not tell from the clean run
# A curve learned over more than the quiet end lacks the rows that were lost: two honest estimates on different rows.
LEARNED, SAME_LEARNED = "curve_a", 1.0
FLAT, LONG = 0.02, 300.0  # growth of memory, judged where the last life was watched for so many s
FLAT_SHORT = 0.25  # in a shorter one, which is still warming up: keeping every row takes more
UNDEFINED = ("slip", "efficiency")  # NaN at standstill (docs/physics.md)
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Check:
    """A promise, whether it stands, and the figures that tell."""

    promise: str
    stands: bool
    seen: str


def checks(soak: Soak, vehicle: Vehicle) -> list[Check]:
    """All of them, after the run."""
    number = last_snapshot(soak.record)
    if number is None:
        return [Check("there is a record", False, "none")]
    core = load_snapshot(soak.record, number)
    assert core.estimator is not None
    kept = Kept()
    through = TractionEstimator(vehicle, channels=core.estimator.channels)
    for path in sorted(soak.record.glob("recording-*.parquet")):
        kept.add(path, soak, through)
    clean = TractionEstimator(vehicle, channels=core.estimator.channels)
    received = core.counts.by_channel["altitude"]["received"]
    return [
        Check("the service ends with code 0", soak.code == 0, f"code {soak.code}"),
        *kept.checks(received, refused(soak)),
        state_check(soak, clean, kept),
        kill_check(soak, kept),
        memory_check(soak),
    ]


class Kept:
    """What the record's segments hold, each against what was sent and against one run over all their rows."""

    def __init__(self) -> None:
        self._numbers: list[npt.NDArray[np.int64]] = []
        self._arrivals: list[Floats] = []
        self._times: list[Floats] = []
        self._not_finite = self._other = self._changed = 0
        self.last: dict[str, float] = {}  # estimates of the last row

    def add(self, path: Path, soak: Soak, through: TractionEstimator) -> None:
        """A segment's two files."""
        rows = pq.read_table(path)
        given = pq.read_table(path.with_name(path.name.replace("recording", "estimates")))
        log = Recording.from_frame(rows)
        again = through.update_block(log)
        standstill = np.asarray(given["event"].to_pylist()) == "standstill"
        for name, expected in again.columns.items():
            column = given[name].to_numpy()
            self._other += not np.array_equal(column, expected, equal_nan=True)
            allowed = standstill if name.startswith(UNDEFINED) else False
            self._not_finite += int((~np.isfinite(column) & ~np.asarray(allowed)).sum())
            self.last[name] = float(column[-1])
        number = rows["altitude"].to_numpy().astype(np.int64)
        sound = ~np.isin(number, list(soak.spoiled))
        for name, values in soak.base.channels.items():
            sent = values[number % len(values)]
            self._changed += int((rows[name].to_numpy() != sent)[sound].sum())
        self._numbers.append(number)
        self._arrivals.append(rows["arrival"].to_numpy())
        self._times.append(log.time)

    @property
    def newest(self) -> int:
        """The number of the sample in the last row."""
        return int(self._numbers[-1][-1])

    @property
    def arrivals(self) -> Floats:
        """Of all rows."""
        return np.concatenate(self._arrivals)

    def checks(self, received: int, refused: int) -> list[Check]:
        """After the last segment."""
        numbers = np.concatenate(self._numbers)
        kept = len(numbers)
        twice = kept - len(np.unique(numbers))
        back = int((np.diff(np.concatenate(self._times)) <= 0.0).sum())
        counted = f"{received} received = {kept} rows + {refused} refused"
        return [
            Check("every received sample is a row or refused", received == kept + refused, counted),
            Check("no sample is in two rows", twice == 0, f"{twice} twice"),
            Check("rows hold what was sent", self._changed == 0, f"{self._changed} values differ"),
            Check("the rows' time rises", back == 0, f"{back} steps do not"),
            Check("no NaN but slip at standstill", self._not_finite == 0, f"{self._not_finite} others"),
            Check(
                "all kills through, estimates of one run", self._other == 0, f"{self._other} columns differ"
            ),
        ]


def refused(soak: Soak) -> int:
    """Samples that the record holds as refused."""
    lines = [line for path in soak.record.glob("refused-*.jsonl") for line in path.read_text().splitlines()]
    return sum("altitude" in json.loads(line)["values"] for line in lines)


def state_check(soak: Soak, clean: TractionEstimator, kept: Kept) -> Check:
    """The last row against that of a run over all samples up to it, as they were before the faults."""
    promise, size, number = "after the last fault, the clean run's state", len(soak.base.time), kept.newest
    if number < soak.count - soak.rate:
        return Check(promise, False, f"the last row is of sample {number} of {soak.count}")
    expected: dict[str, float] = {}
    for first in range(0, number + 1, size):
        n = min(size, number + 1 - first)
        channels = {name: values[:n] for name, values in soak.base.channels.items()}
        block = clean.update_block(Recording((first + np.arange(n)) / soak.rate, channels))
        expected = {name: float(column[-1]) for name, column in block.columns.items()}
    off = {}
    for name, value in expected.items():
        sd = expected.get(f"{name}_std")
        if sd is not None:
            limit = SAME_LEARNED if name.startswith(LEARNED) else SAME
            off[name] = abs(kept.last[name] - value) / sd / limit
            off[f"{name}_std"] = abs(kept.last[f"{name}_std"] / sd - 1.0) / SAME
    # A number that is NaN in one of them only is the furthest.
    worst = max(off, key=lambda name: off[name] if off[name] == off[name] else np.inf)
    return Check(
        promise, off[worst] <= 1.0, f"furthest {worst}: {100 * off[worst]:.0f} % of what it may be off"
    )


def kill_check(soak: Soak, kept: Kept) -> Check:
    """Estimates that a life gave out and the record has not: how far their arrivals lie behind the newest."""
    heard = gone = over = 0
    most = 0.0
    for life in soak.lives:
        seen = np.asarray(life.seen)
        lost = seen[~np.isin(seen, kept.arrivals)]
        heard, gone = heard + len(seen), gone + len(lost)
        if len(lost):
            span = float(seen.max() - lost.min())
            most = max(most, span)
            # The service's ten times a second do not hold while others have the processor.
            over += span > LOST + life.stalled or life is soak.lives[-1]
    kills = len(soak.lives) - 1
    text = f"{kills} kills cost {gone} of {heard} estimates heard, {1e3 * most:.0f} ms at most"
    return Check(f"a kill costs at most {LOST:g} s", over == 0 and heard > 0, text)


def memory_check(soak: Soak) -> Check:
    """The last life's memory: median of its last third over that of its second; the first third warms up."""
    at, held = np.array(soak.lives[-1].memory).T
    third = (at[-1] - at[0]) / 3.0
    second = np.median(held[(at >= at[0] + third) & (at < at[-1] - third)])
    grown = np.median(held[at >= at[-1] - third]) / second - 1.0
    limit = FLAT if at[-1] - at[0] >= LONG else FLAT_SHORT
    text = f"{100 * grown:+.1f} % of {second:.0f} MB, last life of {at[-1] - at[0]:.0f} s"
    return Check(f"memory grows by at most {limit:.0%}", bool(grown <= limit), text)
