"""The record of how a map was made, kept in the map's file."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from terragrip import __version__

ABOUT = "TERRAGRIP_MAP"
"""Name of the GeoPackage's metadata that hold it, as JSON."""


@dataclass(frozen=True)
class About:
    """``epsg`` of the grid and the ``cell`` [m]; the ``datum`` of the positions; the slip at which adhesion is mapped; names of
    the ``runs``; ``notes``: sentences for the user; ``changes``: for each quantity and pair of runs, the number of cells driven again
    and of cells that changed; the ``version`` of Terragrip."""

    epsg: int
    cell: float
    datum: str
    reference_slip: float
    runs: list[str]
    notes: list[str]
    changes: dict[str, list[tuple[str, str, int, int]]]
    version: str = __version__

    def to_text(self) -> str:
        """The record as JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> About:
        """From the result of `to_text`. Raises ValueError or TypeError on anything else."""
        return cls(**json.loads(text))
