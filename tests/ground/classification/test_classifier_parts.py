"""Parts of the ground classifier against independent oracles: scikit-learn, Parseval, counting."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.ensemble import ExtraTreesClassifier
from sklearn.svm import SVC

from terragrip.ground.classification.channels import Channel
from terragrip.ground.classification.expert import Examples, calibrate, probabilities, train
from terragrip.ground.classification.forest import Forest
from terragrip.ground.classification.kernel_machine import PENALTY, WIDTH, KernelMachine, votes
from terragrip.ground.classification.training_set import deal
from terragrip.ground.classification.vibration import band_edges, band_energies
from terragrip.ground.classification.wheel_features import motion
from terragrip.ground.classification.windows import samples_in, window_starts


@pytest.mark.parametrize("classes", [2, 3, 5])
def test_numpy_evaluates_the_machine_as_scikit_learn_does(classes: int) -> None:
    random = np.random.default_rng(classes)
    codes = np.arange(200) % classes
    points = random.standard_normal((200, 6)) + 0.8 * codes[:, None] * np.array([1, 0, -1, 0, 0, 0.3])
    fresh = random.standard_normal((50, 6)) + 1.0
    theirs = SVC(C=PENALTY, gamma=WIDTH / 6, class_weight="balanced", decision_function_shape="ovo").fit(
        points, codes
    )
    pairs = theirs.decision_function(fresh)
    pairs = -pairs[:, None] if classes == 2 else pairs
    scores, _ = KernelMachine.fit(points, codes).decide(fresh)
    np.testing.assert_allclose(scores, votes(pairs, classes), atol=2e-5)


def test_distance_is_to_the_support_vectors_near() -> None:
    random = np.random.default_rng(0)
    points = random.standard_normal((80, 3))
    machine = KernelMachine.fit(points, (points[:, 0] > 0).astype(int))
    fresh = random.standard_normal((7, 3)) * 3
    apart = np.sort(np.linalg.norm(fresh[:, None] - machine.support[None], axis=2), axis=1)[:, 4]
    np.testing.assert_allclose(machine.decide(fresh)[1], np.log(apart), atol=1e-4)


def test_a_tone_lies_in_its_band_with_its_power() -> None:
    """A sine of amplitude 2 has mean square 2, all of it near its frequency (Hann windows: within a bin either way)."""
    period, window = 0.01, 1.7
    edges = band_edges(window, period)
    time = period * np.arange(170)
    for frequency in (7.0, 21.3, 40.0):
        energies = band_energies(2.0 * np.sin(2 * np.pi * frequency * time + 0.4), period, edges)
        centre = 0.5 * (edges[1:] + edges[:-1])
        near = np.abs(centre - frequency) < 2.5 * np.diff(edges)
        assert energies.sum() == pytest.approx(2.0, rel=0.1)
        assert energies[near].sum() > 0.98 * energies.sum()


def test_white_noise_is_flat_and_bands_above_the_nyquist_frequency_are_not_measured() -> None:
    random = np.random.default_rng(1)
    edges = band_edges(1.7, 0.01)
    energies = band_energies(random.standard_normal((4000, 170)), 0.01, edges).mean(axis=0)
    assert energies[:-1].std() / energies[:-1].mean() < 0.1
    assert energies.sum() == pytest.approx(1.0, rel=0.1)
    slow = band_energies(random.standard_normal((10, 85)), 0.02, edges)
    assert np.isnan(slow[:, edges[:-1] > 26.0]).all()
    assert np.isfinite(slow[:, edges[1:] < 24.0]).all()


@given(st.floats(0, 1e6), st.floats(0.01, 300), st.floats(0.1, 5), st.floats(0.1, 1))
def test_windows_lie_in_the_recording_and_fill_it(
    start: float, length: float, window: float, share: float
) -> None:
    step = share * window
    starts = window_starts(start, start + length, window, step)
    assert starts[0] == start
    np.testing.assert_allclose(np.diff(starts), step, rtol=1e-6)
    if length >= window:
        assert starts[-1] + window <= start + length + 0.011 * window + 1e-9
        assert starts[-1] + window + step > start + length - 1e-6
    else:
        assert len(starts) <= 1 + 0.01 / share


def test_a_regular_channel_comes_out_as_it_was_measured() -> None:
    channel = Channel(np.arange(100) / 6.5, np.arange(100.0) ** 1.5)
    starts = np.array([0.0, 1.0, 3.3])
    result = samples_in([channel], starts, 1.7, 1 / 6.5, channel)[:, 0]
    for row, start in zip(result, starts, strict=True):
        first = np.searchsorted(channel.time, start - 1e-9)
        np.testing.assert_allclose(row, channel.values[first : first + 11], rtol=1e-9)


def test_a_hole_makes_a_window_not_measured() -> None:
    time = np.arange(0, 10, 0.01)
    time = time[(time < 4.0) | (time > 5.0)]
    channel = Channel(time, time)
    result = samples_in([channel], np.array([0.0, 3.5, 4.2, 5.1, 9.5]), 1.7, 0.01, channel)[:, 0]
    assert np.isfinite(result).all(axis=1).tolist() == [True, False, False, True, False]


@given(st.lists(st.integers(0, 3), min_size=8, max_size=60).filter(lambda c: set(c) == {0, 1, 2, 3}))
def test_every_class_is_left_in_training_whatever_fold_is_held_out(listed: list[int]) -> None:
    codes = np.array(listed)
    folds, by_recording = deal(codes, np.arange(len(codes)) % 7, np.random.default_rng(0))
    assert by_recording == (np.bincount(codes).min() >= 2)
    if by_recording:
        for fold in np.unique(folds):
            assert set(codes[folds != fold]) == {0, 1, 2, 3}
            assert (folds == fold).any()


def test_calibration_finds_the_slopes_that_made_the_labels() -> None:
    """Of three parts that are scored, the labels follow the first twice as much as the second, and not the third."""
    random = np.random.default_rng(4)
    scores = random.uniform(-1, 1, (3, 20000, 3))
    chances = probabilities(scores, np.array([3.0, 1.5, 0.0]), np.array([0.5, 0.0, -0.5]))
    codes = np.array([random.choice(3, p=row) for row in chances])
    slopes, offsets = calibrate(scores, codes, np.full(len(codes), 1 / len(codes)), len(codes))
    np.testing.assert_allclose(slopes[:2], [3.0, 1.5], rtol=0.05)
    assert slopes[2] < 0.2  # slopes are positive: none comes near zero only
    assert offsets[0] - offsets[2] == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("classes", [2, 5])
def test_numpy_evaluates_the_forest_as_scikit_learn_does(classes: int) -> None:
    """Also at features that equal a threshold in single precision, and where one was not measured."""
    random = np.random.default_rng(classes)
    codes = np.arange(300) % classes
    points = random.standard_normal((300, 4)) + codes[:, None]
    points[:, 1] = np.rint(4 * points[:, 1]) / 4
    points[::7, 2] = np.nan
    fresh = random.standard_normal((1200, 4)) + 1.0
    fresh[:, 1] = np.rint(4 * fresh[:, 1]) / 4
    fresh[3, 2] = np.nan
    mean = np.nanmean(points, axis=0)
    theirs = ExtraTreesClassifier(100, min_samples_leaf=2, class_weight="balanced", random_state=3)
    theirs.fit(np.where(np.isfinite(points), points, mean), codes)
    ours = Forest.fit(points, codes, seed=3)
    expected = theirs.predict_proba(np.where(np.isfinite(fresh), fresh, mean))
    np.testing.assert_allclose(np.exp(ours.decide(fresh)), expected + 0.01, atol=1e-6)


def test_training_leaves_the_warning_filters_as_they_are() -> None:
    """scikit-learn changes them for each tree: forests of two threads emptied them, and it then warned of that itself."""
    names = ("wheel speed: pace", "wheel speed: at fl pace", "torque: size", "torque: at fl size")
    codes, groups = np.arange(120) % 2, np.arange(120) // 10
    features = np.random.default_rng(0).standard_normal((120, 4)) + codes[:, None]
    windows = Examples(features, codes, groups, np.arange(120.0), groups % 4)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "one of the caller's")
        before = list(warnings.filters)
        train(frozenset({"wheel speed", "torque"}), names, windows, threads=4, seed=0)
        assert warnings.filters == before


@pytest.mark.parametrize(
    ("name", "value"), [("left", 10**6), ("right", 0), ("feature", 9), ("feature", -1), ("roots", -1)]
)
def test_nodes_that_make_no_tree_are_refused(name: str, value: int) -> None:
    random = np.random.default_rng(0)
    forest = Forest.fit(random.standard_normal((60, 3)), np.arange(60) % 2, seed=0)
    forest.check()
    changed = getattr(forest, name).copy()
    changed[2] = value
    with pytest.raises(ValueError, match="node"):
        replace(forest, **{name: changed}).check()


def test_a_constant_carries_no_energy() -> None:
    period = 0.01
    wave = np.sin(2 * np.pi * 12.0 * period * np.arange(200))
    edges = band_edges(200 * period, period)
    alone, lifted = (band_energies(wave + level, period, edges) for level in (0.0, 50.0))
    assert np.nansum(alone) == pytest.approx(0.5, rel=0.05)  # mean square of a sine
    np.testing.assert_allclose(lifted, alone, atol=1e-9)


def test_wheels_on_a_straight_line_are_straight() -> None:
    features = motion(np.full((1, 2, 40), 3.0), size=2.0)
    assert features["straightness"] == pytest.approx(3.0 / (3.0 + 0.02 * 2.0))  # FLOOR of the usual size
    assert features["turn"] == 0
    spinning = motion(np.stack([np.full(40, 3.0), np.full(40, -3.0)])[None], size=2.0)
    assert spinning["straightness"] == 0
    assert spinning["turn"] == pytest.approx(3.0 / (3.0 + 0.02 * 2.0))
