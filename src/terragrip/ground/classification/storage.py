"""A trained classifier as a file: NumPy arrays and JSON in one archive (.npz), never pickled."""

from __future__ import annotations

import io
import json
import os
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

import terragrip
from terragrip.errors import InputError
from terragrip.files import refuse_missing, replacing, unreadable
from terragrip.ground.classification.classifier import GroundClassifier
from terragrip.ground.classification.discriminants import Discriminants
from terragrip.ground.classification.expert import Expert, Parts
from terragrip.ground.classification.features import Layout
from terragrip.ground.classification.forest import Forest
from terragrip.ground.classification.kernel_machine import KernelMachine
from terragrip.ground.classification.motion_law import MotionLaw
from terragrip.ground.classification.novelty import LEVELS, SPANS, Strangeness
from terragrip.ground.classification.roles import Roles, roles_of
from terragrip.ground.classification.standardization import Standardization

FORMAT = "terragrip ground classifier"
VERSION = 3

# Arrays of an expert, with their shapes in terms of the machine's features, support vectors, pairs, classes, discriminants,
# known windows, kinds of oddness, spans, levels.
_ARRAYS = {
    "centre": "f",
    "scale": "f",
    "weight": "f",
    "support": "vf",
    "weights": "vp",
    "offsets": "p",
    "axes": "fd",
    "points": "wd",
    "class_offsets": "k",
    "usual": "32",
    "levels": "Sl",
}
# All features, trees, nodes; and the law's features, effects, terms.
_FOREST = {
    "centre": "F",
    "roots": "t",
    "feature": "n",
    "threshold": "n",
    "left": "n",
    "right": "n",
    "share": "nk",
}
_LAW = {"centre": "b", "scale": "b", "whitening": "ee", "laws": "kre"}


def save(classifier: GroundClassifier, path: str | os.PathLike[str]) -> None:
    """Write a fitted classifier; the file appears whole or not at all. Raises InputError if it cannot be written."""
    layout = classifier._layout
    header = {
        "format": FORMAT,
        "version": VERSION,
        "terragrip": terragrip.__version__,
        "parameters": {k: _plain(v) for k, v in classifier.get_params().items()},
        "classes": classifier.classes_.tolist(),
        "features": list(classifier.feature_names_in_),
        "layout": {"window": float(layout.window), "period": layout.period, "size": layout.size},
        "held": classifier._held,
        "notes": list(classifier.notes_),
        "experts": [
            {
                "families": sorted(e.families),
                "features": list(e.features),
                "slopes": e.slopes.tolist(),
                "width": e.parts.machine.width,
            }
            for e in classifier._experts
        ],
    }
    arrays: dict[str, Any] = {"header": np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)}
    for number, expert in enumerate(classifier._experts):
        parts = expert.parts
        scaling, machine, discriminants = parts.standardization, parts.machine, parts.discriminants
        held = (
            scaling.centre,
            scaling.scale,
            scaling.weight,
            machine.support,
            machine.weights,
            machine.offsets,
            discriminants.axes,
            discriminants.points,
            expert.offsets,
            expert.strangeness.usual,
            expert.strangeness.levels,
        )
        arrays |= {f"{name}_{number}": array for name, array in zip(_ARRAYS, held, strict=True)}
        for kind, names, part in (("forest", _FOREST, parts.forest), ("law", _LAW, parts.law)):
            if part is not None:
                arrays |= {f"{kind}_{name}_{number}": getattr(part, name) for name in names}
    with replacing(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def load(path: str | os.PathLike[str]) -> GroundClassifier:
    """Read a classifier that `save` wrote. Raises InputError on a missing, foreign, damaged or newer file."""
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
                mend = "update terragrip, or train it anew"
                raise InputError(
                    f"is of version {version!r}, this terragrip reads {VERSION}", file=path, mend=mend
                )
            return _rebuild(header, archive)
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


def _rebuild(header: dict[str, Any], archive: Any) -> GroundClassifier:
    """The classifier of a header and its arrays; raises KeyError, TypeError or ValueError on what does not fit."""
    classifier = GroundClassifier(**header["parameters"])
    try:
        classifier.check_parameters()
    except InputError as error:
        raise ValueError(error) from error
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
    experts = []
    for number, of_expert in enumerate(header["experts"]):
        features = tuple(of_expert["features"])
        if not features or not known.issuperset(features):
            raise ValueError("an expert's features are not among the classifier's")
        experts.append(_expert(of_expert, features, len(classes), archive, number))
    if not experts:
        raise ValueError("there is no expert")
    classifier._experts = experts
    classifier._layout = Layout(float(layout["window"]), dict(layout["period"]), dict(layout["size"]))
    classifier._held = dict(header["held"])
    classifier._fitted(classes, tuple(names), tuple(str(note) for note in header["notes"]))
    return classifier


def _expert(
    header: dict[str, Any], features: tuple[str, ...], classes: int, archive: Any, number: int
) -> Expert:
    a = {name: archive[f"{name}_{number}"] for name in _ARRAYS}
    roles = roles_of(features)
    count = len(roles.machine)
    sizes = {
        "f": count,
        "v": len(a["support"]),
        "p": classes * (classes - 1) // 2,
        "k": classes,
        "d": min(classes - 1, count),
        "w": len(a["points"]),
        "3": 3,
        "2": 2,
        "S": len(SPANS),
        "l": len(LEVELS),
    }
    _check_shapes(a, _ARRAYS, sizes)
    forest = _forest(archive, number, len(features), classes) if roles.forest else None
    law = _law(archive, number, roles, classes) if roles.law else None
    slopes = np.array(header["slopes"], dtype=float)
    if slopes.shape != (1 + roles.forest + roles.law,) or not (slopes > 0).all():
        raise ValueError("the slopes are not one for each part")
    parts = Parts(
        Standardization(a["centre"], a["scale"], a["weight"]),
        KernelMachine(a["support"], a["weights"], a["offsets"], float(header["width"]), classes),
        Discriminants(a["axes"], a["points"]),
        forest,
        law,
    )
    strangeness = Strangeness(a["usual"], a["levels"])
    return Expert(frozenset(header["families"]), features, parts, slopes, a["class_offsets"], strangeness)


def _forest(archive: Any, number: int, features: int, classes: int) -> Forest:
    a = {name: archive[f"forest_{name}_{number}"] for name in _FOREST}
    sizes = {"F": features, "t": len(a["roots"]), "n": len(a["feature"]), "k": classes}
    _check_shapes(a, _FOREST, sizes, whole=("roots", "feature", "left", "right"))
    forest = Forest(**a)
    forest.check()
    return forest


def _law(archive: Any, number: int, roles: Roles, classes: int) -> MotionLaw:
    a = {name: archive[f"law_{name}_{number}"] for name in _LAW}
    motion, effects = len(roles.motion), len(roles.effects)
    _check_shapes(a, _LAW, {"b": motion + effects, "e": effects, "r": 1 + 2 * motion, "k": classes})
    return MotionLaw(**a)


def _check_shapes(
    arrays: dict[str, Any], shapes: dict[str, str], sizes: dict[str, int], whole: tuple[str, ...] = ()
) -> None:
    """Raise ValueError on an array that is empty, holds NaN, or has another shape or type."""
    for name, letters in shapes.items():
        array = arrays[name]
        kind = "i" if name in whole else "f"
        if array.shape != tuple(sizes[letter] for letter in letters) or array.dtype.kind != kind:
            raise ValueError(f"{name} has shape {array.shape}")
        if not array.size:
            raise ValueError(f"{name} is empty")
        if np.isnan(array).any():
            raise ValueError(f"{name} holds NaN")


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def _foreign(path: str | os.PathLike[str]) -> InputError:
    return InputError(
        "is no ground classifier", file=path, mend="name a file that GroundClassifier.save wrote"
    )


def _damaged(path: str | os.PathLike[str], error: Exception) -> InputError:
    return InputError(f"is damaged ({error})", file=path, mend="copy it again, or train it anew")
