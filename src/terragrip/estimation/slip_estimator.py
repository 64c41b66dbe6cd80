"""Slip from speeds alone, one sample in and one estimate out: a stock tractor while it drives.

The filter is that of `terragrip.estimation.slip_only`, sample by sample. What a log tells as a whole is not known yet: slip counts from
the vehicle file's radii, calibrated ones where there are (the column ``zero_slip_radius_<wheel>`` says which), and the noise is the
vehicle file's or a guess.
"""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Collection, Mapping
from typing import Any, Self

import numpy as np

from terragrip.errors import InputError
from terragrip.estimation.engine import Thresholds
from terragrip.estimation.estimator import Estimate, TractionEstimator, unusable
from terragrip.estimation.noise import channel_noise
from terragrip.estimation.rim_speeds import radius_before_any_log, wheel_of
from terragrip.estimation.sealed import seal, unseal
from terragrip.estimation.slip_columns import GAP, METHOD, STANDSTILL, Place, Rim, columns_of
from terragrip.estimation.slip_filter import SlipFilter, Walks
from terragrip.recording.schema import has_torque
from terragrip.vehicle import Vehicle

_MAGIC = b"TGRIPSL1"
_WALKS = Walks(0.05, 1e-3)  # the middle of the grid that a whole log chooses from


def speeds_alone(channels: Collection[str], vehicle: Vehicle) -> bool:
    """Whether samples of these columns hold speeds, and no torque though the vehicle drives wheels."""
    wheels = any(name == "wheel_based_speed" or name.startswith("wheel_speed_") for name in channels)
    return bool(vehicle.driven.any()) and wheels and "ground_speed" in channels and not has_torque(channels)


class SlipEstimator:
    """Estimates slip while speeds come in; goes where a `TractionEstimator` goes, with fewer columns.

    ``channels``: the columns that samples carry: ``ground_speed``, and ``wheel_speed_<wheel>`` or ``wheel_based_speed``. ``held``,
    ``gap`` and ``standstill_speed`` as for `TractionEstimator`. Raises InputError where no wheel's speed is among the channels.
    """

    method = METHOD

    def __init__(
        self,
        vehicle: Vehicle,
        channels: Collection[str],
        *,
        held: Mapping[str, float] | None = None,
        sensors: Mapping[str, float] | None = None,
        gap: float | None = None,
        standstill_speed: float | None = None,
        walks: Walks = _WALKS,
    ) -> None:
        self.vehicle, self.channels, self.held = vehicle, tuple(channels), dict(held or {})
        self.thresholds = Thresholds(gap=gap, standstill_speed=standstill_speed)
        names = [f"wheel_speed_{w}" for w in vehicle.wheels if f"wheel_speed_{w}" in channels]
        names = names or (["wheel_based_speed"] if "wheel_based_speed" in channels else [])
        if not names:
            raise InputError(
                "there is no wheel's speed", mend="give wheel_based_speed, or a speed of each wheel"
            )
        self._inputs = ("ground_speed", *names)
        self.noise, self.guessed = channel_noise(vehicle, self._inputs, sensors)
        radii = [radius_before_any_log(vehicle, name) for name in names]
        self._factors = (1.0, *(factor for factor, _, _ in radii))
        self._rims = tuple(
            Rim(wheel_of(name), radius, spread)
            for name, (_, radius, spread) in zip(names, radii, strict=True)
        )
        sds = [self.noise[name] * factor for name, factor in zip(self._inputs, self._factors, strict=True)]
        self._filter = SlipFilter(sds, walks)
        self._standstill = STANDSTILL if standstill_speed is None else standstill_speed
        self._gap = GAP if gap is None else gap
        self._place, self._heard = Place(), -math.inf
        self._fresh: dict[
            str, tuple[float, float]
        ] = {}  # instant and value of a held channel's last true update
        state, covariance = self._arrays()
        found = columns_of(state, covariance, self._rims, np.zeros(1), self._standstill, Place())
        zero = self._zero_slip()
        self._zero = tuple(zero.values())
        self.columns = (*found, *zero, "nis", "channels")
        self.places = {name: k for k, name in enumerate(self.columns)}
        self._pack = struct.Struct(f"={len(self.columns)}d").pack

    def _zero_slip(self) -> dict[str, float]:
        """The radii that slip counts from, with their SDs."""
        return {
            f"zero_slip_radius_{rim.wheel}{end}": value
            for rim in self._rims
            for end, value in (("", rim.radius), ("_std", rim.radius * rim.spread))
        }

    def _arrays(self) -> tuple[np.ndarray, np.ndarray]:
        return np.array([self._filter.state]), np.array([self._filter.covariance])

    def update(self, sample: Mapping[str, float | None]) -> Estimate:
        """Take one sample and return the estimate at its instant; as `TractionEstimator.update`, and raises as that."""
        time = sample.get("time")
        if time is None:
            raise unusable(sample, self._inputs)
        return self.update_at(time, sample)

    def update_at(self, time: float, sample: Mapping[str, float | None]) -> Estimate:
        """As `update`, with the instant [s] beside the sample."""
        values = [sample.get(name) for name in self._inputs]
        try:
            sound = math.isfinite(time) and not any(v is not None and math.isinf(v) for v in values)
        except TypeError:
            sound = False
        if not sound:
            raise unusable({**sample, "time": time}, self._inputs)
        before = self._place.time
        if before is not None and time <= before:
            raise InputError(
                f"time {time!r} does not run forward",
                place=f"time {time}",
                mend="give samples in the order of their times",
            )
        speeds = [
            math.nan if value is None or not self._is_fresh(name, time, value) else factor * value
            for name, value, factor in zip(self._inputs, values, self._factors, strict=True)
        ]
        anew = time - self._heard > self._gap
        if anew:
            self._filter.anew()
        elif before is not None:
            self._filter.ahead(time - before)
        self._filter.take(speeds)
        if any(speed == speed for speed in speeds):
            self._heard = time
        return self._estimate(time, anew and before is not None)

    def _is_fresh(self, name: str, time: float, value: float) -> bool:
        """Whether a value is a true update: of a held channel one that changed, or a standing one when the next is due."""
        period = self.held.get(name)
        if period is None:
            return True
        since, last = self._fresh.get(name, (-math.inf, math.nan))
        fresh = value != last or (value == 0.0 and time - since > 1.5 * period)
        if fresh:
            self._fresh[name] = time, value
        return fresh

    def _estimate(self, time: float, after_gap: bool) -> Estimate:
        state, covariance = self._arrays()
        found = columns_of(state, covariance, self._rims, np.array([time]), self._standstill, self._place)
        numbers = {name: float(column[0]) for name, column in found.items()}
        self._place = Place(numbers["distance"], time, numbers["ground_speed"])
        own, x = self._filter, self._filter.state
        fastest = max(abs(x[0]), *(abs(x[0] + slip) for slip in x[2:]))
        event = "outlier" if own.outlier else ""
        event = "gap" if after_gap else "standstill" if fastest <= self._standstill else event
        packed = self._pack(*numbers.values(), *self._zero, own.nis, float(own.taken))
        return Estimate(time, event, packed, self.places)

    def snapshot(self) -> bytes:
        """Everything needed to go on later, bit for bit."""
        own = self._filter
        about = {
            "vehicle": self.vehicle.to_dict(),
            "channels": self.channels,
            "held": self.held,
            "noise": self.noise,
            "guessed": self.guessed,
            "gap": self.thresholds.gap,
            "standstill_speed": self.thresholds.standstill_speed,
            "walks": [own.walks.jerk, own.walks.change],
            "state": own.state,
            "covariance": own.covariance,
            "refused": own.refused,
            "place": [self._place.distance, self._place.time, self._place.speed],
            "heard": self._heard,
            "fresh": self._fresh,
        }
        return seal(_MAGIC, json.dumps(about).encode())

    @classmethod
    def restore(cls, data: bytes) -> Self:
        """The estimator of a snapshot; raises InputError if the bytes are damaged or of another version."""
        about: dict[str, Any] = json.loads(unseal(_MAGIC, data))
        found = cls(
            Vehicle.from_dict(about["vehicle"]),
            about["channels"],
            held=about["held"],
            sensors=about["noise"],
            gap=about["gap"],
            standstill_speed=about["standstill_speed"],
            walks=Walks(*about["walks"]),
        )
        found.guessed = tuple(about["guessed"])
        found._filter.state, found._filter.covariance = about["state"], about["covariance"]
        found._filter.refused = about["refused"]
        found._place, found._heard = Place(*about["place"]), about["heard"]
        found._fresh = {name: (time, value) for name, (time, value) in about["fresh"].items()}
        return found


def restored(snapshot: bytes) -> TractionEstimator | SlipEstimator:
    """The estimator of a snapshot, of either kind; raises InputError if the bytes are damaged."""
    if snapshot[: len(_MAGIC)] == _MAGIC:
        return SlipEstimator.restore(snapshot)
    return TractionEstimator.restore(snapshot)
