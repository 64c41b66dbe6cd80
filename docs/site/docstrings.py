"""A docstring as Markdown: prose, lists of parameters and errors, code."""

from __future__ import annotations

import re

_TITLES = ("Parameters", "Returns", "Raises", "Yields", "Attributes", "Notes", "Examples")
_ROLE = re.compile(r":\w+:`~?([^`]+)`")
_ITEM = re.compile(r"^(\*{0,2}[\w`]+(?:, \*{0,2}[\w`]+)*) ?: (.*)$")


def markdown(text: str) -> str:
    """NumPy's sections become bold titles with lists, ``double`` backticks single ones, roles plain names."""
    text = _ROLE.sub(lambda found: f"`{found[1].rpartition('.')[2]}`", text)
    text = re.sub(r"``([^`]+)``", r"`\1`", text)
    lines, out, in_list = text.splitlines(), [], False
    for number, line in enumerate(lines):
        below = lines[number + 1] if number + 1 < len(lines) else ""
        if line in _TITLES and re.fullmatch(r"-{3,}", below):
            out += ["", f"**{line}**", ""]
            in_list = line in ("Parameters", "Raises", "Attributes")
        elif re.fullmatch(r"-{3,}", line):
            continue
        elif in_list and (item := _ITEM.match(line)):
            out.append(f"- `{item[1].replace('`', '')}`: {_plain(item[2])}")
        elif in_list and line.startswith(" "):
            out.append(f"  {_plain(line.strip())}")
        else:
            in_list = in_list and not line.strip()
            out.append(line if line.startswith("    ") else _plain(line))
    return "\n".join(out).strip()


def _plain(text: str) -> str:
    """Outside code, what Markdown would take for markup stays text."""
    parts = text.split("`")
    parts[::2] = [
        re.sub(r"([*<>])", r"\\\1", re.sub(r"(\w)_(?=\W|$)", r"\1\\_", part)) for part in parts[::2]
    ]
    return "`".join(parts)
