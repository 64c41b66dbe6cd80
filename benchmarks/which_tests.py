"""Which test runs which line of some rooms, and how long the processor takes: recorded once by coverage with contexts.

It is kept in build/mutants. Of a later commit only the test files that changed are run anew; lines keep their tests wherever a
comparison of both sources finds them.
"""

from __future__ import annotations

import difflib
import os
import re
import subprocess
import sys
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
KEPT = ROOT / "build" / "mutants"
MOST = 120  # tests of a line
MORE_TESTS = ("ground", "report", "advice", "maps")  # rooms whose tests run lines of these
APART = (  # they look at packages, or run the whole project in other processes, which a mutant does not reach
    "contract",
    "demo",
    "docs_site",
    "doctor",
    "example_notebooks",
    "kernel_builds",
    "layouts",
    "tutorial",
    "wheel",
    "worked_examples",
)


def git(*words: str) -> str:
    return subprocess.run(["git", *words], capture_output=True, text=True, check=True).stdout.strip()


def test_files(rooms: list[str]) -> list[str]:
    """The files of tests that are recorded: the rooms', their neighbours' and those beside the rooms."""
    files = [
        path.relative_to(ROOT)
        for room in (*rooms, *MORE_TESTS)
        for path in (ROOT / "tests" / room).rglob("test_*.py")
    ]
    files += [path.relative_to(ROOT) for path in (ROOT / "tests").glob("test_*.py")]
    return sorted({str(path) for path in files} - {f"tests/test_{name}.py" for name in APART})


def record(rooms: list[str], files: list[str], data: Path, log: Path, workers: int) -> None:
    """Run tests once, under coverage. SystemExit if one fails."""
    words = [sys.executable, "-m", "pytest", *files, "-q", "-vv", "-n", str(workers)]
    words += [f"--cov=terragrip.{room}" for room in rooms]
    words += [
        "--cov-context=test",
        "--cov-report=",
        "--durations=0",
        "--durations-min=0",
        "-p",
        "no:cacheprovider",
        "-p",
        "processor_time",
    ]
    paths = [str(ROOT / "benchmarks"), *filter(None, [os.environ.get("PYTHONPATH")])]
    text = log.with_suffix(".log.new")
    with text.open("w", encoding="utf-8") as out:
        done = subprocess.run(
            words,
            cwd=ROOT,
            stdout=out,
            stderr=subprocess.STDOUT,
            env={**os.environ, "COVERAGE_FILE": f"{data}.new", "PYTHONPATH": os.pathsep.join(paths)},
            check=False,
        )
    if done.returncode != 0:
        raise SystemExit(f"the tests fail without a mutant, see {text}")
    os.replace(f"{data}.new", data)
    os.replace(text, log)


@dataclass
class Coverage:
    """Which tests run a line, and how long each takes without its fixtures, and at most the fixtures of a file [s]."""

    seconds: dict[str, float]
    fixtures: dict[str, float]
    by_line: dict[str, dict[int, list[str]]]

    @classmethod
    def load(cls, data: Path, log: Path) -> Coverage:
        from coverage import CoverageData

        if not data.exists():  # no test has changed since the commit that this one builds on
            return cls({}, defaultdict(float), {})
        coverage = CoverageData(str(data))
        coverage.read()
        seconds = {context.partition("|")[0]: 0.0 for context in coverage.measured_contexts() if context}
        fixtures: dict[str, float] = defaultdict(float)
        beside: dict[str, list[str]] = defaultdict(list)
        for test in seconds:
            beside[test.partition("::")[0]].append(test)
        log_lines = re.findall(
            r"^([\d.]+)s (setup|call) +(tests/.+)$", log.read_text(encoding="utf-8"), re.MULTILINE
        )
        for took, phase, test in log_lines:
            if phase == "call":
                seconds[test] = float(took)
            else:
                file = test.partition("::")[0]
                fixtures[file] = max(fixtures[file], float(took))
        by_line: dict[str, dict[int, list[str]]] = {}
        for path in coverage.measured_files():
            tests: dict[int, list[str]] = {}
            by_line["src/" + path.rpartition("/src/")[2]] = tests
            for number, contexts in coverage.contexts_by_lineno(path).items():
                names: set[str] = set()
                for test, _, phase in (context.partition("|") for context in contexts if context):
                    # what a fixture runs stands under the first test that asks for it; the others see it too
                    names |= {test, *(beside[test.partition("::")[0]] if phase == "setup" else ())}
                tests[number] = sorted(names)
        return cls(seconds, fixtures, by_line)

    def moved(self, base: str, gone: set[str]) -> Coverage:
        """What was recorded at another commit, at the lines of today and without the tests of some files."""

        def left(tests: list[str]) -> list[str]:
            return [name for name in tests if name.partition("::")[0] not in gone]

        by_line = {}
        for path, lines in self.by_line.items():
            if (ROOT / path).exists():
                before = git("show", f"{base}:{path}").splitlines()
                now = (ROOT / path).read_text(encoding="utf-8").splitlines()
                blocks = difflib.SequenceMatcher(None, before, now, autojunk=False).get_matching_blocks()
                place = {a + k + 1: b + k + 1 for a, b, size in blocks for k in range(size)}
                by_line[path] = {place[n]: left(tests) for n, tests in lines.items() if n in place}
        seconds = {name: self.seconds[name] for name in left(list(self.seconds))}
        return Coverage(seconds, self.fixtures, by_line)

    def joined(self, other: Coverage) -> Coverage:
        """Both."""
        by_line = {path: dict(lines) for path, lines in self.by_line.items()}
        for path, lines in other.by_line.items():
            own = by_line.setdefault(path, {})
            for number, tests in lines.items():
                own[number] = sorted({*own.get(number, ()), *tests})
        fixtures = defaultdict(float, {**self.fixtures, **other.fixtures})
        return Coverage({**self.seconds, **other.seconds}, fixtures, by_line)

    def tests(self, path: str, line: int, budget: float) -> list[str]:
        """Tests for a line, as many as take `budget` [s under coverage], those of its room first: a line of axle loads is run by a
        thousand others, most of them quicker. One that only the import runs is met by the tests of its file."""
        room = "/".join(["tests", *path.split("/")[2:3], ""])
        lines = self.by_line.get(path, {})
        names = set(lines.get(line, ())) or {name for other in lines.values() for name in other}
        cost = {name: self.seconds[name] + self.fixtures[name.partition("::")[0]] for name in names}
        chosen: list[str] = []
        spent = 0.0
        cases: dict[str, int] = defaultdict(int)
        turns = []  # of each test function the quickest case first, then the second of each
        for name in sorted(names, key=lambda name: (cost[name], name)):
            function = name.partition("[")[0]
            turns.append((cases[function], name))
            cases[function] += 1
        files: set[str] = set()
        for _, name in sorted(turns, key=lambda turn: (not turn[1].startswith(room), turn[0])):
            file = name.partition("::")[0]
            needed = self.seconds[name] + (0.0 if file in files else self.fixtures[file])
            if len(chosen) < MOST and (not chosen or spent + needed <= budget):
                chosen.append(name)
                files.add(file)
                spent += needed
        return chosen

    def time(self, tests: list[str]) -> float:
        """What these tests take with their fixtures [s]; of a test that is not recorded, nothing."""
        files = {name.partition("::")[0] for name in tests}
        return sum(self.seconds.get(name, 0.0) for name in tests) + sum(
            self.fixtures.get(f, 0.0) for f in files
        )


def coverage_at(commit: str, rooms: list[str], workers: int, afresh: bool) -> Coverage:
    """Recorded at this commit; where an earlier one is recorded, only the test files that changed since are run anew."""
    log, files = KEPT / f"{commit}.log", test_files(rooms)
    built_on = KEPT / f"{commit}.base"
    if not log.exists():
        earlier = [] if afresh else git("rev-list", "--max-count=500", commit).split()
        base = next(
            (
                one
                for one in earlier
                if (KEPT / f"{one}.coverage").exists() and not (KEPT / f"{one}.base").exists()
            ),
            None,
        )
        if base is not None:
            changed = set(git("diff", "--name-only", base, commit, "--", "tests").split())
            files = [file for file in files if file in changed]
        print(f"Recording which test of {len(files)} files runs which line ...", flush=True)
        if files:
            record(rooms, files, KEPT / f"{commit}.coverage", log, workers)
        else:
            log.touch()
        if base is not None:
            built_on.write_text(base)
    coverage = Coverage.load(KEPT / f"{commit}.coverage", log)
    if built_on.exists():
        base = built_on.read_text()
        gone = set(git("diff", "--name-only", base, commit, "--", "tests").split())
        gone |= {f"tests/test_{name}.py" for name in APART}
        coverage = (
            Coverage.load(KEPT / f"{base}.coverage", KEPT / f"{base}.log").moved(base, gone).joined(coverage)
        )
    if not any(any(tests.values()) for tests in coverage.by_line.values()):
        raise SystemExit(f"{log} holds no test: remove it and start again")
    return coverage
