"""The result for the ground of one drive, and ground.json (architecture.md, contracts)."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Bools, Floats
from terragrip.document import read_json
from terragrip.errors import InputError
from terragrip.files import replacing
from terragrip.ground.changes import Change
from terragrip.ground.events import Event
from terragrip.ground.sections import Section

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


VERSION = 1


@dataclass(frozen=True)
class Timeline:
    """Probabilities of the soils over a drive, a row for each block of half a second.

    `time` [s] (blocks,): each block's start; `names`: the soils, "unknown" last; `probabilities` (blocks, names); `known` (blocks,):
    whether the block gives evidence (elsewhere the probabilities are carried on); `label` (blocks,): the recording's own name of
    the soil, "" where it has none or where vehicle and tool are on different soils.
    """

    time: Floats
    names: tuple[str, ...]
    probabilities: Floats
    known: Bools
    label: NDArray[np.object_]

    @property
    def soil(self) -> NDArray[np.object_]:
        """The most probable soil of each block (blocks,)."""
        if not len(self.time):
            return np.zeros(0, dtype=object)
        return np.array(self.names, dtype=object)[self.probabilities.argmax(axis=1)]

    def to_dict(self) -> dict[str, Any]:
        """In the form of ground.json: probabilities by soil, to four digits."""
        return {
            "time": [round(float(t), 3) for t in self.time],
            "probabilities": {
                name: [round(float(p), 4) for p in self.probabilities[:, k]]
                for k, name in enumerate(self.names)
            },
            "known": [bool(x) for x in self.known],
            "label": [str(x) for x in self.label],
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Timeline:
        """From ground.json; raises KeyError, TypeError or ValueError on anything else."""
        names = tuple(data["probabilities"])
        time = np.array(data["time"], dtype=float)
        table = np.array([data["probabilities"][name] for name in names], dtype=float).reshape(
            len(names), time.size
        )
        known, label = np.array(data["known"], dtype=bool), np.array(data["label"], dtype=object)
        if not len(known) == len(label) == time.size:
            raise ValueError("columns differ in length")
        return cls(time, names, table.T, known, label)


@dataclass(frozen=True)
class Ground:
    """The ground along one drive. `run`: its name; `soils`: those present for more than moments, none without a library; `events` with
    their reasons; `notes`: plain sentences for the user; `about`: the recording, and whether the analysis was `online`."""

    run: str
    start: float
    end: float
    soils: tuple[str, ...]
    changes: tuple[Change, ...]
    sections: tuple[Section, ...]
    events: tuple[Event, ...]
    timeline: Timeline
    notes: tuple[str, ...] = ()
    about: Mapping[str, Any] = field(default_factory=dict)

    def to_pandas(self) -> pd.DataFrame:
        """A row for each section, as in ground.json, with its duration ``seconds``; `views.table_of` makes one of events too."""
        from terragrip.ground.views import table_of

        return table_of(self.sections)

    def plot(self) -> Figure:
        """Soils over time with changes and events, as a matplotlib figure; raises InputError without matplotlib."""
        from terragrip.ground.views import plot

        return plot(self)

    def _repr_html_(self) -> str:
        from terragrip.ground.views import html_of

        return html_of(self)


def to_dict(grounds: Sequence[Ground], about: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """One object for all drives: `changes`, `sections`, `events` of all, each with its `run`; `runs`: the values of each whole drive."""
    return {
        "version": VERSION,
        **(about or {}),
        "changes": [{"run": g.run, **one.to_dict()} for g in grounds for one in g.changes],
        "sections": [{"run": g.run, **one.to_dict()} for g in grounds for one in g.sections],
        "events": [{"run": g.run, **one.to_dict()} for g in grounds for one in g.events],
        "runs": [
            {
                "run": g.run,
                "start": g.start,
                "end": g.end,
                "soils": list(g.soils),
                "notes": list(g.notes),
                **g.about,
                "timeline": g.timeline.to_dict(),
            }
            for g in grounds
        ],
    }


def write(
    grounds: Sequence[Ground], path: str | os.PathLike[str], about: Mapping[str, Any] | None = None
) -> None:
    """Write ground.json, whole or not at all; raises InputError if it cannot be written. It never contains NaN or infinities."""
    text = json.dumps(to_dict(grounds, about), allow_nan=False, ensure_ascii=False)
    with replacing(path) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")


def read(path: str | os.PathLike[str]) -> tuple[Ground, ...]:
    """Read ground.json, a `Ground` for each drive. Raises InputError: no such file, not JSON, a newer version, or not made by `write`."""
    file = os.fspath(path)
    data = read_json(file, "sections", VERSION, "'terragrip ground'")
    try:
        return tuple(_ground(one, data) for one in data["runs"])
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"is damaged ({error})", file=file, hint="write it again with 'terragrip ground'"
        ) from None


def _ground(one: Mapping[str, Any], data: Mapping[str, Any]) -> Ground:
    run = str(one["run"])

    def mine(key: str) -> list[dict[str, Any]]:
        return [{k: v for k, v in row.items() if k != "run"} for row in data[key] if row["run"] == run]

    known = {"run", "start", "end", "soils", "notes", "timeline"}
    return Ground(
        run,
        _finite(one["start"]),
        _finite(one["end"]),
        tuple(one["soils"]),
        tuple(Change.from_dict(row) for row in mine("changes")),
        tuple(Section(**row) for row in mine("sections")),
        tuple(Event(**row) for row in mine("events")),
        Timeline.from_dict(one["timeline"]),
        tuple(one["notes"]),
        {k: v for k, v in one.items() if k not in known},
    )


def _finite(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{value} is no time")
    return number
