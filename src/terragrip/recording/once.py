"""What several checks make of a log, or of its windows, made once and kept for as long as these are."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Concatenate, ParamSpec, TypeVar, cast
from weakref import WeakKeyDictionary

Owner = TypeVar("Owner")
Others = ParamSpec("Others")
Result = TypeVar("Result")

_MADE: WeakKeyDictionary[object, dict[object, tuple[object, object]]] = WeakKeyDictionary()


def once(
    make: Callable[Concatenate[Owner, Others], Result],
) -> Callable[Concatenate[Owner, Others], Result]:
    """A function of a recording or another object that does not change and is compared by identity, and of others: of the same ones it
    gives the same result again, which is not to be written to."""

    @wraps(make)
    def made(owner: Owner, *others: Others.args, **named: Others.kwargs) -> Result:
        known = _MADE.setdefault(owner, {})
        key = (make, *(x if isinstance(x, str) else id(x) for x in others), *named.items())
        if key not in known:  # with the others, so that their ids stay theirs
            known[key] = others, make(owner, *others, **named)
        return cast(Result, known[key][1])

    return cast("Callable[Concatenate[Owner, Others], Result]", made)
