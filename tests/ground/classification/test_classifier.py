"""GroundClassifier on made-up drives: what it tells, what it leaves open, with which sensors, and what it refuses."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from classifier_drives import BODY, GROUNDS, drive, drives
from terragrip import GroundClassifier, InputError, Recording

pytestmark = pytest.mark.usefixtures("small_forests")

TRAINED, HELD_OUT = range(1000, 1004), range(1010, 1013)


@pytest.fixture(scope="module")
def classifier() -> GroundClassifier:
    return GroundClassifier(max_windows=120).fit(*drives(TRAINED))


@pytest.fixture(scope="module")
def held_out() -> tuple[list[pd.DataFrame], list[str]]:
    return drives(HELD_OUT)


def without(tables: list[pd.DataFrame], *begin: str) -> list[pd.DataFrame]:
    return [t.drop(columns=[c for c in t if c.startswith(begin)]) for t in tables]


def test_grounds_are_told_on_drives_never_seen(classifier: GroundClassifier, held_out: tuple) -> None:
    tables, labels = held_out
    assert classifier.score(tables, labels) > 0.93
    assert list(classifier.classes_) == sorted(GROUNDS)


def test_grounds_that_do_not_differ_are_not_told() -> None:
    """The control: three names for one ground score about a third, so nothing but the ground is learnt."""
    same = [drive("wet", seed) for seed in range(1020, 1032)]
    names = ["a", "b", "c"] * 4
    result = GroundClassifier(max_windows=80, rejection=0).fit(same, names)
    tested = [drive("wet", seed) for seed in range(1040, 1049)]
    assert 0.1 < result.score(tested, ["a", "b", "c"] * 3) < 0.6
    assert result.predict_proba(tested).max(axis=1).mean() < 0.7


def test_a_gain_on_a_channel_and_the_wheels_names_do_not_matter(
    classifier: GroundClassifier, held_out: tuple
) -> None:
    """Amperes for newton metres, and other wheels' names in another order: the same words."""

    def changed(tables: list[pd.DataFrame]) -> list[pd.DataFrame]:
        scaled = [t.assign(**{c: 0.27 * t[c] for c in t if c.startswith("drive_torque")}) for t in tables]
        scaled = [t.assign(**{c: 3.1 * t[c] for c in t if c.startswith("wheel_speed")}) for t in scaled]
        swapped = [t[["time", *reversed(t.columns[1:])]] for t in scaled]
        return [
            t.rename(columns=lambda c: c.replace("drive_torque", "motor_current").replace("left", "1"))
            for t in swapped
        ]

    learnt, labels = drives(TRAINED)
    other = GroundClassifier(max_windows=120).fit(changed(learnt), labels)
    tables, _ = held_out
    np.testing.assert_allclose(
        other.predict_proba(changed(tables)), classifier.predict_proba(tables), atol=0.02
    )


@pytest.mark.parametrize(
    ("missing", "least"),
    [
        (("acceleration", "angular_velocity"), 0.8),
        (("wheel_speed", "drive_torque"), 0.8),
        (("drive_torque",), 0.85),
        (("angular_velocity",), 0.85),
        (("wheel_speed", "drive_torque", "acceleration"), 0.75),
    ],
)
def test_sensors_may_be_missing_when_it_is_used(
    classifier: GroundClassifier, held_out: tuple, missing: tuple[str, ...], least: float
) -> None:
    tables, labels = held_out
    assert classifier.score(without(tables, *missing), labels) > least


def test_sensors_may_be_missing_in_part_of_the_training() -> None:
    """One ground's body sensor is missing in most runs: its absence must not become the mark of that ground."""
    tables, labels = drives(range(1000, 1006))
    tables = [
        without([t], *BODY)[0] if g == "wet" and k % 6 < 3 else t
        for k, (t, g) in enumerate(zip(tables, labels, strict=True))
    ]
    result = GroundClassifier(max_windows=120).fit(tables, labels)
    shown, truth = drives(HELD_OUT)
    assert result.score(without(shown, *BODY), truth) > 0.8
    assert result.score(shown, truth) > 0.9


@pytest.mark.sample(2)
@pytest.mark.parametrize("wheels", [("only",), ("fl", "fr", "ml", "mr", "rl", "rr", "tl", "tr")])
def test_one_to_eight_wheels(wheels: tuple[str, ...]) -> None:
    tables, labels = drives(range(1000, 1003), wheels=wheels)
    result = GroundClassifier(max_windows=80).fit(without(tables, *BODY), labels)
    shown, truth = drives(HELD_OUT, wheels=wheels)
    assert result.score(without(shown, *BODY), truth) > 0.85


def test_ground_speed_is_used_where_there_is_one() -> None:
    """Grounds alike but for slip: recognised with a ground speed, not without."""

    def slipping(seed: int, slip: float) -> pd.DataFrame:
        table = without([drive("hard", seed)], *BODY, "drive_torque")[0]
        wheel = table[["wheel_speed_left", "wheel_speed_right"]].mean(axis=1)
        return table.assign(ground_speed=0.2 * (1 - slip) * wheel)

    labels = ["firm", "slick"] * 4
    learnt = [slipping(1000 + k, 0.05 + 0.4 * (k % 2)) for k in range(8)]
    shown = [slipping(1100 + k, 0.05 + 0.4 * (k % 2)) for k in range(8)]
    result = GroundClassifier(max_windows=80).fit(learnt, labels)
    assert result.score(shown, labels) > 0.9
    assert result.score(without(shown, "ground_speed"), labels) < 0.75


def test_runs_may_hold_different_sensors_on_different_grounds() -> None:
    """Only what every ground was measured with can tell them apart; what else there is is named, not used."""
    tables, labels = drives(range(1000, 1003), ("hard", "loose"))
    own = {"hard": "acceleration", "loose": "angular_velocity"}
    tables = [without([t], own[g])[0] for t, g in zip(tables, labels, strict=True)]
    result = GroundClassifier(max_windows=80).fit(tables, labels)
    assert set().union(*result.sensors_) == {"wheel speed", "torque"}
    assert any("acceleration, angular velocity" in note for note in result.notes_)
    shown, truth = drives(HELD_OUT, ("hard", "loose"))
    assert result.score(shown, truth) > 0.85


def test_a_ground_unlike_all_is_unknown_and_the_known_are_not(
    classifier: GroundClassifier, held_out: tuple
) -> None:
    strange = [drive("rails", seed) for seed in HELD_OUT]
    assert (classifier.predict(strange) == "unknown").mean() > 0.9
    assert (classifier.predict(held_out[0]) == "unknown").mean() < 0.1
    assert (classifier.novelty(strange) < 0.02).mean() > 0.9


def test_the_rate_of_rejection_is_about_what_was_asked_for(classifier: GroundClassifier) -> None:
    """On many drives never seen, the share below a level of novelty is about that level."""
    novelty = classifier.novelty(drives(range(1050, 1062))[0])
    assert 0.01 < (novelty < 0.05).mean() < 0.15
    assert 0.1 < (novelty < 0.25).mean() < 0.4


def test_probabilities_are_calibrated_on_drives_never_seen() -> None:
    """Two grounds that overlap: of what is said at p, about p is right; nobody is sure all the time."""
    near = {"a": (5.0, 0.1, 0.3, 20.0), "b": (5.5, 0.12, 0.33, 20.0)}
    learnt = [(drive(near[g], seed), g) for g in near for seed in range(1000, 1010)]
    shown = [(drive(near[g], seed), g) for g in near for seed in range(1070, 1082)]
    result = GroundClassifier(max_windows=250).fit(
        without([t for t, _ in learnt], *BODY), [g for _, g in learnt]
    )
    tables, labels = without([t for t, _ in shown], *BODY), np.array([g for _, g in shown])
    chances = result.predict_proba(tables)
    truth = labels[result.windows(tables)["recording"]]
    right = result.classes_[chances.argmax(axis=1)] == truth
    text = chances.max(axis=1)
    assert 0.55 < right.mean() < 0.99
    assert abs(text.mean() - right.mean()) < 0.08
    assert right[text > np.median(text)].mean() > right[text <= np.median(text)].mean()


def test_windows_say_whose_row_is_whose(classifier: GroundClassifier) -> None:
    tables = [
        drive("hard", 1000, 5.0),
        drive("wet", 1000, 1.7),
        drive("wet", 1001, 1.0),
        drive("loose", 1000, 8.6),
    ]
    windows = classifier.windows(tables)
    assert windows["recording"].tolist() == [0, 0, 1, 2, 3, 3, 3, 3, 3]
    np.testing.assert_allclose(windows["start"], [0, 1.7, 0, 0, 0, 1.7, 3.4, 5.1, 6.8], atol=1e-9)
    chances = classifier.predict_proba(tables)
    assert chances.shape == (9, 3)
    np.testing.assert_allclose(chances.sum(axis=1), 1.0)
    apart = np.concatenate([classifier.predict_proba([t]) for t in tables])
    np.testing.assert_allclose(chances, apart)  # a window does not look at its neighbours
    assert classifier.predict(tables)[3] == "unknown"  # 1 s of data in a window of 1.7 s


def test_judging_once_tells_what_each_question_is_told(classifier: GroundClassifier, held_out: tuple) -> None:
    shown = held_out[0][:2]
    judged = classifier.judge(shown)
    pd.testing.assert_frame_equal(judged[["recording", "start", "end"]], classifier.windows(shown))
    assert judged["ground"].tolist() == classifier.predict(shown).tolist()
    assert np.array_equal(judged["novelty"], classifier.novelty(shown))
    chances = judged[[f"probability_{name}" for name in classifier.classes_]]
    assert np.array_equal(chances, classifier.predict_proba(shown))


def test_each_window_is_judged_from_its_own_time_only(classifier: GroundClassifier) -> None:
    table = drive("hard", 1015, 10.2)
    other = pd.concat([table[table.time < 5.1], drive("loose", 1016, 10.2)[lambda t: t.time >= 5.1]])
    assert np.array_equal(classifier.predict_proba([table])[:3], classifier.predict_proba([other])[:3])


def test_smoothing_shares_evidence_along_a_drive() -> None:
    tables, labels = drives(TRAINED)
    result = GroundClassifier(max_windows=60, rejection=0).fit(without(tables, *BODY, "drive_torque"), labels)
    shown, truth = drives(range(1080, 1086))
    shown = without(shown, *BODY, "drive_torque")
    alone = result.score(shown, truth)
    assert result.set_params(smooth=15.0).score(shown, truth) >= alone


def test_nothing_measured_is_unknown_with_equal_chances(classifier: GroundClassifier) -> None:
    table = drive("hard", 1010, 10.0)
    empty = table[["time"]].assign(soil="hard")
    gap = table.copy()
    gap.loc[(gap.time > 2) & (gap.time < 6), gap.columns[1:]] = np.nan
    assert set(classifier.predict([empty])) == {"unknown"}
    np.testing.assert_allclose(classifier.predict_proba([empty]), 1 / 3)
    assert np.isnan(classifier.novelty([empty])).all()
    assert classifier.predict([gap]).tolist() == ["hard", "unknown", "unknown", "unknown", "hard"]


def test_a_recording_and_a_table_are_the_same_to_it(classifier: GroundClassifier) -> None:
    table = drive("wet", 1011, 12.0).assign(ground_speed=0.5)
    assert np.array_equal(
        classifier.predict_proba([Recording.from_frame(table)]), classifier.predict_proba([table])
    )


def test_the_same_seed_gives_the_same_classifier_and_scikit_learn_can_clone_it(held_out: tuple) -> None:
    from sklearn.base import clone

    first = GroundClassifier(max_windows=40, random_state=3)
    second = clone(first)
    assert second.get_params() == first.get_params()
    tables, labels = drives(range(1000, 1002), seconds=20.0)
    # by single wheels: these are what forests judge
    learnt, shown = without(tables, *BODY), without(held_out[0], *BODY)
    a = first.fit(learnt, labels).predict_proba(shown)
    assert np.array_equal(a, second.fit(learnt, labels).predict_proba(shown))
    assert first.n_features_in_ == len(first.feature_names_in_)


@pytest.mark.long  # it is cloned and fitted anew: above
def test_scikit_learn_can_cross_validate_it() -> None:
    from sklearn.model_selection import cross_val_score

    tables, labels = drives(range(1000, 1004), ("hard", "loose"), seconds=20.0)
    scores = cross_val_score(GroundClassifier(max_windows=40, rejection=0), tables, labels, cv=2)
    assert scores.min() > 0.85


def test_a_long_drive_is_judged_as_its_parts_are(classifier: GroundClassifier) -> None:
    """More windows than are worked on at a time, every 0.01 s."""
    table = drive("loose", 1013, 30.0)
    result = classifier.predict_proba([table])
    try:
        often = classifier.set_params(step=0.01).predict_proba([table])
    finally:
        classifier.set_params(step=None)
    assert len(often) > 2000
    np.testing.assert_allclose(often[::170][: len(result)], result, atol=1e-6)


def test_labels_may_be_numbers() -> None:
    tables, labels = drives(range(1000, 1002), ("hard", "loose"), seconds=20.0)
    result = GroundClassifier().fit(tables, [7 if g == "hard" else 9 for g in labels])
    assert set(result.predict(tables)) <= {7, 9, "unknown"}
    assert result.score(tables, [7 if g == "hard" else 9 for g in labels]) > 0.9


def test_one_recording_of_a_ground_is_enough_but_is_told() -> None:
    result = GroundClassifier(rejection=0).fit([drive("hard", 1000), drive("loose", 1000)], ["hard", "loose"])
    assert result.score([drive("hard", 1001), drive("loose", 1001)], ["hard", "loose"]) > 0.8
    assert any("one recording" in note for note in result.notes_)


GOOD = drive("hard", 1000, 20.0)
OTHER = drive("wet", 1000, 20.0)
STILL = GOOD[["time"]].assign(**dict.fromkeys(BODY, 1.0))


@pytest.mark.parametrize(
    ("recordings", "labels", "parameters", "expected"),
    [
        ([GOOD, OTHER], ["hard", "hard"], {}, "one ground only, hard"),
        ([GOOD, OTHER], ["hard"], {}, "1 labels for 2 recordings"),
        ([GOOD, OTHER], {"a": "hard", "b": "wet"}, {}, "one label for each"),
        ([GOOD, OTHER], "hw", {}, "one label for each"),
        ([GOOD, OTHER], ["hard", ""], {}, "labels[1]"),
        ([GOOD, OTHER], ["hard", None], {}, "labels[1]"),
        ([GOOD, OTHER], ["hard", "unknown"], {}, "labels[1]"),
        ([GOOD, OTHER], ["hard", 3], {}, "mixed"),
        (GOOD, ["hard"], {}, "not a list"),
        ([], [], {}, "no recording"),
        ([GOOD, 3], ["hard", "wet"], {}, "recordings[1]"),
        ([GOOD, OTHER[["time"]]], ["hard", "wet"], {}, "recordings[1]: has no usable channel"),
        ([GOOD, OTHER.drop(columns="time")], ["hard", "wet"], {}, "column time"),
        ([GOOD, OTHER.iloc[::-1]], ["hard", "wet"], {}, "goes back"),
        ([GOOD, OTHER.iloc[:0]], ["hard", "wet"], {}, "empty"),
        ([GOOD, OTHER.assign(acceleration_x="much")], ["hard", "wet"], {}, "acceleration_x"),
        ([GOOD, OTHER.assign(acceleration_x=np.inf)], ["hard", "wet"], {}, "infinite"),
        ([GOOD, OTHER], ["hard", "wet"], {"window": 0.01}, "shorter than two samples"),
        ([GOOD, OTHER], ["hard", "wet"], {"window": 60.0}, "windows"),
        ([GOOD, OTHER], ["hard", "wet"], {"window": -1}, "window"),
        ([GOOD, OTHER], ["hard", "wet"], {"window": np.nan}, "window"),
        ([GOOD, OTHER], ["hard", "wet"], {"step": 0}, "step"),
        ([GOOD, OTHER], ["hard", "wet"], {"rejection": 1.5}, "rejection"),
        ([GOOD, OTHER], ["hard", "wet"], {"max_windows": "all"}, "max_windows"),
        (
            [GOOD[["time", *BODY]], OTHER[["time", "wheel_speed_left"]]],
            ["hard", "wet"],
            {},
            "no sensor that was measured through whole windows on every ground",
        ),
        ([GOOD.head(60)] * 24, ["hard", "wet"] * 12, {}, "longer than a window"),
        ([STILL, STILL], ["hard", "wet"], {}, "nothing measured differs"),
        ([GOOD, OTHER.assign(acceleration_x=1.7e308)], ["hard", "wet"], {}, "1.7e+308 is not a measurement"),
    ],
)
def test_what_cannot_be_learnt_from_is_refused_in_one_line(
    recordings: object, labels: object, parameters: dict, expected: str
) -> None:
    with pytest.raises(InputError) as refused:
        GroundClassifier(**parameters).fit(recordings, labels)
    assert expected in str(refused.value)
    assert "\n" not in str(refused.value)


def test_before_fit_it_says_so() -> None:
    with pytest.raises(InputError, match="call fit"):
        GroundClassifier().predict([GOOD])
    with pytest.raises(InputError, match="is no parameter"):
        GroundClassifier().set_params(windw=2)


def test_slow_channels_are_left_out_and_named() -> None:
    """A temperature-slow current (1 Hz) tells nothing within 1.7 s; the rest goes on."""
    tables, labels = drives(range(1000, 1002), seconds=20.0)
    slow = []
    for table in tables:
        table = table.copy()
        known = table["drive_torque_left"].notna()
        keep = known & (known.cumsum() % 7 == 0)
        for name in ("drive_torque_left", "drive_torque_right"):
            table[name] = table[name].where(keep)
        slow.append(table)
    result = GroundClassifier(max_windows=60).fit(slow, labels)
    assert any(note.startswith("torque: sampled too slowly") for note in result.notes_)
    assert not any("torque" in sensors for sensors in result.sensors_)
