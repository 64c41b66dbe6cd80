"""Who may talk to the studio: host, origin and token checks, and the headers that keep a page to itself.

A page of another site can send requests to loopback (DNS rebinding, cross-site forms, WebSockets, which no
same-origin rule holds back). So every request is checked here, before any route sees it.
"""

from __future__ import annotations

import hmac
import logging
from collections.abc import Iterable
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, quote, urlsplit

from terragrip.live.uri import is_address, is_loopback
from terragrip.log_events import emit

COOKIE = "terragrip_token"
_READING = ("GET", "HEAD", "OPTIONS")
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; connect-src 'self'; "
    "font-src 'self'; worker-src 'self'; manifest-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'"
)
_HEADERS = (
    (b"content-security-policy", POLICY.encode()),
    (b"x-content-type-options", b"nosniff"),
    (b"x-frame-options", b"DENY"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
)


class Access:
    """ASGI middleware that lets through what comes from the studio's own page, or from a program that knows the token.

    Parameters
    ----------
    app: the ASGI application behind.
    hosts: names that the Host header may carry besides the loopback names.
    token: what every request must bring (cookie, or ``Authorization: Bearer``); None on loopback.
    public: the address that browsers see where a reverse proxy stands in front (https://example.org/studio); its host and origin are the
        studio's too, its cookie is kept to its path, and to TLS where it has it. Needs a token.
    """

    def __init__(
        self, app: Any, hosts: Iterable[str] = (), token: str | None = None, public: str | None = None
    ) -> None:
        self._app, self._token = app, token
        self._hosts = {host.lower() for host in hosts}
        place = urlsplit(public or "")
        self._public = place.netloc.lower()
        self._path = f"{place.path.rstrip('/')}/"
        self._tls = place.scheme == "https"

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        problem = self._problem(scope, headers)
        if problem is None and self._token is not None:
            handed = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
            if scope["type"] == "http" and scope["path"] == "/" and handed:
                await self._log_in(send, handed, secure=self._tls or scope.get("scheme") == "https")
                return
            if not self._has_token(headers):
                problem = (401, "a token is needed: open the address that 'terragrip studio' printed")
        if problem is not None:
            _audit(scope, problem[0])
            await _refuse(scope, send, *problem)
            return

        async def guarded(message: Any) -> None:
            if message["type"] == "http.response.start":
                _audit(scope, message["status"])
                own = message.get("headers", [])
                named = {name for name, _ in own}  # a report has a stricter policy of its own
                message = {**message, "headers": [*own, *(one for one in _HEADERS if one[0] not in named)]}
            await send(message)

        await self._app(scope, receive, guarded)

    def _problem(self, scope: Any, headers: dict[str, str]) -> tuple[int, str] | None:
        host = headers.get("host", "")
        if not self._host_is_ours(host):
            return 403, "this host name is not the studio's"
        origin = headers.get("origin")
        # A proxy that hands on its own Host header leaves the browser's origin: the public address.
        ours = {host.lower(), self._public} - {""}
        if origin is not None and urlsplit(origin).netloc.lower() not in ours:
            return 403, "requests from other sites are refused"
        site = headers.get("sec-fetch-site", "none")
        navigation = headers.get("sec-fetch-mode") == "navigate" and scope.get("method") == "GET"
        if site not in ("same-origin", "none") and not (navigation and not scope["path"].startswith("/api")):
            return 403, "requests from other sites are refused"
        return None

    def _host_is_ours(self, header: str) -> bool:
        name = (urlsplit(f"//{header}").hostname or "").lower()
        if is_loopback(name) or name in self._hosts or header.lower() == self._public != "":
            return True
        # With a token a rebound name gains nothing: it cannot bring the cookie of another name. So a tablet may name the machine
        # by its address, and by a name that only its own network gives out (RFC 6762, mDNS).
        return self._token is not None and (is_address(name) or name.endswith(".local"))

    def _has_token(self, headers: dict[str, str]) -> bool:
        assert self._token is not None
        kind, _, given = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and _same(given.strip(), self._token):
            return True
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return cookie is not None and _same(cookie.value, self._token)

    async def _log_in(self, send: Any, given: str, *, secure: bool) -> None:
        assert self._token is not None
        if not _same(given, self._token):
            await _answer(send, 401, "this token is not the studio's")
            return
        cookie = f"{COOKIE}={quote(self._token)}; HttpOnly; SameSite=Strict; Path={self._path}"
        cookie += "; Secure" if secure else ""
        await _answer(send, 303, "", ((b"location", self._path.encode()), (b"set-cookie", cookie.encode())))


def _audit(scope: Any, status: int) -> None:
    """One line for each request that would change something: from where, what, and how it ended."""
    if scope["type"] == "http" and scope["method"] not in _READING:
        client = scope.get("client") or ("",)
        emit(
            logging.getLogger("terragrip.studio"),
            "studio_write",
            client=client[0],
            method=scope["method"],
            path=scope["path"],
            status=status,
        )


def _same(given: str, token: str) -> bool:
    return hmac.compare_digest(given.encode(), token.encode())


async def _refuse(scope: Any, send: Any, status: int, text: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": text})
    else:
        await _answer(send, status, text)


async def _answer(send: Any, status: int, text: str, more: tuple[tuple[bytes, bytes], ...] = ()) -> None:
    headers = [(b"content-type", b"text/plain; charset=utf-8"), *more, *_HEADERS]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": text.encode()})
