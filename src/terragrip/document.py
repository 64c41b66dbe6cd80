"""A file of the user's (YAML) or of ours (JSON), read so that every complaint names the key, the line and the fix."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import yaml
from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from terragrip.errors import InputError, suggestion
from terragrip.files import path_of, refuse_missing, unreadable
from terragrip.units import UnitError

Place = tuple[str | int, ...]

_PLAIN = {
    "string_type": ("is not text", "put it in quotes"),
    "bool_type": ("is not true or false", "write true or false"),
    "bool_parsing": ("is not true or false", "write true or false"),
    "dict_type": ("is not a mapping", "write it as 'key: value' lines, or '{key: value}'"),
    "model_type": ("is not a mapping", "write it as 'key: value' lines, or '{key: value}'"),
    "model_attributes_type": ("is not a mapping", "write it as 'key: value' lines, or '{key: value}'"),
}


class Fault(ValueError):
    """A fault that a validator finds: problem, hint, and the place within the part that was validated."""

    def __init__(self, problem: str, hint: str, place: Place = ()) -> None:
        self.problem, self.hint, self.place = problem, hint, place
        super().__init__(problem)


class Part(BaseModel):
    """A frozen part of a document: unknown keys are refused, and the nearest known key is named."""

    PAGE: ClassVar[str | None] = None
    """The page of the documentation that lists the document's keys; errors name it."""
    model_config = ConfigDict(frozen=True, extra="forbid", arbitrary_types_allowed=True)

    if not TYPE_CHECKING:

        def __init__(self, /, *parts: Any, **data: Any) -> None:
            """From keywords with the content of the file; raises InputError as `validate` does."""
            name = type(self).__name__
            if parts:
                hint = f"{name}.load(path) reads a file, {name}.from_dict(data) a dict"
                raise InputError(f"{name} takes keywords alone", hint=hint)
            try:
                super().__init__(**data)
            except ValidationError as error:
                raise _input_error(error, Document(data, ""), self.PAGE) from error

        __init__.__pydantic_base_init__ = True  # pydantic's name for one that `model_validate` need not call

    def __eq__(self, other: object) -> bool:
        """By fields: what properties keep, arrays among it, is no part of the document, and no array has one truth."""
        return type(self) is type(other) and all(
            getattr(self, k) == getattr(other, k) for k in type(self).model_fields
        )

    def __setattr__(self, name: str, value: Any) -> None:
        hint = "change the file, or what to_dict() gives, and make another with from_dict(data)"
        raise InputError("cannot be changed", place=name, hint=hint)

    @model_validator(mode="before")
    @classmethod
    def _refuse_unknown_keys(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        known = [info.alias or name for name, info in cls.model_fields.items()]
        for key in data:
            if key not in known:
                hint = suggestion(str(key), known, f"known keys are {', '.join(known)}")
                if data[key] is None:  # YAML's comma has ended the value before it
                    number = str(key)[:1].isdigit()
                    lists = f"part of a list? write it in brackets ('[..., {key}]'); {hint}"
                    hint = (
                        f"part of a number with a decimal comma? write a decimal point ('0.{key}')"
                        if number
                        else lists
                    )
                raise PydanticCustomError("unknown_key", "unknown key", {"key": str(key), "hint": hint})
        return data


ModelT = TypeVar("ModelT", bound=BaseModel)


@dataclass(frozen=True)
class Document:
    """The content of a YAML file, and the line of every key by its place."""

    data: Any
    file: str
    lines: dict[Place, int] = field(default_factory=dict)


def read_yaml(path: str | os.PathLike[str]) -> Document:
    """Read a YAML mapping; raises InputError if it is missing, not YAML, not a mapping, or repeats a key."""
    file = path_of(path, "give the path of a file; its content as a dict is for from_dict(...)")
    text = _read_text(file)
    loader = getattr(yaml, "CSafeLoader", yaml.SafeLoader)(text)
    try:
        node = loader.get_single_node()
        lines: dict[Place, int] = {}
        _collect_lines(node, (), lines, file)
        data = None if node is None else loader.construct_document(node)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None) or getattr(error, "context_mark", None)
        problem = getattr(error, "problem", None) or "cannot be read"
        place = None if mark is None else f"line {mark.line + 1}"
        line = "" if mark is None else "".join(text.splitlines()[mark.line : mark.line + 1])
        tabbed = line.lstrip(" ").startswith("\t")
        hint = "indent by blanks, not by tabs" if tabbed else "write it as 'key: value' lines"
        raise InputError(f"not YAML: {problem}", file=file, place=place, hint=hint) from error
    except InputError:
        raise
    except (RecursionError, ValueError, OverflowError) as error:  # too deep, or an impossible date
        raise InputError(
            f"not YAML that can be read: {error}", file=file, hint="simplify the file"
        ) from error
    finally:
        loader.dispose()
    if not isinstance(data, dict):
        problem = "the file is empty" if data is None else "the file is not a mapping"
        raise InputError(problem, file=file, hint="write it as 'key: value' lines")
    return Document(data, file, lines)


def validate(model: type[ModelT], document: Document | Any, *, file: str | None = None) -> ModelT:
    """Build ``model`` from a document or plain data; raises InputError for the first fault found."""
    if not isinstance(document, Document):
        document = Document(document, file or "")
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        raise _input_error(error, document, getattr(model, "PAGE", None)) from error


def read_json(
    path: str | os.PathLike[str],
    key: str,
    version: int,
    writer: str,
    *,
    pairs: Callable[[list[tuple[str, Any]]], Any] | None = None,
) -> dict[str, Any]:
    """Read a JSON object that holds ``key`` and was written by ``writer``, of a ``version`` up to the given one.

    ``pairs``: what makes an object of its pairs. Raises InputError: no such file, not JSON, without the key, of a newer version.
    """
    file = os.fspath(path)
    refuse_missing(file, suffixes=(".json",))
    hint = f"give a file written by {writer}"
    try:
        with open(file, encoding="utf-8-sig") as stream:
            data = json.load(stream, object_pairs_hook=pairs)
    except (ValueError, RecursionError) as error:  # not text, not JSON, or a number of thousands of digits
        raise InputError(f"not JSON ({error})", file=file, hint=hint) from None
    except OSError as error:
        raise unreadable(file, error) from None
    if not isinstance(data, dict) or key not in data:
        raise InputError(f"holds no {key!r}", file=file, hint=hint)
    result = data.get("version", version)
    if not isinstance(result, int) or result > version:
        problem = f"is of version {result}, this Terragrip reads up to {version}"
        raise InputError(problem, file=file, hint="update terragrip")
    return data


def _read_text(file: str) -> str:
    refuse_missing(file, suffixes=(".yaml", ".yml"))
    try:
        return Path(file).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError("is not text", file=file, hint="give a YAML file in UTF-8") from error
    except OSError as error:
        raise unreadable(file, error) from error


def _collect_lines(node: Any, place: Place, lines: dict[Place, int], file: str) -> None:
    """Note the line of every key under ``node``; raises InputError on a key that occurs twice."""
    if isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            here = (*place, str(key.value))
            line = key.start_mark.line + 1
            if here in lines and lines[here] != line:
                raise InputError(
                    "the key occurs twice", file=file, place=f"{_dotted(here)} (line {line})",
                    hint=f"keep one; the other is on line {lines[here]}",
                )  # fmt: skip
            lines[here] = line
            _collect_lines(value, here, lines, file)
    elif isinstance(node, yaml.SequenceNode):
        for index, value in enumerate(node.value):
            lines[(*place, index)] = value.start_mark.line + 1
            _collect_lines(value, (*place, index), lines, file)


def _input_error(error: ValidationError, document: Document, page: str | None) -> InputError:
    """The fault a user should fix first, as one InputError."""
    faults = error.errors(include_url=False)
    order = {"unknown_key": 0, "missing": 2}
    fault = min(faults, key=lambda f: order.get(f["type"], 1))
    place = _place_in(document.data, fault["loc"], missing=fault["type"] == "missing")
    context = fault.get("ctx", {})
    cause = context.get("error")
    problem, hint = fault["msg"].removeprefix("Value error, "), context.get("hint")
    if isinstance(cause, UnitError):
        problem, hint = cause.problem, cause.hint
    elif isinstance(cause, Fault):
        problem, hint, place = cause.problem, cause.hint, (*place, *cause.place)
    elif fault["type"] == "unknown_key":
        place = (*place, context["key"])
    elif fault["type"] == "missing":
        problem, hint = "is missing", "add it"
    elif fault["type"] in ("union_tag_not_found", "union_tag_invalid"):
        problem = "has no known name"
        hint = (
            f"known names are {context['expected_tags']}" if "expected_tags" in context else "add its 'name:'"
        )
    elif fault["type"] in _PLAIN:
        problem, hint = _PLAIN[fault["type"]]
    place_text = _located(place, document)
    return InputError(problem, file=document.file or None, place=place_text, hint=hint, page=page)


def _place_in(data: Any, location: Place, *, missing: bool) -> Place:
    """``location`` without the tags that pydantic adds for unions: the keys the user wrote, or misses."""
    place: list[str | int] = []
    for index, key in enumerate(location):
        inside = (isinstance(data, dict) and key in data) or (
            isinstance(data, list | tuple) and isinstance(key, int) and key < len(data)
        )
        if inside:
            data = data[key]
            place.append(key)
        elif missing and index == len(location) - 1:
            place.append(key)
    return tuple(place)


def _located(place: Place, document: Document) -> str | None:
    if not place:
        return None
    for end in range(len(place), 0, -1):
        line = document.lines.get(place[:end])
        if line is not None:
            return f"{_dotted(place)} (line {line})"
    return _dotted(place)


def _dotted(place: Place) -> str:
    return ".".join(str(key) for key in place)
