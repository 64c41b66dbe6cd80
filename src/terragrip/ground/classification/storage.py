"""A trained classifier as a file: NumPy arrays and JSON in one archive (.npz), never pickled."""

from __future__ import annotations

import io
import json
import os
import zipfile
import zlib
from collections.abc import Callable, Mapping
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
from terragrip.ground.classification.novelty import LEVELS, SPANS, Strangeness
from terragrip.ground.classification.roles import roles_of
from terragrip.ground.classification.standardization import Standardization

Made = TypeVar("Made")

FORMAT = "terragrip ground classifier"
VERSION = 3


# Arrays of an expert's parts, with their shapes in terms of the machine's features, support vectors, pairs, classes,
# discriminants, known windows, kinds of oddness, spans, levels; all features, trees, nodes; the law's features, effects, terms.
_PARTS = {
    "standardization": {"centre": "f", "scale": "f", "weight": "f"},
    "machine": {"support": "vf", "weights": "vp", "offsets": "p"},
    "discriminants": {"axes": "fd", "points": "wd"},
    "strangeness": {"usual": "32", "levels": "Sl"},
    "forest": {
        "centre": "F",
        "roots": "t",
        "feature": "n",
        "threshold": "n",
        "left": "n",
        "right": "n",
        "share": "nk",
    },
    "law": {"centre": "b", "scale": "b", "whitening": "ee", "laws": "kre"},
}
_WHOLE = ("roots", "feature", "left", "right")
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
            if version != VERSION:
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
    except (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, RuntimeError) as error:
        if content[:2] == b"PK":
            raise _damaged(path, error) from error
        raise _foreign(path) from error
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, SyntaxError, OverflowError) as error:
        if content[:2] == b"PK" and b"header.npy" in content:
            raise _damaged(path, error) from error
        raise _foreign(path) from error


def _arrays(expert: Expert) -> dict[str, Any]:
    """The arrays of an expert by their names in the file."""
    parts = expert.parts
    held = {
        "standardization": parts.standardization,
        "machine": parts.machine,
        "discriminants": parts.discriminants,
        "strangeness": expert.strangeness,
        "forest": parts.forest,
        "law": parts.law,
    }
    there = {name: part for name, part in held.items() if part is not None}
    result = {
        _key(name, field): getattr(part, field) for name, part in there.items() for field in _PARTS[name]
    }
    return {_OFFSETS: expert.offsets, **result}


def _key(part: str, field: str) -> str:
    return f"{part}_{field}" if part in _PREFIXED else field


def _learnt(header: dict[str, Any], archive: Any) -> Learnt:
    """What a header and its arrays say was learnt; raises KeyError, TypeError or ValueError on what does not fit."""
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
    )


def _expert(
    header: dict[str, Any], features: tuple[str, ...], classes: int, archive: Any, number: int
) -> Expert:
    roles = roles_of(features)
    machine, motion, effects = len(roles.machine), len(roles.motion), len(roles.effects)
    sizes = {
        "f": machine,
        "p": classes * (classes - 1) // 2,
        "k": classes,
        "d": min(classes - 1, machine),
        "3": 3,
        "2": 2,
        "S": len(SPANS),
        "l": len(LEVELS),
        "F": len(features),
        "b": motion + effects,
        "e": effects,
        "r": 1 + 2 * motion,
    }

    def part(name: str) -> dict[str, Any]:
        arrays = {field: archive[f"{_key(name, field)}_{number}"] for field in _PARTS[name]}
        _check_shapes(arrays, _PARTS[name], sizes)
        return arrays

    slopes = np.array(header["slopes"], dtype=float)
    if slopes.shape != (1 + roles.forest + roles.law,) or not (slopes > 0).all():
        raise ValueError("the slopes are not one for each part")
    forest = Forest(**part("forest")) if roles.forest else None
    if forest is not None:
        forest.check()
    parts = Parts(
        Standardization(**part("standardization")),
        KernelMachine(**part("machine"), width=float(header["width"]), classes=classes),
        Discriminants(**part("discriminants")),
        forest,
        MotionLaw(**part("law")) if roles.law else None,
    )
    offsets = {_OFFSETS: archive[f"{_OFFSETS}_{number}"]}
    _check_shapes(offsets, {_OFFSETS: "k"}, sizes)
    strangeness = Strangeness(**part("strangeness"))
    return Expert(frozenset(header["families"]), features, parts, slopes, offsets[_OFFSETS], strangeness)


def _check_shapes(arrays: dict[str, Any], shapes: dict[str, str], sizes: dict[str, int]) -> None:
    """Raise ValueError on an array that is empty, holds NaN, or has another shape or type.

    A size that ``sizes`` does not give is free, but one in all of these arrays.
    """
    free: dict[str, int] = {}
    for name, letters in shapes.items():
        array = arrays[name]
        kind = "i" if name in _WHOLE else "f"
        if array.ndim != len(letters) or array.dtype.kind != kind:
            raise ValueError(f"{name} has shape {array.shape}")
        wanted = [
            sizes[x] if x in sizes else free.setdefault(x, n)
            for x, n in zip(letters, array.shape, strict=True)
        ]
        if list(array.shape) != wanted:
            raise ValueError(f"{name} has shape {array.shape}")
        if not array.size:
            raise ValueError(f"{name} is empty")
        if np.isnan(array).any():
            raise ValueError(f"{name} holds NaN")


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _foreign(path: str | os.PathLike[str]) -> InputError:
    return InputError(
        "is not a ground classifier", file=path, hint="name a file that GroundClassifier.save wrote"
    )


def _damaged(path: str | os.PathLike[str], error: Exception) -> InputError:
    return InputError(f"is damaged ({error})", file=path, hint="copy it again, or train it again")
