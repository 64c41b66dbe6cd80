"""What is made of a table of estimates: summaries, figures, other files, progress; each figure worked out beside it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drives import MASS, RADIUS, drive, robot
from terragrip._kernel import lib
from terragrip.errors import InputError
from terragrip.estimation import Estimates, estimate, estimated, methods
from terragrip.estimation.batch import _Passes
from terragrip.estimation.calibration.plausible import completed_by_positions
from terragrip.estimation.columns import driven_of
from terragrip.estimation.converting import convert
from terragrip.estimation.driveline import DrivenMachine
from terragrip.estimation.engine import EVENTS, refusal
from terragrip.estimation.engine_torque import EngineTorque
from terragrip.estimation.export import SHEET_ROWS
from terragrip.estimation.export.rows_as_json import json_rows
from terragrip.estimation.forward import flag_before_gaps, table_of
from terragrip.estimation.provenance import about_recording
from terragrip.estimation.rims import Rim
from terragrip.estimation.summary import Tally
from terragrip.estimation.summary_text import _short, _time
from terragrip.recording import LogBlocks, Recording

GAP, STUCK = EVENTS.index("gap"), EVENTS.index("stuck")


def table(rows: int = 12, codes: dict[int, int] | None = None, **columns: Any) -> Estimates:
    """Two wheels at 2 Hz: slip .1 and .2, adhesion .3 and .5, each to .01."""
    time, one = 10.0 + 0.5 * np.arange(rows), np.ones(rows)
    known = {"distance": 0.75 * (time - 10.0), "ground_speed": 1.5 * one, "ground_speed_std": 0.02 * one}
    for wheel, k in (("l", 1), ("r", 2)):
        known |= {
            f"wheel_speed_{wheel}": 5.0 * one,
            f"slip_{wheel}": 0.1 * k * one,
            f"slip_{wheel}_std": 0.01 * one,
        }
        known |= {f"adhesion_{wheel}": (0.1 + 0.2 * k) * one, f"adhesion_{wheel}_std": 0.01 * one}
    event = np.zeros(rows, dtype=np.uint8)
    for row, code in (codes or {}).items():
        event[row] = code
    labels = {"soil": np.array((["clay"] * (rows // 2) + [""] * rows)[:rows], dtype=object)}
    about = {"method": "bank", "vehicle": {"name": "robot", "axles": {"a": {"wheels": ["l", "r"]}}}}
    return Estimates(time, known | columns, event, labels, about, ())


def test_methods_are_numbered_as_the_kernels_header_has_them() -> None:
    assert (methods.EXACT, methods.UNSCENTED) == (lib.TG_EXACT, lib.TG_UNSCENTED)
    policies = (methods.FIXED, methods.ADAPTIVE, methods.SUPERVISED, methods.BANK)
    assert policies == (lib.TG_FIXED, lib.TG_ADAPTIVE, lib.TG_SUPERVISED, lib.TG_BANK)
    assert (methods.FILTERED, methods.ALGEBRAIC, methods.SPEEDS) == (
        lib.TG_FILTERED,
        lib.TG_ALGEBRAIC,
        lib.TG_SPEEDS,
    )
    of = {name: (m.kind, m.engine, m.policy, m.supervisor) for name, m in methods.METHODS.items()}
    assert of["aukf"] == (lib.TG_FILTERED, lib.TG_UNSCENTED, lib.TG_ADAPTIVE, 0)
    assert of["aukf-fs-drive"] == (lib.TG_FILTERED, lib.TG_UNSCENTED, lib.TG_SUPERVISED, 1)
    assert {n for n, m in methods.METHODS.items() if m.adapts} == {"aukf", "aukf-fs", "aukf-fs-drive"}
    assert {n for n, m in methods.METHODS.items() if not m.can_smooth} == {"algebraic"}


def test_a_summary_by_label_sums_time_and_way_and_takes_medians_without_events() -> None:
    speed = np.arange(12.0)
    result = table(codes={2: STUCK, 5: GAP}, ground_speed=speed).summary(by="soil")
    assert result.loc["clay", "rows"] == 6
    assert result.loc["clay", "seconds"] == pytest.approx(2.5)  # a gap's row lasts nothing
    assert result.loc["clay", "metres"] == pytest.approx(2.25)
    assert result.loc["clay", "ground_speed"] == np.median([0, 1, 3, 4])
    assert result.loc["", "seconds"] == pytest.approx(2.5)
    assert result.loc["", "slip_r"] == pytest.approx(0.2)
    assert result.loc["", "slip_r_std"] == pytest.approx(0.01)
    by_event = table(codes={2: STUCK, 5: GAP}, ground_speed=speed).summary(by="event")
    assert by_event.loc["stuck", "ground_speed"] == 2.0
    assert by_event.loc["gap", "seconds"] == 0.0
    with pytest.raises(InputError, match="no label 'place'"):
        table().summary(by="place")


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("slope", np.radians(0.5), "0.5 deg"), ("drive_torque_offset", 0.31, "0.31 N m"), ("drawbar_offset", 12.3, "12 N"),
        ("acceleration_bias", 0.05, "0.05 m/s²"), ("tire_rolling_resistance", 0.005, "0.005"), ("wheel_radius", 0.0123, "1.2 %"),
    ],
)  # fmt: skip
def test_spreads_come_with_their_unit(name: str, value: float, words: str) -> None:
    assert _short(name, value) == words


def test_times_from_ten_minutes_on_are_in_minutes() -> None:
    assert [_time(x) for x in (0.04, 599.94, 600.0, 6000.0)] == ["0.0 s", "599.9 s", "10.0 min", "100.0 min"]


def test_a_long_tally_halves_its_sample_and_keeps_its_medians(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terragrip.estimation.summary._SAMPLE", 50)
    monkeypatch.setattr("terragrip.estimation.summary._MOST", 120)
    tally = Tally()
    for k in range(8):
        part = table(100, ground_speed=k + np.arange(100) / 100)
        tally.add(
            Estimates(part.time + 50.0 * k, part.columns, part.event_codes, part.labels, part.about, ())
        )
    columns = tally.columns
    assert 60 < len(columns["label"]) <= 120
    assert len(columns["label"]) == tally._sampled
    assert np.median(columns["ground_speed"]) == pytest.approx(4.0, abs=0.25)
    assert (tally.rows, tally.duration) == (800, 399.5)
    assert sum(tally.moving.values()) == pytest.approx(399.5)


def test_a_row_lasts_until_the_next_but_no_longer_than_a_gap() -> None:
    tally, part = Tally(), table(4)
    for start, labels in ((0.0, part.labels), (30.0, {})):
        tally.add(
            Estimates(
                start + np.array([0.0, 0.5, 9.0, 9.5]), part.columns, part.event_codes, labels, part.about, ()
            )
        )
    assert tally.moving == {"clay": pytest.approx(0.5 + 1.0), "": pytest.approx(0.5 + 1.0 + 0.5 + 1.0 + 0.5)}
    longer = Tally()
    longer.add(
        Estimates(
            np.array([0.0, 0.5, 9.0, 9.5]),
            part.columns,
            part.event_codes,
            {},
            {**part.about, "settings": {"gap": 4.0}},
            (),
        )
    )
    assert longer.moving == {"": pytest.approx(0.5 + 4.0 + 0.5)}


def test_a_figure_over_time_has_lines_intervals_and_stripes_where_they_belong() -> None:
    figure = table(codes={3: STUCK, 4: STUCK, 8: GAP}).plot("time")
    speed, slip, adhesion = figure.axes
    assert [a.get_ylabel() for a in figure.axes] == ["ground speed [m/s]", "slip [–]", "adhesion [–]"]
    right = slip.get_lines()[1]
    np.testing.assert_allclose(
        right.get_xydata(), np.column_stack([10.0 + 0.5 * np.arange(12), np.full(12, 0.2)])
    )
    band = slip.collections[1].get_paths()[0].get_extents()
    assert (band.ymin, band.ymax) == pytest.approx((0.2 - 0.0196, 0.2 + 0.0196), abs=1e-6)
    stripes = [(p.get_x(), p.get_x() + p.get_width()) for p in adhesion.patches]
    assert stripes == [(11.5, 12.0), (14.0, 14.0)]
    assert [t.get_text() for t in speed.get_legend().get_texts()] == ["stuck", "gap"]
    assert slip.get_ylim() == pytest.approx((0.1 - 0.035, 0.2 + 0.035))
    assert speed.get_ylim() == pytest.approx((1.48, 1.52))
    plane = table(codes={3: STUCK}).plot("plane").axes[0]
    assert plane_points(plane) == [(0.1, 0.3)] * 11 + [(0.2, 0.5)] * 11
    across, up = (line.get_xydata().tolist() for line in plane.get_lines() if line.get_marker() != ".")
    assert (across, up) == ([[0, 0], [1, 0]], [[0, 0], [0, 1]])  # both axes, in shares of the figure


def plane_points(axes: Any) -> list[tuple[float, float]]:
    points = np.concatenate([line.get_xydata() for line in axes.get_lines() if line.get_marker() == "."])
    return sorted((round(float(x), 6), round(float(y), 6)) for x, y in points)


def test_a_map_is_in_metres_from_its_first_position_and_shows_the_wheels_mean() -> None:
    place = {"latitude": 1e-5 * np.arange(12), "longitude": np.r_[np.nan, np.zeros(11)]}
    axes = table(**place).plot("map", "slip").axes[0]
    points = axes.collections[0]
    np.testing.assert_allclose(
        points.get_offsets(), np.column_stack([np.zeros(11), 1.10574 * np.arange(11)]), atol=1e-3
    )
    np.testing.assert_allclose(points.get_array(), 0.15)


def test_estimates_say_whether_they_are_smoothed() -> None:
    log = drive(1.0).recording
    assert [bool(estimate(log, robot(), smooth=smooth).about.get("smooth")) for smooth in (False, True)] == [
        False,
        True,
    ]


def test_a_file_is_converted_with_its_progress(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("terragrip.estimation.converting.ROWS", 40)
    result = estimate(drive(1.0).recording, robot())
    result.write(tmp_path / "e.parquet")
    done: list[tuple[int, int]] = []
    convert(tmp_path / "e.parquet", tmp_path / "e.csv", lambda *rows: done.append(rows))
    assert done == [(40, 100), (80, 100), (100, 100)]
    convert(tmp_path / "e.parquet", tmp_path / "again.csv")
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "e.csv").read_bytes()


def test_a_latitude_alone_is_no_place(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    table(latitude=np.ones(12)).write(tmp_path / "e.mcap")
    with (tmp_path / "e.mcap").open("rb") as stream:
        topics = {channel.topic for _, channel, _ in make_reader(stream).iter_messages()}
    assert topics == {"/terragrip/estimate"}


def test_rows_as_json_leave_nothing_out_and_nan_as_null() -> None:
    part = table(2, adhesion_l=np.array([0.25, np.nan]))
    assert list(json_rows(part, ("time", "adhesion_l", "event", "soil"))) == [
        '{"time":10.0,"adhesion_l":0.25,"event":"","soil":"clay"}', '{"time":10.5,"adhesion_l":null,"event":"","soil":""}',
    ]  # fmt: skip
    assert SHEET_ROWS == 2**20


@pytest.mark.parametrize(
    "name", [name for name in dir(lib) if name.startswith(("TG_BAD_", "TG_NOT_", "TG_TIME_", "TG_DIVERGED"))]
)
def test_a_status_of_the_kernel_is_told_in_words(name: str) -> None:
    assert not str(refusal(getattr(lib, name), None)).startswith("status ")


def test_one_profile_stands_alone_and_several_in_a_list() -> None:
    def profile(*profiles: dict[str, Any]) -> Any:
        return about_recording(Recording(np.arange(2.0), {}, profiles=profiles)).get("profile")

    assert profile() is None
    assert profile({"name": "a"}) == {"name": "a"}
    assert profile({"name": "a"}, {"name": "b"}) == [{"name": "a"}, {"name": "b"}]


def test_progress_counts_over_all_passes_and_never_beyond_the_rows() -> None:
    seen: list[tuple[int, int]] = []
    passes = _Passes(lambda *done: seen.append(done), 10, 3)
    for tell, rows in ((passes.of(0), 4), (passes.of(1), 10), (passes.of(2), 99)):
        tell(rows)
    assert seen == [(4, 30), (20, 30), (30, 30)]
    _Passes(None, 10, 3).of(0)(4)
    log, done = drive(2.0).recording, []
    list(estimated(LogBlocks.of(log, 90), robot(), progress=lambda *rows: done.append(rows)))
    assert done[-1] == (200, 200)
    assert [rows for rows, _ in done] == sorted(rows for rows, _ in done)


def test_columns_stand_in_an_odd_number_of_cache_lines() -> None:
    for rows, lines in ((1, 1), (8, 1), (9, 3), (17, 3), (25, 5)):
        made = table_of(("a", "b"), rows)
        assert made["a"].shape == (rows,)
        assert made["b"].ctypes.data - made["a"].ctypes.data == 64 * lines


@pytest.mark.parametrize(
    ("codes", "flagged"),
    [([0, 0, GAP, GAP, 0], [0, GAP, GAP, GAP, 0]), ([GAP, 0, STUCK, GAP, 0], [GAP, 0, GAP, GAP, 0])],
)
def test_the_row_before_a_gap_is_flagged_across_blocks_too(codes: list[int], flagged: list[int]) -> None:
    event, before = np.array(codes, dtype=np.uint8), np.zeros(3, dtype=np.uint8)
    flag_before_gaps(event, before)
    assert event.tolist() == flagged
    assert before.tolist() == [0, 0, GAP if codes[0] == GAP else 0]


def test_a_vehicle_that_the_kernel_refuses_is_refused_in_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    from terragrip.estimation import estimator, settings

    def wrong(of: Callable[..., Any]) -> Callable[..., Any]:
        def settings_of(*args: Any, **more: Any) -> Any:
            made = of(*args, **more)
            made.machine.mass = -1.0
            return made

        return settings_of

    monkeypatch.setattr(estimator, "settings_of", wrong(settings.settings_of))
    with pytest.raises(InputError, match="the estimator cannot work with this vehicle"):
        estimate(drive(1.0).recording, robot())


@pytest.mark.parametrize(("dead_band", "shown"), [(0.0, 0.0), (0.3, np.nan)])
def test_a_drives_speed_of_zero_is_unknown_where_it_has_a_dead_band(dead_band: float, shown: float) -> None:
    line = {"driveline": {"efficiency": 0.8, "accessory_power": 0.0, "ratio": 50.0}}
    rim = Rim("drive", "wheel_based_speed", 0.2, 0.21, 0.01, 0.0)
    one = DrivenMachine(
        robot(**line), ("wheel_based_speed", "ground_speed"), EngineTorque(None, 0.0), rim, dead_band
    )
    given = {"wheel_based_speed": np.array([0.0, 1.0, 2.0]), "ground_speed": np.ones(3), "engine_speed": np.full(3, 200.0),
             "engine_torque": np.full(3, 10.0)}  # fmt: skip
    columns, torque = one.converted(np.arange(3.0), given, 1)
    np.testing.assert_allclose(columns["wheel_speed_driven"], [5.0, 10.0])
    np.testing.assert_allclose(torque.torque, 50 * 0.8 * 10.0)
    columns, _ = one.converted(np.arange(3.0), given, 0)
    np.testing.assert_array_equal(columns["wheel_speed_driven"], [shown, 5.0, 10.0])
    assert set(columns) == {"wheel_speed_driven", "drive_torque_driven", "ground_speed"}
    assert one.together == 4
    assert one.vehicle.mass == MASS
    assert one.radius("driven") == 0.21 != RADIUS


def test_positions_add_a_yaw_rate_and_a_slope_where_no_sensor_does() -> None:
    time = np.arange(0.0, 60.0, 0.2)
    place = {"latitude": time * 2.0 / 110_574.3, "longitude": 0 * time, "altitude": 0.05 * 2.0 * time}
    added, notes = completed_by_positions(Recording(time, place))
    assert notes == ["The rate of turn is that of the positions; the slope is that of the altitude."]
    assert np.nanmedian(added["pitch"]) == pytest.approx(np.arctan(0.05), rel=0.01)
    np.testing.assert_allclose(added["angular_velocity_z"][20:-20], 0.0, atol=1e-9)
    level = {n: v for n, v in place.items() if n != "altitude"}
    assert completed_by_positions(Recording(time, level))[1] == ["The rate of turn is that of the positions."]
    sensed = Recording(time, {**place, "angular_velocity_z": 0 * time})
    assert completed_by_positions(sensed)[1] == ["The slope is that of the altitude."]
    whole = Recording(time, {**place, "angular_velocity_z": 0 * time, "pitch": 0 * time})
    assert completed_by_positions(whole) == (whole, [])
    still = Recording(time, {"latitude": 0 * time, "longitude": 0 * time})
    assert completed_by_positions(still) == (still, [])


def test_driven_wheels_are_those_whose_axle_is_not_stated_to_roll_freely() -> None:
    front, rear = {"wheels": ["fl", "fr"]}, {"wheels": ["rl", "rr"]}
    wheels = ("fl", "fr", "rl", "rr")
    for front_drives, rear_drives, driven in (
        (False, True, wheels[2:]),
        (True, False, wheels[:2]),
        (False, False, wheels),
    ):
        axles = {"front": {**front, "driven": front_drives}, "rear": {**rear, "driven": rear_drives}}
        assert driven_of(wheels, {"vehicle": {"axles": axles}}) == driven
    assert driven_of(wheels, {"vehicle": {"axles": {"front": front, "rear": rear}}}) == wheels
    assert driven_of(wheels, {}) == wheels
