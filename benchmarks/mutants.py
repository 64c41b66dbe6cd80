"""Do the tests notice? Small changes of the Python (mutants), each tried by the tests that run its line.

    python benchmarks/mutants.py [--count 400] [--rooms physics recording estimation soil] [--workers 2] [--seed COMMIT]
    python benchmarks/mutants.py --at src/terragrip/soil/fit.py:120 [--by tests/soil/test_fit.py]

The sample is drawn by the hash of the commit: places (an operator, a comparison, a number, a truth value, a jump) uniformly over the
source, of each place one change by the operators of cosmic-ray. Left out is only what is no behaviour: annotations, decorators and
`if TYPE_CHECKING`. A first run records which test runs which line (coverage with contexts) and how long it takes, and refuses to go on
if a test fails or nothing is recorded; of a later commit only the test files that changed are run anew
(`--afresh`: all). Each mutant is a forked process that has the heavy libraries; it meets the tests of its line,
quickest first, until one fails. Killed: a test fails, the module cannot be imported, or the tests need far more of the processor than
they did (counted apart). What lives, or no test runs, is printed as a diff. Results are kept in build/mutants, and a run that was
stopped goes on where it was. A whole run takes about an hour on two cores.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import gc
import importlib
import importlib.machinery
import importlib.util
import json
import multiprocessing
import os
import random
import resource
import signal
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from which_tests import KEPT, ROOT, Coverage, coverage_at, git

ROOMS = ("physics", "recording", "estimation", "soil")
BUDGET = 10.0  # s (under coverage) of the tests that one mutant meets
INTERNAL = 3  # exit code of pytest: an error of its own, which would pass for a kill
# Times what its tests took before, and a minute [s of processor]: beyond, a mutant counts as killed.
PATIENCE = 4.0
HANGS = 20.0  # times that on the wall's clock, for what waits without working
TIMED_OUT = -int(signal.SIGXCPU)
PRELOADED = (
    "numpy",
    "pandas",
    "pyarrow",
    "pydantic",
    "scipy.optimize",
    "scipy.stats",
    "pint",
    "yaml",
    "pytest",
    "pytest_asyncio",
    "xdist",
    "anyio.pytest_plugin",
    "hypothesis.strategies",
)
ARITHMETIC = ("Add", "Sub", "Mul", "Div")
ORDER = ("Lt", "LtE", "Gt", "GtE", "Eq", "NotEq")


@dataclass(frozen=True)
class Mutant:
    path: str
    line: int
    operator: str
    occurrence: int


def operators() -> list[str]:
    """The operators of cosmic-ray that a slip of a programmer could be; `x << y` for `x + y` would only flatter the tests."""
    names = [
        f"ReplaceBinaryOperator_{a}_{b}"
        for a in (*ARITHMETIC, "Pow", "FloorDiv", "Mod")
        for b in ARITHMETIC
        if a != b
    ]
    names += [f"ReplaceComparisonOperator_{a}_{b}" for a in ORDER for b in ORDER if a != b]
    names += [
        "ReplaceComparisonOperator_Is_IsNot",
        "ReplaceComparisonOperator_IsNot_Is",
        "ReplaceUnaryOperator_Delete_Not",
    ]
    names += [
        "NumberReplacer",
        "ReplaceAndWithOr",
        "ReplaceOrWithAnd",
        "ReplaceTrueWithFalse",
        "ReplaceFalseWithTrue",
    ]
    names += [
        "ReplaceUnaryOperator_USub_UAdd",
        "ReplaceBreakWithContinue",
        "ReplaceContinueWithBreak",
        "AddNot",
    ]
    return names


def unseen(source: str) -> set[tuple[int, int]]:
    """Places (line, column) inside annotations, decorators and `if TYPE_CHECKING`: no run of a test sees these."""
    out: set[tuple[int, int]] = set()
    lines = source.splitlines()
    for node in ast.walk(ast.parse(source)):
        parts = [getattr(node, name, None) for name in ("annotation", "returns")]
        parts += getattr(node, "decorator_list", [])
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            parts.append(node)
        for part in parts:
            if part is not None:
                for row in range(part.lineno, part.end_lineno + 1):
                    first = part.col_offset if row == part.lineno else 0
                    last = part.end_col_offset if row == part.end_lineno else len(lines[row - 1])
                    out |= {(row, column) for column in range(first, last + 1)}
    return out


def mutants(path: Path) -> Iterator[tuple[tuple[int, int], Mutant]]:
    """Every mutant of a file with its place."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator

    source = path.read_text(encoding="utf-8")
    nodes, skipped = list(ast_nodes(get_ast(source))), unseen(source)
    for name in operators():
        operator, count = get_operator(f"core/{name}")(), 0
        for node in nodes:
            for start, _ in operator.mutation_positions(node):
                if start not in skipped:
                    yield start, Mutant(str(path.relative_to(ROOT)), start[0], name, count)
                count += 1


def sample(rooms: list[str], count: int, seed: str) -> list[Mutant]:
    """`count` mutants, at as many places drawn by `seed`."""
    by_place: dict[tuple[str, tuple[int, int]], list[Mutant]] = defaultdict(list)
    for room in rooms:
        for path in sorted((ROOT / "src" / "terragrip" / room).rglob("*.py")):
            for place, one in mutants(path):
                by_place[str(path), place].append(one)
    draw = random.Random(seed)
    places = draw.sample(sorted(by_place), min(count, len(by_place)))
    return [draw.choice(by_place[place]) for place in places]


def mutated(one: Mutant) -> str:
    """The source of a mutant's file."""
    from cosmic_ray.mutating import mutate_code
    from cosmic_ray.plugins import get_operator

    source = (ROOT / one.path).read_text(encoding="utf-8")
    changed = mutate_code(source, get_operator(f"core/{one.operator}")(), one.occurrence)
    if changed is None:
        raise ValueError(f"{one} is not there")
    return str(changed)


def diff(one: Mutant) -> str:
    source = (ROOT / one.path).read_text(encoding="utf-8")
    lines = difflib.unified_diff(
        source.splitlines(), mutated(one).splitlines(), one.path, one.path, lineterm="", n=0
    )
    return "\n".join(line for line in lines if not line.startswith(("---", "+++", "@@")))


def attempt(path: str, source: str, tests: list[str], seconds: int) -> None:
    """In a process of its own: pytest with a source in place of that of a module. The exit code is pytest's."""
    plain = importlib.machinery.SourceFileLoader.get_code

    def get_code(self: Any, fullname: str) -> Any:
        return compile(source, path, "exec") if self.path == path else plain(self, fullname)

    importlib.machinery.SourceFileLoader.get_code = get_code  # type: ignore[method-assign]
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    import pytest

    plain_and_quick = ["-x", "-q", "--tb=no", "--assert=plain", "-p", "no:cacheprovider", "-p", "no:cov"]
    os._exit(int(pytest.main([*tests, *plain_and_quick])))


def start(one: Mutant, tests: list[str], coverage: Coverage, changed: bool = True) -> tuple[Any, float]:
    """The process that tries a mutant, and when it is too late by the wall's clock."""
    seconds = int(60 + PATIENCE * coverage.time(tests))
    path = ROOT / one.path
    source = mutated(one) if changed else path.read_text(encoding="utf-8")
    arguments = (str(path), source, tests, seconds)
    process = multiprocessing.get_context("fork").Process(target=attempt, args=arguments)
    process.start()
    return process, time.monotonic() + HANGS * seconds


def verdicts(
    todo: list[Mutant], coverage: Coverage, workers: int, by: list[str], budget: float
) -> Iterator[tuple[Mutant, str]]:
    """Each mutant and what became of it: killed, timed out, lived, untested. by: tests instead of those recorded."""
    for name in PRELOADED:
        importlib.import_module(name)
    gc.freeze()  # a child that collects would copy all of it
    waiting = list(reversed(todo))
    probe = next((one for one in todo if by or coverage.tests(one.path, one.line, 0.0)), None)
    if probe is not None:  # else a broken set-up would kill every mutant
        process, _ = start(probe, by or coverage.tests(probe.path, probe.line, 0.0), coverage, changed=False)
        process.join()
        if process.exitcode != 0:
            raise SystemExit(f"the tests of {probe.path}:{probe.line} fail without a mutant")
    running: dict[Any, tuple[Mutant, float]] = {}
    while waiting or running:
        while waiting and len(running) < workers:
            one = waiting.pop()
            tests = by or coverage.tests(one.path, one.line, budget)
            if not tests:
                yield one, "untested"
                continue
            process, until = start(one, tests, coverage)
            running[process] = one, until
        for process, (one, until) in list(running.items()):
            if process.exitcode is not None:
                del running[process]
                if process.exitcode == INTERNAL:
                    raise RuntimeError(f"pytest itself failed on {one}")
                endings = {
                    0: "lived",
                    5: "untested",
                    TIMED_OUT: "timed out",
                    -int(signal.SIGKILL): "timed out",
                }
                yield one, endings.get(process.exitcode, "killed")
            elif time.monotonic() > until:
                process.kill()
        time.sleep(0.02)


def show(one: Mutant, verdict: str) -> str:
    """The verdict; what lives is printed."""
    if verdict in ("lived", "untested"):
        print(f"{verdict}: {one.path}:{one.line} {one.operator}\n{diff(one)}\n", flush=True)
    return verdict


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=400, help="mutants in the sample")
    parser.add_argument("--rooms", nargs="+", default=list(ROOMS), help="packages of terragrip")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--seed", help="draw by this instead of the commit's hash")
    parser.add_argument(
        "--at",
        nargs="*",
        default=(),
        metavar="FILE:LINE",
        help="every mutant of these lines instead of a sample",
    )
    parser.add_argument(
        "--by", nargs="+", default=[], metavar="TEST", help="try these tests, not those recorded"
    )
    parser.add_argument(
        "--budget",
        type=float,
        default=BUDGET,
        help="s of tests that a mutant meets; what lived under less is tried again",
    )
    parser.add_argument(
        "--afresh", action="store_true", help="record all tests, though an earlier commit is recorded"
    )
    wanted = parser.parse_args()
    os.chdir(ROOT)
    KEPT.mkdir(parents=True, exist_ok=True)
    if not wanted.at and git("status", "--porcelain", "src", "tests"):
        raise SystemExit("src or tests have uncommitted changes: a sample belongs to a commit")
    where = importlib.util.find_spec("terragrip")
    if where is None or ROOT not in Path(str(where.origin)).parents:
        raise SystemExit(
            f"terragrip is imported from elsewhere, where no mutant is: put {ROOT / 'src'} first in PYTHONPATH"
        )
    commit = git("rev-parse", "HEAD")
    recorded = None if wanted.by else coverage_at(commit, wanted.rooms, wanted.workers, wanted.afresh)
    coverage = recorded or Coverage({}, {}, {})
    if wanted.at:
        places = [(name, int(line)) for name, _, line in (text.rpartition(":") for text in wanted.at)]
        drawn = [
            one for name in dict(places) for _, one in mutants(ROOT / name) if (one.path, one.line) in places
        ]
        if not drawn:
            raise SystemExit(
                "nothing on these lines can be changed: give lines of code with an operator or a number"
            )
        kept = Path(os.devnull)
    else:
        seed = wanted.seed or commit
        drawn = sample(wanted.rooms, wanted.count, seed)
        kept = KEPT / f"{commit}.{seed[:12]}.jsonl"
    known = {}
    for line in kept.read_text(encoding="utf-8").splitlines() if kept.exists() else ():
        entry = json.loads(line)
        if entry["verdict"] != "lived" or entry["budget"] >= wanted.budget:
            known[Mutant(**entry["mutant"])] = show(Mutant(**entry["mutant"]), entry["verdict"])
    todo = [one for one in drawn if one not in known]
    with kept.open("a", encoding="utf-8") as out:
        for one, verdict in verdicts(todo, coverage, wanted.workers, wanted.by, wanted.budget):
            known[one] = show(one, verdict)
            entry = {"mutant": asdict(one), "verdict": verdict, "budget": wanted.budget}
            out.write(json.dumps(entry) + "\n")
            out.flush()
    became = Counter(known[one] for one in drawn)
    killed = became["killed"] + became["timed out"]
    print(
        f"{killed} of {len(drawn)} mutants killed ({killed / len(drawn):.0%}; {became['timed out']} of them by the limit of time, "
        f"{became['untested']} stand where no test runs) at commit {commit[:12]}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
