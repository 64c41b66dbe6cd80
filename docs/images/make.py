"""The README's picture, out of a demo folder: `make demo` (or `terragrip demo -o FOLDER`), then

    python docs/images/make.py [FOLDER]

It copies the figure of multi2 with a white sheet under it, so that it reads on a dark page too.
"""

from __future__ import annotations

import sys
from pathlib import Path

PICTURES = {"traction-multi2.svg": "demo.svg"}
LARGEST = 300_000  # bytes


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "terragrip-demo") / "figures"
    for source, target in PICTURES.items():
        svg = (folder / source).read_bytes()
        if len(svg) > LARGEST:
            raise SystemExit(f"{source} has {len(svg)} bytes, more than {LARGEST}")
        path = Path(__file__).with_name(target)
        path.write_bytes(svg)
        print(f"{path}: {len(svg)} bytes")


if __name__ == "__main__":
    main()
