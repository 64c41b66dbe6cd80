"""Long work in processes of its own: queued, one at a time, with progress, and cancelled on request."""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from terragrip.studio.notices import Notices

GRACE = 3.0
"""Seconds that a cancelled job has to clean up."""
KEEP = 50
"""Finished jobs that the list still shows."""
DEFECT = "a defect of Terragrip; run the same with 'terragrip --debug' on the command line to see where"


@dataclass
class Job:
    """One job: `state` is queued, running, done, failed or cancelled; `done` of `total` rows; `text` is the summary or the reason."""

    id: str
    kind: str
    title: str
    output: str
    state: str = "queued"
    done: int = 0
    total: int = 0
    text: str = ""
    request: dict[str, Any] = field(default_factory=dict, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """What a page may see of it."""
        names = ("id", "kind", "title", "output", "state", "done", "total", "text")
        return {name: getattr(self, name) for name in names}


class Jobs:
    """The queue. Used from one event loop."""

    def __init__(self, notices: Notices, folder: Path) -> None:
        self._notices, self._folder = notices, folder
        self._jobs: dict[str, Job] = {}
        self._waiting: asyncio.Queue[Job] = asyncio.Queue()
        self._runner: asyncio.Task[None] | None = None
        self._process: asyncio.subprocess.Process | None = None

    def add(self, kind: str, title: str, output: str, request: dict[str, Any]) -> Job:
        """Queue a job; `request` is what the worker gets, `output` the path that it will write."""
        job = Job(secrets.token_hex(8), kind, title, output, request={"kind": kind, **request})
        self._jobs[job.id] = job
        over = [old.id for old in self._jobs.values() if old.state in ("done", "failed", "cancelled")][:-KEEP]
        for old in over:
            del self._jobs[old]
        self._waiting.put_nowait(job)
        if self._runner is None or self._runner.done():
            self._runner = asyncio.create_task(self._run())
        self._tell(job)
        return job

    def all(self) -> list[Job]:
        """Every job, the oldest first."""
        return list(self._jobs.values())

    def get(self, identity: str) -> Job | None:
        """One job, or None."""
        return self._jobs.get(identity)

    async def cancel(self, job: Job) -> None:
        """Stop a job that waits or runs; what it had written of its output is removed."""
        if job.state == "queued":
            self._end(job, "cancelled", "cancelled before it began")
        elif job.state == "running":
            self._end(job, "cancelled", "cancelled; nothing was written")
            await self._stop()

    async def close(self) -> None:
        """Stop everything."""
        if self._runner is not None:
            self._runner.cancel()
        await self._stop()

    async def _stop(self) -> None:
        process = self._process
        if process is None or process.returncode is not None:
            return
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        try:
            await asyncio.wait_for(process.wait(), GRACE)
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()

    async def _run(self) -> None:
        while not self._waiting.empty():
            job = self._waiting.get_nowait()
            if job.state == "queued":
                await self._work(job)

    async def _work(self, job: Job) -> None:
        job.state = "running"
        self._tell(job)
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "terragrip.studio.worker", stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.DEVNULL, limit=1 << 22, cwd=self._folder,
        )  # fmt: skip
        self._process = process
        assert process.stdin is not None
        assert process.stdout is not None
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            process.stdin.write(json.dumps(job.request).encode())
            await process.stdin.drain()
            process.stdin.close()
        async for line in process.stdout:
            self._read_message(job, line)
        await process.wait()
        self._process = None
        if job.state == "running":
            self._end(job, "failed", DEFECT)

    def _read_message(self, job: Job, line: bytes) -> None:
        try:
            message = json.loads(line)
        except ValueError:  # a library that prints
            return
        if job.state != "running" or not isinstance(message, dict):
            return
        if message.get("state") == "running":
            job.done, job.total = int(message["done"]), int(message["total"])
            self._tell(job)
        elif message.get("state") in ("done", "failed"):
            self._end(job, message["state"], str(message.get("text", "")))

    def _end(self, job: Job, state: str, text: str) -> None:
        root = f"{self._folder}/"
        job.state, job.text = state, text.replace(root, "")
        self._tell(job)

    def _tell(self, job: Job) -> None:
        self._notices.publish("job", job=job.to_dict())
