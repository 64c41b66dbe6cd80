"""Which slips a soil's curve lacks, and which drawbar load and speed to drive next to fill them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terragrip.soil.bins import Bins
from terragrip.soil.library import Soil

_STEADY = 0.1
"""Pull over weight, by slip: where a curve rises less, a pull that is off by 1 % of the weight moves the slip by 10 % and more."""


@dataclass(frozen=True)
class Gap:
    """A stretch of slips without enough samples, and the drive that fills it.

    slip (low, high) [-]; drawbar pull (low, high) [N] for that slip; `seconds` of driving needed at `speed` [m/s] wheel
    speed; `reachable` False where the curve is flat or falls with slip, because no steady pull keeps the vehicle at that slip.
    """

    slip: tuple[float, float]
    pull: tuple[float, float]
    seconds: float
    speed: float | None
    reachable: bool


def missing_slips(bins: Bins) -> list[tuple[float, float]]:
    """Stretches (low, high) of slip whose bins have too few samples, neighbours joined."""
    edges = bins.settings.edges
    lacking = np.concatenate(([False], ~bins.used, [False]))
    starts = np.flatnonzero(lacking[1:] & ~lacking[:-1])
    ends = np.flatnonzero(~lacking[1:] & lacking[:-1])
    return [(float(edges[a]), float(edges[b])) for a, b in zip(starts, ends, strict=True)]


def what_to_drive(
    soil: Soil,
    bins: Bins,
    mass: float,
    sample_period: float,
    wheels: int,
    speed: float | None = None,
    gravity: float = 9.81,
) -> list[Gap]:
    """The pulls that fill the missing slips on level ground: F_dx = (mu(s) - rho_s) m g, from the soil's own curve (paper eq. 3, steady).

    mass [kg]; sample_period [s] between samples; each of `wheels` gives one pair per sample; speed [m/s]: the usual one of the data.
    For a soil without a known resistance it is 0 (the pull is then the gross one).
    """
    weight, resistance = mass * gravity, soil.resistance[0] if soil.resistance else 0.0
    gaps = []
    for low, high in missing_slips(bins):
        start, end = soil.value([low, high])
        pulls = sorted((float(one) - resistance) * weight for one in (start, end))
        cells = max(round((high - low) / bins.settings.width), 1)
        seconds = cells * bins.settings.minimum * sample_period / wheels
        gaps.append(
            Gap((low, high), (pulls[0], pulls[1]), seconds, speed, bool(end - start > _STEADY * (high - low)))
        )
    return gaps


def in_words(name: str, gaps: Sequence[Gap]) -> list[str]:
    """A sentence for each gap, for the report and the command line."""
    if not gaps:
        return [f"{name}: every slip bin has enough samples."]
    out = []
    for gap in gaps:
        low, high = gap.slip
        start = f"{name}: no data between {low:.0%} and {high:.0%} slip."
        speed = f" at about {gap.speed:.1f} m/s wheel speed" if gap.speed else ""
        if gap.pull[1] <= 0:
            out.append(
                f"{start} It is below the pull needed for rolling: drive without a tool, or be pushed."
            )
        elif not gap.reachable:
            out.append(
                f"{start} The curve is flat or falls there, so no steady pull holds the vehicle: raise the pull past {gap.pull[1]:.0f} N"
                f"{speed} and log the way through, or hold the wheel speed by control."
            )
        else:
            pull = " to ".join(f"{max(value, 0):.0f}" for value in gap.pull)
            out.append(
                f"{start} Pull {pull} N{speed}, at least {max(gap.seconds, 1):.0f} s in all, in two runs or more."
            )
    return out
