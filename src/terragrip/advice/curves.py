"""Adhesion and resistance of one soil over slip as a set of drawn curves: what the data say, what is known of soils, and the rest open.

Model, over the true slip s, while what is measured is s + e:

    mu(s) = c r_0 + A (h(q(p) k s; p) - f s),   dh/dx = (1 - h)^p,   rho_s(s) = r_0 + r_1 s

p shapes the rise: 2/3 is the brush tyre's cubic, 1 the exponential of physics.md 5, 2 the hyperbola x/(1 + x); Janosi's shear under a
contact patch lies between. q makes every shape reach 3/4 of its height at the exponential's slip, ln 4/k: how fast soils give grip is
known, by what form is not. c r_0 is the adhesion that a wheel needs before it slips where soil yields. e is the error of slip that stays
alike for a whole drive: a wrong radius, a slow error of the ground speed. Each curve is fitted to bins drawn anew by stretches of way,
to constants (torque scale, drawbar and slope) drawn by their stated spread, and to a prior drawn by its spread (randomised maximum a
posteriori; Bardsley et al. 2014): with much data the curves agree, with little they spread as far as soils do.
Why these: docs/advice-history.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from terragrip.advice.samples import Samples
from terragrip.arrays import Bools, Floats
from terragrip.soil.forms import MISFIT, PRIOR, shape_at

DRAWS = 300
BINS = 12
ROUNDS = 25
LEAST_STRETCHES = 4
LEAST_BINS = 3
_DRIVES = {
    "e": (0.0, np.nan, np.nan, np.nan),
    "r_0": (0.07, 0.06, 0.0, 0.6),
    "r_1": (0.06, 0.12, 0.0, 0.5),
    "c": (0.3, 0.4, 0.0, 1.5),
}
NAMES = ("ln A", "ln k", "f", "e", "r_0", "r_1", "p", "c")
CENTRE, SPREAD, LOWER, UPPER = np.array([{**PRIOR, **_DRIVES}[name] for name in NAMES]).T
"""What soils are like before any data: adhesion rises as in `soil.forms`; resistance .07 that grows by .06 over all of slip (Brixius:
.5/sqrt(Bn); where slip digs wheels in, several times that); c 0 on firm ground, mostly 0 to 1 by Wong and Reece's stresses on Wong's soils
(benchmarks/wheel_stresses.py). The spread of e is the drive's own."""
E = NAMES.index("e")
YIELDING, SOFT = 0.08, 0.18
"""Resistance up to which ground counts as firm, and from which it is taken to yield under the wheel as Wong and Reece's does."""
NO_SMALLER, SLOWER = 0.5, 0.75
"""Wheel radius [m] below which k falls on yielding ground, and its power of the radius there: shear needs a way K of 1 to 2.5 cm whatever
the wheel (Wong), which a small one has only at more slip. K alone gives a power of 1, and 3 on .2 m; the paper's robot of .2 m shows
11. Between the two."""
COMMON = 0.5
"""Share of slip's SD that stays alike for a drive: its mean error over the SD is .4 on development machines, .7 with coarse sensors."""
BY_BIN = 0.2
"""Share of slip's SD by which a bin's mean errs beyond the scatter of its stretches: .2 and .3 there."""
SLIP_FLOOR = 0.006
"""SD of a bin's mean slip beyond its scatter: curves of the way, unequal radii."""


@dataclass(frozen=True)
class CurveDraws:
    """Curves of one soil: ``parameters`` (draws, 8) in the order of NAMES, the first row the best fit; ``reach``: slip that the data reach;
    ``slip``, ``adhesion``, ``resistance`` (bins,): what was fitted; ``stretches`` of way behind it."""

    parameters: Floats
    reach: float
    slip: Floats
    adhesion: Floats
    resistance: Floats
    stretches: int

    def adhesion_at(self, slip: Floats) -> Floats:
        """mu (draws, slips) over the true slip."""
        return adhesion(self._true, np.broadcast_to(slip, (len(self.parameters), len(slip))))

    def resistance_at(self, slip: Floats) -> Floats:
        """rho_s (draws, slips) over the true slip."""
        return resistance(self._true, np.broadcast_to(slip, (len(self.parameters), len(slip))))

    @property
    def _true(self) -> Floats:
        free = self.parameters.copy()
        free[:, E] = 0.0
        return free


def adhesion(parameters: Floats, slip: Floats, shape: Floats | None = None) -> Floats:
    """mu (draws, slips) of parameters (draws, 8) at measured slips (draws, slips); ``shape``: `_shape` of these, if it is known."""
    height, level, share = (parameters[:, NAMES.index(name), None] for name in ("ln A", "r_0", "c"))
    return np.asarray(share * level + np.exp(height) * (_shape(parameters, slip) if shape is None else shape))


def _shape(parameters: Floats, slip: Floats) -> Floats:
    """h(q(p) k s; p) - f s (draws, slips): what of the adhesion depends on ln k, f, e and p alone."""
    rate, fall, error, power = (parameters[:, NAMES.index(name), None] for name in ("ln k", "f", "e", "p"))
    return shape_at(slip - error, rate, fall, power)


def resistance(parameters: Floats, slip: Floats) -> Floats:
    """rho_s (draws, slips) at measured slips; never below 0."""
    slipping = np.maximum(slip - parameters[:, E, None], 0)
    return np.asarray(np.maximum(parameters[:, 4, None] + parameters[:, 5, None] * slipping, 0.0))


def lasting_sd(radius_sd: float, slip_sd: float) -> float:
    """SD of slip's error that stays alike for a drive: by the radius's relative SD, and by slip's own."""
    return float(np.hypot(radius_sd, COMMON * slip_sd))


def draw_curves(
    samples: Samples,
    *,
    common_sd: float,
    radius_sd: float,
    offset_sd: float,
    wheel_radius: float,
) -> CurveDraws | None:
    """Curves of one soil; None with fewer than LEAST_STRETCHES stretches or LEAST_BINS bins.

    common_sd: relative SD of the torque scale; radius_sd: relative, of the rolling radius; offset_sd: of rho_s by drawbar offset and slope;
    wheel_radius [m].
    """
    _, label = np.unique(samples.stretch, return_inverse=True)
    stretches = int(label.max()) + 1 if label.size else 0
    if stretches < LEAST_STRETCHES:
        return None
    order = np.argsort(samples.pull, kind="stable")
    bins = int(np.clip(stretches, LEAST_BINS, BINS))
    share = np.cumsum(samples.metres[order]) / samples.way
    cell = np.empty(order.size, dtype=np.int64)
    cell[order] = np.minimum((share * bins).astype(np.int64), bins - 1)
    flat = label * bins + cell

    def sums(values: Floats) -> Floats:
        summed = np.bincount(flat, weights=values * samples.metres, minlength=stretches * bins)
        return np.asarray(summed, dtype=float).reshape(stretches, bins)

    way = sums(np.ones_like(samples.metres))
    totals = [sums(x) for x in (samples.slip, samples.adhesion, samples.resistance)]
    rng = np.random.default_rng(0)
    times = rng.multinomial(stretches, np.full(stretches, 1 / stretches), size=DRAWS).astype(float)
    times = np.vstack([np.ones(stretches), times])
    weight = times @ way
    enough = weight > 0.2 * samples.way / bins
    slip, mu, rho = (times @ total / np.where(enough, weight, 1.0) for total in totals)
    if np.count_nonzero(enough[0]) < LEAST_BINS:
        return None
    spread = np.sqrt(stretches / (stretches - 1))
    sd = [np.where(enough, x, np.nan) for x in (slip, mu, rho)]
    slip_sd, mu_sd, rho_sd = (spread * _pooled(np.nanstd(x[1:], axis=0)) for x in sd)
    own = BY_BIN * sums(samples.slip_std).sum(axis=0) / way.sum(axis=0)
    slip[1:] += own * rng.standard_normal((DRAWS, bins))
    slip_sd = np.sqrt(slip_sd**2 + SLIP_FLOOR**2 + own**2)
    prior_sd = SPREAD.copy()
    prior_sd[E] = lasting_sd(radius_sd, float(np.median(samples.slip_std)))
    centre = CENTRE.copy()
    yields = np.clip(
        (np.average(samples.resistance, weights=samples.metres) - YIELDING) / (SOFT - YIELDING), 0, 1
    )
    centre[1] += SLOWER * float(yields) * min(np.log(wheel_radius / NO_SMALLER), 0.0)
    prior = centre + prior_sd * rng.standard_normal((DRAWS + 1, len(CENTRE)))
    prior[0] = centre
    scale = 1 + common_sd * rng.standard_normal((DRAWS + 1, 1))
    shift = offset_sd * rng.standard_normal((DRAWS + 1, 1))
    scale[0], shift[0] = 1.0, 0.0
    mu, rho = mu * scale, rho + shift
    x = _fit(slip, mu, rho, enough, (slip_sd, mu_sd, rho_sd), prior, prior_sd)
    return CurveDraws(x, float(np.max(slip[0][enough[0]])), slip[0], mu[0], rho[0], stretches)


def _pooled(sd: Floats) -> Floats:
    """Each bin's SD (bins,), not under that of all: few stretches tell a bin's own badly."""
    known = np.isfinite(sd)
    usual = float(np.sqrt(np.mean(sd[known] ** 2))) if known.any() else 0.1
    return np.where(known, np.maximum(sd, usual), usual)


def _fit(
    slip: Floats,
    mu: Floats,
    rho: Floats,
    enough: Bools,
    sd: tuple[Floats, Floats, Floats],
    prior: Floats,
    prior_sd: Floats,
) -> Floats:
    """The curve of each draw by Levenberg-Marquardt on bins and prior together, (draws, 8)."""
    slip_sd, mu_sd, rho_sd = (np.maximum(np.nan_to_num(x, nan=0.1), 1e-4) for x in sd)
    slip = np.where(enough, slip, 0.0)
    lower, upper = LOWER.copy(), UPPER.copy()
    lower[E], upper[E] = -4 * prior_sd[E], 4 * prior_sd[E]
    of_mu, of_rho = np.ones_like(mu), np.sqrt(rho_sd**2 + (0.05 * rho) ** 2 + 1e-6)

    def by_adhesion(p: Floats, shape: Floats | None = None) -> Floats:
        return np.where(enough, (adhesion(p, slip, shape) - mu) / of_mu, 0.0)

    def by_resistance(p: Floats) -> Floats:
        return np.where(enough, (resistance(p, slip) - rho) / of_rho, 0.0)

    x = np.clip(prior, lower, upper)
    x[:, 0] = np.log(np.maximum(1.3 * np.where(enough, mu, 0).max(axis=1), 0.02))
    damping = np.full(len(x), 1e-2)
    for turn in range(ROUNDS):
        if turn in (0, 8, 16):
            h = 1e-3
            steepness = (adhesion(x, slip + h) - adhesion(x, slip - h)) / (2 * h)
            of_mu = np.sqrt(mu_sd**2 + (steepness * slip_sd) ** 2 + (MISFIT * mu) ** 2 + 1e-6)
        shape = _shape(x, slip)
        a, b = by_adhesion(x, shape), by_resistance(x)
        now = np.concatenate([a, b, (x - prior) / prior_sd], axis=1)
        cost = (now**2).sum(axis=1)
        columns = []
        for i, name in enumerate(NAMES):
            moved = x.copy()
            moved[:, i] += 1e-5
            moved_a = by_adhesion(moved, None if name in ("ln k", "f", "e", "p") else shape)
            moved_b = by_resistance(moved) if name in ("e", "r_0", "r_1") else b
            columns.append(
                (np.concatenate([moved_a, moved_b, (moved - prior) / prior_sd], axis=1) - now) / 1e-5
            )
        jacobian = np.stack(columns, axis=-1)
        transposed = jacobian.transpose(0, 2, 1)
        gradient, normal = transposed @ now[..., None], transposed @ jacobian
        diagonal = np.einsum("bkk->bk", normal)
        damped = normal + (damping[:, None] * diagonal)[:, :, None] * np.eye(x.shape[1])
        trial = np.clip(x - np.linalg.solve(damped, gradient)[..., 0], lower, upper)
        tried = np.concatenate([by_adhesion(trial), by_resistance(trial), (trial - prior) / prior_sd], axis=1)
        better = (tried**2).sum(axis=1) < cost
        x = np.where(better[:, None], trial, x)
        damping = np.clip(np.where(better, damping / 4, damping * 6), 1e-8, 1e8)
    return x
