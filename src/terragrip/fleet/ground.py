"""A log's sections of ground and its events with their reasons, as tables for a fleet's data set."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from terragrip.estimation import Estimates
from terragrip.ground.analysis import analyse

if TYPE_CHECKING:
    import pyarrow as pa

    from terragrip.ground.span import Span


def ground_of_log(path: str | os.PathLike[str], log: str) -> dict[str, pa.Table]:
    """The ``sections`` and ``events`` of a file of estimates, as `terragrip ground` finds them without a soil library.

    A row holds the ``log``, the fields of a `terragrip.ground.sections.Section` or `terragrip.ground.events.Event` except those by wheel
    or soil, and its duration ``seconds``. Without sections or events that table is missing. Raises InputError if the estimates do not
    suffice to find sections.
    """
    ground, _ = analyse(Estimates.read(path), run=log)
    tables = {"sections": _table(ground.sections, log), "events": _table(ground.events, log)}
    return {name: table for name, table in tables.items() if table is not None}


def _table(spans: Sequence[Span], log: str) -> pa.Table | None:
    import pyarrow as pa

    if not spans:
        return None
    types = {"str": pa.string(), "int": pa.int64()}
    columns: dict[str, pa.Array] = {"log": pa.array([log] * len(spans))}
    for name, kind in type(spans[0]).__annotations__.items():
        if not kind.startswith("Mapping"):
            columns[name] = pa.array([getattr(span, name) for span in spans], types.get(kind, pa.float64()))
    return pa.table({**columns, "seconds": pa.array([span.seconds for span in spans])})
