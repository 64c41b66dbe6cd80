"""Memory and speed of reading large logs: peak memory over the size of the file, and seconds a gigabyte.

    python benchmarks/bench_formats.py [megabytes, default 100] [kinds, default all]
    python benchmarks/bench_formats.py --large [megabytes, default 5000] [words of the logs' names, default all]
    python benchmarks/bench_formats.py --libraries [megabytes, default 500] [words of the logs' names, default all]

Writes a candump log, an MF4 file (signals, and bus logging) and an MCAP file of that size, most of which nobody asks for,
and reads what a profile asks for in a process of its own. The peer, where there is one, is the plain loop of the library
that reads the same file without keeping anything. What is wanted: memory stays far below the file's size, so that 5 GB fit
into 2 GB. ``--large`` tries that with the logs of `large_logs` (as much room again on the disk): they go through `tg.read`,
``terragrip inspect`` and ``terragrip estimate``, with the peak of all memory, mapped files and all; the peer reads a log of a tenth
of the size. ``--libraries`` holds the library's own loop, which keeps nothing, against the whole of ``terragrip estimate`` on the
same log, by seconds of the processor (others at work on the machine change these little).
"""

from __future__ import annotations

import os
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from large_can_logs import FRAME
from large_logs import LARGE, Large, profile_of_struct

READ = """
import terragrip as tg
from terragrip.formats import Profile
profile = Profile.from_dict({profile!r})
recording = tg.read({path!r}, profile)
assert len(recording) > 1000
"""
PEERS = {
    "candump": "import can\nfor message in can.CanutilsLogReader({path!r}): pass",
    "mcap": "from mcap.stream_reader import StreamReader\nfor record in StreamReader(open({path!r}, 'rb')).records: pass",
    "mf4 bus": "import asammdf\nfile = asammdf.MDF({path!r})\nfile.get('CAN_DataFrame', raw=True)",
    "mf4 signals": "import asammdf\nfile = asammdf.MDF({path!r})\nfor n in ('v', 'u'): file.get(n)",
}
TRACTOR = {
    "channels": {"wheel_based_speed": "WheelBasedMachineSpeed", "ground_speed": "GroundBasedMachineSpeed"}
}
NAMED = {"channels": {"wheel_based_speed": "u", "ground_speed": "v"}}
TOPIC = {"channels": {"wheel_based_speed": "/speed.u", "ground_speed": "/speed.v"}}


VEHICLE = """
mass: 60 kg
wheelbase: 0.6 m
center_of_gravity_height: 0.3 m
hitch_height: 0.25 m
axles:
  front: {mass: 30 kg, wheels: [fl, fr]}
  rear: {mass: 30 kg, wheels: [rl, rr]}
wheel: {radius: 0.2 m, inertia: 0.1 kg m^2}
"""


def candump(path: Path, size: int) -> None:
    """Mostly frames of other identifiers, as on a real bus."""
    with path.open("w") as stream:
        first = 0
        while stream.tell() < size:
            lines = []
            for k in range(first, first + 20_000):
                stamp = 1.7e9 + k * 5e-4
                other = k % 20
                identifier = {0: "0CFE48F0", 1: "0CFE4980"}.get(other, f"18FF{other:02X}17")
                speed = struct.pack("<HIBB", 2000 + k % 100, 0, 255, 0xFD).hex().upper()
                lines.append(f"({stamp:.6f}) can0 {identifier}#{speed}\n")
            first += 20_000
            stream.writelines(lines)


def mf4_bus(path: Path, size: int) -> None:
    """A bus log as loggers write it."""
    import asammdf

    count = size // (FRAME.itemsize + 8)
    records = np.zeros(count, FRAME)
    other = np.arange(count) % 20
    records["CAN_DataFrame.ID"] = np.where(
        other == 0, 0x0CFE48F0, np.where(other == 1, 0x0CFE4980, 0x18FF0017 + 256 * other)
    )
    records["CAN_DataFrame.IDE"], records["CAN_DataFrame.DLC"], records["CAN_DataFrame.DataLength"] = 1, 8, 8
    records["CAN_DataFrame.DataBytes"] = np.frombuffer(struct.pack("<HIBB", 2000, 0, 255, 0xFD), np.uint8)
    source = asammdf.Source("CAN", "CAN", "", asammdf.Source.SOURCE_BUS, asammdf.Source.BUS_TYPE_CAN)
    with asammdf.MDF() as file:
        file.append(
            asammdf.Signal(records, np.arange(count) * 5e-4, name="CAN_DataFrame", source=source),
            acq_source=source,
        )
        file.save(path, overwrite=True)


def mf4_signals(path: Path, size: int) -> None:
    """Fifty signals of one clock, of which two are wanted."""
    import asammdf

    count = size // (51 * 8)
    time_ = np.arange(count) * 1e-2
    with asammdf.MDF() as file:
        names = ["v", "u", *(f"s{k}" for k in range(48))]
        file.append([asammdf.Signal(2 + 0.1 * np.sin(time_ + k), time_, name=n) for k, n in enumerate(names)])
        file.save(path, overwrite=True)


def mcap(path: Path, size: int) -> None:
    """Camera images beside a small topic of JSON."""
    from mcap.writer import CompressionType, Writer

    image = np.random.default_rng(0).bytes(50_000)
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.NONE)
        writer.start()
        schema = writer.register_schema("speed", "jsonschema", b"{}")
        speed = writer.register_channel("/speed", "json", schema)
        camera = writer.register_channel("/camera", "jpeg", 0)
        for k in range(size // 51_000):
            for j in range(10):
                stamp = (k * 10 + j) * 10_000_000
                writer.add_message(speed, stamp, b'{"u": 2.1, "v": 2.0}', stamp)
            writer.add_message(camera, stamp, image, stamp)
        writer.finish()


def measured(
    code: str, *command: str, kinds: tuple[str, ...] = ("RssAnon", "RssShmem")
) -> tuple[float, float]:
    """Seconds and peak MB of a process of its own with its children: memory that is theirs, not the mapped file's.

    ``kinds``: what counts, by its names in /proc; ``command`` in place of Python's ``code``.
    """
    begun, peak = time.perf_counter(), 0
    process = subprocess.Popen(
        command or [sys.executable, "-W", "ignore", "-c", code], stdout=subprocess.DEVNULL
    )
    while process.poll() is None:
        peak = max(peak, sum(own_memory(number, kinds) for number in family(process.pid)))
        time.sleep(0.01)
    if process.returncode:
        sys.exit(f"the process failed: {code}")
    return time.perf_counter() - begun, peak / 1024


def family(number: int) -> list[int]:
    """A process and those that it started."""
    try:
        children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
    except OSError:
        return [number]
    return [number, *(grandchild for child in children for grandchild in family(int(child)))]


def own_memory(number: int, kinds: tuple[str, ...]) -> int:
    """Resident memory [kB] of a process, of some kinds."""
    try:
        lines = Path(f"/proc/{number}/status").read_text().splitlines()
    except OSError:
        return 0
    return sum(int(line.split()[1]) for line in lines if line.startswith(kinds))


CASES = {
    "candump": (candump, "log.log", TRACTOR),
    "mf4 bus": (mf4_bus, "bus.mf4", TRACTOR),
    "mf4 signals": (mf4_signals, "signals.mf4", NAMED),
    "mcap": (mcap, "log.mcap", TOPIC),
}


def large(size: int, words: list[str]) -> None:
    """Print the table of logs of gigabytes."""
    print("| log | MB | what | peak MB | s | MB/s | MB/s of the library's own loop |")
    print("|---|---:|---|---:|---:|---:|---:|")
    for name, log in LARGE.items():
        if all(word.lower() in name.lower() for word in words):
            with tempfile.TemporaryDirectory() as folder:
                tried(name, log, size, Path(folder))


def tried(name: str, log: Large, size: int, folder: Path) -> None:
    """Print the rows of one log."""
    vehicle, out, path = folder / "vehicle.yaml", folder / "estimates.parquet", folder / log.file
    vehicle.write_text(VEHICLE)
    (folder / "struct.yaml").write_text(profile_of_struct())
    profile = [word.format(folder=folder) for word in log.profile]
    peer = f"{own_pace(name, log, size // 10, path):.0f}" if log.loop else ""
    write(name, path, size)
    megabytes, command = path.stat().st_size / 1e6, (sys.executable, "-m", "terragrip")
    work = {
        "`tg.read`": (f"import terragrip as tg; tg.read({str(path)!r}, *{profile[1:]!r})",),
        "`terragrip inspect`": ("", *command, "inspect", str(path)),
        "`terragrip estimate`": (
            "", *command, "estimate", str(path), "--vehicle", str(vehicle), *profile, "-o", str(out), "--quiet",
        ),
    }  # fmt: skip
    for what, arguments in work.items():
        if log.recording_fits or what != "`tg.read`":
            seconds, peak = measured(*arguments, kinds=("VmRSS",))
            pace = megabytes / seconds
            print(
                f"| {name} | {megabytes:.0f} | {what} | {peak:.0f} | {seconds:.0f} | {pace:.0f} | {peer} |",
                flush=True,
            )


def own_pace(name: str, log: Large, size: int, path: Path) -> float:
    """MB/s of the library's own loop over a log of this size."""
    write(name, path, size)
    seconds, _ = measured(log.loop.format(path=str(path)))
    return path.stat().st_size / 1e6 / seconds


def write(name: str, path: Path, size: int) -> None:
    """Write a log in a process of its own, which takes its memory with it."""
    path.unlink(missing_ok=True)
    subprocess.run([sys.executable, __file__, "--write-large", name, str(path), str(size)], check=True)


def libraries(size: int, words: list[str]) -> None:
    """Print what the loop of a library costs beside a whole estimate."""
    print("| log | MB | the library's own loop, CPU s | `estimate`, CPU s | ratio |")
    print("|---|---:|---:|---:|---:|")
    for name, log in LARGE.items():
        if log.loop and all(word.lower() in name.lower() for word in words):
            with tempfile.TemporaryDirectory() as folder:
                path, vehicle = Path(folder) / log.file, Path(folder) / "vehicle.yaml"
                vehicle.write_text(VEHICLE)
                (Path(folder) / "struct.yaml").write_text(profile_of_struct())
                write(name, path, size)
                alone = processor_seconds(
                    sys.executable, "-W", "ignore", "-c", log.loop.format(path=str(path))
                )
                profile = [word.format(folder=folder) for word in log.profile]
                whole = processor_seconds(
                    sys.executable, "-m", "terragrip", "estimate", str(path), "--vehicle", str(vehicle), *profile,
                    "-o", str(Path(folder) / "estimates.parquet"), "--quiet",
                )  # fmt: skip
                megabytes = path.stat().st_size / 1e6
                print(
                    f"| {name} | {megabytes:.0f} | {alone:.1f} | {whole:.1f} | {alone / whole:.2f} |",
                    flush=True,
                )


def processor_seconds(*command: str) -> float:
    """Seconds of the processor that a command takes, with its children; ends the program where it fails."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        sys.exit(f"it failed: {command}")
    return used.ru_utime + used.ru_stime


def main() -> None:
    """Print the table."""
    if sys.argv[1:2] == ["--large"]:
        large(int(sys.argv[2] if len(sys.argv) > 2 else 5000) * 1_000_000, sys.argv[3:])
        return
    if sys.argv[1:2] == ["--libraries"]:
        libraries(int(sys.argv[2] if len(sys.argv) > 2 else 500) * 1_000_000, sys.argv[3:])
        return
    size = int(sys.argv[1] if len(sys.argv) > 1 else 100) * 1_000_000
    chosen = sys.argv[2:] or list(CASES)
    idle = measured("import terragrip as tg\nfrom terragrip.formats import Profile\nimport numpy, pandas")[1]
    print(f"peak memory of a process that reads nothing: {idle:.0f} MB\n")
    print("| log | MB | peak MB | beyond idle, of the file | s | s of the library's own loop | ratio |")
    print("|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for name in chosen:
            _, file, profile = CASES[name]
            path = Path(folder) / file
            subprocess.run([sys.executable, __file__, "--write", name, str(path), str(size)], check=True)
            megabytes = path.stat().st_size / 1e6
            seconds, peak = measured(READ.format(profile=profile, path=str(path)))
            peer, _ = measured(PEERS[name].format(path=str(path)))
            share, ratio = (peak - idle) / megabytes, seconds / peer
            print(
                f"| {name} | {megabytes:.0f} | {peak:.0f} | {share:.2f} | {seconds:.1f} | {peer:.1f} | {ratio:.2f} |",
                flush=True,
            )
            path.unlink()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--write"]:
        CASES[sys.argv[2]][0](Path(sys.argv[3]), int(sys.argv[4]))
    elif sys.argv[1:2] == ["--write-large"]:
        LARGE[sys.argv[2]].write(Path(sys.argv[3]), int(sys.argv[4]))
    else:
        main()
