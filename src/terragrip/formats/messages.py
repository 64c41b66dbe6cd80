"""Messages of topics as signals: every number in a message by topic and field, ``/odom.twist.twist.linear.x``.

Arrays of up to 16 numbers give ``field[0]`` and so on; where the message has a list ``name`` of the same length, as a
JointState has, ``velocity.front_left`` in place of ``velocity[0]``. Covariances are left out.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.boundary import DAMAGE
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import EVERY, Wanted, skips

_LONGEST_ARRAY = 16  # numbers of a list beyond which none is a signal
_LONGEST_LIST = 8  # messages of a list beyond which none is one
_DEEPEST = 8
_BLOCK = 1000  # messages that are read or left out together, where a log is looked at in parts
_OTHER_CLOCK = 1.0  # s between stamp and receipt from which the sender's clock is another one
_TRIED = 20  # messages without a wanted field after which a topic has none: the first may be empty
_QUICKEST = 0.05  # quantile of the delay that counts as no delay, and share of stamps that may be far from it
_STAMPED = 0.9  # of a topic's messages
_PACE = 0.005  # of a clock's own, that no quartz is off by; nor does one run that makes no more
_BURST = 0.1  # of the time between two stamps: receipts that are closer came late, together
_NUMBER = (bool, int, float, np.number, np.bool_)
_PLAIN = frozenset({bool, int, float, str})

Parts = Callable[[Any], Iterable[tuple[str, Any]]]
"""Gives a message's fields as (name, value), or nothing for a value that is no message."""
Fields = dict[str, Any]
Decode = Callable[[bytes], tuple[float | None, Fields]]
"""Gives of a message's bytes the sender's stamp [s], None where it has none, and its fields (`flat`); raises one of `DAMAGE`."""


def flat(message: Any, parts: Parts, topic: str) -> Fields:
    """The numbers and texts of a message by topic and field."""
    own = list(parts(message))
    labels = next((value for key, value in own if key == "name" and isinstance(value, list | tuple)), ())
    if not all(isinstance(label, str) for label in labels):
        labels = ()
    fields: Fields = {}

    def walk(value: Any, name: str, depth: int) -> None:
        if isinstance(value, (*_NUMBER, str)):
            fields[name] = value
        elif isinstance(value, np.ndarray | list | tuple):
            entries = value.tolist() if isinstance(value, np.ndarray) else value
            if entries and not isinstance(entries[0], str):
                if len(entries) > (_LONGEST_ARRAY if isinstance(entries[0], _NUMBER) else _LONGEST_LIST):
                    return
                is_named = len(labels) == len(entries) and depth == 1
                for k, entry in enumerate(entries):
                    walk(entry, f"{name}.{labels[k]}" if is_named else f"{name}[{k}]", depth + 1)
        elif depth < _DEEPEST:
            of_fields(parts(value), name, depth)

    def of_fields(items: Iterable[tuple[str, Any]], name: str, depth: int) -> None:
        for key, part in items:
            if type(part) in _PLAIN:
                fields[f"{name}.{key}"] = part
            else:
                walk(part, f"{name}.{key}", depth + 1 + key.count("."))

    if own:
        of_fields(own, topic, 0)
    else:
        walk(message, topic, 0)
    return fields


def kept(items: Iterable[tuple[str, Any]]) -> list[tuple[str, Any]]:
    """The fields that may be signals."""
    left_out = ("frame_id", "child_frame_id")
    return [(name, value) for name, value in items if name not in left_out and "covariance" not in name]


@dataclass
class _Column:
    """The values of a wanted field so far."""

    is_text: bool
    numbers: array[float] = field(default_factory=lambda: array("d"))
    texts: list[str | None] = field(default_factory=list)

    def add(self, value: Any) -> bool:
        """Add a value; whether it is there, and of the column's kind."""
        if self.is_text:
            known = isinstance(value, str)
            self.texts.append(value if known else None)
            return known
        try:
            self.numbers.append(value)
        except (TypeError, OverflowError):  # JSON has integers of any size
            self.numbers.append(np.nan)
            return False
        return True

    def values(self, count: int) -> np.ndarray:
        """The values (count,): of a column that a later message brought there are none before."""
        # A view: the samples of a long log shall not stand twice.
        values = np.array(self.texts, dtype=object) if self.is_text else np.frombuffer(self.numbers)
        missing = count - len(values)
        return np.r_[np.full(missing, None if self.is_text else np.nan), values] if missing else values


@dataclass
class Topic:
    """Collects the wanted fields of one topic's messages.

    ``bad``: messages that cannot be read; ``strange``: values that are not there, or of another kind than in the first message.
    """

    name: str
    wanted: Wanted = EVERY
    names: dict[str, None] = field(default_factory=dict)
    count: int = 0
    bad: int = 0
    strange: int = 0
    _receipts: array[float] = field(default_factory=lambda: array("d"))
    _stamps: array[float] = field(default_factory=lambda: array("d"))
    _columns: dict[str, _Column] = field(default_factory=dict)

    @property
    def is_wanted(self) -> bool:
        """Whether any field is wanted; True until some messages have shown which there are."""
        return bool(self._columns) or self.count < _TRIED

    def push(self, receipt: float, content: bytes, decode: Decode) -> None:
        """Take a message that came at ``receipt`` [s]; one that cannot be read is counted."""
        if self._columns and skips(self.count, _BLOCK, self.wanted):
            self.count += 1
            return
        try:
            sent, fields = decode(content)
        except DAMAGE:
            self.bad += 1
            return
        self.count += 1
        for name, value in fields.items():
            if name not in self.names:
                self.names[name] = None
                if self.wanted(name):
                    self._columns[name] = _Column(isinstance(value, str))
        if self._columns:
            self._receipts.append(receipt)
            self._stamps.append(sent or np.nan)
            for name, column in self._columns.items():
                self.strange += not column.add(fields.get(name))

    def signals(self) -> tuple[dict[str, Signal], list[str]]:
        """The signals collected, and sentences on them."""
        notes = []
        if self.strange:
            notes.append(
                f"{self.name}: {self.strange} values are absent, or of another type than in the first message."
            )
        if self.bad:
            notes.append(f"{self.name}: {self.bad} messages cannot be read and were left out.")
        time, remarks = self._time()
        fields = {name: Signal(time, column.values(len(time))) for name, column in self._columns.items()}
        return fields, [*notes, *remarks]

    def _time(self) -> tuple[np.ndarray, list[str]]:
        """When the values were measured: the sender's stamps where there are, on the receiver's clock."""
        receipts, stamps = np.frombuffer(self._receipts), np.frombuffer(self._stamps)
        known = np.isfinite(stamps)
        if not known.any() or known.mean() < _STAMPED:
            return receipts, []
        delay = receipts - stamps
        typical = float(np.median(delay[known]))
        delay = np.where(known, delay, typical)
        stamps = np.where(
            known, stamps, receipts - typical
        )  # a stamp of 0 is none, or where simulated time begins
        far = np.abs(delay - typical) > _OTHER_CLOCK
        if far.mean() > _QUICKEST and not _in_bursts(receipts, stamps):
            apart = float(np.ptp(delay))
            pace, start = np.polyfit(receipts[known] - receipts[0], stamps[known], 1)
            rest = stamps[known] - pace * (receipts[known] - receipts[0]) - start
            runs = pace > _PACE and abs(pace - 1) > _PACE
            simulated = (
                f" They run {pace:.3g} times as fast, as simulated time does: speeds and accelerations need it, so record with "
                "'ros2 bag record --use-sim-time'."
            )
            return receipts, [
                f"{self.name}: its stamps drift by {apart:.3g} s against the recorder's clock; the times of receipt are used."
                + simulated * bool(runs and np.ptp(rest) < _OTHER_CLOCK)
            ]
        if abs(typical) <= _OTHER_CLOCK:
            return stamps, []
        offset = float(np.quantile(delay, _QUICKEST))
        instant = (
            f"{self.name} is stamped {offset:.3f} s off the recorder's clock; the stamps were shifted to it."
        )
        return stamps + offset, [instant]


def _in_bursts(receipts: np.ndarray, stamps: np.ndarray) -> bool:
    """Whether messages (n,) waited for each other on their way, so that the stamps say better when they were sent."""
    usual = float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    return usual > 0 and float(np.mean(np.diff(receipts) < _BURST * usual)) > _QUICKEST


def log_of(topics: Iterable[Topic], path: str, notes: list[str], files: Iterable[Path] = ()) -> SignalLog:
    """The signals of all topics; raises InputError if no message could be read."""
    result: dict[str, Signal] = {}
    names: dict[str, None] = {}
    topics, remarks = list(topics), list(notes)
    for topic in topics:
        signals, own = topic.signals()
        result |= signals
        remarks += own
        names |= topic.names
    if not any(topic.count for topic in topics):
        bad = sum(topic.bad for topic in topics)
        problem = f"has no readable message ({bad} are unreadable)" if bad else "holds no message"
        raise InputError(
            f"{problem}{'; ' + remarks[0] if remarks else ''}", file=path, hint="check how it was recorded"
        )
    digest = "+".join(sha256(file) for file in files) or None
    return SignalLog(tuple(names), result, sha256=digest, notes=tuple(remarks))
