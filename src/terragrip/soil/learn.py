"""From estimates of many runs to a soil library."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.html import html_notes
from terragrip.soil.bins import BY_PULL, BY_SLIP, PAPER_BINS, PULL, Bins, BinSettings, bin_pairs
from terragrip.soil.choice import FORMS, FormVerdict, compare_forms
from terragrip.soil.fit import AdhesionCurve, explaining
from terragrip.soil.identifiability import moved_by_noise
from terragrip.soil.library import Soil, SoilLibrary
from terragrip.soil.missing import Gap, in_words, what_to_drive
from terragrip.soil.pull_bins import bin_by_pull
from terragrip.soil.slip_noise import SlipNoise, correct_slip_noise, shifted
from terragrip.soil.transitions import settled

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


STRETCH = 10.0
"""Metres of one run that count as one draw of the bootstrap where there are too few runs."""
FEW_RUNS = 5
ALIKE = 0.25
"""Share of the variance of slip's error that a row has in common with those beside it (half of its SD: `advice.curves.COMMON`)."""
APART = 0.03
"""Relative difference of the scale by pull from that by slip beyond which it is reported."""
FALL = 0.05
"""Share of its top by which a curve must come down within the bins to make sorting by pull unfit."""


@dataclass(frozen=True)
class RunPairs:
    """The usable pairs of one run on one soil: slip, adhesion and slip noise (n,), wheel after wheel; by row (rows,) the vehicle's pull,
    the mean adhesion of its wheels; the stretch of `STRETCH` metres; the metres of its path; rho_s and speed. ``roll``: metres that a
    wheel rolls until its adhesion has followed its slip."""

    run: str
    soil: str
    slip: Floats
    adhesion: Floats
    slip_std: Floats
    pull: Floats
    stretch: NDArray[np.int64]
    metres: Floats
    resistance: Floats
    speed: Floats
    roll: float = 0.0

    @property
    def wheels(self) -> int:
        """The wheels of each row."""
        return self.slip.size // max(self.resistance.size, 1)

    @property
    def steady(self) -> RunPairs:
        """The pairs as means over `roll` metres of the path around each; slip's noise in them by rows of which `ALIKE` is common."""
        rows, step = self.resistance.size, self.metres
        way = np.cumsum(step) - step / 2
        first, last = (np.searchsorted(way, way + end) for end in (-self.roll / 2, self.roll / 2))
        last = np.maximum(last, np.arange(rows) + 1)

        def mean(values: Floats) -> Floats:
            known = np.isfinite(values).reshape(-1, rows)
            sums = np.cumsum([known * step, np.where(known, values.reshape(-1, rows), 0.0) * step], axis=-1)
            sums = np.concatenate((np.zeros((*sums.shape[:2], 1)), sums), axis=-1)
            way, total = sums[..., last] - sums[..., first]
            own = values.reshape(-1, rows)
            return np.where(known & (way > 0), total / np.where(way > 0, way, 1.0), own).ravel()

        share = ALIKE + (1 - ALIKE) / np.tile(last - first, self.wheels)
        slip, adhesion, pull = (mean(values) for values in (self.slip, self.adhesion, self.pull))
        return replace(self, slip=slip, adhesion=adhesion, pull=pull, slip_std=self.slip_std * np.sqrt(share))


@dataclass(frozen=True)
class LearnedSoil:
    """One soil's fit with everything that the report shows beside it.

    `curve`: the fit that counts, by pull and without slip noise; `slip_noise`: the effect of that noise on it. `by_slip`: the paper's, each
    pair sorted by its own slip (`curve` itself where that one counts, or the drives hold too few of the paper's slips).
    """

    soil: Soil
    curve: AdhesionCurve
    by_slip: AdhesionCurve
    verdict: FormVerdict | None
    slip_noise: SlipNoise | None
    gaps: tuple[Gap, ...]
    pairs: tuple[RunPairs, ...] = field(repr=False)


@dataclass(frozen=True)
class Campaign:
    """All soils of a set of estimates: the fits, the soils without a fit and why, sentences for the user; soils without a fit that can
    be recognised all the same (`SoilLibrary.without_curve`)."""

    soils: Mapping[str, LearnedSoil]
    not_fitted: Mapping[str, str]
    words: tuple[str, ...]
    without_curve: Mapping[str, Soil] = field(default_factory=dict)

    def library(self, provenance: Mapping[str, Any] | None = None) -> SoilLibrary:
        """As a soil library."""
        soils = {name: learned.soil for name, learned in self.soils.items()}
        return SoilLibrary(soils, dict(provenance or {}), dict(self.not_fitted), dict(self.without_curve))

    def to_pandas(self) -> pd.DataFrame:
        """As `SoilLibrary.to_pandas`."""
        return self.library().to_pandas()

    def plot(self) -> Figure:
        """As `SoilLibrary.plot`."""
        return self.library().plot()

    def _repr_html_(self) -> str:
        return self.library()._repr_html_() + html_notes(self.words)


def usable_pairs(
    columns: Mapping[str, Any], wheels: Sequence[str], length: float, run: str, roll: float = 0.0
) -> list[RunPairs]:
    """Pairs of one estimates table by soil: labelled, settled (vehicle and tool on one soil), no event.

    columns: `distance`, `soil`, `event`, `soil_resistance`, `ground_speed` and, of each of the driven `wheels`, `slip_<w>`,
    `slip_<w>_std`, `adhesion_<w>`, arrays of shape (rows,). `length` [m] from the label's reference point to the rearmost wheel or tool.
    """
    soil = np.asarray(columns["soil"], dtype=object)
    good = settled(columns["distance"], soil, length) & (np.asarray(columns["event"], dtype=object) == "")
    distance = np.asarray(columns["distance"], dtype=float)
    steps = np.diff(distance, prepend=distance[:1])
    out = []
    for name in sorted(set(soil[good])):
        rows = good & (soil == name)
        stretch = np.floor(distance[rows] / STRETCH).astype(np.int64)
        of_wheels = {
            quantity: np.stack([np.asarray(columns[quantity.format(w)], dtype=float)[rows] for w in wheels])
            for quantity in ("slip_{}", "adhesion_{}", "slip_{}_std")
        }
        slip, adhesion, noise = of_wheels.values()
        out.append(
            RunPairs(
                run,
                str(name),
                slip.ravel(),
                adhesion.ravel(),
                noise.ravel(),
                adhesion.mean(axis=0),
                stretch,
                steps[rows],
                np.asarray(columns["soil_resistance"], dtype=float)[rows],
                np.asarray(columns["ground_speed"], dtype=float)[rows],
                roll,
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
    common_slip_sd: float = 0.0,
) -> Campaign:
    """Fit a curve to each soil of the pairs; compare forms, correct for slip noise, propose what to drive next.

    `curve`: an unfitted AdhesionCurve with the settings to use (default: the paper's shape on bins by pull). `bins` by soil; default the
    curve's, on grass the paper's range up to 40 %. Bins by slip replace bins by pull where adhesion falls within the bins (beyond the
    maximum one pull has two slips) or only one pull was driven; a note says so. `mass` [kg] gives the pulls of
    the advice. `common_sd`: relative SD of adhesion's error that all runs share; it widens the intervals, and so does
    `common_slip_sd`, the SD of slip's.
    Raises InputError if no pair is labelled.
    """
    template = (curve or AdhesionCurve(bins=PULL)).unfitted(
        common_sd=common_sd, common_slip_sd=common_slip_sd
    )
    special = bins
    if special is None:
        special = {name: replace(template.bins, upper=one.upper) for name, one in PAPER_BINS.items()}
    grouped: dict[str, list[RunPairs]] = {}
    for part in pairs:
        grouped.setdefault(part.soil, []).append(part)
    if not grouped:
        raise InputError(
            "no sample has a soil label", hint="give a 'soil' column, or name the soil with --soil"
        )
    soils, missed, words = {}, {}, _alike(grouped)
    for name, parts in sorted(grouped.items()):
        settings = special.get(name, template.bins)
        try:
            learned = _learn(
                name, parts, template.unfitted(bins=settings), mass, sample_period, wheels, source
            )
        except InputError as error:
            missed[name] = str(error)
            words.append(f"{name}: not fitted, {error}.")
            continue
        soils[name] = learned
        words += [f"{name}: {note}" for note in learned.curve.notes_]
        words += (
            [f"{name}: {learned.slip_noise.sentence}"]
            if learned.slip_noise and learned.slip_noise.matters
            else []
        )
        words += [f"{name}: {sentence}" for sentence in [scales_apart(learned)] if sentence]
        words += in_words(name, learned.gaps) if learned.gaps else []
    return Campaign(soils, missed, tuple(words))


def _alike(names: Iterable[str]) -> list[str]:
    """A sentence for each of several soils whose names differ in capitals alone."""
    alike = [list(same) for _, same in groupby(sorted(names, key=str.casefold), str.casefold)]
    return [
        f"{', '.join(sorted(same))}: a curve each; write the name alike if they are one soil."
        for same in alike
        if len(same) > 1
    ]


def _clusters(parts: Sequence[RunPairs]) -> NDArray[np.int64]:
    """Labels (n,) of the units that the bootstrap draws: runs, or stretches of runs where there are few."""
    run = np.repeat(np.arange(len(parts)), [part.slip.size for part in parts])
    if len(parts) >= FEW_RUNS:
        return run
    stretch = np.concatenate([np.tile(part.stretch, part.wheels) for part in parts])
    return np.asarray(run * (np.ptp(stretch) + 1) + stretch - stretch.min())


def bin_parts(parts: Sequence[RunPairs], settings: BinSettings) -> Bins:
    """Bins of one soil's pairs, with the clusters that the bootstrap draws: runs, or stretches of runs where there are few."""
    cluster = _clusters(parts)
    parts = [part.steady for part in parts] if settings.by == BY_PULL else parts
    slip, adhesion, noise = (_joined(parts, name) for name in ("slip", "adhesion", "slip_std"))
    if settings.by == BY_PULL:
        pull = np.concatenate([np.tile(part.pull, part.wheels) for part in parts])
        metres = np.concatenate([np.tile(part.metres / part.wheels, part.wheels) for part in parts])
        return bin_by_pull(slip, adhesion, pull, metres, cluster, settings, noise)
    return bin_pairs(slip, adhesion, cluster, settings)


def scales_apart(learned: LearnedSoil) -> str:
    """A sentence where the scale by pull and the paper's by slip differ by more than APART; else nothing."""
    if learned.curve is learned.by_slip or learned.curve.free_ != ("a",):
        return ""
    a, paper = (one.parameters_["a"] for one in (learned.curve, learned.by_slip))
    if abs(a / paper - 1) <= APART:
        return ""
    return (
        f"Sorted by pull, a is {a:.3g}; sorted by slip, as the paper does, {paper:.3g}: "
        "bins of slip gather weak spots and the noise of slip."
    )


def _joined(parts: Sequence[RunPairs], name: str) -> Floats:
    return np.concatenate([getattr(part, name) for part in parts])


def _learn(
    name: str,
    parts: Sequence[RunPairs],
    template: AdhesionCurve,
    mass: float | None,
    sample_period: float,
    wheels: int,
    source: str,
) -> LearnedSoil:
    sorted_by_slip = bin_parts(parts, template.bins.papers())
    curve, by_slip = _fits(parts, template, sorted_by_slip)
    verdict = _compared(curve.bins_ if curve.bins_.settings.by == BY_PULL else sorted_by_slip, _form(curve))
    if curve.interval_ and len(parts) < FEW_RUNS:
        curve.notes_.append(
            f"The intervals come from stretches of {STRETCH:g} m of {len(parts)} run{'s' * (len(parts) > 1)}: "
            "they do not cover the differences between runs."
        )
    corrected = _of_noise(parts, curve) if np.isfinite(_joined(parts, "slip_std")).any() else None
    if curve.bins_.settings.by == BY_SLIP and corrected is not None:
        curve.doubt(moved_by_noise(corrected.moved))
    if verdict is not None and not verdict.follows:
        curve.doubt(verdict.sentence)
        curve.notes_ += [verdict.sentence] if verdict.sentence not in curve.notes_ else []
    resistance, speed = _joined(parts, "resistance"), _joined(parts, "speed")
    soil = Soil.from_curve(name, curve, source, (float(np.nanmean(resistance)), float(np.nanstd(resistance))))
    if verdict is not None and not verdict.follows:
        soil = replace(soil, fit={**soil.fit, "follows": False})
    if by_slip is not curve:
        papers = by_slip.to_dict()
        kept = ("parameters", "interval", "r2", "nrmse", "bins", "settings", "band")
        shown = {key: papers[key] for key in kept if key in papers}
        soil = replace(soil, fit={**soil.fit, "by_slip": shown})
    if corrected is not None:
        shown = {
            "plain": dict(corrected.plain),
            "corrected": dict(corrected.corrected),
            "slip_std": corrected.slip_std,
        }
        soil = replace(soil, fit={**soil.fit, "slip_noise": shown})
    driven = np.isfinite(speed) & (speed > 0)
    # Over the way: standing has none.
    usual = float(np.average(speed[driven], weights=speed[driven])) if driven.any() else 0.0
    gaps = what_to_drive(soil, sorted_by_slip, mass, sample_period, wheels, usual) if mass else []
    return LearnedSoil(soil, curve, by_slip, verdict, corrected, tuple(gaps), tuple(parts))


def _fits(
    parts: Sequence[RunPairs], template: AdhesionCurve, sorted_by_slip: Bins
) -> tuple[AdhesionCurve, AdhesionCurve]:
    """The fit that counts and the paper's by slip, which may be one. Raises InputError with too few slips or pulls, or no fit."""
    steady, one_pull = [part.steady for part in parts], False
    if template.bins.by == BY_PULL and not (
        _falls(sorted_by_slip) and _falls(bin_parts(steady, sorted_by_slip.settings))
    ):
        by_pull = bin_parts(parts, template.bins)
        one_pull = int(np.count_nonzero(by_pull.used)) < 2
        if not one_pull:
            curve = explaining(template.unfitted().fit_bins(by_pull))
            return curve, _beside(curve, sorted_by_slip)
    paper = explaining(template.unfitted(bins=sorted_by_slip.settings).fit_bins(sorted_by_slip))
    if one_pull:
        paper.doubt(
            "Sorted by slip, not by pull: the drives hold fewer than two pulls, so the data do not fix the curve."
        )
    elif template.bins.by == BY_PULL:
        paper.notes_.append(
            "Sorted by slip, not by pull: the curve falls within the bins, so that one pull has two slips."
        )
    return paper, paper


def _beside(curve: AdhesionCurve, sorted_by_slip: Bins) -> AdhesionCurve:
    """The paper's fit beside a curve by pull; the curve itself where the drives reached too little of the paper's slips."""
    try:
        return curve.unfitted(bins=sorted_by_slip.settings).fit_bins(sorted_by_slip)
    except InputError:
        return curve


def _of_noise(parts: Sequence[RunPairs], curve: AdhesionCurve) -> SlipNoise:
    """The effect of slip noise on the fit that counts: by pull it is removed, by slip the fit keeps it (the paper's way)."""
    slip, adhesion, noise = (_joined(parts, key) for key in ("slip", "adhesion", "slip_std"))
    if curve.bins_.settings.by == BY_SLIP:
        return correct_slip_noise(curve, slip, adhesion, noise)
    exact = [replace(part, slip_std=np.zeros_like(part.slip_std)) for part in parts]
    plain = curve.unfitted(bootstrap=0).fit_bins(bin_parts(exact, curve.bins)).parameters_
    free = curve.free_
    freed = {name: curve.parameters_[name] for name in free}
    return shifted(curve, freed, {name: plain[name] for name in free}, slip, noise, "the fit is freed of it")


def _form(curve: AdhesionCurve) -> str:
    """The form that a curve was fitted with, as `FORMS` names it; the paper's with all parameters free is the effective one."""
    model = "effective" if curve.model == "exponential" and len(curve.free_) > 1 else curve.model
    return f"{model} with intercept" if curve.intercept else model


def _compared(bins: Bins, asked: str = "exponential") -> FormVerdict | None:
    """The verdict on a form; None where the bins cannot decide, or the form is none of those compared."""
    try:
        return compare_forms(bins, asked)
    except InputError:
        return None


def _falls(bins: Bins) -> bool:
    """Whether adhesion falls by more than FALL of its maximum within the bins: by the best form, where the paper's cannot follow them.

    Noise of slip, or wheels that hop, make slips that no pull asked for, and bins by slip fall there; not those of steady ones.
    """
    verdict = _compared(bins)
    if verdict is None or verdict.proposal is None:
        return False
    model, intercept = FORMS[verdict.proposal]
    values = (
        AdhesionCurve(model, intercept=intercept, bootstrap=0).fit_bins(bins).predict(bins.slip[bins.used])
    )
    return bool(values.max() - values[-1] > FALL * abs(values.max()))
