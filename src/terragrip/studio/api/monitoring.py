"""What a monitoring system asks: is the studio alive, is it ready, what has it done."""

from __future__ import annotations

import http.client
import os
from urllib.parse import urlsplit

from fastapi import APIRouter
from fastapi.responses import PlainTextResponse

from terragrip.live.monitor import LIVE, READY
from terragrip.prometheus_text import CONTENT_TYPE, METRICS, Metrics
from terragrip.studio.api.live import LIVE_TOKEN
from terragrip.studio.job_store import STATES
from terragrip.studio.state import Here, Studio

router = APIRouter(tags=["monitoring"], default_response_class=PlainTextResponse)

_PATIENCE = 2.0  # s for the live service to answer


@router.get(LIVE)
async def alive() -> str:
    """The process answers."""
    return "alive\n"


@router.get(READY)
def ready(studio: Here) -> PlainTextResponse:
    """200 where the folder can be used and the live service, if one was named, gets data; else 503 and why, in one line."""
    why = _unready(studio)
    return PlainTextResponse("ready\n") if why is None else PlainTextResponse(f"{why}\n", 503)


@router.get(METRICS)
async def metrics(studio: Here) -> PlainTextResponse:
    """Jobs and pages, as Prometheus reads them."""
    page = Metrics()
    states = [job.state for job in studio.jobs.all()]
    page.add(
        "gauge", "terragrip_studio_jobs", "Jobs in the list (the last 50 that ended) by state.",
        [({"state": state}, states.count(state)) for state in STATES],
    )  # fmt: skip
    page.add("gauge", "terragrip_studio_pages", "Pages open.", studio.notices.pages)
    return PlainTextResponse(str(page), media_type=CONTENT_TYPE)


def _unready(studio: Studio) -> str | None:
    root = studio.folder.root
    if not (root.is_dir() and os.access(root, os.R_OK | os.W_OK | os.X_OK)):
        return "the folder is gone, or cannot be read and written"
    return None if studio.live is None else _of_live(studio.live)


def _of_live(address: str) -> str | None:
    """What the live service answers when asked the same; None where it is ready."""
    place = urlsplit(address)
    kind = http.client.HTTPSConnection if place.scheme == "wss" else http.client.HTTPConnection
    token = os.environ.get(LIVE_TOKEN)
    connection = kind(place.hostname or "", place.port, timeout=_PATIENCE)
    try:
        connection.request("GET", READY, headers={"Authorization": f"Bearer {token}"} if token else {})
        answer = connection.getresponse()
        text = answer.read(300).decode(errors="replace").partition("\n")[0]
    except (OSError, http.client.HTTPException) as error:
        why = getattr(error, "strerror", None) or error or type(error).__name__
        return f"the live service at {place.hostname}:{place.port} does not answer ({why})"
    finally:
        connection.close()
    return None if answer.status == 200 else f"the live service: {text or answer.reason}"
