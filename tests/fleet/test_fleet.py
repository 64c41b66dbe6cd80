"""`terragrip fleet`: many logs into one data set, which grows by what is new."""

from __future__ import annotations

import errno
import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import terragrip as tg
from small_fleet import VEHICLE, call, fleet, furnished, whole, write_log
from terragrip.cli import main
from terragrip.cli.drives import logs_in
from terragrip.errors import InputError
from terragrip.estimation import Estimates
from terragrip.files import lock
from terragrip.fleet.cluster import Pool
from terragrip.fleet.dataset import known_notes, settled, write_tables
from terragrip.fleet.doubts import compared, unlike
from terragrip.fleet.logs import FleetLog, fleet_logs, on_disk
from terragrip.fleet.run import FleetResult
from terragrip.fleet.store import Store
from terragrip.fleet.tally import MEANS, impossible
from terragrip.fleet.task import Outcome, _attempt
from terragrip.ground.analysis import analyse

Ran = Callable[..., tuple[int, str, str]]


@pytest.fixture
def ran(
    place: Path,
    scheduler: str,
    undrawn: None,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> Ran:
    """Exit code, output and errors of a call that works with a scheduler which other tests have already started.

    Each soil is learned by the paper's form without asking whether another fits better, half of such a call's time: the fleet of two
    machines is asked, below, and tests/soil/test_choice.py.
    """
    monkeypatch.setattr("terragrip.soil.learn._compared", lambda *_: None)

    def run(*words: object) -> tuple[int, str, str]:
        code = main(call(place, *words, "--scheduler", scheduler))
        said = capsys.readouterr()
        return code, said.out, said.err

    return run


@pytest.fixture(scope="module")
def first_call(tmp_path_factory: pytest.TempPathFactory, scheduler: str) -> Path:
    """The data set of a call on the logs of `place`; not to be changed."""
    place = furnished(tmp_path_factory.mktemp("first_call"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terragrip.soil.learn._compared", lambda *_: None)  # as `ran`
        assert main(call(place, "--scheduler", scheduler, "--quiet")) == 0
    return place / "out"


@pytest.fixture
def estimated(place: Path, first_call: Path) -> Path:
    """`place/out`, as a first call left it: a log is known by its content, wherever it lies."""
    return shutil.copytree(first_call, place / "out")


def written(out: Path) -> dict[str, int]:
    """When each file of estimates was written."""
    return {path.name: path.stat().st_mtime_ns for path in (out / "estimates").rglob("*.parquet")}


def test_the_numbers_for_prometheus_are_those_of_the_data_set(place: Path, ran: Ran) -> None:
    (place / "logs/broken.csv").write_text("nothing of use\n")
    words = ("--vehicle", place / "Heros.yaml", "--metrics", place / "fleet.prom", "--quiet")
    code, _, errors = ran(*words)
    assert (code, errors) == (0, "")
    rows, reasons = whole(place / "out")
    page = dict(
        line.rsplit(" ", 1)
        for line in (place / "fleet.prom").read_text().splitlines()
        if not line.startswith("#")
    )
    assert int(page['terragrip_fleet_logs{state="estimated"}']) == len(rows)
    assert int(page['terragrip_fleet_logs{state="failed"}']) == len(reasons) == 1
    assert int(page["terragrip_fleet_rows"]) == pd.read_parquet(place / "out/summary.parquet")["rows"].sum()
    duration = float(page["terragrip_fleet_duration_seconds"])
    assert duration > 0
    of_log = []  # from the files of estimates themselves
    for path in (place / "out/estimates").rglob("*.parquet"):
        table = pd.read_parquet(path, partitioning=None)
        moves = table[table["event"] != "standstill"]
        of_log.append(moves["nis"].sum() / moves["channels"].sum())
    for quantile, name in ((0, "0"), (0.5, "0.5"), (0.9, "0.9"), (1, "1")):
        seen = float(page[f'terragrip_fleet_nis{{quantile="{name}"}}'])
        assert seen == pytest.approx(np.quantile(of_log, quantile))
    least, most = (float(page[f'terragrip_fleet_log_seconds{{quantile="{q}"}}']) for q in (0, 1))
    assert 0 < least <= most < duration
    assert sorted(pd.read_parquet(place / "out/summary.parquet")["nis"]) == pytest.approx(sorted(of_log))


def test_a_fleet_of_two_machines_and_three_days(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    index = place / "index.csv"
    index.write_text("log,vehicle\n" + "".join(f"drive{n}.csv,Thorvald.yaml\n" for n in (1, 4)))
    code = main(call(place, "--index", index, "--vehicle", place / "Heros.yaml"))
    said = capsys.readouterr()
    assert (code, said.err) == (0, "")
    assert "6 estimated, 0 unchanged, 0 failed" in said.out
    rows, reasons = whole(place / "out")
    assert (len(rows), reasons) == (6, {})

    # each log's rows are those of one log estimated alone, to the last digit
    alone = tg.estimate(tg.read(place / "logs/b/drive4.csv"), tg.Vehicle.load(place / "Thorvald.yaml"))
    (path,) = (place / "out/estimates/vehicle=Thorvald/day=2026-05-03").glob("*.parquet")
    table = pd.read_parquet(path, partitioning=None)
    for name in ("slip_l", "adhesion_r_std", "soil_resistance"):
        np.testing.assert_array_equal(table[name], alone[name])

    summary = pd.read_parquet(place / "out/summary.parquet").set_index("log")
    assert summary["vehicle"]["drive4.csv"] == "Thorvald"
    assert summary["day"].to_dict() == {f"drive{n}.csv": f"2026-05-0{1 + n // 2}" for n in range(6)}
    usable = alone["event"] == ""
    mean = np.mean([alone["slip_l"][usable], alone["slip_r"][usable]])
    assert summary["slip"]["drive4.csv"] == pytest.approx(mean, abs=1e-3)
    assert summary["distance"]["drive4.csv"] == pytest.approx(20.0, abs=0.2)

    # the line of docs/fleet.md
    every = pl.scan_parquet(
        place / "out/estimates/**/*.parquet",
        hive_partitioning=True,
        missing_columns="insert",
        extra_columns="ignore",
    )
    by_log = every.group_by("vehicle", "log").len().collect()
    assert by_log["len"].sum() == sum(rows.values())
    assert set(by_log.filter(pl.col("vehicle") == "Thorvald")["log"]) == {"drive1.csv", "drive4.csv"}

    soils = json.loads((place / "out/soils.json").read_text())["soils"]
    for soil in ("clay", "sand"):  # the drive's own curve, 0.5 (1 - exp(-12 s)), at the slips driven
        bins = [b for b in soils[soil]["bins"] if 0.05 < b["slip"] < 0.21]
        assert bins
        for one in bins:
            assert one["mean"] == pytest.approx(0.5 * (1 - np.exp(-12 * one["slip"])), abs=0.03)
    page = (place / "out/report.html").read_text()
    assert "6 logs of 2 vehicles on 3 days" in page
    assert "src=" not in page.replace('src="data:', "")


def test_the_report_says_which_logs_are_in_doubt(place: Path, ran: Ran) -> None:
    """A log in km/h has a note, and a mean slip that no machine can have counts in no mean."""
    log = place / "logs/b/drive4.csv"
    table = pd.read_csv(log)
    table["ground_speed"] *= 3.6
    table.to_csv(log, index=False)
    assert ran()[0] == 0
    page = (place / "out/report.html").read_text()
    row = page[page.index("ground_speed may be in km/h") - 400 : page.index("ground_speed may be in km/h")]
    assert "drive4.csv" in row
    summary = pd.read_parquet(place / "out/summary.parquet").set_index("log")
    assert "no machine has a mean slip -0." in summary.loc["drive4.csv", "left_out"]
    assert "drive4.csv" in page[page.index("Logs left out of the means") :]
    assert summary["slip"].min() > 0
    assert (summary["left_out"] != "").sum() == 1
    assert "drive4.csv" not in set(pd.read_parquet(place / "out/soils.parquet")["log"])


def test_a_way_downhill_without_a_pitch_is_named_as_a_cause() -> None:
    """7 % downhill with the engine braking has true adhesion -.035 and resistance -.035: 'no machine has' that was said."""
    row = dict.fromkeys(MEANS) | {"adhesion": -0.035, "soil_resistance": -0.035}
    assert "but downhill where no pitch is in the log" in impossible(row)


@pytest.mark.parametrize("mass", ["1 kg", "100 t"])
def test_a_log_with_another_machines_vehicle_file_counts_in_no_mean(place: Path, ran: Ran, mass: str) -> None:
    """A robot's log with a tractor's file had a mean adhesion of -0.11, as the ground pushed it all the way, and counted."""
    vehicle = place / "Heros.yaml"
    vehicle.write_text(vehicle.read_text().replace("100 kg", mass))
    code, out, _ = ran()
    assert code == 0
    assert "left out of means and curves: no machine has a mean adhesion" in out
    summary = pd.read_parquet(place / "out/summary.parquet")
    assert summary["adhesion"].isna().all()
    assert summary["left_out"].str.contains("check its vehicle file").all()


def test_a_second_call_does_what_is_new_or_changed_and_no_more(
    place: Path, estimated: Path, ran: Ran
) -> None:
    first = written(estimated)
    write_log(place / "logs/b/drive6.csv", 6)
    write_log(place / "logs/a/drive0.csv", 60)
    code, said, _ = ran()
    assert code == 0
    assert "2 estimated, 5 unchanged, 0 failed" in said
    second = written(estimated)
    assert {name for name in second if second[name] != first.get(name)} == {
        "drive0.csv.parquet",
        "drive6.csv.parquet",
    }
    # a machine that is another: all its logs anew, under its new name alone; a log that went is kept
    (place / "logs/b/drive6.csv").unlink()
    (place / "Heros.yaml").write_text(VEHICLE.format(name="Heros 2"))
    code, said, _ = ran()
    assert "6 estimated, 0 unchanged, 0 failed" in said
    assert "1 log of earlier calls is kept." in said
    rows, _ = whole(estimated)
    assert len(rows) == 7
    vehicles = pd.read_parquet(estimated / "summary.parquet").set_index("log")["vehicle"]
    assert vehicles.pop("drive6.csv") == "Heros"
    assert set(vehicles) == {"Heros 2"}


def test_a_log_that_cannot_be_read_stops_no_other_and_leaves_when_it_is_whole_again(
    place: Path, estimated: Path, ran: Ran
) -> None:
    broken = place / "logs/a/drive1.csv"
    content = broken.read_bytes()
    broken.write_bytes(b"\x00\xff" * 500)
    code, said, errors = ran()
    assert (code, errors) == (0, "")
    assert "0 estimated, 5 unchanged, 1 failed" in said
    rows, reasons = whole(estimated)
    assert len(rows) == 5
    assert list(reasons) == ["drive1.csv"]
    assert "drive1.csv" in reasons["drive1.csv"]
    broken.write_bytes(content)
    assert ran()[0] == 0
    rows, reasons = whole(estimated)
    assert (len(rows), reasons) == (6, {})


def test_estimates_of_the_fleet_are_no_logs_of_it(place: Path, ran: Ran) -> None:
    (place / "logs/b/note.txt").write_text("no log")
    out = place / "logs/out"
    for estimated in (6, 0):
        code, said, _ = ran(place / "logs/**/*", "--vehicle", place / "Heros.yaml", "-o", out)
        assert code == 0
        assert f"{estimated} estimated, {6 - estimated} unchanged, 1 failed" in said
    rows, reasons = whole(out)
    assert (len(rows), list(reasons)) == (6, ["note.txt"])


def test_the_table_and_its_vehicle_files_beside_the_logs_are_no_logs(place: Path) -> None:
    index = place / "index.csv"
    index.write_text("log,vehicle\n" + "".join(f"drive{n}.csv,Thorvald.yaml\n" for n in range(6)))
    files = on_disk(logs_in([place / "**/*"]), str(place / "out"))
    logs = fleet_logs(files, place / "Heros.yaml", None, index)
    assert sorted(log.name for log in logs) == [f"drive{n}.csv" for n in range(6)]


def test_a_copy_of_a_log_is_named(place: Path, estimated: Path, ran: Ran) -> None:
    log = place / "logs/a/drive1.csv"
    (log.parent / "drive1 (copy).csv").write_bytes(log.read_bytes())
    assert ran()[0] == 0
    summary = pd.read_parquet(estimated / "summary.parquet").set_index("log")
    assert list(summary.index[summary["left_out"] != ""]) == ["drive1.csv"]
    assert summary.loc["drive1.csv", "left_out"] == "a copy of drive1 (copy).csv"
    assert np.isnan(summary.loc["drive1.csv", "slip"])


def noted(log: str, vehicle: str, start: str, **means: float) -> dict[str, Any]:
    """A note of a log of 20 s, as far as logs are compared by it."""
    summary = {"vehicle": vehicle, "start": start, "duration": 20.0, "moving_time": 20.0, "notes": ""}
    return {"log": log, "content": log, "summary": {**summary, **dict.fromkeys(MEANS), **means}}


def test_drives_of_one_machine_that_overlap_are_named() -> None:
    """Two loggers of a drive, or two machines of one name; clocks of other zones are no other time."""
    starts = {
        "a": ("Heros", "2026-05-01T08:00:00+00:00"),
        "b": ("Heros", "2026-05-01T10:00:05+02:00"),
        "c": ("Heros", "2026-05-01T08:00:25+00:00"),
        "d": ("Thorvald", "2026-05-01T08:00:00+00:00"),
        "e": ("Heros", "2026-05-01T08:00:00+02:00"),
    }
    notes = compared([noted(log, *where) for log, where in starts.items()])
    said = {note["log"]: note["summary"]["notes"] for note in notes if note["summary"]["notes"]}
    assert list(said) == ["b"]
    assert "overlaps a by 15 s" in said["b"]


def test_a_vehicle_file_that_is_wrong_makes_its_machine_unlike_the_others() -> None:
    """Forty machines, one stated a tenth too large in radius, so that its slip is .21 for .13; not those that differ as machines do."""
    rng = np.random.default_rng(1)
    slips = {f"M{k}": 0.13 + 0.01 * rng.standard_normal() for k in range(40)} | {"M19": 0.21}
    rows = [one["summary"] for one in compared([noted(m, m, "", slip=s) for m, s in slips.items()])]
    assert list(unlike(rows)) == ["M19"]
    assert unlike(rows)["M19"].startswith("slip 0.21 (others 0.13")
    assert unlike(rows[12:21]) == {}, "too few to say what is usual"


Refused = Callable[..., str]


@pytest.fixture
def refused(place: Path, scheduler: str, capsys: pytest.CaptureFixture[str]) -> Refused:
    """The one line of a call that exits with 2 and leaves nothing behind."""

    def line(*words: object) -> str:
        where = () if "--scheduler" in words else ("--scheduler", scheduler)
        assert main(call(place, *words, *where)) == 2
        errors = capsys.readouterr().err
        assert errors.count("\n") == 1
        assert not (place / "out").exists()
        return errors

    return line


def test_nothing_matches(place: Path, refused: Refused) -> None:
    assert "no file matches" in refused(place / "logs/**/*.mcap")


def test_two_logs_of_one_name(place: Path, refused: Refused, ran: Ran) -> None:
    write_log(place / "logs/b/drive0.csv", 9)
    said = refused()
    assert "a/drive0.csv" in said
    assert "b/drive0.csv" in said
    index = place / "index.csv"
    index.write_text("log,name\nlogs/b/drive0.csv,drive0 of b\n")
    assert ran("--index", index, "--vehicle", place / "Heros.yaml")[0] == 0
    assert {"drive0.csv", "drive0 of b"} <= set(whole(place / "out")[0])


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("log,vehicle\ndrive0.csv,Heros.yaml\n", "names no vehicle for"),
        ("log,vehicle\ndrive9.csv,Heros.yaml\n", "no log is drive9.csv; did you mean drive"),
        ("log,machine\ndrive0.csv,Heros.yaml\n", "unknown column 'machine'"),
        ("log,vehicle\ndrive0.csv,Heroes.yaml\n", "did you mean Heros.yaml"),
        ("log,vehicle\ndrive0.csv,Heros.yaml\ndrive0.csv,Thorvald.yaml\n", "is listed twice"),
    ],
)
def test_an_index_that_does_not_fit(place: Path, refused: Refused, table: str, said: str) -> None:
    index = place / "index.csv"
    index.write_text(table)
    assert said in refused("--index", index)


def test_two_vehicles_of_one_name(place: Path, refused: Refused) -> None:
    (place / "Thorvald.yaml").write_text(VEHICLE.format(name="Heros").replace("100 kg", "120 kg"))
    index = place / "index.csv"
    index.write_text("log,vehicle\ndrive0.csv,Thorvald.yaml\n")
    assert "has the name 'Heros' of another vehicle" in refused(
        "--index", index, "--vehicle", place / "Heros.yaml"
    )


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("foo", "write e.g. tcp://host:8786"),
        ("http://x:1", "write e.g."),
        ("tcp://x:y", "write e.g."),
        ("tls://127.0.0.1:9", "certificates"),
    ],
)
def test_what_is_no_address_of_a_scheduler_is_one_line(
    place: Path, refused: Refused, address: str, said: str
) -> None:
    assert said in refused("--scheduler", address)


def test_a_full_disk_is_no_success(place: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each log's reason stands among the failures; a caller that looks at the exit code alone must see it too."""
    failed = {"drive0.csv": "kann nicht", "drive1.csv": "is damaged"}
    done = FleetResult(4, 0, failed, 1, 0, 0, 4000, 0, (1.0,), (0.1,))
    monkeypatch.setattr("terragrip.fleet.run.run_fleet", lambda *_, **__: done)
    code, _, errors = ran()
    assert (code, errors.count("\n")) == (2, 1)
    assert "the disk had no room for 1 of 6 logs" in errors


def test_that_logs_have_notes_is_said(place: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch) -> None:
    done = FleetResult(4, 0, {}, 0, 0, 2, 4000, 0, (1.0,), (0.1,))
    monkeypatch.setattr("terragrip.fleet.run.run_fleet", lambda *_, **__: done)
    assert "2 logs have notes, in the report" in ran()[1]


@pytest.mark.parametrize(
    ("error", "full"),
    [
        (OSError(errno.ENOSPC, "auf dem Gerät ist kein Platz mehr"), True),
        (OSError(errno.EDQUOT, "quota"), True),
        (OSError(errno.EFBIG, "larger than a file may be"), True),
        (OSError("Error writing bytes to file. Detail: [errno 28] whatever"), True),
        (OSError(errno.EACCES, os.strerror(errno.ENOSPC)), False),
        (InputError(f"holds the text {os.strerror(errno.ENOSPC)}"), False),
    ],
)
def test_a_full_disk_is_known_by_its_number_and_not_by_a_text(error: Exception, full: bool) -> None:
    log = FleetLog("drive0.csv", "drive0.csv", 1, "Heros", None, None)  # type: ignore[arg-type]

    def wrapped() -> None:
        raise InputError("cannot be written", file="0.parquet") from error

    def plain() -> None:
        raise error

    for step in (wrapped, plain):
        outcome = _attempt(log, step)
        assert isinstance(outcome, Outcome)
        assert outcome.disk_full is full


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.ESTALE])
def test_a_disk_or_network_that_is_lost_takes_no_earlier_estimates(
    place: Path, estimated: Path, ran: Ran, number: int
) -> None:
    """The machine's fault says nothing of a log: neither of one estimated anew (--smooth), nor of one as before."""

    def fails(*_: object) -> None:
        raise InputError("cannot be written", file="0.parquet") from OSError(number, os.strerror(number))

    logs = fleet_logs(
        on_disk(logs_in([place / "logs/**/*.csv"]), str(place / "out")), place / "Heros.yaml", None, None
    )
    store = Store.at(str(estimated))
    before, failed = known_notes(store)
    notes, reasons = settled(
        store,
        before,
        failed,
        [outcome for log in logs if isinstance(outcome := _attempt(log, fails), Outcome)],
    )
    assert len(notes) == len(reasons) == 6
    assert reasons["drive0.csv"].endswith("; its estimates of an earlier call are kept")
    assert "0 estimated, 6 unchanged, 0 failed" in ran()[1]


def test_a_result_that_is_lost_with_the_last_worker_does_not_stop_the_call() -> None:
    """It was done, and its worker gone before it was fetched: the call starts a worker, which does it again."""
    log = FleetLog("drive0.csv", "drive0.csv", 1, "Heros", None, None)  # type: ignore[arg-type]
    workers: dict[str, object] = {}

    class Future:
        key, status = "a", "finished"

        def result(self, timeout: float | None = None) -> list[Outcome]:
            assert workers or timeout is not None, "waits for ever"
            if not workers:
                raise TimeoutError
            return [Outcome("drive0.csv")]

    class Client:
        status = "running"

        def submit(self, *_: object, **__: object) -> Future:
            return Future()

        def scheduler_info(self, **_: object) -> dict[str, object]:
            return {"workers": workers}

        def wait_for_workers(self, *_: object, **__: object) -> None: ...

    pool = Pool(Client, "this machine", lambda: workers.update(anew=1))
    pool.connect(1.0)
    assert [one.log for one in pool.run([log], None, None)] == ["drive0.csv"]  # type: ignore[arg-type]


def test_maps_of_logs_with_positions(place: Path, ran: Ran) -> None:
    for number, name in enumerate(("mapped", "metres", "without")):
        path = write_log(place / f"fields/{name}.csv", number)
        if name != "without":
            table = pd.read_csv(path)
            table["latitude"], table["longitude"] = 51.0, 13.5 + table.index * 0.02 / 70100
            if name == "metres":
                table["latitude"] *= 111e3
            table.to_csv(path, index=False)
    logs = str(place / "fields/*.csv")
    assert ran(logs, "--map")[0] == 0
    summary = pd.read_parquet(place / "out/summary.parquet").set_index("log")
    assert "metres of a grid" in summary["no_map"]["metres.csv"]
    assert summary["no_map"]["without.csv"] == "has no positions"
    (file,) = (place / "out/cells").rglob("*.parquet")
    cells = pd.read_parquet(file, partitioning=None)
    assert set(cells["log"]) == {"mapped.csv"}
    assert set(cells["epsg"]) == {32633}
    assert len(cells) == summary["cells"]["mapped.csv"] > 15
    adhesion = pq.read_table(file, partitioning=None)["adhesion"]
    assert adhesion.null_count == cells["adhesion"].isna().sum(), "null, which sums pass over, not NaN"
    rows = pd.read_parquet(place / "out" / summary["file"]["mapped.csv"], partitioning=None)
    mean = rows[["slip_l", "slip_r"]].to_numpy()[rows["event"] == ""].mean()
    assert np.average(cells["slip"], weights=cells["count"]) == pytest.approx(mean, abs=0.003)

    assert "0 estimated, 3 unchanged" in ran(logs, "--map")[1]
    assert "3 estimated" in ran(logs)[1]
    assert not list((place / "out/cells").rglob("*.parquet"))


def test_sections_and_events_of_logs(place: Path, ran: Ran) -> None:
    """As `terragrip ground` finds them, a row each; a call without them takes them away again."""
    for number, name in enumerate(("driven", "stopped")):
        path = write_log(place / f"fields/{name}.csv", number)
        table = pd.read_csv(path)
        if name == "stopped":
            still = [c for c in table if c.startswith(("wheel", "ground", "drive", "drawbar"))]
            table.loc[300:600, still] = 0.0
        table.to_csv(path, index=False)
    logs = str(place / "fields/*.csv")
    assert ran(logs, "--ground")[0] == 0
    summary = pd.read_parquet(place / "out/summary.parquet").set_index("log")
    assert (summary["no_ground"] == "").all()
    for log, file in summary["file"].items():
        ground, _ = analyse(Estimates.read(place / "out" / file), run=str(log))
        for name, spans in (("sections", ground.sections), ("events", ground.events)):
            there = place / "out" / file.replace("estimates/", f"{name}/", 1)
            assert there.exists() == bool(spans)
            if spans:
                rows = pd.read_parquet(there, partitioning=None)
                assert list(rows["start"]) == [span.start for span in spans]
                assert list(rows["seconds"]) == [span.seconds for span in spans]
                assert set(rows["log"]) == {log}
    (events,) = [pd.read_parquet(one, partitioning=None) for one in (place / "out/events").rglob("stopped*")]
    assert "standstill" in set(events["kind"])
    assert events["why"].str.len().min() > 0

    assert "0 estimated, 2 unchanged" in ran(logs, "--ground")[1]
    assert "2 estimated" in ran(logs)[1]
    assert not [*(place / "out/events").rglob("*.parquet"), *(place / "out/sections").rglob("*.parquet")]


def test_a_scheduler_that_does_not_answer(place: Path) -> None:
    code, _, errors = fleet(place, "--scheduler", "tcp://127.0.0.1:9")
    assert (code, errors.count("\n")) == (2, 1)
    assert "no scheduler answers at tcp://127.0.0.1:9" in errors
    assert not (place / "out").exists(), "no empty folder with its lock"


def test_a_store_that_cannot_be_reached(place: Path, refused: Refused) -> None:
    assert "cannot be reached" in refused("nosuchstore://bucket/*.csv")
    assert "is not a store" in refused("-o", "nosuchstore://bucket/out")
    (place / "file").write_text("")
    assert "is a file, and a folder is needed" in refused("-o", place / "file")


@pytest.mark.skipif(os.geteuid() == 0, reason="NOT TESTED: root may write anywhere")
def test_a_folder_that_cannot_be_written(place: Path, refused: Refused) -> None:
    (place / "shut").mkdir(mode=0o500)
    assert "cannot be written" in refused("-o", place / "shut/out")


def test_a_second_call_on_one_folder_is_refused_while_the_first_works(place: Path, ran: Ran) -> None:
    out = place / "out"
    out.mkdir()
    held = lock(out / ".lock")
    assert held is not None
    code, _, errors = ran()
    assert (code, errors) == (
        2, f"terragrip: {out}: --output: another terragrip fleet is using it; wait until it ends, or name another folder\n",
    )  # fmt: skip
    os.close(held)
    assert ran()[0] == 0
    assert len(whole(out)[0]) == 6


@pytest.mark.parametrize("content", ['{"log": "dr', "[1, 2]", '{"log": "drive1.csv"}'])
def test_a_damaged_note_is_one_line_and_loses_nothing(estimated: Path, ran: Ran, content: str) -> None:
    (note,) = [one for one in (estimated / "state/logs").iterdir() if "drive1.csv" in one.read_text()]
    note.write_text(content)
    before = written(estimated)
    code, _, errors = ran()
    assert (code, errors.count("\n")) == (2, 1)
    assert f"{note}: is damaged; remove it" in errors
    assert written(estimated) == before
    note.unlink()
    assert "1 estimated, 5 unchanged, 0 failed" in ran()[1]
    assert len(whole(estimated)[0]) == 6


def test_logs_of_earlier_calls_do_not_leave_the_tables_in_silence(
    place: Path, estimated: Path, ran: Ran
) -> None:
    """Their notes are gone, and this call does not name them."""
    before = {path: path.read_bytes() for path in estimated.glob("[!.]*.*")}
    for note in (estimated / "state/logs").iterdir():
        note.unlink()
    some = (place / "logs/b/*.csv", "--vehicle", place / "Heros.yaml")
    code, _, errors = ran(*some)
    assert (code, errors.count("\n")) == (2, 1)
    assert "state/logs: lacks the notes of drive0.csv and 2 others" in errors
    assert {path: path.read_bytes() for path in estimated.glob("[!.]*.*")} == before
    assert "6 estimated, 0 unchanged, 0 failed" in ran()[1]
    assert len(whole(estimated)[0]) == 6


@pytest.mark.parametrize("name", ["soils.json", "report.html", "soils.parquet"])
def test_a_file_that_is_not_the_fleets_is_not_overwritten(place: Path, ran: Ran, name: str) -> None:
    out = place / "out"
    out.mkdir()
    (out / name).write_text("a season's work")
    code, _, errors = ran()
    assert (code, errors.count("\n")) == (2, 1)
    assert f"{name}: exists already, and is not a fleet data set" in errors
    assert (out / name).read_text() == "a season's work"
    assert not (out / "state/logs").exists()


def test_a_fleet_of_which_every_log_failed_goes_on(place: Path, ran: Ran) -> None:
    (place / "logs/a/broken.csv").write_text("nothing of use\n")
    words = (place / "logs/a/broken.csv", "--vehicle", place / "Heros.yaml")
    for _ in range(2):
        code, said, _ = ran(*words)
        assert code == 0
        assert "0 estimated, 0 unchanged, 1 failed" in said


def test_a_link_to_nothing_fails_alone(place: Path, ran: Ran) -> None:
    (place / "logs/b/gone.csv").symlink_to(place / "nowhere.csv")
    code, said, _ = ran(place / "logs/b/*.csv", "--vehicle", place / "Heros.yaml")
    assert code == 0
    assert "1 failed" in said
    assert "gone.csv: no such file" in said


def test_estimates_that_are_gone_or_cut_short_are_made_anew(estimated: Path, ran: Ran) -> None:
    files = sorted((estimated / "estimates").rglob("*.parquet"))
    files[0].unlink()
    files[1].write_bytes(files[1].read_bytes()[:200])
    assert "2 estimated, 4 unchanged, 0 failed" in ran()[1]
    assert len(whole(estimated)[0]) == 6


def test_what_a_killed_call_leaves_is_removed(place: Path, estimated: Path, ran: Ran) -> None:
    """Its lock, a worker's folder with half of a log, and a log whose estimates no note names yet."""
    (estimated / ".lock").touch()
    half = estimated / ".tmp/terragrip-fleet-1/drive.parquet"
    half.parent.mkdir(parents=True)
    half.write_bytes(b"PAR1")
    next((estimated / "state/logs").iterdir()).unlink()
    assert "1 estimated, 5 unchanged, 0 failed" in ran()[1]
    rows, reasons = whole(estimated)
    assert (len(rows), reasons) == (6, {})


def test_a_log_with_estimates_is_no_failure(place: Path, estimated: Path, ran: Ran) -> None:
    """A worker may have stored a log's note just before it was lost."""
    table = pa.table({"log": ["drive0.csv"], "reason": ["its worker was lost"]})
    pq.write_table(table, estimated / "failures.parquet")
    summary = pd.read_parquet(estimated / "summary.parquet")
    summary[summary["log"] != "drive0.csv"].to_parquet(estimated / "summary.parquet")
    assert ran(place / "logs/b/*.csv", "--vehicle", place / "Heros.yaml")[0] == 0
    rows, reasons = whole(estimated)
    assert (len(rows), reasons) == (6, {})


def test_a_log_whose_worker_was_lost_keeps_its_earlier_estimates(estimated: Path, ran: Ran) -> None:
    store = Store.at(str(estimated))
    before, failed = known_notes(store)
    lost = Outcome("drive0.csv", reason="no worker came back")
    broken = Outcome("drive1.csv", reason="is no log", refused=True)
    notes, reasons = settled(store, before, failed, [lost, broken])
    assert {note["log"] for note in notes} == {f"drive{k}.csv" for k in (0, 2, 3, 4, 5)}
    assert reasons["drive0.csv"] == "no worker came back; its estimates of an earlier call are kept"
    assert reasons["drive1.csv"] == "is no log"
    write_tables(store, notes, reasons)
    left = {path.name for path in (estimated / "estimates").rglob("*.parquet")}
    assert "drive0.csv.parquet" in left
    assert "drive1.csv.parquet" not in left
    assert set(known_notes(store)[1]) == {"drive0.csv", "drive1.csv"}, "both run last in the next call"
    assert "1 estimated, 5 unchanged, 0 failed" in ran()[1]
    assert whole(estimated)[1] == {}


def test_what_every_log_would_fail_by_is_refused_and_loses_nothing(
    place: Path, estimated: Path, ran: Ran, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = written(estimated)
    (place / "bad.dbc").write_text("no DBC")
    mistakes = (
        ("--dbc", place / "no.dbc"),
        ("--dbc", place / "bad.dbc"),
        ("--metrics", place / "no/m.prom"),
        ("--metrics", place / "logs/a/drive0.csv"),
    )
    for words in mistakes:
        code, _, errors = ran(*words)
        assert (code, errors.count("\n")) == (2, 1)
        assert str(words[1]) in errors
    monkeypatch.setattr("terragrip.__version__", "0.0.1")
    code, _, errors = ran()
    assert (code, errors.count("\n")) == (2, 1)
    assert "and 0.0.1 here; install the same version" in errors
    assert written(estimated) == before


def test_a_store_that_cannot_be_read_is_one_line(estimated: Path, ran: Ran) -> None:
    table = estimated / "failures.parquet"
    table.unlink()
    table.mkdir()
    code, _, errors = ran()
    assert code == 2
    assert errors.count("\n") == 1
    assert "cannot be read or written" in errors
