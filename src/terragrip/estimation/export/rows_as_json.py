"""Rows of estimates as JSON objects, digits and all."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from math import isfinite
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


_ROWS = 5000  # as texts at a time: each cell is an object


def json_rows(part: Estimates, names: Sequence[str]) -> Iterator[str]:
    """Each row's named columns as a JSON object; what is missing is null."""
    template = "{" + ",".join(f"{json.dumps(name).replace('%', '%%')}:%s" for name in names) + "}"
    for first in range(0, len(part), _ROWS):
        rows = part.select(slice(first, first + _ROWS))
        yield from (template % row for row in zip(*(_cells(rows[name]) for name in names), strict=True))


def _cells(values: Any) -> list[str]:
    if values.dtype.kind == "O":
        known = {text: json.dumps(text, ensure_ascii=False) for text in set(values.tolist())}
        return [known[text] for text in values.tolist()]
    return [repr(value) if isfinite(value) else "null" for value in values.tolist()]
