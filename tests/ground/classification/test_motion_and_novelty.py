"""What is judged given the motion, and what is called strange: against scikit-learn, counting, and drives of another driver."""

from __future__ import annotations

import numpy as np
import pytest
from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

from classifier_drives import BODY, drive
from terragrip import GroundClassifier
from terragrip.ground.classification.discriminants import Discriminants
from terragrip.ground.classification.motion_law import MotionLaw
from terragrip.ground.classification.neighbours import nearby_mean, smoothed
from terragrip.ground.classification.novelty import Strangeness
from terragrip.ground.classification.roles import MOTION, roles_of


def test_without_motion_the_law_is_linear_discriminant_analysis() -> None:
    random = np.random.default_rng(0)
    codes = np.arange(6000) % 3
    mixing = random.standard_normal((4, 4))
    means = random.standard_normal((3, 4))
    effects = random.standard_normal((6000, 4)) @ mixing + means[codes]
    law = MotionLaw.fit(np.zeros((6000, 1)), effects, codes)
    fresh = random.standard_normal((500, 4)) @ mixing + means[np.arange(500) % 3]
    theirs = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=0.03).fit(effects, codes)
    ours = law.decide(np.zeros((500, 1)), fresh).argmax(axis=1)
    assert (ours == theirs.predict(fresh)).mean() > 0.95


def test_a_motion_that_was_never_driven_on_a_ground_does_not_speak_against_it() -> None:
    """Effort rises with pace on both grounds, by another slope; drives as fast as the test's were on the other ground only.

    A third beyond what was driven, that is; far beyond, no law holds.
    """
    random = np.random.default_rng(1)

    def windows(ground: int, low: float, high: float, count: int = 400) -> tuple[np.ndarray, np.ndarray]:
        pace = random.uniform(low, high, (count, 1))
        slope = np.array([0.5, 1.0])[ground]
        return pace, slope * pace + 0.1 * random.standard_normal((count, 1))

    slow, fast = windows(0, 1, 2), windows(1, 1.5, 4)
    law = MotionLaw.fit(np.vstack([slow[0], fast[0]]), np.vstack([slow[1], fast[1]]), np.repeat([0, 1], 400))
    pace, effort = windows(0, 2.1, 2.7)
    assert (law.decide(pace, effort).argmax(axis=1) == 0).mean() > 0.95


def test_a_driver_who_turns_and_hurries_on_one_ground_does_not_make_it_another() -> None:
    """Wheels alone; on hard ground all learnt drives are slow. A fast one still differs from loose ground, which was driven fast."""

    def at(ground: str, seed: int, faster: float) -> object:
        table = drive(ground, seed, 25.0).drop(columns=BODY).dropna()
        wheels = [c for c in table if c.startswith("wheel_speed")]
        table[wheels] *= faster
        return table

    learnt = [at("hard", s, 0.4) for s in range(4)] + [at("loose", s, 1.5) for s in range(4)]
    classifier = GroundClassifier(rejection=0.0).fit(learnt, ["hard"] * 4 + ["loose"] * 4)
    assert classifier.score([at("hard", s, 1.5) for s in range(10, 13)], ["hard"] * 3) > 0.9


def test_discriminants_are_scikit_learns_up_to_turns() -> None:
    """Distances along Fisher's discriminants, which scikit-learn's eigenvalue solver finds as well."""
    random = np.random.default_rng(2)
    codes = np.arange(900) % 3
    points = random.standard_normal((900, 6)) * np.arange(1, 7) + 2.0 * np.eye(3, 6)[codes]
    ours = Discriminants.fit(points, codes)
    theirs = LinearDiscriminantAnalysis(solver="eigen", shrinkage=0.1).fit(points, codes)
    fresh = random.standard_normal((40, 6)) * 4
    known = theirs.transform(points)
    apart = np.linalg.norm(theirs.transform(fresh)[:, None] - known, axis=2)
    order = np.corrcoef(ours.distance(fresh), np.log(np.sort(apart, axis=1)[:, 9]))[0, 1]
    assert order > 0.97
    assert ours.distance(points[:5]).max() < ours.distance(points[:5] + 30.0).min()


def test_nearby_windows_are_averaged_within_reach_and_holes_do_not_count() -> None:
    starts = np.array([0.0, 1.0, 2.0, 5.0, 6.0])
    values = np.array([1.0, 2.0, np.nan, 10.0, 20.0])
    np.testing.assert_allclose(nearby_mean(values, starts, 1.0), [1.5, 1.5, 2.0, 15.0, 15.0])
    np.testing.assert_allclose(nearby_mean(values, starts, 0.0), values)
    chances = np.array([[0.9, 0.1], [0.5, 0.5], [0.2, 0.8]])
    once = smoothed(chances, np.arange(3.0), 1.0)
    odds = np.log(chances[:, 0] / chances[:, 1])
    np.testing.assert_allclose(np.log(once[1, 0] / once[1, 1]), odds.mean(), atol=1e-6)
    np.testing.assert_allclose(once.sum(axis=1), 1.0)


def test_novelty_is_the_share_of_known_windows_that_are_as_strange_over_every_span() -> None:
    random = np.random.default_rng(3)
    groups, starts = np.repeat(np.arange(40), 50), np.tile(np.arange(50.0), 40)
    of_run = random.standard_normal(40)[groups]  # windows of one run are strange alike
    odd = np.stack([of_run + random.standard_normal(2000), 3.0 + 0.5 * random.standard_normal(2000)])
    known = Strangeness.fit(odd, np.full(2000, 1 / 2000), groups, starts)
    alone = known.of(odd)
    share = known.novelty(alone, 0.0)
    for rate in (0.02, 0.1, 0.5):
        assert (share < rate).mean() == pytest.approx(rate, abs=0.005)
        over = np.concatenate([nearby_mean(alone[groups == g], starts[groups == g], 5.0) for g in range(40)])
        assert (known.novelty(over, 10.0) < rate).mean() == pytest.approx(rate, abs=0.01)
    assert np.isnan(known.novelty(np.array([np.nan]), 7.0)).all()
    assert (np.diff(known.novelty(np.linspace(-5, 9, 50), 7.0)) <= 1e-12).all()


def test_what_the_driver_does_goes_to_no_part_but_pace_and_turning() -> None:
    features = (
        *MOTION,
        "wheel speed: trend",
        "torque: level",
        "wheel speed+torque: sides difference",
        "torque: at left mean",
    )
    roles = roles_of(features)
    assert [features[k] for k in roles.machine] == [*MOTION, "torque: level"]
    assert [features[k] for k in roles.effects] == ["torque: level", "wheel speed+torque: sides difference"]
    assert roles.forest
    assert roles.law
    alone = roles_of(("wheel speed: pace", "wheel speed: trend"))
    assert len(alone.machine) == 2
    assert not alone.law
    assert not alone.forest
