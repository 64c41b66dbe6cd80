"""How a sensor trembles in a window: spread, peaks, and the shape of its spectrum."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats

BANDS = 32  # at most; fewer where a window holds fewer samples
_SEGMENT = 0.375  # of a window: four overlapping segments average the spectrum's noise out
_FEWEST = 8  # samples in a segment that is worth a spectrum
_PARTS = 5  # of a window, whose energies are compared


def band_edges(window: float, period: float) -> Floats:
    """Edges (bands + 1,) [Hz] of the bands that a window of samples every ``period`` [s] resolves; may be empty.

    Bands are equally wide, from above the mean up to the Nyquist frequency.
    """
    samples = _segment(round(window / period))
    if samples < _FEWEST:
        return np.empty(0)
    resolution = 1.0 / (samples * period)
    highest = (samples // 2 + 0.5) * resolution
    return np.linspace(0.5 * resolution, highest, min(BANDS, samples // 2) + 1)


def band_energies(values: Floats, period: float, edges: Floats) -> Floats:
    """Mean square (..., bands) of ``values`` (..., samples) in each band of ``edges`` [Hz], mean removed.

    Welch's method with Hann windows. A band that the samples do not resolve is NaN.
    """
    count = values.shape[-1]
    samples = _segment(count)
    bands = len(edges) - 1
    if samples < _FEWEST:
        return np.full((*values.shape[:-1], bands), np.nan)
    centred = values - values.mean(axis=-1, keepdims=True)
    taper = np.hanning(samples)
    hop = max((count - samples) // 3, 1)
    first = np.arange(0, count - samples + 1, hop)
    segments = centred[..., first[:, None] + np.arange(samples)] * taper
    power = (np.abs(np.fft.rfft(segments, axis=-1)) ** 2).mean(axis=-2) * 2.0 / (samples * (taper**2).sum())
    frequency = np.fft.rfftfreq(samples, period)
    bin_of = np.searchsorted(edges, frequency, side="right") - 1
    energies = np.full((*values.shape[:-1], bands), np.nan)
    for band in range(bands):
        inside = bin_of == band
        if inside.any():
            energies[..., band] = power[..., inside].sum(axis=-1)
    return energies


def moments(values: Floats) -> dict[str, Floats]:
    """Of ``values`` (..., samples): spread, and of the standardised values peak, kurtosis, skew's size, lag-1
    correlation, share of zero crossings and the step's size; each (...,)."""
    centred = values - values.mean(axis=-1, keepdims=True)
    spread = np.sqrt((centred**2).mean(axis=-1))
    unit = centred / np.where(spread > 0, spread, 1.0)[..., None]
    square = unit * unit  # NumPy's third and fourth power call pow for every sample
    return {
        "spread": spread,
        "peak": np.abs(unit).max(axis=-1),
        "kurtosis": np.log1p((square * square).mean(axis=-1)),
        "skew": np.abs((square * unit).mean(axis=-1)),
        "lag": (unit[..., 1:] * unit[..., :-1]).mean(axis=-1),
        "crossings": np.diff(unit > 0, axis=-1).mean(axis=-1),
        "step": np.sqrt((np.diff(unit, axis=-1) ** 2).mean(axis=-1)),
    }


def spectral_shape(energies: Floats, edges: Floats) -> dict[str, Floats]:
    """Of band energies (..., bands): centroid and width [Hz], flatness (1 = white) and the strongest band [Hz]."""
    middle = 0.5 * (edges[1:] + edges[:-1])
    known = np.nan_to_num(energies) + 1e-300
    share = known / known.sum(axis=-1, keepdims=True)
    centroid = (share * middle).sum(axis=-1)
    width = np.sqrt((share * (middle - centroid[..., None]) ** 2).sum(axis=-1))
    flatness = np.exp(np.log(share).mean(axis=-1)) * len(middle)
    return {
        "centroid": centroid,
        "width": width,
        "flatness": flatness,
        "strongest": middle[share.argmax(axis=-1)],
    }


def unsteadiness(values: Floats) -> Floats:
    """Spread (windows,) of the log energy over the parts of a window: high on ground that comes in bumps.

    ``values`` (windows, axes, samples).
    """
    centred = values - values.mean(axis=-1, keepdims=True)
    energy = (centred**2).sum(axis=1)
    size = max(energy.shape[-1] // _PARTS, 1)
    parts = energy.shape[-1] // size
    blocks = energy[:, : parts * size].reshape(len(energy), parts, size).mean(axis=-1)
    floor = 1e-6 * blocks.mean(axis=-1, keepdims=True) + 1e-300
    return np.log(blocks + floor).std(axis=-1)


def likeness(first: Floats, second: Floats) -> Floats:
    """Correlation (...,) of two signals (..., samples); 0 where one of them is constant."""
    first = first - first.mean(axis=-1, keepdims=True)
    second = second - second.mean(axis=-1, keepdims=True)
    size = np.sqrt((first**2).mean(axis=-1) * (second**2).mean(axis=-1))
    return (first * second).mean(axis=-1) / np.where(size > 0, size, 1.0)


def _segment(samples: int) -> int:
    return round(_SEGMENT * samples)
