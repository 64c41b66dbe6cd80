"""Run batches of logs on Dask workers, local or of a remote scheduler. Losing workers or the scheduler loses no log."""

from __future__ import annotations

import logging
import os
import re
import time
from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from typing import Any

from terragrip.errors import InputError
from terragrip.fleet.logs import FleetLog
from terragrip.fleet.store import Store
from terragrip.fleet.task import Outcome, Settings, estimate_logs

BATCH_BYTES, BATCH_LOGS = 8_000_000, 16
"""The most bytes and logs of a batch."""
BATCHES_PER_WORKER = 8
"""The fewest batches per worker, so that all workers finish at about the same time."""
PATIENCE = 60.0
"""How long to wait for a lost scheduler, or for a worker once all are lost [s]."""
CONNECT_TIMEOUT = 10.0
"""How long a scheduler may take to answer at the start [s]."""
_MEMORY = "most likely it needs more memory than a worker has; raise --memory or use fewer --workers"
_POLL = 0.05
"""Time between two looks at the results [s]."""
_FETCH = 5.0
"""How long to wait for a result before looking after the workers again [s]; one that is lost with its worker is computed anew."""
_COUNT = 1.0
"""Time between two counts of the workers [s]; each count is a request to the scheduler."""

_CONFIG = {
    # A worker that nears its memory limit is terminated and its log reported; spilling and pausing would only delay the others.
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.scheduler.allowed-failures": 1,
    "distributed.admin.tick.limit": "60 s",
    # Dask's own overhead on the workers' processors (decision 0140): by default it samples every thread's stack each 10 ms, checks the
    # event loop each 20 ms, and makes malloc return every freed 64 kB to the system.
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "500 ms",
    "distributed.admin.system-monitor.interval": "10 s",
    "distributed.worker.memory.monitor-interval": "200 ms",
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(
        ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS"), 1
    ),
}


def batches_of(logs: Sequence[FleetLog], workers: int) -> list[list[FleetLog]]:
    """Batches of logs, the largest first, small ones grouped."""
    share = sum(log.size for log in logs) / max(1, BATCHES_PER_WORKER * workers)
    limit = min(BATCH_BYTES, share)
    count = max(1, min(BATCH_LOGS, len(logs) // max(1, BATCHES_PER_WORKER * workers)))
    batches: list[list[FleetLog]] = []
    size = 0
    for log in sorted(logs, key=lambda one: (-one.size, one.name)):
        if not batches or len(batches[-1]) >= count or size + log.size > limit:
            batches.append([])
            size = 0
        batches[-1].append(log)
        size += log.size
    return batches


@contextmanager
def workers_at(scheduler: str | None, workers: int, memory: str | None) -> Iterator[Pool]:
    """The workers of an existing ``scheduler``; without one, ``workers`` processes on this machine, each with ``memory`` ("2 GB"; None: an
    equal share).

    Raises InputError if Dask is not installed, if the scheduler does not answer or has no worker, or if a worker has another version of
    Terragrip.
    """
    try:
        import dask
        import distributed
    except ImportError:
        raise InputError(
            "Dask is not installed", hint="pip install 'terragrip[fleet]'", page="install"
        ) from None
    # Lost workers and schedulers are reported in the failures or in one line, not in Dask's log.
    for name in [*logging.root.manager.loggerDict]:
        if name.split(".")[0] in ("distributed", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    with dask.config.set(_CONFIG), ExitStack() as opened:
        if scheduler is not None:
            pool = Pool(lambda: _client(scheduler), scheduler)
        else:
            limit: Any = "auto" if memory is None else _bytes(memory)
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                memory_limit=limit,
                dashboard_address=":0",  # any free port, without a warning
                silence_logs=logging.CRITICAL,
            )
            opened.enter_context(cluster)
            pool = Pool(
                lambda: distributed.Client(cluster, set_as_default=False),
                "this machine",
                lambda: cluster.scale(workers),
            )
        opened.callback(pool.close)
        pool.connect(CONNECT_TIMEOUT)
        if scheduler is not None:
            pool.check_versions()
        yield pool


def check_address(address: str) -> None:
    """Refuse an address that Dask cannot connect to; its half-built client would print a traceback when it is collected.

    Raises InputError.
    """
    written = re.fullmatch(r"(?:([a-z]+)://)?[^\s:/]+:\d{1,5}|(?:([a-z]+)://)?\[[^\s\]]+\]:\d{1,5}", address)
    scheme = (written[1] or written[2] or "tcp") if written else None
    if scheme not in ("tcp", "tls", "ws", "wss"):
        raise InputError(
            f"{address!r} is not the address of a scheduler",
            place="--scheduler",
            hint="write e.g. tcp://host:8786",
        )
    if scheme not in ("tls", "wss") or find_spec("dask") is None:
        return
    import dask

    if not dask.config.get("distributed.comm.tls.ca-file", None):
        raise InputError(
            f"{address} needs certificates",
            place="--scheduler",
            hint="name them in Dask's configuration, e.g. DASK_DISTRIBUTED__COMM__TLS__CA_FILE=ca.pem, and the client's",
        )


def _client(address: str) -> Any:
    from distributed import Client

    return Client(address, timeout=5, set_as_default=False)


def _bytes(text: str) -> int:
    from dask.utils import parse_bytes

    try:
        amount = int(parse_bytes(text))
    except ValueError:
        amount = 0
    if amount < 1_000_000:
        raise InputError(f"{text!r} is not an amount of memory", place="--memory", hint="write e.g. 2GB")
    return amount


class Pool:
    """A connection to the workers, re-established when it breaks.

    ``connect`` returns a client of the scheduler at ``address``. ``refill`` restarts missing workers (None: they are not ours to start).
    """

    def __init__(
        self, connect: Callable[[], Any], address: str, refill: Callable[[], None] | None = None
    ) -> None:
        self._new_client, self._address, self._refill = connect, address, refill
        self._client: Any = None
        self._counted = self._last_staffed = 0.0

    def connect(self, patience: float) -> None:
        """Connect, retrying for ``patience`` seconds. Raises InputError if no scheduler answers or no worker appears."""
        self.close()
        end = time.monotonic() + patience
        while True:
            try:
                self._client = self._new_client()
                break
            except (OSError, ValueError) as error:
                if isinstance(error, ValueError) or time.monotonic() > end:
                    raise InputError(
                        f"no scheduler answers at {self._address}",
                        place="--scheduler",
                        hint="start one with `dask scheduler`, or leave --scheduler out; finished logs are kept",
                    ) from None
                time.sleep(0.5)
        try:
            self._client.wait_for_workers(1, timeout=max(patience, CONNECT_TIMEOUT))
        except TimeoutError:
            self.close()
            raise InputError(
                f"the scheduler at {self._address} has no worker",
                place="--scheduler",
                hint="start some with `dask worker ADDRESS`",
            ) from None
        self._last_staffed = time.monotonic()

    def close(self) -> None:
        """Disconnect; the workers of a local cluster stop with it."""
        client, self._client = self._client, None
        if client is not None:
            client.close(timeout=2)

    def check_versions(self) -> None:
        """Raise InputError if a worker has another version of Terragrip: every log on it would fail and lose its earlier estimates."""
        from terragrip import __version__

        # A nested function is pickled by value, so a worker need not have Terragrip installed.
        def version() -> str:
            try:
                from terragrip import __version__
            except ImportError:
                return "missing"
            return __version__

        for worker, found in self._client.run(version).items():
            if found != __version__:
                raise InputError(
                    f"Terragrip is {found} on the worker {worker} and {__version__} here",
                    place="--scheduler",
                    hint="install the same version on all workers",
                )

    @property
    def count(self) -> int:
        """The current number of workers, at least 1."""
        return max(1, len(self._client.scheduler_info(n_workers=-1)["workers"]))

    def run(
        self, logs: Sequence[FleetLog], settings: Settings, store: Store, failed: Container[str] = ()
    ) -> Iterator[Outcome]:
        """One outcome per log, in the order in which they finish.

        If a batch loses its worker twice, its logs are run again at the end, one at a time; a log that then loses its worker twice is the
        cause. Logs whose name is in ``failed`` run after all others, each in a batch of its own, so that one which kills the last worker
        takes no other log down.

        Raises InputError if the scheduler or all workers are lost and do not return within `PATIENCE`, after yielding a failure for each
        log that the lost workers held.
        """
        suspects: list[FleetLog] = []
        first = batches_of([log for log in logs if log.name not in failed], self.count)
        try:
            for batches in (first, [[log] for log in logs if log.name in failed]):
                yield from self._all(batches, settings, store, suspects)
            while suspects:
                alone: list[FleetLog] = []
                yield from self._all([suspects[:1]], settings, store, alone)
                name = suspects.pop(0).name
                if alone:
                    reason = f"its worker was lost twice while estimating it alone: {_MEMORY}"
                    yield Outcome(name, reason=reason)
        except _NoWorkersError as error:
            names = sorted({log.name for log in (*suspects, *error.logs)})
            others = f" or one of {len(names) - 1} others" if len(names) > 1 else ""
            for name in names:
                reason = f"no worker came back after the last was lost, with this log{others}: {_MEMORY}"
                yield Outcome(name, reason=reason)
            raise self._without_workers(names) from None

    def _all(
        self, batches: list[list[FleetLog]], settings: Settings, store: Store, suspects: list[FleetLog]
    ) -> Iterator[Outcome]:
        """The outcomes of batches. Logs whose batch lost its worker twice are appended to ``suspects`` instead."""
        open_batches = self._submit(batches, settings, store)
        while open_batches:
            lost = self._client.status != "running"
            for future, batch in list(open_batches.items()):
                if future.status == "pending":
                    continue
                try:
                    outcomes = _outcomes_of(future, batch, suspects)
                except TimeoutError:  # lost with its worker, perhaps the last, which this loop restarts
                    continue
                except (CancelledError, OSError):  # the scheduler is lost, and its results with it
                    lost = True
                    break
                del open_batches[future]
                yield from outcomes
            if lost:
                left = list(open_batches.values())
                self.connect(PATIENCE)
                open_batches = self._submit(left, settings, store)
            if not self._has_workers():
                raise _NoWorkersError(_lost_with(self._client, open_batches))
            time.sleep(_POLL)

    def _has_workers(self) -> bool:
        """Whether there was a worker within the last `PATIENCE`; also restarts local workers that Dask gave up on."""
        now = time.monotonic()
        if now - self._counted < _COUNT:
            return True
        self._counted = now
        if self._client.scheduler_info(n_workers=1)["workers"]:
            self._last_staffed = now
        if self._refill is not None:
            self._refill()
        return now - self._last_staffed < PATIENCE

    def _without_workers(self, names: Sequence[str]) -> InputError:
        """The error for a pool without workers; ``names``: the logs that the last ones held."""
        listed = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
        after = f"; the last one was lost with {listed}" if names else ""
        if self._refill is None:
            return InputError(
                f"the scheduler at {self._address} has had no worker for {PATIENCE:.0f} s{after}",
                place="--scheduler",
                hint="start workers with more memory and run again; finished logs are kept",
            )
        return InputError(
            f"no worker of this machine came back within {PATIENCE:.0f} s{after}",
            place="--workers",
            hint="raise --memory or use fewer --workers and run again; finished logs are kept",
        )

    def _submit(
        self, batches: list[list[FleetLog]], settings: Settings, store: Store
    ) -> dict[Any, list[FleetLog]]:
        submit = self._client.submit
        return {
            submit(estimate_logs, batch, settings, store, pure=False, priority=-number): batch
            for number, batch in enumerate(batches)
        }


class _NoWorkersError(Exception):
    """No worker came back; ``logs`` are those that the lost workers held."""

    def __init__(self, logs: list[FleetLog]) -> None:
        super().__init__()
        self.logs = logs


def _lost_with(client: Any, open_batches: Mapping[Any, list[FleetLog]]) -> list[FleetLog]:
    """The logs of batches that were on a worker when it was lost; empty if the scheduler cannot be asked."""

    # A nested function is pickled by value, so a remote scheduler need not have Terragrip installed.
    def suspicious(dask_scheduler: Any) -> set[str]:
        return {key for key, task in dask_scheduler.tasks.items() if task.suspicious}

    try:
        keys = client.run_on_scheduler(suspicious)
    except (OSError, ValueError):
        return []
    return [log for future, batch in open_batches.items() if future.key in keys for log in batch]


def _outcomes_of(future: Any, batch: list[FleetLog], suspects: list[FleetLog]) -> list[Outcome]:
    """The outcomes of a batch that is no longer pending. Raises CancelledError or OSError if its scheduler was lost, TimeoutError if
    its result does not come within `_FETCH`."""
    from distributed import KilledWorker

    if future.status != "error":
        result: list[Outcome] = future.result(timeout=_FETCH)
        return result
    error = future.exception()
    if isinstance(error, KilledWorker):
        suspects += batch
        return []
    reason = " ".join(f"the worker could not run it ({type(error).__name__}: {error})".split())
    return [Outcome(log.name, reason=reason) for log in batch]


def default_workers() -> int:
    """The number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
