"""The kernel's estimator for Python: settings from a vehicle, columns in, columns out."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip._kernel import ffi, lib
from terragrip.arrays import Floats
from terragrip.errors import InputError
from terragrip.vehicle import Vehicle

EVENTS = ("", "outlier", "standstill", "gap", "immobilization", "stuck", "push", "restart")
"""Texts of the ``event`` column, in the order of tg_event."""

SIGNS = ("rise", "high_slip", "leading", "resistance", "command")
"""The signs of the warning, columns ``warning_<sign>``, in the order of tg_sign."""
OF_FORCES = ("leading", "resistance")
"""Those of them that need torques."""

_MISSING = (math.nan,) * lib.TG_SLOTS
_BLOCK = 1 << 18  # rows a call: Ctrl-C and progress get a turn between calls


def twin_slots(quantity: str, columns: Sequence[str]) -> dict[str, int]:
    """The places of columns that hold a quantity of the kernel's, one behind the other, each with its twin ``_std``."""
    value, std = (getattr(lib, f"TG_OUT_{quantity.upper()}{end}") for end in ("", "_STD"))
    return {
        name: place + k
        for k, column in enumerate(columns)
        for name, place in ((column, value), (f"{column}_std", std))
    }


def estimate_slots(vehicle: Vehicle, *, adaptive: bool = False) -> dict[str, int]:
    """The place in tg_estimate.value of each column of an estimates table, in the table's order.

    ``adaptive``: with A_k, ``adaptation_<state>`` of each state, which the adaptive and the supervised policy have.
    """
    slots = {"distance": lib.TG_OUT_DISTANCE}
    slots |= twin_slots("ground_speed", ["ground_speed"]) | twin_slots("soil_resistance", ["soil_resistance"])
    for quantity in ("wheel_speed", "adhesion", "slip", "net_traction", "efficiency"):
        slots |= twin_slots(quantity, [f"{quantity}_{wheel}" for wheel in vehicle.wheels])
    for k, axle in enumerate(vehicle.axle_names):
        slots[f"vertical_load_{axle}"] = lib.TG_OUT_VERTICAL_LOAD + k
    slots |= twin_slots("curve", ["curve_a"])
    slots |= twin_slots("wheel_curve", [f"curve_a_{wheel}" for wheel in vehicle.wheels])
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
        self.slots_in, self.slots_out = dict(slots_in), dict(slots_out)
        self._used = 1 + max(self.slots_out.values())
        self.inputs = tuple(self.slots_in)
        self.filtered_only = tuple(name for name, slot in self.slots_out.items() if not _is_smoothed(slot))
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
        names: list[Any] = [None] * lib.TG_SLOTS  # no sample has a column None
        for name, slot in self.slots_in.items():
            names[slot] = name
        self._names = tuple(names)
        single = ffi.sizeof("tg_real") < ffi.sizeof("double")  # the kernel that tests have
        self._pack = struct.Struct(f"=d{lib.TG_SLOTS}{'f' if single else 'd'}").pack_into
        self._room_in = ffi.buffer(self.sample)

    @property
    def standstill_speed(self) -> float:
        """Below it vehicle and wheels count as standing [m/s]: as it was set, else by the machine's size."""
        return float(self.settings().standstill_speed)

    def settings(self) -> Any:
        """A copy of the tg_settings in use."""
        settings = ffi.new("tg_settings *")
        lib.tg_estimator_settings(self.handle, settings)
        return settings

    def update(self, time: float, sample: Mapping[str, Any]) -> int:
        """Process a sample into ``self.estimate``; returns tg_status. Raises struct.error on what is no number."""
        self._pack(self._room_in, 0, time, *map(sample.get, self._names, _MISSING))
        status: int = lib.tg_estimator_update(self.handle, self.sample, self.estimate)
        return status

    def values(self) -> list[float]:
        """The numbers in ``self.estimate``, a column at each of the places of ``slots_out``."""
        result: list[float] = ffi.unpack(self.estimate.value, self._used)
        return result

    def run(
        self,
        time: Floats,
        columns: Mapping[str, Floats],
        out: Mapping[str, Floats],
        event: npt.NDArray[np.uint8],
        progress: Callable[[int], None] | None = None,
    ) -> None:
        """Process rows of contiguous columns (n,) and write those of ``out`` (n,) and the event codes.

        ``progress`` is called with the rows done. Raises InputError with the row where the kernel refuses one; the rows before it
        have been taken.
        """
        rows = len(time)
        sources = {self.slots_in[name]: values for name, values in columns.items()}
        targets = {self.slots_out[name]: values for name, values in out.items()}
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
            _require(status, f"row {first + done[0] + 1}")
            if progress is not None:
                progress(last)

    def smooth_carry(self) -> Floats:
        """Storage for what smoothing passes from block to block."""
        return np.zeros(lib.tg_smooth_carry(self.handle))

    def record(self, time: Floats, columns: Mapping[str, Floats]) -> Floats:
        """Process rows and return their records (n, length), for `smooth`."""
        records = np.empty((len(time), lib.tg_smooth_length(self.handle)))
        sources = _pointers({self.slots_in[k]: v for k, v in columns.items()}, lib.TG_SLOTS, 0)
        _require(
            lib.tg_estimator_record(self.handle, len(time), _pointer(time, 0), sources, _pointer(records, 0))
        )
        return records

    def smooth(
        self, records: Floats, following: Floats | None, carry: Floats, out: Mapping[str, Floats]
    ) -> None:
        """Overwrite ``out`` by the smoothed values; ``following`` is the record behind the last row."""
        targets = _pointers({self.slots_out[k]: v for k, v in out.items()}, lib.TG_OUT_SLOTS, 0)
        behind = ffi.NULL if following is None else _pointer(following, 0)
        rows = len(records)
        _require(
            lib.tg_estimator_smooth(
                self.handle, rows, _pointer(records, 0), behind, _pointer(carry, 0), targets
            )
        )

    def set_noise(self, settings: Any) -> None:
        """From the next sample on, the noise and the update periods of these settings; raises InputError on unusable ones."""
        _require(lib.tg_estimator_set_noise(self.handle, settings.noise, settings.held_period))

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
        bytes_of = ffi.from_buffer("uint8_t[]", data)
        _require(lib.tg_estimator_restore(self.handle, self._size, bytes_of, len(data)))


_STATUS = {
    1: "a count or a constant is out of range",
    2: "a number is infinite or missing",
    3: "a number that must be positive is not",
    4: "time does not increase",
    5: "the estimate is no longer finite",
    6: "the snapshot is damaged, or of another version or machine",
}
_HINTS = {
    2: "leave a value that was not measured empty (NaN)",
    4: "give samples in the order of time, each instant once",
    6: "start a new estimator",
}


def refusal(status: int, place: str | None) -> InputError:
    """The error for the tg_status of a refused sample or snapshot."""
    return InputError(_STATUS.get(status, f"status {status}"), place=place, hint=_HINTS.get(status))


def _require(status: int, place: str | None = None) -> None:
    if status != lib.TG_OK:
        raise refusal(status, place)


def _pointer(values: Floats, first: int) -> Any:
    return ffi.cast("double *", values.ctypes.data + 8 * first)


def _pointers(columns: Mapping[int, Floats], slots: int, first: int) -> Any:
    places: Sequence[Any] = [_pointer(columns[k], first) if k in columns else ffi.NULL for k in range(slots)]
    return ffi.new("double *[]", places)
