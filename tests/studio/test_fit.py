"""The fit page's server: models, points, fits, saving."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from terragrip.estimation import Estimates
from terragrip.physics.adhesion import CURVES
from terragrip.soil.estimates import soils_of
from terragrip.soil.library import SoilLibrary


def fit(client: TestClient, **wanted: Any) -> Any:
    return client.post("/api/fit", json={"model": "exponential", "bootstrap": 200, **wanted})


def test_points_on_a_curve_give_the_curve_back(client: TestClient) -> None:
    slip = np.linspace(0.02, 0.9, 25)
    for name, given in (("burckhardt", {"c1": 0.9, "c2": 18.0, "c3": 0.3}), ("exponential", {"a": 0.71})):
        mu = CURVES[name].value(slip, given)
        result = fit(client, model=name, slip=slip.tolist(), adhesion=mu.tolist()).json()
        for parameter, value in given.items():
            assert math.isclose(result["parameters"][parameter], value, rel_tol=1e-4)
        assert result["r2"] > 0.999999
        assert len(result["bins"]) == len(slip)


def test_a_soil_of_estimates_is_fitted_as_terragrip_soils_does(client: TestClient, folder: Path) -> None:
    shown = {
        soil["name"]: soil for soil in client.get("/api/soils", params={"path": "estimates.parquet"}).json()
    }
    reference = soils_of([folder / "estimates.parquet"]).soils["grass"].curve.to_dict()
    result = fit(client, path="estimates.parquet", soil="grass", bootstrap=1000).json()
    assert {name: result[name] for name in reference} == json.loads(json.dumps(reference))
    assert shown["grass"]["bins"] == result["bins"]


def test_bins_of_estimates_are_sorted_by_pull_as_terragrip_soils_sorts_them(
    client: TestClient, folder: Path
) -> None:
    """Weak spots make slip vary about the pull's own, which bins by slip take for a lower curve."""
    known, time = Estimates.read(folder / "estimates.parquet"), np.arange(8000) / 20
    pulled = 0.25 + 0.2 * np.sin(time / 16)
    spot = np.random.default_rng(1000).standard_normal(200).repeat(40)
    mu = CURVES["exponential"].value(pulled, {"a": 0.85})
    columns = {"distance": time, "ground_speed": np.ones(8000), "soil_resistance": np.full(8000, 0.1)}
    for wheel in known.wheels:
        columns |= {f"adhesion_{wheel}": mu, f"slip_{wheel}": pulled * np.exp(0.2 * spot)}
        columns |= {f"slip_{wheel}_std": np.full(8000, 0.01)}
    labels = {"soil": np.full(8000, "fine", dtype=object)}
    Estimates(time, columns, np.zeros(8000, np.uint8), labels, known.about).write(folder / "made_up.parquet")
    reference = soils_of([folder / "made_up.parquet"]).soils["fine"].curve.to_dict()
    result = fit(client, path="made_up.parquet", soil="fine", bootstrap=1000).json()
    assert result["settings"]["by"] == "pull"
    assert {name: result[name] for name in reference} == json.loads(json.dumps(reference))
    (shown,) = client.get("/api/soils", params={"path": "made_up.parquet"}).json()
    assert shown["bins"] == result["bins"]


def test_curves_are_served_as_samples(client: TestClient) -> None:
    for name, model in CURVES.items():
        given = {model.names[0]: 1.5}
        served = client.post(
            "/api/curve", json={"model": name, "parameters": {**given, "intercept": -0.05}}
        ).json()
        assert np.array_equal(served["value"], model.value(served["slip"], given, -0.05))
        assert served["peak"] == list(model.peak(given))
    assert client.post("/api/curve", json={"model": "magic"}).status_code == 422
    assert client.post("/api/curve", json={"model": "pacejka", "parameters": {"a": 1}}).status_code == 422


def test_enough_points_carry_intervals_and_a_band(client: TestClient) -> None:
    slip = np.linspace(0.02, 0.6, 40)
    mu = CURVES["exponential"].value(slip, {"a": 0.8}) + 0.01 * np.random.default_rng(1).standard_normal(40)
    result = fit(client, slip=slip.tolist(), adhesion=mu.tolist()).json()
    low, high = result["interval"]["a"]
    assert low < 0.8 < high
    assert result["band"]["low"][30] < result["band"]["high"][30]


def test_a_refit_of_a_library_is_no_surer_than_the_library(client: TestClient, folder: Path) -> None:
    """Its bins share their error of slip, which no scatter of them shows; of one stretch `terragrip soils` gives no interval."""
    sent = {"path": "soils.json", "soil": "grass"}
    alone = fit(client, **sent).json()
    assert alone["interval"] == {}
    assert "no interval can be determined" in alone["notes"][0]
    library = json.loads((folder / "soils.json").read_text())
    library["soils"]["grass"] |= {"clusters": 20, "common_slip_sd": 0.02}
    (folder / "soils.json").write_text(json.dumps(library))
    low, high = fit(client, **sent).json()["interval"]["a"]
    slip, mu = (np.array([one[key] for one in library["soils"]["grass"]["bins"]]) for key in ("slip", "mean"))
    ends = [
        fit(client, slip=(slip + off).tolist(), adhesion=mu.tolist()).json()["parameters"]["a"]
        for off in (0.02, -0.02)
    ]
    assert high - low > ends[1] - ends[0]
    gone = fit(client, path="soils.json", soil="moss")
    assert gone.status_code == 422
    assert "soils.json: has no soil 'moss'" in gone.json()["detail"]


def test_too_few_points_get_a_sentence_and_no_curve(client: TestClient) -> None:
    for points in ({}, {"slip": [0.1], "adhesion": [0.2]}, {"slip": [0.1, 0.1], "adhesion": [0.2, 0.3]}):
        answer = fit(client, **points)
        assert answer.status_code == 422
        assert "\n" not in answer.json()["detail"]
    assert fit(client, slip=[0.1, 0.2], adhesion=[0.1]).status_code == 422
    assert fit(client, model="magic", slip=[0.1, 0.2], adhesion=[0.1, 0.2]).status_code == 422
    assert client.post("/api/fit", content=b'{"model": "exponential", "slip": [NaN]}').status_code == 422


def test_all_four_parameters_carry_the_badge(client: TestClient) -> None:
    slip = np.linspace(0.05, 0.6, 30)
    mu = CURVES["exponential"].value(slip, {"a": 0.85}) + 0.01 * np.sin(40 * slip)
    result = fit(client, fixed="free", slip=slip.tolist(), adhesion=mu.tolist()).json()
    assert result["identifiability"]["identifiable"] is False
    assert set(result["interval"]) == {"A", "k", "d"}


def test_a_saved_curve_is_read_back_and_another_of_its_name_refused(client: TestClient, folder: Path) -> None:
    soil = {
        "library": "mine.json",
        "name": "sand",
        "model": "burckhardt",
        "parameters": {"c1": 0.5, "c2": 9.0, "c3": 0.1},
    }
    assert client.post("/api/soils/save", json=soil).status_code == 201
    assert SoilLibrary.load(folder / "mine.json")["sand"].parameters["c2"] == 9.0
    again = client.post("/api/soils/save", json=soil)
    assert again.status_code == 422
    assert "sand" in again.json()["detail"]
    changed = {**soil, "replace": True, "parameters": {**soil["parameters"], "c2": 11.0}}  # type: ignore[dict-item]
    assert client.post("/api/soils/save", json=changed).status_code == 201
    assert SoilLibrary.load(folder / "mine.json")["sand"].parameters["c2"] == 11.0
    fitted = fit(client, slip=[0.02, 0.04, 0.06, 0.08, 0.1], adhesion=[0.1, 0.18, 0.24, 0.29, 0.33]).json()
    whole = {key: fitted[key] for key in ("model", "parameters", "free", "interval", "band", "bins")}
    assert (
        client.post("/api/soils/save", json={"library": "mine.json", "name": "clay", **whole}).status_code
        == 201
    )
    saved = SoilLibrary.load(folder / "mine.json")["clay"]
    assert saved.reach == pytest.approx(0.1)
    low, high = saved.band([0.05, 0.3])
    assert high[1] - low[1] > 3 * (high[0] - low[0])
    for bad in (
        {"library": "mine.csv"},
        {"model": "none"},
        {"parameters": {"zz": 1}},
        {"library": "../x.json"},
    ):
        assert client.post("/api/soils/save", json={**soil, "name": "other", **bad}).status_code == 422


def test_a_replaced_soil_keeps_what_it_is_recognised_by(client: TestClient, folder: Path) -> None:
    """A soil whose curve was saved anew lost its resistance, and drives on it were named unknown."""
    before = json.loads((folder / "soils.json").read_text())["soils"]["grass"]
    found = fit(client, path="estimates.parquet", soil="grass").json()
    names = ("model", "parameters", "interval", "bins", "free", "clusters", "common_slip_sd")
    curve = {name: found[name] for name in names if name in found}
    sent = {"library": "soils.json", "name": "grass", "replace": True, **curve}
    assert client.post("/api/soils/save", json=sent).status_code == 201
    after = SoilLibrary.load(folder / "soils.json")["grass"].to_dict()
    for kept in ("resistance", "spread", "signature", "slip_noise", "free", "clusters"):
        assert after.get(kept) == before.get(kept), kept
    assert after["resistance"]


@pytest.mark.parametrize("path", ["soils.json", "estimates.parquet"])
def test_soils_of_each_kind_of_file_are_served(client: TestClient, path: str) -> None:
    soils = client.get("/api/soils", params={"path": path}).json()
    assert [soil["name"] for soil in soils if soil.get("bins")] == ["grass"]


def test_digitised_points_are_served(client: TestClient, folder: Path) -> None:
    (folder / "points.csv").write_text("slip,mu\n5,0.2\n10,0.3\n20,0.35\n")
    (soil,) = client.get("/api/soils", params={"path": "points.csv"}).json()
    assert soil["points"] == {"slip": [0.05, 0.1, 0.2], "adhesion": [0.2, 0.3, 0.35]}


def test_literature_and_models_are_served(client: TestClient) -> None:
    assert {model["name"] for model in client.get("/api/models").json()} == set(CURVES)
    assert "dry asphalt" in {soil["name"] for soil in client.get("/api/literature").json()}


def test_a_parameter_on_its_bound_is_told(client: TestClient) -> None:
    """A straight line through the points needs ever slower a rise than the range of k allows."""
    slip = np.linspace(0.02, 0.5, 30)
    sent = {"model": "effective", "fixed": "free", "slip": slip.tolist(), "bootstrap": 0}
    result = client.post("/api/fit", json={**sent, "adhesion": (5.0 * np.sign(slip)).tolist()}).json()
    limits = {
        p["name"]: p
        for m in client.get("/api/models").json()
        if m["name"] == "effective"
        for p in m["parameters"]
    }
    on = [
        name
        for name in result["free"]
        if min(
            result["parameters"][name] - limits[name]["lower"],
            limits[name]["upper"] - result["parameters"][name],
        )
        < 1e-3 * (limits[name]["upper"] - limits[name]["lower"])
    ]
    assert on
    assert result["at_bound"] == on
    good = 0.6 * -np.expm1(-10 * slip)
    assert client.post("/api/fit", json={**sent, "adhesion": good.tolist()}).json()["at_bound"] == []


def test_a_fit_of_estimates_keeps_to_the_bounds_that_are_sent(client: TestClient) -> None:
    sent = {"path": "estimates.parquet", "soil": "grass"}
    free = fit(client, **sent).json()["parameters"]["a"]
    answer = fit(client, **sent, bounds={"a": [1.02 * free, 2.0]})
    assert answer.status_code == 200, answer.text
    assert answer.json()["parameters"]["a"] == pytest.approx(1.02 * free)
    assert answer.json()["at_bound"] == ["a"]
    refused = fit(client, **sent, bounds={"a": [2.0, 1.0]})
    assert refused.status_code == 422
    assert "bounds of a" in refused.json()["detail"]


def test_a_dragged_handle_gives_a_curve_and_its_parameters(client: TestClient) -> None:
    sent = {"model": "burckhardt", "parameters": {"c1": 0.8, "c2": 20.0, "c3": 0.2}}
    (peak,) = [one for one in client.post("/api/curve", json=sent).json()["handles"] if one["name"] == "peak"]
    goal = {"handle": "peak", "slip": peak["slip"] + 0.08, "value": peak["value"] - 0.1}
    moved = client.post("/api/curve/move", json={**sent, **goal}).json()
    np.testing.assert_allclose(moved["peak"], [goal["slip"], goal["value"]], atol=0.005)
    assert moved["value"] == CURVES["burckhardt"].value(moved["slip"], moved["parameters"]).tolist()
    assert (
        moved["initial_slope"]
        == moved["parameters"]["c1"] * moved["parameters"]["c2"] - moved["parameters"]["c3"]
    )
    held = client.post("/api/curve/move", json={**sent, **goal, "held": ["c1", "c2", "c3"]})
    assert held.status_code == 422
    assert client.post("/api/curve/move", json={**sent, **goal, "handle": "tail"}).status_code == 422
    unknown = client.post("/api/curve/move", json={**sent, **goal, "parameters": {"zz": 1.0}})
    assert unknown.status_code == 422
    assert "no parameter 'zz'" in unknown.text


def test_a_fit_from_here_begins_where_the_curve_was_dragged(client: TestClient) -> None:
    """From a wheel numeric so high that these slips do not feel it, no step leads down: the fit's own starts are elsewhere."""
    slip = np.linspace(0.3, 0.6, 30)
    mu = CURVES["wismer_luth"].value(slip, {"wheel_numeric": 10.0})
    sent = {"model": "wismer_luth", "bootstrap": 0, "slip": slip.tolist(), "adhesion": mu.tolist()}
    for start, found in ((20.0, 10.0), (490.0, 490.0)):
        result = fit(client, **sent, start={"wheel_numeric": start}).json()
        assert result["parameters"]["wheel_numeric"] == pytest.approx(found, rel=1e-3)
    assert fit(client, **sent, start={"zz": 1.0}).status_code == 422
