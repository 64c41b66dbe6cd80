"""Estimate a fleet's logs into its data set."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from terragrip.errors import InputError
from terragrip.estimation.methods import DEFAULT
from terragrip.fleet.cluster import check_address, default_workers, workers_at
from terragrip.fleet.curves import learn_curves
from terragrip.fleet.dataset import (
    REPORT,
    SOILS,
    Note,
    known_notes,
    settled,
    write_tables,
    write_text,
)
from terragrip.fleet.doubts import compared, unlike
from terragrip.fleet.logs import FleetLog
from terragrip.fleet.page import report_of
from terragrip.fleet.store import TEMPORARY, Store
from terragrip.fleet.task import Outcome, Settings
from terragrip.formats.can.catalog import catalog
from terragrip.log_events import emit

logger = logging.getLogger("terragrip.fleet")


@dataclass(frozen=True)
class FleetResult:
    """What a call did. ``estimated``: logs estimated now; ``unchanged``: logs whose estimates from an earlier call still hold; ``failed``:
    reasons by log, ``unwritten`` of them for lack of disk space; ``kept``: logs of earlier calls that this one did not name; ``noted``:
    logs named now whose estimates have notes. Of the logs
    estimated now: ``rows``, ``restarts`` of the filter, and of each log ``nis`` over its expected value and the ``seconds`` of a worker.
    Of the data set, ``left_out``: logs that means and curves do not count, with the reason; ``unlike``: machines with the means in which
    they are far from the others."""

    estimated: int
    unchanged: int
    failed: dict[str, str]
    unwritten: int
    kept: int
    noted: int
    rows: int
    restarts: int
    nis: tuple[float, ...]
    seconds: tuple[float, ...]
    left_out: dict[str, str] = field(default_factory=dict)
    unlike: dict[str, str] = field(default_factory=dict)


def run_fleet(
    logs: Sequence[FleetLog],
    output: str,
    method: str = DEFAULT,
    *,
    smooth: bool = False,
    dbc: Sequence[Path] = (),
    scheduler: str | None = None,
    workers: int | None = None,
    memory: str | None = None,
    maps: bool = False,
    ground: bool = False,
    progress: Callable[[int, int], None] | None = None,
) -> FleetResult:
    """Estimate logs into a data set (docs/fleet.md). Logs that it already holds with the same settings are left as they are.

    Parameters
    ----------
    logs: from `fleet_logs`.
    output: a folder, or the address of a store that fsspec knows.
    method, smooth, dbc: as for :func:`terragrip.from_log.estimate_file`.
    scheduler: address of a Dask scheduler; None: ``workers`` processes on this machine, each with ``memory`` ("2GB"; None: an equal share).
    maps: also map each log that has positions (`terragrip.fleet.extra`).
    ground: also find each log's sections and events (`terragrip.fleet.extra`).
    progress: called with the number of finished logs and of all.

    Raises
    ------
    InputError: a DBC file cannot be read; the output cannot be read or written; another call is using it; a worker has another version
        of Terragrip; the scheduler or all its workers are lost (the tables are written before). A log that cannot
        be estimated raises nothing; it is listed among the failures.
    """
    from terragrip import __version__

    if scheduler is not None:
        check_address(scheduler)
    for file in {*map(str, dbc), *(file for log in logs if log.profile for file in log.profile.dbc)}:
        catalog([file])  # a damaged one would fail every log, and its earlier estimates would go
    store = Store.at(output)
    settings = Settings(
        method, smooth, tuple(str(path.absolute()) for path in dbc), __version__, maps, ground
    )
    emit(logger, "fleet_started", logs=len(logs))
    try:
        # A call without workers leaves no folder behind.
        with workers_at(scheduler, workers or default_workers(), memory) as pool, store.locked():
            before, failed = known_notes(store, [log.name for log in logs])
            outcomes, stopped = _outcomes(pool.run(logs, settings, store, failed), len(logs), progress)
            notes, reasons = settled(store, before, failed, outcomes)
            notes = compared(notes)
            _write(store, notes, reasons)
            if stopped is not None:
                raise stopped
    except OSError as error:
        raise InputError(
            f"cannot be read or written ({error})", file=output, hint="run again; finished logs are kept"
        ) from error
    result = _result(outcomes, notes, reasons)
    counts = {"estimated": result.estimated, "unchanged": result.unchanged, "failed": len(result.failed)}
    emit(logger, "fleet_ended", **counts, kept=result.kept, rows=result.rows, restarts=result.restarts)
    return result


def _outcomes(
    coming: Iterable[Outcome], logs: int, progress: Callable[[int, int], None] | None
) -> tuple[list[Outcome], InputError | None]:
    """The outcomes as they come; and, where the workers are lost, the error, so that the tables of what is done are still written."""
    outcomes: list[Outcome] = []
    try:
        for outcome in coming:
            outcomes.append(outcome)
            if outcome.note is None:
                emit(logger, "fleet_log_failed", log=outcome.log, reason=outcome.reason)
            if progress:
                progress(len(outcomes), logs + 1)
    except InputError as error:
        return outcomes, error
    return outcomes, None


def _result(outcomes: Sequence[Outcome], notes: Sequence[Note], reasons: Mapping[str, str]) -> FleetResult:
    named = {one.log for one in outcomes}
    fresh = [one.note["summary"] for one in outcomes if one.fresh and one.note is not None]
    return FleetResult(
        estimated=sum(one.fresh for one in outcomes),
        unchanged=sum(one.note is not None and not one.fresh for one in outcomes),
        failed={one.log: reasons[one.log] for one in outcomes if one.note is None},
        unwritten=sum(one.disk_full for one in outcomes),
        kept=sum(note["log"] not in named for note in notes),
        noted=sum(note["log"] in named and bool(note["summary"]["notes"]) for note in notes),
        rows=sum(one["rows"] for one in fresh),
        restarts=sum(one["restart_events"] for one in fresh),
        nis=tuple(one["nis"] for one in fresh if one["nis"] is not None),
        seconds=tuple(one.seconds for one in outcomes if one.fresh),
        left_out={note["log"]: why for note in notes if (why := note["summary"]["left_out"])},
        unlike=unlike([note["summary"] for note in notes]),
    )


def _write(store: Store, notes: Sequence[Note], reasons: Mapping[str, str]) -> None:
    """Write the tables, the report and the curves of all logs. Raises OSError if the store refuses."""
    curves = learn_curves(store, notes)
    write_tables(store, notes, reasons)
    write_text(store, REPORT, report_of(notes, reasons, curves))
    library = curves.pooled.library({"files": [note["file"] for note in notes if note["sample"]]})
    write_text(store, SOILS, json.dumps(library.to_dict(), indent=1, allow_nan=False) + "\n")
    store.remove(TEMPORARY)
