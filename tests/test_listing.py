"""Tables that list logs, as spreadsheets of several countries save them."""

from __future__ import annotations

from pathlib import Path

import pytest

from terragrip.listing import listed_logs

COLUMNS = ("log", "profile", "drive")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "latin-1"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_separator_and_encoding_are_read(tmp_path: Path, separator: str, encoding: str) -> None:
    table = tmp_path / "drives.csv"
    rows = [("Log", "Drive"), ("böe.csv", "1"), ("", ""), ("b.csv", " 2 ")]
    table.write_bytes("".join(separator.join(row) + "\r\n" for row in rows).encode(encoding))
    assert listed_logs(table, COLUMNS) == [
        (2, {"log": "böe.csv", "drive": "1"}),
        (4, {"log": "b.csv", "drive": "2"}),
    ]


def test_what_a_short_row_lacks_is_empty(tmp_path: Path) -> None:
    table = tmp_path / "drives.csv"
    table.write_text("log,profile\na.csv\n")
    assert listed_logs(table, COLUMNS) == [(2, {"log": "a.csv", "profile": ""})]
