"""Many vehicles in one `terragrip live`: processor, delay, drops and memory.

    python benchmarks/bench_live_many.py [--vehicles 200] [--rate 10] [--seconds 120] [--write]

`terragrip live` runs as a process of its own, held to one core, with a mosquitto broker, a record a vehicle, and all columns as JSON.
This process sends each vehicle's samples of a made-up pull, evenly spread over the time, and takes the time from sending a sample
to receiving its estimate through the broker again. All of it runs in real time (SCHED_RR) where the system allows that. The peer is a step
of filterpy's UKF on the same model (peer.py). --write puts the table into docs/live.md.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import pull
from bench_live import CORES, log_and_peer, usage
from marked import put
from mqtt_wire import Wire, broker, packet
from priority import prefer
from terragrip.live import read_record
from terragrip.recording import Recording

DOCUMENT = Path(__file__).resolve().parents[1] / "docs" / "live.md"
BEGIN = "<!-- made by benchmarks/bench_live_many.py --write -->"
LEARNED = 55.0  # s after which noise is learned ever more rarely


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--vehicles", type=int, default=200)
    parser.add_argument("--rate", type=int, default=10, help="samples a second of each")
    parser.add_argument("--seconds", type=float, default=120.0)
    parser.add_argument("--write", action="store_true", help="put the table into docs/live.md")
    options = parser.parse_args()
    prefer()
    with tempfile.TemporaryDirectory(prefix="terragrip-bench-") as name:
        folder = Path(name)
        vehicle, vehicle_file = pull.vehicle(folder)
        log, step = log_and_peer(vehicle)
        text = bench(options, log, vehicle_file, folder, step)
    print(text)
    if options.write:
        put(DOCUMENT, BEGIN, text)


def bench(options: argparse.Namespace, log: Recording, vehicle_file: Path, folder: Path, step: float) -> str:
    """The table."""
    count, rate = options.vehicles, options.rate
    rounds = round(options.seconds * rate)
    payloads = samples(log, rate)
    with broker(folder) as (port, pid):
        os.sched_setaffinity(0, CORES[-1:])
        os.sched_setaffinity(pid, CORES[-1:])
        prefer(pid)
        process = start(vehicle_file, folder / "record", port)
        out, back = Wire(port, "sender"), Wire(port, "listener")
        back.subscribe("field/+/estimate")
        time.sleep(4.0)
        empty = held(process.pid)
        sent, got = np.zeros((rounds, count)), np.full((rounds, count), np.nan)
        marks: list[tuple[float, float]] = []  # when, processor used
        listener = threading.Thread(target=listen, args=(back, got, rate))
        listener.start()
        send(out, payloads, rate, sent, lambda: marks.append((time.perf_counter(), usage(process.pid))))
        listener.join()
        full = held(process.pid)
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=120)
    kept = sum(len(read_record(folder / "record" / f"v{k:03d}")[0]) for k in range(count))
    delay = 1e3 * (got - sent)
    missing = int(np.isnan(got).sum())
    settled = min(round(LEARNED * rate), rounds // 2)
    (t0, u0), (t1, u1) = marks[min(settled // rate, len(marks) - 2)], marks[-1]
    share = (u1 - u0) / (t1 - t0)
    whole = (marks[-1][1] - marks[0][1]) / (marks[-1][0] - marks[0][0])
    late = delay[settled:]
    rows = [
        ("of a core, once noise is learned; over all", f"{100 * share:.0f} %, {100 * whole:.0f} %"),
        ("us a sample", f"{1e6 * share / (count * rate):.0f}"),
        ("of the peer's step", f"{share / (count * rate) / step:.2f}"),
        ("estimates missing", f"{missing} of {count * rounds}"),
        ("rows not recorded", f"{count * rounds - kept}"),
        ("delay once noise is learned: median, p99, most, ms", spread(late)),
        ("delay in the first minute, while it is: median, p99, most, ms", spread(delay[:settled])),
        ("memory without a vehicle, MB; more a vehicle, MB", f"{empty:.0f}; {(full - empty) / count:.2f}"),
    ]  # fmt: skip
    lines = [
        f"{count} vehicles at {rate} Hz, {options.seconds:.0f} s; peer: a step of filterpy's UKF, {1e6 * step:.0f} us in this run. "
        f"Load of the machine's {os.cpu_count()} cores at its end, this run included: {os.getloadavg()[0]:.0f}.",
        "",
        "| | seen |",
        "|---|---:|",
        *(f"| {name} | {value} |" for name, value in rows),
    ]
    if said.strip():
        print(said.decode()[-2000:], file=sys.stderr)
    return "\n".join(lines)


def spread(delay: np.ndarray) -> str:
    """Median, 99 % and most."""
    return "{:.1f}, {:.1f}, {:.0f}".format(*np.nanpercentile(delay, [50, 99, 100]))


def start(vehicle_file: Path, record: Path, port: int) -> subprocess.Popen[bytes]:
    """`terragrip live` of many on the first core."""
    at = f"mqtt://127.0.0.1:{port}/field/{{vehicle}}"
    process = subprocess.Popen(
        [
            str(Path(sys.executable).with_name("terragrip")), "live", "--quiet", "--vehicle", str(vehicle_file),
            "--source", f"{at}/sample", "--sink", at, "--record", str(record),
        ],
        stderr=subprocess.PIPE,
    )  # fmt: skip
    os.sched_setaffinity(process.pid, CORES[:1])
    prefer(process.pid)
    return process


def samples(log: Recording, rate: int) -> list[str]:
    """The log's rows at the rate, as JSON without the time."""
    names = [name for name in log.channels if name not in log.references]
    every = max(round(1.0 / rate / float(np.median(np.diff(log.time)))), 1)
    columns = np.column_stack([log.channels[name] for name in names])[::every]
    return [json.dumps(dict(zip(names, row.tolist(), strict=True)))[1:] for row in columns]


def send(wire: Wire, payloads: list[str], rate: int, sent: np.ndarray, mark) -> None:
    """Each vehicle's sample of each round, evenly spread; ``mark`` once a second."""
    rounds, count = sent.shape
    began = time.perf_counter()
    for k in range(rounds):
        if k % rate == 0:
            mark()
        for v in range(count):
            body = payloads[(k + 7 * v) % len(payloads)]
            data = packet(f"field/v{v:03d}/sample", f'{{"time":{k / rate},{body}'.encode())
            while (left := began + (k + v / count) / rate - time.perf_counter()) > 0:
                time.sleep(left)
            sent[k, v] = time.perf_counter()
            wire.link.sendall(data)
    mark()


def listen(wire: Wire, got: np.ndarray, rate: int) -> None:
    """Note when each row's estimate came, until nothing does for 5 s."""
    wire.link.settimeout(15.0)
    while not np.isfinite(got[-1]).all():
        try:
            for topic, payload in wire.messages():
                if b'"predicted":false' in payload[:200]:
                    now = time.perf_counter()
                    k = round(rate * float(payload[8 : payload.index(b",")]))
                    got[k, int(topic[7:10])] = now
        except TimeoutError:
            return


def held(pid: int) -> float:
    """Memory that a process holds now, MB."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


if __name__ == "__main__":
    main()
