"""Sources and sinks by URI: ``udp://127.0.0.1:9870?format=doubles``, ``can:can0?interface=socketcan``, ``replay:LOG?speed=10``."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from ipaddress import ip_address
from urllib.parse import parse_qsl, unquote, urlsplit

from terragrip.errors import InputError, suggestion


def is_address(host: str) -> bool:
    """Whether a host is an IP address."""
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Whether a host can be reached from this machine only; a name, even 127.0.0.1.example.org, is whatever its owner says."""
    return host == "localhost" or (is_address(host) and ip_address(host).is_loopback)


@dataclass(frozen=True, slots=True)
class Uri:
    """A URI taken apart. ``text`` is what the user wrote; ``path`` what follows ``scheme:`` or the host."""

    text: str
    scheme: str
    host: str = ""
    port: int | None = None
    path: str = ""
    options: dict[str, str] = field(default_factory=dict)

    @classmethod
    def parse(cls, text: str, schemes: dict[str, Collection[str]], role: str) -> Uri:
        """Take a URI apart; ``schemes`` are those known, each with its options.

        Raises InputError on an unknown scheme or option, and on a password, which everyone could read.
        """
        head, colon, _ = text.partition(":")
        scheme = head.lower()
        try:
            parts = urlsplit(text)
            port = parts.port
        except ValueError as error:
            raise InputError(
                f"{head}:… is not a URI ({error})", place=f"--{role}", hint="write host:port"
            ) from error
        if parts.username or parts.password:
            raise InputError(
                f"credentials do not belong on the command line ({scheme}://…@{parts.hostname})", place=f"--{role}",
                hint="set TERRAGRIP_USERNAME and TERRAGRIP_PASSWORD, or TERRAGRIP_CREDENTIALS=FILE of mode 0600",
            )  # fmt: skip
        if not colon or scheme not in schemes:
            hint = suggestion(scheme, schemes, f"give one of {', '.join(f'{s}:' for s in schemes)}")
            raise InputError(
                f"{head[:20]!r} is not a {role} that Terragrip knows", place=f"--{role}", hint=hint
            )
        # The fragment sign is a wild card of MQTT, not the beginning of a fragment.
        rest = text[len(head) + 1 :]
        path = rest.split("?", 1)[0]
        if path.startswith("//"):
            path = path[2:].partition("/")[2]
        options = dict(parse_qsl(rest.partition("?")[2], keep_blank_values=True))
        for name in options:
            if name not in schemes[scheme]:
                known = ", ".join(sorted(schemes[scheme])) or "none"
                hint = suggestion(name, schemes[scheme], f"its options are: {known}")
                raise InputError(f"{scheme}: has no option {name!r}", place=f"--{role} {text}", hint=hint)
        return cls(text, scheme, parts.hostname or "", port, unquote(path), options)

    @property
    def name(self) -> str:
        """The URI without its options: what it is called in events and the record."""
        return self.text.split("?", 1)[0]

    def number(self, option: str, default: float) -> float:
        """An option as a positive number; raises InputError if it is none."""
        text = self.options.get(option)
        if text is None:
            return default
        try:
            value = float(text)
        except ValueError:
            value = 0.0
        if not 0.0 < value < float("inf"):
            raise InputError(f"{option} is {text!r}", place=self.text, hint="give a positive number")
        return value

    def choice(self, option: str, known: Sequence[str]) -> str:
        """An option that is one of those ``known``, by default the first; raises InputError if it is none."""
        text = self.options.get(option, known[0])
        if text not in known:
            hint = f"give {', '.join(known[:-1])} or {known[-1]}"
            raise InputError(f"{option} is {text!r}", place=self.text, hint=hint)
        return text
