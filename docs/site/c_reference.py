"""The page of the C interface: terragrip.h, its comments as text and its declarations as code."""

from __future__ import annotations

import re
from pathlib import Path

HEADER = Path(__file__).resolve().parents[2] / "kernel" / "include" / "terragrip.h"
_TITLES = {
    "tg_status": "Status",
    "tg_machine": "Machine, inputs, tuning",
    "tg_filter": "The filter",
    "tg_deviations": "Considered constants",
    "tg_track": "Smoothing",
    "tg_curve": "The adhesion curve while driving",
    "TG_WHEEL_SPEED": "A sample's places",
    "TG_OUT_GROUND_SPEED": "An estimate's places",
    "tg_event": "Events, signs and methods",
    "tg_sample": "Samples and estimates",
    "tg_uncertainty": "Uncertainty",
    "tg_watch_settings": "The warning",
    "tg_tuned": "Tuned numbers",
    "tg_settings": "Settings",
    "tg_estimator": "The estimator",
}
"""Where a section begins: the first declaration of what the key names."""


def page() -> str:
    """Markdown of the public part of the header, in its order."""
    text = HEADER.read_text(encoding="utf-8")
    top = re.search(r"/\*(.*?)\*/", text, re.DOTALL)
    body = re.search(r"/\* cdef begin \*/\n(.*?)/\* cdef end \*/", text, re.DOTALL)
    if top is None or body is None:
        raise SystemExit(f"{HEADER}: no comment at its top, or no section of declarations")
    about = re.sub(r"^ \* ?", "", top[1], flags=re.MULTILINE).strip()
    about = re.sub(r"\b(tg_\w+\*?|TG_\w+)", r"`\1`", about)
    parts = ["# C", about, "How to compile and call it on a controller: [controller.md](controller.md)."]
    for title, code in _sections(body[1]):
        parts += [f"## {title}", f"```c\n{code.strip()}\n```"]
    return "\n\n".join(parts) + "\n"


def _sections(body: str) -> list[tuple[str, str]]:
    """Title and code, cut before the block in which a key of `_TITLES` is declared first."""
    blocks = re.split(r"\n\n(?=\S)", body)
    left, found = dict(_TITLES), [("Types", "")]
    for block in blocks:
        key = next(
            (key for key in left if re.search(rf"^.*\b{key};|^    {key} = ", block, re.MULTILINE)), None
        )
        if key is not None:
            found.append((left.pop(key), ""))
        title, code = found[-1]
        found[-1] = title, f"{code}\n\n{block}"
    if left:
        raise SystemExit(f"{HEADER}: nothing declares {', '.join(left)}; correct _TITLES in {__file__}")
    return [(title, code) for title, code in found if code.strip()]
