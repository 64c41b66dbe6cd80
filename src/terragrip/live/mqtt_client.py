"""The connection to an MQTT broker, for source and sink."""

from __future__ import annotations

import logging
import socket
import ssl
from typing import Any

from terragrip.errors import InputError
from terragrip.live.credentials import Credentials
from terragrip.live.uri import Uri

_silent = logging.getLogger("terragrip.live.mqtt")
_silent.addHandler(logging.NullHandler())
_silent.propagate = False  # the service says itself what is lost


def check(uri: Uri) -> Credentials:
    """Raise InputError on a missing host or topic, a CA that cannot be read, or a password that would travel openly."""
    import aiomqtt  # noqa: F401  # so that a missing package is said at once

    if not uri.host or not uri.path.strip("/"):
        raise InputError("names no broker and topic", place=uri.text, hint="write mqtt://127.0.0.1/machine/+")
    credentials = Credentials.find()
    if uri.scheme == "mqtts":
        _tls(uri)
    elif credentials.password and not uri.is_loopback():
        raise InputError("the password would travel openly", place=uri.text, hint="use mqtts:")
    return credentials


def client(uri: Uri) -> Any:
    """An aiomqtt client for ``mqtt://HOST[:1883]/TOPIC`` or, by TLS, ``mqtts://HOST[:8883]/TOPIC?ca=FILE``.

    Needs a running loop; raises InputError as `check` does.
    """
    import aiomqtt

    credentials, secure = check(uri), uri.scheme == "mqtts"
    return aiomqtt.Client(
        uri.host,
        uri.port or (8883 if secure else 1883),
        username=credentials.username,
        password=credentials.password,
        identifier=uri.options.get("client"),
        tls_context=_tls(uri) if secure else None,
        timeout=5.0,
        # Or a message waits up to 40 ms for the broker to acknowledge the one before (Nagle's algorithm).
        socket_options=[(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)],
        logger=_silent,
    )


def _tls(uri: Uri) -> ssl.SSLContext:
    try:
        return ssl.create_default_context(cafile=uri.options.get("ca"))
    except (OSError, ssl.SSLError) as error:
        raise InputError(
            f"the CA cannot be read ({error.strerror or error})", file=uri.options.get("ca"), place=uri.text,
            hint="name a PEM file",
        ) from error  # fmt: skip


def quality(uri: Uri) -> int:
    """The quality of service asked for; raises InputError unless it is 0, 1 or 2."""
    text = uri.options.get("qos", "0")
    if text not in ("0", "1", "2"):
        raise InputError(f"qos is {text!r}", place=uri.text, hint="give 0, 1 or 2")
    return int(text)
