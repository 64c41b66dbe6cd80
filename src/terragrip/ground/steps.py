"""Steps of a drive: blocks put together until the vehicle has driven a share of its length.

A border is crossed wheel by wheel and then by the tool: over the vehicle's length, however long that takes. Changes are sought step by
step, so that a small robot and a tractor, slow or fast, see a border alike. Standing still makes no step.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from terragrip.arrays import Floats
from terragrip.soil.blocks import Blocks

A_LENGTH = 6
"""Steps in which vehicle and tool drive their own length; a step is at least one block."""
_SUMS, _FIRST, _LAST = ("rows", "usable"), ("number", "start"), ("end", "streak", "travelled")


def steps_of(
    blocks: Blocks, length: float, begin: float | None = None
) -> tuple[Blocks, Blocks, float | None]:
    """The steps of `length` [m] that blocks complete, the blocks left over, and where the step that these begin started [m].

    Only blocks that show the ground make steps, one ends where they do. `begin`: of the blocks left over before. 0 m: each block is a step.
    """
    spans: list[tuple[int, int]] = []
    first: int | None = None
    for k, (known, travelled) in enumerate(
        zip(blocks.known.tolist(), blocks.travelled.tolist(), strict=True)
    ):
        if not known:
            if first is not None:
                spans.append((first, k))
            first, begin = None, travelled
            continue
        first, begin = k if first is None else first, travelled if begin is None else begin
        if travelled - begin >= 0.999 * length:
            spans.append((first, k + 1))
            first, begin = None, travelled
    rest = blocks[len(blocks) if first is None else first :]
    return _spans_joined(blocks, spans), rest, begin


def _spans_joined(blocks: Blocks, spans: list[tuple[int, int]]) -> Blocks:
    """Blocks [first, after) of each span as one: means of what they show."""
    first, after = np.array(spans, dtype=np.int64).reshape(-1, 2).T
    inside = np.zeros(len(blocks), dtype=bool)
    for start, stop in spans:
        inside[start:stop] = True
    begin = np.concatenate(([0], np.cumsum(after - first)[:-1])).astype(np.int64)[: len(spans)]

    def total(values: Floats) -> Floats:
        return np.add.reduceat(values[inside], begin, axis=0) if spans else values[:0]

    out = {}
    for one in fields(Blocks):
        values = getattr(blocks, one.name)
        if one.name in _FIRST:
            out[one.name] = values[first]
        elif one.name in _LAST:
            out[one.name] = values[after - 1]
        elif one.name in _SUMS:
            out[one.name] = total(values)
        else:
            shown = np.isfinite(values)
            count = total(shown.astype(float))
            with np.errstate(invalid="ignore"):
                out[one.name] = total(np.where(shown, values, 0.0)) / np.where(count > 0, count, np.nan)
    return Blocks(**out)


def crossing_variance(step: float, way: float, seconds: float) -> float:
    """Variance [s²] of a change's time, since a border is crossed over the vehicle's length: it may be either end of that.

    `step` [m] of `steps_of`; `way` [m] driven in `seconds` about the change. 0 where blocks are steps, or nothing is driven.
    """
    return (0.5 * A_LENGTH * step * seconds / way) ** 2 if way > 0 else 0.0


def joined(one: Blocks, other: Blocks) -> Blocks:
    """The blocks of both, one after the other."""
    return Blocks(
        **{f.name: np.concatenate([getattr(one, f.name), getattr(other, f.name)]) for f in fields(Blocks)}
    )
