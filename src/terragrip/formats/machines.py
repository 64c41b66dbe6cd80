"""Which columns of a log are of one machine, where ROS's namespaces tell several apart (``/r1/joint_states``, ``/r2/joint_states``)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from typing import Any


def of_one_machine(columns: Iterable[str], speeds: Sequence[Sequence[str]]) -> tuple[list[str], list[str]]:
    """The columns without other machines', those beside the wheel speeds first, and a sentence on the other machines.

    ``speeds``: for each wheel the columns that may be its speed. Namespaces that have one of each wheel are machines, the first is kept.
    """
    spaces = [list(map(namespace_of, own)) for own in speeds]
    first = spaces[0] if spaces else []
    home, *others = dict.fromkeys(n for n in first if all(n in own for own in spaces)) or [""]
    return without(columns, home, others) if home else (list(columns), [])


def without(columns: Iterable[str], home: str, others: Collection[str]) -> tuple[list[str], list[str]]:
    """The columns without those in the namespaces of the ``others``, those of ``home`` first, and a sentence on the others."""
    kept = [column for column in columns if namespace_of(column) not in others]
    kept.sort(key=lambda column: namespace_of(column) != home)
    sentence = (
        f"The log has several machines, {', '.join((home, *others))}, of which {home} is read; "
        "for another one write e.g. 'namespace: {}' in the profile."
    )
    return kept, [sentence.format(next(iter(others)))] if others else []


def machines_among(spaces: Mapping[str, Collection[str]], rims: Mapping[str, Collection[str]]) -> list[str]:
    """The namespaces that are machines, empty if there are not several: the first whose ``rims`` others have, too, then those.

    By namespace, ``spaces`` are all names inside it, ``rims`` those that are speeds of wheels.
    """
    for home, own in rims.items():
        others = [space for space, names in spaces.items() if space != home and set(own) <= set(names)]
        if own and others:
            return [home, *others]
    return []


def namespace_of(column: str) -> str:
    """``/r1`` of ``/r1/joint_states.velocity.fl``; empty without one."""
    parts = column.partition(".")[0].split("/")
    return f"/{parts[1]}" if len(parts) > 2 and not parts[0] else ""


def inside(namespace: str, name: str) -> str:
    """A profile's name or pattern inside a namespace: ``/r1/odom.x`` for ``/odom.x``; one that is inside stays, as a plain one."""
    is_out = name.startswith(("/", "*")) and not name.startswith(f"{namespace}/")
    return f"{namespace}{'/' * name.startswith('*')}{name}" if is_out else name


def renamed(value: Any, rename: Callable[[str], str]) -> Any:
    """Part of a profile's content with its names changed."""
    if isinstance(value, Mapping):
        return {renamed(key, rename): renamed(own, rename) for key, own in value.items()}
    if isinstance(value, list | tuple):
        return [renamed(own, rename) for own in value]
    return rename(value) if isinstance(value, str) else value
