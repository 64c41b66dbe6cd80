"""soils.json: round trip, merging, comparing, and every way a file can be wrong."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from soil_campaign import pairs
from terragrip.errors import InputError
from terragrip.soil.digitised import read_points, soils_of_points
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.library import Soil, SoilLibrary, _refuse_bad_band
from terragrip.soil.literature import brixius_soil, burckhardt_grounds, literature_soils, paper_soils


def fitted(name="fine", seed=1):
    return Soil.from_curve(
        name, AdhesionCurve(bootstrap=200).fit(*pairs(seed, a=0.85)), "simulated", (0.12, 0.01)
    )


def test_round_trip(tmp_path):
    library = SoilLibrary({"fine": fitted()}, {"files": ["a.parquet"]}, {"wet": "too few bins"})
    library.write(tmp_path / "soils.json")
    again = SoilLibrary.load(tmp_path / "soils.json")
    assert again.to_dict() == library.to_dict()
    np.testing.assert_array_equal(again["fine"].value([0.1, -0.1]), library["fine"].value([0.1, -0.1]))
    raw = json.loads((tmp_path / "soils.json").read_text())["soils"]["fine"]
    assert {"model", "parameters", "interval", "r2", "nrmse", "bins"} <= set(raw)
    assert set(raw["bins"][0]) == {"slip", "mean", "std", "count"}
    assert raw["resistance"] == {"mean": 0.12, "std": 0.01}


@pytest.mark.parametrize("wrong", [float("nan"), float("inf")])
def test_a_number_that_is_none_is_not_written(tmp_path, wrong):
    path = tmp_path / "soils.json"
    paper_soils().write(path)
    before = path.read_bytes()
    for soil in (Soil("x", "exponential", {"a": wrong}), Soil("x", "exponential", {"a": 1.0}, r2=wrong)):
        with pytest.raises(InputError, match=r"soils\.json: a number of a soil is not one"):
            SoilLibrary({"x": soil}).write(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_each_constant_of_the_literature_is_the_one_printed_in_the_documents():
    """docs/physics.md states the paper's Table 1 and Burckhardt's constants; as many as there, and none besides."""
    text = " ".join((Path(__file__).parents[2] / "docs" / "physics.md").read_text(encoding="utf-8").split())
    (roads,) = re.findall(r"Burckhardt c1 \(1 - e\^\{-c2 s\}\) - c3 s: (.*?)\. - Pacejka", text)
    printed = {}
    for words in roads.split("; "):
        name, constants = re.fullmatch(r"(\D+) (\S+, \S+, \S+)", words).groups()
        printed[name] = dict(zip(("c1", "c2", "c3"), map(float, constants.split(", ")), strict=True))
    assert {name: soil.parameters for name, soil in burckhardt_grounds().items()} == printed
    nrmse, r2, names = re.search(r"Table 1: NRMSE ([\d. ]+), R² ([\d. ]+) for ([a-z, ]+)\.", text).groups()
    scales = dict(re.findall(r"(\w+) (\d\.\d+)", re.search(r"a by soil: (.*?)\. a is", text)[1]))
    table = zip(names.split(", "), map(float, nrmse.split()), map(float, r2.split()), strict=True)
    expected = {name: (float(scales[name]), square, error) for name, error, square in table}
    assert len(expected) == 5
    assert {n: (s.parameters["a"], s.r2, s.nrmse) for n, s in paper_soils().items()} == expected


def test_literature_is_as_printed():
    soils = literature_soils()
    assert len(soils) == 12
    assert soils["hard"].value(0.2) == pytest.approx(
        1.42 * (1 - 0.52 * np.exp(0.002) - 0.48 * np.exp(-2.272))
    )
    assert soils["ice"].value(0.1) == pytest.approx(0.05, abs=1e-9)
    assert all(soil.source for soil in soils.values())
    assert brixius_soil(900e3, 0.1, 0.4, 340).resistance[0] > 0
    assert brixius_soil(900e3, 0.1, 0.4, 340).name == "cone index 900 kPa"
    with pytest.raises(InputError, match="positive"):
        brixius_soil(-1, 0.1, 0.4, 340)


def test_burckhardts_roads_peak_where_the_literature_says():
    """Largest friction of each road, and full slip, as printed with his constants (Kiencke and Nielsen, Automotive Control Systems)."""
    peaks = {
        "dry asphalt": (0.17, 1.17, 0.76), "wet asphalt": (0.13, 0.80, 0.51), "dry concrete": (0.16, 1.09, 0.66),
        "dry cobble": (0.40, 1.00, 0.70), "wet cobble": (0.14, 0.38, 0.28), "snow": (0.06, 0.19, 0.13),
    }  # fmt: skip
    slip = np.linspace(0, 1, 10_001)
    for name, (at, most, sliding) in peaks.items():
        mu = literature_soils()[name].value(slip)
        assert slip[mu.argmax()] == pytest.approx(at, abs=0.006), name
        assert mu.max() == pytest.approx(most, abs=0.006), name
        assert mu[-1] == pytest.approx(sliding, abs=0.006), name


def test_the_spread_is_the_scatter_of_all_samples_about_the_curve():
    """Of the samples in the bins: each bin's own variance, and its mean's distance from the curve, weighted by their number."""
    slip, mu, run = pairs(4, "effective", A=0.6, k=12.0, d=0.5)  # a curve that the one fitted cannot follow
    curve = AdhesionCurve(bootstrap=0).fit(slip, mu, run)
    total = samples = 0.0
    for low in curve.bins_.settings.edges[:-1]:
        inside = (slip >= low) & (slip < low + 0.01)
        off = mu[inside] - curve.predict(np.array([slip[inside].mean()]))
        total, samples = total + float((off**2).sum()), samples + inside.sum()
    assert Soil.from_curve("x", curve).spread == pytest.approx(
        np.sqrt(total / samples), rel=5e-3
    )  # n for n - 1


def test_merge_refuses_twins_unless_told():
    with pytest.raises(InputError, match="both libraries hold a soil 'fine'"):
        paper_soils().merge(SoilLibrary({"fine": fitted()}))
    assert paper_soils().merge(SoilLibrary({"fine": fitted()}), "keep")["fine"].source.startswith("Kobelski")
    assert paper_soils().merge(SoilLibrary({"fine": fitted()}), "replace")["fine"].source == "simulated"
    with pytest.raises(InputError):
        paper_soils().merge(paper_soils(), "both")


def test_compare_says_how_far_apart():
    row = SoilLibrary({"fine": fitted()}).compare(paper_soils())[0]
    assert row["soil"] == "fine"
    assert row["largest"] < 0.05
    assert row["to"] == pytest.approx(fitted().reach)
    other = SoilLibrary({"fine": fitted(seed=2)})
    assert SoilLibrary({"fine": fitted()}).compare(other)[0]["intervals_meet"] == {"a": True}
    # an interval inside the other one meets it, one beyond it on either side does not
    for low, high, meets in ((0.45, 0.55, True), (0.1, 0.3, False), (0.7, 0.9, False)):
        mine, theirs = (replace(fitted(), interval={"a": ends}) for ends in ((0.4, 0.6), (low, high)))
        (row,) = SoilLibrary({"fine": mine}).compare(SoilLibrary({"fine": theirs}))
        assert row["intervals_meet"] == {"a": meets}


BAD = {
    "two soils of one name": '{"soils": {"a": {"model": "exponential", "parameters": {"a": 1}}, "a": {}}}',
    "newer version": '{"version": 9, "soils": {}}',
    "not JSON": "[",
    "a number without end": f'{{"version": {"1" * 5000}, "soils": {{}}}}',
    "empty": "",
    "no soils": '{"soil": {}}',
    "unknown model": '{"soils": {"a": {"model": "x"}}}',
    "unknown parameter": '{"soils": {"a": {"model": "exponential", "parameters": {"q": 1}}}}',
    "text for a number": '{"soils": {"a": {"model": "exponential", "parameters": {"a": "x"}}}}',
    "NaN": '{"soils": {"a": {"model": "exponential", "parameters": {"a": NaN}}}}',
    "interval of three": '{"soils": {"a": {"model": "exponential", "parameters": {"a": 1}, "interval": {"a": [1, 2, 3]}}}}',
    **{
        f"{key} that is none": '{"soils": {"a": {"model": "exponential", "parameters": {"a": 1}, "KEY": VALUE}}}'.replace(
            "KEY", key
        ).replace("VALUE", value)
        for key, value in {
            "interval": "[1]",
            "free": '[["a"]]',
            "settings": "7",
            "identifiability": '{"condition": 1.0}',
            "by_slip": '{"parameters": {}}',
        }.items()
    },
    "bins that are none": '{"soils": {"a": {"model": "exponential", "parameters": {"a": 1}, "bins": 3}}}',
    "points that are not numbers": '{"soils": {"a": {"model": "exponential", "parameters": {"a": 1}, "bins": [{"slip": "x"}]}}}',
}


@pytest.mark.parametrize("text", BAD.values(), ids=BAD)
def test_bad_libraries_are_named_in_one_line(tmp_path, text):
    (tmp_path / "s.json").write_text(text)
    with pytest.raises(InputError) as caught:
        SoilLibrary.load(tmp_path / "s.json")
    assert "\n" not in str(caught.value)
    assert "s.json" in str(caught.value)


@pytest.mark.parametrize(
    ("slip", "low", "high", "says"),
    [
        ([0.1, 0.2], [0.3, 0.4, 0.5], [0.4, 0.5], "of one length"),
        ([0.1, 0.2], [0.3, 0.4], [0.4], "of one length"),
        ([0.1], [0.3], [0.4], "of one length"),
        ([0.2, 0.1], [0.3, 0.4], [0.4, 0.5], "not in order"),
        ([0.1, 0.1], [0.3, 0.4], [0.4, 0.5], "not in order"),
    ],
)
def test_a_band_is_of_one_length_and_in_order(slip, low, high, says):
    band = {"slip": slip, "low": low, "high": high}
    _refuse_bad_band({"slip": [0.1, 0.2], "low": [0.3, 0.4], "high": [0.4, 0.5]}, "s.json", "soil a")
    with pytest.raises(InputError, match=says):
        _refuse_bad_band(band, "s.json", "soil a")


@pytest.mark.parametrize("parameters", [{"p": 1.0}, ["a"], None])
def test_a_fit_by_slip_needs_the_soils_parameters(tmp_path, parameters):
    entry = {
        "model": "exponential",
        "parameters": {"a": 1.0},
        "by_slip": {"parameters": parameters, "r2": 0.9},
    }
    (tmp_path / "s.json").write_text(json.dumps({"soils": {"a": entry}}))
    with pytest.raises(InputError, match=r"soils\.a\.by_slip.*has not the soil's parameters"):
        SoilLibrary.load(tmp_path / "s.json")


@given(st.recursive(st.none() | st.booleans() | st.floats(allow_nan=False) | st.text(max_size=5), lambda x: st.lists(x, max_size=3)
                    | st.dictionaries(st.sampled_from(["soils", "a", "model", "parameters", "bins", "version", "interval", "resistance"]),
                                      x, max_size=4), max_leaves=12))  # fmt: skip
def test_any_json_is_a_library_or_an_input_error(tmp_path_factory, data):
    path = tmp_path_factory.mktemp("any") / "s.json"
    path.write_text(json.dumps({"soils": {"x": data}} if isinstance(data, dict) else data))
    try:
        assert isinstance(SoilLibrary.load(path), SoilLibrary)
    except InputError as error:
        assert "s.json" in str(error)  # noqa: PT017 (either outcome is right, the property is that there is no third)


def test_digitised_points(tmp_path):
    (tmp_path / "p.csv").write_text("clay,,sand,\nX,Y,X,Y\n5,0.1,7,0.2\n60,.5,30,.4\n20,.3,,\n")
    clay, sand = read_points(tmp_path / "p.csv")
    assert (clay.name, sand.name) == ("clay", "sand")
    np.testing.assert_allclose(clay.slip, [0.05, 0.2, 0.6])
    assert "per cent" in clay.notes[0]
    (tmp_path / "q.csv").write_text("0,05;0,1\n0,2;0,3\n")
    np.testing.assert_allclose(read_points(tmp_path / "q.csv")[0].slip, [0.05, 0.2])
    (tmp_path / "r.csv").write_text("slip [%],clay,clay 20 %,\n0.2,.01,.2,.1\n0.9,.06,.9,.6\n")
    small, wet = read_points(tmp_path / "r.csv")
    np.testing.assert_allclose(small.slip, [0.002, 0.009])  # a rigid wheel's: it was 20 and 90 % of slip
    np.testing.assert_allclose(wet.slip, [0.2, 0.9])


@pytest.mark.parametrize(
    ("text", "expected"),
    [("", "no numbers"), ("a,b\n", "no numbers"), ("1,2\n3,x\n", "row 2, column 2"), ("1,2,3\n4,5,6\n", "3 columns"),
     ("0.1,0.2\n", "1 points"), ("500,1\n600,2\n", "slip lies between"), ("0.1,inf\n0.2,1\n", "not a number"),
     ("Time [s],v\n0,0.1\n40,0.3\n", "column Time: is a log"), ("ground_speed,wheel_speed_l\n0,0\n0.5,3\n", "is a log")],
)  # fmt: skip
def test_digitised_points_that_are_none(tmp_path, text, expected):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(InputError, match=expected):
        read_points(tmp_path / "p.csv")


def test_each_point_of_a_printed_curve_is_a_bin_however_near_the_next_one(tmp_path):
    slip = np.arange(0.06, 0.3, 0.004)  # closer than the bins of a campaign
    mu = 0.9 * (1 - 0.52 * np.exp(0.01 * slip) - 0.48 * np.exp(-11.36 * slip))
    rows = "".join(f"{s:.6f},{m:.9f}\n" for s, m in zip(slip, mu, strict=True))
    (tmp_path / "p.csv").write_text("slip,clay\n" + rows)
    (soil,) = soils_of_points(tmp_path / "p.csv").values()
    assert [row["count"] for row in soil.bins] == [1] * len(slip)
    np.testing.assert_allclose([row["mean"] for row in soil.bins], mu, atol=1e-8)
    assert soil.parameters["a"] == pytest.approx(0.9, rel=1e-6)


def test_digitised_curves_without_a_name_are_counted(tmp_path):
    (tmp_path / "q.csv").write_text("0.05,0.1,0.07,0.2\n0.6,0.5,0.3,0.4\n0.2,0.3,,\n")
    assert [curve.name for curve in read_points(tmp_path / "q.csv")] == ["curve 1", "curve 2"]


def test_a_soil_shows_each_parameter_with_its_interval():
    soil = fitted()
    low, high = soil.interval["a"]
    shown = SoilLibrary({"fine": soil}, {}, {})._repr_html_()
    assert low < soil.parameters["a"] < high
    assert f"a {soil.parameters['a']:.3g} ({low:.3g} to {high:.3g})" in shown
