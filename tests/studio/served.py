"""A studio in a thread for the browser tests, and what they need to run."""

from __future__ import annotations

import asyncio
import socket
import sys
import threading
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
import uvicorn

from studio_session import chromium
from terragrip.studio.app import STATIC, create_app

AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"
BUILT = (STATIC / "index.html").is_file() and AXE.is_file()

NEEDS = [
    pytest.mark.skipif(
        chromium() is None,
        reason="no chromium: apt-get install chromium-headless-shell, or run `make test` as root",
    ),
    pytest.mark.skipif(not BUILT, reason="the pages are not built: `make studio` needs Node.js 20 or newer"),
    # playwright's loop and sockets are still open when pytest looks for what was left behind
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]
# The details of pages whose main ways are in test_browser.py: of `make test-long` and `make browser-test`
DETAILS = [*NEEDS, pytest.mark.long]


def leave(tab: Any) -> None:
    """Go to where no page of the studio is: of the same address, so that the next one finds its process and its compiled scripts."""
    tab.goto(f"{tab.url.partition('#')[0]}icon.svg")


class Served:
    """A studio on a folder, served by a thread; it can be stopped and started again on its port."""

    def __init__(self, folder: Path, port: int) -> None:
        self.folder, self.port = folder, port
        self.live: str | None = None
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        self.app = create_app(self.folder, upload_limit=20_000_000, live=self.live)
        config = uvicorn.Config(self.app, loop="asyncio", log_level="critical", timeout_graceful_shutdown=1)
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, args=([bound(self.port)],), daemon=True)
        self.thread.start()
        until(lambda: self.server.started)

    def stop(self) -> None:
        for job in self.app.state.studio.jobs.all():  # what pytest shows where the test failed
            print(f"{job.command}: {job.state}, {job.done} of {job.total} {job.text}")
        self.server.should_exit = True
        self.thread.join(60)
        assert not self.thread.is_alive(), self._stands()

    def _stands(self) -> str:
        """What a studio that does not stop waits for: each thread's stack, each task."""
        names = {thread.ident: thread.name for thread in threading.enumerate()}
        stacks = [
            f"{names.get(number)}\n{''.join(traceback.format_stack(frame))}"
            for number, frame in sys._current_frames().items()
        ]
        tasks = [
            repr(task) for server in self.server.servers for task in asyncio.all_tasks(server.get_loop())
        ]
        return "\n".join([*stacks, *tasks])


def bound(port: int) -> socket.socket:
    """A socket on a port of this machine, 0 for any that is free; until one of them listens, there may be several on a port."""
    listener = socket.socket()
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind(("127.0.0.1", port))
    return listener


def until(condition: Callable[[], object], seconds: float = 60.0) -> None:
    """Wait for what another thread or process does."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "it never happened"
        time.sleep(0.01)


def axe_violations(tab: Any, theme: str, impacts: Sequence[str] = ()) -> list[tuple[str, str]]:
    """What axe-core says of a page in a theme, of these weights or of any; in dark of its colours, for of the rest light says the same."""
    tab.emulate_media(color_scheme=theme)
    tab.wait_for_function("theme => document.documentElement.dataset.theme === theme", arg=theme)
    if not tab.evaluate("() => 'axe' in window"):
        tab.evaluate(
            f"() => {{ {AXE.read_text(encoding='utf-8')} }}"
        )  # no script of the page, so its policy stays as it is
    rules = {"runOnly": {"type": "tag", "values": ["cat.color"]}} if theme == "dark" else {}
    result = tab.evaluate(
        "options => axe.run(document, options)", {"resultTypes": ["violations"], "selectors": False, **rules}
    )
    return [
        (v["id"], v["nodes"][0]["html"][:120])
        for v in result["violations"]
        if not impacts or v["impact"] in impacts
    ]
