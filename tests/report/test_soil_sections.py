"""Curves in the report: the paper's numbers, ours and the truth side by side, and what is said where there is none."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import made_up
from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.report import soil_sections, trust_sections
from terragrip.report.curves import SoilCurves, draw_both_maxima, draw_fits, maxima
from terragrip.report.page import Picture, Section, Table
from terragrip.soil.estimates import GatheredRuns
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.known import known_soils
from terragrip.soil.learn import Campaign, LearnedSoil
from terragrip.soil.library import Soil, SoilLibrary


@pytest.fixture(scope="module", name="curves")
def curves_fixture() -> list[SoilCurves]:
    """hard and fine, six runs each, with a truth, the same fit on "true" pairs."""
    gathered = GatheredRuns()
    for i, soil in enumerate(["hard", "fine"] * 6):
        gathered.add(made_up.estimates(1000 + i, (soil,)), f"{soil}-{i}")
    campaign = gathered.learn()
    truth = {n: Soil(n, "exponential", {"a": made_up.A[n]}, resistance=(0.1, 0.0)) for n in ("hard", "fine")}
    slip = np.linspace(0.05, 0.6, 5000)
    true = {
        n: AdhesionCurve(bootstrap=0).fit(slip, CURVES["exponential"].value(slip, {"a": a}))
        for n, a in made_up.A.items()
    }
    return soil_sections.curves_of_all(campaign, truth, true)


def tables(section: Section) -> list[Table]:
    return [item for item in section.content if isinstance(item, Table)]


def test_the_table_holds_the_papers_numbers_ours_and_the_truth(curves: list[SoilCurves]) -> None:
    quality, scale = tables(soil_sections.fits(curves, {}))
    cells = {row[0]: dict(zip(scale.header, row, strict=True)) for row in scale.rows}
    assert cells["hard"]["paper"] == "1.420"
    assert cells["fine"]["truth"] == "0.850"
    for name, a in (("hard", 1.42), ("fine", 0.85)):
        assert float(cells[name]["ours, by pull"]) == pytest.approx(a, rel=0.03)
        assert float(cells[name]["ours, by slip"]) == pytest.approx(a, rel=0.03)
        assert float(cells[name]["true pairs, by pull"]) == pytest.approx(a, abs=1e-3)
    row = dict(zip(quality.header, quality.rows[0], strict=True))
    assert (row["soil"], row["NRMSE: paper"], row["R²: paper"], row["runs"]) == (
        "hard",
        "0.046",
        "0.975",
        "6",
    )
    assert float(row["R²: ours, by pull"]) > 0.97


def test_soils_beside_each_other_are_drawn_whole(curves: list[SoilCurves]) -> None:
    """Under its own name each; the first soil's height cut those of firmer ground."""
    hard, fine = curves
    drawn = draw_fits([fine, hard])
    assert all(text in drawn for text in (">0.7</text>", ">hard</text>", ">fine</text>"))


def test_a_fit_that_is_a_hint_only_does_not_look_the_surest(curves: list[SoilCurves]) -> None:
    """Elsewhere than in the paper, and without an interval: no columns of dashes, a dotted line, and it is said at each number."""
    hints = [replace(one, name=f"soil{i}", paper=None, learned=_guessed(one)) for i, one in enumerate(curves)]
    section = soil_sections.fits(hints, {})
    assert not any("paper" in head for table in tables(section) for head in table.header)
    assert "Dotted: a hint only" in section.content[0].caption
    assert "a hint only" in draw_fits(hints)
    assert "a hint only" not in draw_fits(curves)
    (peaks,) = tables(soil_sections.both_maxima(hints, 0.02))
    assert all(cell.endswith("a hint") for row in peaks.rows for cell in row[1:3])


def _guessed(one: SoilCurves) -> LearnedSoil:
    return replace(one.learned, curve=AdhesionCurve(bootstrap=0).fit_bins(one.learned.curve.bins_))


def test_hard_stands_first_and_alone_as_in_the_paper(curves: list[SoilCurves]) -> None:
    pictures = [item for item in soil_sections.fits(curves, {}).content if isinstance(item, Picture)]
    assert [picture.name for picture in pictures] == ["fit-hard", "fits"]
    for picture in pictures:
        assert "simulated truth" in picture.svg
        assert "simulated truth" in picture.caption
        assert "95 %" in picture.caption
    # a mark and a bar for each used bin of hard, by pull and by slip
    learned = curves[0].learned
    assert 40 < int(learned.by_slip.bins_.used.sum()) <= 55
    bins = len(learned.soil.bins) + int(learned.by_slip.bins_.used.sum())
    assert pictures[0].svg.count("<use") >= bins


def test_maxima_are_those_of_the_formula(curves: list[SoilCurves]) -> None:
    """eta = kappa/(kappa + rho)(1 - s) on a fine grid, written out here once more."""
    soil = Soil("x", "exponential", {"a": 0.85}, resistance=(0.1, 0.0))
    result = maxima(soil, 0.02)
    s = np.linspace(1e-4, 1, 200_001)
    mu = 0.85 * (1 - 0.52 * np.exp(0.01 * s) - 0.48 * np.exp(-11.36 * s))
    eta = np.where(mu > 0.1, (mu - 0.1) / (mu + 0.02) * (1 - s), 0)
    assert result.adhesion == pytest.approx((s[mu.argmax()], mu.max()), abs=2e-4)
    assert result.efficiency == pytest.approx((s[eta.argmax()], eta.max()), abs=2e-4)
    (table,) = tables(soil_sections.both_maxima(curves, 0.02))
    fine = dict(zip(table.header, next(row for row in table.rows if row[0] == "fine"), strict=True))
    assert fine["true largest η"] == f"{eta.max():.2f} at {100 * s[eta.argmax()]:.0f} %"


def test_the_badge_says_that_four_parameters_are_too_many(curves: list[SoilCurves]) -> None:
    section = trust_sections.trust(curves)
    assert "draws the same curve" in section.prose[0]
    assert re.search(r"A = 0\.\d+, k = \d+\.\d+, d = ", section.prose[0])
    badges, ranking = tables(section)
    assert all(row[1].startswith("yes") for row in badges.rows)
    for row in ranking.rows:
        errors = dict(zip(ranking.header[2:], map(float, row[2:]), strict=True))
        assert errors[row[1]] == min(errors.values())
        assert (
            errors["exponential"] < 0.02
        )  # the soils were made with it: 0.02 of scatter, hundreds of samples a bin


def test_what_lacks_is_said_and_where_nothing_lacks_too(curves: list[SoilCurves]) -> None:
    section = trust_sections.what_is_missing(curves)
    (table,) = tables(section)
    assert all(row[1].endswith("to 60 %") for row in table.rows)
    assert any("no data between" in sentence for sentence in section.prose)
    pulls = [row[2].removesuffix(" N").split(" to ") for row in table.rows]
    assert all(len(set(pull)) == len(pull) for pull in pulls)  # '870 to 870 N' is one


def test_without_soils_each_section_says_why() -> None:
    for section in (
        soil_sections.both_maxima([], 0.02),
        soil_sections.fits([], {}),
        trust_sections.trust([]),
        trust_sections.what_is_missing([]),
    ):
        assert section.omitted is not None
        assert "soil label" in section.omitted
        assert not section.content
    missed = {"clay": "1 slip bins"}
    for section in (soil_sections.both_maxima([], 0.02, missed), trust_sections.trust([], missed)):
        assert section.omitted == "Left out: no soil could be fitted."
    missed = soil_sections.fits([], missed)
    assert missed.prose == ("clay: not fitted, 1 slip bins.",)


def test_a_library_is_shown_as_it_was_learned(curves: list[SoilCurves], tmp_path: Path) -> None:
    """soils.json holds all that the tables and the drawn curves say: one curve, whoever shows it."""
    Campaign({one.name: one.learned for one in curves}, {}, ()).library().write(tmp_path / "soils.json")
    campaign = known_soils(SoilLibrary.load(tmp_path / "soils.json"), ["hard", "fine", "clay"])
    assert campaign.not_fitted == {"clay": "the library does not contain it"}
    shown = soil_sections.curves_of_all(campaign)
    fresh = soil_sections.curves_of_all(Campaign({one.name: one.learned for one in curves}, {}, ()))
    for mine, theirs in zip(
        tables(soil_sections.fits(shown, {})), tables(soil_sections.fits(fresh, {})), strict=True
    ):
        assert mine.header == theirs.header
        assert [row[:-1] for row in mine.rows] == [row[:-1] for row in theirs.rows]
    for mine, theirs in zip(shown, fresh, strict=True):
        grid = np.linspace(0.05, 0.6, 12)
        assert np.array_equal(mine.learned.curve.predict(grid), theirs.learned.curve.predict(grid))
        assert np.allclose(mine.learned.curve.band(grid), theirs.learned.curve.band(grid), atol=1e-5)
        assert mine.learned.curve.bins_.to_list() == theirs.learned.curve.bins_.to_list()
    assert "terragrip soils" in (trust_sections.what_is_missing(shown).omitted or "")


def test_what_lies_beyond_the_bins_is_not_drawn_as_known(curves: list[SoilCurves]) -> None:
    """Curves fitted up to 3 or 6 % of slip were 40 to 90 % off at 20 %, with the badge, a full line and a marked maximum there."""
    shown = curves[0]
    peaks = maxima(shown.learned.soil, 0.02)
    assert peaks.efficiency[0] < shown.reach < peaks.adhesion[0]
    (table,) = tables(soil_sections.both_maxima(curves, 0.02))
    row = dict(zip(table.header, table.rows[0], strict=True))
    assert row["largest µ"].endswith(", beyond the data")
    assert "beyond" not in row["largest η"]
    drawn = draw_both_maxima(shown, 0.02)
    assert drawn.count("beyond the data") == 1
    assert "opacity: 0.6" in draw_fits([shown])
    assert "opacity: 0.08" in draw_fits([shown])


def test_a_library_carries_the_band_of_a_curve_with_several_free_parameters(tmp_path: Path) -> None:
    gathered = GatheredRuns()
    for i in range(6):
        gathered.add(made_up.estimates(1100 + i, ("fine",)), f"fine-{i}")
    learned = gathered.learn(AdhesionCurve("effective", "free", bootstrap=300)).soils["fine"]
    assert len(learned.curve.free_) > 1
    Campaign({"fine": learned}, {}, ()).library().write(tmp_path / "soils.json")
    read = known_soils(SoilLibrary.load(tmp_path / "soils.json"), ["fine"]).soils["fine"].curve
    slips = np.linspace(0.05, 0.6, 23)
    low, high = learned.curve.band(slips)
    assert np.max(np.abs(np.array(read.band(slips)) - np.array([low, high]))) < 0.05 * np.max(high - low)
    drawn = draw_fits(soil_sections.curves_of_all(Campaign({"fine": replace(learned, curve=read)}, {}, ())))
    assert "95 % of the fit" in drawn
    data = json.loads((tmp_path / "soils.json").read_text())
    for wrong in (
        {"slip": [0, 1]},
        {"slip": [1, 0], "low": [0, 0], "high": [1, 1]},
        {"slip": [0, 1], "low": [0, "x"], "high": [1, 1]},
    ):
        data["soils"]["fine"]["band"] = wrong
        (tmp_path / "bad.json").write_text(json.dumps(data))
        with pytest.raises(InputError, match="band"):
            SoilLibrary.load(tmp_path / "bad.json")


def test_full_bins_are_not_called_enough_where_the_data_fix_no_curve(curves: list[SoilCurves]) -> None:
    full = [replace(one, learned=replace(one.learned, gaps=())) for one in curves]
    (text,) = trust_sections.what_is_missing(full, {}).prose
    assert "Yet" not in text or not all(one.learned.curve.identifiability_.identifiable for one in full)
    curve = full[0].learned.curve
    before = curve.identifiability_
    try:
        curve.identifiability_ = replace(before, identifiable=False)
        (text,) = trust_sections.what_is_missing(full, {}).prose
    finally:
        curve.identifiability_ = before
    assert f"the data do not fix the curve of {full[0].name} (R² " in text
