"""Advice for a machine that tells slip alone: shares of time against the usual band, and what they cost."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from terragrip.advice.fuel import burnt, fuel_rate_of
from terragrip.advice.result import Action, Advice, share_words
from terragrip.estimation import Estimates
from terragrip.vehicle import Vehicle

BAND = (0.08, 0.15)
"""The usual band of slip of tractors at heavy draught work (ASABE EP496: 8 to 15 %, from firm to soft ground)."""
OFTEN = 0.1
"""Share of time outside the band from which something is advised."""
LEAST_SPEED = 0.2
"""m/s: slower rows count as standing."""
LEAST_SECONDS = 60.0
MOSTLY = 0.5
"""Share of time below the band from which less ballast is advised."""
SHIFTS = np.linspace(-1.96, 1.96, 41)
"""SDs by which all of a drive's slips may be off at once, by the zero that they count from."""
SUREST = 0.05
"""Quantile of the rows' SDs of slip that stands for the zero's."""
REMEDY = (
    "drive 40 s without load on a road, faster than 5 m/s, or state which rows are without load on firm ground "
    "(terragrip calibrate --light FROM:TO)"
)
Rows = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]
"""Slip, the SD of its zero, seconds, ground speed [m/s] and fuel [m³/s] of rows (n,)."""
WHY_NO_CURVE = (
    "no torque was measured, so what this ground bears, its best slip and the efficiency are not known: log wheel torque, "
    "or engine torque with a driveline in the vehicle file"
)


def advise_slip(tables: Sequence[Estimates], vehicle: Vehicle) -> Advice:
    """Shares of driving time below, within and above the usual band; what slip above it costs in time."""
    return advise_rows([slip_rows(one) for one in tables], vehicle)


def advise_rows(rows: Sequence[Rows], vehicle: Vehicle) -> Advice:
    """As `advise_slip`, of rows gathered drive by drive (`slip_rows`)."""
    slip, error, seconds, speed, fuel = (np.concatenate(x) for x in zip(*rows, strict=True))
    total = float(seconds.sum())
    if total < LEAST_SECONDS:
        return Advice(
            "",
            missing=(
                f"slip is known for {total:.0f} s of driving; give at least {LEAST_SECONDS:.0f} s",
                WHY_NO_CURVE,
            ),
        )
    low, high = BAND
    shares = _shares(slip, seconds)
    drive = {
        "seconds": total, "slip_mean": float(np.average(slip, weights=seconds)),
        "slip_std": float(np.average(error, weights=seconds)), "band_low": low, "band_high": high, **shares,
    }  # fmt: skip
    moved = [_shares(slip + z * error, seconds) for z in SHIFTS]
    for name in shares:
        drive |= {
            f"{name}_low": min(one[name] for one in moved),
            f"{name}_high": max(one[name] for one in moved),
        }
    lost = drive["time_lost"]
    work: dict[str, float] = {}
    if vehicle.working_width:
        rate = float(np.average(speed, weights=seconds)) * vehicle.working_width * 0.36
        work = {"hectares_per_hour": rate, "hectares_per_hour_at_band": rate / (1 - lost)}
    work |= burnt(fuel, seconds, seconds * speed, vehicle.working_width)
    cost = (
        f", {work['hectares_per_hour_at_band'] - work['hectares_per_hour']:.2g} ha/h"
        if vehicle.working_width
        else ""
    )
    if "litres_per_hour" in work:
        cost += f", {lost * work['litres_per_hour']:.2g} l of fuel an hour at most"
    actions, open_still = _actions(drive, cost)
    missing = (
        *open_still,
        WHY_NO_CURVE,
        *(() if vehicle.working_width else ("working_width in the vehicle file, for ha/h",)),
    )
    return Advice("", actions=actions, missing=missing, drive=drive, field_work=work)


def _shares(slip: np.ndarray, seconds: np.ndarray) -> dict[str, float]:
    """Shares of the time below, within and above the band, and of the time that slip above it costs, of rows (n,)."""
    (low, high), total = BAND, float(seconds.sum())
    inside = (slip >= low) & (slip <= high)
    below, within, above = (float(seconds[mask].sum() / total) for mask in (slip < low, inside, slip > high))
    lost = float((seconds * np.maximum(1 - (1 - slip) / (1 - high), 0)).sum() / total)
    return {
        "share_below": below,
        "share_within": within,
        "share_above": above,
        "time_lost": lost,
    }


def _actions(drive: Mapping[str, float], cost: str) -> tuple[tuple[Action, ...], tuple[str, ...]]:
    """What to do as far as slip's own interval bears it, and a sentence where it does not."""
    low, high = BAND
    above, below = share_words(drive, "above"), share_words(drive, "below")
    actions = []
    if drive["share_above_low"] > OFTEN:
        saved = f"{drive['time_lost']:.1%} ({drive['time_lost_low']:.1%} to {drive['time_lost_high']:.1%})"
        actions.append(
            Action(
                "Load less, or add ballast, where slip is high: work shallower or narrower there, or with less tyre pressure within the "
                "tyre maker's table.",
                f"Slip is above {high:.0%} in {above} of the driving time; at {high:.0%} the same wheel speed would save {saved} of "
                f"the time{cost}.",
            )
        )
    if drive["share_below_low"] > MOSTLY:
        actions.append(
            Action(
                "If this was heavy draught work: take ballast off, or load more (deeper, wider).",
                f"Slip is below {low:.0%} in {below} of the driving time: the machine is heavier than its pull needs. On light work, on "
                "the road and in transport low slip is right.",
            )
        )
    if actions:
        return tuple(actions), ()
    if drive["share_above_high"] > OFTEN or drive["share_below_high"] > MOSTLY:
        return (), (
            f"slip is known to ± {196 * drive['slip_std']:.1f} points only, not enough for advice: it is above {high:.0%} in "
            f"{drive['share_above_low']:.0%} to {drive['share_above_high']:.0%} of the time, below {low:.0%} in "
            f"{drive['share_below_low']:.0%} to {drive['share_below_high']:.0%}; {REMEDY}",
        )
    keep = Action(
        "Keep load and ballast.",
        f"Slip is above {high:.0%} in {above}, below {low:.0%} in {below} of the time.",
    )
    return (keep,), ()


def slip_rows(estimates: Estimates) -> Rows:
    """Slip (the wheels' mean), the SD of what all of it may be off by, seconds, speed and fuel of the rows that drive and are not flagged.

    Noise goes from row to row, so the drive's surest rows tell what is left: where slip counts from.
    """
    slip = np.mean([estimates[f"slip_{w}"] for w in estimates.wheels], axis=0)
    error = np.mean([estimates[f"slip_{w}_std"] for w in estimates.wheels], axis=0)
    step = np.diff(estimates.time, append=estimates.time[-1:])
    # not the median: channels on clocks of their own put several rows close together
    usual = float(np.quantile(step[step > 0], 0.9)) if (step > 0).any() else 0.0
    speed = np.abs(estimates["ground_speed"])
    good = np.isfinite(slip) & estimates.during("") & (speed > LEAST_SPEED)
    seconds = np.minimum(step, 5 * usual)
    common = np.full(int(good.sum()), np.quantile(error[good], SUREST) if good.any() else 0.0)
    return slip[good], common, seconds[good], speed[good], fuel_rate_of(estimates)[good]
