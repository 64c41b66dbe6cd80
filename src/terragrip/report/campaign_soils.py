"""What a simulation knows of the soils' curves: the curve each was made with, and the fit on true slip and adhesion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from terragrip.errors import InputError
from terragrip.soil.estimates import roll_of, whole_length
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.learn import Campaign, RunPairs, bin_parts, usable_pairs
from terragrip.soil.library import Soil

if TYPE_CHECKING:
    from terragrip.estimation import Estimates
    from terragrip.simulation import SimulationResult


def true_pairs(estimates: Estimates, result: SimulationResult, run: str) -> list[RunPairs]:
    """True slip and adhesion of the very rows that `estimates` gives to the curves."""
    columns = {name: estimates[name] for name in ("distance", "soil", "event")}
    columns["soil_resistance"] = result.truth["true_soil_resistance"].to_numpy()
    columns["ground_speed"] = result.truth["true_ground_speed"].to_numpy()
    for wheel in estimates.wheels:
        columns[f"slip_{wheel}"] = result.truth[f"true_slip_{wheel}"].to_numpy()
        columns[f"slip_{wheel}_std"] = np.zeros(len(estimates))
        columns[f"adhesion_{wheel}"] = result.truth[f"true_adhesion_{wheel}"].to_numpy()
    vehicle = estimates.vehicle
    return usable_pairs(columns, estimates.wheels, whole_length(vehicle), run, roll_of(vehicle))


def fits_of_truth(
    campaign: Campaign, pairs: Sequence[RunPairs], by_slip: bool = False
) -> dict[str, AdhesionCurve]:
    """The fit of each of the campaign's soils on true pairs, in the same bins, or in the paper's `by_slip`; no intervals."""
    result = {}
    for name, learned in campaign.soils.items():
        parts = [part for part in pairs if part.soil == name]
        settings = learned.curve.bins.papers() if by_slip else learned.curve.bins
        try:
            result[name] = learned.curve.unfitted(bootstrap=0).fit_bins(bin_parts(parts, settings))
        except (InputError, ValueError):  # too few bins: what the truth does not show is left out
            continue
    return result


def soils_of_scenario(scenario: str, pairs: Sequence[RunPairs]) -> dict[str, Soil]:
    """The soils a scenario was made with: their curves, and the mean true resistance over `pairs`."""
    from terragrip.simulation import Scenario

    result = {}
    for name, soil in Scenario.load(scenario).soils.items():
        resistance = [part.resistance for part in pairs if part.soil == name]
        if not resistance:
            continue
        values = np.concatenate(resistance)
        parameters = {key: value for key, value in soil.curve.items() if key != "name"}
        known = (float(np.nanmean(values)), float(np.nanstd(values)))
        result[name] = Soil(name, str(soil.curve["name"]), parameters, resistance=known, source="simulated")
    return result
