"""Rolling radius of each wheel: ground speed over wheel speed, extrapolated to zero adhesion.

On a zero-pull straight pass the wheels still pull the vehicle's own rolling resistance, and slip a little for
it: v/ω = r (1 - s). The model is that of physics.md 5 in its identifiable form without the falling part, solved
for slip::

    v/ω_i = r_i (1 - s),   s = -(A_j/C_j) ln(1 - μ_i/A_j)

The curve's initial steepness C_j and its level A_j are fitted together with the radii, from zero-pull windows
and windows of moderate pull on the same soil. Where no window pulls they keep their priors, and the interval
says so. v/ω is regressed on μ, not the reverse: the noise of a speed is in v/ω, and μ has little. (R), our own
construction.

Driven wheels share one correction of the vehicle file's radii here, and their mean μ: which wheel's radius
differs shows only in which wheel pulls more, and there it is one with the torque gains, so it is determined together
with them (:mod:`~terragrip.estimation.calibration.sharing`). An undriven wheel has a radius of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from terragrip.arrays import Bools, Floats, Ints
from terragrip.estimation.calibration.result import Evidence, Unknown
from terragrip.estimation.calibration.sharing import block_covariance, effective_blocks
from terragrip.estimation.calibration.windows import Windows
from terragrip.estimation.calibration.zeros import evidence
from terragrip.physics.loads import GRAVITY
from terragrip.physics.motion import algebraic_adhesion
from terragrip.physics.slip import slip
from terragrip.vehicle import Vehicle

WINDOW = 2.0
"""Window length [s]: long enough that the noise of a speed sensor is small beside slip."""

_ZERO_PULL = 0.03  # drawbar force over weight
_SLOWEST = 0.2  # m/s
_STRAIGHT = 0.02  # relative difference of the wheels' speeds from side to side
_GENTLE = 0.3  # likewise of the hubs, where the yaw rate is known
_LEAST_DISTANCE = 5.0  # m of zero-pull passes
_LOW = 0.7  # of the largest pull: windows above it do not determine the radius
# Prior of ln C, mean and standard deviation: C is 2 on grass, 8 on hard soil.
_STEEPNESS = (float(np.log(5.0)), 0.8)
_LEVEL = (0.6, 0.6)  # prior of A: mean, and standard deviation of ln A
_LEAST_PULL = 0.15
_DELAY = 0.1  # s, SD of the ground speed's delay: while a machine speeds up it pulls more, so a delay would pass for slip
_WANDERS = 0.2  # s, by which it may differ from window to window: a receiver's interval, and rates are of four seconds
_SOILS = 0.35  # SD of ln C from one stretch without a label to the next,
_STRETCH, _STRETCHES = 20.0, 40  # m that it lasts at least, and how many there are at most
_PARTS = 4  # of the way without labels, that may be soils of their own: what their curves change is in the interval
_LEAST_ADHESION = 0.01
_ROUNDS = 50
_TORQUE_ZERO = 0.02  # prior of a torque zero, over r F, where the vehicle states none
_ROLLING = 0.15  # adhesion and rolling resistance at zero pull: what a gain error acts on


@dataclass(frozen=True)
class Rolling:
    """Rolling radii from zero-pull passes.

    ``radius`` (w,) m; ``std`` (w,) relative, with all that is considered; ``factor`` of its 95 % interval; ``slip`` the
    mean slip that was corrected; ``rests_on``: the evidence.
    """

    radius: Floats
    std: Floats
    factor: float
    slip: float
    rests_on: tuple[Evidence, ...]


def rolling_radii(
    windows: Windows, vehicle: Vehicle, block: Ints, sources: Sequence[str]
) -> Rolling | Unknown:
    """Rolling radius of every wheel from the zero-pull windows, with its slip there corrected.

    ``block`` (n,) labels the stretch of track of every window. Torques must have their zeros taken off.
    """
    from scipy.special import stdtrit

    adhesion = _adhesion(windows, vehicle)
    passes = _passes(windows, vehicle) & np.all(np.isfinite(adhesion), axis=1)
    free = passes & (np.abs(windows.drawbar) < _ZERO_PULL * vehicle.mass * GRAVITY)
    distance = float(np.sum(windows.ground_speed[free]) * windows.length)
    if distance < _LEAST_DISTANCE:
        why = f"{distance:.0f} m of straight passes at zero pull, and {_LEAST_DISTANCE:.0f} m are needed"
        return Unknown("wheel_radius", why)
    fits = [
        _by_soils(windows, vehicle, adhesion, passes, free, soil, block) for soil in _possible_soils(windows)
    ]
    if fits[0] is None:
        return Unknown("wheel_radius", "no zero-pull window has a plausible adhesion")
    scale, own, typical, stretches = fits[0]
    for other in fits[1:]:
        own = own + (0.0 if other is None else np.log(other[0] / scale) ** 2)
    radius = vehicle.wheel_radius * scale
    variance = own + _considered(vehicle, typical)
    rolled = slip(windows.wheel_speed[free], windows.hub_speed[free], radius, standstill_speed=0.0)
    rests_on = evidence(windows, free, sources)
    factor = float(stdtrit(max(1.0, stretches - 1), 0.975))
    return Rolling(radius, np.sqrt(variance), factor, float(np.mean(rolled)), rests_on)


def _possible_soils(windows: Windows) -> list[npt.NDArray[np.object_]]:
    """The labels (n,) of the windows; where some have none also with one for each part of the way: a soil may last as long."""
    bare = windows.soil == ""
    if not bare.any():
        return [windows.soil]
    way = np.maximum(np.nan_to_num(windows.position[:, 0]), 0.0)
    part = np.minimum(_PARTS * way / max(float(way.max()), 1e-9), _PARTS - 1).astype(np.intp)
    return [windows.soil, np.where(bare, part.astype(str).astype(object), windows.soil)]


def _by_soils(
    windows: Windows,
    vehicle: Vehicle,
    adhesion: Floats,
    passes: Bools,
    free: Bools,
    soil: npt.NDArray[np.object_],
    block: Ints,
) -> tuple[Floats, Floats, float, float] | None:
    """The scale of the radii (w,), its variance, the steepness at zero pull, and on how many blocks these rest, by a curve for each
    ``soil`` (n,); None without a window at zero pull, or of some wheel without any of little adhesion."""
    soils = sorted(set(soil[free]))
    code = np.array([soils.index(label) if label in soils else -1 for label in soil])
    driving = adhesion[:, vehicle.driven] if vehicle.driven.any() else adhesion
    most = np.array([_most(driving[passes & (code == j)]) for j in range(len(soils))])
    used = passes[:, None] & (code >= 0)[:, None] & (np.abs(adhesion) < _LOW * most[code][:, None])
    if not (used[free].any() and used.any(axis=0).all()):
        return None
    scale, own, steepness, stretches = _fit(windows, vehicle, adhesion, code, most, used, block)
    return scale, own, float(np.average(steepness[code[free]])), stretches


def _adhesion(windows: Windows, vehicle: Vehicle) -> Floats:
    """Adhesion (n, w); of driven wheels their mean, by load."""
    adhesion = algebraic_adhesion(
        windows.wheel_speed,
        windows.wheel_acceleration,
        windows.torque,
        windows.load,
        radius=vehicle.wheel_radius,
        inertia=vehicle.wheel_inertia,
        tire_resistance=vehicle.tire_rolling_resistance,
        bearing_resistance=vehicle.wheel_bearing,
    )
    driven = vehicle.driven
    if driven.any():
        load = windows.load[:, driven]
        mean = np.sum(adhesion[:, driven] * load, axis=1) / np.sum(load, axis=1)
        adhesion[:, driven] = mean[:, None]
    return adhesion


def _passes(windows: Windows, vehicle: Vehicle) -> Bools:
    """Windows of straight, forward driving."""
    rim = windows.wheel_speed * vehicle.wheel_radius
    sides = _sides(vehicle)
    left, right = sides > 0, sides < 0
    straight = np.ones(len(windows), dtype=bool)
    if left.any() and right.any():
        speed = rim.mean(axis=1)
        apart = np.abs(rim[:, left].mean(axis=1) - rim[:, right].mean(axis=1))
        turning = np.ptp(windows.hub_speed, axis=1)
        known = np.isfinite(windows.yaw_rate) & (vehicle.track is not None)
        # With a known turn each hub's speed is known, as long as it does not scrub.
        straight = np.where(known, turning < _GENTLE * np.abs(speed), apart < _STRAIGHT * np.abs(speed))
    whole = windows.count > 0.5 * np.median(windows.count[windows.count > 0])
    moving = (windows.ground_speed > _SLOWEST) & np.all(rim > _SLOWEST, axis=1)
    return whole & moving & straight


def _sides(vehicle: Vehicle) -> Ints:
    """1 left, -1 right, 0 in the middle (w,), by the places in the axles' lists: a track may not be known."""
    places = [np.arange(count) for count in np.bincount(vehicle.wheel_axle)]
    return np.concatenate([np.sign(own[::-1] - own) for own in places])


def _most(adhesion: Floats) -> float:
    """Adhesion of the windows of most pull."""
    return max(_LEAST_PULL, float(np.quantile(adhesion, 0.95))) if adhesion.size else _LEAST_PULL


def _fit(
    windows: Windows,
    vehicle: Vehicle,
    adhesion: Floats,
    code: Ints,
    most: Floats,
    used: Bools,
    block: Ints,
) -> tuple[Floats, Floats, Floats, float]:
    """Least squares for the radii over the file's, ln C_j, ln A_j and the ground speed's delay; the variance is over blocks of track.

    Without a label the slips of a stretch have a common error: soft soil needs more thrust and slips more, so slip over adhesion
    between soils is not the curve of one soil.
    Returns the scale (w,), the variance (w,) of its logarithm, C (soils,), and how many blocks the radii rest on.
    """
    w, soils = len(vehicle.wheels), len(most)
    shared = np.flatnonzero(vehicle.driven)[:1].tolist() + np.flatnonzero(~vehicle.driven).tolist()
    group = np.array([shared.index(k if k in shared else shared[0]) for k in range(w)])
    count = len(shared)
    rim = np.where(used, windows.wheel_speed * vehicle.wheel_radius, 1.0)
    ratio = np.log(np.where(used, windows.hub_speed, 1.0) / rim)
    ratio -= _own(ratio, used, group)
    pull = np.where(used, adhesion, 0.0)
    (steep, steep_spread), (_, level_spread) = _STEEPNESS, _LEVEL
    level_mean = np.log(np.maximum(_LEVEL[0], 1.2 * most))
    center = np.r_[np.zeros(count), np.full(soils, steep), level_mean, 0.0]
    prior = np.r_[
        np.zeros(count), np.full(soils, steep_spread**-2.0), np.full(soils, level_spread**-2.0), _DELAY**-2.0
    ]
    rates = np.mean(windows.wheel_acceleration * vehicle.wheel_radius, axis=1)[:, None]
    by_delay = np.where(used & np.isfinite(rates), -rates / np.where(used, windows.hub_speed, 1.0), 0.0)
    stretch = _stretches(windows)
    offset_std = _SOILS / np.exp(steep) * _typical(np.abs(pull).mean(axis=1), np.any(used, axis=1), stretch)
    values, offset = center.copy(), np.zeros(len(offset_std))
    for _ in range(_ROUNDS):
        steepness = np.exp(values[count : count + soils])[code][:, None]
        level = np.exp(values[count + soils : -1])[code][:, None]
        slip, bend = _slip_at(pull, steepness, level)
        jacobian = np.zeros((*ratio.shape, len(values)))
        jacobian[:, np.arange(w), group] = 1.0
        jacobian[:, :, -1] = by_delay
        for j in range(soils):
            own = code[:, None] == j
            jacobian[:, :, count + j] = np.where(own, slip / (1 - slip), 0.0)
            jacobian[:, :, count + soils + j] = np.where(own, -bend / (1 - slip), 0.0)
        residual = ratio - values[group] - values[-1] * by_delay - np.log1p(-np.minimum(slip, 0.9))
        noise = 1.4826 * float(np.median(np.abs(residual - offset[stretch][:, None])[used]))
        # Local adhesion shifts slip in proportion.
        spreads = np.sqrt(max(noise, 1e-6) ** 2 + (0.1 * slip) ** 2 + (_WANDERS * by_delay) ** 2)
        apart = np.abs(residual - offset[stretch][:, None]) / spreads
        root = np.where(used, np.sqrt(np.minimum(1.0, 2.5 / np.maximum(apart, 1e-12))), 0.0) / spreads
        rows = root[..., None] * np.concatenate([jacobian, residual[..., None]], axis=2)
        rows, offset = _less_offsets(rows, root, stretch, offset_std)
        flat, rest = rows[..., :-1].reshape(-1, len(values)), rows[..., -1]
        normal = flat.T @ flat + np.diag(prior)
        step = np.linalg.solve(normal, flat.T @ rest.ravel() - prior * (values - center))
        values = values + np.clip(step, -1.0, 1.0)
        if np.max(np.abs(step)) < 1e-10:
            break
    rooted = rows[..., :-1]
    score = np.einsum("nwp,nw->np", rooted, rest)
    informed = np.any(used, axis=1)
    # The scatter of few blocks may be too small by chance; that of single windows is a lower bound.
    variance = np.max(
        [
            np.diag(block_covariance(normal, rooted[informed], score[informed], labels, np.diag(prior)))
            for labels in (block[informed], np.arange(int(informed.sum())))
        ],
        axis=0,
    )
    held = min(effective_blocks(normal, rooted[informed], block[informed], k) for k in range(count))
    return np.exp(values[group]), variance[group], np.exp(values[count : count + soils]), held


def _own(ratio: Floats, used: Bools, group: Ints) -> Floats:
    """What the ratios (n, w) of each wheel differ by, over the windows, from the mean of its ``group`` (w,): a radius of its own,
    which is no outlier, (w,)."""
    median = np.nanmedian(np.where(used, ratio, np.nan), axis=0)
    return median - np.log(np.bincount(group, np.exp(median)) / np.bincount(group))[group]


def _slip_at(pull: Floats, steepness: Floats, level: Floats) -> tuple[Floats, Floats]:
    """The curve's slip at adhesions, and d slip / d ln A, all (n, w)."""
    share = np.clip(pull / level, -0.95, 0.95)
    slip = -level / steepness * np.log1p(-share)
    return slip, -level / steepness * (np.log1p(-share) + share / (1 - share))


def _stretches(windows: Windows) -> Ints:
    """The stretch of track of each window (n,), from 1; 0 where it has a label."""
    way = np.maximum.accumulate(np.nan_to_num(windows.position[:, 0]))
    length = max(_STRETCH, float(way.max(initial=0.0)) / _STRETCHES)
    names = windows.recording * (1 + int(way.max(initial=0.0) / length)) + (way / length).astype(np.intp)
    bare = windows.soil == ""
    result = np.zeros(len(way), dtype=np.intp)
    result[bare] = 1 + np.unique(names[bare], return_inverse=True)[1]
    return result


def _typical(size: Floats, used: Bools, stretch: Ints) -> Floats:
    """The median adhesion of the used windows of each stretch; 0 for labelled ones, whose slips have no common error."""
    result = np.zeros(int(stretch.max(initial=0)) + 1)
    for label in np.unique(stretch[used & (stretch > 0)]):
        result[label] = max(_LEAST_ADHESION, float(np.median(size[used & (stretch == label)])))
    return result


def _less_offsets(rows: Floats, effect: Floats, stretch: Ints, std: Floats) -> tuple[Floats, Floats]:
    """Rows (n, w, k) whitened for an offset of SD std (m,) that a stretch's rows share, and the last column's offsets (m,).

    ``effect`` (n, w) is what an offset of 1 adds to a row: I + σ² u uᵀ has the inverse root I - (1 - 1/√(1 + σ²|u|²)) u uᵀ/|u|².
    """
    power, along = np.zeros(len(std)), np.zeros((len(std), rows.shape[2]))
    np.add.at(power, stretch, np.sum(effect**2, axis=1))
    np.add.at(along, stretch, np.einsum("nw,nwk->nk", effect, rows))
    share = std**2 * power
    taken = along * ((1 - 1 / np.sqrt(1 + share)) / np.maximum(power, 1e-300))[:, None]
    return rows - effect[..., None] * taken[stretch][:, None, :], std**2 * along[:, -1] / (1 + share)


def _considered(vehicle: Vehicle, steepness: float) -> Floats:
    """Variance (w,) of the relative radius from what passes cannot determine: torque zeros and gains, ρ_t."""
    lever = np.sum(vehicle.axle_mass) * GRAVITY * float(np.mean(vehicle.wheel_radius))
    driven = max(1, int(vehicle.driven.sum()))
    stated = vehicle.uncertainty
    zero = _TORQUE_ZERO if stated.drive_torque_offset is None else stated.drive_torque_offset * driven / lever
    gain = (0.0 if stated.drive_torque_gain is None else stated.drive_torque_gain) * _ROLLING
    of_adhesion = np.where(vehicle.driven, np.hypot(zero, gain) / np.sqrt(driven), 0.0)
    return np.asarray((of_adhesion**2 + (stated.tire_rolling_resistance or 0.0) ** 2) / steepness**2)
