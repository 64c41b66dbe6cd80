"""An Excel workbook: the rows, what each column means, and what the table was made from, a sheet each."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from terragrip.estimation.columns import column_named
from terragrip.estimation.export.about import about_rows
from terragrip.files import UNFINISHED
from terragrip.recording.clock import clock_times

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates

CLOCK = "clock (UTC)"


class Spreadsheet:
    """Sheets ``estimates`` (clock time in its second column where the log has it), ``columns`` and ``about``; missing: an empty cell."""

    def __init__(self, path: Path, first: Estimates, target: Path) -> None:
        import xlsxwriter

        # Rows go to disk as they come, so that a long sheet needs no memory.
        self._sheets = TemporaryDirectory(dir=path.parent, prefix=UNFINISHED)
        self._book = xlsxwriter.Workbook(path, {"constant_memory": True, "tmpdir": self._sheets.name})
        self._bold = self._book.add_format({"bold": True})
        self._date = self._book.add_format({"num_format": "yyyy-mm-dd hh:mm:ss.000"})
        self._sheet = self._book.add_worksheet("estimates")
        self._names, self._row = first.names, 1
        self._has_clock = first.start is not None
        heads = [self._names[0], *([CLOCK] if self._has_clock else []), *self._names[1:]]
        self._sheet.freeze_panes(1, 1 + self._has_clock)
        self._sheet.set_column(0, len(heads) - 1, 12)
        if self._has_clock:
            self._sheet.set_column(1, 1, 24)
        self._sheet.write_row(0, 0, heads, self._bold)
        meanings = [(name, *column_named(name)) for name in self._names]
        self._list("columns", [("column", "unit", "description"), *meanings], (26, 8, 80))
        self._list("about", [("what", "value"), *about_rows(first)], (26, 100))

    def _list(self, title: str, rows: list[tuple[str, ...]], widths: tuple[int, ...]) -> None:
        sheet = self._book.add_worksheet(title)
        for column, width in enumerate(widths):
            sheet.set_column(column, column, width)
        for number, row in enumerate(rows):
            for column, text in enumerate(row):
                sheet.write_string(number, column, text[:32_767], None if number else self._bold)

    def write(self, part: Estimates) -> None:
        """Write the rows of a part."""
        columns: list[Any] = [part[name].tolist() for name in self._names]
        clock = clock_times(part.time, part.start).tolist() if part.start is not None else None
        sheet, row, place = self._sheet, self._row, 1 + self._has_clock
        for number, cells in enumerate(zip(*columns, strict=True)):
            sheet.write_number(row, 0, cells[0])
            if self._has_clock and clock is not None:
                sheet.write_datetime(row, 1, clock[number], self._date)
            for column, cell in enumerate(cells[1:], place):
                if isinstance(cell, str):
                    if cell:
                        sheet.write_string(row, column, cell)
                elif math.isfinite(cell):
                    sheet.write_number(row, column, cell)
            row += 1
        self._row = row

    def close(self) -> None:
        """Pack the sheets into the file."""
        self._book.close()
        self._sheets.cleanup()

    def drop(self) -> None:
        """Nothing is packed, and nothing left."""
        self._book.fileclosed = True
        for sheet in self._book.worksheets():
            with suppress(OSError):  # what it still holds finds no room either
                sheet.row_data_fh.close()
        self._sheets.cleanup()
