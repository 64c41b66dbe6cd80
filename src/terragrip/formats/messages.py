"""Messages of topics as signals: every number in a message by topic and field, ``/odom.twist.twist.linear.x``.

Arrays of up to 16 numbers give ``field[0]`` and so on; where the message has a list ``name`` of the same length, as a
JointState has, ``velocity.front_left`` in place of ``velocity[0]``. Covariances are left out.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from terragrip.errors import InputError
from terragrip.files import sha256
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted, skips

LONGEST_ARRAY = 16
"""Numbers of a list beyond which none is a signal."""
LONGEST_LIST = 8
"""Messages of a list beyond which none is one."""
_DEEPEST = 8
BLOCK = 1000
"""Messages that are read or left out together, where a log is looked at in parts."""
_OTHER_CLOCK = 1.0  # s between stamp and receipt from which the sender's clock is another one
_TRIED = 20  # messages without a wanted field after which a topic has none: the first may be empty
_QUICKEST = 0.05  # quantile of the delay that counts as no delay, and share of stamps that may be far from it
_BURST = 0.1  # of the time between two stamps: receipts that are closer came late, together

Parts = Callable[[Any], Iterable[tuple[str, Any]]]
"""Gives a message's fields as (name, value), or nothing for a value that is no message."""
Path = tuple[str | int, ...]


@dataclass
class Column:
    """A wanted field: where it stands in a message, and its values so far."""

    path: Path
    is_text: bool
    numbers: array[float] = field(default_factory=lambda: array("d"))
    texts: list[str | None] = field(default_factory=list)


@dataclass
class Topic:
    """Collects the wanted fields of one topic's messages.

    ``parts`` gives the fields of a message; ``stamp`` the sender's time [s], if the message has one; ``field_of`` one field by
    name: it raises LookupError, TypeError or AttributeError where the field is not there.
    These three are for messages that come as objects; those of ROS come as bytes (`terragrip.formats.ros_topic`).
    ``strange``: values that are not there, or of another kind than in the first message.
    """

    name: str
    parts: Parts = lambda message: ()
    stamp: Callable[[Any], float | None] = lambda message: None
    wanted: Wanted | None = None
    field_of: Callable[[Any, str], Any] = dict.__getitem__
    names: tuple[str, ...] = ()
    count: int = 0
    bad: int = 0
    strange: int = 0
    _receipts: array[float] = field(default_factory=lambda: array("d"))
    _stamps: array[float] = field(default_factory=lambda: array("d"))
    _columns: dict[str, Column] = field(default_factory=dict)
    _labels: tuple[str, ...] | None = None
    _seen: set[str] = field(default_factory=set)

    @property
    def is_wanted(self) -> bool:
        """Whether any field is wanted; True until some messages have shown which there are."""
        return bool(self._columns) or self.count < _TRIED

    def add(self, receipt: float, message: Any) -> None:
        """Add a message that came at ``receipt`` [s]."""
        parts = dict(self.parts(message))
        labels, more = names_of_entries(parts), self._brings_more(parts)
        if not self._columns or more or labels != self._labels:
            self._learn(message, labels)
        self.count += 1
        if not self._columns or skips(self.count - 1, BLOCK, self.wanted):
            return
        sent = self.stamp(message)
        self._receipts.append(receipt)
        self._stamps.append(sent or np.nan)
        for column, value in zip(self._columns.values(), self._values(message), strict=True):
            if column.is_text:
                column.texts.append(value)
            else:
                column.numbers.append(value)

    def _values(self, message: Any) -> list[Any]:
        """The wanted fields of a message, in the order of the columns; what is not there is NaN or None, and counted."""
        values: list[Any] = []
        for column in self._columns.values():
            value = self._at(column.path, message)
            if column.is_text:
                known = isinstance(value, str)
                values.append(value if known else None)
            else:
                known = isinstance(value, bool | int | float | np.number | np.bool_)
                values.append(float(value) if known else np.nan)
            self.strange += not known
        return values

    def _at(self, path: Path, value: Any) -> Any:
        """What stands at a path in a message, None if nothing does."""
        try:
            for step in path:
                if isinstance(step, int):
                    value = value[step]
                elif isinstance(value, Sequence) and self._labels is not None:
                    value = value[self._labels.index(step)]
                else:
                    value = self.field_of(value, step)
        except (LookupError, TypeError, AttributeError, ValueError):
            return None
        return value

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
        notes += remarks
        fields = {}
        for name, column in self._columns.items():
            # A view: the samples of a long log shall not stand twice.
            values = np.array(column.texts, dtype=object) if column.is_text else np.frombuffer(column.numbers)
            # A column that a later message brought has no value before.
            missing = len(time) - len(values)
            if missing:
                values = np.r_[np.full(missing, None if column.is_text else np.nan), values]
            fields[name] = Signal(time, values)
        return fields, notes

    def _time(self) -> tuple[np.ndarray, list[str]]:
        """When the values were measured: the sender's stamps where there are, on the receiver's clock."""
        receipts, stamps = np.frombuffer(self._receipts), np.frombuffer(self._stamps)
        if not len(stamps) or not np.isfinite(stamps).all():
            return receipts, []
        delay = receipts - stamps
        typical = float(np.median(delay))
        far = np.abs(delay - typical) > _OTHER_CLOCK
        if far.mean() > _QUICKEST and not _in_bursts(receipts, stamps):
            apart = float(np.ptp(delay))
            return receipts, [
                f"{self.name}: its stamps drift by {apart:.3g} s against the recorder's clock; the times of receipt are used."
            ]
        if abs(typical) <= _OTHER_CLOCK:
            return stamps, []
        offset = float(np.quantile(delay, _QUICKEST))
        instant = (
            f"{self.name} is stamped {offset:.3f} s off the recorder's clock; the stamps were shifted to it."
        )
        return stamps + offset, [instant]

    def _brings_more(self, parts: dict[str, Any]) -> bool:
        """Whether a message has a field that none had before: a logger may write what was measured at that instant, and no more."""
        new = {name for name, value in parts.items() if name not in self._seen and value is not None}
        self._seen |= new
        return bool(new)

    def _learn(self, message: Any, labels: tuple[str, ...] | None) -> None:
        """Make columns of the fields of a message, beside those that there are."""
        self._labels = labels
        fields: dict[Path, Any] = {}
        self._walk(message, (), fields)
        self._add_columns({path: isinstance(value, str) for path, value in fields.items()})

    def _add_columns(self, are_texts: dict[Path, bool]) -> None:
        """Make columns of the wanted ones of some fields, beside those that there are."""
        names = dict.fromkeys(self.names)
        for path, is_text in are_texts.items():
            name = self.name_of(path)
            names[name] = None
            if name not in self._columns and (self.wanted is None or self.wanted(name)):
                self._columns[name] = Column(path, is_text)
        self.names = tuple(names)

    def name_of(self, path: Path) -> str:
        """The signal's name of a field."""
        return f"{self.name}.{_shown(path)}" if path else self.name

    def _walk(self, value: Any, path: Path, fields: dict[Path, Any]) -> None:
        """Collect the numbers and texts under a value by path."""
        if isinstance(value, bool | int | float | str | np.number | np.bool_):
            fields[path] = value
            return
        if isinstance(value, np.ndarray | list | tuple):
            self._walk_list(value, path, fields)
            return
        for key, part in self.parts(value):
            if not is_left_out(path, key):
                self._walk(part, (*path, key), fields)

    def _walk_list(self, values: Any, path: Path, fields: dict[Path, Any]) -> None:
        if not len(values) or isinstance(values[0], str):
            return
        plain = isinstance(values[0], bool | int | float | np.number | np.bool_)
        if len(values) > (LONGEST_ARRAY if plain else LONGEST_LIST):
            return
        named = self._labels if self._labels and len(self._labels) == len(values) and len(path) == 1 else None
        for k, value in enumerate(values):
            self._walk(value, (*path, k if named is None else named[k]), fields)


def is_left_out(path: Path, key: str) -> bool:
    """Whether the field ``key`` of the message at a path is no signal."""
    return len(path) >= _DEEPEST or key in ("frame_id", "child_frame_id") or "covariance" in key


def _in_bursts(receipts: np.ndarray, stamps: np.ndarray) -> bool:
    """Whether messages (n,) waited for each other on their way, so that the stamps say better when they were sent."""
    usual = float(np.median(np.diff(stamps))) if len(stamps) > 1 else 0.0
    return usual > 0 and float(np.mean(np.diff(receipts) < _BURST * usual)) > _QUICKEST


def _shown(path: Path) -> str:
    text = ""
    for step in path:
        text += f"[{step}]" if isinstance(step, int) else f".{step}" if text else step
    return text


def log_of(topics: Iterable[Topic], path: str, notes: list[str], files: Iterable[FilePath] = ()) -> SignalLog:
    """The signals of all topics; raises InputError if no message could be read."""
    result: dict[str, Signal] = {}
    names: dict[str, None] = {}
    topics, remarks = list(topics), list(notes)
    for topic in topics:
        signals, own = topic.signals()
        result |= signals
        remarks += own
        names |= dict.fromkeys(topic.names)
    if not any(topic.count for topic in topics):
        bad = sum(topic.bad for topic in topics)
        problem = f"has no readable message ({bad} are unreadable)" if bad else "holds no message"
        raise InputError(
            f"{problem}{'; ' + remarks[0] if remarks else ''}", file=path, hint="check how it was recorded"
        )
    digest = "+".join(sha256(file) for file in files) or sha256(path)
    return SignalLog(tuple(names), result, path, digest, tuple(remarks))


def names_of_entries(parts: dict[str, Any]) -> tuple[str, ...] | None:
    """The list ``name`` of a message, as of a JointState's joints; None if it has none."""
    fields = parts.get("name")
    if isinstance(fields, list | tuple) and all(isinstance(entry, str) for entry in fields):
        return tuple(fields)
    return None
