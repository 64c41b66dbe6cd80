"""The one error that a user's input can raise."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from typing import Any


class InputError(ValueError):
    """An input or a call is unusable. The text is one line: the problem, the place, and the fix.

    Parameters
    ----------
    problem: the problem, without the place.
    file: the file that has it, if any.
    place: the place in the file (``"column ground_speed, row 17"``, ``"axles.front.mass"``).
    hint: how the user can correct it.
    page: the page of the documentation that explains it, and its heading: ``"vehicle#all-keys"`` is docs/vehicle.md.

    The command line prints ``str(error)`` and exits with 2.
    """

    def __init__(
        self,
        problem: str,
        *,
        file: str | os.PathLike[str] | None = None,
        place: str | None = None,
        hint: str | None = None,
        page: str | None = None,
    ) -> None:
        self.problem = problem
        self.file = None if file is None else os.fspath(file)
        self.place = place
        self.hint = hint
        self.page = page
        text = ": ".join(part for part in (self.file, place, problem) if part)
        if hint:
            text = f"{text}; {hint}"
        if page:
            text = f"{text} (docs: {page})"
        super().__init__(" ".join(text.split()))

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by the arguments, so that the error survives a worker process."""
        return _rebuild, (self.problem, self.file, self.place, self.hint, self.page)


def _rebuild(
    problem: str, file: str | None, place: str | None, hint: str | None, page: str | None
) -> InputError:
    return InputError(problem, file=file, place=place, hint=hint, page=page)


def missing_package(
    package: str,
    extra: str,
    purpose: str = "",
    *,
    file: str | os.PathLike[str] | None = None,
    place: str | None = None,
) -> InputError:
    """The error of a package that is not installed: ``"to read MDF the Python package 'asammdf' is needed"``, and the extra to install."""
    problem = f"to {purpose} the" if purpose else "the"
    return InputError(
        f"{problem} Python package {package!r} is needed",
        file=file,
        place=place,
        hint=f"pip install 'terragrip[{extra}]'",
        page="install",
    )


def reason_of(error: Exception, no_memory: str = "not enough memory") -> str:
    """Why one of many failed while the others go on, in one line: what the user gave, memory, a file, or a defect of ours."""
    text = f"a defect of Terragrip ({type(error).__name__}: {error})"
    if isinstance(error, InputError):
        text = str(error)
    elif isinstance(error, MemoryError):
        text = no_memory
    elif isinstance(error, OSError):
        text = f"a file cannot be read or written ({error})"
    return " ".join(text.split())


def system_error(error: BaseException) -> int | None:
    """The system's number (errno) of a failure or of what caused it; Arrow and Polars put it into their text. None where there is none."""
    cause: BaseException | None = error
    while cause is not None:
        number = getattr(cause, "errno", None)
        if number is not None:
            return int(number)
        written = re.search(r"(?:errno|os error) (\d+)", str(cause), re.IGNORECASE)
        if written:
            return int(written[1])
        cause = cause.__cause__
    return None


def nearest(name: str, known: Iterable[str]) -> str | None:
    """The known name most similar to ``name`` (case and underscores ignored), or None if none is close."""
    from difflib import get_close_matches

    wanted = _plain(name)
    plain = {_plain(k): k for k in known}
    match = get_close_matches(wanted, list(plain), n=1, cutoff=0.7)
    if not match and len(wanted) >= 3:
        match = [p for p in plain if wanted in p or (len(p) >= 3 and p in wanted)]
    return plain[match[0]] if match else None


def suggestion(name: str, known: Iterable[str], otherwise: str | None = None) -> str | None:
    """The hint for an unknown name: the nearest of those known, else ``otherwise``."""
    close = nearest(name, known)
    return f"did you mean {close}?" if close else otherwise


def _plain(name: str) -> str:
    return "".join(name.casefold().split()).replace("_", "")
