"""Signals derived by a formula in column names: written in Python's grammar, of which only arithmetic is allowed, worked out by numpy.

Nothing is executed: the text is parsed to a tree, every node of it is looked at, and the tree is walked. The unknown stays unknown: a NaN
in a row makes the result NaN there, and so does a division by zero.
"""

from __future__ import annotations

import ast
import operator
import re
import sys
import warnings
from collections.abc import Callable
from functools import lru_cache, reduce
from typing import Any

import numpy as np

from terragrip.arrays import Floats
from terragrip.errors import InputError

Lookup = Callable[[str], Floats]

LONGEST = 500
"""Characters of a formula."""
MOST = 200
"""Nodes of its tree."""

BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: np.add,
    ast.Sub: np.subtract,
    ast.Mult: np.multiply,
    ast.Div: np.divide,
    ast.Pow: np.power,
}
UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}
COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], Any]] = {
    ast.Lt: np.less,
    ast.LtE: np.less_equal,
    ast.Gt: np.greater,
    ast.GtE: np.greater_equal,
    ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}
ARGUMENTS = {
    "abs": (1, 1),
    "sqrt": (1, 1),
    "min": (1, 20),
    "max": (1, 20),
    "mean": (1, 2),
    "where": (3, 3),
    "diff": (1, 1),
}
"""The functions, and how few and how many arguments each takes."""
ALLOWED = f"use + - * / **, comparisons, numbers, columns, {', '.join(ARGUMENTS)}"


@lru_cache(maxsize=64)
def parsed(text: str) -> ast.expr:
    """The tree of a formula. Raises InputError where it cannot be read or holds more than arithmetic."""
    if not text.strip():
        raise InputError("is empty", place="formula", hint="for example slip_rl - slip_rr")
    if len(text) > LONGEST:
        raise InputError(f"is longer than {LONGEST} characters", place="formula")
    if re.search(r"\d,\d", text):
        raise InputError(
            "a comma between two digits",
            place="formula",
            hint="write a number as 9.81, and a blank after the comma that separates two",
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", SyntaxWarning)  # such as of `1(2)`, which is refused below
            tree = ast.parse(text.strip(), mode="eval").body
    except SyntaxError as error:
        place = f"at character {error.offset}" if error.offset else "to its end"
        raise InputError(f"cannot be read {place}", place="formula", hint=ALLOWED) from None
    except (ValueError, MemoryError, RecursionError):
        raise InputError("cannot be read", place="formula", hint=ALLOWED) from None
    nodes = list(ast.walk(tree))
    if len(nodes) > MOST:
        raise InputError("has too many parts", place="formula", hint="split it into two formulas")
    for node in nodes:
        _allow(node)
    return tree


def _allow(node: ast.AST) -> None:
    """Raise InputError unless a node is arithmetic."""
    if isinstance(node, ast.Constant):
        if type(node.value) not in (int, float):
            raise InputError(f"{str(node.value)[:20]!r} is not a number", place="formula", hint=ALLOWED)
        if isinstance(node.value, int) and node.value > sys.float_info.max:
            raise InputError("a number is too large", place="formula")
    elif isinstance(node, ast.Call):
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if node.keywords:
            raise InputError("an equals sign inside parentheses is not arithmetic", place="formula")
        if name not in ARGUMENTS:
            raise InputError(f"there is no function {name or 'of that kind'}", place="formula", hint=ALLOWED)
        fewest, most = ARGUMENTS[name]
        if not fewest <= len(node.args) <= most:
            count = str(fewest) if fewest == most else f"{fewest} to {most}"
            raise InputError(f"{name} takes {count} in its parentheses", place="formula")
        if name == "mean" and len(node.args) == 2 and not isinstance(node.args[1], ast.Constant):
            raise InputError(
                "mean over time takes a number of seconds", place="formula", hint="mean(slip_rl, 0.5)"
            )
    elif not isinstance(
        node, (ast.BinOp, ast.UnaryOp, ast.Compare, ast.Name, ast.Load, *BINARY, *UNARY, *COMPARISONS)
    ):
        kind = type(node).__name__
        words = {
            "Tuple": "a comma separates the arguments of a function",
            "Attribute": "a dot is not part of a name",
        }
        dotted = words.get(kind, f"{kind} is not arithmetic")
        raise InputError(dotted, place="formula", hint=ALLOWED)


def names(text: str) -> set[str]:
    """The columns that a formula asks for. Raises as `parsed`."""
    tree = parsed(text)
    called = {id(node.func) for node in ast.walk(tree) if isinstance(node, ast.Call)}
    return {n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called}


def evaluate(text: str, time: Floats, lookup: Lookup) -> Floats:
    """The formula row by row, shape of `time` (n,) [s]; NaN where it is not known.

    ``lookup`` gives a column, (n,) in SI. Raises as `parsed` and as ``lookup``.
    """
    tree = parsed(text)
    with np.errstate(all="ignore"):
        result = np.array(np.broadcast_to(_value(tree, time, lookup), time.shape), np.float64)
    result[~np.isfinite(result)] = np.nan
    return result


def _value(node: ast.AST, time: Floats, lookup: Lookup) -> Any:
    if isinstance(node, ast.Constant):
        assert isinstance(node.value, (int, float))
        return np.float64(node.value)
    if isinstance(node, ast.Name):
        return np.asarray(lookup(node.id), np.float64)
    if isinstance(node, ast.UnaryOp):
        return UNARY[type(node.op)](_value(node.operand, time, lookup))
    if isinstance(node, ast.BinOp):
        left, right = (_value(side, time, lookup) for side in (node.left, node.right))
        return BINARY[type(node.op)](left, right)
    if isinstance(node, ast.Compare):
        sides = [_value(side, time, lookup) for side in (node.left, *node.comparators)]
        pairs = zip(node.ops, sides[:-1], sides[1:], strict=True)
        return reduce(np.multiply, (_compared(COMPARISONS[type(op)], a, b) for op, a, b in pairs))
    assert isinstance(node, ast.Call)
    assert isinstance(node.func, ast.Name)
    return _called(node.func.id, [_value(argument, time, lookup) for argument in node.args], time)


def _compared(compare: Callable[[Any, Any], Any], a: Any, b: Any) -> Any:
    """1 where it holds, 0 where it does not, NaN where a side is unknown."""
    return np.where(np.isnan(a) | np.isnan(b), np.nan, compare(a, b).astype(np.float64))


def _called(name: str, values: list[Any], time: Floats) -> Any:
    first = values[0]
    if name == "abs":
        return np.abs(first)
    if name == "sqrt":
        return np.sqrt(first)
    if name == "where":
        return np.where(np.isnan(first), np.nan, np.where(first != 0, values[1], values[2]))
    if name == "diff":
        rows = np.broadcast_to(first, time.shape)
        return np.concatenate(([np.nan], np.diff(rows)))[: len(time)]
    if name == "mean" and len(values) == 2:
        return _moving_mean(np.broadcast_to(first, time.shape), time, float(values[1]))
    if len(values) > 1:
        return reduce(np.minimum if name == "min" else np.maximum, values)
    known = np.atleast_1d(first)
    known = known[np.isfinite(known)]
    if not known.size:
        return np.nan
    return np.mean(known) if name == "mean" else np.min(known) if name == "min" else np.max(known)


def _moving_mean(values: Floats, time: Floats, seconds: float) -> Floats:
    """Mean of the known rows within `seconds` about each row; NaN where there is none."""
    known = np.isfinite(values)
    total, count = (
        np.concatenate(([0.0], np.cumsum(part)))
        for part in (np.where(known, values, 0.0), known.astype(float))
    )
    first = np.searchsorted(time, time - seconds / 2, "left")
    last = np.searchsorted(time, time + seconds / 2, "right")
    result: Floats = (total[last] - total[first]) / (count[last] - count[first])
    return result
