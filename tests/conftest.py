"""What every test shares: a deterministic hypothesis profile, and the way to the shared data."""

from __future__ import annotations

import asyncio
import gc
import os
from collections import Counter
from collections.abc import Callable, Generator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings

# `ci` gives the same examples on every run. HYPOTHESIS_PROFILE=explore searches anew, and longer.
settings.register_profile(
    "ci", derandomize=True, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci"))

TESTS = Path(__file__).resolve().parent
SHARED = Path(os.environ.get("TERRAGRIP_SHARED") or TESTS.parents[1] / "shared")


@pytest.fixture
def shared() -> Callable[[str], Path]:
    """Return a function from a path inside ``../shared`` to the real one; where absent it skips the test."""

    def locate(inside: str) -> Path:
        path = SHARED / inside
        if not path.exists():
            pytest.skip(f"NOT TESTED: {path} is absent (TERRAGRIP_SHARED names another place)")
        return path

    return locate


def _undrawn() -> Generator[None]:
    """Figures are made but not drawn: for tests that read a report's words, of whose time drawing is three quarters."""
    empty = '<svg xmlns="http://www.w3.org/2000/svg" width="100pt" height="50pt"></svg>'
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.layout_engine.ConstrainedLayoutEngine.execute", lambda *_: None)
        patch.setattr("matplotlib.figure.Figure.savefig", lambda _, sink, **__: sink.write(empty))
        yield


undrawn = pytest.fixture(_undrawn, name="undrawn")
undrawn_in_file = pytest.fixture(_undrawn, name="undrawn_in_file", scope="module")


@pytest.fixture(scope="module")
def unchecked() -> Generator[None]:
    """No log is searched for what is likely wrong in it: for tests of estimates or of a calibration alone, which take up to half of the
    time then."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terragrip.estimation.batch.notes_of", lambda _, recording: tuple(recording.notes))
        patch.setattr("terragrip.estimation.calibration.procedure._doubts", lambda *_: ())
        yield


@pytest.fixture(scope="module")
def one_form() -> Generator[None]:
    """Soils are learned by the form that is asked for, and no other is tried, which takes half of the time of learning; what others say is
    in tests/soil/test_choice.py and test_learn.py, and on a page in report/test_soil_sections.py."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terragrip.soil.learn._compared", lambda *_: None)
        yield


@pytest.fixture(scope="module")
def small_forests() -> Generator[None]:
    """Ground classifiers grow a fifth of their trees, which takes half of the time of learning from a few drives; scikit-learn's whole
    forest is compared in test_classifier_parts.py, and the measured grounds of test_classifier_husky.py are told with it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("terragrip.ground.classification.forest._TREES", 20)
        yield


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, Any, Any]:
    """All that importing every test file makes stays to the end: to look through it for garbage meanwhile took a quarter of the processor's
    time, and afterwards again and again a tenth."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000)  # as terragrip's own processes do
        gc.enable()


@pytest.hookimpl(tryfirst=True)  # before `-m` selects by marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    _mark_what_is_no_sample(items)
    _spread(items)


def _mark_what_is_no_sample(items: list[pytest.Item]) -> None:
    """Of a test marked `sample(n)` the first case and each nth after it stay in `make test`: a step that divides neither of two numbers
    of parameters comes to each of both."""
    cases: Counter[tuple[Path, str]] = Counter()
    for item in items:
        if (sample := item.get_closest_marker("sample")) is not None:
            test = item.path, item.nodeid.partition("[")[0]
            if cases[test] % sample.args[0]:
                item.add_marker(pytest.mark.long)
            cases[test] += 1


def _spread(items: list[pytest.Item]) -> None:
    """Spread each room's files evenly over those of the others, between what stands beside the rooms and the studio's: workers take
    file after file, and with all of them in `live`, which waits for brokers and timers, two thirds of the processors' time were idle."""
    files: dict[str, dict[Path, int]] = {}
    for item in items:
        room = files.setdefault(_room(item.path), {})
        room.setdefault(item.path, len(room))

    def place(item: pytest.Item) -> tuple[int, float, str]:
        room = _room(item.path)
        share = (files[room][item.path] + 0.5) / len(files[room])
        return {"": 0, "studio": 2}.get(room, 1), share, room

    items.sort(key=place)


@cache
def _room(path: Path) -> str:
    """The folder below tests in which a file stands; empty beside the rooms."""
    return next(iter(path.relative_to(TESTS).parts[:-1]), "")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, Any, Any]:
    """Hide playwright's loop, which counts as running from the first browser test to the end of the session, from tests with a loop of
    their own: which of them come after it on one worker is chance."""
    loop = asyncio._get_running_loop()
    if loop is None or "browser" in getattr(item, "fixturenames", ()):
        return (yield)
    asyncio._set_running_loop(None)
    try:
        return (yield)
    finally:
        if not loop.is_closed():
            asyncio._set_running_loop(loop)
