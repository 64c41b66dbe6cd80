"""Which columns are comparable between grounds: what one ground lacks would mark it by its absence."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from terragrip.ground.classification.channels import BODY, CURRENT, PREFIXES, TORQUE, Columns


def not_comparable(
    tables: Sequence[Columns], codes: npt.NDArray[np.intp]
) -> tuple[tuple[str, ...], list[str]]:
    """Beginnings of columns to leave out, both in learning and in telling, and a note on each.

    ``codes`` (tables,): the ground of each. Torque and current are two quantities, of which one cannot be told from what was
    learnt of the other: what fewer grounds hold is left out. So is an axis of a body sensor that some ground lacks.
    """

    def grounds(*begin: str) -> set[int]:
        holding = [
            any(n.startswith(begin) and np.isfinite(v).any() for n, v in t.values.items()) for t in tables
        ]
        return {int(code) for code, holds in zip(codes, holding, strict=True) if holds}

    left_out: tuple[str, ...] = ()
    notes = []
    torque, current = grounds(*TORQUE), grounds(*CURRENT)
    if torque or current:
        used, other = (TORQUE, CURRENT) if len(torque) >= len(current) else (CURRENT, TORQUE)
        left_out += other
        if torque and current:
            notes.append(f"{other[0]}*: not used, as {used[0]}* is another quantity.")
    everywhere = set(codes.tolist())
    for family in BODY:
        lacking = [axis for axis in PREFIXES[family] if grounds(axis) not in (set(), everywhere)]
        if any(grounds(axis) == everywhere for axis in PREFIXES[family]):
            left_out += tuple(lacking)
            notes += [f"{axis}: not measured on every ground, so not used." for axis in lacking]
    return left_out, notes


def without(table: Columns, left_out: tuple[str, ...]) -> Columns:
    """The table without the columns that begin so."""
    return table._replace(values={n: v for n, v in table.values.items() if not n.startswith(left_out)})
