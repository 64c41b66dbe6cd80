"""The process that does one long job, so that it can be cancelled: a request on standard input, a line of JSON for each step on standard
output, the last one with the outcome. Run as ``python -m terragrip.studio.worker``.
"""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path
from types import FrameType
from typing import Any

from terragrip.errors import InputError

PERIOD = 0.1
"""Seconds between two reports of progress."""


class _Reporter:
    def __init__(self) -> None:
        self._last = 0.0

    def __call__(self, done: int, total: int, text: str = "") -> None:
        now = time.monotonic()
        if now - self._last >= PERIOD or done == total:
            self._last = now
            send(state="running", done=int(done), total=int(total))


def send(**content: Any) -> None:
    """One line to the studio."""
    print(json.dumps(content), flush=True)


def run(request: dict[str, Any]) -> str:
    """Do the job that `request` describes ("kind" and absolute paths); returns a text for the user. Raises InputError."""
    kind = request["kind"]
    if kind == "estimate":
        return _estimate(request)
    if kind == "soils":
        return _soils(request)
    raise InputError(f"there is no job {kind!r}")


def _estimate(request: dict[str, Any]) -> str:
    from terragrip.from_log import estimate_file
    from terragrip.vehicle import Vehicle

    return estimate_file(
        request["recording"],
        Vehicle.load(request["vehicle"]),
        request["output"],
        request["method"],
        profile=request.get("profile"),
        smooth=bool(request.get("smooth")),
        progress=_Reporter(),
    )


def _soils(request: dict[str, Any]) -> str:
    from terragrip.soil.estimates import soils_of

    paths = [Path(path) for path in request["estimates"]]
    learning = [path for path in paths if _has_adhesion(path)]
    if not learning:
        raise InputError(
            "the estimates hold slip but no adhesion, so no soil can be learned",
            hint="estimate a log with torques",
        )
    campaign = soils_of(learning, progress=_Reporter())
    campaign.library({"from": [path.name for path in learning]}).write(request["output"])
    left = [f"{path.name}: left out, slip without adhesion" for path in paths if path not in learning]
    return "\n".join([*campaign.words, *left])


def _has_adhesion(path: Path) -> bool:
    import pyarrow.parquet as pq

    from terragrip.estimation.estimates import wheels_with

    return bool(wheels_with("adhesion", pq.read_schema(path).names))


def _stop(number: int, frame: FrameType | None) -> None:
    raise KeyboardInterrupt


def main() -> int:
    """Read the request, do it, say how it ended."""
    signal.signal(signal.SIGTERM, _stop)
    request = json.load(sys.stdin)
    try:
        send(state="done", text=run(request))
    except InputError as error:
        send(state="failed", text=str(error))
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
