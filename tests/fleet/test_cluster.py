"""What a call does when Dask loses workers, a scheduler or a store for a while: by stand-ins for Dask's client and for the store.

Real ones: test_faults.py and test_s3.py.
"""

from __future__ import annotations

from concurrent.futures import CancelledError
from contextlib import AbstractContextManager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from terragrip.errors import InputError
from terragrip.fleet.cluster import Pool, workers_at
from terragrip.fleet.logs import FleetLog
from terragrip.fleet.store import Store
from terragrip.fleet.task import Outcome


def logs(count: int) -> list[FleetLog]:
    return [FleetLog(f"drive{k}.csv", f"drive{k}.csv", 1, "Heros", None, None) for k in range(count)]  # type: ignore[arg-type]


def client(submit: Any, status: str = "running") -> SimpleNamespace:
    """A client with one worker that hands batches to `submit`."""
    return SimpleNamespace(
        status=status,
        close=lambda **_: None,
        submit=lambda _, batch, *__, **___: submit(batch),
        scheduler_info=lambda **_: {"workers": {"one": 1}},
        wait_for_workers=lambda *_, **__: None,
    )


def done(batch: list[FleetLog]) -> Any:
    outcomes = [Outcome(log.name) for log in batch]
    return _Future(status="finished", result=lambda **_: outcomes)


class _Future(SimpleNamespace):
    __hash__ = object.__hash__  # futures are keys


def test_of_a_batch_that_loses_its_worker_twice_the_log_that_does_it_alone_is_named() -> None:
    pytest.importorskip("distributed", reason="needs terragrip[fleet]")
    from distributed import KilledWorker

    def submit(batch: list[FleetLog]) -> Any:
        if "drive3.csv" in {log.name for log in batch}:
            return _Future(status="error", exception=lambda: KilledWorker("a", None, 1))  # type: ignore[arg-type]
        return done(batch)

    pool = Pool(lambda: client(submit), "this machine", lambda: None)
    pool.connect(1.0)
    outcomes = {one.log: one.reason for one in pool.run(logs(20), None, None)}  # type: ignore[arg-type]
    assert len(outcomes) == 20
    assert [name for name, reason in outcomes.items() if reason] == ["drive3.csv"]
    assert "memory" in str(outcomes["drive3.csv"])


@pytest.mark.parametrize("how", ["cancelled", "unreachable", "closed"])
def test_what_is_lost_with_a_scheduler_is_done_by_the_next(how: str) -> None:
    pytest.importorskip("distributed", reason="needs terragrip[fleet]")

    def lost(_: object) -> Any:
        def result(**_: object) -> None:
            raise CancelledError if how == "cancelled" else OSError("unreachable")

        return _Future(status="pending" if how == "closed" else "finished", result=result)

    clients = [client(done), client(lost, status=how if how == "closed" else "running")]
    pool = Pool(lambda: clients.pop(), "tcp://127.0.0.1:1")
    pool.connect(1.0)
    named = [one.log for one in pool.run(logs(3), None, None)]  # type: ignore[arg-type]
    assert sorted(named) == ["drive0.csv", "drive1.csv", "drive2.csv"]
    assert clients == []


def test_where_no_worker_comes_back_the_logs_of_the_last_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs terragrip[fleet]")
    monkeypatch.setattr("terragrip.fleet.cluster.PATIENCE", 0.0)
    workers: dict[str, int] = {"one": 1}

    def submit(batch: list[FleetLog]) -> Any:
        if batch[0].name != "drive1.csv":
            return done(batch)
        workers.clear()  # while it works on this one
        return _Future(status="pending", key="a")

    dask = client(submit)
    dask.scheduler_info = lambda **_: {"workers": workers}
    dask.run_on_scheduler = lambda _: {"a"}
    pool = Pool(lambda: dask, "tcp://127.0.0.1:1")
    pool.connect(1.0)
    reasons: dict[str, str] = {}
    with pytest.raises(InputError, match=r"127\.0\.0\.1:1 has had no worker for 0 s; .*drive1\.csv"):  # noqa: PT012
        for one in pool.run(logs(3), None, None):  # type: ignore[arg-type]
            reasons[one.log] = one.reason
    assert {name for name, reason in reasons.items() if not reason} == {"drive0.csv", "drive2.csv"}
    assert "memory" in reasons["drive1.csv"]


def test_workers_here_have_the_memory_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it a log that needs more takes the whole machine's: test_faults.py."""
    distributed = pytest.importorskip("distributed", reason="needs terragrip[fleet]")

    def cluster(**words: object) -> None:
        raise InputError(f"{words['n_workers']} workers, {words['memory_limit']} bytes")

    monkeypatch.setattr(distributed, "LocalCluster", cluster)
    with pytest.raises(InputError, match="2 workers, 420000000 bytes"), workers_at(None, 2, "420MB"):
        pass


class _Here(AbstractContextManager[None]):
    """A cluster of this machine whose workers are gone with their first batch."""

    workers: dict[str, int]

    def __exit__(self, *_: object) -> None:
        pass

    def scale(self, count: int) -> None:
        self.workers.update({str(k): 1 for k in range(count)})


def test_workers_here_that_dask_gives_up_are_started_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """Real ones: test_faults.py."""
    distributed = pytest.importorskip("distributed", reason="needs terragrip[fleet]")
    here = _Here()
    here.workers = {"0": 1, "1": 1}

    class Waiting(_Future):
        @property
        def status(self) -> str:
            return "finished" if here.workers else "pending"

    def submit(batch: list[FleetLog]) -> Any:
        here.workers.clear()
        return Waiting(key="a", result=lambda **_: [Outcome(log.name) for log in batch])

    dask = client(submit)
    dask.scheduler_info = lambda **_: {"workers": here.workers}
    dask.run_on_scheduler = lambda _: set()
    monkeypatch.setattr(distributed, "LocalCluster", lambda **_: here)
    monkeypatch.setattr(distributed, "Client", lambda *_, **__: dask)
    monkeypatch.setattr("terragrip.fleet.cluster._COUNT", 0.0)
    monkeypatch.setattr("terragrip.fleet.cluster.PATIENCE", 5.0)
    with workers_at(None, 2, None) as pool:
        outcomes = list(pool.run(logs(3), None, None))  # type: ignore[arg-type]
    assert [one.reason for one in outcomes] == [None] * 3
    assert len(here.workers) == 2


class Refusing(MemoryFileSystem):
    """A store that refuses the first write of each object."""

    protocol = "refusing"
    store: dict[str, Any] = {}  # noqa: RUF012 - as of the class above, which shares it
    pseudo_dirs = [""]  # noqa: RUF012
    refused: set[str] = set()  # noqa: RUF012

    def put_file(self, lpath: str, rpath: str, *words: Any, **more: Any) -> None:
        if lpath not in self.refused:
            self.refused.add(lpath)
            raise ConnectionError("the store is busy")
        super().put_file(lpath, rpath, *words, **more)


def test_a_store_that_refuses_each_first_write_has_all_at_the_end(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("terragrip.fleet.store.RETRY_DELAYS", (0.0,))
    fsspec.register_implementation("refusing", Refusing, clobber=True)
    store = Store.at("refusing://fields/out")
    store.check()
    with store.staging(str(tmp_path)) as folder:
        for name in "ab":
            (folder / name).write_text(name)
            store.put(folder / name, f"estimates/{name}")
    assert store.read_all("estimates") == {"estimates/a": b"a", "estimates/b": b"b"}
    assert len(Refusing.refused) == 2
