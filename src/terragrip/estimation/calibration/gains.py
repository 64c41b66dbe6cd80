"""Relative torque gains from logs: which windows count, on which soil, and what the fit's errors hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from terragrip.arrays import Bools, Floats, Ints
from terragrip.estimation.calibration.plausible import turns_unseen
from terragrip.estimation.calibration.result import Evidence, Quantity, Unknown
from terragrip.estimation.calibration.sharing import SharedGains, Sharing, fit_shared_gains
from terragrip.estimation.calibration.windows import Windows, track_blocks, wheel_loads, windows
from terragrip.estimation.calibration.zeros import evidence
from terragrip.physics.loads import load_levers
from terragrip.physics.slip import slip
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

WINDOW = 0.5
"""Window length [s]: a third of a metre of track."""

_SLOWEST = 0.15  # m/s
_SLIP = (-0.1, 0.6)  # beyond, a wheel digs itself in and leaves the curve that it shares
_TIGHT = 0.05  # difference of the hubs' speeds over the ground speed
_MIN_BLOCKS = 8
_ONE_SIGNAL = 1 - 1e-9  # correlation: two sensors' noise is more
_BLOCKS_A_SOIL = 15  # for a soil's gains to be held against another's
_SURPRISE = 0.01
_SEGMENT = 20.0  # m of track that count as one soil where there is no label
_EDGE = 0.3  # m on either side of a soil's border
_RADIUS = 0.003  # prior of the wheels' relative radii where the vehicle states none
_LEAST_OFFSET = 1e-3  # N m
_LEAST_PULL_EFFECT = 0.005  # relative: a smaller effect of a pull that no cell measures is not reported
_ASIDE = 0.15  # of what leans from side to side: heights are known to that (classes.yaml), and so is which axle bears how much of it
_NO_PULL = (
    "no log has a drawbar_force, and what a tool pulls moves load between the axles, so that these gains are open by "
    "{:.1f} %: measure it, or leave hitch_height out of the vehicle file where nothing is ever towed"
)


@dataclass(frozen=True)
class ChannelErrors:
    """Standard deviations of constant errors: of dv/dt + g sinθ and of a_y [m/s²], of the drawbar force [N], of the yaw rate [rad/s], and
    of the load that the vehicle file puts on the front axles and not on the rear ones, a share of the mean axle load."""

    push: float
    lateral: float
    drawbar: float
    yaw: float = 0.0
    axle_load: float = 0.0


@dataclass(frozen=True)
class RelativeGains:
    """The gains, what stays unknown, and the wheels' radii (w,) relative to their mean, with standard errors (w,)."""

    quantities: list[Quantity]
    unknown: list[Unknown]
    radius: Floats
    radius_std: Floats


def relative_gains(
    logs: Sequence[Recording],
    vehicle: Vehicle,
    offset_std: Floats,
    errors: ChannelErrors,
    sources: Sequence[str],
    common_radius_std: float = 0.0,
) -> RelativeGains | list[Unknown]:
    """Torque gains of the driven wheels relative to their (geometric) mean.

    ``logs`` must have their zeros taken off; ``offset_std`` (w,) N m of the torque zeros; ``common_radius_std`` is the relative error that
    all radii may share: it moves all slips alike, and with them how steep their curve looks.
    """
    key = "drive_torque_gain"
    common = Unknown(
        "drive_torque_gain, all wheels",
        "a gain common to all wheels only scales the curves that they share; it keeps its prior",
    )
    driven = np.flatnonzero(vehicle.driven)
    if len(driven) < 2:
        return [Unknown(key, "a single driven wheel has no other wheel to compare with")]
    table = _driving(windows(logs, vehicle, WINDOW), vehicle)
    blocks = track_blocks(table) if len(table) else np.zeros(0, dtype=np.intp)
    few = Unknown(
        key, "too little driving on one soil: the wheels must share a curve over some 30 m of track"
    )
    if len(table) == 0 or len(np.unique(blocks)) < _MIN_BLOCKS:
        return [few, common]
    with np.errstate(invalid="ignore"):  # of a torque that never changes: no other's signal
        alike = np.corrcoef(table.torque[:, driven].T).min()
    if alike > _ONE_SIGNAL:
        return [Unknown(key, "the torques of all driven wheels are one signal, which has one gain"), common]
    rows = _rows(table, vehicle, offset_std, blocks, driven, common_radius_std, errors.yaw)
    fit = fit_shared_gains(rows)
    if fit is None or fit.blocks < _MIN_BLOCKS:
        return [few, common]
    disagreement = _disagreement(rows)
    # Soils that follow each other are errors that last, which the fit holds already.
    disagreement = max(1.0, disagreement / fit.lasting) if disagreement > 1 else 0.0
    own = max(1.0, disagreement) ** 2 * fit.covariance
    covariance = own + _considered_loads(fit, table, vehicle, driven, errors)
    unknown = [common]
    if not any("drawbar_force" in log.channels for log in logs):
        pull = _unseen_pull(table, vehicle, driven)
        moved = _considered_loads(fit, table, vehicle, driven, ChannelErrors(0.0, 0.0, pull))
        own = own + moved  # a pull differs from log to log, so the gains must not hold it
        covariance = covariance + moved
        most = float(np.sqrt(moved.diagonal()[: len(driven)].max()))
        if most > _LEAST_PULL_EFFECT:
            unknown.append(Unknown(f"{key}, axle to axle", _NO_PULL.format(100 * most)))
    rests_on = evidence(table, slice(None), sources, table.torque_count)
    quantities = _quantities(fit, covariance, own, vehicle, driven, rests_on, disagreement, errors.axle_load)
    radius, radius_std = np.ones(len(vehicle.wheels)), np.zeros(len(vehicle.wheels))
    radius[driven] += fit.radius
    radius_std[driven] = np.sqrt(np.diag(covariance)[len(driven) :])
    return RelativeGains(quantities, unknown, radius, radius_std)


def _quantities(
    fit: SharedGains,
    covariance: Floats,
    own: Floats,
    vehicle: Vehicle,
    driven: Ints,
    rests_on: tuple[Evidence, ...],
    disagreement: float,
    axle_load: float,
) -> list[Quantity]:
    from scipy.special import stdtrit  # scipy.stats takes seconds to load

    factor = float(stdtrit(fit.blocks - 1, 0.975))
    sentence = (
        "relative to the mean of all wheels, at the loads of the vehicle file: torques of wheels at the same slip "
        f"on the same soil are compared, {fit.windows} windows on {fit.blocks} stretches of track; assumes "
        "the same soil under rear and front wheels"
    )
    if axle_load > 0 and len(vehicle.axles) > 1:
        sentence += (
            f"; the intervals hold axle loads that are {100 * axle_load:.2g} % off (uncertainty: vertical_load), "
            "and adhesion comes out right in spite of these"
        )
    if disagreement:
        sentence += (
            f"; the soils disagree, and the intervals are {disagreement * fit.lasting:.1f} times wider"
        )
    return [
        Quantity(
            "drive_torque_gain",
            float(np.exp(value)),
            float(np.exp(value) * np.sqrt(variance)),
            "1",
            rests_on,
            sentence,
            wheel=vehicle.wheels[index],
            factor=factor,
            # Wrong loads shift the gains so that adhesion comes out right: the estimator counts them by themselves.
            own_std=float(np.exp(value) * np.sqrt(alone)),
        )
        for index, value, variance, alone in zip(
            driven, fit.log_gain, np.diag(covariance), np.diag(own), strict=False
        )
    ]


def _disagreement(rows: Sharing) -> float:
    """How much more the gains of single soils differ than their errors explain (Birge's ratio, at least 1).

    A gain is the same on every soil; a rut that helps the rear wheels, or wrong loads, are not.
    """
    from scipy.special import chdtrc

    estimates, precisions = [], []
    for soil in np.unique(rows.soil):
        own = rows.soil == soil
        if len(np.unique(rows.block[own])) < _BLOCKS_A_SOIL:
            continue
        fit = fit_shared_gains(rows.select(own))
        if fit is not None:
            w = len(fit.log_gain)
            estimates.append(fit.log_gain[1:])  # the first follows from the others
            precisions.append(np.linalg.pinv(fit.covariance[1:w, 1:w]))
    if len(estimates) < 2:
        return 1.0
    mean = np.linalg.pinv(np.sum(precisions, axis=0)) @ np.sum(
        [p @ x for p, x in zip(precisions, estimates, strict=True)], axis=0
    )
    apart = sum(float((x - mean) @ p @ (x - mean)) for p, x in zip(precisions, estimates, strict=True))
    freedom = (len(estimates) - 1) * len(mean)
    by_chance = float(chdtrc(freedom, apart))
    return 1.0 if by_chance > _SURPRISE else max(1.0, float(np.sqrt(apart / freedom)))


def _driving(table: Windows, vehicle: Vehicle) -> Windows:
    """Windows of forward driving in which everything was measured."""
    rim = table.wheel_speed * vehicle.wheel_radius
    needed = (table.torque, table.load, rim, table.wheel_acceleration, table.hub_speed)
    known = np.isfinite(needed).all(axis=(0, 2))
    moving = (table.ground_speed > _SLOWEST) & np.all(rim > _SLOWEST, axis=1)
    whole = table.count > 0.5 * np.median(table.count[table.count > 0])
    slips = slip(table.wheel_speed, table.hub_speed, vehicle.wheel_radius)
    on_curve = np.all((slips > _SLIP[0]) & (slips < _SLIP[1]), axis=1)
    # Where a turn is not known, the hubs' speeds are not; where it is tight, the wheels scrub and are far apart on their curve.
    turn_known = ~turns_unseen(table, vehicle) & (
        np.ptp(table.hub_speed, axis=1) < _TIGHT * table.ground_speed
    )
    return table.select(known & moving & whole & on_curve & turn_known & ~_near_border(table))


def _rows(
    table: Windows,
    vehicle: Vehicle,
    offset_std: Floats,
    blocks: Ints,
    driven: Ints,
    radius_std: float,
    yaw_std: float = 0.0,
) -> Sharing:
    radius = vehicle.wheel_radius
    spin = vehicle.wheel_inertia * table.wheel_acceleration
    rolling = vehicle.tire_rolling_resistance * table.load + vehicle.wheel_bearing * table.wheel_speed
    return Sharing(
        torque=table.torque[:, driven],
        known=(spin + radius * rolling)[:, driven],
        leverage=(radius * table.load)[:, driven],
        slip=slip(table.wheel_speed, table.hub_speed, radius)[:, driven],
        soil=_soil_codes(table),
        block=blocks,
        radius_std=vehicle.uncertainty.wheel_radius or _RADIUS,
        offset_std=np.maximum(offset_std[driven], _LEAST_OFFSET),
        slip_std=radius_std,
        by_delay=np.mean((table.wheel_acceleration / table.wheel_speed)[:, driven], axis=1),
        by_yaw=(vehicle.wheel_side / (radius * table.wheel_speed))[:, driven],
        yaw_std=yaw_std,
    )


def _soil_codes(table: Windows) -> Ints:
    """One code per soil label; unlabelled track counts as a soil of its own every so many metres."""
    stretch = np.floor(table.position[:, 0] / _SEGMENT).astype(int)
    names = [
        label if label else f"\0{recording} {place}"
        for label, recording, place in zip(table.soil, table.recording, stretch, strict=True)
    ]
    return np.unique(np.array(names, dtype=str), return_inverse=True)[1].astype(np.intp)


def _near_border(table: Windows) -> Bools:
    """Windows (n,) in which not all wheels may be on the soil of the label: within a wheelbase of a border."""
    near = np.zeros(len(table), dtype=bool)
    for index in np.unique(table.recording):
        own = np.flatnonzero(table.recording == index)
        labels, place = table.soil[own], table.position[own]
        if not np.any(labels != ""):
            continue
        changed = np.flatnonzero(labels[1:] != labels[:-1])
        reach = float(np.ptp(place[0])) + _EDGE if len(place) else _EDGE
        for k in changed:
            middle = 0.5 * (place[k, 0] + place[k + 1, 0])
            near[own] |= np.abs(place[:, 0] - middle) < reach
    return near


def _considered_loads(
    fit: SharedGains, table: Windows, vehicle: Vehicle, driven: Ints, errors: ChannelErrors
) -> Floats:
    """Covariance (2 w, 2 w) that constant errors of the channels, and of what leans aside, add by shifting load from wheel to wheel."""
    rest = {
        "drawbar": np.nan_to_num(table.drawbar),
        "push": np.nan_to_num(table.push),
        "lateral": np.nan_to_num(table.lateral),
    }
    before = _mean_loads(table, vehicle, rest)
    changes = [_shifted(before, vehicle, errors.axle_load)]
    for name in rest:
        after = _mean_loads(table, vehicle, {**rest, name: rest[name] + getattr(errors, name)})
        changes.append(after / before - 1)
    aside = before - _mean_loads(table, vehicle, {**rest, "lateral": np.zeros(len(table))})
    front = vehicle.wheel_axle == 0
    levers = np.abs(aside) @ np.array([front, ~front]).T
    changes.append(_ASIDE * aside / before)
    if levers.all():  # a stiff chassis leaves open which axle bears it
        changes.append(changes[-1] * np.where(front, 1.0, -levers[0] / levers[1]))
    effects = [fit.load_sensitivity @ change[driven] for change in changes]
    return np.sum([np.outer(effect, effect) for effect in effects], axis=0)


def _shifted(load: Floats, vehicle: Vehicle, share: float) -> Floats:
    """Relative changes of the wheels' loads (w,) where `share` of a mean axle load moves from the rear to the front (physics.md 6)."""
    levers, axle = load_levers(vehicle.axle_to_rear), vehicle.wheel_axle
    largest = max(float(np.abs(levers).max()), 1e-12)  # a single axle has none
    moved = share * load.sum() / len(levers) * levers / largest
    return np.asarray((moved / np.bincount(axle, load))[axle])


def _unseen_pull(table: Windows, vehicle: Vehicle, driven: Ints) -> float:
    """What a tool pulls at most where no cell measures it [N]: all that the wheels' forces do beside accelerating."""
    forces = np.sum((table.torque / vehicle.wheel_radius)[:, driven], axis=1) - vehicle.mass * np.nan_to_num(
        table.push
    )
    return max(float(np.nanmean(forces)), 0.0)


def _mean_loads(table: Windows, vehicle: Vehicle, channels: dict[str, Floats]) -> Floats:
    flat = np.zeros(len(table))
    loads = wheel_loads(
        vehicle,
        slope=flat,
        spin_torque=flat,
        measured=np.full((len(table), len(vehicle.axles)), np.nan),
        drawbar=channels["drawbar"],
        push=channels["push"],
        lateral=channels["lateral"],
    )
    return np.asarray(loads.mean(axis=0))
