"""A studio in a thread for the browser tests, and what they need to run."""

from __future__ import annotations

import socket
import threading
import time
from pathlib import Path

import pytest
import uvicorn

from studio_session import chromium
from terragrip.studio.app import STATIC, create_app

AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"
BUILT = (STATIC / "index.html").is_file() and AXE.is_file()

NEEDS = [
    pytest.mark.skipif(
        chromium() is None, reason="no chromium: apt-get install chromium, or run `make test` as root"
    ),
    pytest.mark.skipif(not BUILT, reason="the pages are not built: `make studio` needs Node.js 20 or newer"),
    # playwright's loop and sockets are still open when pytest looks for what was left behind
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]


class Served:
    """A studio on a folder, served by a thread; it can be stopped and started again on its port."""

    def __init__(self, folder: Path, live: str | None = None) -> None:
        self.folder, self.live = folder, live
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        self.start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def start(self) -> None:
        app = create_app(self.folder, upload_limit=20_000_000, live=self.live)
        config = uvicorn.Config(app, port=self.port, log_level="critical", timeout_graceful_shutdown=1)
        self.server = uvicorn.Server(config)
        self.thread = threading.Thread(target=self.server.run, daemon=True)
        self.thread.start()
        while not self.server.started:
            time.sleep(0.01)

    def stop(self) -> None:
        self.server.should_exit = True
        self.thread.join(10)
