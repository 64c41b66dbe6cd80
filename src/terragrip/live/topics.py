"""Topics that name a vehicle at one level, ``field/{vehicle}/sample``, and those of sinks that a source would receive."""

from __future__ import annotations

import re
from collections.abc import Iterable

from terragrip.errors import InputError

VEHICLE = "{vehicle}"
_NAME = re.compile(r"\w([\w .-]{0,62}\w)?")
_KEPT = 10_000  # topics


def of_vehicle(prefix: str, name: str) -> str:
    """A topic with the vehicle's name in its place."""
    return prefix.replace(VEHICLE, name) if name else prefix


def is_name(text: str) -> bool:
    """Whether a vehicle may be called so: letters, digits, ``_ - .`` and blanks within, at most 64; good for a folder's name too."""
    return _NAME.fullmatch(text) is not None


def refuse_echo(sink: str, sources: Iterable[str]) -> None:
    """Raise InputError where what a sink sends would come back by one of the sources; each is a URI."""
    scheme, where, levels = _parts(sink)
    sent = [*(level for level in levels if level), "estimate"]
    for source in sources:
        by, there, wanted = _parts(source)
        if (by, there) == (scheme, where) and (scheme == "udp" or _covers(wanted, sent)):
            raise InputError(
                f"its messages would come back by {source}", place=f"--sink {sink}",
                hint="give it another prefix, or another topic to the source",
            )  # fmt: skip


def _parts(text: str) -> tuple[str, str, list[str]]:
    """Scheme, host and the levels of the topic of a URI."""
    scheme, _, rest = text.partition(":")
    where, path = "", rest.split("?", 1)[0]
    if path.startswith("//"):
        where, _, path = path[2:].partition("/")
    return scheme.lower(), where.replace("localhost", "127.0.0.1").removesuffix(":1883"), path.split("/")


def _covers(wanted: list[str], sent: list[str]) -> bool:
    """Whether a topic with wild cards of MQTT or Zenoh is also the one that is sent to."""
    if not wanted or wanted[0] in ("#", "**"):
        return not sent if not wanted else any(_covers(wanted[1:], sent[k:]) for k in range(len(sent) + 1))
    alike = bool(sent) and (wanted[0] in ("+", "*", VEHICLE, sent[0]) or sent[0] == VEHICLE)
    return alike and _covers(wanted[1:], sent[1:])


class VehicleTopics:
    """The topics of a source. ``text``: its URI. Raises InputError unless ``{vehicle}`` is one whole level of the topic, once."""

    def __init__(self, text: str) -> None:
        self.text = text
        scheme, _, levels = _parts(text)
        if levels.count(VEHICLE) != 1 or text.count(VEHICLE) != 1:
            raise InputError(
                f"{VEHICLE} is not one whole level of the topic", place=text, hint=f"write mqtt://HOST/field/{VEHICLE}/sample"
            )  # fmt: skip
        self._levels, self._level = levels, levels.index(VEHICLE)
        self._one = "*" if scheme == "zenoh" else "+"
        self._known: dict[str, tuple[str, str]] = {}

    @property
    def subscription(self) -> str:
        """The URI with a wild card for the vehicle."""
        return self.text.replace(VEHICLE, self._one)

    def named(self, name: str) -> str:
        """The source as the vehicle's own service would call it: without options."""
        return self.text.split("?", 1)[0].replace(VEHICLE, name)

    def split(self, topic: str) -> tuple[str, str]:
        """The vehicle's name, and the topic with ``{vehicle}`` in its place, by which a profile may ask for it."""
        known = self._known.get(topic)
        if known is None:
            levels = topic.split("/")
            name = levels[self._level] if len(levels) > self._level else ""
            general = "/".join([*levels[: self._level], VEHICLE, *levels[self._level + 1 :]])
            if len(self._known) >= _KEPT:
                self._known.clear()
            known = self._known[topic] = name, general
        return known
