"""The kernel's estimator as Python sees it: settings from a vehicle, columns in, columns out."""

from __future__ import annotations

import math
import struct
from array import array
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip._kernel import ffi, lib
from terragrip.errors import InputError
from terragrip.estimation.methods import Method
from terragrip.physics.loads import GRAVITY, lateral_shares
from terragrip.physics.radius import biderman_deflection, hadekel_deflection, loaded_radius, rolling_radius
from terragrip.vehicle import BidermanRadius, HadekelRadius, Vehicle, Wheel

Floats = npt.NDArray[np.float64]

EVENTS = ("", "outlier", "standstill", "gap", "immobilization", "stuck", "push", "restart")
"""Texts of the ``event`` column, in the order of tg_event."""

SIGNS = ("rise", "high_slip", "leading", "resistance", "command")
"""The signs of the warning, columns ``warning_<sign>``, in the order of tg_sign."""

_MISSING = (math.nan,) * lib.TG_SLOTS
_BLOCK = 1 << 18  # rows a call: Ctrl-C and progress get a turn between calls


@dataclass(frozen=True)
class Thresholds:
    """What a user may set. Speeds in m/s, times in s; None keeps the kernel's tuned default."""

    gap: float | None = None
    standstill_speed: float | None = None
    max_step: float | None = None

    def put(self, settings: Any) -> None:
        """Write what the user set into a tg_settings."""
        for name in ("gap", "standstill_speed", "max_step"):
            value = getattr(self, name)
            if value is not None:
                setattr(settings, name, value)


def watch_limits() -> dict[str, float]:
    """The thresholds by which the estimator flags rows: tg_watch_settings, ``gap`` [s] and ``standstill_speed`` [m/s]."""
    settings = lib.tg_default_settings()
    names = [name for name, _ in ffi.typeof("tg_watch_settings").fields]
    found = {name: float(getattr(settings.watch, name)) for name in names}
    return found | {"gap": float(settings.gap), "standstill_speed": float(settings.standstill_speed)}


def sample_slots(vehicle: Vehicle) -> dict[str, int]:
    """The place in tg_sample.value of each recording column that the estimator looks at."""
    return {
        **{f"wheel_speed_{w}": lib.TG_WHEEL_SPEED + i for i, w in enumerate(vehicle.wheels)},
        "ground_speed": lib.TG_GROUND_SPEED,
        **{f"drive_torque_{w}": lib.TG_DRIVE_TORQUE + i for i, w in enumerate(vehicle.wheels)},
        "drawbar_force": lib.TG_DRAWBAR_FORCE,
        "acceleration_x": lib.TG_ACCELERATION_X,
        "acceleration_y": lib.TG_ACCELERATION_Y,
        "pitch": lib.TG_PITCH,
        "roll": lib.TG_ROLL,
        "angular_velocity_z": lib.TG_YAW_RATE,
        **{f"vertical_load_{a}": lib.TG_VERTICAL_LOAD + k for k, a in enumerate(vehicle.axle_names)},
    }


def estimate_slots(vehicle: Vehicle, *, adaptive: bool = False) -> dict[str, int]:
    """The place in tg_estimate.value of each column of an estimates table, in the table's order.

    ``adaptive``: with A_k, ``adaptation_<state>`` of each state, which the adaptive and the supervised policy have.
    """
    slots = {"distance": lib.TG_OUT_DISTANCE}

    def take(name: str, slot: int, std: int, place: int = 0) -> None:
        slots[name] = slot + place
        slots[f"{name}_std"] = std + place

    take("ground_speed", lib.TG_OUT_GROUND_SPEED, lib.TG_OUT_GROUND_SPEED_STD)
    take("soil_resistance", lib.TG_OUT_SOIL_RESISTANCE, lib.TG_OUT_SOIL_RESISTANCE_STD)
    for quantity, slot, std in (
        ("wheel_speed", lib.TG_OUT_WHEEL_SPEED, lib.TG_OUT_WHEEL_SPEED_STD),
        ("adhesion", lib.TG_OUT_ADHESION, lib.TG_OUT_ADHESION_STD),
        ("slip", lib.TG_OUT_SLIP, lib.TG_OUT_SLIP_STD),
        ("net_traction", lib.TG_OUT_NET_TRACTION, lib.TG_OUT_NET_TRACTION_STD),
        ("efficiency", lib.TG_OUT_EFFICIENCY, lib.TG_OUT_EFFICIENCY_STD),
    ):
        for i, wheel in enumerate(vehicle.wheels):
            take(f"{quantity}_{wheel}", slot, std, i)
    for k, axle in enumerate(vehicle.axle_names):
        slots[f"vertical_load_{axle}"] = lib.TG_OUT_VERTICAL_LOAD + k
    take("curve_a", lib.TG_OUT_CURVE, lib.TG_OUT_CURVE_STD)
    for i, wheel in enumerate(vehicle.wheels):
        take(f"curve_a_{wheel}", lib.TG_OUT_WHEEL_CURVE, lib.TG_OUT_WHEEL_CURVE_STD, i)
    slots["warning"] = lib.TG_OUT_WARNING
    slots["warning_usual_slip"] = lib.TG_OUT_USUAL_SLIP
    for k, sign in enumerate(SIGNS):
        slots[f"warning_{sign}"] = lib.TG_OUT_SIGN + k
    slots["nis"] = lib.TG_OUT_NIS
    slots["channels"] = lib.TG_OUT_CHANNELS
    slots["supervisor"] = lib.TG_OUT_SUPERVISOR
    if adaptive:
        states = [f"{quantity}_{w}" for quantity in ("wheel_speed", "adhesion") for w in vehicle.wheels]
        states.insert(len(vehicle.wheels), "ground_speed")
        for j, state in enumerate((*states, "soil_resistance")):
            slots[f"adaptation_{state}"] = lib.TG_OUT_ADAPTATION + j
    return slots


def _is_smoothed(slot: int) -> bool:
    """Whether tg_estimator_smooth writes a place of tg_estimate.value; the others keep what the forward pass found."""
    return bool(slot < lib.TG_OUT_VERTICAL_LOAD and not lib.TG_OUT_NIS <= slot <= lib.TG_OUT_DISTANCE)


class Engine:
    """One tg_estimator. ``settings`` is a tg_settings structure; raises InputError if the kernel refuses it.

    ``slots_in`` and ``slots_out``: the places in tg_sample.value and tg_estimate.value of the columns it works with.
    """

    def __init__(self, settings: Any, slots_in: Mapping[str, int], slots_out: Mapping[str, int]) -> None:
        self.slots_in, self._slots_out = dict(slots_in), dict(slots_out)
        self._used = 1 + max(self._slots_out.values())
        self.inputs = tuple(self.slots_in)
        self.outputs = tuple(self._slots_out)
        self.filtered_only = tuple(name for name, slot in self._slots_out.items() if not _is_smoothed(slot))
        self._size = lib.tg_estimator_size(settings.tuning.policy)
        self._memory = ffi.new("char[]", self._size + 64)
        address = int(ffi.cast("uintptr_t", self._memory))
        self.handle = ffi.cast("tg_estimator *", address + -address % 64)  # lives as long as this object
        status = lib.tg_estimator_init(self.handle, settings)
        if status != lib.TG_OK:
            raise InputError(
                f"the estimator cannot work with this vehicle ({_STATUS.get(status, status)})",
                hint="check masses, inertias, radii and sensors in the vehicle file",
            )
        self.sample = ffi.new("tg_sample *")
        self.estimate = ffi.new("tg_estimate *")
        self.index_out = self._slots_out
        names: list[Any] = [None] * lib.TG_SLOTS  # no sample has a column None
        for name, slot in self.slots_in.items():
            names[slot] = name
        self._names = tuple(names)
        real = ffi.sizeof("tg_real")
        self._doubles = real == ffi.sizeof("double")  # else the kernel in single precision, as tests have it
        self._pack = struct.Struct(f"=d{lib.TG_SLOTS}{'d' if self._doubles else 'f'}").pack_into
        self._room_in = ffi.buffer(self.sample)
        self._room_out = ffi.buffer(self.estimate.value, real * self._used)

    def update(self, time: float, sample: Mapping[str, Any]) -> int:
        """Take a sample and fill ``self.estimate``; returns tg_status. Raises struct.error on what is no number."""
        self._pack(self._room_in, 0, time, *map(sample.get, self._names, _MISSING))
        status: int = lib.tg_estimator_update(self.handle, self.sample, self.estimate)
        return status

    def packed(self) -> bytes:
        """A copy of the numbers in ``self.estimate``: doubles, a column of `outputs` at each place of ``index_out``."""
        if not self._doubles:
            return array("d", ffi.unpack(self.estimate.value, self._used)).tobytes()
        found: bytes = self._room_out[:]
        return found

    def run(
        self,
        time: Floats,
        columns: Mapping[str, Floats],
        out: Mapping[str, Floats],
        event: npt.NDArray[np.uint8],
        progress: Callable[[int], None] | None = None,
    ) -> None:
        """Take rows of contiguous columns (n,) and write those of ``out`` (n,) and the event codes.

        ``progress`` is called with the rows done. Raises InputError with the row where the kernel refuses one; the rows before it
        have been taken.
        """
        rows = len(time)
        sources = {self.slots_in[name]: values for name, values in columns.items()}
        targets = {self._slots_out[name]: values for name, values in out.items()}
        done = ffi.new("size_t *")
        for first in range(0, rows, _BLOCK):
            last = min(first + _BLOCK, rows)
            places_in = _pointers(sources, lib.TG_SLOTS, first)
            places_out = _pointers(targets, lib.TG_OUT_SLOTS, first)
            status = lib.tg_estimator_block(
                self.handle,
                last - first,
                _pointer(time, first),
                places_in,
                places_out,
                ffi.cast("uint8_t *", event.ctypes.data + first),
                done,
            )
            if status != lib.TG_OK:
                raise refusal(status, f"row {first + done[0] + 1}")
            if progress is not None:
                progress(last)

    def smooth_carry(self) -> Floats:
        """Room for what smoothing carries from block to block."""
        return np.zeros(lib.tg_smooth_carry(self.handle))

    def record(self, time: Floats, columns: Mapping[str, Floats]) -> Floats:
        """Take rows and return their records (n, length), for `smooth`."""
        records = np.empty((len(time), lib.tg_smooth_length(self.handle)))
        sources = _pointers({self.slots_in[k]: v for k, v in columns.items()}, lib.TG_SLOTS, 0)
        status = lib.tg_estimator_record(
            self.handle, len(time), _pointer(time, 0), sources, _pointer(records, 0)
        )
        if status != lib.TG_OK:
            raise refusal(status, None)
        return records

    def smooth(
        self, records: Floats, following: Floats | None, carry: Floats, out: Mapping[str, Floats]
    ) -> None:
        """Overwrite ``out`` by the smoothed values; ``following`` is the record behind the last row."""
        targets = _pointers({self._slots_out[k]: v for k, v in out.items()}, lib.TG_OUT_SLOTS, 0)
        behind = ffi.NULL if following is None else _pointer(following, 0)
        status = lib.tg_estimator_smooth(
            self.handle, len(records), _pointer(records, 0), behind, _pointer(carry, 0), targets
        )
        if status != lib.TG_OK:
            raise refusal(status, None)

    def new_ground(self) -> None:
        """Forget the adhesion curves: the ground is another one."""
        lib.tg_estimator_new_ground(self.handle)

    def snapshot(self) -> bytes:
        """The estimator as bytes that continue bit for bit."""
        size = lib.tg_snapshot_size(self.handle)
        data = ffi.new("uint8_t[]", size)
        lib.tg_estimator_snapshot(self.handle, data)
        return bytes(ffi.buffer(data, size))

    def restore(self, data: bytes) -> None:
        """Continue from a snapshot; raises InputError if it is damaged or another kernel's."""
        status = lib.tg_estimator_restore(
            self.handle, self._size, ffi.from_buffer("uint8_t[]", data), len(data)
        )
        if status != lib.TG_OK:
            raise refusal(status, None)


_STATUS = {
    1: "a count or a constant is out of range",
    2: "a number is infinite or missing",
    3: "a number that must be positive is not",
    4: "time does not run forward",
    5: "the estimate left the finite numbers",
    6: "the snapshot is damaged, or of another version or machine",
}
_MEND = {
    2: "leave a value that was not measured empty (NaN)",
    4: "give samples in the order of time, each instant once",
    6: "start a new estimator",
}


def refusal(status: int, place: str | None) -> InputError:
    """The error for a tg_status that a sample or a snapshot came back with."""
    return InputError(_STATUS.get(status, f"status {status}"), place=place, hint=_MEND.get(status))


def settings_of(
    vehicle: Vehicle,
    method: Method,
    *,
    noise: Mapping[str, float],
    held: Mapping[str, float],
    channels: Collection[str],
    thresholds: Thresholds,
) -> Any:
    """A tg_settings for the vehicle.

    ``noise``: SD of each channel the estimator looks at, SI. ``held``: update period [s] of held channels.
    ``channels``: the columns that samples will carry, which tells whether a drawbar force and the torque of an
    undriven wheel are measured.
    """
    settings = ffi.new("tg_settings *", lib.tg_default_settings())
    settings.method = method.kind
    settings.tuning.engine = method.engine
    settings.tuning.policy = method.policy
    settings.tuning.supervisor = method.supervisor
    settings.axles = len(vehicle.axle_names)
    settings.towing = "drawbar_force" in channels
    _set_wheels(settings, vehicle, channels)
    lib.tg_tune_walks(settings)
    _set_loads(settings, vehicle)
    _set_calibration(settings, vehicle)
    _set_uncertainty(settings, vehicle, "pitch" in channels)
    for name, slot in sample_slots(vehicle).items():
        settings.noise[slot] = noise.get(name, 0.0)
        settings.held_period[slot] = held.get(name, 0.0)
    thresholds.put(settings)
    return settings


def _set_wheels(settings: Any, vehicle: Vehicle, channels: Collection[str]) -> None:
    machine = settings.machine
    machine.wheels = len(vehicle.wheels)
    machine.mass = vehicle.mass
    machine.gravity = GRAVITY
    machine.tire_rolling_resistance = vehicle.tire_rolling_resistance
    arms, rolling = wheel_radii(vehicle)
    for i, wheel in enumerate(vehicle.wheels):
        machine.radius[i] = arms[i]
        settings.rolling_radius[i] = rolling[i]
        machine.inertia[i] = vehicle.wheel_inertia[i]
        machine.bearing_resistance[i] = vehicle.bearing_resistance
        settings.wheel_axle[i] = vehicle.wheel_axle[i]
        settings.powered[i] = bool(vehicle.driven[i])
        settings.driven[i] = bool(vehicle.driven[i]) or f"drive_torque_{wheel}" in channels


def wheel_radii(vehicle: Vehicle) -> tuple[Floats, Floats]:
    """Torque arm and rolling radius of each wheel (n,) [m] under its static load (physics.md 4)."""
    arms, rolling = np.array(vehicle.wheel_radius), np.array(vehicle.wheel_radius)
    counts = np.bincount(vehicle.wheel_axle)
    for i, wheel in enumerate(vehicle.wheel_data):
        axle = vehicle.wheel_axle[i]
        deflection = _deflection(
            wheel, float(arms[i]), GRAVITY * float(vehicle.axle_mass[axle]) / counts[axle]
        )
        if deflection > 0:
            loaded = loaded_radius(arms[i], deflection)
            arms[i], rolling[i] = loaded, rolling_radius(arms[i], loaded)
    return arms, rolling


def _deflection(wheel: Wheel, radius: float, load: float) -> float:
    model = wheel.radius_model
    if isinstance(model, HadekelRadius):
        found = hadekel_deflection(
            load, unloaded_radius=radius, width=wheel.width or 0.0, inflation_pressure=model.pressure
        )
    elif isinstance(model, BidermanRadius):
        found = biderman_deflection(
            load, inflation_pressure=model.pressure, carcass_pressure=model.p0, c1=model.C1, c2=model.C2
        )
    else:
        return 0.0
    if found >= 0.5 * radius:
        raise InputError(
            f"the radius model deflects a tire of {radius:g} m by {float(found):.3g} m",
            place="wheel.radius_model",
            hint="check its pressure and constants",
        )
    return float(found)


def _set_loads(settings: Any, vehicle: Vehicle) -> None:
    """Shares and levers of the load formulas (physics.md 3), as physics.loads.axle_loads has them."""
    position, mass = vehicle.axle_to_rear, vehicle.axle_mass
    offset = position - position.mean()
    lever = offset / np.sum(offset**2) if len(mass) > 1 else np.zeros(1)
    for k in range(len(mass)):
        settings.load_share[k] = mass[k] / mass.sum()
        settings.load_transfer[k] = lever[k]
    settings.center_of_gravity_height = vehicle.center_of_gravity_height
    settings.hitch_height = vehicle.hitch_height
    place = 0
    for axle in vehicle.axles.values():
        count = len(axle.wheels)
        shares = np.full((2, count), 1 / count)
        if vehicle.track:
            shares = lateral_shares(
                count,
                [0.0, 1.0],
                center_of_gravity_height=vehicle.center_of_gravity_height,
                track=vehicle.track,
            )
        for level, leaning in zip(shares[0], shares[1], strict=True):
            settings.wheel_share[place] = level
            settings.lateral_share[place] = level - leaning
            place += 1
    for i, side in enumerate(wheel_sides(vehicle)):
        settings.wheel_side[i] = side


def wheel_sides(vehicle: Vehicle) -> Floats:
    """Distance of each wheel (n,) [m] from the vehicle's middle, left positive; 0 without a track."""
    half = (vehicle.track or 0.0) / 2
    counts = [len(axle.wheels) for axle in vehicle.axles.values()]
    return np.concatenate([np.linspace(half, -half, n) if n > 1 else np.zeros(1) for n in counts])


def _set_calibration(settings: Any, vehicle: Vehicle) -> None:
    for i in range(len(vehicle.wheels)):
        settings.gain[lib.TG_DRIVE_TORQUE + i] = vehicle.drive_torque_gain[i]
        settings.offset[lib.TG_DRIVE_TORQUE + i] = vehicle.drive_torque_offset[i]
    settings.offset[lib.TG_DRAWBAR_FORCE] = vehicle.calibration.drawbar_offset
    settings.offset[lib.TG_ACCELERATION_X] = vehicle.calibration.acceleration_bias_x
    settings.offset[lib.TG_PITCH] = vehicle.calibration.pitch_offset


_SENSED_SLOPE = np.deg2rad(0.2)  # SD of a pitch sensor's mounting, where the vehicle file does not say


def _set_uncertainty(settings: Any, vehicle: Vehicle, pitch_measured: bool) -> None:
    """The vehicle file's spreads. A measured pitch leaves only its mounting unknown, not the slope."""
    given = vehicle.uncertainty
    spread = settings.uncertainty
    for name in (
        "drive_torque_gain",
        "drive_torque_gain_common",
        "drive_torque_offset",
        "drawbar_gain",
        "drawbar_offset",
        "tire_rolling_resistance",
        "vertical_load",
        "wheel_radius",
        "acceleration_bias",
    ):
        setattr(spread, name, getattr(given, name) or 0.0)
    slope = given.slope or 0.0
    spread.slope = min(slope, _SENSED_SLOPE) if pitch_measured and given.slope is not None else slope


def _pointer(values: Floats, first: int) -> Any:
    return ffi.cast("double *", values.ctypes.data + 8 * first)


def _pointers(columns: Mapping[int, Floats], slots: int, first: int) -> Any:
    places: Sequence[Any] = [_pointer(columns[k], first) if k in columns else ffi.NULL for k in range(slots)]
    return ffi.new("double *[]", places)
