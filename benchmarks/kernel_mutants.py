"""Do the C tests notice? Small changes of the kernel's C (mutants), each compiled and tried by kernel/tests.

    python benchmarks/kernel_mutants.py [--count 120] [--files filter bank ...] [--seed COMMIT]

As benchmarks/mutants.py does of the Python: places (an operator, a comparison, a number, an index) are drawn by the hash of the commit
uniformly over the sources, of each place one change. The changed file alone is compiled anew, in double precision; the programs of
kernel/tests run, quickest first, until one fails or takes far longer than it did. What lives is printed as a line and its change. Changes
that the compiler refuses are drawn again.
"""

from __future__ import annotations

import argparse
import random
import re
import subprocess
import sys
import time
from pathlib import Path

from which_tests import ROOT, git

CHANGES = {
    "+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "&&": "||", "||": "&&",
    "+=": "-=", "-=": "+=", "*=": "/=", "++": "--",
}  # fmt: skip
TOKEN = re.compile(
    r"(?<=[\w)\]] )(?:[-+*/]|[<>]=?|[=!]=|&&|\|\||[-+*]=)(?= )|\+\+|(?<![\w.])\d+(?:\.\d+)?(?![\w.])"
)
UNSEEN = re.compile(r"/\*.*?\*/|^#.*?$|\"[^\"]*\"", re.DOTALL | re.MULTILINE)
FLAGS = ["-std=c99", "-O1", "-w", "-Wno-psabi", "-Ikernel/include", "-Ikernel/src", "-Ikernel/tests"]
PATIENCE = 10.0  # times what a test took before, and 10 s
OUT = ROOT / "build" / "kernel-mutants"


def places(path: Path) -> list[tuple[Path, int, int]]:
    """Where a file can be changed: file, first and last character; not in comments, directives and texts."""
    text = path.read_text(encoding="utf-8")
    code = UNSEEN.sub(lambda found: " " * len(found.group()), text)
    return [(path, *found.span()) for found in TOKEN.finditer(code)]


def changed(text: str, start: int, end: int, draw: random.Random) -> str:
    """The text with its token at a place changed."""
    token = text[start:end]
    other = CHANGES.get(token) or (
        str(int(token) + draw.choice((-1, 1))) if token.isdigit() else str(2 * float(token))
    )
    return text[:start] + other + text[end:]


def compiled(source: Path, target: Path) -> bool:
    """Whether a C file compiles; its object is at ``target``."""
    return (
        subprocess.run(["cc", *FLAGS, "-c", source, "-o", target], cwd=ROOT, capture_output=True).returncode
        == 0
    )


def killer(changed_file: str, times: dict[str, float]) -> str | None:
    """The first test program that fails with the object of a changed file in place of that file's, or None."""
    objects = [
        OUT / ("mutant.o" if path.stem == changed_file else f"{path.stem}.o")
        for path in (ROOT / "kernel/src").glob("*.c")
    ]
    for name in sorted(times, key=lambda name: times[name]):
        program = OUT / f"{name}.program"
        if subprocess.run(
            ["cc", OUT / f"test_{name}.o", *objects, "-lm", "-o", program], capture_output=True
        ).returncode:
            return "link"
        began = time.monotonic()
        try:
            done = subprocess.run(
                [program], capture_output=True, timeout=10 + PATIENCE * times[name] if times[name] else None
            )
        except subprocess.TimeoutExpired:
            return name
        if done.returncode:
            return name
        times[name] = times[name] or time.monotonic() - began
    return None


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=120)
    parser.add_argument("--files", nargs="+", help="names of sources without .c; default: all")
    parser.add_argument(
        "--seed", default=git("rev-parse", "HEAD"), help="draw by this instead of the commit's hash"
    )
    wanted = parser.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    tests = sorted((ROOT / "kernel/tests").glob("*.c"))
    sources = sorted((ROOT / "kernel/src").glob("*.c"))
    made = [compiled(path, OUT / f"{path.stem}.o") for path in sources] + [
        compiled(path, OUT / f"test_{path.stem}.o") for path in tests
    ]
    times = {path.stem: 0.0 for path in tests}
    if not all(made) or (failed := killer("", times)):
        raise SystemExit(f"without a mutant {failed or 'a file'} fails")
    draw = random.Random(wanted.seed)
    every = [
        place for path in sources if not wanted.files or path.stem in wanted.files for place in places(path)
    ]
    draw.shuffle(every)
    tried = killed = 0
    for path, start, end in every:
        text = path.read_text(encoding="utf-8")
        mutant = changed(text, start, end, draw)
        (OUT / "mutant.c").write_text(mutant, encoding="utf-8")
        if not compiled(OUT / "mutant.c", OUT / "mutant.o"):
            continue
        tried += 1
        row = text.count("\n", 0, start)
        by = killer(path.stem, times)
        killed += by is not None
        if by is None:
            print(
                f"lived: {path.name}:{row + 1}\n- {text.splitlines()[row].strip()}\n+ {mutant.splitlines()[row].strip()}",
                flush=True,
            )
        if tried == wanted.count:
            break
    print(
        f"{killed} of {tried} mutants killed ({killed / tried:.0%}) at {git('rev-parse', 'HEAD')[:12]}, drawn by {wanted.seed[:12]}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
