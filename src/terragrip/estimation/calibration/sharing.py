"""Wheels that share one adhesion curve: torque gains of the wheels relative to each other.

Wheels at the same slip on the same soil have the same adhesion, so the difference of one wheel's torque from the others' is
its gain. Model of the mean torque of wheel i over window n (physics.md 1, averaged)::

    M_in = k_i (B_in + r_i F_in (m_n + d_n (s_in - s_n + (1 - s_in) e_i))) + o_i,   B = J dω/dt + r ρ_t F + r ρ_w ω

m_n is the adhesion that all wheels have at the window's mean slip s_n, an unknown of its own in every window: so neither the noise of
ground speed, nor the curve's form, nor what the soil does to all wheels alike enters the gains. The curve is needed only
for its steepness d_n, which holds the wheels' small differences of slip
(:mod:`~terragrip.estimation.calibration.steepness`). Unknown are ln k_i (mean 0: a gain common to all
wheels cannot be distinguished from m_n) and, with their priors, the relative radii e_i (mean 0, likewise), the offsets o_i and what is
left of the gyroscope's zero, which shifts slip from side to side. A larger radius is a longer lever, too: what is solved for in place
of k_i is k_i (1 + e_i). Weighted least squares with Huber weights; (R), our own construction.

Adhesion differs from place to place, so the errors of neighbouring windows are correlated: the covariance is the sandwich
over blocks of track.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.estimation.calibration.steepness import Steepness, steepness_of

_ROUNDS = 60
_CLOSE = 1e-8  # change of every ln k
_HUBER = 2.5  # robust standard deviations
_LOCAL = 0.1  # relative difference of local adhesion between wheels, for the weights: to start with,
_LEAST_LOCAL = 0.01  # and at least
_LEAST_WINDOWS = 30
_MOST_STRETCH = 0.8
_LASTS = 0.2  # share of the blocks over which errors may be alike
_UNLIKELY = 0.02  # a form that is less likely is not tried


@dataclass(frozen=True)
class Sharing:
    """Rows that share curves: a row a window, a column a wheel (n, w), no NaN.

    ``torque`` N m; ``known`` the part B without adhesion, N m; ``leverage`` r F, N m; ``slip``; ``soil`` (n,) and
    ``block`` (n,) integer labels from 0. ``radius_std`` of each wheel's relative radius, ``offset_std`` (w,) N m: the priors; ``slip_std``
    of an error that all slips share. ``by_delay`` (n,) 1/s: what a ground speed that is late by a second adds to the slips (None: nothing);
    ``by_yaw`` (n, w) s: what a yaw rate that is too large by 1 rad/s adds (None: nothing), and ``yaw_std`` the prior of that error, rad/s.
    """

    torque: Floats
    known: Floats
    leverage: Floats
    slip: Floats
    soil: Ints
    block: Ints
    radius_std: float
    offset_std: Floats
    slip_std: float = 0.0
    by_delay: Floats | None = None
    by_yaw: Floats | None = None
    yaw_std: float = 0.0

    def select(self, rows: Bools) -> Sharing:
        """The windows of a mask (n,)."""
        names = ("torque", "known", "leverage", "slip", "soil", "block", "by_delay", "by_yaw")
        by_row = {name: getattr(self, name) for name in names}
        return replace(self, **{name: value[rows] for name, value in by_row.items() if value is not None})


@dataclass(frozen=True)
class SharedGains:
    """``log_gain`` (w,) and relative ``radius`` (w,), both with mean 0, and their ``covariance`` (2 w, 2 w).

    ``windows`` and ``blocks`` of track are what they rest on; ``load_sensitivity`` (2 w, w) is ∂(ln k, e)/∂ln F;
    ``lasting``: how many times larger the gains' standard errors are for errors that outlast a block.
    """

    log_gain: Floats
    radius: Floats
    covariance: Floats
    windows: int
    blocks: int
    load_sensitivity: Floats
    lasting: float = 1.0


def fit_shared_gains(data: Sharing) -> SharedGains | None:
    """Estimate the relative gains; None where there are too few windows."""
    if len(data.torque) < _LEAST_WINDOWS:
        return None
    first = _Problem.of(data)
    start = first.solve(np.zeros(len(first.prior)), 1.0)
    best = _solved(first.refined(start), start)
    error = min(best.problem.curves.relative_std, _MOST_STRETCH)
    # Where curves are steeper by a factor than they look, or of another form than fits best.
    around = first.refined(best.values)
    others = [(0.5, _solved(replace(around, stretch=1 + sign * error), best.values)) for sign in (-1.0, 1.0)]
    others += [
        (chance, _solved(replace(around, form=form), best.values))
        for form, chance in enumerate(best.problem.curves.chance)
        if chance > _UNLIKELY
    ]
    problem, w = best.problem, data.torque.shape[1]
    # What takes (ln k, e) to their differences: an error that all wheels have leaves no trace. A larger radius is a longer lever.
    apart = np.eye(w) - 1 / w
    center = np.block([[np.eye(w), -apart], [np.zeros((w, w)), apart]])
    found = center @ best.values[: 2 * w]
    changes = [(chance, center @ other.values[: 2 * w] - found) for chance, other in others]
    covariance = problem.covariance(best.values, best.scale, data.block)[: 2 * w, : 2 * w]
    alone = problem.covariance(best.values, best.scale, data.block, lasting=False)[:w, :w]
    return SharedGains(
        log_gain=found[:w],
        radius=found[w:],
        covariance=center @ covariance @ center.T
        + sum(c * np.outer(change, change) for c, change in changes),
        windows=len(data.block),
        blocks=len(np.unique(data.block)),
        load_sensitivity=center @ problem.load_sensitivity(best.values, best.scale),
        lasting=float(np.sqrt(np.trace(covariance[:w, :w]) / np.trace(alone))),
    )


class _Solution(NamedTuple):
    problem: _Problem
    values: Floats  # (p,)
    scale: float  # the design effect that the priors are weighted with


def _solved(problem: _Problem, start: Floats) -> _Solution:
    """The unknowns, from a start nearby."""
    w = problem.data.torque.shape[1]
    values = problem.solve(start, 1.0)
    fit = problem.fit(values, 1.0)
    naive, clustered = (
        _inverse(fit.normal) * fit.variance,
        problem.covariance(values, 1.0, problem.data.block),
    )
    # Neighbouring windows repeat each other: weigh the priors against the data's true information.
    scale = max(1.0, float(np.trace(clustered[:w, :w]) / np.trace(naive[:w, :w])))
    return _Solution(problem, problem.solve(values, scale), scale)


@dataclass(frozen=True)
class _Fit:
    jacobian: Floats  # (n, w, p), of the scaled residual, the part that m_n absorbs removed
    residual: Floats  # (n, w), likewise
    weight: Floats  # (n, w), of Huber
    normal: Floats  # (p, p), priors and the zero mean of ln k included
    variance: float  # of a scaled residual


@dataclass(frozen=True)
class _Problem:
    """Unknowns: ln k, e, o, each (w,), and the yaw rate's error where it has any."""

    data: Sharing
    prior: Floats  # (p, p) precision, p = 3 w, or 3 w + 1
    torque_noise: float
    curves: Steepness  # as the levels show it
    local: Floats  # (n,) relative difference of local adhesion between wheels
    stretch: float = 1.0  # factor on what the levels show of the steepness
    form: int | None = None  # the curves' form; None: that which fits best

    @property
    def steepness(self) -> Floats:
        """(n,) d_n."""
        return self.stretch * self.curves.of(self.form)

    @classmethod
    def of(cls, data: Sharing) -> _Problem:
        n, w = data.torque.shape
        turns = data.by_yaw is not None and data.yaw_std > 0
        prior = np.zeros((3 * w + turns, 3 * w + turns))
        prior[w : 2 * w, w : 2 * w] = np.eye(w) / data.radius_std**2
        prior[2 * w : 3 * w, 2 * w : 3 * w] = np.diag(1 / data.offset_std**2)
        if turns:
            prior[-1, -1] = data.yaw_std**-2.0
        noise = 0.02 * float(np.median(np.abs(data.torque)))
        flat = Steepness(np.zeros((1, n)), 0.0, np.ones(1))
        problem = cls(data, prior, max(noise, 1e-9), flat, np.full(n, _LOCAL))
        return problem._with_steepness(np.zeros(len(prior)))

    def refined(self, values: Floats) -> _Problem:
        """The problem with the curves' steepness and each soil's scatter as the residuals show them."""
        level, residual, _ = self._levels(values)
        size = np.maximum(np.abs(self.data.leverage * level[:, None]), self.torque_noise)
        share = np.median(np.abs(residual / size), axis=1)
        local = self.local.copy()
        for soil in np.unique(self.data.soil):
            own = self.data.soil == soil
            if own.sum() >= _LEAST_WINDOWS:
                local[own] = max(_LEAST_LOCAL, 1.4826 * float(np.median(share[own])))
        return replace(self, local=local)._with_steepness(values)

    def _with_steepness(self, values: Floats) -> _Problem:
        """d_n of the curves as the levels show them."""
        level, _, _ = self._levels(values)
        data = self.data
        by_delay = np.zeros(len(level)) if data.by_delay is None else data.by_delay
        curves = steepness_of(level, data.slip.mean(axis=1), data.soil, data.slip_std, data.block, by_delay)
        return replace(self, curves=curves)

    def _levels(self, values: Floats) -> tuple[Floats, Floats, Floats]:
        """m_n (n,), the residual torque (n, w) and its spread (n, w) at the unknowns' values."""
        w = self.data.torque.shape[1]
        gain, offset = np.exp(values[:w]), values[2 * w : 3 * w]
        lever = gain * self.data.leverage
        rest = self.data.torque - offset - gain * self.data.known - lever * self._slip_part(values)
        # Adhesion differs in proportion: the spread of a torque is proportional to the wheel's own share of it.
        size = np.abs(np.median(rest / lever, axis=1, keepdims=True)) * lever
        spread = np.hypot(self.local[:, None] * size, self.torque_noise)
        level = np.sum(rest * lever / spread**2, axis=1) / np.sum(lever**2 / spread**2, axis=1)
        return level, rest - level[:, None] * lever, spread

    def _slip_part(self, values: Floats) -> Floats:
        """Adhesion that the wheels' differences of slip make (n, w)."""
        w = self.data.torque.shape[1]
        slip, shift = self.data.slip, values[w : 2 * w]
        apart = slip - slip.mean(axis=1, keepdims=True) + (1 - slip) * shift
        if len(values) > 3 * w:
            apart = apart - self._by_yaw() * values[-1]
        return np.asarray(self.steepness[:, None] * apart)

    def _by_yaw(self) -> Floats:
        """What an error of the yaw rate adds to each slip beyond their mean (n, w), s."""
        by_yaw = self.data.by_yaw
        assert by_yaw is not None
        return np.asarray(by_yaw - by_yaw.mean(axis=1, keepdims=True))

    def fit(self, values: Floats, scale: float) -> _Fit:
        """Linearise at the values; ``scale`` is the design effect that the priors are weighted with."""
        n, w = self.data.torque.shape
        level, residual, spread = self._levels(values)
        gain = np.exp(values[:w])
        lever = gain * self.data.leverage
        jacobian = np.zeros((n, w, len(values)))
        own = np.arange(w)
        jacobian[:, own, own] = gain * self.data.known + lever * (level[:, None] + self._slip_part(values))
        jacobian[:, own, w + own] = lever * self.steepness[:, None] * (1 - self.data.slip)
        jacobian[:, own, 2 * w + own] = 1.0
        if len(values) > 3 * w:
            jacobian[:, :, -1] = -lever * self.steepness[:, None] * self._by_yaw()
        scaled = residual / spread
        robust = 1.4826 * float(np.median(np.abs(scaled)))
        weight = np.minimum(1.0, _HUBER * robust / np.maximum(np.abs(scaled), 1e-300))
        free = lever / spread  # what a change of m_n does
        jacobian /= spread[..., None]
        norm = np.sum(weight * free**2, axis=1)
        taken = np.einsum("nw,nwp->np", weight * free, jacobian) / norm[:, None]
        jacobian -= free[..., None] * taken[:, None, :]
        scaled = scaled - free * (np.sum(weight * free * scaled, axis=1) / norm)[:, None]
        variance = float(np.sum(weight * scaled**2) / np.sum(weight)) * w / (w - 1)
        flat = jacobian.reshape(-1, len(values))
        normal = flat.T @ (flat * weight.reshape(-1, 1)) + variance * scale * self.prior
        # The means of ln k and of e are 0, since m_n absorbs what is common: rows without uncertainty.
        for part in (slice(w), slice(w, 2 * w)):
            normal[part, part] += 1e6 * float(np.max(np.diag(normal)[part]))
        return _Fit(jacobian, scaled, weight, normal, variance)

    def step(self, values: Floats, scale: float) -> Floats:
        """One Gauss-Newton step (p,)."""
        w, fit = self.data.torque.shape[1], self.fit(values, scale)
        gradient = np.einsum("nwp,nw->p", fit.jacobian, fit.weight * fit.residual)
        gradient -= fit.variance * scale * self.prior @ values
        move = _inverse(fit.normal) @ gradient
        for part in (slice(w), slice(w, 2 * w)):
            move[part] -= np.mean(values[part] + move[part])
        return np.asarray(move)

    def solve(self, values: Floats, scale: float) -> Floats:
        """Gauss-Newton steps until the gains converge."""
        w = self.data.torque.shape[1]
        for _ in range(_ROUNDS):
            move = self.step(values, scale)
            values = values + move
            if np.max(np.abs(move[:w])) < _CLOSE:
                break
        return values

    def covariance(self, values: Floats, scale: float, block: Ints, *, lasting: bool = True) -> Floats:
        """Sandwich covariance of the unknowns over blocks (n,)."""
        fit = self.fit(values, scale)
        score = np.einsum("nwp,nw->np", fit.jacobian, fit.weight * fit.residual)
        jacobian = fit.jacobian * np.sqrt(fit.weight)[..., None]
        prior = (fit.variance * scale) ** 2 * self.prior
        return block_covariance(fit.normal, jacobian, score, block, prior, lasting=lasting)

    def load_sensitivity(self, values: Floats, scale: float) -> Floats:
        """∂(ln k, e)/∂ln F by one Gauss-Newton step from the optimum, (2 w, w)."""
        w, change = self.data.torque.shape[1], 0.01
        rest, columns = self.step(values, scale)[: 2 * w], []
        for j in range(w):
            # The tire's resistance in B grows with the load too; it is small beside the adhesion's torque.
            leverage = self.data.leverage * (1 + change * (np.arange(w) == j))
            moved = replace(self, data=replace(self.data, leverage=leverage))
            columns.append((moved.step(values, scale)[: 2 * w] - rest) / change)
        return np.stack(columns, axis=1)


def block_covariance(
    normal: Floats, jacobian: Floats, score: Floats, block: Ints, prior: Floats, *, lasting: bool = True
) -> Floats:
    """Covariance (p, p) of a least-squares fit whose errors are correlated in blocks and beyond: leave one block out (CR3).

    ``normal`` (p, p) with all priors; ``jacobian`` (n, w, p), times the root of the weights; ``score`` (n, p) weighted
    residual times Jacobian; ``block`` (n,) labels; ``prior`` (p, p) what the priors' own errors add. One step from the
    optimum stands for each refit. Unlike the plain sandwich it does not understate the variance of a fit that rests on few blocks.
    ``lasting``: where neighbouring blocks err alike (one soil, a receiver's error of half a minute), their products count too.
    """
    labels, code = np.unique(block, return_inverse=True)
    count, size = len(labels), len(normal)
    scores = np.zeros((count, size))
    np.add.at(scores, code, score)
    information = np.zeros((count, size, size))
    np.add.at(information, code, np.einsum("nwp,nwq->npq", jacobian, jacobian))
    shifts = (_inverse(normal - information) @ scores[..., None])[..., 0]
    inverse = _inverse(normal)
    widened = shifts * _lasting(shifts) if lasting else shifts
    return np.asarray(widened.T @ widened * (count - 1) / count + inverse @ prior @ inverse)


def _lasting(shifts: Floats) -> Floats:
    """Factors (p,) of at least 1 on the standard errors: what neighbours of a row of shifts (blocks, p) add, by Bartlett's weights.

    Newey and West, Econometrica 55, 1987. Products of chance sign may make a variance smaller; that is not accepted.
    """
    reach = int(np.ceil(_LASTS * len(shifts)))
    alone = np.sum(shifts**2, axis=0)
    together = alone + sum(
        2 * (1 - lag / (reach + 1)) * np.sum(shifts[lag:] * shifts[:-lag], axis=0)
        for lag in range(1, min(reach, len(shifts) - 1) + 1)
    )
    return np.asarray(np.sqrt(np.maximum(together / np.maximum(alone, 1e-300), 1.0)))


def effective_blocks(normal: Floats, jacobian: Floats, block: Ints, unknown: int) -> float:
    """How many equal blocks would determine one unknown as well as these do: (Σγ)²/Σγ², γ a block's part of its variance.

    Arguments as in `block_covariance`; Carter, Schnepel and Steigerwald, Review of Economics and Statistics 99, 2017.
    """
    labels, code = np.unique(block, return_inverse=True)
    part = np.zeros(len(labels))
    np.add.at(part, code, np.sum((jacobian @ _inverse(normal)[unknown]) ** 2, axis=1))
    return float(np.sum(part) ** 2 / np.sum(part**2)) if part.any() else 1.0


def _inverse(matrix: Floats) -> Floats:
    """Inverses (..., p, p) of positive semidefinite matrices after scaling their diagonals to 1; what is not determined stays 0."""
    size = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 1e-300))
    scale = size[..., :, None] * size[..., None, :]
    values, vectors = np.linalg.eigh(matrix / scale)
    known = np.abs(values) > 1e-13 * np.abs(values).max(axis=-1, keepdims=True)
    rooted = np.divide(1.0, values, where=known, out=np.zeros_like(values))
    inverse = (vectors * rooted[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return np.asarray(inverse / scale)
