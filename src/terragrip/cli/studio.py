"""``terragrip studio``: the pages where an engineer looks, served on this machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from terragrip.cli.log import LogForm, LogFormat, log_to_stderr
from terragrip.errors import InputError, missing_package


def command(
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER", help="Folder of logs, estimates and libraries; the only place read or written."
        ),
    ] = Path(),
    address: Annotated[
        str,
        typer.Option(
            "--address", metavar="IP", help="Address to serve other machines too; a token is then needed."
        ),
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="TCP port; 0 chooses a free one.")] = 8750,
    live: Annotated[
        str | None, typer.Option("--live", metavar="URL", help="WebSocket of a running 'terragrip live'.")
    ] = None,
    public_url: Annotated[
        str | None,
        typer.Option(
            "--public-url",
            metavar="URL",
            help="Address at which browsers reach a reverse proxy in front; a token is then needed.",
        ),
    ] = None,
    tls_certificate: Annotated[
        Path | None,
        typer.Option("--tls-certificate", metavar="PEM", help="Serve https with this certificate (chain)."),
    ] = None,
    tls_key: Annotated[
        Path | None,
        typer.Option("--tls-key", metavar="PEM", help="The certificate's key, without a password."),
    ] = None,
    upload_limit: Annotated[
        int, typer.Option("--upload-limit", metavar="MB", min=1, help="Largest file that can be uploaded.")
    ] = 2000,
    log_format: LogFormat = LogForm.text,
) -> None:
    """Open the studio on a folder.

    The token for other machines is new at each start, or that of the environment variable TERRAGRIP_TOKEN. Ctrl-C ends the studio.
    """
    from terragrip.live.uri import is_address, is_loopback

    if not (home := is_loopback(address)) and not is_address(address):
        raise InputError(f"{address!r} is not an IP address", place="--address", hint="give e.g. 0.0.0.0")
    if live is not None and not live.startswith(("ws://", "wss://")):
        raise InputError(f"{live!r} is not a WebSocket address", place="--live", hint="give ws://HOST:PORT")
    if public_url is not None and not _is_web_address(public_url):
        raise InputError(
            f"{public_url!r} is not a web address",
            place="--public-url",
            hint="give https://HOST, or https://HOST/PATH",
        )
    if (tls_certificate is None) != (tls_key is None):
        raise InputError(
            "a certificate needs its key, and a key its certificate",
            place="--tls-key" if tls_key is None else "--tls-certificate",
            hint="give both as PEM files",
        )
    try:
        from terragrip.studio.serve import Certificate, serve
    except ModuleNotFoundError as error:
        if (error.name or "").split(".")[0] == "terragrip":
            raise
        raise missing_package(error.name or "", "studio", "serve the studio") from error
    as_json = log_format is LogForm.json
    if as_json:
        log_to_stderr(log_format)
    limit = upload_limit * 1_000_000
    serve(
        folder,
        address,
        port,
        loopback=home,
        live=live,
        upload_limit=limit,
        public=public_url,
        as_json=as_json,
        certificate=Certificate(tls_certificate, tls_key) if tls_certificate and tls_key else None,
    )


def _is_web_address(text: str) -> bool:
    from urllib.parse import urlsplit

    try:
        place = urlsplit(text)
        return (
            place.scheme in ("http", "https") and bool(place.hostname) and not (place.query or place.fragment)
        )
    except ValueError:
        return False
