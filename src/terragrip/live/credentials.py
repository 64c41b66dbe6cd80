"""Names, passwords and tokens: from the environment, or from a file that only its owner may read; never shown."""

from __future__ import annotations

import hmac
import os
import stat
from dataclasses import dataclass, field
from pathlib import Path

from terragrip.errors import InputError

_KEYS = ("username", "password", "token")
FILE = "TERRAGRIP_CREDENTIALS"


@dataclass(frozen=True, slots=True)
class Credentials:
    """What may be known; None what is not."""

    username: str | None = None
    password: str | None = field(default=None, repr=False)
    token: str | None = field(default=None, repr=False)

    @classmethod
    def find(cls) -> Credentials:
        """TERRAGRIP_USERNAME, TERRAGRIP_PASSWORD, TERRAGRIP_TOKEN; what they lack from the file TERRAGRIP_CREDENTIALS names.

        The file has lines ``username: …``. Raises InputError where it is missing, or others may read it.
        """
        path = os.environ.get(FILE)
        result = _from_file(Path(path)) if path else {}
        for key in _KEYS:
            value = os.environ.get(f"TERRAGRIP_{key.upper()}")
            if value:
                result[key] = value
        return cls(**result)

    def grants(self, given: str | None) -> bool:
        """Whether what a client gave is the token."""
        return self.token is not None and hmac.compare_digest((given or "").encode(), self.token.encode())


def _from_file(path: Path) -> dict[str, str]:
    try:
        mode = path.stat().st_mode
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or "is no text"
        raise InputError(f"cannot be read ({why})", file=path, place=FILE, hint="check the path") from error
    if stat.S_IMODE(mode) & 0o077:
        raise InputError(
            f"others can read it (mode {stat.S_IMODE(mode):04o})", file=path, place=FILE, hint="chmod 600"
        )
    result: dict[str, str] = {}
    for number, line in enumerate(text.splitlines(), 1):
        key, colon, value = line.partition(":")
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not colon or key.strip() not in _KEYS:
            raise InputError(
                "is neither username, password nor token", file=path, place=f"line {number}",
                hint="write 'username: …'",
            )  # fmt: skip
        result[key.strip()] = value.strip()
    return result
