"""The licences of what Terragrip stands on, and whether one forbids shipping.

    python docs/site/licences.py

Python packages are those of requirements.lock that are installed here; the pages' packages those of web/package-lock.json that the
build puts into the pages. Exit code 1 where a licence forbids shipping or is unknown.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

# Beside an Apache-2.0 program: what may be shipped with it (or, LGPL and MPL, installed unchanged beside it).
FIT = re.compile(
    r"\b(MIT|MIT-0|MIT-CMU|BSD|0BSD|BSD-[23]-Clause|Apache|Apache-2\.0|ISC|ISCL|PSF|PSF-2\.0|Python Software Foundation"
    r"|Zlib|CC0-1\.0|EPL-2\.0|MPL|MPL-2\.0|LGPL|LGPLv3|LGPL-3\.0-only|any-OSI|Unlicense)\b"
)
FORBIDDING = re.compile(
    r"(?<!L)\b(A?GPL|A?GPLv\d\+?|A?GPL-[\d.]+[\w-]*|Affero|SSPL|BUSL|CC-BY-NC[\w.-]*|[Nn]on-?[Cc]ommercial|Proprietary)"
)


@dataclass(frozen=True)
class Package:
    """A package and its licence in the words of its own metadata; ``shipped``: a part of the wheel itself."""

    name: str
    version: str
    licence: str
    shipped: bool = False

    @property
    def problem(self) -> str | None:
        """Why it may not be shipped, or None. Of alternatives (OR) one that fits is enough."""
        choices = re.split(r"\s+OR\s+|\s+or\s+", self.licence.strip("()"))
        fit = [one for one in choices if FIT.search(one) and not FORBIDDING.search(one)]
        if self.shipped:  # weak copyleft inside our own file would bind it
            fit = [one for one in fit if not re.search(r"LGPL|MPL|EPL", one)]
        if fit:
            return None
        return (
            "forbids shipping" if FORBIDDING.search(self.licence) else "has a licence that is not known here"
        )


def packages() -> list[Package]:
    """Every package: Python's by name, then those inside the pages."""
    return [*python_packages(), *page_packages()]


def python_packages() -> Iterable[Package]:
    """Those of requirements.lock; what another platform alone needs is not installed here and left out."""
    for name in re.findall(
        r"^([\w.-]+)==", (ROOT / "requirements.lock").read_text(encoding="utf-8"), re.MULTILINE
    ):
        try:
            about = metadata.metadata(name)
        except metadata.PackageNotFoundError:
            continue
        yield Package(name, about["Version"], _licence(about))


def _licence(about: metadata.PackageMetadata) -> str:
    """The SPDX expression, else the classifiers, else the first line of the licence's text."""
    expression = about.get("License-Expression")
    classifiers = [
        line.split("::")[-1].strip()
        for line in about.get_all("Classifier") or []
        if line.startswith("License ::")
    ]
    first = (about.get("License") or "").strip().partition("\n")[0][:60]
    return str(expression or " OR ".join(classifiers) or first)


def page_packages() -> Iterable[Package]:
    """Those of web/package-lock.json that are no tools."""
    lock = json.loads((ROOT / "web/package-lock.json").read_text(encoding="utf-8"))
    for path, about in lock["packages"].items():
        if path and not about.get("dev"):
            name = path.rpartition("node_modules/")[2]
            yield Package(name, about["version"], about.get("license", ""), shipped=True)


def table() -> str:
    """A Markdown table of all."""
    lines = ["| package | version | licence | where |", "|---|---|---|---|"]
    for one in packages():
        where = "inside the studio's pages" if one.shipped else "installed by pip"
        lines.append(f"| {one.name} | {one.version} | {one.licence} | {where} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    print(table())
    wrong = [one for one in packages() if one.problem]
    for one in wrong:
        print(f"{one.name} {one.version} {one.problem}: {one.licence!r}", file=sys.stderr)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
