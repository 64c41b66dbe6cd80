"""Random fields of the ground: Gaussian, stationary, the same at the same place whatever path crosses it."""

from __future__ import annotations

import zlib

import numpy as np

from terragrip.arrays import Bools, Floats

FEATURES = 160
ENVELOPE = 0.08  # m: a tyre smooths bumps shorter than about its contact length
LONGEST = 1.5  # m: beyond this wavelength roughness is the slope's business


def stream(seed: int, name: str) -> np.random.Generator:
    """A generator of its own for each purpose, so that a change of one (a sensor, say) leaves the others' numbers alone."""
    return np.random.default_rng([seed, zlib.crc32(name.encode())])


class Field:
    """A Gaussian field in the plane of mean 0 and variance 1 (random Fourier features, Rahimi and Recht 2007).

    Covariance: Matérn 3/2 over ``length`` [m] (rough as ground is), or Gaussian where ``smooth`` (hills, whose slope
    must exist).
    """

    def __init__(self, rng: np.random.Generator, length: float, *, smooth: bool = False) -> None:
        wave = rng.standard_normal((2, FEATURES)) / length
        if not smooth:  # Matérn of order nu has a Student t spectrum of 2 nu degrees of freedom
            wave *= np.sqrt(3.0 / rng.chisquare(3.0, FEATURES))
        self._wave = wave
        self._phase = rng.uniform(0.0, 2 * np.pi, FEATURES)

    def at(self, east: Floats, north: Floats) -> Floats:
        """Values at the points (n,)."""
        return np.sqrt(2.0 / FEATURES) * np.cos(self._angle(east, north)).sum(axis=1)

    def slope(self, east: Floats, north: Floats, heading: Floats) -> Floats:
        """Derivative along ``heading`` [rad] at the points (n,), 1/m."""
        along = np.outer(np.cos(heading), self._wave[0]) + np.outer(np.sin(heading), self._wave[1])
        return -np.sqrt(2.0 / FEATURES) * (along * np.sin(self._angle(east, north))).sum(axis=1)

    def _angle(self, east: Floats, north: Floats) -> Floats:
        return np.outer(east, self._wave[0]) + np.outer(north, self._wave[1]) + self._phase


def on_grid(field: Field, east: Floats, north: Floats, mask: Bools, stride: int) -> Floats:
    """Field values (n,) where ``mask``, 0 elsewhere; computed at every ``stride``-th point and interpolated."""
    n = len(east)
    nodes = np.unique(np.r_[np.arange(0, n, stride), n - 1])
    near = np.convolve(mask, np.ones(2 * stride + 1), mode="same")[nodes] > 0.5
    values = np.zeros(len(nodes))
    if near.any():
        values[near] = field.at(east[nodes[near]], north[nodes[near]])
    return np.where(mask, np.interp(np.arange(n), nodes, values), 0.0)


def roughness(rng: np.random.Generator, count: int, spacing: float, scale: float = 1.0) -> Floats:
    """Elevation of a track of variance 1 (count,), one point every ``spacing`` m.

    Power spectrum over wave number k: 1/(k² + k0²) (ISO 8608's slope -2), flat beyond ``LONGEST``, cut by the tyre's
    ``ENVELOPE``; both lengths times ``scale``, as the tyre is.
    """
    size = 2 * int(2 ** np.ceil(np.log2(max(count, 64))))
    wave = 2 * np.pi * np.fft.rfftfreq(size, spacing)
    shape = np.exp(-0.5 * (wave * scale * ENVELOPE) ** 2) / np.sqrt(
        wave**2 + (2 * np.pi / (scale * LONGEST)) ** 2
    )
    shape[0] = 0.0
    profile = np.fft.irfft(np.fft.rfft(rng.standard_normal(size)) * shape, size)
    power = (shape[1:-1] ** 2).sum() * 2 + shape[-1] ** 2
    return profile[:count] / np.sqrt(power / size)


def clods(rng: np.random.Generator, x: Floats, density: Floats, height: Floats, length: Floats) -> Floats:
    """Bumps that earth clumps make of a track (n,) [m]: a Poisson number, heights of 0.5 to 1.5 times the mean.

    ``density`` [1/m], mean ``height`` and ``length`` [m] are given at every point of ``x``.
    """
    out = np.zeros(len(x))
    spacing = x[1] - x[0]
    number = rng.poisson(density.max() * (x[-1] - x[0])) if density.max() > 0 else 0
    places, keep, size = (
        rng.uniform(x[0], x[-1], number),
        rng.uniform(0, 1, number),
        rng.uniform(0.5, 1.5, number),
    )
    for place, share, factor in zip(places, keep, size, strict=True):
        k = int((place - x[0]) / spacing)
        if share * density.max() > density[k]:
            continue
        near = slice(max(0, k - int(length[k] / spacing) - 1), k + int(length[k] / spacing) + 2)
        d = (x[near] - place) / length[k]
        out[near] += np.where(np.abs(d) < 0.5, factor * height[k] * 0.5 * (1 + np.cos(2 * np.pi * d)), 0.0)
    return out
