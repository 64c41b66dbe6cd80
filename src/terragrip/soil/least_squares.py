"""Least squares of a curve model on bin means, many sets of means at once (the bootstrap's), by Levenberg-Marquardt with bounds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from terragrip.arrays import Floats
from terragrip.physics.adhesion import CurveModel

INTERCEPT = "intercept"


def solve(
    model: CurveModel,
    free: Sequence[str],
    fixed: Mapping[str, float],
    slip: Floats,
    means: Floats,
    weights: Floats,
    start: Floats,
    iterations: int = 60,
) -> tuple[Floats, Floats]:
    """Parameters (sets, free) that minimise sum_j w_j (means_j - curve(slip_j))^2, and that sum (sets,).

    slip, means, weights: (sets, bins), weight 0 where a bin is missing; start: (sets, free). `free` may name "intercept".
    Each set iterates on its own: a step is kept where it lowers the sum, and the damping follows (Marquardt 1963).
    """
    bounds = {p.name: (p.lower, p.upper) for p in model.parameters} | {INTERCEPT: (-2.0, 2.0)}
    lower = np.array([bounds[name][0] for name in free])
    upper = np.array([bounds[name][1] for name in free])
    root = np.sqrt(weights)
    target = np.where(weights > 0, means, 0.0) * root
    where = np.where(weights > 0, slip, 0.1)

    def curve(x: Floats) -> Floats:
        given = {name: x[:, i, None] for i, name in enumerate(free)}
        intercept = given.pop(INTERCEPT, fixed.get(INTERCEPT, 0.0))
        rest = {name: value for name, value in fixed.items() if name != INTERCEPT}
        return model.value(where, {**rest, **given}, intercept) * root

    x = np.clip(start, lower, upper)
    now = curve(x)
    cost = ((target - now) ** 2).sum(axis=1)
    damping = np.full(len(x), 1e-3)
    for _ in range(iterations):
        jacobian = _jacobian(curve, x, now, upper)
        gradient = np.einsum("bkj,bj->bk", jacobian, target - now)
        normal = np.einsum("bkj,blj->bkl", jacobian, jacobian)
        scale = np.maximum(np.einsum("bkk->bk", normal), 1e-12)
        damped = normal + (damping[:, None] * scale)[..., None] * np.eye(len(free))
        step = np.linalg.solve(damped, gradient[..., None])[..., 0]
        trial = np.clip(x + step, lower, upper)
        value = curve(trial)
        trial_cost = ((target - value) ** 2).sum(axis=1)
        better = trial_cost < cost
        moved = float(
            np.max(np.where(better, (cost - trial_cost) / np.maximum(cost, 1e-300), 0.0), initial=0.0)
        )
        x = np.where(better[:, None], trial, x)
        now = np.where(better[:, None], value, now)
        cost = np.where(better, trial_cost, cost)
        damping = np.clip(np.where(better, damping / 5, damping * 4), 1e-12, 1e12)
        if moved < 1e-10 and (damping.min() > 1e3 or better.any()):
            break
    return x, cost


def _jacobian(curve, x: Floats, now: Floats, upper: Floats) -> Floats:  # type: ignore[no-untyped-def]
    """Forward differences, backward at an upper bound: (sets, free, bins), bins last because sums run over them."""
    columns = []
    for i in range(x.shape[1]):
        h = 1e-6 * np.maximum(np.abs(x[:, i]), 1e-2)
        h = np.where(x[:, i] + h > upper[i], -h, h)
        moved = x.copy()
        moved[:, i] += h
        columns.append((curve(moved) - now) / h[:, None])
    return np.stack(columns, axis=1)


def starts(model: CurveModel, free: Sequence[str], means: Floats) -> Floats:
    """Start points (starts, free): the model's own, its heights scaled to the data, and its rates halved and tripled."""
    level = float(np.nanmax(np.abs(means))) or 0.1
    scaled = {"a", "A", "c1", "D", "b"}
    rates = {"k", "c2", "B", "c", "alpha_2", "mobility", "wheel_numeric"}
    base = {p.name: p.start for p in model.parameters} | {INTERCEPT: 0.0}
    rows = []
    for factor in (1.0, 0.5, 0.2, 3.0):
        for drop in (0.0, -0.1 * level):
            row = []
            for name in free:
                value = base[name]
                if name in scaled:
                    value = level / 0.476 if (model.name, name) == ("exponential", "a") else 1.1 * level
                elif name in rates:
                    value *= factor
                elif name == INTERCEPT:
                    value = drop
                row.append(value)
            rows.append(row)
    return np.array(rows)
