"""Blocks: means and spreads of half seconds, what counts, and the same cut in pieces as at once."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pandas as pd
import pytest

from ground_drives import FINE, WHEELS, drive
from terragrip.errors import InputError
from terragrip.estimation.engine import EVENTS
from terragrip.soil.blocks import PERIOD, SETTLING, blocks_of, driven_wheels, estimates_blocks

STANDSTILL = EVENTS.index("standstill")


def table(estimates):
    return {name: estimates[name] for name in estimates.names}


def test_means_and_spreads_are_those_of_a_group_by():
    estimates = drive(1, [("fine", FINE, 20)])
    blocks = estimates_blocks(estimates)
    by = pd.DataFrame({n: estimates[n] for n in estimates.columns}).groupby(
        np.floor(estimates.time / PERIOD + 1e-9)
    )
    np.testing.assert_allclose(blocks.resistance, by["soil_resistance"].mean())
    np.testing.assert_allclose(blocks.roughness[:, 0], np.log(by["soil_resistance"].std() + 1e-4))
    mu = [by[f"adhesion_{w}"] for w in WHEELS]
    np.testing.assert_allclose(blocks.adhesion, np.column_stack([one.mean() for one in mu]))
    np.testing.assert_allclose(
        blocks.roughness[:, 1], np.log(np.mean([one.std() for one in mu], axis=0) + 1e-4)
    )
    np.testing.assert_allclose(blocks.mean_adhesion, blocks.adhesion @ np.array([500, 500, 860, 860]) / 2720)


def test_standing_spinning_and_the_time_to_settle_tell_nothing():
    estimates = drive(2, [("fine", FINE, 30)])
    estimates.event_codes[200:210] = STANDSTILL  # one block at 10 s
    estimates.columns["slip_fr"][400:410] = 0.7  # one at 20 s
    blocks = estimates_blocks(estimates)
    unknown = np.flatnonzero(~blocks.known)
    expected = [*range(SETTLING), *range(20, 21 + SETTLING), *range(40, 41 + SETTLING)]
    np.testing.assert_array_equal(unknown, expected)


def test_nan_stretches_and_gaps_end_a_streak():
    estimates = drive(3, [("fine", FINE, 30)])
    estimates.columns["soil_resistance"][100:140] = np.nan
    keep = np.ones(600, dtype=bool)
    keep[300:420] = False
    cut = replace(
        estimates,
        time=estimates.time[keep],
        columns={k: v[keep] for k, v in estimates.columns.items()},
        event_codes=estimates.event_codes[keep],
        labels={k: v[keep] for k, v in estimates.labels.items()},
    )
    blocks = estimates_blocks(cut)
    assert blocks.number[30] - blocks.number[29] == 13
    assert not blocks.known[10:14].any()
    assert blocks.streak[29] == 16  # 14 to 29
    assert blocks.streak[30] == 1


def test_cut_in_pieces_it_is_the_same():
    estimates = drive(4, [("fine", FINE, 20)])
    estimates.event_codes[93:108] = STANDSTILL
    columns, axles = table(estimates), driven_wheels(estimates.vehicle)
    whole = blocks_of(columns, axles)
    before, parts = None, []
    for first in range(0, len(estimates), 10):
        part = blocks_of({k: v[first : first + 10] for k, v in columns.items()}, axles, 0.0, before)
        before = (int(part.number[0]), int(part.streak[0]))
        parts.append(part)
    for one in fields(whole):
        if one.name != "end":  # of the last row, where nothing follows
            np.testing.assert_array_equal(
                getattr(whole, one.name), np.concatenate([getattr(p, one.name) for p in parts])
            )


def test_an_undriven_axle_does_not_count():
    estimates = drive(5, [("fine", FINE, 5)])
    about = {**estimates.about, "vehicle": {**estimates.about["vehicle"]}}
    about["vehicle"]["axles"] = {k: dict(v) for k, v in about["vehicle"]["axles"].items()}
    about["vehicle"]["axles"]["front"]["driven"] = False
    assert estimates_blocks(replace(estimates, about=about)).adhesion.shape[1] == 2


@pytest.mark.parametrize("name", ["soil_resistance", "adhesion_rl", "distance"])
def test_a_missing_column_is_named(name):
    columns = table(drive(6, [("fine", FINE, 5)]))
    del columns[name]
    with pytest.raises(InputError, match=rf"e\.parquet: column {name}: is missing"):
        blocks_of(columns, dict.fromkeys(WHEELS, "front"), file="e.parquet")


def test_a_distance_that_is_none_is_named():
    columns = table(drive(8, [("fine", FINE, 5)]))
    columns["distance"][17] = np.nan
    with pytest.raises(InputError, match="column distance, row 17: nan is no distance"):
        blocks_of(columns, dict.fromkeys(WHEELS, "front"))


def test_no_row():
    columns = {k: v[:0] for k, v in table(drive(7, [("fine", FINE, 5)])).items()}
    with pytest.raises(InputError, match="holds no row"):
        blocks_of(columns, dict.fromkeys(WHEELS, "front"))
