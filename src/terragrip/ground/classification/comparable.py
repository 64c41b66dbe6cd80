"""Which columns are comparable between grounds: what one ground lacks would mark it by its absence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from terragrip.ground.classification.channels import (
    BODY,
    CURRENT,
    FAMILIES,
    PREFIXES,
    SAME_RATE,
    TORQUE,
    Columns,
    Signals,
    shortest_period,
)


def not_comparable(
    tables: Sequence[Columns], codes: npt.NDArray[np.intp]
) -> tuple[tuple[str, ...], list[str]]:
    """Beginnings of columns to leave out, both in training and in prediction, and a note on each.

    ``codes`` (tables,): the ground of each. Torque and current are two quantities, of which one cannot be distinguished from what was
    learnt of the other: what fewer grounds, or recordings, hold is left out. So is an axis of a body sensor that some ground lacks.
    """

    def grounds(begin: str) -> list[int]:
        """The ground of each recording that holds such a column."""
        return [
            int(code)
            for code, table in zip(codes, tables, strict=True)
            if any(name.startswith(begin) and np.isfinite(v).any() for name, v in table.values.items())
        ]

    left_out: tuple[str, ...] = ()
    notes = []
    efforts = {begin: grounds(begin) for begin in (*TORQUE, *CURRENT)}
    if any(efforts.values()):
        used, other = sorted(efforts, key=lambda begin: (-len(set(efforts[begin])), -len(efforts[begin])))
        left_out += (other,)
        if efforts[other]:
            notes.append(f"{other}*: not used, as {used}* is another quantity.")
    everywhere = set(codes.tolist())
    for family in BODY:
        on = {axis: set(grounds(axis)) for axis in PREFIXES[family]}
        lacking = [axis for axis in on if on[axis] and on[axis] != everywhere]
        if everywhere in on.values():
            left_out += tuple(lacking)
            notes += [f"{axis}: not measured on every ground, so not used." for axis in lacking]
    return left_out, notes


def rates_apart(recorded: Sequence[Signals], codes: npt.NDArray[np.intp]) -> list[str]:
    """A note on each family of sensors that is sampled at one rate on one ground and at another on another."""
    notes = []
    for family in FAMILIES:
        by_ground: dict[int, list[float]] = {}
        for one, code in zip(recorded, codes.tolist(), strict=True):
            if family in one.families:
                by_ground.setdefault(code, []).append(shortest_period(one.families[family]))
        usual = [float(np.median(periods)) for periods in by_ground.values()]
        if usual and max(usual) > SAME_RATE * min(usual):
            rates = f"every {min(usual):.2g} s on one ground, every {max(usual):.2g} s on another"
            notes.append(f"{family}: sampled {rates}; what is learned from it may be the rate.")
    return notes


def without(table: Columns, left_out: tuple[str, ...]) -> Columns:
    """The table without the columns that begin so."""
    return table._replace(values={n: v for n, v in table.values.items() if not n.startswith(left_out)})
