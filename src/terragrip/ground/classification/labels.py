"""Labels of recordings: one each, of one kind, two grounds or more."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from terragrip.errors import InputError

UNKNOWN = "unknown"


def one_each(labels: Any, count: int) -> list[Any]:
    """The labels as a list; raises InputError unless there are ``count`` of them."""
    try:
        listed = [] if isinstance(labels, str) else list(labels)
    except TypeError:
        listed = []
    if isinstance(labels, dict) or len(listed) != count:
        problem = f"there are {len(listed)} labels for {count} recordings"
        raise InputError(problem, place="labels", hint="give a list with one label for each recording")
    return [label.item() if isinstance(label, np.generic) else label for label in listed]


def classes_of(labels: Any, count: int) -> tuple[npt.NDArray[Any], npt.NDArray[np.intp]]:
    """The sorted classes, and the class number (recordings,) of each recording.

    Raises InputError on labels that are not one for each, empty, of mixed kinds, or all the same.
    """
    listed = one_each(labels, count)
    for k, label in enumerate(listed):
        if not isinstance(label, str | int | float) or label != label or label == "":
            raise InputError(
                f"{label!r} is not a label", place=f"labels[{k}]", hint="give a text or a number"
            )
        if label == UNKNOWN:
            hint = "leave the recording out: what fits no ground is called unknown"
            raise InputError("'unknown' cannot be learned as a ground", place=f"labels[{k}]", hint=hint)
    if len({isinstance(label, str) for label in listed}) > 1:
        raise InputError("texts and numbers are mixed", place="labels", hint="give labels of one kind")
    classes, codes = np.unique(np.array(listed), return_inverse=True)
    if len(classes) < 2:
        sentence = f"there is one ground only, {classes[0]!s}" if len(classes) else "there is no recording"
        raise InputError(sentence, place="labels", hint="give recordings of two grounds or more")
    return classes, codes
