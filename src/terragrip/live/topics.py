"""Topics that name a vehicle at one level: ``field/{vehicle}/sample``."""

from __future__ import annotations

import re

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


class VehicleTopics:
    """The topics of a source. ``text``: its URI. Raises InputError unless ``{vehicle}`` is one whole level of the topic, once."""

    def __init__(self, text: str) -> None:
        self.text = text
        self._scheme, _, rest = text.partition(":")
        where, path = "", rest.split("?", 1)[0]
        if path.startswith("//"):
            where, _, path = path[2:].partition("/")
        self._where, levels = where, path.split("/")
        if levels.count(VEHICLE) != 1 or text.count(VEHICLE) != 1:
            raise InputError(
                f"{VEHICLE} is not one whole level of the topic", place=text, hint=f"write mqtt://HOST/field/{VEHICLE}/sample"
            )  # fmt: skip
        self._levels, self._level = levels, levels.index(VEHICLE)
        self._one, self._any = ("*", "**") if self._scheme.lower() == "zenoh" else ("+", "#")
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

    def matches(self, sink: VehicleTopics) -> bool:
        """Whether what is sent one level below a sink's topics of the same server comes by this source."""
        if (self._scheme, self._where) != (sink._scheme, sink._where):
            return False
        sent = [*(level for level in sink._levels if level), "estimate"]
        for k, level in enumerate(self._levels):
            if level == self._any:
                return True
            if k >= len(sent) or (level not in (self._one, VEHICLE, sent[k]) and sent[k] != VEHICLE):
                return False
        return len(sent) == len(self._levels)
