"""What several checks make of a log, made once and kept for as long as the log is."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TYPE_CHECKING, Concatenate, ParamSpec, TypeVar, cast
from weakref import WeakKeyDictionary

if TYPE_CHECKING:
    from terragrip.recording.table import Recording

Others = ParamSpec("Others")
Result = TypeVar("Result")

_MADE: WeakKeyDictionary[Recording, dict[object, tuple[object, object]]] = WeakKeyDictionary()


def once(
    make: Callable[Concatenate[Recording, Others], Result],
) -> Callable[Concatenate[Recording, Others], Result]:
    """A function of a recording, whose channels do not change, and of other objects: of the same ones it gives the same result again,
    which is not to be written to."""

    @wraps(make)
    def made(recording: Recording, *others: Others.args, **named: Others.kwargs) -> Result:
        known = _MADE.setdefault(recording, {})
        key = (make, *(x if isinstance(x, str) else id(x) for x in others), *named.items())
        if key not in known:  # with the others, so that their ids stay theirs
            known[key] = others, make(recording, *others, **named)
        return cast(Result, known[key][1])

    return cast("Callable[Concatenate[Recording, Others], Result]", made)
