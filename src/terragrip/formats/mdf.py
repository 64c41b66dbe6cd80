"""ASAM MDF 3 and 4 (MF4): measured signals, and raw CAN frames with a DBC or the table of J1939, by asammdf.

asammdf runs in a process of its own (`terragrip.formats.mdf_worker` says why).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from terragrip.files import sha256
from terragrip.formats.can.catalog import catalog
from terragrip.formats.can.frames import Frames
from terragrip.formats.can.log import finished
from terragrip.formats.registry import Databases, Format
from terragrip.formats.signals import Signal, SignalLog
from terragrip.formats.table import Wanted, kept_rows
from terragrip.formats.worker import Worker


def read_mdf(path: str, wanted: Wanted | None, databases: Databases) -> SignalLog:
    """Read an MDF file; raises InputError if it is damaged, or holds neither signals nor known frames."""
    frames = Frames(catalog(databases), wanted)
    with Worker("terragrip.formats.mdf_worker", "asammdf", path, "MDF file") as worker:
        head = worker.receive()
        start, units = float(head["start"]), dict(head["units"])
        worker.send([name for name in units if wanted is None or wanted(name)])
        signals: dict[str, Signal] = {}
        clocks: dict[int, npt.NDArray[np.float64]] = {}
        while "end" not in (message := worker.receive()):
            if "frames" in message:
                time, identifiers, lengths, data = (worker.array() for _ in range(4))
                frames.add_many(start + time, identifiers, lengths, data)
                continue
            group = int(message["group"])
            if not message["shared"]:
                time = worker.array()
                time = start + time[kept_rows(len(time), wanted)]
            else:
                time = clocks[group]
            clocks.setdefault(group, time)
            values = worker.array()
            values = values[kept_rows(len(values), wanted)]
            signals[str(message["name"])] = Signal(
                time, values.astype(object) if values.dtype.kind == "U" else values, message["unit"] or None
            )
    if not frames.count:
        return SignalLog(tuple(units), signals, path, sha256(path))
    log = finished(frames, path, (), databases, refuse_unknown=not signals)
    return SignalLog((*units, *log.names), signals | log.signals, path, log.sha256, log.notes)


FORMATS = (
    Format("mdf", "MDF file", read_mdf, (".mf4", ".mdf"), (b"MDF     ", b"UnFinMF "), takes_databases=True),
)
