"""A progress bar for long work, only on a terminal and only when the work does take long."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Step = Callable[..., None]
"""Called with what is done, what there is in all, and perhaps what was just done."""

_PATIENCE = 0.5  # s without a bar
_watchers: list[Step] = []


def watch(watcher: Step) -> None:
    """From now on progress goes to ``watcher`` in place of a bar."""
    _watchers[:] = [watcher]


@contextmanager
def progress(title: str, quiet: bool = False) -> Iterator[Step]:
    """A function to call with (done, total) or (done, total, text), which draws a bar on standard error.

    Nothing is drawn where standard error is no terminal, with ``quiet``, or in the first half second; see `watch`, too.
    """
    if _watchers:
        yield _watchers[0]
        return
    if quiet or not sys.stderr.isatty():
        yield _nothing
        return
    bar = _Bar(title)
    try:
        yield bar.step
    finally:
        bar.stop()


def _nothing(done: int, total: int, text: str = "") -> None:
    """Draw nothing."""


class _Bar:
    def __init__(self, title: str) -> None:
        self._title, self._begin = title, time.monotonic()
        self._bar: Any = None
        self._task: Any = None

    def step(self, done: int, total: int, text: str = "") -> None:
        if self._bar is None:
            if time.monotonic() - self._begin < _PATIENCE:
                return
            self._start(total)
        self._bar.update(self._task, completed=done, total=total, description=f"{self._title} {text}".strip())

    def _start(self, total: int) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"))
        self._bar = Progress(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
        self._bar.start()
        self._task = self._bar.add_task(self._title, total=total)

    def stop(self) -> None:
        if self._bar is not None:
            self._bar.stop()
