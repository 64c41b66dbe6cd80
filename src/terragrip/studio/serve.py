"""Serve the studio until Ctrl-C."""

from __future__ import annotations

import logging
import os
import secrets
import socket
import ssl
from dataclasses import dataclass
from pathlib import Path

import uvicorn

from terragrip.errors import InputError
from terragrip.log_events import emit
from terragrip.studio.app import STATIC, create_app

TOKEN = "TERRAGRIP_TOKEN"
SHORTEST = 16
"""Characters that a token of the user's own must have."""


@dataclass(frozen=True)
class Certificate:
    """Paths of a certificate (chain) and its key, both PEM."""

    chain: Path
    key: Path

    def check(self) -> None:
        """InputError where they cannot be read, are no PEM, do not belong together, or the key has a password."""
        try:
            ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(self.chain, self.key, password="")
        except (OSError, ValueError) as error:  # ssl.SSLError is an OSError
            missing = next((one for one in (self.chain, self.key) if not one.is_file()), None)
            raise InputError(
                "is not there" if missing else f"cannot be used with {self.key} ({error})",
                file=missing or self.chain,
                place="--tls-certificate",
                hint="give the certificate with its chain and its key without a password, both as PEM files",
            ) from None


def serve(
    folder: Path,
    address: str,
    port: int,
    *,
    loopback: bool,
    live: str | None,
    upload_limit: int,
    public: str | None = None,
    as_json: bool = False,
    certificate: Certificate | None = None,
) -> None:
    """Bind, say where the pages are, serve. InputError where the folder or the port cannot be used, or the token is too short.

    `public`: the address by which a reverse proxy is reached. What comes through it comes from other machines, so a token is needed,
    though the studio itself stands on loopback. `as_json`: nothing is printed; events are logged, as are uvicorn's warnings.
    `certificate`: https instead of http.
    """
    if certificate is not None:
        certificate.check()
    if as_json and not (loopback and public is None) and TOKEN not in os.environ:
        raise InputError("a new token would appear in the log", place="--log-format", hint=f"set {TOKEN}")
    token = None if loopback and public is None else _token()
    app = create_app(
        folder, token=token, hosts=(address,), upload_limit=upload_limit, live=live, public=public
    )
    listener = _bind(address, port)
    own = f"http{'' if certificate is None else 's'}://{_shown(address)}:{listener.getsockname()[1]}/"
    place = own if public is None else f"{public.rstrip('/')}/"
    logger = logging.getLogger("terragrip.studio")
    emit(logger, "studio_started", address=place)
    if not as_json:
        _say(place, own, token, loopback=loopback, public=public, encrypted=certificate is not None)
    # No access log: it would hold the token of the first request.
    config = uvicorn.Config(
        app,
        loop="asyncio",  # also where uvloop is installed: a second loop would earn nothing here
        log_level="warning",
        access_log=False,
        ws_max_size=1 << 20,
        timeout_graceful_shutdown=2,
        ssl_certfile=None if certificate is None else certificate.chain,
        ssl_keyfile=None if certificate is None else certificate.key,
    )
    if as_json:  # its own handlers write text
        for name in ("uvicorn", "uvicorn.error"):
            logging.getLogger(name).handlers.clear()
            logging.getLogger(name).propagate = True
    server = uvicorn.Server(config)
    try:
        server.run(sockets=[listener])
    except KeyboardInterrupt:
        pass
    finally:
        listener.close()
        emit(logger, "studio_stopped")


def _say(
    place: str, own: str, token: str | None, *, loopback: bool, public: str | None, encrypted: bool
) -> None:
    """Print how the pages are reached."""
    if not (STATIC / "index.html").is_file():
        print(
            "The pages are not built (Node.js 20 or newer, then `make studio`); only the interface is served."
        )
    print(
        f"Terragrip studio: {place}{f'?token={token}' if token and TOKEN not in os.environ else ''}",
        flush=True,
    )
    if public is not None:
        print(f"The proxy must forward to {own}.", flush=True)
    elif not loopback:
        way = "" if encrypted else "; the connection is not encrypted"
        print(f"Anyone who knows the token can read and write this folder{way}.", flush=True)


def _token() -> str:
    given = os.environ.get(TOKEN)
    if given is None:
        return secrets.token_urlsafe(24)
    if len(given) < SHORTEST or not given.isascii() or not given.isprintable():
        raise InputError(
            f"is shorter than {SHORTEST} printable characters", place=TOKEN, hint="choose a longer one"
        )
    return given


def _bind(address: str, port: int) -> socket.socket:
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((address, port))
        listener.listen()  # from here on the printed address answers, if after a moment
    except OSError as error:
        listener.close()
        raise InputError(
            f"{address}:{port} cannot be used ({error.strerror})", place="--port", hint="choose another, or 0"
        ) from error
    return listener


def _shown(address: str) -> str:
    return f"[{address}]" if ":" in address else address
