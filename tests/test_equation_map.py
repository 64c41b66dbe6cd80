"""The map of equations in docs/physics.md: every equation of the paper has its places, and each place cites it."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LABELS = {
    1: "eq:force_balance_horizontal",
    2: "eq:torque_balance",
    3: "eq:vehicle_dynamics",
    4: "eq:mu_physical",
    5: "eq:mu_rho_kappa",
    6: "eq:slip",
    7: "eq:traction-eff",
    8: "eq:mu(s)_empirical",
    9: "eq:discr-nonlin-model",
    10: "eq:UKF-predict-PDF",
    11: "eq:a-priori-est-cov",
}


def places() -> Iterator[tuple[int, str, str]]:
    """Number of the equation, file and name of each place on the page."""
    page = (ROOT / "docs/physics.md").read_text(encoding="utf-8")
    for row in re.findall(r"^\| (\d+) \|(.*)\|$", page[page.index("## 9.") :], re.MULTILINE):
        for file, name in re.findall(r"`([\w/.]+): (\w+)`", row[1]):
            yield int(row[0]), file, name


def cited(text: str) -> set[int]:
    """The numbers that a text cites as ``eq. 2``, ``eq. 2 and 3``, ``eq. 4, 5, 7`` or ``eq. 10 to 13``."""
    result: set[int] = set()
    for listed in re.findall(r"eq\. (\d+(?:(?:, | and | to )\d+)*)", text):
        numbers = [int(x) for x in re.findall(r"\d+", listed)]
        result |= set(range(numbers[0], numbers[-1] + 1)) if " to " in listed else set(numbers)
    return result


def words_of_python(path: Path, name: str) -> str:
    """Docstring and comments of the definition, and the module's docstring."""
    source = path.read_text(encoding="utf-8")
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return (ast.get_docstring(tree) or "") + (ast.get_source_segment(source, node) or "")
    raise AssertionError(f"{path} defines no {name}")


def words_of_c(path: Path, name: str) -> str:
    """The comment above the function, and what stands in its body."""
    source = path.read_text(encoding="utf-8")
    match = re.search(
        rf"((?:/\*(?:(?!\*/).)*\*/\n)?)^[^\n;#]*\b{name}\([^;]*?\)\n?\s*\{{.*?^\}}",
        source,
        re.MULTILINE | re.DOTALL,
    )
    assert match is not None, f"{path} defines no {name}"
    return match.group(0)


@pytest.mark.parametrize(("number", "file", "name"), list(places()))
def test_each_place_cites_its_equation(number: int, file: str, name: str) -> None:
    path = ROOT / file
    assert path.exists(), file
    text = words_of_python(path, name) if path.suffix == ".py" else words_of_c(path, name)
    assert number in cited(text), f"{file}: {name} does not cite eq. {number}"


def test_no_equation_is_left_out() -> None:
    assert {number for number, _, _ in places()} == set(range(1, 14))


def test_the_numbers_are_those_of_the_paper(shared: Callable[[str], Path]) -> None:
    """LaTeX counts labelled lines of align and every equation that is not starred."""
    source = shared("paper/kobelski2021.tex").read_text(encoding="utf-8")
    blocks = re.findall(r"\\begin\{(align|equation)\}(.*?)\\end\{\1\}", source, re.DOTALL)
    counted = [re.findall(r"\\label\{(eq:.*?)\}(?!\()", row) for kind, block in blocks
               for row in (block.split("\\\\") if kind == "align" else [block])]  # fmt: skip
    for number, label in LABELS.items():
        assert label in counted[number - 1], (number, counted[number - 1])


def test_nothing_refers_to_pages_that_a_reader_cannot_open() -> None:
    kinds = {".py", ".c", ".h", ".md", ".toml", ".ts"}
    folders = [
        ROOT / name for name in ("src", "kernel", "docs", "tests", "benchmarks", "web/src", "examples")
    ]
    files = [p for folder in folders for p in folder.rglob("*") if p.suffix in kinds and p != Path(__file__)]
    for path in [*files, ROOT / "pyproject.toml", ROOT / "README.md"]:
        assert not re.search(r"\b(PHYSICS|DESIGN)\b", path.read_text(encoding="utf-8")), path
