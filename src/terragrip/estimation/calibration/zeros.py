"""Zeros of the sensors from standstill: torque, drawbar, accelerometer.

All of them assume that what a sensor should read there is known: nothing drives or holds the wheels, the bar is slack,
the ground is level or its slope is measured. Where the readings contradict that, there is no result.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.estimation.calibration.result import Evidence, Quantity, Unknown
from terragrip.estimation.calibration.windows import Windows
from terragrip.physics.loads import GRAVITY
from terragrip.vehicle import Vehicle
from terragrip.vehicle_parts import Uncertainty

WINDOW = 0.5
"""Window length [s] in which standstill is searched for."""

_STANDING = 0.03  # m/s, of vehicle and rims, as window means
_LEAST_STANDING = 2.0  # s a spell must last
_DRIVING = 0.1  # m/s
_LEAST_FREE = 10.0  # s of driving with a bar that nothing moves
_UNKNOWN_YAW = 0.005  # rad/s, prior of a gyroscope's zero where the vehicle never stands: .3 deg/s
_ALIKE = 3.0  # standard errors
_HILL = 20.0  # m: stops nearer than that stand on one slope
_ALONE = 4.0  # s that one stop must last to count without another that agrees: whoever stands for the zeros stands 10 s
_ONE_SHORT_STOP = "one short stop, or stops that disagree: stand 10 s with the motors off and the bar slack, or twice with driving between"
# Of the weight along the slope: wheels that hold the vehicle carry it, less what the ground's resistance does.
_HOLDING = 0.3, 1.5
_IDLE_SHARE = 0.05  # of the driving torque: more than that at standstill is work, not a zero


def standstills(windows: Windows, vehicle: Vehicle) -> list[slice]:
    """Spells in which vehicle and wheels stand, without the window after they stop and the one in which they start: torque rises first."""
    rim = np.abs(windows.wheel_speed) * vehicle.wheel_radius
    standing = (np.abs(windows.ground_speed) < _STANDING) & np.all(rim < _STANDING, axis=1)
    least = int(np.ceil(_LEAST_STANDING / windows.length))
    stops = spells(standing, windows.recording, least)
    begins = np.diff(windows.recording, prepend=-1) != 0
    ends = np.diff(windows.recording, append=-1) != 0
    return [slice(s.start + (not begins[s.start]), s.stop - (not ends[s.stop - 1])) for s in stops]


def spells(wanted: Bools, recording: Ints, least: int) -> list[slice]:
    """The rows of each run of at least ``least`` wanted windows (n,) within one recording."""
    edge = np.flatnonzero(np.diff(wanted.astype(int)) | np.diff(recording)) + 1
    starts, ends = np.r_[0, edge], np.r_[edge, len(wanted)]
    return [
        slice(int(a), int(b))
        for a, b in zip(starts, ends, strict=True)
        if b > a and wanted[a] and b - a >= least
    ]


def evidence(
    windows: Windows, used: Bools | Ints | slice, sources: Sequence[str], count: Floats | None = None
) -> tuple[Evidence, ...]:
    """One entry per recording of the windows ``used``: from the first one's start to the last one's end, with the samples used.

    ``count`` (n,) samples of the channel that was used; ground speed's by default.
    """
    count = windows.count if count is None else count
    rows = np.arange(len(windows))[used]
    logs = windows.recording[rows]
    return tuple(
        Evidence(
            sources[index],
            float(windows.start[own[0]]),
            float(windows.start[own[-1]] + windows.length),
            int(count[own].sum()),
        )
        for index in np.unique(logs)
        for own in [rows[logs == index]]
    )


def rows_of(stops: Sequence[slice]) -> Ints:
    """The rows of some spells."""
    return np.asarray(np.r_[tuple(stops)])


def spell_mean(values: Floats, stops: Sequence[slice], count: Floats, noise: float) -> tuple[float, float]:
    """Mean and standard error of values (n,) over spells; what varies from spell to spell counts in the error.

    ``noise`` is the standard deviation of one of the ``count`` (n,) samples: a few windows may scatter less by chance.
    """
    rows = rows_of(stops)
    pooled = values[rows][np.isfinite(values[rows])]
    if len(pooled) < 2:
        return float("nan"), float("nan")
    samples = max(1.0, float(count[rows].sum()))
    within = max(float(np.std(pooled, ddof=1)) / np.sqrt(len(pooled)), noise / np.sqrt(samples))
    means = np.array([stop_means(values, spell) for spell in stops])
    means = means[np.isfinite(means)]
    between = float(np.std(means, ddof=1)) / np.sqrt(len(means)) if len(means) > 1 else 0.0
    # Two spells hardly show their scatter: what they do show adds to the scatter within them.
    error = max(within, between) if len(means) > 2 else float(np.hypot(within, between))
    return float(np.mean(means)), error


def resting(
    windows: Windows,
    values: Floats,
    stops: Sequence[slice],
    count: Floats,
    noise: float,
    most: Floats,
    usual: Floats | float = -1.0,
) -> list[slice]:
    """The stops at which every column of ``values`` (n, k) reads its zero, as far as that can be known; ``noise`` is that of a
    sample, of which a window has ``count`` (n,).

    A zero is small (``most`` (k,)) and the same at every stop; a torque that holds the vehicle, or a tension in the bar, is
    not, and where one wheel holds it, its zero is not the others' either. So those that read alike within noise count: the
    most numerous such group, of groups of one size the one nearest to zero. Stops without driving between them are one stop,
    and one counts only if it lasts as long as one made for this, or reads no more than ``usual`` (k,) in any column.
    """
    stops = [spell for spell in stops if np.all(np.abs(stop_means(values, spell)) <= most)]
    if not stops:
        return []
    means = np.array([stop_means(values, spell) for spell in stops])
    samples = np.array([max(1.0, count[spell].sum()) for spell in stops])
    errors = noise / np.sqrt(samples)
    alike = np.ones((len(stops), len(stops)), dtype=bool)
    if noise > 0:
        apart = np.max(np.abs(means[:, None] - means[None]), axis=2)
        alike = apart < _ALIKE * np.hypot(errors[:, None], errors[None])
    groups = []
    for of_one, mean in zip(alike, means, strict=True):
        # Of two stops' median the longer, surer one would be further off than its error.
        middle = np.average(means[of_one], axis=0, weights=samples[of_one])
        away = np.max(np.abs(means - middle), axis=1)
        members = [
            spell
            for spell, error, d in zip(stops, errors, away, strict=True)
            if noise <= 0 or d < _ALIKE * error
        ]
        if _sure(windows, members) or np.all(np.abs(mean) <= usual):
            groups.append((int(of_one.sum()), -float(np.max(np.abs(mean))), members))
    return max(groups, key=lambda group: group[:2])[2] if groups else []


def stop_means(values: Floats, spell: slice) -> Floats:
    """Mean (k,) of values (n, k) over a stop, or of (n,); NaN where a column has no value in it."""
    rows = values[spell]
    known = np.isfinite(rows)
    with np.errstate(invalid="ignore"):
        return np.where(known, rows, 0.0).sum(axis=0) / known.sum(axis=0)


def _sure(windows: Windows, stops: Sequence[slice]) -> bool:
    """Whether stops are more than one, with driving between them, or last long enough."""
    moving = np.abs(windows.ground_speed) > _DRIVING
    apart = (
        windows.recording[a.stop - 1] != windows.recording[b.start] or moving[a.stop - 1 : b.start].any()
        for a, b in pairwise(stops)
    )
    return len(rows_of(stops)) * windows.length >= _ALONE or any(apart)


def torque_zeros(
    windows: Windows, vehicle: Vehicle, sources: Sequence[str], noise: float
) -> tuple[list[Quantity], list[Unknown]]:
    """Torque zero of each driven wheel from standstill; ``noise`` is the standard deviation of a torque sample, N m."""
    key, stops = "drive_torque_offset", standstills(windows, vehicle)
    if not stops:
        return [], [Unknown(key, f"no standstill of {_LEAST_STANDING:.0f} s or longer")]
    driven = np.flatnonzero(vehicle.driven)
    torque, wheels = windows.torque[:, driven], [vehicle.wheels[index] for index in driven]
    stops = [spell for spell in stops if np.isfinite(stop_means(torque, spell)).all()]
    if not stops:
        return [], [Unknown(key, "no torque was measured at standstill")]
    stated = 3 * (vehicle.uncertainty.drive_torque_offset or 0.0)
    allowed = np.maximum(stated, _IDLE_SHARE * _work(windows, torque))

    def calm_of(some: list[slice]) -> list[slice]:
        return resting(windows, torque, some, windows.torque_count, noise, allowed, stated)

    calm = calm_of(stops)
    holding, released = _on_slopes(windows, vehicle, torque, stops)
    level = 0.0  # N m: what may hold the vehicle unseen, where it is held on slopes
    if holding and not any(spell in released for spell in calm):
        calm = calm_of([spell for spell in stops if spell not in holding])
        if not calm:
            why = "at standstill on a slope the torques are those that hold the vehicle: stand with the motors off"
            return [], [Unknown(key, why)]
        if not any(spell in released for spell in calm):
            level = vehicle.uncertainty.assumed("pitch_offset") * vehicle.mass * GRAVITY
            level *= float(vehicle.wheel_radius.mean()) / len(driven)
    if not calm:
        means = [stop_means(torque, spell) for spell in stops]
        return [], _held_by(wheels, means, allowed) or [Unknown(key, _ONE_SHORT_STOP)]
    scatter = np.zeros(len(driven))
    read = np.array([stop_means(torque, spell) for spell in stops if spell not in holding])
    read = read[np.all(np.abs(read) <= allowed, axis=1)]
    longest = max(spell.stop - spell.start for spell in calm) * windows.length
    # Short ones may be alike by chance where motors hold the vehicle.
    if len(read) >= 2 * len(calm) and longest < 2 * _ALONE:
        scatter = np.std(read, axis=0, ddof=1)
    entry = evidence(windows, rows_of(calm), sources, windows.torque_count)
    sentence = "mean of the stops that agree; assumes that nothing drives or holds the wheels there"
    quantities = []
    for wheel, values, apart in zip(wheels, torque.T, scatter, strict=True):
        value, error = spell_mean(values, calm, windows.torque_count, noise)
        error = float(np.linalg.norm([error, level, apart]))
        quantities.append(Quantity(key, value, error, "N m", entry, sentence, wheel=wheel))
    return quantities, []


def _held_by(wheels: Sequence[str], means: Sequence[Floats], allowed: Floats) -> list[Unknown]:
    """Which wheels' drives read more than ``allowed`` (k,) at the stop of the least torque, of ``means`` (k,) of each stop."""
    least = min(means, key=lambda mean: np.max(np.abs(mean) - allowed))
    return [
        Unknown(
            f"drive_torque_offset {wheel}",
            f"at standstill the drive reads {value:.2f} N m, so it seems to hold the vehicle",
        )
        for wheel, value, most in zip(wheels, least, allowed, strict=True)
        if abs(value) > most
    ]


def _on_slopes(
    windows: Windows, vehicle: Vehicle, torque: Floats, stops: Sequence[slice]
) -> tuple[list[slice], list[slice]]:
    """The stops on a measured slope at which the torques hold the vehicle, and those at which they do not and read their zeros."""
    shares = [(spell, _held_share(windows, vehicle, torque, spell)) for spell in stops]
    holding = [spell for spell, share in shares if _HOLDING[0] < share < _HOLDING[1]]
    released = [spell for spell, share in shares if np.isfinite(share) and spell not in holding]
    return holding, released


def _held_share(windows: Windows, vehicle: Vehicle, torque: Floats, spell: slice) -> float:
    """How much of the weight along a measured slope the driven wheels' ``torque`` (n, k) carries at a stop; NaN where it is level to three
    standard deviations of a pitch sensor's zero, or no pitch is known."""
    pitch = float(stop_means(windows.pitch[:, None], spell)[0])
    if not abs(pitch) > 3 * vehicle.uncertainty.assumed("pitch_offset"):
        return float("nan")
    thrust = np.sum(stop_means(torque, spell) / vehicle.wheel_radius[vehicle.driven])
    return float(thrust / (vehicle.mass * GRAVITY * np.sin(pitch)))


def _work(windows: Windows, torque: Floats) -> Floats:
    """What a twentieth of the sizes of torque (n, k) in driving exceeds (k,); infinite where no driving was measured."""
    driving = np.abs(torque[np.abs(windows.ground_speed) > _DRIVING])
    return np.array([np.nanquantile(v, 0.95) if np.isfinite(v).any() else np.inf for v in driving.T])


def drawbar_zero(
    windows: Windows, vehicle: Vehicle, sources: Sequence[str], noise: float
) -> tuple[list[Quantity], list[Unknown]]:
    """Drawbar zero from standstill, or else from driving with a bar that nothing moves.

    ``noise`` is the standard deviation of a drawbar sample, N.
    """
    key = "drawbar_offset"
    if not np.isfinite(windows.drawbar).any() or not np.any(windows.drawbar):
        return [], [Unknown(key, "there is no drawbar_force")]
    allowed = max(3 * (vehicle.uncertainty.drawbar_offset or 0.0), 0.01 * vehicle.mass * GRAVITY)
    stops = standstills(windows, vehicle)
    sentence = "mean of the stops that agree; assumes that the bar is slack there"
    why = f"no standstill of {_LEAST_STANDING:.0f} s or longer, and none free of a tool"
    bar = windows.drawbar[:, None]
    readings = [float(mean) for spell in stops for mean in stop_means(bar, spell) if np.isfinite(mean)]
    if readings:
        least = min(readings, key=abs)
        taut = f"at standstill it reads {least:.1f} N, so the bar seems to be under tension"
        why = taut if abs(least) > allowed else _ONE_SHORT_STOP
    stops = resting(windows, bar, stops, windows.drawbar_count, noise, np.array([allowed]))
    alone = len(stops) == 1
    if not stops:
        stops = _free_passes(windows, noise)
        sentence = "mean over driving with a constant drawbar force; assumes that nothing is towed there"
        if not stops:
            return [], [Unknown(key, why)]
    value, error = spell_mean(windows.drawbar, stops, windows.drawbar_count, noise)
    if not abs(value) <= allowed:
        return [], [Unknown(key, why)]
    if alone:
        # Nothing tells a bar's zero from a pull that the motors hold there.
        thrust = np.nansum(windows.torque[:, vehicle.driven] / vehicle.wheel_radius[vehicle.driven], axis=1)
        held, scatter = spell_mean(thrust, stops, windows.torque_count, 0.0)
        error = float(np.hypot(error, held)) if abs(held) > _ALIKE * scatter else error
        sentence = "mean of the one stop; assumes that the bar is slack there, to what the torques read"
    entry = evidence(windows, rows_of(stops), sources, windows.drawbar_count)
    return [Quantity(key, value, error, "N", entry, sentence)], []


def _free_passes(windows: Windows, noise: float) -> list[slice]:
    """Spells of driving in which the windows' drawbar means scatter no more than sensor noise makes them."""
    moving = (np.abs(windows.ground_speed) > _DRIVING) & np.isfinite(windows.drawbar)
    least = int(_LEAST_FREE / windows.length)
    stops = []
    for spell in spells(moving, windows.recording, least):
        bar, count = windows.drawbar[spell], windows.drawbar_count[spell]
        if np.std(bar) < 2 * noise / np.sqrt(np.median(count)):
            stops.append(spell)
    return stops


def inclination_zeros(
    windows: Windows, vehicle: Vehicle, sources: Sequence[str], noise: float
) -> tuple[list[Quantity], list[Unknown]]:
    """Zeros of accelerometer and pitch sensor from standstill, as far as they can be determined.

    Standing on slope θ the accelerometer reads b + g sinθ, the pitch sensor p + θ: the data determine b - g p, or b + g sinθ
    where there is no pitch sensor, and no more. The sum is split by the priors' variances (the best linear estimate),
    and what stays open is in both intervals. ``noise`` is that of an accelerometer sample, m/s².
    """
    bias_key, pitch_key = "acceleration_bias_x", "pitch_offset"
    no_pitch = Unknown(pitch_key, "there is no pitch")
    pitched = bool(np.isfinite(windows.pitch).any())
    if not np.isfinite(windows.acceleration).any():
        why = "a slope and a pitch sensor's zero look the same: give acceleration_x, or drive on ground known to be level"
        return [], [
            Unknown(bias_key, "there is no acceleration_x"),
            Unknown(pitch_key, why) if pitched else no_pitch,
        ]
    stops = [s for s in standstills(windows, vehicle) if np.isfinite(windows.acceleration[s]).any()]
    if not stops:
        why = f"no standstill of {_LEAST_STANDING:.0f} s or longer"
        return [], [Unknown(bias_key, why), Unknown(pitch_key, why) if pitched else no_pitch]
    pitched = all(np.isfinite(windows.pitch[s]).any() for s in stops)
    slope = windows.pitch if pitched else np.zeros(len(windows))
    total, error = spell_mean(
        windows.acceleration - GRAVITY * np.sin(slope), stops, windows.acceleration_count, noise
    )
    stated = vehicle.uncertainty
    rests_on = evidence(windows, rows_of(stops), sources, windows.acceleration_count)
    # The ground differs from place to place, a sensor's zero does not.
    places = _places(windows, stops)
    other = GRAVITY * (
        stated.assumed("pitch_offset") if pitched else stated.assumed("slope") / np.sqrt(places)
    )
    own = stated.assumed("acceleration_bias")
    if abs(total) > 3 * np.hypot(own, other):
        mounting = Uncertainty().assumed("acceleration_bias")
        own = max(own, mounting)
        if not pitched:  # the machine may as well have stood on a hill
            other = max(other, mounting / np.sqrt(places))
    share = own**2 / (own**2 + other**2)
    left = own * other / np.hypot(own, other)
    sentence = (
        "mean at standstill, split between bias and slope by their priors: they cannot be distinguished"
    )
    if pitched:
        sentence = "accelerometer less g sin(pitch) at standstill, split by the priors of the two zeros: only the difference is known"
    bias = Quantity(
        bias_key, share * total, float(np.hypot(share * error, left)), "m/s^2", rests_on, sentence
    )
    if not pitched:
        return [bias], [no_pitch]
    rest = 1 - share
    tilt = -rest * total / GRAVITY
    pitch = Quantity(
        pitch_key, tilt, float(np.hypot(rest * error, left)) / GRAVITY, "rad", rests_on, sentence
    )
    return [bias, pitch], []


def _places(windows: Windows, stops: Sequence[slice]) -> int:
    """In how many places, `_HILL` apart along the way, the stops of one log are: the next log may begin where this one did. A way that
    comes back counts as another place: nothing here shows the course."""
    most = 0
    for log in {int(windows.recording[s.start]) for s in stops}:
        count, last = 0, -np.inf
        for at in sorted(windows.position[s.start, 0] for s in stops if windows.recording[s.start] == log):
            if at - last > _HILL:
                count, last = count + 1, at
        most = max(most, count)
    return most


def yaw_rate_zero(windows: Windows, vehicle: Vehicle) -> tuple[float, float]:
    """The gyroscope's mean at standstill and its standard error, rad/s: its zero shifts slip from side to side.

    Where the vehicle never stands for two windows: 0, and what such sensors are off by.
    """
    stops = [s for s in standstills(windows, vehicle) if np.isfinite(windows.yaw_rate[s]).any()]
    _, error = spell_mean(windows.yaw_rate, stops, windows.count, 0.0) if stops else (np.nan, np.nan)
    if not np.isfinite(error):
        return 0.0, _UNKNOWN_YAW if np.isfinite(windows.yaw_rate).any() else 0.0
    return float(np.nanmean(windows.yaw_rate[rows_of(stops)])), error
