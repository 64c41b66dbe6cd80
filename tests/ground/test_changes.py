"""Changes: the conjugate model against Student's law, segmentation against all segmentations, the detector against the plain recursion."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import t as student

from ground_drives import COARSE, FINE, GRASS, VEHICLE, Ground, drive, stopped, thinned
from terragrip.errors import InputError
from terragrip.ground import changes as changes_module
from terragrip.ground.analysis import Settings, analyse
from terragrip.ground.changes import LEAST, _borders, _Cost, changes_of
from terragrip.ground.conjugate import Model
from terragrip.ground.noise import noise_of
from terragrip.ground.online_changes import OnlineChanges
from terragrip.ground.signals import GROUND, curve_scale, signals_of
from terragrip.ground.steps import A_LENGTH, joined, steps_of
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import estimates_blocks
from terragrip.soil.estimates import whole_length
from terragrip.vehicle import Vehicle

USUAL = noise_of(np.zeros((0, 4)), GROUND)


def predictive(model: Model, x: np.ndarray) -> np.ndarray:
    """Log Student predictive of each row of x (n, signals) after those before it, all weights 1 (Murphy 2007, eq. 110)."""
    mean, count, shape, scale = (np.array(v) for v in (model.mean, model.count, model.shape, model.scale))
    out = []
    for row in x:
        law = student(2 * shape, mean, np.sqrt(scale * (count + 1) / (shape * count)))
        out.append(law.logpdf(row).sum())
        scale = scale + count * (row - mean) ** 2 / (2 * (count + 1))
        mean, count, shape = (count * mean + row) / (count + 1), count + 1, shape + 0.5
    return np.array(out)


@given(st.integers(0, 10_000), st.integers(1, 30))
@settings(max_examples=30)
def test_evidence_is_the_product_of_student_predictives(seed, n):
    model = replace(Model.of(GROUND, USUAL), weight=np.ones(4))
    x = model.mean + np.random.default_rng(seed).standard_normal((n, 4)) * 0.1
    result = model.evidence(np.full((1, 4), float(n)), x.sum(axis=0)[None], (x**2).sum(axis=0)[None])
    assert result[0] == pytest.approx(predictive(model, x).sum(), rel=1e-9, abs=1e-8)


@pytest.mark.sample(3)
@pytest.mark.parametrize("seed", range(5))
def test_the_segmentation_is_the_best_of_all(seed):
    rng = np.random.default_rng(seed)
    steps = np.repeat(rng.normal(0.12, 0.06, 4), 6)
    x = np.column_stack([steps, 0.85 + 0 * steps, -5.7 + 0 * steps, -5.1 + 0 * steps]) + rng.standard_normal(
        (24, 4)
    ) * [0.01, 0.08, 0.5, 0.5]
    cost, price = _Cost(x, replace(Model.of(GROUND, USUAL), weight=np.ones(4))), 6.0

    def total(cuts):
        ends = np.array([0, *cuts, 24])
        return cost.of(ends[:-1], ends[1:]).sum() + price * len(cuts)

    every = [c for k in range(6) for c in combinations(range(24), k) if (np.diff([0, *c, 24]) >= LEAST).all()]
    assert tuple(_borders(cost, price)) == min(every, key=total)


def test_a_change_is_found_where_it_is():
    result = changes_of(estimates_blocks(drive(1, [("grass", GRASS, 40), ("coarse", COARSE, 40)])))
    assert len(result) == 1
    assert result[0].time == pytest.approx(40, abs=1)
    assert result[0].std < 1
    assert result[0].probability > 0.99
    assert result[0].shift["soil_resistance"] > 2
    assert result[0].shift["adhesion_sd"] > 1


@pytest.mark.parametrize("online", [False, True])
def test_a_border_is_crossed_over_the_vehicles_length(online):
    """Wheel by wheel, then by the tool: both ends of the crossing lie in the stated interval, as its middle does."""
    crossing = whole_length(Vehicle.from_dict(VEHICLE)) / 0.6
    between = [
        ("", replace(GRASS, a=GRASS.a + k * (COARSE.a - GRASS.a), resistance=0.07 * (1 + k)), crossing / 4)
        for k in (0.2, 0.4, 0.6, 0.8)
    ]
    held = []
    for seed in range(8):
        estimates = drive(seed, [("grass", GRASS, 40), *between, ("coarse", COARSE, 40)])
        changes = analyse(estimates, settings=Settings(online=online))[0].changes
        ends = (40, 40 + crossing)
        held += [any(abs(one.time - end) < 1.96 * one.std for one in changes) for end in ends]
    assert np.mean(held) > 0.9


@pytest.mark.parametrize("online", [False, True])
def test_a_stop_beside_a_border_is_no_crossing(online):
    """Two minutes at rest, .9 m behind a border that is crossed in 5 s: its SD was 39 s, while driving 2.3 s."""
    estimates = stopped(drive(1, [("grass", GRASS, 40), ("coarse", COARSE, 40)]), 41.5, 120.0)
    (change,) = analyse(estimates, settings=Settings(online=online))[0].changes
    assert change.time == pytest.approx(40, abs=1)
    assert change.std < 4


def test_pull_alone_is_no_change():
    """More pull on one soil moves slip and adhesion along its curve: reported where these are the signals, and not else."""
    for seed in range(2):
        blocks = estimates_blocks(drive(seed, [("fine", FINE, 60), ("fine", replace(FINE, slip=0.3), 60)]))
        assert changes_of(blocks) == ()
        assert OnlineChanges().update(blocks) == []
        assert changes_of(blocks, ("slip", "adhesion"))


def under(ground: Ground, pull: float) -> Ground:
    """The ground where so much (pull over weight) is asked for beside its resistance: forces balance."""
    slip = np.linspace(0, 0.6, 601)
    mu = CURVES["exponential"].value(slip, {"a": ground.a})
    return replace(ground, slip=float(np.interp(ground.resistance + pull, mu, slip)))


SOFT, RUTTED = Ground(0.5, 0.07), Ground(0.85, 0.13, rough=0.012)
CASES = [  # the ground before, the ground after, what is known of the pull, whose the change may be
    (under(SOFT, 0.1), under(RUTTED, 0.1), "measured", "ground"),
    (under(SOFT, 0.1), under(RUTTED, 0.1), "unknown", "ground"),
    (under(RUTTED, 0.05), under(replace(RUTTED, rough=0.003), 0.25), "measured", "tool or ground"),
    (under(SOFT, 0.1), under(replace(SOFT, resistance=0.16), 0.1), "unknown", "tool or ground"),
    (under(SOFT, 0.1), under(replace(SOFT, resistance=0.16), 0.1), "none", "ground"),
]


@pytest.mark.parametrize(("before", "after", "pull", "cause"), CASES)
def test_a_change_that_a_tool_may_have_made_says_so(before, after, pull, cause):
    """A plough that comes in raises the pull, where that is measured; else the resistance, along the curve of one ground."""
    for seed in range(2):
        estimates = drive(seed, [("one", before, 40), ("other", after, 40), ("one", before, 40)], wander=0.02)
        blocks = estimates_blocks(estimates)
        for changes in (changes_of(blocks, pull=pull), OnlineChanges(pull=pull).update(blocks)):
            assert {change.cause for change in changes} == {cause}


@pytest.mark.parametrize(
    ("channels", "stated", "note"),
    [
        (["drawbar_force"], {}, None),
        (["ground_speed"], {}, "2 of 2 changes may be a tool's.*write 'uncertainty: {drawbar_force: 0}'"),
        (["ground_speed"], {"drawbar_force": 100}, "2 of 2 changes may be a tool's"),
        (["ground_speed"], {"drawbar_force": 0}, None),
    ],
)
def test_a_note_counts_the_changes_that_may_be_a_tools(channels, stated, note):
    """Resistance alone changes: the ground's where the pull is measured and stays, or nothing is towed."""
    vehicle = Vehicle.from_dict({**VEHICLE, "uncertainty": stated}).to_dict()
    one, other = CASES[3][:2]
    pieces = [("one", one, 40), ("other", other, 40), ("one", one, 40)]
    ground, _ = analyse(drive(1, pieces, wander=0.02, vehicle=vehicle, settings={"channels": channels}))
    counted = [one for one in ground.notes if "may be a tool's" in one]
    assert bool(counted) == (note is not None)
    assert note is None or re.search(note, counted[0])
    assert {one.cause for one in ground.changes} == {"ground" if note is None else "tool or ground"}
    drawn = [line.get_linestyle() for line in ground.plot().axes[0].lines if line.get_marker() == "None"]
    assert drawn == ["-" if note is None else ":"] * 2


def test_noise_is_the_estimates_own_and_the_grounds():
    """White noise counts whole, what outlasts a step by half, up to what is usual; steps of the level pass for neither."""
    rng = np.random.default_rng(0)
    white = rng.standard_normal(8000)
    ground = np.repeat(rng.standard_normal(4000), 2)
    slow = np.repeat(rng.standard_normal(1000), 8)
    levels = 8 * (np.arange(8000) // 400 % 2)
    signals = 0.03 * np.column_stack([white, white + levels, white + ground, white + 9 * slow])
    within, weight = noise_of(signals, ("slip",) * 4)
    floor = np.sqrt(1 + 0.25)  # half of what is usual: no ground is quite even
    np.testing.assert_allclose(within / 0.03, [floor, floor, np.sqrt(2), np.sqrt(2)], rtol=0.1)
    np.testing.assert_allclose(weight[[0, 1, 3]], [1.25 / 1.5, 1.25 / 1.5, 2 / 3], rtol=0.1)
    assert 2 / 3 < weight[2] < 1.25 / 1.5  # half of the neighbours share the ground


def test_standing_still_changes_nothing():
    """The chance of a change goes with the way: the same signals at a standstill are reported later, or never."""
    estimates = drive(2, [("fine", FINE, 60), ("grass", GRASS, 4)])
    still = replace(
        estimates, columns={**estimates.columns, "distance": np.minimum(estimates.columns["distance"], 33.0)}
    )
    assert len(OnlineChanges().update(estimates_blocks(estimates))) == 1
    assert OnlineChanges().update(estimates_blocks(still)) == []


def plain_probabilities(x: np.ndarray, hazard: float, model: Model) -> np.ndarray:
    """Adams and MacKay's recursion in the plain: log P(the present ground began at block k | all), after the last block."""
    joint = np.array([0.0])
    for n in range(len(x)):
        grown = joint + np.log1p(-hazard) if n else joint
        fresh = logsumexp(joint) + np.log(hazard) if n else -np.inf
        joint = np.append(grown, fresh)
        for k in range(len(joint)):
            joint[k] += predictive(model, x[max(k - 1, 0) : n + 1] if k else x[: n + 1])[-1]
    return joint - logsumexp(joint)


def test_the_detector_is_the_plain_recursion(monkeypatch):
    blocks = estimates_blocks(drive(3, [("fine", FINE, 5), ("grass", GRASS, 3)]))
    blocks = blocks[blocks.known]
    x, model = signals_of(blocks), replace(Model.of(GROUND, USUAL), weight=np.ones(4))
    monkeypatch.setattr("terragrip.ground.online_changes._LEAST", 0.0)
    monkeypatch.setattr(
        "terragrip.ground.online_changes.noise_of",
        lambda *_: USUAL._replace(weight=np.ones(4)),
    )
    detector = OnlineChanges(length=30)
    detector.update(blocks)
    hazard = -np.expm1(-0.3 / 30)  # 0.3 m a block
    expected = plain_probabilities(x, hazard, model)
    assert expected[1] == -np.inf  # the first block ends no ground
    np.testing.assert_allclose(detector._probability, np.exp(np.delete(expected, 1)), rtol=1e-6, atol=1e-12)


def test_a_change_is_told_soon_and_once():
    changes = OnlineChanges().update(estimates_blocks(drive(4, [("grass", GRASS, 40), ("fine", FINE, 40)])))
    assert len(changes) == 1
    assert 40 < changes[0].reported < 43.5
    assert changes[0].time == pytest.approx(40, abs=1)
    assert 0.8 <= changes[0].probability <= 1


def test_block_by_block_and_with_a_break_it_tells_the_same():
    blocks = estimates_blocks(
        thinned(drive(5, [("grass", GRASS, 30), ("coarse", COARSE, 30)]), 4)
    )  # no roughness
    step = 1.0  # m: some blocks, of which the break leaves some pending
    whole = OnlineChanges(step).update(blocks)
    first = OnlineChanges(step)
    result = [reported for k in range(50) for reported in first.update(blocks[k : k + 1])]
    second = OnlineChanges(step)
    second.restore(json.loads(json.dumps(first.to_dict(), allow_nan=False)))
    result += second.update(blocks[50:])
    assert result == whole
    assert len(whole) == 1


def test_slow_roughness_lets_levels_speak():
    """At 4 Hz a half second has two rows: no roughness, but a change of level is still found; at 1 Hz too."""
    estimates = drive(6, [("grass", GRASS, 40), ("fine", FINE, 40)])
    for every in (5, 20):
        result = changes_of(estimates_blocks(thinned(estimates, every)))
        assert [change.time for change in result] == pytest.approx([40], abs=1.5)


@pytest.mark.parametrize("scale", [1, 4])
def test_hard_grounds_that_come_and_go_are_told_apart(scale):
    """rho_s .045 and .1 for five vehicle lengths each, crossed within one: by a robot and, in four times the time, a tractor."""
    hard, soft = Ground(0.7, 0.045, 0.004), Ground(0.7, 0.1, 0.009)
    parts = []
    for k in range(6):
        one, other = (hard, soft) if k % 2 == 0 else (soft, hard)
        ramp = [
            replace(one, resistance=w * other.resistance + (1 - w) * one.resistance)
            for w in (0.2, 0.4, 0.6, 0.8)
        ]
        parts += [("one", one, 22 * scale), *(("border", part, scale) for part in ramp)]
    estimates = drive(8, [*parts, ("one", hard, 14 * scale)], speed=0.5)
    length = 2.7 * scale
    blocks = estimates_blocks(estimates)
    borders = scale * (24 + 26 * np.arange(6))
    result = changes_of(blocks, step=length / A_LENGTH)
    assert [change.time for change in result] == pytest.approx(borders, abs=2 * scale)
    live = OnlineChanges(length / A_LENGTH).update(blocks)
    assert 4 <= len(live) <= 6
    assert all(np.abs(borders - change.time).min() < 3 * scale for change in live)


@given(st.lists(st.integers(1, 40), min_size=1, max_size=6), st.floats(0.0, 3.0))
@settings(max_examples=20)
def test_steps_are_means_of_their_blocks_however_they_come(cuts, length):
    blocks = estimates_blocks(drive(9, [("fine", FINE, 12), ("grass", GRASS, 8)]))
    whole, rest, _ = steps_of(blocks, length)
    known = blocks[blocks.known]
    shown = known[: len(known) - len(rest)]
    assert whole.usable.sum() == shown.usable.sum()
    counts = np.searchsorted(shown.travelled, whole.travelled, side="right")
    firsts = np.concatenate(([0], counts[:-1]))
    means = [shown.resistance[a:b].mean() for a, b in zip(firsts, counts, strict=True)]
    np.testing.assert_allclose(whole.resistance, means, rtol=1e-12)
    assert (np.diff(whole.travelled) >= 0.999 * length).all()
    begin, pending, pieces = None, blocks[:0], blocks[:0]
    for part in np.split(np.arange(len(blocks)), np.minimum(np.cumsum(cuts), len(blocks))):
        some, pending, begin = steps_of(joined(pending, blocks[part]), length, begin)
        pieces = joined(pieces, some)
    np.testing.assert_array_equal(pieces.resistance, whole.resistance)
    np.testing.assert_array_equal(pieces.start, whole.start)


@pytest.mark.sample(2)
@pytest.mark.parametrize("one_ground", [10, 120])
def test_a_long_drive_searched_in_pieces_has_the_changes_of_the_whole(monkeypatch, one_ground):
    pieces = [("grass", GRASS, one_ground), ("fine", FINE, one_ground)] * (240 // one_ground)
    blocks = estimates_blocks(drive(7, pieces))
    whole = changes_of(blocks)
    monkeypatch.setattr(changes_module, "_SEARCHED", 100)
    assert changes_of(blocks) == whole
    assert len(whole) == pytest.approx(480 / one_ground - 1, abs=2)


def test_a_long_drive_on_one_ground_is_searched_a_few_times_over(monkeypatch):
    """Pieces without a border grow by their own size: the work goes with the length of the drive."""
    searched, pelt = [], changes_module._pelt
    monkeypatch.setattr(changes_module, "_SEARCHED", 20)
    monkeypatch.setattr(
        changes_module,
        "_pelt",
        lambda c, begin, end, p: searched.append(end - begin) or pelt(c, begin, end, p),
    )
    x = np.array([0.12, 0.85, -5.7, -5.1]) + np.random.default_rng(0).standard_normal((600, 4)) * 0.01
    assert _borders(_Cost(x, Model.of(GROUND, USUAL)), 8.0) == []
    assert sum(searched) < 3 * len(x)


def test_a_creep_before_a_standstill_is_no_change():
    """As the vehicle rolls out slip is anything, and mu and rho_s with it."""
    stop = Ground(0.2, 0.02, slip=0.02)
    estimates = drive(8, [("fine", FINE, 40), ("stop", stop, 4), ("fine", FINE, 40)])
    creeps = np.asarray(estimates["soil"]) == "stop"
    stds = {
        name: np.where(creeps, 0.4, 0.02)
        for name in estimates.names
        if name.startswith("slip_") and name.endswith("_std")
    }
    assert len(changes_of(estimates_blocks(estimates))) == 2
    assert not changes_of(estimates_blocks(replace(estimates, columns={**estimates.columns, **stds})))


def test_noise_in_slip_makes_no_scale():
    """A pull that slips by 2 % on a usual curve, slip known to 4 %: what noise measures, more or less, tells nothing of the curve."""
    blocks = estimates_blocks(drive(9, [("fine", FINE, 20)]))
    rng = np.random.default_rng(9)
    slip = 0.02 + 0.04 * rng.standard_normal(blocks.slip.shape)
    usual = CURVES["exponential"].value(np.array([0.02]), {"a": 0.85})
    made = replace(
        blocks, slip=slip, slip_variance=np.full_like(slip, 0.04**2), adhesion=np.full_like(slip, usual)
    )
    assert not np.isfinite(signals_of(made, ("curve_scale",))).any()


def test_short_and_empty_drives_have_none():
    blocks = estimates_blocks(drive(7, [("fine", FINE, 3)]))
    assert changes_of(blocks) == ()
    assert OnlineChanges().update(blocks) == []


def test_the_curve_scale_is_the_one_that_made_the_pair():
    slip = np.array([0.1, 0.2, 0.4])
    mu = CURVES["exponential"].value(slip, {"a": 0.4})
    np.testing.assert_allclose(curve_scale(slip, mu), 0.4, rtol=0.06)
    assert curve_scale(np.array([0.0]), np.array([0.0]))[0] == pytest.approx(0.85)


def test_without_ruptures_or_with_an_unknown_signal_one_line(monkeypatch):
    blocks = estimates_blocks(drive(9, [("fine", FINE, 20)]))
    with pytest.raises(InputError, match="no signal 'colour'"):
        changes_of(blocks, ("colour",))
    monkeypatch.setitem(sys.modules, "ruptures.detection.pelt", None)
    with pytest.raises(InputError, match=r"terragrip\[ground\]"):
        changes_of(blocks)
