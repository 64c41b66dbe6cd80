"""The live service as a user runs it: delay, drops, processor and memory, and what kills cost.

    python benchmarks/bench_live.py [--seconds 60] [--kills 20] [--write]

`terragrip live` runs as a process of its own, held to one core, with UDP in and out and a record. This process sends the
samples of a made-up pull at a steady rate from another core, and takes the time from sending a sample to receiving its
estimate. All of it runs in real time (SCHED_RR) where the system allows that, so that other work on the machine does not count.
The peer is a step of filterpy's UKF on the same model (peer.py): without reading, recording or sending anything.
Then the process is killed at random moments, and what a restart has is compared with what was sent.
--write puts the table into docs/live.md.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import peer
import pull
from marked import put
from priority import prefer
from sink_messages import measured_row
from terragrip.estimation import TractionEstimator
from terragrip.live import read_record
from terragrip.recording import Recording
from terragrip.vehicle import Vehicle

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "live.md"
BEGIN = "<!-- made by benchmarks/bench_live.py --write -->"
CORES = sorted(os.sched_getaffinity(0))


@dataclass(frozen=True)
class Ports:
    """Where the service listens, and where its estimates go."""

    source: int
    sink: socket.socket

    @classmethod
    def free(cls) -> Ports:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            source = probe.getsockname()[1]
        sink = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        sink.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 16 << 20)
        sink.bind(("127.0.0.1", 0))
        sink.settimeout(2.0)
        return cls(source, sink)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60.0, help="how long each rate is held")
    parser.add_argument(
        "--kills", type=int, default=20, help="how often the process is killed; 0 leaves it out"
    )
    parser.add_argument("--write", action="store_true", help="put the table into docs/live.md")
    options = parser.parse_args()
    prefer()
    with tempfile.TemporaryDirectory(prefix="terragrip-bench-") as name:
        folder = Path(name)
        vehicle, vehicle_file = pull.vehicle(folder)
        log, step = log_and_peer(vehicle)
        lines = [
            f"Peer: a step of filterpy's UKF, {1e6 * step:.0f} us in this run.",
            "",
            "| rate, Hz | estimates missing | not recorded | delay median, ms | p99, ms | most, ms | of a core | us a sample "
            "| of the peer's step | memory, MB |",
            "|---:|---:|---:|---:|---:|---:|---:|---:|---:|---:|",
        ]
        lines += [
            bench_rate(log, vehicle_file, folder / f"at{rate}", rate, seconds, step)
            # The slow one a little longer, so that it closes a segment too.
            for rate, seconds in ((1000, options.seconds), (100, 1.2 * options.seconds))
        ]
        if options.kills:
            lines += ["", bench_kills(log, vehicle, vehicle_file, folder / "killed", options.kills)]
    text = "\n".join(lines)
    print(text)
    if options.write:
        put(DOCUMENT, BEGIN, text)


def start(vehicle_file: Path, record: Path, ports: Ports) -> subprocess.Popen[bytes]:
    """`terragrip live` on the first core."""
    process = subprocess.Popen(
        [
            str(Path(sys.executable).with_name("terragrip")), "live", "--quiet", "--vehicle", str(vehicle_file),
            "--source", f"udp://127.0.0.1:{ports.source}",
            "--sink", f"udp://127.0.0.1:{ports.sink.getsockname()[1]}", "--record", str(record),
        ]
    )  # fmt: skip
    os.sched_setaffinity(process.pid, CORES[:1])
    prefer(process.pid)
    return process


def log_and_peer(vehicle: Vehicle) -> tuple[Recording, float]:
    """What is sent, and how long [s] a step of the peer takes on it."""
    frame, load = pull.recording(vehicle, 20.0)
    _, step = peer.run(pull.problem(vehicle, frame, load), 1000)
    return Recording.from_frame(frame), step


def messages(log: Recording, rate: int, count: int) -> list[bytes]:
    """JSON samples, the log's rows over and over, stamped at the rate."""
    names = [name for name in log.channels if name not in log.references]
    columns = np.column_stack([log.channels[name] for name in names])
    return [
        json.dumps(
            {"time": k / rate, **dict(zip(names, columns[k % len(columns)].tolist(), strict=True))}
        ).encode()
        for k in range(count)
    ]


def until_ready(ports: Ports, process: subprocess.Popen[bytes]) -> None:
    """Wait until the service speaks: it sends its status once a second."""
    ports.sink.settimeout(20.0)
    while b"row_rate" not in ports.sink.recv(1 << 16):
        if process.poll() is not None:
            raise SystemExit("terragrip live ended")
    ports.sink.settimeout(2.0)


def bench_rate(
    log: Recording, vehicle_file: Path, record: Path, rate: int, seconds: float, step: float
) -> str:
    """A row of the table: the service at one rate."""
    count = round(rate * seconds)
    samples, ports = messages(log, rate, count), Ports.free()
    process = start(vehicle_file, record, ports)
    os.sched_setaffinity(0, CORES[-1:])
    until_ready(ports, process)
    idle = usage(process.pid)
    sent, got, dropped = np.zeros(count), np.full(count, np.nan), [0]
    listener = threading.Thread(target=listen, args=(ports.sink, got, rate, dropped))
    listener.start()
    send(samples, rate, ports.source, sent)
    listener.join()
    used, peak = usage(process.pid) - idle, memory(process.pid)
    process.send_signal(signal.SIGINT)
    process.wait(20)
    kept, _ = read_record(record)
    delay = 1e3 * (got - sent)
    p50, p99, most = np.nanpercentile(delay, [50, 99, 100])
    missing, unkept = count - np.isfinite(got).sum(), count - len(kept)
    return (
        f"| {rate} | {missing} of {count} ({dropped[0]} dropped) | {unkept} | {p50:.2f} | {p99:.2f} | {most:.1f} "
        f"| {100 * used / seconds:.1f} % | {1e6 * used / count:.0f} | {used / count / step:.2f} | {peak:.0f} |"
    )


def send(samples: list[bytes], rate: int, port: int, sent: np.ndarray) -> None:
    """Send at a steady rate, never two at once where one was late."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        link.connect(("127.0.0.1", port))
        began = time.perf_counter()
        for k, sample in enumerate(samples):
            while (left := began + k / rate - time.perf_counter()) > 0:
                time.sleep(left if left > 2e-4 else 0)
            sent[k] = time.perf_counter()
            link.send(sample)


def listen(sink: socket.socket, got: np.ndarray, rate: int, dropped: list[int]) -> None:
    """Note when each row's estimate came, until nothing but the status comes any more."""
    quiet = 0
    while quiet < 3 and not np.isfinite(got[-1]):
        try:
            data = sink.recv(1 << 16)
        except TimeoutError:
            return
        now = time.perf_counter()
        row = measured_row(data)
        if row is not None:
            got[round(rate * row["time"])] = now
            quiet = 0
        elif b"row_rate" in data:
            quiet += 1
            status = json.loads(data)
            dropped[0] = sum(mine["dropped"] for mine in status["counts"].values()) + sum(
                box["dropped"] for box in status["sinks"].values()
            )


def usage(pid: int) -> float:
    """Seconds of processor that a process's threads have used, as the scheduler counted them.

    Not from /proc/PID/stat, which on many kernels counts by ticks: what wakes at 100 Hz is then counted wrong.
    """
    threads = Path(f"/proc/{pid}/task").glob("*/schedstat")
    return sum(int(path.read_text().split()[0]) for path in threads) / 1e9


def memory(pid: int) -> float:
    """The most memory that a process has held, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def bench_kills(log: Recording, vehicle: Vehicle, vehicle_file: Path, record: Path, kills: int) -> str:
    """Kill the process again and again while samples come; compare the record with what was sent, and with one run."""
    rate, ports, generator = 200, Ports.free(), random.Random(7)
    samples = messages(log, rate, 400_000)
    stop, sent_at = threading.Event(), []
    sender = threading.Thread(target=keep_sending, args=(samples, rate, ports.source, stop, sent_at))
    sender.start()
    down, last = [], 0
    for _ in range(kills):
        process = start(vehicle_file, record, ports)
        until_ready(ports, process)
        time.sleep(generator.uniform(0.0, 1.0))
        process.kill()
        process.wait()
        killed = time.perf_counter()
        kept, _ = read_record(record)
        newest = round(rate * float(kept.time[-1]))
        down.append(killed - sent_at[newest])
        last = len(kept)
    stop.set()
    sender.join()
    kept, estimates = read_record(record)
    through = TractionEstimator(vehicle, channels=tuple(kept.channels)).update_block(kept)
    same = all(
        np.array_equal(through.columns[name], estimates.columns[name], equal_nan=True)
        for name in through.columns
    )
    return (
        f"{kills} kills at random moments, {rate} Hz: the record ends {1e3 * np.median(down):.0f} ms before the kill in the "
        f"median, {1e3 * max(down):.0f} ms at most; its {last} estimates {'are' if same else 'ARE NOT'} those of one run, bit for bit."
    )


def keep_sending(
    samples: list[bytes], rate: int, port: int, stop: threading.Event, sent_at: list[float]
) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link:
        began = time.perf_counter()
        for k, sample in enumerate(samples):
            if stop.is_set():
                return
            left = began + k / rate - time.perf_counter()
            if left > 0:
                time.sleep(left)
            sent_at.append(time.perf_counter())
            link.sendto(sample, ("127.0.0.1", port))


if __name__ == "__main__":
    main()
