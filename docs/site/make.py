"""Build the documentation site: the pages of docs/, and the reference made from the code.

    python docs/site/make.py [-o build/docs]          # make docs

Pages are copied into a folder beside the output; what the code itself knows (commands, keys, channels, columns, the Python and
C interfaces, licences) is written there as pages too, anew at each build. Sphinx makes HTML of it, with every warning an error: a
link that leads nowhere, a page that the table of contents lacks. Nothing is loaded from the network, when built or when read.
"""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import c_reference
import commands
import drawing
import licences
import python_reference
import tables

HERE = Path(__file__).resolve().parent
DOCS = HERE.parent

GENERATED: dict[str, Callable[[], str]] = {
    "commands": commands.page,
    "profile-keys": tables.profile_keys,
    "channels": tables.channels,
    "estimates-columns": tables.estimates_columns,
    "python": python_reference.page,
    "c": c_reference.page,
    "licences": lambda: f"# Licences\n\n{licences.table()}",
}
"""Pages made from the code, by name: what writes each."""

CONTENTS: dict[str, list[str]] = {
    "Tutorials": ["tutorial", "tutorial-tractor", "tutorial-rover", "tutorial-wheel-rig"],
    "How to": [
        "install",
        "formats",
        "inspect",
        "calibrate",
        "soils",
        "ground",
        "ground-classifier",
        "report",
        "studio",
        "live",
        "controller",
        "simulation",
    ],
    "Reference": [
        "commands",
        "vehicle",
        "profile-keys",
        "channels",
        "estimates-columns",
        "events",
        "python",
        "c",
        "glossary",
        "licences",
    ],
    "Science": [
        "physics",
        "methods",
        "families",
        "families-history",
        "ground-history",
        "vehicle-history",
        "maps-history",
        "advice-history",
        "warning",
        "warning-history",
        "real-logs",
        "real-logs-history",
        "benchmarks",
    ],
    "Inside": [
        "architecture",
        "architecture-history",
        "live-history",
        "checks-history",
        "formats-history",
        "kernel",
        "tuned-numbers",
        "ablation",
        "mutants",
        "decisions/README",
    ],
}
"""The site's table of contents. A page of docs/ that stands nowhere here is put at the end of the how-tos."""

_OUTSIDE = re.compile(
    r"\[([^\]]*)\]\(\.\./([^)\s]+)\)"
)  # a link to a file beside docs/, which is no part of the site


def contents() -> dict[str, list[str]]:
    """The table of contents with every page of docs/ in it."""
    named = {name for names in CONTENTS.values() for name in names}
    others = sorted({path.stem for path in DOCS.glob("*.md")} - named - {"README"})
    return {title: [*names, *(others if title == "How to" else [])] for title, names in CONTENTS.items()}


def assemble(folder: Path) -> None:
    """Write the site's sources into an empty folder: pages, pictures, generated pages, Sphinx's settings."""
    folder.mkdir(parents=True)
    for path in DOCS.glob("*.md"):
        text = path.read_text(encoding="utf-8")
        (folder / path.name).write_text(_OUTSIDE.sub(r"\1 (`\2`)", text), encoding="utf-8")
    shutil.copytree(DOCS / "images", folder / "images", ignore=shutil.ignore_patterns("*.py", "__pycache__"))
    shutil.copytree(DOCS / "decisions", folder / "decisions")
    for name, write in GENERATED.items():
        (folder / f"{name}.md").write_text(write(), encoding="utf-8")
    (folder / "images" / "axes.svg").write_text(drawing.axes(), encoding="utf-8")
    with (folder / "README.md").open("a", encoding="utf-8") as index:
        for title, names in contents().items():
            index.write(f"\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n" + "\n".join(names) + "\n```\n")
    with (folder / "decisions" / "README.md").open("a", encoding="utf-8") as index:
        names = sorted(path.stem for path in DOCS.glob("decisions/[0-9]*.md"))
        index.write("\n```{toctree}\n:hidden:\n\n" + "\n".join(names) + "\n```\n")
    shutil.copy(HERE / "conf.py", folder)


def build(source: Path, target: Path) -> int:
    """HTML by Sphinx of the assembled folder; its exit code."""
    from sphinx.cmd.build import build_main

    code = build_main(
        ["--builder", "html", "--quiet", "--fail-on-warning", "--keep-going", str(source), str(target)]
    )
    if code == 0:
        shutil.copy(target / "README.html", target / "index.html")
        shutil.rmtree(target / ".doctrees", ignore_errors=True)
    return code


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=DOCS.parent / "build" / "docs")
    wanted = parser.parse_args()
    target: Path = wanted.output.absolute()
    source = target.with_name(f"{target.name}-source")
    for folder in (source, target):
        shutil.rmtree(folder, ignore_errors=True)
    assemble(source)
    code = build(source, target)
    if code == 0:
        print(f"The documentation is {target / 'index.html'}")
    return code


if __name__ == "__main__":
    sys.exit(main())
