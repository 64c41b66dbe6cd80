"""Scenarios, soils, tools, sensor sets and vehicles that come with the package, and how a scenario file uses them.

A scenario may ``extends:`` another (mappings merge, the rest replaces). ``use: NAME`` in the vehicle, a tool, a soil or
the sensors takes a library entry; keys beside it override. A tool may be its bare name. A set (``runs:``) holds many
scenarios on one ``base:``.
"""

from __future__ import annotations

import os
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from terragrip.document import Document, read_yaml
from terragrip.errors import InputError, suggestion

Tree = dict[str, Any]
_VEHICLE = "innok-heros-444"
_DEPTH = 8  # of `extends`: deeper is a loop


def scenario_names() -> tuple[str, ...]:
    """Names of the package's scenarios, single ones first, then the runs of each set."""
    single = [name for name, document in _packaged().items() if "runs" not in document.data]
    return (*single, *(run for name in set_names() for run in set_runs(name) if run not in single))


def set_names() -> tuple[str, ...]:
    """Names of the package's scenario sets."""
    return tuple(name for name, document in _packaged().items() if "runs" in document.data)


def set_runs(name: str = "campaign") -> tuple[str, ...]:
    """Names of the runs of a set, in order; raises InputError if there is no such set."""
    if name not in set_names():
        raise InputError(f"no scenario set {name!r}", hint=f"sets are {', '.join(set_names())}")
    return tuple(_run_name(run) for run in _packaged()[name].data["runs"])


def scenario_document(path_or_name: str | os.PathLike[str]) -> Document:
    """The whole scenario, `extends` and `use` carried out, with the lines of its file; raises InputError."""
    name = os.fspath(path_or_name)
    result = _by_name(name)
    if result is None:
        if not name.endswith((".yaml", ".yml")) and not Path(name).exists():
            otherwise = "give a file, or a name that `terragrip simulate --list` shows"
            hint = suggestion(name, scenario_names(), otherwise)
            raise InputError(f"no scenario {name!r}", hint=hint)
        result = read_yaml(path_or_name)
    tree = resolve({"name": Path(name).stem, **result.data}, result.file)
    return Document(tree, result.file, result.lines)


def resolve(tree: Tree, file: str | None = None) -> Tree:
    """Carry out `extends` and every `use`; raises InputError if one names what is not there."""
    tree = _extended(tree, file, 0)
    tree["vehicle"] = _entry("vehicles", tree.get("vehicle", _VEHICLE), file, "vehicle")
    if isinstance(tree.get("sensors"), str | dict):
        tree["sensors"] = _entry("sensors", tree["sensors"], file, "sensors")
    if isinstance(tree.get("tools"), list):
        tree["tools"] = [_entry("tools", tool, file, f"tools.{k}") for k, tool in enumerate(tree["tools"])]
    soils = tree.get("soils", {})
    if isinstance(soils, dict):
        own = {name: _entry("soils", soil, file, f"soils.{name}") for name, soil in soils.items()}
        tree["soils"] = {**_library("soils"), **own}
    return tree


def _extended(tree: Tree, file: str | None, depth: int) -> Tree:
    parent = tree.get("extends")
    own = {key: value for key, value in tree.items() if key != "extends"}
    if parent is None:
        return own
    result = _by_name(str(parent))
    if result is None or depth > _DEPTH:
        problem = f"no scenario {parent!r}" if result is None else "extends itself"
        hint = suggestion(str(parent), scenario_names())
        raise InputError(problem, file=file, place="extends", hint=hint)
    inherited = {key: value for key, value in result.data.items() if key not in ("name", "description")}
    return _merged(_extended(inherited, result.file, depth + 1), own)


def _merged(below: Tree, above: Tree) -> Tree:
    """``above`` over ``below``: mappings merge key by key (a `use` starts anew), all else replaces."""
    out = dict(below)
    for key, value in above.items():
        old = out.get(key)
        merge = isinstance(old, dict) and isinstance(value, dict) and "use" not in value
        out[key] = _merged(old, value) if merge else value  # type: ignore[arg-type]
    return out


def _entry(section: str, value: Any, file: str | None, place: str) -> Any:
    if isinstance(value, str):
        value = {"use": value}
    if not isinstance(value, dict) or "use" not in value:
        return value
    name, entries = str(value["use"]), _library(section)
    if name not in entries:
        hint = suggestion(name, entries, f"known are {', '.join(entries)}")
        raise InputError(
            f"nothing called {name!r} in the library's {section}", file=file, place=place, hint=hint
        )
    return _merged(entries[name], {key: item for key, item in value.items() if key != "use"})


def _by_name(name: str) -> Document | None:
    packaged = _packaged()
    if name in packaged and "runs" not in packaged[name].data:
        return packaged[name]
    for document in packaged.values():
        for run in document.data.get("runs", ()):
            if isinstance(run, dict) and run["name"] == name:
                return Document(_merged(document.data.get("base", {}), run), document.file)
    return None


def _run_name(run: Any) -> str:
    return run if isinstance(run, str) else str(run["name"])


def _library(section: str) -> Tree:
    return dict(_read("library", f"{section}.yaml").data)


@cache
def _packaged() -> dict[str, Document]:
    folder = resources.files("terragrip.simulation") / "scenarios"
    names = sorted(item.name for item in folder.iterdir() if item.name.endswith(".yaml"))
    return {name.removesuffix(".yaml"): _read("scenarios", name) for name in names}


@cache
def _read(folder: str, name: str) -> Document:
    with resources.as_file(resources.files("terragrip.simulation") / folder / name) as path:
        return read_yaml(path)
