"""Read a log of any known format."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from terragrip.errors import InputError
from terragrip.files import refuse_missing, unreadable
from terragrip.formats.csv import SUFFIXES, read_csv
from terragrip.formats.parquet import MAGIC, read_parquet
from terragrip.formats.profile import Profile
from terragrip.formats.table import LogTable, Wanted
from terragrip.recording import Recording, checks
from terragrip.recording.schema import LABELS, TIME, is_channel, unit_of
from terragrip.units import UnitError, factor_to


def read(path: str | os.PathLike[str], profile: Profile | str | os.PathLike[str] | None = None) -> Recording:
    """Read a log (CSV and its cousins, plain or gzipped, or Parquet) as a Recording.

    Without a profile the columns must have the recording's own names; a unit that the file itself states
    (``ground_speed [km/h]``, or a row of units) is converted. With a `Profile`, or the path of one, the columns
    become what it says. Raises InputError with file, column, row and mend for whatever makes the log unusable.
    """
    if profile is not None:
        chosen = profile if isinstance(profile, Profile) else Profile.load(profile)
        sources = chosen.sources
        return chosen.apply(read_table(path, wanted=lambda name: name in sources))
    table = read_table(path, wanted=lambda name: name == TIME or name in LABELS or is_channel(name))
    checks.require_columns(table.names, table.source)
    columns = dict(table.columns)
    for name, unit in table.units.items():
        target = unit_of(name)
        if target is None or name not in columns or columns[name].dtype.kind not in "fiu":
            continue
        try:
            factor = factor_to(unit, target)
        except UnitError as error:
            raise InputError(
                error.problem, file=table.source, place=f"column {name}", mend=error.mend
            ) from error
        if factor != 1.0:
            columns[name] = columns[name] * np.float64(factor)
    notes = [*table.notes, *checks.remarks(table.names)]
    return Recording.from_frame(columns, table.source, sha256=table.sha256, notes=notes)


def read_table(path: str | os.PathLike[str], wanted: Wanted | None = None) -> LogTable:
    """Read the ``wanted`` columns of a log by their own names (None: all); raises InputError if it is no table."""
    refuse_missing(path, suffixes=(*SUFFIXES, ".parquet"))
    try:
        with Path(path).open("rb") as stream:
            magic = stream.read(4)
    except OSError as error:
        raise unreadable(path, error) from error
    return read_parquet(path, wanted) if magic == MAGIC else read_csv(path, wanted)
