"""The messages of one topic of a ROS bag, which come as bytes: those of one layout are read at once.

rosbags reads the first message of every layout, and is what the layout is checked against; it reads all of them where there
is no layout.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.boundary import DAMAGE
from terragrip.formats.messages import BLOCK, Column, Topic, names_of_entries
from terragrip.formats.ros_layout import Bytes, Layout, Path, layout_of
from terragrip.formats.signals import Signal
from terragrip.formats.table import skips

_TOGETHER, _BYTES = 2000, 4 << 20  # messages that are read at once, and their bytes
_MOST_LAYOUTS = 32  # of a topic; where there are more, messages are read one by one
_SECONDS: Path = ("header", "stamp", "sec")
_NANOSECONDS: Path = ("header", "stamp", "nanosec")

Rows = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Serialised:
    """How messages of a type are read: ``read`` gives a message as rosbags does, and raises ``errors`` on damage.

    ``fields`` gives rosbags' descriptions of the types' fields; ``one``: the messages are serialised by ROS 1.
    """

    kind: str
    one: bool
    read: Callable[[bytes], Any]
    fields: Callable[[], Mapping[str, Any]]
    errors: tuple[type[Exception], ...]


class _Block:
    """The wanted fields of some messages: columns (n,) by name, the senders' stamps (n,) and which could be read (n,)."""

    def __init__(self, count: int) -> None:
        self.stamps = np.full(count, np.nan)
        self.readable = np.ones(count, dtype=bool)
        self.columns: dict[str, npt.NDArray[Any]] = {}

    def column(self, name: str, *, is_text: bool) -> npt.NDArray[Any]:
        """A column, empty at first."""
        if name not in self.columns:
            count = len(self.stamps)
            self.columns[name] = np.full(count, None, dtype=object) if is_text else np.full(count, np.nan)
        return self.columns[name]


@dataclass
class RosTopic(Topic):
    """A `Topic` whose messages come as bytes."""

    _form: Serialised | None = None
    _waiting: list[bytes] = field(default_factory=list)
    _came: list[float] = field(default_factory=list)
    _bytes: int = 0
    _number: int = 0
    _layouts: dict[int, list[Layout]] = field(default_factory=dict)
    _tried: int = 0

    def push(self, receipt: float, raw: bytes, form: Serialised) -> None:
        """Take a message that came at ``receipt`` [s]; one that cannot be read is counted."""
        if form != self._form:
            self._flush()
            self._form, self._layouts, self._tried = form, {}, 0
        if not self._columns:
            message = self._read(raw)
            if message is None:
                return
            self._learn(message, names_of_entries(dict(self.parts(message))))
            if not self._columns:
                self.count += 1
                return
        self._number += 1
        if skips(self._number - 1, BLOCK, self.wanted):
            self.count += 1
            return
        self._waiting.append(raw)
        self._came.append(receipt)
        self._bytes += len(raw)
        if len(self._waiting) >= _TOGETHER or self._bytes > _BYTES:
            self._flush()

    def signals(self) -> tuple[dict[str, Signal], list[str]]:
        """The signals collected, and sentences on them."""
        self._flush()
        return super().signals()

    def _flush(self) -> None:
        """Read the messages that wait."""
        raws, came = self._waiting, self._came
        self._waiting, self._came, self._bytes = [], [], 0
        block = _Block(len(raws))
        groups: dict[int, list[int]] = {}
        for row, raw in enumerate(raws):
            groups.setdefault(len(raw), []).append(row)
        for size, places in groups.items():
            rows = np.array(places, dtype=np.intp)
            data = np.frombuffer(b"".join([raws[k] for k in places]), np.uint8).reshape(len(rows), size)
            for layout in self._layouts.get(size, []):
                rows, data = self._decode_many(layout, rows, data, block)
            while len(rows):
                new = self._decode_one(int(rows[0]), data[0].tobytes(), block)
                rows, data = rows[1:], data[1:]
                if new is not None:
                    self._layouts.setdefault(size, []).append(new)
                    rows, data = self._decode_many(new, rows, data, block)
        self._append(np.array(came), block)

    def _append(self, came: npt.NDArray[np.float64], block: _Block) -> None:
        known = block.readable
        self.count += int(known.sum())
        self._receipts.frombytes(came[known].tobytes())
        self._stamps.frombytes(block.stamps[known].tobytes())
        for name, column in self._columns.items():
            values = block.column(name, is_text=column.is_text)[known]
            if column.is_text:
                column.texts.extend(values.tolist())
            else:
                column.numbers.frombytes(values.tobytes())

    def _read(self, raw: bytes) -> Any:
        """A message, or None and counted where it cannot be read."""
        assert self._form is not None
        try:
            return self._form.read(raw)
        except (*DAMAGE, *self._form.errors):
            self.bad += 1
            return None

    def _decode_one(self, row: int, raw: bytes, block: _Block) -> Layout | None:
        """Read a message by rosbags; returns its layout, if it has one."""
        message = self._read(raw)
        if message is None:
            block.readable[row] = False
            return None
        labels = names_of_entries(dict(self.parts(message)))
        if labels != self._labels or self._tried < _MOST_LAYOUTS:
            self._learn(message, labels)  # another layout may have fields that there were none of
        stamp = self.stamp(message) or np.nan
        values = self._values(message)
        block.stamps[row] = stamp
        for (name, column), value in zip(self._columns.items(), values, strict=True):
            block.column(name, is_text=column.is_text)[row] = value
        if self._tried >= _MOST_LAYOUTS:
            return None
        self._tried += 1
        return self._checked_layout(raw, labels, stamp, values)

    def _checked_layout(
        self, raw: bytes, labels: tuple[str, ...] | None, stamp: float, values: list[Any]
    ) -> Layout | None:
        """The layout of a message; None if it does not give the values that rosbags gives."""
        form = self._form
        assert form is not None
        try:
            layout = layout_of(form.fields(), form.kind, raw, labels, one=form.one)
            data = np.frombuffer(raw, np.uint8).reshape(1, -1)
            same = _equal(_stamps(layout, data)[0], stamp)
            for column, value in zip(self._columns.values(), values, strict=True):
                own = _read_column(layout, column, data)
                same = same and _equal(None if own is None else own[0], value)
        except DAMAGE:
            return None
        return layout if same else None

    def _decode_many(self, layout: Layout, rows: Rows, data: Bytes, block: _Block) -> tuple[Rows, Bytes]:
        """Read the messages of a layout; returns those that have another one."""
        fitting = layout.fits(data)
        own, ours = rows[fitting], data[fitting]
        block.stamps[own] = _stamps(layout, ours)
        for name, column in self._columns.items():
            values = _read_column(layout, column, ours)
            if values is None:
                self.strange += len(own)
            else:
                block.column(name, is_text=column.is_text)[own] = values
        return rows[~fitting], data[~fitting]


def _read_column(layout: Layout, column: Column, data: Bytes) -> Any:
    """A column of messages (n, bytes); None where the layout lacks it, or has another kind of field there."""
    if column.is_text:
        return layout.text(column.path, data) if column.path in layout.texts else None
    return layout.number(column.path, data) if column.path in layout.numbers else None


def _stamps(layout: Layout, data: Bytes) -> npt.NDArray[np.float64]:
    """The senders' stamps (n,) [s] of messages (n, bytes), NaN where there are none."""
    if _SECONDS not in layout.numbers or _NANOSECONDS not in layout.numbers:
        return np.full(len(data), np.nan)
    result = layout.number(_SECONDS, data) + 1e-9 * layout.number(_NANOSECONDS, data)
    return np.where(result == 0, np.nan, result)


def _equal(first: Any, second: Any) -> bool:
    if isinstance(first, float) and isinstance(second, float):
        return bool(first == second or (np.isnan(first) and np.isnan(second)))
    missing = second is None or (isinstance(second, float) and np.isnan(second))
    return bool(first == second or (first is None and missing))
