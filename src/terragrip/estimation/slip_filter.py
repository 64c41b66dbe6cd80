"""A Kalman filter for slip from speeds alone.

State: ground speed v, its rate a, and for each wheel the slip speed d = rω - v. a and d are random walks; ground speed
measures v, a wheel's rim speed measures v + d. All of it is linear, and both speeds share v, so that noise of one does not
pass for slip. Backwards by Rauch, Tung and Striebel (1965). (R), our own construction.
"""

from __future__ import annotations

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


def run(
    time: Floats,
    speeds: Floats,
    noise: Floats,
    anew: npt.NDArray[np.bool_],
    walks: Walks,
    *,
    smooth: bool = False,
) -> Filtered:
    """Filter a log, forwards or both ways.

    Parameters
    ----------
    time: (n,) s. speeds: (n, 1 + wheels) m/s, ground speed first, NaN where not measured. noise: (1 + wheels,) their SDs.
    anew: (n,) rows before which nothing is known of the motion. walks: see `Walks`. smooth: run backwards too.
    """
    rows, channels = speeds.shape
    size = channels + 1
    state, covariance = np.empty((rows, size)), np.empty((rows, size, size))
    ahead = np.empty((rows, size, size)) if smooth else None  # predicted covariances
    nis, taken, outlier = np.zeros(rows), np.zeros(rows), np.zeros(rows, dtype=bool)
    refused = [0] * channels
    steps = np.diff(time, prepend=time[0])
    measured = np.isfinite(speeds)
    x, p = np.zeros(size), np.zeros((size, size))
    likelihood = 0.0
    for k in range(rows):
        if k == 0 or anew[k]:
            x, p = np.zeros(size), np.diag(np.square([*_PRIOR[:2], *[_PRIOR[2]] * (channels - 1)]))
        else:
            x, p = _ahead(x, p, float(steps[k]), walks)
        if ahead is not None:
            ahead[k] = p
        for c in np.flatnonzero(measured[k]):
            # Ground speed sees v; a wheel sees v and its own d.
            column = p[:, 0] if c == 0 else p[:, 0] + p[:, c + 1]
            variance = column[0] + (0.0 if c == 0 else column[c + 1]) + noise[c] ** 2
            innovation = speeds[k, c] - x[0] - (0.0 if c == 0 else x[c + 1])
            ratio = innovation * innovation / variance
            if ratio > _GATE**2 and refused[c] < _PATIENCE:
                refused[c] += 1
                outlier[k] = True
                likelihood -= 0.5 * (_GATE**2 + np.log(variance))
                continue
            if refused[c] >= _PATIENCE and ratio > _GATE**2:
                # So many in a row are no outliers: the motion is not what was thought.
                p = p + np.diag(np.square([*_PRIOR[:2], *[_PRIOR[2]] * (channels - 1)]))
                column = p[:, 0] if c == 0 else p[:, 0] + p[:, c + 1]
                variance = column[0] + (0.0 if c == 0 else column[c + 1]) + noise[c] ** 2
            refused[c] = 0
            x = x + column * (innovation / variance)
            p = p - np.outer(column, column) / variance
            nis[k] += ratio
            taken[k] += 1
            likelihood -= 0.5 * (ratio + np.log(variance))
        state[k], covariance[k] = x, p
    found = Filtered(state, covariance, nis, taken, outlier, float(likelihood))
    if ahead is not None:
        _backwards(found, ahead, steps, anew)
    return found


def _ahead(x: Floats, p: Floats, dt: float, walks: Walks) -> tuple[Floats, Floats]:
    """State and covariance a time step later."""
    x = x.copy()
    x[0] += dt * x[1]
    p = p.copy()
    p[0, :] += dt * p[1, :]
    p[:, 0] += dt * p[:, 1]
    q = walks.jerk
    p[0, 0] += q * dt**3 / 3
    p[0, 1] += q * dt**2 / 2
    p[1, 0] += q * dt**2 / 2
    p[1, 1] += q * dt
    rest = np.arange(2, len(x))
    p[rest, rest] += walks.change * dt
    return x, p


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
