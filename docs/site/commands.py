"""The page of the commands, from the command line itself: every option, as `--help` says it."""

from __future__ import annotations

import inspect
from typing import Any

from terragrip.cli.entry import program


def page() -> str:
    """Markdown: a section a command, in the order of `terragrip --help`."""
    root = program()
    parts = [
        "# Commands",
        "`terragrip COMMAND --help` says the same in the terminal. Exit code 0: done; 2: the input or the call is unusable, one line says"
        " what, where and how to fix it; 1: a defect of Terragrip. Files appear whole or not at all.",
        _options(root),
    ]
    parts += [_section(f"terragrip {name}", command, 2) for name, command in root.commands.items()]
    return "\n\n".join(parts) + "\n"


def _section(path: str, command: Any, level: int) -> str:
    arguments = [_metavar(one) for one in command.params if one.param_type_name == "argument"]
    parts = [
        f"{'#' * level} {path}",
        inspect.cleandoc(command.help or "").replace("\b\n", ""),
        f"```text\n{' '.join([path, '[OPTIONS]', *arguments])}\n```",
        _options(command),
    ]
    parts += [
        _section(f"{path} {name}", one, level + 1) for name, one in getattr(command, "commands", {}).items()
    ]
    return "\n\n".join(part for part in parts if part)


def _options(command: Any) -> str:
    context = _context(command)
    lines = ["| option | what |", "|---|---|"]
    for parameter in command.params:
        if parameter.param_type_name == "argument":
            record = _metavar(parameter), parameter.help or ""
        else:
            record = parameter.get_help_record(context)
        if record is not None:
            names, text = (" ".join(str(part).split()).replace("|", "\\|") for part in record)
            lines.append(f"| `{names}` | {text} |")
    return "\n".join(lines) if len(lines) > 2 else ""


def _metavar(argument: Any) -> str:
    name = argument.metavar or argument.name.upper()
    several = f"{name}..." if argument.nargs == -1 else name
    return several if argument.required else f"[{several}]"


def _context(command: Any) -> Any:
    return command.context_class(command)
