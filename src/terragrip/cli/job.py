"""A command line run by another program, such as the studio: ``python -m terragrip.cli.job estimate LOG ...``.

As ``python -m terragrip``, but progress goes to standard error as lines of JSON (``{"done": 10, "total": 100}``), and a request to
terminate ends it as Ctrl-C does: what was begun is removed, what was finished is whole.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from types import FrameType

from terragrip.cli import main
from terragrip.cli.progress import watch

PERIOD = 0.1
"""Seconds between two lines of progress."""


class _Reporter:
    def __init__(self) -> None:
        self._last = 0.0

    def __call__(self, done: int, total: int, text: str = "") -> None:
        now = time.monotonic()
        if now - self._last >= PERIOD or done == total:
            self._last = now
            print(json.dumps({"done": int(done), "total": int(total)}), file=sys.stderr, flush=True)


def _interrupt(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, _interrupt)
    watch(_Reporter())
    sys.exit(main())
