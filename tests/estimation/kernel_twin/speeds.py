"""Slip from speeds alone as the kernel's `speeds.c` has it, in plain NumPy: what tests hold the kernel against.

State: ground speed v, its rate a, and of each wheel the slip speed d = r ω - (v - side yaw_rate), all in the vehicle's own
directions. a is an Ornstein-Uhlenbeck process (Singer 1970), d a random walk in proportion to speed. How hard both are driven is
not known: nine filters, one a pair of densities, are mixed as an interacting multiple model (Blom and Bar-Shalom 1988).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from kernel_twin.reckoning import Reckoning

Floats = npt.NDArray[np.float64]

MANOEUVRES = (1e-3, 3e-2, 1.0)
"""Densities of what drives the acceleration, (m/s²)²/s: a steady drive, driving by hand, sharp starts and stops."""
SLIPPING = (5e-3, 5e-2, 5e-1)
"""Change of slip per root second: one ground and load, a rough one, a wheel that lets go."""
PAIRS = tuple((manoeuvre, slipping) for manoeuvre in MANOEUVRES for slipping in SLIPPING)
LASTING = 3.0
"""Time constant of the acceleration [s]."""
DWELL = 2.0
"""Mean time [s] in a pair of densities."""
HUBER = 4.0
OUTLIER = 0.5
"""A sample that counts less than this is an outlier."""
_FIRST_RATE = 1.0  # SD of a [m/s²] before it was seen
_AGILITY = 0.5 * 9.80665  # m/s²: what a vehicle is capable of
_SLOWEST = 0.1  # m/s: slower wheels change their slip speed no less
TOGETHER = 0.9
"""Correlation of what two wheels' slip speeds change by: they stand on one ground and pull one load."""
SLOW_SHARE = 0.2
"""Of the ground speed's noise: SD of an error that does not average out, before any stop has shown it."""
MEMORY, SURE, SPIKE = 1000, 2.0, 4.0
"""Neighbouring innovations: over so many their mean product; what exceeds so many SDs of chance counts; cut at so many SDs."""


@dataclass
class SpeedsFilter:
    """``noise`` (1 + wheels,): SDs [m/s] of ground speed and rim speeds. ``state`` (2 + wheels,) and ``covariance``."""

    noise: Floats
    state: Floats = field(init=False)
    covariance: Floats = field(init=False)
    means: Floats = field(init=False)
    spreads: Floats = field(init=False)
    probability: Floats = field(init=False)
    begun: bool = field(init=False)
    nis: float = field(init=False, default=0.0)
    channels: int = field(init=False, default=0)
    weight: Floats = field(init=False)
    densities: tuple[float, float] = field(init=False, default=(0.0, 0.0))
    off: float = field(init=False)
    """1, -1: the last ground speed lay above, below what was expected, and counted less; 0: neither."""
    alike: float = field(init=False, default=0.0)
    pairs: int = field(init=False, default=0)
    last: float = field(init=False, default=0.0)
    expected: float = field(init=False, default=0.0)
    reckoning: Reckoning | None = None
    """Of a silent ground speed; None: never."""
    reckoned: float = field(init=False, default=0.0)
    """Variance of this row's reckoned ground speed, else 0,"""
    doubt: float = field(init=False, default=0.0)
    """and of the last one, until the next measured ground speed."""

    @property
    def slow(self) -> float:
        """Variance of the ground speed beside the covariance: of an error that no stop has shown, and of a reckoned one."""
        chance = SURE * self.expected / np.sqrt(self.pairs) if self.pairs else 0.0
        alike = max(self.alike - chance, 0.0) if self.alike > 0 else 0.0
        left = min(self.noise[0] ** 2 / self.expected, 1.0) if alike else 0.0  # 1 - gain
        alike *= left * (1 + left * (1 - left))
        return (SLOW_SHARE * self.noise[0]) ** 2 + alike + max(self.doubt - self.covariance[0, 0], 0.0)

    def __post_init__(self) -> None:
        size = len(self.noise) + 1
        self.state, self.covariance = np.zeros(size), np.zeros((size, size))
        self.means, self.spreads = np.zeros((len(PAIRS), size)), np.zeros((len(PAIRS), size, size))
        self.probability = np.full(len(PAIRS), 1 / len(PAIRS))
        self.begun, self.off = False, 0.0
        self.weight = np.ones(len(self.noise))

    def step(self, dt: float, speeds: Floats) -> None:
        """Go ``dt`` [s] on and take samples (1 + wheels,) [m/s] of ground speed and rims, NaN where not measured."""
        self.nis, self.channels, self.weight, self.reckoned = 0.0, 0, np.ones(len(self.noise)), 0.0
        measured, noise = bool(np.isfinite(speeds[0])), self.noise.copy()
        self.doubt = 0.0 if measured else self.doubt
        if self.reckoning and (made := self.reckoning.speed(dt, speeds, self.state[0] + self.state[2:])):
            self.reckoned = self.doubt = made[1]
            speeds = np.r_[made[0], speeds[1:]]
            noise[0] = np.sqrt(made[1])
        if not self.begun:
            self._begin(speeds)
            return
        usable = np.isfinite(speeds)
        move = transition(dt, len(self.state))
        scale = move @ self.state  # the noise of slip speeds is in proportion to speed
        stay, leave = np.exp(-dt / DWELL), -np.expm1(-dt / DWELL) / len(PAIRS)
        prior = stay * self.probability + leave
        side = 1.0 if speeds[0] > scale[0] else -1.0
        confirmed = measured and self.off == side
        result, ahead, square = [], 0.0, 0.0
        for m, (manoeuvre, slipping) in enumerate(PAIRS):
            x, P = self._mixed(m, stay * self.probability[m] / prior[m])
            Q = process_noise(scale, dt, manoeuvre, slipping**2)
            x, P = move @ x, move @ P @ move.T + Q
            if self.reckoned:
                P = P + (_AGILITY * dt) ** 2 / 12 * _between(len(x))
            ahead += prior[m] * (speeds[0] - x[0])
            square += prior[m] * ((speeds[0] - x[0]) ** 2 + P[0, 0])
            result.append(self._update(x, P, speeds, noise, confirmed))
        if self.reckoned:
            self.last = 0.0
        elif measured:
            self._watch(ahead, square - ahead**2 + self.noise[0] ** 2)
        score = np.log(prior) + [one[2] for one in result]
        p = np.exp(score - score.max())
        p /= p.sum()
        self.probability = p
        self.means, self.spreads = np.stack([one[0] for one in result]), np.stack([one[1] for one in result])
        self.nis = float(p @ [one[3] for one in result])
        self.weight = p @ np.stack([one[4] for one in result])
        if measured:
            self.off = side if confirmed or self.weight[0] < OUTLIER else 0.0
        self.channels = int(usable.sum()) - (self.reckoned > 0)
        self.densities = float(p @ [q for q, _ in PAIRS]), float(p @ [c * c for _, c in PAIRS])
        self._merge()
        if self.reckoning and measured:
            v, rims = self.state[0], self.state[0] + self.state[2:]
            self.reckoning.remember(dt, v, self.covariance[0, 0], speeds, rims)

    def _watch(self, innovation: float, variance: float) -> None:
        """Take one more innovation of the ground speed."""
        innovation = float(np.clip(innovation, -SPIKE * np.sqrt(variance), SPIKE * np.sqrt(variance)))
        if self.last != 0:
            self.pairs = min(self.pairs + 1, MEMORY)
            self.alike += (self.last * innovation - self.alike) / self.pairs
        self.last, self.expected = innovation, variance

    def _mixed(self, mode: int, own: float) -> tuple[Floats, Floats]:
        """Where a mode starts from: itself by ``own``, all modes together by the rest."""
        x = own * self.means[mode] + (1 - own) * self.state
        apart, other = self.means[mode] - x, self.state - x
        P = own * (self.spreads[mode] + np.outer(apart, apart))
        return x, P + (1 - own) * (self.covariance + np.outer(other, other))

    def _merge(self) -> None:
        """The moments of all modes together."""
        self.state = self.probability @ self.means
        apart = self.means - self.state
        self.covariance = np.einsum("m,mij->ij", self.probability, self.spreads)
        self.covariance += np.einsum("m,mi,mj->ij", self.probability, apart, apart)

    def _update(
        self, x: Floats, P: Floats, speeds: Floats, noise: Floats, confirmed: bool
    ) -> tuple[Floats, Floats, float, float, Floats]:
        likelihood, nis = 0.0, 0.0
        usable = np.isfinite(speeds)
        rows = _rows(len(self.noise))
        weight = np.ones(len(self.noise))
        for c in np.flatnonzero(usable):
            size = np.sqrt(rows[c] @ P @ rows[c] + noise[c] ** 2)
            off = abs(speeds[c] - rows[c] @ x)
            soft = off > HUBER * size and not (c == 0 and confirmed)
            weight[c] = HUBER * size / off if soft else 1.0
        for c in np.flatnonzero(usable):
            column = P @ rows[c]
            variance = rows[c] @ column + noise[c] ** 2 / weight[c]
            innovation = speeds[c] - rows[c] @ x
            x = x + column * innovation / variance
            P = P - np.outer(column, column) / variance
            nis += 0.0 if c == 0 and self.reckoned else innovation**2 / variance
            likelihood -= 0.5 * (innovation**2 / variance + np.log(variance))
        if self.reckoned:
            weight[0] = 1.0
        return x, P, likelihood, nis, weight

    def _begin(self, speeds: Floats) -> None:
        """Start from the first row that measures any speed; what it does not measure follows from the rest, broadly."""
        given = np.isfinite(speeds)
        if not given.any():
            return
        v = float(speeds[0] if given[0] else np.mean(speeds[1:][given[1:]]))
        broad = (0.3 * abs(v) + 0.1) ** 2
        x, P = np.zeros_like(self.state), np.zeros_like(self.covariance)
        x[0], P[0, 0], P[1, 1] = v, self.noise[0] ** 2 if given[0] else broad, _FIRST_RATE**2
        for c in range(1, len(speeds)):
            if given[c]:
                x[c + 1] = speeds[c] - v
                P[c + 1], P[:, c + 1] = -P[0], -P[0]
            P[c + 1, c + 1] = P[0, 0] + self.noise[c] ** 2 if given[c] else broad
        self.means[:], self.spreads[:] = x, P
        self.state, self.covariance = x, P
        self.begun = True

    def anew(self) -> None:
        """Nothing is known of the motion from here on."""
        self.__post_init__()


def transition(dt: float, size: int) -> Floats:
    """The state's map (size, size) over ``dt`` [s]."""
    move = np.eye(size)
    move[0, 1] = -LASTING * np.expm1(-dt / LASTING)
    move[1, 1] = np.exp(-dt / LASTING)
    return move


def _between(size: int) -> Floats:
    """What moves the ground speed one way and all slip speeds the other, at constant rims."""
    direction = np.full(size, -1.0)
    direction[:2] = 1.0, 0.0
    return np.outer(direction, direction)


def process_noise(x: Floats, dt: float, manoeuvre: float, slipping: float) -> Floats:
    """Variance (n, n) that ``dt`` [s] add; ``slipping``: density of relative slip, 1/s."""
    Q = np.zeros((len(x), len(x)))
    Q[:2, :2] = manoeuvre * np.array([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]])
    speed = np.maximum(np.maximum(abs(x[0]), np.abs(x[0] + x[2:])), _SLOWEST)
    alike = np.where(np.eye(len(speed), dtype=bool), 1.0, TOGETHER)
    Q[2:, 2:] = slipping * dt * alike * np.outer(speed, speed)
    return Q


def _rows(channels: int) -> Floats:
    rows = np.zeros((channels, channels + 1))
    rows[:, 0] = 1
    for c in range(1, channels):
        rows[c, c + 1] = 1
    return rows
