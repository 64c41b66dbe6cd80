"""A CAN bus by python-can: frames in, by DBC files and the built-in table of J1939 and ISO 11783; estimates out, by terragrip.dbc."""

from __future__ import annotations

import asyncio
import errno
import math
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from terragrip.errors import InputError, missing_package
from terragrip.estimation.driveline import DRIVEN
from terragrip.estimation.engine import EVENTS
from terragrip.estimation.estimator import Estimate
from terragrip.estimation.rims import DRIVE
from terragrip.ground.classification.labels import UNKNOWN
from terragrip.live.decode import Decoder
from terragrip.live.feed import Feed, Lost
from terragrip.live.frame_decoder import FrameDecoder
from terragrip.live.message import GROUND, SOIL, Message
from terragrip.live.outbox import Outbox
from terragrip.live.outputs import Row
from terragrip.live.thread_bridge import ThreadBridge, repeated_in_thread
from terragrip.live.uri import Uri

if TYPE_CHECKING:
    from terragrip.vehicle import Vehicle

INTERFACES = ("socketcan", "vector", "virtual", "pcan", "kvaser", "slcan", "ixxat", "udp_multicast")
_PATIENCE = 0.2  # s
_AT_ONCE = 64  # frames
_BATCHES = 256
DBC = Path(__file__).parents[1] / "terragrip.dbc"
RATE = "10"  # Hz: nine frames a row on four wheels, which is 5 % of 250 kbit/s
_MOST = 8  # wheels

_VEHICLE = {
    "GroundSpeed": "ground_speed",
    "GroundSpeedStd": "ground_speed_std",
    "SoilResistance": "soil_resistance",
    "SoilResistanceStd": "soil_resistance_std",
}
_WHEEL = {
    "TG_Wheel": {"Slip": "slip", "Adhesion": "adhesion"},
    "TG_Traction": {"NetTraction": "net_traction", "Efficiency": "efficiency"},
}


class CanSource:
    """``can:can0?interface=socketcan&dbc=machine.dbc``; several DBC files by commas. The profile's own are read too.

    A sample is stamped by the interface, which is on the machine's clock.
    """

    real_time = True

    def __init__(self, uri: Uri, decoder: Decoder) -> None:
        self.uri = uri
        check(uri)
        own = decoder.profile.dbc if decoder.profile is not None else ()
        databases = [name for name in uri.options.get("dbc", "").split(",") if name]
        wants = decoder.wants if decoder.profile is not None else lambda name: True
        self.frames = FrameDecoder([*databases, *own], wants)
        decoder.units = self.frames.units

    async def run(self, feed: Feed) -> None:
        """Feed frames; raises Lost where the bus is not there or goes away."""
        bridge = ThreadBridge(feed, _BATCHES)
        feed.one_layout = False

        def read(bus: Any) -> None:
            frame = bus.recv(_PATIENCE)
            batch: list[Any] = []
            while frame is not None and len(batch) < _AT_ONCE:
                batch.append(frame)
                frame = bus.recv(0.0)
            if frame is not None:
                batch.append(frame)
            if batch:
                bridge.call(self._feed, feed, batch)

        async with bus_of(self.uri) as bus:
            feed.connected()
            await repeated_in_thread(partial(read, bus))

    def _feed(self, feed: Feed, batch: list[Any]) -> None:
        for frame in batch:
            if frame.is_error_frame or frame.is_remote_frame:
                continue
            fields = self.frames.fields(frame.arbitration_id, frame.is_extended_id, bytes(frame.data))
            if fields:
                feed.fields({**fields, "time": frame.timestamp} if frame.timestamp > 0 else fields)
            else:
                feed.messages += 1


class CanSink:
    """``can:can0?interface=socketcan&rate=10``; wheels in the order of the vehicle file."""

    def __init__(self, uri: Uri, vehicle: Vehicle, *_: object) -> None:
        import cantools

        self.uri = uri
        check(uri)
        if len(vehicle.wheels) > _MOST:
            raise InputError(f"the DBC has {_MOST} wheels", place=uri.text, hint="use another sink")
        uri.options.setdefault("rate", RATE)
        self._database: Any = cantools.database.load_file(DBC)
        self._wheels = vehicle.wheels
        self._driven = vehicle.driven_wheels
        self._counter = 0
        self._change: tuple[float, float] | None = None  # time and probability of the last one

    async def run(self, outbox: Outbox) -> None:
        """Send frames; raises Lost where the bus goes away or takes nothing any more."""
        import can

        async with bus_of(self.uri) as bus:
            outbox.connected()
            while True:
                for identifier, data in self.frames_of(await outbox.get()):
                    bus.send(can.Message(arbitration_id=identifier, is_extended_id=True, data=data))

    def frames_of(self, message: Message) -> list[tuple[int, bytes]]:
        """Identifier and payload of each frame that a message becomes: of an estimate, and of what the ground is."""
        if message.row is not None:
            return self.frames(message.row)
        data = message.data or {}
        if message.kind == GROUND:
            self._change = (data["time"], data["probability"])
        return [self._ground(data)] if message.kind == SOIL else []

    def _ground(self, data: dict[str, Any]) -> tuple[int, bytes]:
        known = [name for name in data["probabilities"] if name != UNKNOWN]
        time, probability = self._change or (math.nan, math.nan)
        values = {
            "SoilNumber": 0 if data["soil"] not in known else 1 + known.index(data["soil"]),
            "SoilProbability": data["probability"],
            "ChangeProbability": probability,
            "ChangeAge": data["time"] - time,
        }
        return self._frame("TG_Ground", values)

    def frames(self, row: Row) -> list[tuple[int, bytes]]:
        """Identifier and payload of each frame of a row."""
        estimate = row.estimate
        values: dict[str, float] = {ours: _of(estimate, column) for ours, column in _VEHICLE.items()}
        values |= {
            "Event": EVENTS.index(estimate.event),
            "Predicted": row.predicted,
            "MessageCounter": self._counter,
        }
        self._counter = (self._counter + 1) % 251
        result = [self._frame("TG_Vehicle", values)]
        for message, quantities in _WHEEL.items():
            for number, wheel in enumerate(self._wheels, 1):
                values = {}
                for ours, quantity in quantities.items():
                    own = f"{quantity}_{wheel}"
                    if quantity == "slip" and own not in estimate.places and wheel in self._driven:
                        # the drive train's speed stands for all driven wheels, a sum of their forces does not
                        own = next(
                            (f"slip_{one}" for one in (DRIVE, DRIVEN) if f"slip_{one}" in estimate.places),
                            own,
                        )
                    values[f"{ours}{number}"] = _of(estimate, own)
                    values[f"{ours}Std{number}"] = _of(estimate, f"{own}_std")
                result.append(self._frame(f"{message}{number}", values))
        return result

    def _frame(self, name: str, values: dict[str, float]) -> tuple[int, bytes]:
        message = self._database.get_message_by_name(name)
        raw = {signal.name: _raw(signal, values[signal.name]) for signal in message.signals}
        return message.frame_id, message.encode(raw, scaling=False, strict=False)


def _of(estimate: Estimate, column: str) -> float:
    """A column of an estimate; missing where estimates have none such, as those of slip alone."""
    return float(estimate[column]) if column in estimate.places else math.nan


def _raw(signal: Any, value: float) -> int:
    """A signal's raw value, held within its range; all ones ("not available", J1939-71) where it is missing."""
    if math.isnan(value):
        return (1 << signal.length) - 1
    raw = round((value - signal.offset) / signal.scale)
    most = round((signal.maximum - signal.offset) / signal.scale)
    return min(max(raw, 0), most)


def check(uri: Uri) -> str:
    """The interface's name; raises InputError on a missing channel or an unknown interface."""
    _python_can()
    if not uri.path:
        raise InputError("names no channel", place=uri.text, hint="write can:can0")
    interface = uri.choice("interface", INTERFACES)
    if interface == "udp_multicast" and find_spec("msgpack") is None:
        raise missing_package("msgpack", "live", "use udp_multicast", place=uri.text)
    return interface


@asynccontextmanager
async def bus_of(uri: Uri) -> AsyncIterator[Any]:
    """The bus of ``can:can0?interface=socketcan&bitrate=250000``; raises Lost where it is not there or goes away."""
    can = _python_can()
    options: dict[str, Any] = {"interface": check(uri), "channel": uri.path}
    if "bitrate" in uri.options:
        options["bitrate"] = round(uri.number("bitrate", 250_000))
    try:
        bus = await asyncio.to_thread(can.Bus, **options)
    except (can.CanError, OSError, ValueError, ImportError, NotImplementedError) as error:
        if getattr(error, "errno", None) == errno.EAFNOSUPPORT:
            raise Lost(
                "the bus: this system has no SocketCAN: load can and can_raw, or give an interface"
            ) from error
        raise Lost(f"the bus: {' '.join(str(error).split())[:160]}") from error
    try:
        yield bus
    except (can.CanError, OSError) as error:
        raise Lost(f"the bus: {error}") from error
    finally:
        bus.shutdown()


def _python_can() -> Any:
    """python-can, which imports asammdf where it is installed, for a log format: 85 MB and 0.6 s that a live bus does not need."""
    hidden = not {"can", "asammdf"} & sys.modules.keys()
    if hidden:
        sys.modules["asammdf"] = None  # type: ignore[assignment]  # makes its import fail
    try:
        import can
    finally:
        if hidden:
            del sys.modules["asammdf"]
    return can
