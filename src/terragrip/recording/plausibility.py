"""All checks of a log for what is likely wrong in it: sentences for the user, never errors.

`CHECKS` lists them in the order of their sentences, each with those that explain its symptoms: where one of these found something, it
says nothing itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.physics.slip import middle_speed
from terragrip.recording.axles import axle_warnings, free_axle_warnings
from terragrip.recording.brake import without_braked_torques
from terragrip.recording.codes import without_codes
from terragrip.recording.copies import replay_warnings, speed_copy_warnings, torque_copy_warnings
from terragrip.recording.counted import counted_warnings, waiting_warnings
from terragrip.recording.doubled import doubled_warnings
from terragrip.recording.dropouts import dropout_warnings, zero_warnings
from terragrip.recording.forces import Courses, acceleration_warnings, balance_warnings
from terragrip.recording.frozen import cut_warnings, frozen_warnings, overflow_warnings
from terragrip.recording.ground_noise import noisy_ground_speed_warnings
from terragrip.recording.held import measurable
from terragrip.recording.inertial import inertial_warnings
from terragrip.recording.interpolated import interpolated_warnings
from terragrip.recording.leaps import leap_warnings
from terragrip.recording.mechanics import Means, means_of, motion_warnings, shortfall_warnings
from terragrip.recording.pace import clock_warnings, drift_warnings, odometry_warnings
from terragrip.recording.pitch import pitch_lag_warnings
from terragrip.recording.plain_signs import plain_sign_warnings
from terragrip.recording.plain_units import (
    angle_warnings,
    gravity_warnings,
    mass_warnings,
    size_warnings,
    spacing_warnings,
)
from terragrip.recording.rescaled import rescaled_warnings
from terragrip.recording.rest import rest_warnings, torque_rest_warnings, turn_rest_warnings
from terragrip.recording.reverse import against_warnings, reverse_warnings
from terragrip.recording.rim_noise import noisy_rim_warnings
from terragrip.recording.rolling import light_warnings, slower_warnings
from terragrip.recording.sides import exchanged_torques, side_warnings
from terragrip.recording.sideways import sideways_warnings
from terragrip.recording.slowing import slowing_warnings
from terragrip.recording.speed_ratios import drive_train_warnings, position_warnings, rim_warnings
from terragrip.recording.steering import joint_warnings, steering_warnings
from terragrip.recording.torques import sign_warnings, torque_warnings
from terragrip.recording.track import Track, track_of
from terragrip.recording.turn_rates import shown_turn, turn_rate_warnings
from terragrip.recording.turns import exchange_warnings
from terragrip.recording.window_means import averaged
from terragrip.recording.wrong_sign import WrongSign

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_FINEST = 0.05  # s: but for what is lost in means, no check has a finer resolution


def unit_warnings(recording: Recording, vehicle: Vehicle | None) -> list[str]:
    """Sentences on channels that are likely not in SI, of the wrong sign, of another wheel, late, frozen or lost.

    Without a vehicle that knows its wheels, checks that need their radii are left out.
    """
    return [note for notes in warnings_by_check(recording, vehicle).values() for note in notes]


def warnings_by_check(
    recording: Recording, vehicle: Vehicle | None, names: Iterable[str] | None = None
) -> dict[str, list[str]]:
    """Those sentences by the name of their check, of checks that found something; ``names``: of these checks, None: of all."""
    log = _Log(recording, vehicle)
    found = {name: log.found(name) for name in names or (check.name for check in CHECKS)}
    return {name: [str(note) for note in notes] for name, notes in found.items() if notes}


def wrong_signs(recording: Recording, vehicle: Vehicle | None) -> list[WrongSign]:
    """Of the sentences of `unit_warnings` those on channels of the opposite sign, each with its channels and what shows it."""
    log = _Log(recording, vehicle)
    return [note for check in CHECKS for note in log.found(check.name) if isinstance(note, WrongSign)]


class _Log:
    """A log and what several checks look at; each is computed when it is first asked for.

    ``recording`` is the log as given, which the estimate reads; ``whole`` are its rows without codes for missing values, ``rows`` their
    means where they are finer than any check needs.
    """

    def __init__(self, recording: Recording, vehicle: Vehicle | None) -> None:
        channels = {name: measurable(values) for name, values in recording.channels.items()}
        self.whole, self.codes = without_codes(replace(recording, channels=channels), vehicle)
        self.recording, self.any_vehicle = recording, vehicle
        self.knows_wheels = vehicle is not None and vehicle.knows_wheels
        self._found: dict[str, list[str]] = {}

    def found(self, name: str) -> list[str]:
        """The sentences of a check; none where another one explains them."""
        if name not in self._found:
            check = _BY_NAME[name]
            silent = (check.needs_wheels and not self.knows_wheels) or any(
                map(self.found, check.explained_by)
            )
            self._found[name] = [] if silent else check.find(self)
        return self._found[name]

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle, of a check that ``needs_wheels``."""
        assert self.any_vehicle is not None
        return self.any_vehicle

    @cached_property
    def as_measured(self) -> Recording:
        """The rows with the ground speed where its receiver is, as that of the positions."""
        return averaged(without_braked_torques(self.whole), _FINEST)

    @cached_property
    def rows(self) -> Recording:
        """The rows with the ground speed of what the vehicle turns about, which the wheels go with."""
        ahead, side = (0.0, 0.0) if self.any_vehicle is None else self.any_vehicle.receiver
        ground = self.as_measured.channels.get("ground_speed")
        if ground is None or self.turn is None or not (ahead or side):
            return self.as_measured
        middle = middle_speed(ground, np.nan_to_num(self.turn), ahead=ahead, side=side)
        return self.as_measured.with_channels(ground_speed=middle)

    @cached_property
    def track(self) -> Track | None:
        return track_of(self.whole)

    @cached_property
    def turn(self) -> Floats | None:
        return shown_turn(self.as_measured, self.track)

    @cached_property
    def sides(self) -> tuple[list[str], list[str]]:
        """Of radii, and of torques."""
        return side_warnings(self.rows, self.vehicle, self.turn)

    @cached_property
    def means(self) -> Means | None:
        return means_of(self.rows, self.any_vehicle if self.knows_wheels else None)

    @property
    def means_of_even_torques(self) -> Means | None:
        """The same without thrusts where a torque is off beside its axle's other one: so is their sum."""
        means = self.means
        return means and (replace(means, thrusts={}) if self.found("uneven torques") else means)

    @cached_property
    def courses(self) -> Courses | None:
        return Courses.of(self.rows, self.vehicle if self.knows_wheels else None)


@dataclass(frozen=True)
class Check:
    """What ``find`` finds wrong in a log, unless one of the checks ``explained_by`` found something."""

    name: str
    find: Callable[[_Log], list[str]]
    explained_by: tuple[str, ...] = ()
    needs_wheels: bool = True


_TIME = ("clock",)
"""Every other check is by time,"""
_WAY = (*_TIME, "against")
"""and takes it that rims and ground go one way."""
_SPEEDS = (*_WAY, "reverse", "rescaled", "sides", "rims", "free axles")
_COURSES = (*_SPEEDS, "positions")
_INSTANTS = ("inertial", "pitch lag")
"""Where a sensor is late the rest of what is compared with it follows."""
_FORCES = (
    *_WAY,
    *_INSTANTS,
    "rims",
    "angles",
    "spacing",
    "signs",
    "uneven torques",
    "motion",
    "acceleration",
    "zeros",
    "leaps",
    "overflows",
)

_EACH = (
    Check("clock", lambda log: clock_warnings(log.whole, log.vehicle)),
    Check("against", lambda log: against_warnings(log.rows), _TIME, needs_wheels=False),
    Check("reverse", lambda log: reverse_warnings(log.rows, log.vehicle), (*_WAY, "exchanged wheels")),
    Check("rims", lambda log: rim_warnings(log.rows, log.vehicle), (*_WAY, "sides")),
    Check("free axles", lambda log: free_axle_warnings(log.rows, log.vehicle), (*_WAY, "sides", "rims")),
    Check(
        "slower",
        lambda log: slower_warnings(log.rows, log.vehicle, log.means, log.turn),
        (
            *_SPEEDS,
            "steering",
            "exchanged wheels",
            "turn rate",
            "turn rate at rest",
            "signs",
            "motion",
            "acceleration",
            "frozen",
            "dropouts",
            "copied speeds",
            "spacing",
        ),
    ),
    Check("rescaled", lambda log: rescaled_warnings(log.as_measured, log.vehicle, log.turn, log.track), _WAY),
    Check(
        "steering",
        lambda log: steering_warnings(log.rows, log.vehicle, log.turn),
        (*_WAY, "reverse", "exchanged wheels", "turn rate"),
    ),
    Check("joint", lambda log: joint_warnings(log.rows, log.vehicle, log.turn), (*_WAY, "exchanged wheels")),
    Check("sides", lambda log: log.sides[0], (*_WAY, "rescaled")),
    Check("uneven torques", lambda log: log.sides[1], (*_WAY, "rescaled")),
    Check("drive train", lambda log: drive_train_warnings(log.rows), _WAY, needs_wheels=False),
    Check("drift", lambda log: drift_warnings(log.rows), _WAY, needs_wheels=False),
    Check(
        "positions",
        lambda log: position_warnings(
            log.as_measured, log.track, wheels_agree=log.knows_wheels and not any(map(log.found, _SPEEDS))
        ),
        _WAY,
        needs_wheels=False,
    ),
    Check("exchanged wheels", lambda log: exchange_warnings(log.rows, log.vehicle, log.turn), _WAY),
    Check(
        "turn rate",
        lambda log: turn_rate_warnings(
            log.rows,
            None if any(map(log.found, ("exchanged wheels", "rims", "copied speeds"))) else log.any_vehicle,
            None if log.found("positions") else log.track,
        ),
        _WAY,
        needs_wheels=False,
    ),
    Check(
        "plain signs",  # with the radii the checks of torques and turns show more
        lambda log: [] if log.knows_wheels else plain_sign_warnings(log.rows, by_wheels=log.track is None),
        _WAY,
        needs_wheels=False,
    ),
    Check("angles", lambda log: angle_warnings(log.whole), _WAY, needs_wheels=False),
    Check("gravity", lambda log: gravity_warnings(log.rows), _WAY, needs_wheels=False),
    Check("signs", lambda log: sign_warnings(log.whole, log.vehicle), _WAY),
    Check(
        "motion",
        lambda log: motion_warnings(log.rows, log.any_vehicle, log.means_of_even_torques),
        (*_WAY, "reverse", "rims", "angles", "signs", "overflows", "spacing"),
        needs_wheels=False,
    ),
    Check(
        "acceleration",
        lambda log: acceleration_warnings(log.courses),
        (*_COURSES, *_INSTANTS, "angles", "signs", "motion"),
        needs_wheels=False,
    ),
    Check(
        "pitch lag",
        lambda log: pitch_lag_warnings(log.rows, log.means),
        (*_WAY, "inertial", "angles", "motion"),
        needs_wheels=False,
    ),
    Check(
        "sideways",
        lambda log: sideways_warnings(log.rows, log.means, log.turn),
        (*_WAY, "turn rate", "exchanged wheels", "motion"),
        needs_wheels=False,
    ),
    Check("copied torques", lambda log: torque_copy_warnings(log.whole, log.vehicle), _WAY),
    Check("copied speeds", lambda log: speed_copy_warnings(log.whole, log.vehicle), _WAY),
    Check("torques", lambda log: torque_warnings(log.rows, log.vehicle, log.means), _FORCES),
    Check(
        "ground noise",
        lambda log: noisy_ground_speed_warnings(log.whole, log.vehicle),
        (*_WAY, "rims", "frozen", "interpolated"),
    ),
    Check(
        "rim noise",
        lambda log: noisy_rim_warnings(log.whole, log.vehicle),
        (*_TIME, "counted", "rims", "sides", "rescaled", "frozen"),
    ),
    Check(
        "balance",
        lambda log: balance_warnings(log.courses, log.vehicle),
        (*_COURSES, *_FORCES, "torques", "rim noise"),
    ),
    Check(
        "slowing",
        lambda log: slowing_warnings(log.rows, log.vehicle),
        (*_COURSES, *_FORCES, "torques", "balance"),
    ),
    Check(
        "shortfall",
        lambda log: shortfall_warnings(log.rows, log.means),
        (*_COURSES, *_FORCES, "torques", "balance"),
    ),
    Check(
        "light",
        lambda log: light_warnings(log.rows, log.vehicle, log.means),
        (*_SPEEDS, *_FORCES, "torques", "balance", "shortfall", "slower", "frozen"),
    ),
    Check("inertial", lambda log: inertial_warnings(log.rows, log.vehicle), (*_WAY, "joint")),
    Check("zeros", lambda log: zero_warnings(log.rows, log.vehicle, log.means), _WAY),
    Check(
        "leaps",
        lambda log: leap_warnings(log.rows, log.vehicle),
        (*_WAY, "zeros", "rescaled", "frozen", "dropouts"),
    ),
    Check("counted", lambda log: counted_warnings(log.whole), _TIME, needs_wheels=False),
    Check("frozen", lambda log: frozen_warnings(log.whole), (*_TIME, "counted"), needs_wheels=False),
    Check("waiting", lambda log: waiting_warnings(log.whole), (*_TIME, "counted"), needs_wheels=False),
    Check("doubled", lambda log: doubled_warnings(log.whole), (*_TIME, "counted"), needs_wheels=False),
    Check("dropouts", lambda log: dropout_warnings(log.whole), (*_TIME, "counted"), needs_wheels=False),
    Check("cut", lambda log: cut_warnings(log.whole), (*_TIME, "frozen"), needs_wheels=False),
    Check("overflows", lambda log: overflow_warnings(log.whole), _TIME, needs_wheels=False),
    Check("replays", lambda log: replay_warnings(log.whole), _TIME, needs_wheels=False),
    Check("rest", lambda log: rest_warnings(log.rows), (*_WAY, "frozen", "dropouts"), needs_wheels=False),
    Check(
        "turn rate at rest",
        lambda log: turn_rest_warnings(log.rows, log.vehicle),
        (*_WAY, "frozen", "turn rate"),
    ),
    Check("torques at rest", lambda log: torque_rest_warnings(log.rows, log.vehicle), (*_WAY, "frozen")),
    Check("mass", lambda log: mass_warnings(log.rows, log.any_vehicle), needs_wheels=False),
    Check("codes", lambda log: log.codes, needs_wheels=False),
    Check("odometry", lambda log: odometry_warnings(log.whole, log.vehicle)),
    Check("vehicle", lambda log: size_warnings(log.any_vehicle), needs_wheels=False),
    Check("interpolated", lambda log: interpolated_warnings(log.recording), _TIME, needs_wheels=False),
    Check("spacing", lambda log: spacing_warnings(log.whole), _TIME, needs_wheels=False),
)
_ALL = tuple(check.name for check in _EACH)
_ELSE = (
    Check("exchanged torques", lambda log: exchanged_torques(log.rows, log.vehicle, log.turn), _ALL),
    Check(
        "axles",
        lambda log: axle_warnings(log.rows, log.vehicle, log.means),
        (*_ALL, "exchanged torques"),
    ),
)
"""Their symptoms are those of other mistakes, too."""

CHECKS = _EACH + _ELSE
_BY_NAME = {check.name: check for check in CHECKS}
