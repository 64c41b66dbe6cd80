"""The application: routes, errors as one line, the built front end."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import AsyncIterator, Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, Response
from fastapi.staticfiles import StaticFiles

from terragrip import __version__
from terragrip.errors import InputError
from terragrip.studio.access import Access
from terragrip.studio.state import UPLOAD_LIMIT, Studio

STATIC = Path(__file__).with_name("static")
ROUTES = (
    "files",
    "columns",
    "machines",
    "jobs",
    "curves",
    "fit",
    "pictures",
    "drive",
    "advice",
    "signals",
    "live",
    "basemap",
    "maps",
)
NOT_BUILT = (
    "The studio's pages are not built. They need Node.js 20 or newer: install it, then run `make studio` in a clone "
    "(or install a released wheel, which contains them). The interface at /openapi.json works without them."
)


def create_app(
    folder: str | os.PathLike[str],
    *,
    token: str | None = None,
    hosts: Iterable[str] = (),
    upload_limit: int = UPLOAD_LIMIT,
    live: str | None = None,
    public: str | None = None,
) -> FastAPI:
    """The studio on one folder, as an ASGI application.

    Parameters
    ----------
    folder: the only folder that requests can read or write.
    token: what every request must bring; needed on any address but loopback.
    hosts: names that the Host header may carry besides loopback's.
    upload_limit: bytes of one upload.
    live: WebSocket address of a running live service.
    public: the address that browsers see where a reverse proxy stands in front.

    Raises InputError if there is no such folder.
    """
    studio = Studio(folder, upload_limit, live)

    @contextlib.asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        threading.Thread(target=studio.prepare_maps, daemon=True).start()
        yield
        await studio.jobs.close()

    # Swagger's own page loads from the internet; the description alone is at /openapi.json.
    app = FastAPI(
        title="Terragrip studio",
        version=__version__,
        docs_url=None,
        redoc_url=None,
        lifespan=life,
        routes=list(_interface().routes),
    )
    app.state.studio = studio
    app.add_exception_handler(InputError, _unusable)
    app.add_exception_handler(RequestValidationError, _malformed)
    if (STATIC / "index.html").is_file():
        app.mount("/", _Pages(directory=STATIC, html=True), name="pages")
    else:
        app.add_api_route("/", _not_built, include_in_schema=False)
    app.add_middleware(Access, hosts=tuple(hosts), token=token, public=public)
    return app


@cache
def _interface() -> APIRouter:
    """All routes but the pages. An application that includes routers itself reads their functions' signatures anew at its first request."""
    router = APIRouter()
    for name in ROUTES:
        router.include_router(import_module(f"terragrip.studio.api.{name}").router, prefix="/api")
    router.include_router(import_module("terragrip.studio.api.monitoring").router)
    return router


class _Pages(StaticFiles):
    """The built pages, compressed at build time: names with a hash never change, the rest is asked for again."""

    async def get_response(self, path: str, scope: Any) -> Response:
        response = await super().get_response(path, scope)
        whole = getattr(response, "path", None)
        if response.status_code != 200 or whole is None:
            return response
        accepted = dict(scope["headers"]).get(b"accept-encoding", b"").decode("latin-1")
        for coding, ending in (("br", ".br"), ("gzip", ".gz")):
            packed = f"{whole}{ending}"
            if coding in accepted and os.path.isfile(packed):
                response = FileResponse(packed, media_type=response.media_type)
                response.headers["content-encoding"] = coding
                break
        response.headers["vary"] = "accept-encoding"
        fixed = "/assets/" in os.fspath(whole)
        response.headers["cache-control"] = "public, max-age=31536000, immutable" if fixed else "no-cache"
        return response


async def _unusable(request: Request, error: Exception) -> Response:
    root = f"{request.app.state.studio.folder.root}/"
    return JSONResponse({"detail": str(error).replace(root, "")}, status_code=422)


async def _malformed(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    first = error.errors()[0]
    place = ".".join(str(part) for part in first.get("loc", ())[1:])
    return JSONResponse({"detail": f"{place}: {first.get('msg', 'is not usable')}"}, status_code=422)


async def _not_built() -> Response:
    return Response(NOT_BUILT, media_type="text/plain", status_code=503)
