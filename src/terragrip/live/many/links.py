"""Sources and sinks of many vehicles: each is one connection, whose topics name the vehicle."""

from __future__ import annotations

from collections.abc import Sequence

from terragrip.errors import InputError
from terragrip.live.links import Sink, open_sink
from terragrip.live.many.vehicles import Vehicles
from terragrip.live.topics import VEHICLE, VehicleTopics, refuse_echo
from terragrip.live.uri import Uri

_BY_TOPIC = ("mqtt", "mqtts", "zenoh")


class Router:
    """What a source feeds (as it does a `Feed`): its messages go to the vehicle that their topic names."""

    def __init__(self, index: int, text: str, vehicles: Vehicles) -> None:
        self.name = text.split("?", 1)[0]
        self.is_connected = False
        self.why_lost = "is not connected yet"
        self._index, self._vehicles = index, vehicles
        self._has_lost = False

    def message(self, data: bytes, arrival: float | None = None, *, topic: str | None = None) -> None:
        """A message as bytes; those of a source without topics belong to no vehicle."""
        self._vehicles.message(self._index, data, topic or "")

    def dropped(self, number: int) -> None:
        """Messages were dropped before it was known whose they are."""
        self._vehicles.journal.event("behind", self.name, f"{number} messages dropped unread")

    def connected(self) -> None:
        """The source has its other side (again)."""
        self.is_connected = True
        if self._has_lost:
            self._has_lost = False
            self._vehicles.journal.event("source_back", self.name, "connected again")

    def lost(self, why: str) -> None:
        """The source lost its other side."""
        self.is_connected, self.why_lost = False, why
        if not self._has_lost:
            self._has_lost = True
            self._vehicles.journal.event("source_lost", self.name, why)


def check_sources(sources: Sequence[str]) -> list[VehicleTopics]:
    """The topics of the sources; raises InputError where one cannot tell vehicles apart."""
    for text in sources:
        if text.partition(":")[0].lower() not in _BY_TOPIC:
            raise InputError(
                "cannot tell vehicles apart", place=f"--source {text}", hint=f"write mqtt://HOST/field/{VEHICLE}/sample, or zenoh:"
            )  # fmt: skip
    return [VehicleTopics(text) for text in sources]


def open_sinks(sinks: Sequence[str], sources: Sequence[VehicleTopics]) -> list[tuple[Uri, Sink]]:
    """The sinks; raises InputError where one cannot tell vehicles apart, or what it sends would come back by a source."""
    result = []
    for text in sinks:
        scheme = text.partition(":")[0].lower()
        if scheme in _BY_TOPIC:
            VehicleTopics(text)
            refuse_echo(text, (source.text for source in sources))
        elif scheme != "studio":
            raise InputError(
                "cannot tell vehicles apart", place=f"--sink {text}", hint=f"write mqtt://HOST/field/{VEHICLE}, zenoh: or studio:"
            )  # fmt: skip
        result.append(open_sink(text, None, ()))
    return result
