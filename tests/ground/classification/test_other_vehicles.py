"""GroundClassifier on what other vehicles log: other wheels, axes and efforts, which differ between learning and telling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from classifier_drives import BODY, GROUNDS, drive, drives
from terragrip import GroundClassifier, InputError
from terragrip.ground.classification.labelled import read_labels

pytestmark = pytest.mark.usefixtures("small_forests")

TRAINED, HELD_OUT = range(1000, 1003), range(1010, 1012)


def learnt(tables: list[pd.DataFrame], labels: list[str]) -> GroundClassifier:
    return GroundClassifier(max_windows=80).fit(tables, labels)


def wheels_only(
    seeds: range, wheels: tuple[str, ...] = ("left", "right")
) -> tuple[list[pd.DataFrame], list[str]]:
    tables, labels = drives(seeds, wheels=wheels)
    return [table.drop(columns=BODY) for table in tables], labels


def with_current(table: pd.DataFrame, gain: float = 0.02, *, torque: bool = True) -> pd.DataFrame:
    torques = [c for c in table if c.startswith("drive_torque")]
    currents = {c.replace("drive_torque", "motor_current"): gain * table[c] for c in torques}
    return table.assign(**currents).drop(columns=[] if torque else torques)


def test_an_axis_that_one_ground_lacks_is_not_its_mark() -> None:
    tables, labels = drives(TRAINED)
    tables = [
        t.drop(columns="acceleration_z") if g == "wet" else t for t, g in zip(tables, labels, strict=True)
    ]
    result = learnt(tables, labels)
    assert any("acceleration_z" in note for note in result.notes_)
    shown, truth = drives(HELD_OUT)
    assert result.score(shown, truth) > 0.9
    assert result.score([t.drop(columns="acceleration_z") for t in shown], truth) > 0.9


def test_a_drive_that_lacks_an_axis_is_told_from_the_other_sensors() -> None:
    result = learnt(*drives(TRAINED))
    shown, truth = drives(HELD_OUT)
    assert result.score([t.drop(columns="acceleration_z") for t in shown], truth) > 0.85


def test_current_is_not_told_from_what_was_learnt_of_torque() -> None:
    """Amperes for newton metres would be a vehicle that pulls fifty times less: the wheels' speeds have to do."""
    result = learnt(*wheels_only(TRAINED))
    shown, _ = wheels_only(HELD_OUT)
    speeds = [t[[c for c in t if not c.startswith("drive_torque")]] for t in shown]
    np.testing.assert_array_equal(
        result.predict_proba([with_current(t, torque=False) for t in shown]), result.predict_proba(speeds)
    )


def test_where_both_are_logged_either_torque_or_current_is_learnt_from() -> None:
    tables, labels = wheels_only(TRAINED)
    result = learnt([with_current(t) for t in tables], labels)
    assert any("motor_current_*" in note for note in result.notes_)
    shown, truth = wheels_only(HELD_OUT)
    assert result.score(shown, truth) > 0.85


def test_a_ground_recorded_at_another_rate_is_said() -> None:
    tables, labels = drives(TRAINED)
    slow = [
        t[t["wheel_speed_left"].notna() | (np.arange(len(t)) % 3 == 0)] if g == "wet" else t
        for t, g in zip(tables, labels, strict=True)
    ]
    assert not any("rate" in note for note in learnt(*wheels_only(TRAINED)).notes_)
    result = learnt(slow, labels)
    assert [note.partition(":")[0] for note in result.notes_ if "may be the rate" in note] == [
        "angular velocity",
        "acceleration",
    ]


def test_the_words_in_wheels_names_do_not_matter() -> None:
    plain, worded = ("a", "b", "c", "d"), ("front_left", "front_right", "rear_left", "rear_right")
    reported = [
        learnt(*wheels_only(TRAINED, wheels)).predict_proba(wheels_only(HELD_OUT, wheels)[0])
        for wheels in (plain, worded)
    ]
    np.testing.assert_array_equal(*reported)


def every(table: pd.DataFrame, rows: int) -> pd.DataFrame:
    return table.iloc[::rows].reset_index(drop=True)


def test_a_body_sensor_at_a_higher_rate_is_judged_at_that_of_training() -> None:
    def slower(table: pd.DataFrame) -> pd.DataFrame:
        at = np.flatnonzero(table[BODY[0]].notna())
        return table.assign(**{name: table[name].where(np.isin(table.index, at[::4])) for name in BODY})

    tables, labels = drives(TRAINED)
    result = learnt([slower(table) for table in tables], labels)
    assert result.score(*drives(HELD_OUT)) > 0.9


def test_a_recording_too_slow_to_show_what_was_learned_is_unknown_and_why_is_said() -> None:
    result = learnt(*wheels_only(TRAINED))
    slow = every(wheels_only(HELD_OUT)[0][0].dropna(), 4)
    assert (result.predict([slow]) == "unknown").all()
    assert result.too_slow(slow)[0] == "wheel speed: sampled every 0.62 s, learned every 0.15 s, not used."
    for rows in (1, 2):  # at half of the rate a window has five samples
        assert not result.too_slow(every(wheels_only(HELD_OUT)[0][0].dropna(), rows))


def test_a_machine_that_drives_pulls_and_vibrates_three_times_as_much_is_unknown() -> None:
    """Limited to the learned range, its features look like those of the ground that pulls and vibrates most."""
    result = learnt(*drives(TRAINED))
    measured = ["wheel_speed_left", "wheel_speed_right", "drive_torque_left", "drive_torque_right", *BODY]
    other = [table.assign(**{name: 3 * table[name] for name in measured}) for table in drives(HELD_OUT)[0]]
    assert (result.predict(other) == "unknown").mean() > 0.9


def test_wheels_that_were_not_learned_are_of_another_vehicle() -> None:
    result = learnt(*wheels_only(TRAINED))
    four = wheels_only(HELD_OUT, ("left", "right", "rear_left", "rear_right"))[0]
    with pytest.raises(InputError, match=r"rear_left, rear_right \(learned: left, right\)"):
        result.predict(four)


def test_a_very_short_run_beside_a_long_one_does_not_stop_the_training() -> None:
    """Held out, the long one would leave nothing of its ground: probabilities are learnt within runs, and that is said."""
    tables = [drive(ground, seed, 20.0) for ground in GROUNDS for seed in (1000, 1001)]
    labels = [ground for ground in GROUNDS for _ in range(2)]
    tables[-1] = drive(labels[-1], 1001, 0.5)
    result = learnt(tables, labels)
    assert any("one recording" in note for note in result.notes_)
    assert result.score(*drives(HELD_OUT)) > 0.85


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_labels_are_read_as_a_spreadsheet_saves_them(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "heute.csv").touch()
    (tmp_path / "labels.csv").write_text("file;label\nheute.csv;nasse Böschung\n", encoding=encoding)
    assert [drive.label for drive in read_labels(tmp_path / "labels.csv")] == ["nasse Böschung"]
