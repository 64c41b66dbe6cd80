"""The metadata of a table of estimates, as texts for files without structured metadata."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from terragrip.estimation.estimates import Estimates


def about_texts(estimates: Estimates) -> dict[str, str]:
    """Start, source, method, version and the rest of ``about`` by name; what has parts is JSON."""
    recording = {f"recording_{name}": value for name, value in estimates.about.get("recording", {}).items()}
    plain = {"start": recording.pop("recording_start", None), **estimates.about, **recording}
    plain.pop("recording", None)
    return {
        name: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
        for name, value in plain.items()
        if value is not None
    }


def about_rows(estimates: Estimates) -> list[tuple[str, str]]:
    """`about_texts` and each note, as rows of two texts."""
    return [*about_texts(estimates).items(), *(("note", note) for note in estimates.notes)]
