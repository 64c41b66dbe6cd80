"""Does the live service stay up? Random faults for a while, then every promise of docs/live.md is checked against what was sent.

    python benchmarks/soak.py [--seconds 3600] [--rate 1000] [--seed 18] [--keep FOLDER]

A mosquitto broker carries the samples of a made-up drive to `terragrip live`, a process of its own with a record. A plan drawn from the
seed says which samples are lost, held back, sent twice, spoiled or stamped a day off, when the sender's clock steps, when the broker is
restarted, and when the service is killed by SIGKILL and started again on its record. Kills fall in the first half only, so that memory
is watched over one long life; the last part is without faults. Each sample bears its number as `altitude`, which the filter does not use.
A machine that is too slow gets the samples later (the sender waits for the service): it takes longer, and nothing fails by load.
Ends with 1 and a line for each broken promise. Needs mosquitto: without it says so and ends with 0.
"""

from __future__ import annotations

import argparse
import contextlib
import heapq
import json
import math
import os
import random
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from array import array
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import paho.mqtt.client as mqtt

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "estimation"))  # for drives.py

import pull
from drives import drive
from priority import prefer
from sink_messages import measured_row
from soak_checks import checks

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
QUIET = 20.0  # s at the end without faults
PERIOD = 60.0  # s after which the drive repeats
PATIENCE = 180.0  # s for a start, a backlog, a connection: far more than a loaded machine needs
BACKLOG = 1000  # samples waiting in the service at which the sender waits, too
# s between two, in the mean
OFTEN = {"loss": 0.5, "reorder": 0.3, "double": 1.0, "spoil": 0.3, "stray stamp": 5.0}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=3600.0, help="of samples; at least 60")
    parser.add_argument("--rate", type=int, default=1000, help="samples a second")
    parser.add_argument("--seed", type=int, default=18)
    parser.add_argument("--keep", type=Path, help="a new folder for the record, which then stays")
    options = parser.parse_args()
    if options.seconds < 60.0:
        parser.error("--seconds is at least 60: faults and memory need that long")
    if options.keep is not None and options.keep.exists():
        parser.error(f"{options.keep} exists: name a new folder")
    if MOSQUITTO is None:
        print(
            "SKIPPED: the soak needs mosquitto; on Debian and Ubuntu: apt-get install mosquitto",
            file=sys.stderr,
        )
        return 0
    prefer()  # as bench_live does, where the system allows it
    with tempfile.TemporaryDirectory(prefix="terragrip-soak-") as name:
        folder = Path(name)
        vehicle, vehicle_file = pull.vehicle(folder)
        soak = Soak(
            options.seconds,
            options.rate,
            options.seed,
            folder,
            vehicle_file,
            options.keep or folder / "record",
        )
        began = time.perf_counter()
        soak.run()
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))  # what follows may wait
        print(
            f"{soak.count} samples at {options.rate} Hz in {time.perf_counter() - began:.0f} s, seed {options.seed}"
        )
        print(
            "faults: " + ", ".join(f"{number} {kind}" for kind, number in sorted(soak.faults.items())) + "\n"
        )
        results = checks(soak, vehicle)
    width = max(len(check.promise) for check in results)
    for check in results:
        print(f"{check.promise:{width}}  {'stands' if check.stands else 'BROKEN'}  {check.seen}")
    broken = [check for check in results if not check.stands]
    for check in broken:
        line = f"soak: broken promise: {check.promise}: {check.seen} (--seed {options.seed})"
        print(line, file=sys.stderr)
    return 1 if broken else 0


def planned(seconds: float, rate: int, seed: int) -> dict[int, list[str]]:
    """Kinds of faults by the number of the sample at which each begins; none in the first 5 s and in the last `QUIET` s."""
    generator, end = random.Random(seed), seconds - QUIET
    rare = max(10.0, seconds / 60.0)  # s between two
    result: dict[int, list[str]] = {}
    for kind, mean, last in (
        *((kind, mean, end) for kind, mean in OFTEN.items()),
        ("clock step", rare, end - 2.0), ("broker restart", max(20.0, rare), end - 5.0), ("kill", rare, seconds / 2),
    ):  # fmt: skip
        at = 5.0 + generator.uniform(0.0, mean)
        while at < last:
            result.setdefault(int(at * rate), []).append(kind)
            # Rare ones keep a distance: a clock's step is believed after a second, a connection settles in 10 s.
            at += generator.expovariate(1.0 / mean) if mean < rare else mean * generator.uniform(0.7, 1.3)
    return result


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Broker:
    """mosquitto on loopback."""

    def __init__(self, folder: Path) -> None:
        self.port, self._conf = free_port(), folder / "mosquitto.conf"
        self._conf.write_text(f"listener {self.port} 127.0.0.1\npersistence false\nallow_anonymous true\n")
        self.start()

    def start(self) -> None:
        assert MOSQUITTO is not None
        self._process = subprocess.Popen([MOSQUITTO, "-c", self._conf], stderr=subprocess.DEVNULL)
        for _ in range(500):
            with contextlib.suppress(OSError), socket.create_connection(("127.0.0.1", self.port), 1):
                return
            time.sleep(0.02)
        raise SystemExit("mosquitto does not listen")

    def stop(self) -> None:
        self._process.terminate()
        self._process.wait(20)


@dataclass
class Life:
    """One process of the service, from its start to its end, and what it gave out."""

    process: subprocess.Popen[bytes]
    sink: socket.socket
    seen: array[float] = field(
        default_factory=lambda: array("d")
    )  # arrivals of the rows whose estimates came
    memory: list[tuple[float, float]] = field(default_factory=list)  # s, MB
    waits: list[tuple[float, float]] = field(default_factory=list)  # s, s waited for a processor so far
    rows: int = -1  # as the last status said; -1: it has not spoken yet
    waiting: int = 0  # samples
    stalled: float = 0.0  # s that it waited for a processor in its last half second

    def watch(self) -> None:
        """Until it has ended: what comes out of it, and its memory."""
        while self.process.poll() is None:
            now = time.perf_counter()
            with contextlib.suppress(OSError, ValueError, IndexError):  # it may end meanwhile
                self.waits = [*self.waits[-9:], (now, self.waited())]
                self.memory.append((now, memory(self.process.pid)))
            with contextlib.suppress(TimeoutError):
                while time.perf_counter() < now + 0.1:
                    self._hear(self.sink.recv(1 << 16))
        self.sink.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            while True:
                self._hear(self.sink.recv(1 << 16))
        self.sink.close()

    def _hear(self, data: bytes) -> None:
        row = measured_row(data)
        if row is not None:
            self.seen.append(row["arrival"])
        elif b"row_rate" in data:
            status = json.loads(data)
            self.rows, self.waiting = status["rows"], status["waiting"]

    def waited(self) -> float:
        """Seconds that its main thread was ready to run and had no processor; 0 where the system does not tell."""
        with contextlib.suppress(OSError):
            return int(Path(f"/proc/{self.process.pid}/schedstat").read_text().split()[1]) / 1e9
        return 0.0

    def kill(self) -> None:
        now, waited = time.perf_counter(), self.waited()
        self.stalled = waited - min((w for at, w in self.waits if at > now - 0.5), default=0.0)
        self.process.kill()
        self.process.wait()


def memory(pid: int) -> float:
    """What a process holds now, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    held = [int(line.split()[1]) for line in lines if line.startswith("VmRSS")]
    return held[0] / 1024  # IndexError where the process has just ended


class Soak:
    """The run: sender, broker, service, and what went wrong on purpose."""

    def __init__(
        self, seconds: float, rate: int, seed: int, folder: Path, vehicle_file: Path, record: Path
    ) -> None:
        self.rate, self.count, self.record = rate, round(seconds * rate), record
        self.plan, self._random = planned(seconds, rate, seed), random.Random(seed + 1)
        turn = 2 * np.pi / PERIOD
        self.base = drive(
            PERIOD, rate=float(rate), seed=seed,
            speed=lambda t: 0.6 + 0.05 * np.sin(3 * turn * t), slip=lambda t: 0.10 + 0.05 * np.sin(2 * turn * t),
        ).recording  # fmt: skip
        self._names = list(self.base.channels)
        self._rows = np.column_stack([self.base.channels[name] for name in self._names]).tolist()
        self.faults: Counter[str] = Counter()
        self.spoiled: set[int] = set()
        self.lives: list[Life] = []
        self._watchers: list[threading.Thread] = []
        self.code = 0
        self._vehicle_file, self._folder = vehicle_file, folder
        self._offset = 0.0  # s by which the sender's clock has stepped
        self._lost_until = 0
        self._held: list[tuple[int, int, bytes]] = []  # due at, number, message

    def run(self) -> None:
        """Send everything; on return the service has ended and its record is closed."""
        self.broker = Broker(self._folder)
        self.client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self.client.reconnect_delay_set(1, 1)
        self.client.connect("127.0.0.1", self.broker.port)
        self.client.loop_start()
        try:
            self._begin_life()
            self._wait_for(lambda: self.lives[-1].rows >= 0)
            self._send_all()
            self._wait_for_end()
            self.lives[-1].process.send_signal(signal.SIGINT)
            self.code = self.lives[-1].process.wait(120)
        finally:
            for life in self.lives:
                life.process.kill()
            for watcher in self._watchers:
                watcher.join()
            self.client.loop_stop()
            self.broker.stop()

    def _begin_life(self) -> None:
        sink = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sink.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16 << 20)
        sink.bind(("127.0.0.1", 0))
        sink.settimeout(0.05)
        process = subprocess.Popen(
            [
                str(Path(sys.executable).with_name("terragrip")), "live", "--quiet", "--vehicle", str(self._vehicle_file),
                "--source", f"mqtt://127.0.0.1:{self.broker.port}/machine", "--record", str(self.record),
                "--sink", f"udp://127.0.0.1:{sink.getsockname()[1]}?columns=ground_speed",
            ],
            stdout=subprocess.DEVNULL,
        )  # fmt: skip
        self.lives.append(Life(process, sink))
        self._watchers.append(threading.Thread(target=self.lives[-1].watch))
        self._watchers[-1].start()

    def _wait_for(self, condition: Callable[[], bool]) -> None:
        end = time.perf_counter() + PATIENCE
        while not condition():
            if self.lives[-1].process.poll() is not None:
                raise SystemExit("soak: broken promise: terragrip live ended by itself")
            if time.perf_counter() > end:
                raise SystemExit(f"soak: broken promise: terragrip live did nothing for {PATIENCE:.0f} s")
            time.sleep(0.02)

    def _wait_for_end(self) -> None:
        """Until the number of rows stands still for three seconds."""
        before, since, life = -1, time.perf_counter(), self.lives[-1]
        while time.perf_counter() < since + 3.0 or life.waiting:
            self._wait_for(lambda: True)
            if life.rows != before:
                before, since = life.rows, time.perf_counter()
            time.sleep(0.05)

    def _send_all(self) -> None:
        began, quiet = time.perf_counter(), self.count - round(QUIET * self.rate)
        for k in range(self.count):
            late = time.perf_counter() - (began + k / self.rate)
            if late < 0.0:
                time.sleep(-late)
            elif late > 0.2:  # a slow machine gets them later, not in a burst
                began += late
            if self.lives[-1].waiting > BACKLOG:
                self._wait_for(lambda: self.lives[-1].waiting < BACKLOG // 2)
            for kind in self.plan.get(k, ()):
                if kind not in OFTEN:
                    self._disturb(kind)
            if k == quiet:  # what went wrong is over: service and broker are there again
                self._wait_for(lambda: self.lives[-1].rows >= 0 and self.client.is_connected())
            self._send(k)

    def _disturb(self, kind: str) -> None:
        """What concerns more than samples."""
        if kind == "kill":
            if self.lives[-1].rows < 0:
                return  # it is not up yet again
            self.lives[-1].kill()
            self._begin_life()
        elif kind == "broker restart":
            self.broker.stop()
            threading.Timer(self._random.uniform(0.1, 1.0), self.broker.start).start()
        else:
            self._offset += self._random.choice((-1, 1)) * math.exp(
                self._random.uniform(math.log(11), math.log(3600))
            )
        self.faults[kind] += 1

    def _send(self, k: int) -> None:
        draw, stamp = self._random, k / self.rate + self._offset
        fields: dict[str, Any] = dict(zip(self._names, self._rows[k % len(self._rows)], strict=True))
        copies, due = 1, k
        for kind in self.plan.get(k, ()):
            if kind not in OFTEN:
                continue
            self.faults[kind] += 1
            if kind == "loss":
                self._lost_until = max(
                    self._lost_until, k + int(math.exp(draw.uniform(0.0, math.log(0.3 * self.rate))))
                )
            elif kind == "reorder":
                due = k + draw.randrange(1, max(2, self.rate // 25))  # up to 40 ms: twice the window
            elif kind == "double":
                copies = 2
            elif kind == "stray stamp":
                stamp += draw.choice((-86400.0, 86400.0))
            else:
                self.spoiled.add(k)
                name = draw.choice(self._names)
                fields[name] = draw.choice(
                    (None, "fast", float("nan"), 1e300, fields[name] * 10.0 ** draw.uniform(0.3, 6.0))
                )
        message = json.dumps({"time": stamp, "altitude": k, **fields}).encode()
        if k >= self._lost_until:
            for _ in range(copies):
                heapq.heappush(self._held, (due, k, message))
        while self._held and (self._held[0][0] <= k or k == self.count - 1):
            self.client.publish("machine", heapq.heappop(self._held)[2])


if __name__ == "__main__":
    raise SystemExit(main())
