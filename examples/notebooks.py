"""The example notebooks, one a dataset: made from the scripts in examples/notebooks, executed, and checked.

    python examples/notebooks.py [NAME ...] [--data ../shared/data] [--output build/notebooks]

A script is a notebook in percent cells (``# %%`` code, ``# %% [markdown]`` text). Measured data are others': they are read from the
folder of shared data, and a notebook whose data are absent says so in its first lines and ends there. Outputs go to build/, not into git.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
SCRIPTS = HERE / "notebooks"


def cells_of(script: str) -> list[tuple[str, str]]:
    """Kind ("markdown" or "code") and text of each cell of a script in percent cells."""
    found = []
    for part in re.split(r"^# %%", script, flags=re.MULTILINE)[1:]:
        head, _, body = part.partition("\n")
        is_text = "[markdown]" in head
        lines = [line.removeprefix("# ").removeprefix("#") if is_text else line for line in body.splitlines()]
        found.append(("markdown" if is_text else "code", "\n".join(lines).strip()))
    return [(kind, text) for kind, text in found if text]


def notebook_of(script: Path) -> Any:
    """The notebook of a script, not executed."""
    from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

    make = {"markdown": new_markdown_cell, "code": new_code_cell}
    cells = [make[kind](text) for kind, text in cells_of(script.read_text(encoding="utf-8"))]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"  # the same script gives the same notebook
    python = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return new_notebook(cells=cells, metadata={"kernelspec": python})


def executed(script: Path, data: Path) -> Any:
    """The notebook of a script with its outputs; raises nbclient's CellExecutionError where a cell fails."""
    from nbclient import NotebookClient

    os.environ["TERRAGRIP_DATA"] = str(data)
    notebook = notebook_of(script)
    NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(HERE)}}
    ).execute()
    return notebook


def main() -> int:
    """Make the notebooks; 0 where every cell of every one ran."""
    import nbformat

    known = sorted(path.stem for path in SCRIPTS.glob("*.py"))
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(known)}; none: all")
    arguments.add_argument("--data", type=Path, default=HERE.parents[1] / "shared" / "data")
    arguments.add_argument("--output", type=Path, default=HERE.parent / "build" / "notebooks")
    given = arguments.parse_args()
    unknown = sorted(set(given.names) - set(known))
    if unknown:
        print(f"there is no notebook {unknown[0]}; there are {', '.join(known)}", file=sys.stderr)
        return 2
    given.output.mkdir(parents=True, exist_ok=True)
    failed = 0
    for name in given.names or known:
        try:
            notebook = executed(SCRIPTS / f"{name}.py", given.data.resolve())
        except Exception as error:  # noqa: BLE001 - of whatever kind: the others are tried too
            print(f"{name}: {str(error).strip().splitlines()[-1]}", file=sys.stderr)
            failed += 1
            continue
        nbformat.write(notebook, given.output / f"{name}.ipynb")
        outputs = sum(len(cell.get("outputs", ())) for cell in notebook.cells)
        print(f"{given.output / name}.ipynb: {len(notebook.cells)} cells, {outputs} outputs")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
