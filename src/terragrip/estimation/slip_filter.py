"""A Kalman filter for slip from speeds alone.

State: ground speed v, its rate a, and for each wheel the slip speed d = rω - v. a and d are random walks; ground speed
measures v, a wheel's rim speed measures v + d. All of it is linear, and both speeds share v, so that noise of one does not
pass for slip. Backwards by Rauch, Tung and Striebel (1965). (R), our own construction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

_PRIOR = (10.0, 3.0, 3.0)  # SDs of v [m/s], a [m/s²] and d [m/s] before anything was measured
_GATE = 5.0  # SDs of an innovation beyond which a sample is an outlier,
_PATIENCE = 5  # unless so many of one channel come in a row
_JERKS = (0.002, 0.01, 0.05, 0.3, 2.0)  # spectral densities of a, (m/s²)²/s,
_CHANGES = (1e-5, 1e-4, 1e-3, 1e-2, 1e-1)  # and of d, (m/s)²/s, between which the likelihood chooses
_TRIAL, _TRIALS = 250, 5  # rows that it is judged on, in so many parts


@dataclass(frozen=True)
class Walks:
    """How fast acceleration and slip speed change: spectral densities of their random walks [SI]."""

    jerk: float
    change: float


@dataclass(frozen=True)
class Filtered:
    """What the filter gives, a row each.

    ``state`` (n, 2 + wheels); ``covariance`` (n, 2 + wheels, 2 + wheels); ``nis`` and ``channels`` (n,): innovation squared
    over its variance, summed over the channels taken; ``outlier`` (n,); ``likelihood``: logarithm, of all.
    """

    state: Floats
    covariance: Floats
    nis: Floats
    channels: Floats
    outlier: npt.NDArray[np.bool_]
    likelihood: float


def choose_walks(time: Floats, speeds: Floats, noise: Floats, anew: npt.NDArray[np.bool_]) -> Walks:
    """The walks under which parts of the log, spread over its motion, are likeliest, of a coarse grid.

    Arguments as for `run`.
    """
    moving = np.flatnonzero(np.nan_to_num(np.abs(speeds)).max(axis=1) > 0.1)
    first, last = (int(moving[0]), int(moving[-1]) + 1) if len(moving) else (0, len(time))
    starts = {int(k) for k in np.linspace(first, max(first, last - _TRIAL), _TRIALS)}
    parts = [slice(k, min(k + _TRIAL, last)) for k in sorted(starts)]

    def likelihood(walks: Walks) -> float:
        return sum(run(time[p], speeds[p], noise, anew[p], walks).likelihood for p in parts)

    jerk = max(_JERKS, key=lambda q: likelihood(Walks(q, _CHANGES[2])))
    change = max(_CHANGES, key=lambda q: likelihood(Walks(jerk, q)))
    return Walks(jerk, change)


class SlipFilter:
    """The filter, sample by sample; `run` is its steps one after another.

    ``noise`` (1 + wheels,): SDs of ground speed and rim speeds [m/s]. ``state`` (2 + wheels,) and ``covariance``, its rows, are those
    after the last step; after `take`, ``nis``, ``taken`` and ``outlier`` say how its samples fitted, as in `Filtered`. Plain
    numbers: at this size they are ten times as fast as arrays.
    """

    def __init__(self, noise: Sequence[float] | Floats, walks: Walks) -> None:
        self.walks = walks
        self._variance = [float(sd) ** 2 for sd in noise]
        self._prior = [_PRIOR[0] ** 2, _PRIOR[1] ** 2, *[_PRIOR[2] ** 2] * (len(noise) - 1)]
        self.refused = [0] * len(noise)
        self.likelihood = self.nis = 0.0
        self.taken, self.outlier = 0, False
        self.state: list[float] = []
        self.covariance: list[list[float]] = []
        self.anew()

    def anew(self) -> None:
        """Nothing is known of the motion from here on."""
        size = len(self._prior)
        self.state = [0.0] * size
        self.covariance = [[self._prior[i] if i == j else 0.0 for j in range(size)] for i in range(size)]

    def ahead(self, dt: float) -> None:
        """Go ``dt`` [s] on."""
        x, p, q = self.state, self.covariance, self.walks.jerk
        x[0] += dt * x[1]
        first, second = p[0], p[1]
        for j, value in enumerate(second):
            first[j] += dt * value
        for row in p:
            row[0] += dt * row[1]
        first[0] += q * dt**3 / 3
        first[1] += q * dt**2 / 2
        second[0] += q * dt**2 / 2
        second[1] += q * dt
        change = self.walks.change * dt
        for i in range(2, len(x)):
            p[i][i] += change

    def take(self, speeds: Sequence[float]) -> None:
        """Take samples (1 + wheels,) [m/s] of this instant, NaN where not measured."""
        x, p = self.state, self.covariance
        self.nis, self.taken, self.outlier = 0.0, 0, False
        for c, speed in enumerate(speeds):
            if not math.isfinite(speed):
                continue
            column, variance = self._seen(c)
            innovation = speed - x[0] - (x[c + 1] if c else 0.0)
            ratio = innovation * innovation / variance
            if ratio > _GATE**2 and self.refused[c] < _PATIENCE:
                self.refused[c] += 1
                self.outlier = True
                self.likelihood -= 0.5 * (_GATE**2 + math.log(variance))
                continue
            if self.refused[c] >= _PATIENCE and ratio > _GATE**2:
                # So many in a row are no outliers: the motion is not what was thought.
                for i, more in enumerate(self._prior):
                    p[i][i] += more
                column, variance = self._seen(c)
            self.refused[c] = 0
            for i, share in enumerate(column):
                gain = share / variance
                x[i] += gain * innovation
                row = p[i]
                for j, other in enumerate(column):
                    row[j] -= gain * other
            self.nis += ratio
            self.taken += 1
            self.likelihood -= 0.5 * (ratio + math.log(variance))

    def _seen(self, channel: int) -> tuple[list[float], float]:
        """Covariance (n,) of the state with a channel, and the variance of its innovation: ground speed sees v, a wheel v + d."""
        if channel == 0:
            column = [row[0] for row in self.covariance]
            return column, column[0] + self._variance[0]
        column = [row[0] + row[channel + 1] for row in self.covariance]
        return column, column[0] + column[channel + 1] + self._variance[channel]


def run(
    time: Floats,
    speeds: Floats,
    noise: Floats,
    anew: npt.NDArray[np.bool_],
    walks: Walks,
    *,
    smooth: bool = False,
    going: SlipFilter | None = None,
    since: float | None = None,
) -> Filtered:
    """Filter a log, forwards or both ways.

    Parameters
    ----------
    time: (n,) s. speeds: (n, 1 + wheels) m/s, ground speed first, NaN where not measured. noise: (1 + wheels,) their SDs.
    anew: (n,) rows before which nothing is known of the motion. walks: see `Walks`. smooth: run backwards too. going: a
    filter that goes on from the instant ``since`` [s].
    """
    rows, channels = speeds.shape
    size = channels + 1
    state, covariance = np.empty((rows, size)), np.empty((rows, size, size))
    ahead = np.empty((rows, size, size)) if smooth else None  # predicted covariances
    nis, taken, outlier = np.zeros(rows), np.zeros(rows), np.zeros(rows, dtype=bool)
    steps = np.diff(time, prepend=time[0] if since is None else since)
    one = SlipFilter(noise, walks) if going is None else going
    for k, (dt, fresh, samples) in enumerate(
        zip(steps.tolist(), anew.tolist(), speeds.tolist(), strict=True)
    ):
        if fresh:
            one.anew()
        elif k or going is not None:
            one.ahead(dt)
        if ahead is not None:
            ahead[k] = one.covariance
        one.take(samples)
        state[k], covariance[k] = one.state, one.covariance
        nis[k], taken[k], outlier[k] = one.nis, one.taken, one.outlier
    found = Filtered(state, covariance, nis, taken, outlier, one.likelihood)
    if ahead is not None:
        _backwards(found, ahead, steps, anew)
    return found


def _backwards(found: Filtered, ahead: Floats, steps: Floats, anew: npt.NDArray[np.bool_]) -> None:
    """Overwrite the forward estimates by those that know the rows after each."""
    state, covariance = found.state, found.covariance
    move = np.eye(state.shape[1])
    for k in range(len(state) - 2, -1, -1):
        if anew[k + 1]:
            continue
        move[0, 1] = steps[k + 1]
        gain = np.linalg.solve(ahead[k + 1], move @ covariance[k]).T
        state[k] += gain @ (state[k + 1] - move @ state[k])
        covariance[k] += gain @ (covariance[k + 1] - ahead[k + 1]) @ gain.T
