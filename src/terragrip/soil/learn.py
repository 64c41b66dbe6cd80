"""From estimates of many runs to a soil library."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from terragrip.errors import InputError
from terragrip.soil.bins import PAPER_BINS, Bins, BinSettings, bin_pairs
from terragrip.soil.choice import LEAST_BINS, FormVerdict, compare_forms
from terragrip.soil.fit import AdhesionCurve
from terragrip.soil.ground_mean import GroundMean, mean_over_ground
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.missing import Gap, in_words, what_to_drive
from terragrip.soil.slip_noise import SlipNoise, correct_slip_noise
from terragrip.soil.transitions import settled

Array = NDArray[np.float64]

STRETCH = 10.0
"""Metres of one run that count as one draw of the bootstrap where there are too few runs."""
FEW_RUNS = 5
POOR = 0.5
"""R2 below which a fit carries a warning."""


@dataclass(frozen=True)
class RunPairs:
    """The usable pairs of one run on one soil: slip, adhesion and slip noise (n,), wheel after wheel; the stretch of `STRETCH` metres
    that each lies in and the metres that it stands for (n,); rho_s and speed (rows,)."""

    run: str
    soil: str
    slip: Array
    adhesion: Array
    slip_std: Array
    stretch: NDArray[np.int64]
    metres: Array
    resistance: Array
    speed: Array


@dataclass(frozen=True)
class LearnedSoil:
    """One soil's fit with all that the report shows beside it."""

    soil: Soil
    curve: AdhesionCurve
    verdict: FormVerdict | None
    slip_noise: SlipNoise | None
    ground_mean: GroundMean | None
    gaps: tuple[Gap, ...]
    pairs: tuple[RunPairs, ...] = field(repr=False)


@dataclass(frozen=True)
class Campaign:
    """All soils of a set of estimates: what was fitted, what was not and why, sentences for the user."""

    soils: Mapping[str, LearnedSoil]
    not_fitted: Mapping[str, str]
    words: tuple[str, ...]

    def library(self, provenance: Mapping[str, Any] | None = None) -> SoilLibrary:
        """As a soil library."""
        soils = {name: learned.soil for name, learned in self.soils.items()}
        return SoilLibrary(soils, dict(provenance or {}), dict(self.not_fitted))


def usable_pairs(
    columns: Mapping[str, Any], wheels: Sequence[str], length: float, run: str
) -> list[RunPairs]:
    """Pairs of one estimates table by soil: labelled, settled (vehicle and tool on one soil), no event.

    columns: `distance`, `soil`, `event`, `soil_resistance`, `ground_speed` and, of each wheel, `slip_<w>`, `slip_<w>_std`, `adhesion_<w>`,
    arrays of shape (rows,). `length` [m] from the label's reference point to the rearmost wheel or tool.
    """
    soil = np.asarray(columns["soil"], dtype=object)
    good = settled(columns["distance"], soil, length) & (np.asarray(columns["event"], dtype=object) == "")
    distance = np.asarray(columns["distance"], dtype=float)
    steps = np.diff(distance, prepend=distance[:1])
    out = []
    for name in sorted(set(soil[good])):
        rows = good & (soil == name)
        stretch = np.floor(distance[rows] / STRETCH).astype(np.int64)
        out.append(
            RunPairs(
                run,
                str(name),
                np.concatenate([np.asarray(columns[f"slip_{w}"], dtype=float)[rows] for w in wheels]),
                np.concatenate([np.asarray(columns[f"adhesion_{w}"], dtype=float)[rows] for w in wheels]),
                np.concatenate([np.asarray(columns[f"slip_{w}_std"], dtype=float)[rows] for w in wheels]),
                np.tile(stretch, len(wheels)),
                np.tile(steps[rows], len(wheels)),
                np.asarray(columns["soil_resistance"], dtype=float)[rows],
                np.asarray(columns["ground_speed"], dtype=float)[rows],
            )
        )
    return out


def learn_soils(
    pairs: Iterable[RunPairs],
    curve: AdhesionCurve | None = None,
    bins: Mapping[str, BinSettings] | None = None,
    mass: float | None = None,
    sample_period: float = 0.01,
    wheels: int = 4,
    source: str = "",
    common_sd: float = 0.0,
) -> Campaign:
    """Fit a curve to each soil of the pairs; compare forms, correct for slip noise, say what to drive next.

    `curve`: an unfitted AdhesionCurve with the settings to use (default: the paper's). `bins` by soil; default the curve's,
    on grass the paper's up to 40 %. `mass` [kg] gives the pulls of the advice. `common_sd`: relative SD of adhesion's error that all
    runs share, for the interval by metres. Raises InputError where no pair is labelled.
    """
    template = curve or AdhesionCurve()
    special = PAPER_BINS if bins is None else bins
    grouped: dict[str, list[RunPairs]] = {}
    for part in pairs:
        grouped.setdefault(part.soil, []).append(part)
    if not grouped:
        raise InputError(
            "no sample has a soil label", mend="give a 'soil' column, or name the soil with --soil"
        )
    soils, missed, words = {}, {}, []
    for name, parts in sorted(grouped.items()):
        settings = special.get(name, template.bins)
        try:
            learned = _learn(name, parts, template, settings, mass, sample_period, wheels, source, common_sd)
        except InputError as error:
            missed[name] = str(error)
            words.append(f"{name}: not fitted, {error}.")
            continue
        soils[name] = learned
        words += [f"{name}: {note}" for note in learned.curve.notes_]
        words += (
            [f"{name}: {learned.verdict.sentence}"] if learned.verdict and not learned.verdict.follows else []
        )
        words += (
            [f"{name}: {learned.slip_noise.sentence}"]
            if learned.slip_noise and learned.slip_noise.matters
            else []
        )
        words += (
            [f"{name}: {learned.ground_mean.sentence}"]
            if learned.ground_mean and learned.ground_mean.matters
            else []
        )
        words += in_words(name, learned.gaps) if learned.gaps else []
    return Campaign(soils, missed, tuple(words))


def _clusters(parts: Sequence[RunPairs]) -> tuple[NDArray[np.int64], bool]:
    """What is drawn by the bootstrap: runs, or stretches of runs where there are few. (labels (n,), whether they are runs)."""
    run = np.repeat(np.arange(len(parts)), [part.slip.size for part in parts])
    if len(parts) >= FEW_RUNS:
        return run, True
    stretch = np.concatenate([part.stretch for part in parts])
    return np.asarray(
        np.unique(np.stack([run, stretch]), axis=1, return_inverse=True)[1].ravel(), dtype=np.int64
    ), False


def _learn(
    name: str,
    parts: Sequence[RunPairs],
    template: AdhesionCurve,
    settings: BinSettings,
    mass: float | None,
    sample_period: float,
    wheels: int,
    source: str,
    common_sd: float,
) -> LearnedSoil:
    slip = np.concatenate([part.slip for part in parts])
    adhesion = np.concatenate([part.adhesion for part in parts])
    noise = np.concatenate([part.slip_std for part in parts])
    cluster, by_run = _clusters(parts)
    curve = AdhesionCurve(
        template.model,
        template.fixed,
        template.intercept,
        template.weights,
        settings,
        template.bootstrap,
        template.seed,
    )
    binned: Bins = bin_pairs(slip, adhesion, cluster, settings)
    curve.fit_bins(binned)
    if curve.r2_ <= 0:
        raise InputError(
            f"the {curve.model} curve explains nothing of its {np.count_nonzero(binned.used)} bins (R2 {curve.r2_:.2f}): "
            "slip may have been too small to tell from its noise",
            mend="drive at more slip",
        )
    if curve.r2_ < POOR:
        curve.notes_.append(f"The curve explains little of the bins (R2 {curve.r2_:.2f}): take it as a hint.")
    if curve.interval_ and not by_run:
        curve.notes_.append(
            f"The intervals come from stretches of {STRETCH:g} m of {len(parts)} run{'s' * (len(parts) > 1)}: "
            "they do not hold how much runs differ."
        )
    resistance = np.concatenate([part.resistance for part in parts])
    speed = np.concatenate([part.speed for part in parts])
    soil = Soil.from_curve(name, curve, source, (float(np.nanmean(resistance)), float(np.nanstd(resistance))))
    verdict = compare_forms(binned) if np.count_nonzero(binned.used) >= LEAST_BINS else None
    corrected = correct_slip_noise(curve, slip, adhesion, noise) if np.isfinite(noise).any() else None
    if corrected is not None:
        shown = {
            "plain": dict(corrected.plain),
            "corrected": dict(corrected.corrected),
            "slip_std": corrected.slip_std,
        }
        soil = replace(soil, fit={**soil.fit, "slip_noise": shown})
    metres = np.concatenate([part.metres for part in parts])
    ground = mean_over_ground(
        curve, slip, adhesion, metres, cluster, noise, common_sd, template.bootstrap, template.seed
    )
    if ground is not None:
        interval = None if ground.interval is None else list(ground.interval)
        of_ground = {"a": ground.mean, "interval": interval, "metres": ground.metres}
        soil = replace(soil, fit={**soil.fit, "ground_mean": of_ground})
    usual = float(np.nanmedian(speed))
    gaps = what_to_drive(soil, binned, mass, sample_period, wheels, usual) if mass else []
    return LearnedSoil(soil, curve, verdict, corrected, ground, tuple(gaps), tuple(parts))
