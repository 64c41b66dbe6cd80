"""Long work: command lines of Terragrip in processes of their own, queued, one at a time, with progress, and cancelled on request.

A job is its command line and nothing else, so that what the page shows for the next time is what was run.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import secrets
import sys
from collections.abc import Sequence
from pathlib import Path

from terragrip.errors import InputError
from terragrip.log_events import emit
from terragrip.studio.job_store import ENDED, Job, JobStore
from terragrip.studio.notices import Notices

GRACE = 3.0
"""Seconds that a cancelled job has to clean up."""
KEEP = 50
"""Finished jobs that the list still shows."""
DEFECT = "a defect of Terragrip; run the same with 'terragrip --debug' on the command line to see where"


logger = logging.getLogger("terragrip.studio")


class Jobs:
    """The queue, after the jobs that the folder keeps of earlier studios. Used from one event loop. Raises InputError as `JobStore`."""

    def __init__(self, notices: Notices, folder: Path, store: JobStore) -> None:
        self._notices, self._folder, self._store = notices, folder, store
        self._jobs: dict[str, Job] = {job.id: job for job in store.load()}
        self._waiting: asyncio.Queue[Job] = asyncio.Queue()
        self._runner: asyncio.Task[None] | None = None
        self._process: asyncio.subprocess.Process | None = None

    def add(self, kind: str, title: str, output: str, words: Sequence[str]) -> Job:
        """Queue a job; `words` is its command line after "terragrip", `output` the path that it will write.

        Raises InputError where the folder cannot be written, or a job that has not ended will write the same path.
        """
        same = Path(output)
        if any(job.state not in ENDED and Path(job.output) == same for job in self._jobs.values()):
            raise InputError(
                "will be written by another job",
                file=output,
                hint="wait for it, cancel it, or choose another name",
            )
        job = Job(secrets.token_hex(8), kind, title, output, words=tuple(words))
        self._store.save(job)
        self._jobs[job.id] = job
        over = [old.id for old in self._jobs.values() if old.state in ENDED][:-KEEP]
        for old in over:
            del self._jobs[old]
        self._store.remove(over)
        self._waiting.put_nowait(job)
        if self._runner is None or self._runner.done():
            self._runner = asyncio.create_task(self._run())
        self._publish(job)
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
            self._end(job, "cancelled", "cancelled; unfinished output is removed")
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
        self._keep(job)
        emit(logger, "job_started", job=job.id, kind=job.kind, output=job.output)
        self._publish(job)
        try:
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "terragrip.cli.job", *job.words, stdin=asyncio.subprocess.DEVNULL, stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.PIPE, limit=1 << 22, cwd=self._folder,
            )  # fmt: skip
        except OSError as error:
            gone = isinstance(error, FileNotFoundError)
            hint = f"is {self._folder} still there?" if gone else "free memory, or end other programs"
            self._end(job, "failed", f"could not be started ({error.strerror}): {hint}")
            return
        self._process = process
        assert process.stdout is not None
        text, problem = await asyncio.gather(process.stdout.read(), self._follow(job, process.stderr))
        code = await process.wait()
        self._process = None
        if job.state == "running":
            done = text.decode(errors="replace").strip()
            self._end(
                job,
                "failed" if code else "done",
                "\n".join([problem or DEFECT, done]).strip() if code else done,
            )

    async def _follow(self, job: Job, stream: asyncio.StreamReader | None) -> str:
        """Report progress until a process ends; what it wrote beside that, the reason where it failed."""
        assert stream is not None
        lines = []
        async for raw in stream:
            line = raw.decode(errors="replace").strip()
            if not line.startswith('{"done"'):
                lines.append(line.removeprefix("terragrip: "))
            elif job.state == "running":
                step = json.loads(line)
                job.done, job.total = int(step["done"]), int(step["total"])
                self._publish(job)
        return "\n".join(lines).strip()

    def _end(self, job: Job, state: str, text: str) -> None:
        root = f"{self._folder}/"
        job.state, job.text = state, text.replace(root, "")
        self._keep(job)
        emit(logger, "job_ended", job=job.id, kind=job.kind, state=state)
        self._publish(job)

    def _keep(self, job: Job) -> None:
        with contextlib.suppress(
            InputError
        ):  # a full disk ends no job; after a restart this one counts as interrupted
            self._store.save(job)

    def _publish(self, job: Job) -> None:
        self._notices.publish("job", job=job.to_dict())
