"""Run every command of docs/worked-examples.md in a folder.

    python examples/worked_examples.py [-o build/worked] [--picture]

The page is the one list of commands. --picture puts the rover's map (MIT) into docs/images.
"""

from __future__ import annotations

import argparse
import os
import re
import shlex
import shutil
from pathlib import Path

from terragrip.cli import main as terragrip

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs/worked-examples.md"
PICTURE = ROOT / "docs/images/pathfinder-map.png"


def commands(data: Path) -> list[list[str]]:
    """The page's commands without their first word, with the places of the data and of the examples."""
    blocks = re.findall(r"```sh\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    lines = [shlex.split(line) for block in blocks for line in block.splitlines() if line.strip()]
    return [[_place(word, data) for word in line[1:]] for line in lines]


def _place(word: str, data: Path) -> str:
    if word.startswith("../shared/data/"):
        return str(data / word.removeprefix("../shared/data/"))
    return str(ROOT / word) if word.startswith("examples/") else word


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("build/worked"))
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared/data")
    parser.add_argument("--picture", action="store_true", help="copy the rover's map into docs/images")
    arguments = parser.parse_args()
    if not arguments.data.is_dir():
        raise SystemExit(f"{arguments.data}: no such folder; name the data with --data")
    data = arguments.data.resolve()
    arguments.output.mkdir(parents=True, exist_ok=True)
    os.chdir(arguments.output)
    for words in commands(data):
        print(f"\n$ terragrip {shlex.join(words)}", flush=True)
        if code := terragrip(words):
            raise SystemExit(code)
    if arguments.picture:
        shutil.copyfile("rover.png", PICTURE)


if __name__ == "__main__":
    main()
