"""Blocks of a drive and the signature of a soil, against plain loops and closed forms."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from terragrip.errors import InputError
from terragrip.physics.adhesion import CURVES
from terragrip.soil.blocks import Blocks, _streak, blocks_of, driven_wheels, wheel_loads
from terragrip.soil.library import Soil
from terragrip.soil.signature import (
    USUAL_CURVE,
    USUAL_SOIL,
    Signature,
    _correlation,
    _ground,
    curve_error,
    learn_signature,
    signature_in,
    steepness,
    with_signatures,
)
from terragrip.vehicle import Vehicle

AXLES = {"l": "rear", "r": "front"}


def columns(rows: int = 200, rate: float = 10.0, seed: int = 1) -> dict[str, Any]:
    """A drive of two wheels at so many rows a second, with an own deviation for each estimate."""
    draws, time = np.random.default_rng(seed), 5.0 + np.arange(rows) / rate
    out: dict[str, Any] = {"time": time, "distance": 2.0 * (time - 5.0), "event": np.full(rows, "", object)}
    out["soil_resistance"] = 0.1 + 0.01 * draws.standard_normal(rows)
    for k, wheel in enumerate(AXLES):
        out[f"slip_{wheel}"] = 0.1 + 0.1 * k + 0.02 * draws.standard_normal(rows)
        out[f"adhesion_{wheel}"] = 0.3 + 0.1 * k + 0.03 * draws.standard_normal(rows)
        out[f"slip_{wheel}_std"] = draws.uniform(0.01, 0.02, rows)
        out[f"adhesion_{wheel}_std"] = draws.uniform(0.02, 0.04, rows)
    out["soil_resistance_std"] = draws.uniform(0.01, 0.03, rows)
    out["vertical_load_rear"], out["vertical_load_front"] = np.full(rows, 300.0), np.full(rows, 100.0)
    out["curve_a"] = draws.uniform(0.8, 0.9, rows)
    return out


def test_a_block_is_half_a_second_of_means_and_scatter() -> None:
    data = columns()
    data["event"][[6, 23]] = ["gap", "outlier"]  # the first is not usable, the second is
    data["slip_l"][[11, 12, 13]] = [0.61, -0.61, np.nan]  # beyond what can be read
    data["slip_r"][16] = 0.6
    data["adhesion_r"][17], data["soil_resistance"][18] = np.nan, np.nan
    blocks = blocks_of(data, AXLES)
    assert len(blocks) == 40
    assert blocks.usable[:5].tolist() == [5, 4, 2, 3, 5]
    for k in range(40):
        rows = [r for r in range(5 * k, 5 * k + 5) if r not in (6, 11, 12, 13, 17, 18)]
        for name, column in (("resistance", "soil_resistance"), ("curve_a", "curve_a")):
            assert getattr(blocks, name)[k] == pytest.approx(np.mean(data[column][rows]))
        mu, slip = ([data[f"{q}_{w}"][rows] for w in AXLES] for q in ("adhesion", "slip"))
        np.testing.assert_allclose(blocks.adhesion[k], np.mean(mu, axis=1))
        np.testing.assert_allclose(blocks.slip[k], np.mean(slip, axis=1))
        np.testing.assert_allclose(
            blocks.slip_variance[k], [np.mean(data[f"slip_{w}_std"][rows] ** 2) for w in AXLES]
        )
        np.testing.assert_allclose(
            blocks.adhesion_variance[k], [np.mean(data[f"adhesion_{w}_std"][rows] ** 2) for w in AXLES]
        )
        assert blocks.resistance_variance[k] == pytest.approx(np.mean(data["soil_resistance_std"][rows] ** 2))
        if len(rows) >= 4:
            scatter = np.std(data["soil_resistance"][rows], ddof=1), np.std(mu, axis=1, ddof=1).mean()
            np.testing.assert_allclose(blocks.roughness[k], np.log(np.add(scatter, 1e-4)))
            assert blocks.slip_sd[k] == pytest.approx(np.log(np.std(slip, axis=1, ddof=1).mean() + 1e-4))
        else:
            assert np.isnan(blocks.roughness[k]).all()
    np.testing.assert_allclose(blocks.share, [[0.75, 0.25]] * 40)
    np.testing.assert_allclose(blocks.mean_adhesion, blocks.adhesion @ [0.75, 0.25])
    np.testing.assert_allclose(blocks.mean_slip, blocks.slip @ [0.75, 0.25])
    np.testing.assert_allclose(blocks.start, 5.0 + 0.5 * np.arange(40))
    np.testing.assert_allclose(blocks.end[:-1], blocks.start[1:])
    assert blocks.end[-1] == data["time"][-1]
    np.testing.assert_allclose(blocks.travelled, data["distance"][4::5])
    assert blocks.streak[:9].tolist() == [1, 2, 0, 1, 2, 3, 4, 5, 6]  # the third is usable by less than half
    np.testing.assert_array_equal(blocks.known, blocks.streak > 4)


@pytest.mark.parametrize(("usable", "counts"), [(4, False), (5, True)])
def test_a_block_counts_that_is_usable_by_half(usable: int, counts: bool) -> None:
    data = columns(30, rate=20.0)
    data["event"][10 + usable : 20] = "gap"
    assert blocks_of(data, AXLES).streak.tolist() == ([1, 2, 3] if counts else [1, 0, 1])


def test_without_deviations_loads_or_a_curve_estimates_count_as_exact_and_wheels_alike() -> None:
    bare = {
        n: v for n, v in columns().items() if not n.endswith("_std") and "load" not in n and n != "curve_a"
    }
    blocks = blocks_of(bare, AXLES)
    for name in ("resistance_variance", "adhesion_variance", "slip_variance"):
        assert not getattr(blocks, name).any()
    assert np.isnan(blocks.curve_a).all()
    np.testing.assert_array_equal(blocks.share, 0.5)
    assert wheel_loads(columns(3), {"l": "front"})["l"].tolist() == [100.0] * 3


def test_blocks_count_from_an_origin_and_go_on_from_the_block_before() -> None:
    data = columns(50)
    blocks = blocks_of(data, AXLES, origin=3.0, before=(3, 7))
    assert blocks.number.tolist() == list(range(4, 14))
    assert blocks.streak.tolist() == list(range(8, 18))
    assert blocks_of(data, AXLES, origin=3.0, before=(0, 7)).streak[0] == 8
    assert blocks_of(data, AXLES, origin=3.0, before=(-1, 7)).streak[0] == 1
    assert blocks[2:4].number.tolist() == [6, 7]
    late = {n: v[25:] if len(v) else v for n, v in data.items()}
    assert blocks_of(late, AXLES, origin=5.0).number[0] == 5
    gap = {n: np.delete(v, range(10, 30)) for n, v in data.items()}
    assert blocks_of(gap, AXLES).number.tolist() == [0, 1, 6, 7, 8, 9]
    assert blocks_of(gap, AXLES).streak.tolist() == [1, 2, 1, 2, 3, 4]


def test_a_streak_ends_with_a_bad_block_or_more_than_two_seconds_missing() -> None:
    number, good = np.array([3, 4, 8, 13, 14, 15]), np.array([True, True, True, True, False, True])
    assert _streak(number, good, None).tolist() == [1, 2, 3, 1, 0, 1]
    assert _streak(number, good, (2, 5)).tolist() == [6, 7, 8, 1, 0, 1]
    assert _streak(number, good, (-2, 5)).tolist() == [1, 2, 3, 1, 0, 1]


def test_tables_that_cannot_be_cut_are_refused_with_their_place() -> None:
    data = columns(10)
    with pytest.raises(InputError, match=r"x\.parquet.*column slip_r: is missing"):
        blocks_of({n: v for n, v in data.items() if n != "slip_r"}, AXLES, file="x.parquet")
    with pytest.raises(InputError, match="holds no row"):
        blocks_of({n: v[:0] for n, v in data.items()}, AXLES)
    data["distance"][3] = np.nan
    with pytest.raises(InputError, match="column distance, row 3: nan is no distance"):
        blocks_of(data, AXLES)


def test_all_wheels_count_where_none_is_driven() -> None:
    axles = {
        "front": {"mass": 1, "wheels": ["l", "r"], "driven": False},
        "rear": {"mass": 1, "wheels": ["x"], "driven": True},
    }
    base = {
        "mass": 2,
        "wheelbase": 1.0,
        "center_of_gravity_height": 0.3,
        "wheel": {"radius": 0.2, "inertia": 0.1},
    }
    assert driven_wheels(Vehicle.from_dict({**base, "axles": axles})) == {"x": "rear"}
    axles["rear"]["driven"] = False
    assert driven_wheels(Vehicle.from_dict({**base, "axles": axles})) == {
        "l": "front",
        "r": "front",
        "x": "rear",
    }


SOIL = Soil("field", "exponential", {"a": 0.9, "intercept": -0.02})


def known_blocks(count: int = 40, seed: int = 2) -> Blocks:
    blocks = blocks_of(columns(5 * count, seed=seed), AXLES)
    return replace(blocks, streak=np.full(count, 9))


def test_an_error_about_the_curve_is_relative_and_its_variance_goes_by_the_slope() -> None:
    blocks = known_blocks()
    error, variance, scale = curve_error(SOIL, blocks)
    share, step = np.array([0.75, 0.25]), 1e-6
    curve = CURVES["exponential"].value(blocks.slip, {"a": 0.9}) - 0.02
    ahead = CURVES["exponential"].value(blocks.slip + step, {"a": 0.9}) - 0.02
    np.testing.assert_allclose(scale, np.abs(curve @ share) + 0.05)
    np.testing.assert_allclose(error, (blocks.adhesion - curve) @ share / scale)
    slope = (ahead - curve) / step
    known = np.sqrt(blocks.adhesion_variance + slope**2 * blocks.slip_variance) @ share
    np.testing.assert_allclose(variance, (known / scale) ** 2, rtol=1e-4)
    steeper = steepness(SOIL, blocks) / steepness(USUAL_SOIL, blocks)
    np.testing.assert_allclose(
        steeper, 0.9 / USUAL_CURVE["a"], rtol=0.05
    )  # intercepts count in the height alone


def test_the_ground_under_noisy_values_is_paule_and_mandels() -> None:
    draws = np.random.default_rng(3)
    noise = draws.uniform(0.5, 2.0, (400, 2)) * [1e-4, 1e-2]
    values = [0.1, -0.2] + np.sqrt(np.add([4e-4, 4e-2], noise)) * draws.standard_normal((400, 2))
    middle, sd = _ground(values, noise)
    for k in range(2):
        weight = 1 / (sd[k] ** 2 + noise[:, k])
        assert middle[k] == pytest.approx(np.average(values[:, k], weights=weight), rel=1e-6)
        assert np.mean(weight * (values[:, k] - middle[k]) ** 2) == pytest.approx(1.0, abs=1e-6)
    assert sd == pytest.approx([0.02, 0.2], rel=0.15)
    assert _ground(np.full((30, 2), 0.3), noise[:30])[1].tolist() == [0.005, 0.03]


@pytest.mark.parametrize(("slope", "expected"), [(1.0, 0.9), (-1.0, -0.9), (0.0, 0.0)])
def test_a_correlation_stays_within_nine_tenths(slope: float, expected: float) -> None:
    x = np.linspace(-1.0, 1.0, 50)
    assert _correlation(np.column_stack([x, slope * x])) == pytest.approx(expected)
    y = 0.5 * x + np.random.default_rng(1).standard_normal(50)
    assert _correlation(np.column_stack([x, y])) == pytest.approx(np.corrcoef(x, y)[0, 1])


def test_a_signature_holds_level_and_roughness_of_all_runs() -> None:
    runs = [known_blocks(seed=k) for k in (2, 3)]
    signature = learn_signature(SOIL, runs, "made so")
    assert signature is not None
    assert (signature.blocks, signature.runs, signature.made_by) == (80, 2, "made so")
    rough = np.concatenate([run.roughness for run in runs])
    np.testing.assert_allclose(signature.roughness, rough.mean(axis=0))
    np.testing.assert_allclose(signature.roughness_covariance, np.cov(rough.T) + 0.01 * np.eye(2))
    level = np.concatenate([np.column_stack([run.resistance, curve_error(SOIL, run)[0]]) for run in runs])
    noise = np.concatenate(
        [np.column_stack([run.resistance_variance, curve_error(SOIL, run)[1]]) for run in runs]
    )
    middle, sd = _ground(level, noise)
    np.testing.assert_allclose(signature.level, middle)
    np.testing.assert_allclose(signature.level_sd, sd)
    scaled = (level - middle) / np.sqrt(sd**2 + noise)
    assert signature.level_correlation == pytest.approx(np.corrcoef(scaled.T)[0, 1])


@pytest.mark.parametrize(("known", "learned"), [(19, False), (20, True)])
def test_twenty_known_blocks_make_a_signature(known: int, learned: bool) -> None:
    run = known_blocks()
    run = replace(run, streak=np.where(np.arange(40) < known, 5, 4))
    signature = learn_signature(SOIL, [run])
    assert (signature is not None) is learned
    assert learn_signature(SOIL, []) is None
    smooth = replace(
        known_blocks(), roughness=np.where(np.arange(40)[:, None] < known, run.roughness, np.nan)
    )
    assert (learn_signature(SOIL, [smooth]).roughness is not None) is learned


def test_signatures_go_into_a_library_and_come_out_and_damaged_ones_are_refused() -> None:
    signed = with_signatures({"field": SOIL, "bare": SOIL}, {"field": [known_blocks()]}, "aukf")
    assert "signature" not in signed["bare"].fit
    signature = signature_in(signed["field"])
    assert signature is not None
    assert signature.made_by == "aukf"
    again = Signature.from_dict(signature.to_dict(), "soils.field.signature")
    for one in fields(Signature):
        np.testing.assert_array_equal(getattr(again, one.name), getattr(signature, one.name))
    assert signature_in(SOIL) is None
    for wrong in (
        {"level": [1.0]}, {"level_sd": [0.0, 1.0]}, {"level_correlation": 1.0}, {"level_correlation": -1.0}, {"blocks": None},
        {"blocks": 0}, {"roughness": [np.nan, 0.0]}, {"roughness_covariance": [[1.0, 2.0], [2.0, 1.0]]},
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"l\.json.*soils\.field\.signature.*is not a signature"):
            Signature.from_dict({**signature.to_dict(), **wrong}, "soils.field.signature", "l.json")
