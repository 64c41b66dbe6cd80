"""Forces against accelerations where the speed changes, in starts and stops: sentences for the user, never errors.

The wheels' thrust Σ M/r less the drawbar force is the mass times dv/dt + g sin(pitch), plus a resistance (physics.md 1), and an
accelerometer along the vehicle reads the same acceleration. Within seconds the resistance changes by chance and the acceleration by
command, which shows in the rims: their rate is the instrument of each regression, so neither noise nor a hit (which slows the vehicle,
not the rims) bends it. A receiver filters its speed: forces go with the accelerometer, and without one with the rims' rate (R).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from terragrip.arrays import Floats
from terragrip.recording.brake import braked
from terragrip.recording.courses import points_of, smooth
from terragrip.recording.ranks import quantile
from terragrip.recording.turns import are_known, filled_channel
from terragrip.recording.wrong_sign import WrongSign
from terragrip.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from terragrip.recording.table import Recording
    from terragrip.vehicle import Vehicle

_CALM, _SLOW = 0.6, 12.0  # s: faster changes are noise, slower ones the ground
_MOVING = 0.1  # of the speed that a twentieth of the drive exceeds
_SLIP = 0.3  # beyond, resistance grows with the pull
_BRAKED = 1e-6  # of a window: what a brake does is in no torque
_LEAST = 40.0  # s of driving: in 22 s one start outweighs all blocks (a right log in 531 was named)
_BLOCKS = 12  # for the jackknife
_STARTS = 2.5  # blocks among which the rims' change is spread, by its squares: a start or two have no scatter
_COMMANDED = 0.1  # of what thrust and pull vary by (SD): where the rims change less, what the load does to them outweighs what they command
_COMMAND = 0.15  # correlation of thrust and rims' rate: below it the load drives both, as under a governor with droop
_SURE = 3.0  # standard errors
_ALIKE = 0.5  # correlation of ground's and rims' rates, of a pull with that just before and after: below it nothing stands out of noise
_ACCELERATION = 1.8  # against both the ground's and the rims' rate
_FORCE = 1.3  # an uncalibrated torque, an estimated mass


@dataclass(frozen=True)
class Range:
    """A factor with its bounds, `_SURE` standard errors away."""

    value: float
    low: float
    high: float

    def is_off(self, factor: float) -> bool:
        """Whether it is surely beyond ``factor`` or its inverse, or of the other sign."""
        return self.low > factor or self.high < 1 / factor

    @property
    def holds_one(self) -> bool:
        """Whether 1 is within the bounds."""
        return self.low <= 1.0 <= self.high


_RIGHT = Range(1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Courses:
    """Courses (n,) of a drive without what changes slowly: ``rims``: their rate; ``change``: that of the ground speed, with the climb; the
    accelerometer's ``shown``; ``thrust`` and ``pull`` over the mass [m/s²], None where the log lacks them; ``beside``: the pull just before
    and after, whose noise is another: the instrument of its slope. None where a cell shows but noise: nothing is towed."""

    rims: Floats
    change: Floats
    shown: Floats | None
    thrust: Floats | None
    pull: Floats | None
    beside: Floats | None

    @classmethod
    def of(cls, recording: Recording, vehicle: Vehicle | None) -> Courses | None:
        """None without speeds of ground and wheels, where rows are too far apart to show a start, or too little is driven."""
        time, channels = recording.time, recording.channels
        found = points_of(time)
        names = (
            [n for n in channels if n.startswith("wheel_speed_")]
            if vehicle is None
            else [f"wheel_speed_{w}" for w in vehicle.driven_radii]
        )
        if found is None or not names or not are_known(recording, "ground_speed", *names):
            return None
        points, step = found
        if 2 * step > _CALM:
            return None

        def at(name: str, shift: float = 0.0) -> Floats:
            return np.interp(points + shift, time, filled_channel(recording, name))

        def calm(values: Floats) -> Floats:
            return smooth(values, _CALM, step)

        radii = {} if vehicle is None else vehicle.driven_radii
        rim = calm(np.mean([radii.get(n[12:], 1.0) * at(n) for n in names], axis=0))
        speed = calm(at("ground_speed"))
        if vehicle is None:  # without radii: as fast as the ground, on average
            rim = rim * float(np.sum(speed * rim)) / max(float(np.sum(rim**2)), 1e-9)
        rows = (speed > _MOVING * quantile(speed, 0.95)) & (rim > 0)
        if vehicle is not None:
            rows &= rim - speed < _SLIP * rim
        rows &= smooth(np.interp(points, time, braked(recording)), 2 * _CALM, step) < _BRAKED
        if rows.sum() * step < _LEAST:
            return None

        share = smooth(rows.astype(np.float64), _SLOW, step)

        def quick(values: Floats) -> Floats:
            """Less the mean while driving: at rest nothing resists."""
            return (values - smooth(np.where(rows, values, 0.0), _SLOW, step) / np.maximum(share, 1e-9))[rows]

        rate = np.gradient(rim, step)
        change = np.gradient(speed, step)
        if are_known(recording, "pitch"):
            change = change + STANDARD_GRAVITY * np.sin(calm(at("pitch")))
        shown = None
        if are_known(recording, "acceleration_x") and not _is_dead(channels["acceleration_x"]):
            shown = quick(calm(at("acceleration_x")))
        thrust = pull = beside = None
        torques = [f"drive_torque_{w}" for w in radii]
        if vehicle is not None and torques and are_known(recording, *torques):
            spun = sum(
                float(inertia) / radius**2 * on
                for inertia, radius, on in zip(
                    vehicle.wheel_inertia, vehicle.wheel_radius, vehicle.driven, strict=True
                )
            )
            force = calm(np.sum([at(f"drive_torque_{w}") / r for w, r in radii.items()], axis=0))
            thrust = quick((force - spun * rate) / vehicle.mass)
            if are_known(recording, "drawbar_force"):
                apart = _CALM + 2 * step  # such means share no sample
                pull = quick(calm(at("drawbar_force")) / vehicle.mass)
                near = at("drawbar_force", -apart) + at("drawbar_force", apart)
                beside = quick(calm(near) / 2 / vehicle.mass)
                if not _correlation(pull, beside) > _ALIKE:
                    beside = None
        return cls(quick(rate), quick(change), shown, thrust, pull, beside)

    def slopes(self, y: Floats, x: Floats, *beside: tuple[Floats, Floats]) -> list[Range]:
        """y (n,) over the acceleration x (n,) that the rims command, and over each course of ``beside``, given with its instrument;
        of what is not known 1."""
        unknown = [_RIGHT] * (1 + len(beside))
        if not _correlation(self.rims, self.change) > _ALIKE:
            return unknown
        one = np.ones(len(y))
        courses, instruments = zip((x, self.rims), *beside, (one, one), strict=True)
        inside, outside = instruments, (*courses, y)
        block = np.arange(len(y)) * _BLOCKS // len(y)
        sums = np.array(
            [
                np.stack([v[block == k] for v in inside]) @ np.stack([v[block == k] for v in outside]).T
                for k in range(_BLOCKS)
            ]
        )
        whole = sums.sum(axis=0)
        spread = np.bincount(block, self.rims**2)
        if np.sum(spread) ** 2 < _STARTS * np.sum(spread**2):
            return unknown
        tables = np.concatenate([whole[None], whole - sums])
        if not (np.linalg.matrix_rank(tables[..., :-1]) == len(inside)).all():
            return unknown
        fits = np.linalg.solve(tables[..., :-1], tables[..., -1:])[..., 0]
        errors = _SURE * np.sqrt((_BLOCKS - 1) * np.var(fits[1:], axis=0))
        return [Range(v, v - e, v + e) for v, e in zip(fits[0], errors, strict=True)][: len(unknown)]


def acceleration_warnings(courses: Courses | None) -> list[str]:
    """A sentence on an accelerometer of another sign or scale than the change of speed."""
    if courses is None or courses.shown is None:
        return []
    found = [courses.slopes(courses.shown, own)[0] for own in (courses.change, courses.rims)]
    # A receiver that filters changes less than the rims do.
    if not all(each.is_off(_ACCELERATION) for each in found):
        return []
    if found[0].value < 0:
        return [opposite_acceleration()]
    return [
        f"acceleration_x is not the change of ground speed but {found[0].value:.2g} times that: it may be in g (write 'unit: g' in the "
        "profile), or not the axis that points forward."
    ]


def opposite_acceleration(too: str = "") -> WrongSign:
    """The sentence on an accelerometer of the opposite sign."""
    shown = f"is not the change of ground speed but its opposite{too}"
    return WrongSign.of(["acceleration_x"], shown, "forward is")


def balance_warnings(courses: Courses | None, vehicle: Vehicle) -> list[str]:
    """A sentence on torques, drawbar force and mass that contradict each other, and which of them may be wrong.

    Without a drawbar force a trailer that is not logged only adds to what the torques have to move: they are too small by accelerometer
    and ground speed, or nothing is said.
    """
    if courses is None or courses.thrust is None:
        return []
    # of torques or a pull of another scale the other one shows what the load does; a cell that shows but noise does not
    load = min(np.std(course) for course in (courses.thrust, courses.beside) if course is not None)
    if np.std(courses.rims) < _COMMANDED * load:
        return []
    # a receiver filters, and its speed is late
    change = courses.rims if courses.shown is None else courses.shown
    scale = "the torques' scale (at the wheel, not at the motor: the gear ratio counts) and the wheel radius"
    if courses.pull is None or courses.beside is None:
        # what a trailer's inertia pulls in starts is no instrument, but a part of the force all the same
        left = courses.thrust if courses.pull is None else courses.thrust - courses.pull
        if _correlation(left, courses.rims) < _COMMAND:
            return []
        fits = [courses.slopes(left, own)[0] for own in (change, courses.change)]
        off = all(mass.high < 1 / _FORCE for mass in fits)
        off |= courses.pull is not None and all(mass.low > _FORCE for mass in fits)
        return [_imbalance(fits[0], "", [scale, "the mass"], vehicle)] if off else []
    mass, pull = courses.slopes(courses.thrust, change, (courses.pull, courses.beside))
    if not (mass.is_off(_FORCE) or pull.is_off(_FORCE)):
        return []
    causes = []
    if max(mass.low, pull.low) <= min(mass.high, pull.high):
        causes.append(scale)
    if pull.holds_one:
        causes.append("the mass")
    if mass.holds_one:
        causes.append("the scale of drawbar_force")
    if not causes:  # on hills that nothing measures a trailer pulls as the slope does
        return []
    return [_imbalance(mass, f", and by {pull.value:.2g} times the drawbar force", causes, vehicle)]


def _imbalance(mass: Range, beside: str, causes: list[str], vehicle: Vehicle) -> str:
    if mass.high < 1:
        causes = [*causes, "brakes that the torques do not contain (give a channel 'brake')"]
    return (
        f"In starts and stops the drive torques over the wheel radius change by {mass.value:.2g} times the force that moves "
        f"{vehicle.mass:.4g} kg{beside}: check {', or '.join(causes)}."
    )


def _correlation(a: Floats, b: Floats) -> float:
    """The correlation of two courses (n,), 0 where one never changes."""
    return float(np.corrcoef(a, b)[0, 1]) if np.ptp(a) and np.ptp(b) else 0.0


def _is_dead(values: Floats) -> bool:
    """Whether the finite values are all the same but for rounding, of which a slope, of either sign, is surely not 1."""
    known = values[np.isfinite(values)]
    return bool(np.ptp(known) <= 1e-9 * np.max(np.abs(known)))
