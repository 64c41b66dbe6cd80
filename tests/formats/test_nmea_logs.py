"""NMEA 0183: small files written with pynmea2 give back what was put in."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pynmea2
import pytest

from terragrip.errors import InputError
from terragrip.formats.reading import read_table
from test_logs import SPEED


def write_nmea(path: Path) -> Path:
    lines = []
    for k in range(100):
        clock = f"2359{30 + k // 10:02d}.{k % 10}0" if k < 300 else ""
        knots = SPEED[k] / (1852 / 3600)
        rmc = ("A", "5103.0000", "N", "01344.0000", "E", f"{knots:.6f}", "90.0", "211126", "", "")
        if k == 50:
            rmc = ("V", *rmc[1:])
        lines.append(str(pynmea2.RMC("GP", "RMC", (clock, *rmc))))
        gga = (
            clock,
            "5103.0000",
            "N",
            "01344.0000",
            "E",
            "4",
            "12",
            "0.8",
            "110.5",
            "M",
            "44.0",
            "M",
            "",
            "",
        )
        lines.append(str(pynmea2.GGA("GN", "GGA", gga)))
    lines[20] = lines[20].replace("01344", "01345")  # the checksum is wrong now
    path.write_text("\r\n".join(lines) + "\r\n")
    return path


def test_nmea_sentences(tmp_path: Path) -> None:
    table = read_table(write_nmea(tmp_path / "gnss.log"))
    speed = table.columns["ground_speed"]
    assert np.isfinite(speed).sum() == 98  # one without a fix, one damaged
    known = np.isfinite(speed)
    assert np.allclose(speed[known], SPEED[:100][np.isin(np.arange(100), [10, 50], invert=True)], atol=1e-5)
    assert np.allclose(table.columns["time"], np.arange(100) / 10)
    assert table.columns["latitude"][0] == pytest.approx(51.05)
    assert table.columns["altitude"][0] == 110.5
    assert {
        "1 sentences are damaged and were left out.",
        "1 sentences have no fix: their values are missing.",
    } <= set(table.notes)
    assert table.start == pytest.approx(1795305570.0)  # 2026-11-21 23:59:30 UTC


def test_speeds_without_a_time_are_counted(tmp_path: Path) -> None:
    """Of a receiver that sends VTG at 10 Hz and RMC at 1 Hz nine speeds of ten were left out, and nothing said so."""
    place = ("A", "5103.0000", "N", "01344.0000", "E", "2.0", "90.0", "211126", "", "")
    vtg = str(pynmea2.VTG("GP", "VTG", ("90.0", "T", "", "M", "2.0", "N", "3.7", "K", "A")))
    for often, expected in ((1, ()), (10, ("90 VTG sentences came between two times and were left out",))):
        lines = [
            line
            for k in range(10)
            for line in (str(pynmea2.RMC("GP", "RMC", (f"1200{k:02d}.00", *place))), *[vtg] * often)
        ]
        path = tmp_path / "gnss.nmea"
        path.write_text("\n".join(lines) + "\n")
        table = read_table(path)
        assert len(table.columns["ground_speed"]) == 10
        assert [note.partition(":")[0] for note in table.notes] == list(expected)


def test_what_a_receiver_reckons_without_satellites_is_no_measurement(tmp_path: Path) -> None:
    """Under trees it goes on by dead reckoning, by the wheels' speeds even: of that slip was made, without a word."""
    place = ("5103.0000", "N", "01344.0000", "E")
    for mode, quality, count in (("A", "1", 6), ("D", "4", 6), ("", "2", 6), ("E", "6", 3), ("S", "8", 3)):
        lines = []
        for k in range(6):
            now = mode if k > 2 else "A"
            clock, gga = (
                f"1200{k:02d}.00",
                (*place, quality if k > 2 else "4", "9", "1", "9", "M", "44", "M", "", ""),
            )
            rmc = ("A", *place, "2.0", "90.0", "211126", "", "", *[now] * (now != ""))
            lines.append(str(pynmea2.RMC("GN", "RMC", (clock, *rmc))))
            lines.append(str(pynmea2.VTG("GN", "VTG", ("90.0", "T", "", "M", "2.0", "N", "3.7", "K", now))))
            lines.append(str(pynmea2.GGA("GN", "GGA", (clock, *gga))))
        (tmp_path / "gnss.nmea").write_text("\n".join(lines) + "\n")
        table = read_table(tmp_path / "gnss.nmea")
        assert np.isfinite(table.columns["ground_speed"]).sum() == count
        assert np.isfinite(table.columns["latitude"]).sum() == count
        expected = [] if count == 6 else ["9 sentences have no fix: their values are missing."]
        assert [note for note in table.notes if "fix" in note] == expected


def test_nmea_runs_past_midnight(tmp_path: Path) -> None:
    clocks = ("235959.50", "000000.00", "000000.50")
    gga = ("5103.0000", "N", "01344.0000", "E", "4", "12", "0.8", "110.5", "M", "44.0", "M", "", "")
    path = tmp_path / "gnss.nmea"
    path.write_text("\n".join(str(pynmea2.GGA("GN", "GGA", (clock, *gga))) for clock in clocks) + "\n")
    assert np.allclose(read_table(path).columns["time"], [0, 0.5, 1.0])


def test_a_log_without_any_sentence_of_ours(tmp_path: Path) -> None:
    path = tmp_path / "gnss.nmea"
    path.write_text("$GPGSV,1,1,00*79\n" * 5)
    with pytest.raises(InputError, match="no usable RMC, VTG or GGA"):
        read_table(path)


def test_a_position_that_two_sentences_of_an_instant_give_alike_is_no_repeat(tmp_path: Path) -> None:
    """Every receiver sends RMC and GGA of one instant; only a position that differs between them replaces one."""
    path = write_nmea(tmp_path / "log.nmea")
    assert not [note for note in read_table(path).notes if "repeat the time" in note]
    text = path.read_text().replace("\r\n", "\n").split("\n")
    sentence = text[61].split("*")[0].replace("5103.0000", "5103.0100")
    checksum = 0
    for letter in sentence[1:]:
        checksum ^= ord(letter)
    path.write_text("\n".join([*text[:61], f"{sentence}*{checksum:02X}", *text[62:]]))
    notes = read_table(path).notes
    assert "1 samples repeat the time of the one before with another value, and replace it." in notes
