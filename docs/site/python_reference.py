"""The page of the Python interface: every public name of `terragrip`, from its docstring."""

from __future__ import annotations

import inspect
from typing import Any

import docstrings

import terragrip


def page() -> str:
    """Markdown: a section a name of ``terragrip.__all__``, its public methods below it."""
    parts = [
        "# Python",
        "`import terragrip as tg`. Tables are pandas at the edge and NumPy inside; numbers are SI. What the user can set right raises"
        " `tg.InputError`, whose text is one line with file, place and fix.",
    ]
    for name in terragrip.__all__:
        value = getattr(terragrip, name)
        if inspect.isclass(value):
            parts += _class(name, value)
        elif callable(value):
            parts += [
                f"## tg.{name}",
                _signature(f"tg.{name}", value),
                docstrings.markdown(inspect.getdoc(value) or ""),
            ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _class(name: str, value: type) -> list[str]:
    parts = [
        f"## tg.{name}",
        _signature(f"tg.{name}", value),
        docstrings.markdown(inspect.getdoc(value) or ""),
    ]
    for member, kind in _members(value):
        own = getattr(value, member)
        if kind == "property":
            text = docstrings.markdown(inspect.getdoc(inspect.getattr_static(value, member)) or "")
            parts += [f"### tg.{name}.{member}", text]
        else:
            parts += [
                f"### tg.{name}.{member}",
                _signature(member, own),
                docstrings.markdown(inspect.getdoc(own) or ""),
            ]
    return parts


def _members(value: type) -> list[tuple[str, str]]:
    """Public members with a docstring that the class itself, or a class of Terragrip below it, defines."""
    found: dict[str, str] = {}
    for base in reversed(value.__mro__):
        if not base.__module__.startswith("terragrip"):
            continue
        for name, member in vars(base).items():
            kind = "property" if isinstance(member, property) else "method"
            if name.startswith("_") or not (kind == "property" or callable(getattr(base, name, None))):
                continue
            if not isinstance(member, type) and inspect.getdoc(
                getattr(base, name) if kind == "method" else member
            ):
                found[name] = kind
    return list(found.items())


def _signature(name: str, value: Any) -> str:
    try:
        signature = inspect.signature(value)
    except (ValueError, TypeError):
        return ""
    bare = [
        p.replace(annotation=p.empty) for p in signature.parameters.values() if p.name not in ("self", "cls")
    ]
    text = str(signature.replace(parameters=bare, return_annotation=signature.empty))
    return f"```text\n{name}{text}\n```"
