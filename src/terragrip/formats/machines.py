"""Which columns of a log are of one machine, where ROS's namespaces tell several apart (``/r1/joint_states``, ``/r2/joint_states``)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def of_one_machine(columns: Iterable[str], speeds: Sequence[Sequence[str]]) -> tuple[list[str], list[str]]:
    """The columns without other machines', those beside the wheel speeds first, and a sentence on the other machines.

    ``speeds``: for each wheel the columns that may be its speed. Namespaces that have one of each wheel are machines, the first is kept.
    """
    spaces = [list(map(_namespace, own)) for own in speeds]
    first = spaces[0] if spaces else []
    home, *others = dict.fromkeys(n for n in first if all(n in own for own in spaces)) or [""]
    if not home:
        return list(columns), []
    kept = [column for column in columns if _namespace(column) not in others]
    kept.sort(key=lambda column: _namespace(column) != home)
    sentence = (
        f"The log has several machines, {', '.join((home, *others))}, of which {home} is read; "
        "for another one name its columns in a profile."
    )
    return kept, [sentence] if others else []


def twins(column: str, columns: Iterable[str]) -> list[str]:
    """A column, then those that have its name in other namespaces."""
    name = column.removeprefix(_namespace(column))
    return [column, *(c for c in columns if c != column and c.removeprefix(_namespace(c)) == name)]


def _namespace(column: str) -> str:
    """``/r1`` of ``/r1/joint_states.velocity.fl``; empty without one."""
    parts = column.partition(".")[0].split("/")
    return f"/{parts[1]}" if len(parts) > 2 and not parts[0] else ""
