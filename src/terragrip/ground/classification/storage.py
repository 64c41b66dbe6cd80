"""A trained classifier as a file: NumPy arrays and JSON in one archive (.npz), never pickled."""

from __future__ import annotations

import io
import json
import os
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

import terragrip
from terragrip.errors import InputError
from terragrip.files import refuse_missing, replacing, unreadable
from terragrip.ground.classification.discriminants import Discriminants
from terragrip.ground.classification.expert import Expert, Parts
from terragrip.ground.classification.features import Layout
from terragrip.ground.classification.forest import Forest
from terragrip.ground.classification.kernel_machine import KernelMachine
from terragrip.ground.classification.learnt import Learnt
from terragrip.ground.classification.motion_law import MotionLaw
from terragrip.ground.classification.novelty import Strangeness
from terragrip.ground.classification.roles import roles_of
from terragrip.ground.classification.standardization import Standardization

Made = TypeVar("Made")

FORMAT = "terragrip ground classifier"
VERSION = 4
READ = (3, VERSION)  # 3: without the wheels' names and the strangeness of what lies outside


_PARTS: dict[str, Any] = {
    "standardization": Standardization,
    "machine": KernelMachine,
    "discriminants": Discriminants,
    "strangeness": Strangeness,
    "forest": Forest,
    "law": MotionLaw,
}
_PREFIXED = ("forest", "law")  # their arrays' names in the file begin with the part's
_OFFSETS = "class_offsets"


def save(parameters: Mapping[str, Any], learnt: Learnt, path: str | os.PathLike[str]) -> None:
    """Write what was learnt with a classifier's parameters; the file appears whole or not at all.

    Raises InputError if it cannot be written.
    """
    layout = learnt.layout
    header = {
        "format": FORMAT,
        "version": VERSION,
        "terragrip": terragrip.__version__,
        "parameters": {k: _plain(v) for k, v in parameters.items()},
        "classes": learnt.classes.tolist(),
        "features": list(learnt.features),
        "layout": {"window": float(layout.window), "period": layout.period, "size": layout.size},
        "held": dict(learnt.held),
        "left_out": list(learnt.left_out),
        "wheels": list(learnt.wheels),
        "notes": list(learnt.notes),
        "experts": [
            {
                "families": sorted(e.families),
                "features": list(e.features),
                "slopes": e.slopes.tolist(),
                "width": e.parts.machine.width,
            }
            for e in learnt.experts
        ],
    }
    arrays: dict[str, Any] = {"header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)}
    for number, expert in enumerate(learnt.experts):
        arrays |= {f"{name}_{number}": array for name, array in _arrays(expert).items()}
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def load(path: str | os.PathLike[str], make: Callable[[Mapping[str, Any], Learnt], Made]) -> Made:
    """What ``make`` makes of the parameters and of what was learnt in a file that `save` wrote.

    Raises InputError on a missing, foreign, damaged or newer file; one whose parameters ``make`` refuses is damaged.
    """
    refuse_missing(path, suffixes=(".npz",))
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        with np.load(io.BytesIO(content), allow_pickle=False) as archive:
            header = json.loads(bytes(archive["header"]))
            if not isinstance(header, dict) or header.get("format") != FORMAT:
                raise _foreign(path)
            version = header.get("version")
            if version not in READ:
                hint = "update terragrip, or train it again"
                raise InputError(
                    f"is of version {version!r}, this Terragrip reads {VERSION}", file=path, hint=hint
                )
            learnt = _learnt(header, archive)
            try:
                return make(header["parameters"], learnt)
            except InputError as error:
                raise ValueError(error) from error
    except InputError:
        raise
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, RuntimeError,
            AttributeError, LookupError, TypeError, ValueError, SyntaxError, OverflowError) as error:  # fmt: skip
        if content[:2] == b"PK" and b"header.npy" in content:
            hint = "copy it again, or train it again"
            raise InputError(f"is damaged ({error})", file=path, hint=hint) from error
        raise _foreign(path) from error


def _arrays(expert: Expert) -> dict[str, Any]:
    """The arrays of an expert by their names in the file."""
    held = {**vars(expert.parts), "strangeness": expert.strangeness}
    there = {name: part for name, part in held.items() if part is not None}
    result = {key: getattr(part, field) for name, part in there.items() for field, key in _keys(name).items()}
    return {_OFFSETS: expert.offsets, **result}


def _keys(part: str) -> dict[str, str]:
    """The names in the file of a part's arrays, by those of its fields."""
    begin = f"{part}_" if part in _PREFIXED else ""
    return {
        one.name: f"{begin}{one.name}" for one in fields(_PARTS[part]) if one.type not in ("float", "int")
    }


def _learnt(header: dict[str, Any], archive: Any) -> Learnt:
    """The model that a header and its arrays describe; raises KeyError, TypeError or ValueError on what does not fit."""
    layout = header["layout"]
    numbers = [
        layout["window"],
        *layout["period"].values(),
        *layout["size"].values(),
        *header["held"].values(),
    ]
    if not all(isinstance(x, int | float) and 0 < x < float("inf") for x in numbers):
        raise ValueError("a period or a size is no positive number")
    classes = np.array(header["classes"])
    if classes.ndim != 1 or len(np.unique(classes)) != len(classes) or len(classes) < 2:
        raise ValueError("the classes are not two or more different labels")
    names = [str(name) for name in header["features"]]
    known = set(names)
    experts: list[Expert] = []
    for number, of_expert in enumerate(header["experts"]):
        features = tuple(of_expert["features"])
        if not features or not known.issuperset(features):
            raise ValueError("an expert's features are not among the classifier's")
        experts.append(_expert(of_expert, features, len(classes), archive, number))
    if not experts:
        raise ValueError("there is no expert")
    return Learnt(
        classes,
        tuple(names),
        tuple(experts),
        Layout(float(layout["window"]), dict(layout["period"]), dict(layout["size"])),
        dict(header["held"]),
        tuple(str(note) for note in header["notes"]),
        tuple(str(begin) for begin in header.get("left_out", ())),  # files of before it mattered have none
        tuple(str(wheel) for wheel in header.get("wheels", ())),
    )


def _expert(
    header: dict[str, Any], features: tuple[str, ...], classes: int, archive: Any, number: int
) -> Expert:
    """An expert of the file; a window without any value shows whether its arrays fit each other."""
    roles = roles_of(features)

    def array(key: str) -> Any:
        result = archive[f"{key}_{number}"]
        if not result.size or np.isnan(result).any():
            raise ValueError(f"{key} is empty, or holds NaN")
        return result

    def part(name: str, **numbers: Any) -> Any:
        return _PARTS[name](**{field: array(key) for field, key in _keys(name).items()}, **numbers)

    slopes = np.array(header["slopes"], dtype=float)
    if slopes.shape != (1 + roles.forest + roles.law,) or not (slopes > 0).all():
        raise ValueError("the slopes are not one for each part")
    parts = Parts(
        part("standardization"),
        part("machine", width=float(header["width"]), classes=classes),
        part("discriminants"),
        part("forest") if roles.forest else None,
        part("law") if roles.law else None,
    )
    if parts.forest is not None:
        parts.forest.check()
    strangeness, families = part("strangeness"), frozenset(header["families"])
    expert = Expert(families, features, parts, slopes, array(_OFFSETS), strangeness)
    chances, strange = expert.judge(np.full((1, len(features)), np.nan))
    if (
        chances.shape != (1, classes)
        or not np.isfinite([*chances[0], *strangeness.novelty(strange, 1.0)]).all()
    ):
        raise ValueError("an expert's arrays do not fit each other")
    return expert


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _foreign(path: str | os.PathLike[str]) -> InputError:
    return InputError(
        "is not a ground classifier", file=path, hint="name a file that GroundClassifier.save wrote"
    )
