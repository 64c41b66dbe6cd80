"""Fuzz everything that parses what others wrote, by coverage (atheris on libFuzzer): read, or refused by an InputError in one line.

    python fuzz/parsers.py --each SECONDS [TARGET ...]     every target, each in a process of its own
    python fuzz/parsers.py TARGET [libFuzzer's options]    one target, e.g. -max_total_time=60, or a file that was found

A target's corpus is fuzz/corpus/TARGET (committed, small) and build/fuzz/TARGET (what earlier runs found, and files by the tests' writers).
What fails is written to build/fuzz/found and named.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

HERE = Path(__file__).parent
BUILD = HERE.parent / "build" / "fuzz"
LONGEST = 4000
"""Bytes of an input at most, unless a seed of a binary form is longer: short files are tried a hundred times as fast."""
Check = Callable[[bytes], object]


def of_file(suffix: str, read: Callable[[Path], object]) -> Check:
    """Of a reader of files: from memory, where there is such a file system."""
    folder = Path(tempfile.mkdtemp(prefix="fuzz-", dir="/dev/shm" if os.path.isdir("/dev/shm") else None))
    path = folder / f"input{suffix}"

    def check(data: bytes) -> object:
        path.write_bytes(data)
        return read(path)

    return check


def log(suffix: str) -> Callable[[], Check]:
    def target() -> Check:
        from terragrip.formats.reading import read_table

        return of_file(suffix, read_table)

    return target


def vehicle() -> Check:
    from terragrip import Vehicle

    return of_file(".yaml", Vehicle.load)


def profile() -> Check:
    from terragrip.formats import Profile

    return of_file(".yaml", Profile.load)


def soils() -> Check:
    from terragrip.soil.library import SoilLibrary

    return of_file(".json", SoilLibrary.load)


def ground() -> Check:
    from terragrip.ground.result import read

    return of_file(".json", read)


def message() -> Check:
    """A message of a broker or a datagram, with and without a profile."""
    from terragrip.formats import Profile
    from terragrip.live.decode import Decoder
    from terragrip.live.feed import Feed
    from terragrip.live.inbox import Inbox
    from terragrip.live.payload import unpacker

    mapped = Profile.load(HERE / "corpus" / "profile" / "every_key.yaml")
    feeds = [
        Feed(0, "fuzz", Decoder(one), unpacker(None if one is None else one.payload), Inbox(), after=0.0)
        for one in (None, mapped)
    ]

    def check(data: bytes) -> None:
        for feed in feeds:
            feed.message(data, topic="a/b")
            samples = feed.inbox.samples
            assert all(isinstance(value, float) for sample in samples for value in sample[3].values())
            samples.clear()

    return check


def frame() -> Check:
    """A CAN frame: four bytes of identifier, the data."""
    from terragrip.live.frame_decoder import FrameDecoder

    decoder = FrameDecoder([], lambda name: True)

    def check(data: bytes) -> None:
        identifier = int.from_bytes(data[:4], "little")
        fields = decoder.fields(identifier & 0x1FFFFFFF, bool(identifier >> 31), data[4:68])
        assert all(isinstance(value, float) for value in fields.values())

    return check


LOGS = (
    ".csv",
    ".vbo",
    ".nmea",
    ".asc",
    ".trc",
    ".log",
    ".blf",
    ".bag",
    ".db3",
    ".mcap",
    ".mat",
    ".mf4",
    ".parquet",
)
TARGETS: dict[str, Callable[[], Check]] = {
    **{suffix[1:]: log(suffix) for suffix in LOGS},
    **{one.__name__: one for one in (vehicle, profile, soils, ground, message, frame)},
}


def seeds(name: str) -> None:
    """Files by the writers of the tests into the target's folder of build."""
    folder = BUILD / name
    if folder.exists():
        return
    folder.mkdir(parents=True)
    sys.path[:0] = [str(HERE.parent / "tests" / "formats"), str(HERE.parent / "tests")]
    from test_damage import SAMPLES

    for kind, write in SAMPLES.items():
        with tempfile.TemporaryDirectory() as scratch:
            file = write(Path(scratch))
            if file.suffix == f".{name}":
                content = file.read_bytes()
                (folder / kind.replace(" ", "_")).write_bytes(
                    content[:LONGEST] if content.isascii() else content
                )
    if name == "parquet":
        import pandas as pd

        pd.DataFrame({"time": [0.0, 0.1, 0.2], "ground_speed": [1.0, None, 1.2]}).to_parquet(
            folder / "three_rows"
        )


def fuzz(name: str, options: list[str]) -> None:
    """Does not return: libFuzzer ends the process."""
    import atheris

    with atheris.instrument_imports(
        include=["terragrip"]
    ):  # at any time: many are imported where they are used
        seeds(name)
        from terragrip.errors import InputError

        check = TARGETS[name]()

        def one(data: bytes) -> None:
            try:
                check(data)
            except InputError as error:
                if "\n" in str(error):
                    raise AssertionError("not in one line") from error

        corpora = [folder for folder in (BUILD / name, HERE / "corpus" / name) if folder.is_dir()]
        sizes = [file.stat().st_size for folder in corpora for file in folder.iterdir()]
        found = BUILD / "found"
        found.mkdir(parents=True, exist_ok=True)
        limits = [f"-max_len={max([LONGEST, *sizes])}", "-timeout=60", "-rss_limit_mb=3000"]
        files = [] if any(not option.startswith("-") for option in options) else map(str, corpora)
        atheris.Setup([sys.argv[0], *limits, f"-artifact_prefix={found}/{name}-", *options, *files], one)
        atheris.Fuzz()


def each(seconds: int, names: list[str]) -> int:
    """Every target for so long; how many failed."""
    if importlib.util.find_spec("atheris") is None:
        print(
            "SKIPPED: the parsers' fuzzers need atheris, which has no wheel for this Python or machine",
            file=sys.stderr,
        )
        return 0
    failed = 0
    for name in names or TARGETS:
        begin = time.monotonic()
        command = [sys.executable, __file__, name, f"-max_total_time={seconds}", "-print_final_stats=1"]
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        runs = [line.split()[-1] for line in done.stderr.splitlines() if "number_of_executed_units" in line]
        said = "passed" if done.returncode == 0 else "FAILED"
        print(
            f"{name}: {said}, {runs[0] if runs else 'no'} inputs in {time.monotonic() - begin:.0f} s",
            flush=True,
        )
        if done.returncode:
            failed += 1
            print("\n".join(done.stderr.splitlines()[-40:]), flush=True)
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--each", type=int, metavar="SECONDS")
    parser.add_argument("target", nargs="*")
    given, options = parser.parse_known_args()
    unknown = [name for name in given.target[: None if given.each else 1] if name not in TARGETS]
    if unknown or not (given.each or given.target):
        parser.error(f"targets are {', '.join(TARGETS)}")
    if given.each:
        return min(1, each(given.each, given.target))
    fuzz(given.target[0], [*given.target[1:], *options])
    return 0


if __name__ == "__main__":
    sys.exit(main())
