"""A stand-in for a live service whose source can fall silent, go on predicted, freeze, or go."""

from __future__ import annotations

import asyncio
import contextlib
import json
import threading
from collections.abc import Iterator
from typing import Any
from urllib.parse import parse_qs, urlsplit

import numpy as np

COLUMNS = ["slip_a", "slip_a_std", "adhesion_a", "ground_speed", "ground_speed_std", "curve_a", "curve_a_std"]
VALUES = [0.2, 0.01, 0.4, 1.5, 0.02, 1.0, 0.05]


class LiveService:
    """Rows at 20 Hz, `step` s apart by their stamps, while `mode` is "measured"; "predicted": predicted ones; "slipless": without slip;
    "silent": none, but a status a second; "frozen": nothing."""

    step = 0.05
    vehicles: tuple[str, ...] = ()  # of a service of many; the n-th drives n times as fast as `VALUES` say
    setpoint: dict[str, Any] | None = None  # what is published of it, four times a second
    quiet: tuple[str, ...] = ()  # what a status says of silent sources

    def __init__(self) -> None:
        self.mode, self.address = "measured", ""
        self._ready, self._stop = threading.Event(), threading.Event()
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()), daemon=True)
        self._thread.start()
        assert self._ready.wait(60)

    def stop(self) -> None:
        """The service goes."""
        self._stop.set()
        self._thread.join(60)

    async def _answer(self, socket: Any) -> None:
        from websockets.exceptions import ConnectionClosed

        with contextlib.suppress(ConnectionClosed):  # the page has left
            await self._send(socket)

    async def _send(self, socket: Any) -> None:
        hello = {
            "kind": "hello",
            "vehicle": "v",
            "columns": COLUMNS,
            "wheels": ["a"],
            "driven": ["a"],
            "events": [""],
        }
        values = dict(zip(COLUMNS, VALUES, strict=True))
        if self.vehicles:
            (name,) = parse_qs(urlsplit(socket.request.path).query).get("vehicle", self.vehicles[:1])
            if name not in self.vehicles:
                await socket.close(1008, f"no vehicle {name!r} sends")
                return
            hello |= {"name": name, "vehicles": self.vehicles}
            values["ground_speed"] *= 1 + self.vehicles.index(name)
        await socket.send(json.dumps(hello))
        row = 0
        while not self._stop.is_set():
            row += 1
            values["slip_a"] = np.nan if self.mode == "slipless" else VALUES[0]
            if self.mode in ("measured", "predicted", "slipless"):
                await socket.send(
                    np.array(
                        [row * self.step, float(self.mode == "predicted"), 0.0, *values.values()]
                    ).tobytes()
                )
            if row % 5 == 0 and self.setpoint and self.mode == "measured":
                await socket.send(json.dumps({"kind": "setpoint", "time": row * self.step, **self.setpoint}))
            if row % 20 == 0 and self.mode != "frozen":
                status = {"kind": "status", "time": row * self.step, "delay": 0.0, "counts": {}}
                await socket.send(json.dumps({**status, "silent": self.quiet}))
            await asyncio.sleep(0.05)

    async def _run(self) -> None:
        from websockets.asyncio.server import serve

        async with serve(self._answer, "127.0.0.1", 0) as server:
            self.address = f"ws://127.0.0.1:{next(iter(server.sockets)).getsockname()[1]}"
            self._ready.set()
            while not self._stop.is_set():
                await asyncio.sleep(0.02)


@contextlib.contextmanager
def listened_to(served: Any) -> Iterator[LiveService]:
    """A service while the block runs, of which the studio was told at its start."""
    service = LiveService()
    served.stop()
    served.live = service.address
    served.start()
    try:
        yield service
    finally:
        service.stop()
