"""Signatures: the ground's own spread apart from the estimates', kept in the library."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from ground_drives import COARSE, FINE, GRASS, Ground, drive
from terragrip.errors import InputError
from terragrip.soil.blocks import estimates_blocks
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.signature import Signature, _ground, learn_signature, signature_in


def test_it_finds_what_the_drives_were_drawn_from(library):
    for name, ground in {"grass": GRASS, "fine": FINE, "coarse": COARSE}.items():
        result = signature_in(library[name])
        assert result.level[0] == pytest.approx(ground.resistance, abs=3 * ground.varies / np.sqrt(100))
        assert result.runs == 2
        assert result.made_by == "bank"
    smooth, rough = signature_in(library["fine"]), signature_in(library["coarse"])
    assert np.exp(rough.roughness - smooth.roughness) == pytest.approx(
        5.0, rel=0.2
    )  # as drawn: 0.015 against 0.003
    assert rough.level_sd[0] == pytest.approx(0.03, rel=0.2)


def test_the_estimates_own_noise_is_not_the_grounds():
    soil = Soil("x", "exponential", {"a": 0.85})
    blocks = estimates_blocks(drive(1, [("x", Ground(0.85, 0.12, 0.02), 400)]))
    rng = np.random.default_rng(0)
    noisy = replace(
        blocks,
        resistance=blocks.resistance + 0.03 * rng.standard_normal(len(blocks)),
        resistance_variance=blocks.resistance_variance * 0 + 0.03**2,
    )
    clean = replace(blocks, resistance_variance=blocks.resistance_variance * 0)
    for one in (clean, noisy):
        assert learn_signature(soil, [one]).level_sd[0] == pytest.approx(0.02, rel=0.15)


def test_too_few_blocks_are_no_signature():
    blocks = estimates_blocks(drive(2, [("fine", FINE, 8)]))
    assert learn_signature(Soil("fine", "exponential", {"a": 0.85}), [blocks]) is None
    assert learn_signature(Soil("fine", "exponential", {"a": 0.85}), []) is None


def test_it_survives_the_library_file(library, tmp_path):
    library.write(tmp_path / "soils.json")
    again = SoilLibrary.load(tmp_path / "soils.json")
    for name in library:
        assert signature_in(again[name]).to_dict() == signature_in(library[name]).to_dict()


@pytest.mark.parametrize(
    ("key", "value"),
    [("level", [0.1]), ("level_sd", [0.0, 0.1]), ("roughness_covariance", [[1, 2], [2, 1]]), ("level_correlation", 1.0),
     ("level", [float("nan"), 0.0]), ("blocks", "many")],
)  # fmt: skip
def test_a_damaged_one_is_refused(library, key, value):
    data = {**signature_in(library["fine"]).to_dict(), key: value}
    with pytest.raises(InputError, match=r"soils\.fine\.signature: is not a signature"):
        Signature.from_dict(data, "soils.fine.signature")


def test_the_ground_under_unequal_noise_is_paule_and_mandels():
    rng = np.random.default_rng(4)
    noise = 10 ** rng.uniform(-4, -1, (300, 2))
    values = [0.4, 1.0] + np.sqrt(0.01 + noise) * rng.standard_normal((300, 2))
    middle, sd = _ground(values, noise)
    for k in range(2):

        def mean_square(ground: float, x: np.ndarray = values[:, k], v: np.ndarray = noise[:, k]) -> float:
            centre = np.average(x, weights=1 / (ground + v))
            return float(np.mean((x - centre) ** 2 / (ground + v)))

        ground = brentq(lambda g: mean_square(g) - 1, 1e-6, 1.0)
        assert sd[k] == pytest.approx(np.sqrt(ground), rel=1e-3)
        assert middle[k] == pytest.approx(
            np.average(values[:, k], weights=1 / (ground + noise[:, k])), rel=1e-3
        )
