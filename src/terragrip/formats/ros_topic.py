"""The messages of one topic of ROS, which come as bytes: those of one layout are read at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.formats.boundary import DAMAGE
from terragrip.formats.messages import BLOCK, Topic
from terragrip.formats.ros_layout import Bytes, Layout, Serialised, layout_of
from terragrip.formats.signals import Signal
from terragrip.formats.table import skips

_TOGETHER, _BYTES = 2000, 4 << 20  # messages that are read at once, and their bytes
_MOST_LAYOUTS = 32  # of a topic; where there are more, the layouts of single messages are determined


@dataclass
class RosTopic(Topic):
    """A `Topic` whose messages come as bytes."""

    _form: Serialised | None = None
    _waiting: list[bytes] = field(default_factory=list)
    _came: list[float] = field(default_factory=list)
    _bytes: int = 0
    _number: int = 0
    _layouts: dict[int, list[Layout]] = field(default_factory=dict)

    def push(self, receipt: float, raw: bytes, form: Serialised) -> None:
        """Take a message that came at ``receipt`` [s]; one that cannot be read is counted."""
        self._begin(form)
        if not self._columns:
            if self._new_layout(form, raw) is None:
                self.bad += 1
                return
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

    def fields(self, raw: bytes, form: Serialised) -> tuple[float, dict[str, Any]] | None:
        """The sender's stamp [s], NaN if there is none, and the wanted fields of one message by name, for who takes messages as they come.

        Nothing is collected. None where the message cannot be read.
        """
        self._begin(form)
        data = np.frombuffer(raw, np.uint8).reshape(1, -1)
        known = next((one for one in self._layouts.get(len(raw), []) if one.fits(data)[0]), None)
        layout = known or self._new_layout(form, raw)
        if layout is None:
            return None
        values = {
            name: layout.values(one.path, data, is_text=one.is_text) for name, one in self._columns.items()
        }
        there = {name: value.tolist()[0] for name, value in values.items() if value is not None}
        return float(layout.stamps(data)[0]), there

    def signals(self) -> tuple[dict[str, Signal], list[str]]:
        """The signals collected, and sentences on them."""
        self._flush()
        return super().signals()

    def _begin(self, form: Serialised) -> None:
        """Messages of this form come now."""
        if form != self._form:
            self._flush()
            self._form, self._layouts = form, {}

    def _new_layout(self, form: Serialised, raw: bytes) -> Layout | None:
        """The layout of a message, which is kept, and its fields as columns; None where it cannot be read."""
        try:
            layout = layout_of(form, raw)
        except DAMAGE:
            return None
        self._add_columns({**dict.fromkeys(layout.numbers, False), **dict.fromkeys(layout.texts, True)})
        if sum(map(len, self._layouts.values())) < _MOST_LAYOUTS:
            self._layouts.setdefault(len(raw), []).append(layout)
        return layout

    def _flush(self) -> None:
        """Read the messages that wait."""
        raws, came, form = self._waiting, np.array(self._came), self._form
        self._waiting, self._came, self._bytes = [], [], 0
        groups: dict[int, list[int]] = {}
        for row, raw in enumerate(raws):
            groups.setdefault(len(raw), []).append(row)
        alike: list[tuple[Layout, npt.NDArray[np.intp], Bytes]] = []
        readable = np.ones(len(raws), dtype=bool)
        for size, places in groups.items():
            rows = np.array(places, dtype=np.intp)
            data = np.frombuffer(b"".join([raws[k] for k in places]), np.uint8).reshape(len(rows), size)
            known = iter(list(self._layouts.get(size, [])))
            while len(rows) and form is not None:
                layout = next(known, None) or self._new_layout(form, data[0].tobytes())
                if layout is None:
                    readable[rows[0]] = False
                    rows, data = rows[1:], data[1:]
                    continue
                fitting = layout.fits(data)
                alike.append((layout, rows[fitting], data[fitting]))
                rows, data = rows[~fitting], data[~fitting]
        self.count += int(readable.sum())
        self.bad += int((~readable).sum())
        stamps = np.full(len(raws), np.nan)
        for layout, rows, data in alike:
            stamps[rows] = layout.stamps(data)
        self._receipts.frombytes(came[readable].tobytes())
        self._stamps.frombytes(stamps[readable].tobytes())
        for column in self._columns.values():
            values = np.full(len(raws), None if column.is_text else np.nan)
            for layout, rows, data in alike:
                own = layout.values(column.path, data, is_text=column.is_text)
                if own is None:
                    self.strange += len(rows)
                else:
                    values[rows] = own
            if column.is_text:
                column.texts.extend(values[readable].tolist())
            else:
                column.numbers.frombytes(values[readable].tobytes())
