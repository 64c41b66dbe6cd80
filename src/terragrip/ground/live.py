"""The ground while driving: estimates in, one by one; every half second the soils' probabilities, and changes as they are reported.

The blocks, the model and the code are those of a whole drive with `online`: identical results.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from terragrip.errors import InputError
from terragrip.ground.causes import pull_of
from terragrip.ground.changes import Change
from terragrip.ground.emissions import Emissions
from terragrip.ground.online_changes import OnlineChanges
from terragrip.ground.recognition import ForwardFilter, by_soil
from terragrip.ground.steps import A_LENGTH
from terragrip.soil.blocks import PERIOD, Blocks, blocks_of, driven_wheels, needed_columns
from terragrip.soil.estimates import whole_length
from terragrip.soil.library import SoilLibrary

if TYPE_CHECKING:
    from terragrip.estimation import Estimate, TractionEstimator

_VERSION = 3


@dataclass(frozen=True)
class GroundState:
    """The state at the end of a block. `time` [s]: of the row that ended it; `soil`: the most probable; `probabilities` of all soils.

    `known`: whether the block gave evidence (else the probabilities are carried on). `change`: a change reported now, or None.
    """

    time: float
    soil: str
    probabilities: Mapping[str, float]
    known: bool
    change: Change | None

    def to_dict(self) -> dict[str, Any]:
        """As JSON holds it; of the change how certain it is, and its cause."""
        change = self.change
        return {
            "time": self.time,
            "soil": self.soil,
            "probability": self.probabilities[self.soil],
            "probabilities": dict(self.probabilities),
            "change": change
            and {name: getattr(change, name) for name in ("time", "std", "probability", "cause")},
        }


class LiveGround:
    """Follows the ground along the estimates of one drive.

    estimator: the source of the estimates; at every change it is notified of a new ground (`new_ground()`), which restarts its
    adhesion curve. library: the known soils; without one every soil is unknown, and only changes are reported.
    """

    def __init__(
        self,
        estimator: TractionEstimator,
        library: SoilLibrary | None = None,
    ) -> None:
        self.estimator = estimator
        self._axle_of = driven_wheels(estimator.vehicle)
        optional = [f"{n}_std" for n in needed_columns(tuple(self._axle_of))[3:]]
        loads = [f"vertical_load_{axle}" for axle in dict.fromkeys(self._axle_of.values())]
        every = (*needed_columns(tuple(self._axle_of)), *optional, *loads, "curve_a")
        there = {"time", "event", *estimator.columns}
        self._columns = tuple(name for name in every if name in there)
        length = whole_length(estimator.vehicle)
        self._emissions = Emissions(
            library.recognisable if library is not None else {}, estimator.method, length
        )
        self._filter = ForwardFilter(self._emissions)
        pull = pull_of(estimator.vehicle, "drawbar_force" in estimator.channels)
        self._changes = OnlineChanges(length / A_LENGTH, pull=pull)
        self._origin: float | None = None
        self._number = 0
        self._before: tuple[int, int] | None = None
        self._rows: list[list[Any]] = []

    def update(self, estimate: Estimate) -> GroundState | None:
        """Process the next estimate; returns the state if it ends a block, else None."""
        if self._origin is None:
            self._origin = estimate.time
        number = int(np.floor((estimate.time - self._origin) / PERIOD + 1e-9))
        state = None
        if number != self._number and self._rows:
            state = self._close(estimate.time)
        self._number = number
        self._rows.append([estimate[name] for name in self._columns])
        return state

    def finish(self) -> GroundState | None:
        """The state after the last, unfinished block; None if there is none. No estimate may follow."""
        return self._close(float(self._rows[-1][0])) if self._rows else None

    def _close(self, end: float) -> GroundState:
        block = self._block(end)
        self._before = (int(block.number[0]), int(block.streak[0]))
        self._rows.clear()
        probabilities = by_soil(self._filter.update(block).filtered, self._emissions.states)[0]
        change = next(iter(self._changes.update(block)), None)
        if change is not None:
            self.estimator.new_ground()
        names = self._emissions.names
        by_name = {name: float(p) for name, p in zip(names, probabilities, strict=True)}
        return GroundState(end, names[int(probabilities.argmax())], by_name, bool(block.known[0]), change)

    def _block(self, end: float) -> Blocks:
        columns = dict(zip(self._columns, map(np.array, zip(*self._rows, strict=True)), strict=True))
        block = blocks_of(columns, self._axle_of, self._origin, self._before)
        return replace(block, end=np.array([end]))

    def snapshot(self) -> bytes:
        """Everything needed to continue later, bit for bit: the state, not the library, as JSON."""
        state = {
            "version": _VERSION,
            "soils": list(self._emissions.soils),
            "columns": list(self._columns),
            "origin": self._origin,
            "number": self._number,
            "before": self._before,
            "rows": self._rows,
            "probabilities": self._filter.probabilities.tolist(),
            "travelled": self._filter.travelled,
            "changes": self._changes.to_dict(),
        }
        return json.dumps(state).encode()

    @classmethod
    def restore(
        cls,
        data: bytes,
        estimator: TractionEstimator,
        library: SoilLibrary | None = None,
    ) -> Self:
        """Continue from a snapshot with the same estimator and library; raises InputError if it is damaged or belongs to others."""
        result = cls(estimator, library)
        try:
            state = json.loads(data)
            same = (
                state["version"] == _VERSION
                and state["soils"] == list(result._emissions.soils)
                and state["columns"] == list(result._columns)
            )
            if same:
                result._origin, result._number, result._rows = state["origin"], state["number"], state["rows"]
                result._before = None if state["before"] is None else (state["before"][0], state["before"][1])
                result._filter.probabilities = np.array(state["probabilities"], dtype=float)
                result._filter.travelled = state["travelled"]
                result._changes.restore(state["changes"])
        except (ValueError, KeyError, TypeError, IndexError) as error:
            raise InputError(f"the snapshot of the ground is damaged ({error})", hint="start anew") from None
        if not same:
            raise InputError(
                "the snapshot of the ground is of another version, vehicle or library", hint="start anew"
            )
        return result
