"""Recognition: the filter against dense matrices, an unknown soil, twins that share, and what a library lacks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ground_drives import COARSE, FINE, GRASS, RATE, Ground, drive, thinned
from ground_library import learned
from terragrip.errors import InputError
from terragrip.ground.analysis import Settings, analyse
from terragrip.ground.emissions import Emissions
from terragrip.ground.recognition import LENGTH, ForwardFilter, by_soil
from terragrip.ground.unknown import CELLS
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import estimates_blocks
from terragrip.soil.estimates import GatheredRuns
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.literature import literature_soils
from terragrip.soil.signature import signature_in

MIXED = [("grass", GRASS, 30), ("fine", FINE, 30), ("coarse", COARSE, 30), ("grass", GRASS, 20)]


def without(library: SoilLibrary, *names: str) -> SoilLibrary:
    return SoilLibrary({k: v for k, v in library.items() if k not in names})


def share(timeline, label: str, soil: str) -> float:
    """How much of the blocks labelled `label` is named `soil`."""
    rows = timeline.label == label
    return float((timeline.soil[rows] == soil).mean())


def test_filter_and_smoother_are_those_of_dense_matrices(library):
    emissions = Emissions(dict(library))
    blocks = estimates_blocks(drive(1, [("grass", GRASS, 8), ("fine", FINE, 8)]))
    forward = ForwardFilter(emissions).update(blocks)
    likelihood, start = np.exp(emissions.log_likelihood(blocks, np.ones(len(blocks)))), forward.start
    n = len(start)
    driven = np.diff(blocks.travelled, prepend=blocks.travelled[0])
    steps = [(s := np.exp(-d / LENGTH)) * np.eye(n) + (1 - s) * np.tile(start, (n, 1)) for d in driven]
    alpha, filtered = start, []
    for step, seen in zip(steps, likelihood, strict=True):
        alpha = (alpha @ step) * seen
        alpha /= alpha.sum()
        filtered.append(alpha)
    beta, both = np.ones(n), [filtered[-1]]
    for k in range(len(blocks) - 2, -1, -1):
        beta = steps[k + 1] @ (likelihood[k + 1] * beta)
        beta /= beta.sum()
        both.append(filtered[k] * beta / (filtered[k] * beta).sum())
    np.testing.assert_allclose(forward.filtered, filtered, rtol=1e-8, atol=1e-14)
    np.testing.assert_allclose(forward.smoothed(), both[::-1], rtol=1e-8, atol=1e-14)
    assert forward.filtered.shape == (len(blocks), len(library) + CELLS)
    together = by_soil(forward.filtered, emissions.states)
    np.testing.assert_allclose(together[:, :3], forward.filtered[:, :3])
    np.testing.assert_allclose(together[:, 3], forward.filtered[:, 3:].sum(axis=1))


@pytest.mark.parametrize("online", [False, True])
def test_known_soils_are_named(library, online):
    ground, table = analyse(drive(2, MIXED), library, "m", Settings(online=online))
    for soil in library:
        assert share(ground.timeline, soil, soil) > (0.85 if online else 0.97)
    assert [s.soil for s in ground.sections] == ["grass", "fine", "coarse", "grass"]
    assert set(table["soil_estimate"]) <= {*library, "unknown"}
    assert np.nanmin(table["soil_probability"]) > 0.2
    assert ground.notes == ()


@pytest.mark.parametrize("missing", ["grass", "coarse"])
def test_a_soil_that_the_library_does_not_hold_is_unknown(library, missing):
    timeline = analyse(drive(3, MIXED), without(library, missing))[0].timeline
    assert share(timeline, missing, "unknown") > 0.9
    for soil in library:
        if soil != missing:
            assert share(timeline, soil, soil) > 0.95


def test_a_library_without_the_soils_driven_says_so(library):
    ground, table = analyse(drive(4, [("ice", Ground(0.16, 0.03), 40)]), library)
    assert set(table["soil_estimate"][400:]) == {"unknown"}
    assert ground.notes == ("No soil of the library fits any of the drive: all of it is unknown.",)


def test_what_no_soil_can_be_is_unknown(library):
    estimates = drive(13, [("fine", FINE, 30)])
    estimates.columns["soil_resistance"] *= 1e5
    ground = analyse(estimates, library)[0]
    assert ground.soils == ("unknown",)


def test_twins_share_the_probability(library):
    """Two soils that cannot be distinguished: half each, whichever was driven."""
    twins = SoilLibrary({**library, "twin": replace(library["fine"], name="twin")})
    timeline = analyse(drive(5, [("fine", FINE, 60)]), twins)[0].timeline
    last = dict(zip(timeline.names, timeline.probabilities[-1], strict=True))
    assert last["fine"] == pytest.approx(last["twin"])
    assert last["fine"] + last["twin"] > 0.99


@pytest.mark.parametrize(
    ("key", "change"), [("roughness_covariance", lambda x: 0.6 * x), ("roughness", lambda x: x + 0.02)]
)
def test_twins_whose_few_blocks_scattered_otherwise_share_the_probability(library, key, change):
    """How much a minute's blocks happened to scatter, and where their mean lies within that, is no mark of a soil."""
    fine = signature_in(library["fine"])
    other = {**fine.to_dict(), key: change(getattr(fine, key)).tolist()}
    twin = replace(library["fine"], name="twin", fit={**library["fine"].fit, "signature": other})
    soils = SoilLibrary({"fine": library["fine"], "twin": twin})
    timeline = analyse(drive(5, [("fine", FINE, 60)]), soils)[0].timeline
    assert timeline.probabilities[20:, 0] == pytest.approx(timeline.probabilities[20:, 1], abs=0.02)


def test_standing_still_carries_the_soil_on(library):
    estimates = drive(6, [("fine", FINE, 60)])
    estimates.columns["distance"][600:] = estimates.columns["distance"][600]
    for name in estimates.columns:
        if name.startswith("slip"):
            estimates.columns[name][600:] = np.nan
    timeline = analyse(estimates, library, settings=Settings(online=True))[0].timeline
    assert not timeline.known[62:].any()
    np.testing.assert_allclose(timeline.probabilities[62:], np.tile(timeline.probabilities[62], (58, 1)))


def test_wide_intervals_make_soils_hard_to_tell(library):
    """The estimates' own SDs enter: twenty times as wide, the same drive names its soil with ten times the doubt or more."""
    sharp = drive(7, [("fine", FINE, 30)])
    wide = replace(sharp, columns={k: 20 * v if k.endswith("_std") else v for k, v in sharp.columns.items()})
    one, other = (analyse(e, library)[0].timeline for e in (sharp, wide))
    fine = one.names.index("fine")
    doubts = [1 - timeline.probabilities[20:, fine].mean() for timeline in (one, other)]
    assert doubts[1] > 10 * doubts[0]


def test_soils_without_a_signature_are_told_by_curve_and_resistance():
    """Of a library that is older, or from the literature: named with less certainty, and said."""
    soils = {
        name: Soil(name, "exponential", {"a": g.a}, resistance=(g.resistance, 0.02))
        for name, g in {"grass": GRASS, "fine": FINE}.items()
    }
    ground = analyse(drive(8, [("grass", GRASS, 40), ("fine", FINE, 40)]), SoilLibrary(soils))[0]
    assert share(ground.timeline, "grass", "grass") > 0.8
    assert share(ground.timeline, "fine", "fine") > 0.8
    assert "no signature of grass, fine" in ground.notes[0]
    assert analyse(drive(8, [("fine", FINE, 30)]), literature_soils())[0].timeline.probabilities.sum(
        axis=1
    ) == pytest.approx(1)


def test_roughness_of_another_method_is_not_compared(library):
    smoothed = drive(9, [("fine", FINE, 40)], smooth=True)
    ground = analyse(smoothed, library)[0]
    assert "these are by bank, smoothed: their roughness is not compared" in ground.notes[0]
    assert share(ground.timeline, "fine", "fine") > 0.5


def test_an_empty_library_and_none_name_nothing():
    for library in (None, SoilLibrary({})):
        ground = analyse(drive(10, [("grass", GRASS, 30), ("fine", FINE, 30)]), library)[0]
        assert set(ground.timeline.soil) == {"unknown"}
        assert len(ground.changes) == 1
        assert ("The library holds no soil, so none is named." in ground.notes) == (library is not None)
        assert not any("No soil of the library fits" in note for note in ground.notes)


def test_a_damaged_signature_is_named(library):
    bad = replace(library["fine"], fit={"signature": {"level": 1}})
    with pytest.raises(InputError, match=r"soils\.fine\.signature"):
        analyse(drive(11, [("fine", FINE, 10)]), SoilLibrary({"fine": bad}))


def test_nothing_to_read_is_said(library):
    estimates = drive(12, [("fine", FINE, 20)])
    estimates.event_codes[:] = 2
    ground = analyse(estimates, library)[0]
    assert "No stretch of the drive shows the ground" in ground.notes[0]
    assert ground.sections[0].slip_mean is None
    assert [e.kind for e in ground.events] == ["standstill"]


@pytest.mark.parametrize("hertz", [1, 4])
def test_slow_logs_teach_and_name_soils_by_level(hertz):
    """Under 8 Hz no signature was learned, and at 1 Hz no block showed the ground at all."""
    every = int(RATE) // hertz
    pieces = [("grass", GRASS, 60), ("fine", FINE, 60)]
    library = learned([thinned(drive(seed, pieces), every) for seed in (1, 2)])
    assert all(signature_in(soil).roughness is None for soil in library.values())
    ground, _ = analyse(thinned(drive(3, pieces), every), library)
    assert [section.soil for section in ground.sections] == ["grass", "fine"]
    assert min(max(section.probabilities.values()) for section in ground.sections) > 0.9


def test_slip_that_is_not_known_leaves_the_soil_to_the_resistance(library):
    """Slip +- .3: a curve's error is at most its height; by its slope alone every known soil was thought impossible."""
    blind = drive(4, [("grass", GRASS, 60)])
    wide = {
        name: np.full_like(x, 0.3)
        for name, x in blind.columns.items()
        if name.startswith("slip_") and name.endswith("_std")
    }
    ground, _ = analyse(replace(blind, columns={**blind.columns, **wide}), library)
    assert [section.soil for section in ground.sections] == ["grass"]


def test_a_soil_without_a_curve_is_recognised_by_its_resistance(tmp_path):
    """On wet ground the drives hold too little slip for a curve: left out of the library it would be unknown, or another soil."""
    wet = Ground(0.8, 0.17, 0.008, 0.004)
    gathered = GatheredRuns()
    for seed in (1, 2):
        gathered.add(drive(seed, [("fine", FINE, 40)]), f"fine {seed}")
        gathered.add(with_little_slip(drive(seed, [("wet", wet, 40)])), f"wet {seed}")
    gathered.learn().library().write(tmp_path / "soils.json")
    library = SoilLibrary.load(tmp_path / "soils.json")
    assert list(library) == ["fine"]
    assert list(library.not_fitted) == list(library.without_curve) == ["wet"]

    table = with_little_slip(drive(9, [("wet", wet, 40)]))
    ground = analyse(table, library)[0]
    assert share(ground.timeline, "wet", "wet") > 0.9
    assert any("holds no curve of wet" in note for note in ground.notes)
    assert share(analyse(drive(9, [("fine", FINE, 40)]), library)[0].timeline, "fine", "fine") > 0.9


def with_little_slip(estimates):
    """The drive at a pull that slips by 0.3 %, known to 3 %."""
    rng, rows = np.random.default_rng(len(estimates)), len(estimates)
    columns = dict(estimates.columns)
    for name in [n for n in columns if n.startswith("slip_")]:
        noise = 0.03 * np.repeat(rng.standard_normal(rows // 20 + 1), 20)[:rows]
        columns[name] = np.full(rows, 0.03) if name.endswith("_std") else 0.003 + noise
    for name in [n for n in columns if n.startswith("adhesion_") and not n.endswith("_std")]:
        columns[name] = 0.03 + 0.005 * rng.standard_normal(rows)
    return replace(estimates, columns=columns)


def test_slowly_driven_ground_counts_by_the_way():
    """Half the speed, half the ground: the evidence of a block halves where it is of the same wheels' ground, and is not more at speed."""
    blocks = estimates_blocks(drive(6, [("fine", FINE, 20)]))
    library = literature_soils()
    emissions = Emissions(dict(library), length=4.0)
    slow, slower, fast = (
        emissions.log_likelihood(blocks, np.full(len(blocks), way))[blocks.known] for way in (0.2, 0.1, 9.0)
    )
    timed = Emissions(dict(library)).log_likelihood(blocks, np.full(len(blocks), 0.2))[blocks.known]
    levels = slow - slower  # roughness, which counts by time, is in both
    np.testing.assert_allclose(levels, 0.1 / 3.0 * (fast - slow) / (0.5 / 3.5 - 0.2 / 3.0), rtol=1e-9)
    np.testing.assert_allclose(fast, timed, rtol=1e-12)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_where_slip_errs_the_flatter_of_two_curves_does_not_win_by_its_name(seed):
    """The same error of slip is a small one of mu on a flat curve: as a density of mu alone that made flat soils likelier."""
    rng, estimates = np.random.default_rng(seed), drive(3, [("steep", FINE, 60)])
    slip = 0.05 + 0.02 * np.sin(estimates.time / 7)
    off = np.repeat(0.05 * rng.standard_normal(len(slip) // 10), 10)  # of the ground speed, by blocks
    columns = dict(estimates.columns)
    for wheel in estimates.wheels:
        columns[f"adhesion_{wheel}"] = CURVES["exponential"].value(slip, {"a": 1.2})
        columns |= {f"slip_{wheel}": slip + off, f"slip_{wheel}_std": np.full(len(slip), 0.05)}
    blocks = estimates_blocks(replace(estimates, columns=columns))
    soils = {name: Soil(name, "exponential", {"a": a}) for name, a in (("flat", 0.7), ("steep", 1.2))}
    emissions = Emissions(soils)
    likelihood = emissions.log_likelihood(blocks, np.ones(len(blocks))).sum(axis=0)
    flat, steep = (likelihood[emissions.states == k].max() for k in range(2))
    assert steep > flat
