"""What a map's file says of how the map was made."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass

from terragrip import __version__

ABOUT = "TERRAGRIP_MAP"
"""Name of the GeoPackage's metadata that hold it, as JSON."""


@dataclass(frozen=True)
class About:
    """``epsg`` of the grid and the ``cell`` [m]; the ``datum`` that positions were read in; the slip that adhesion is mapped at; names of
    the ``runs``; ``notes``: sentences for the user; ``changes``: of each quantity from which run to which how many cells were driven again,
    and how many of them changed; the ``version`` of Terragrip."""

    epsg: int
    cell: float
    datum: str
    reference_slip: float
    runs: list[str]
    notes: list[str]
    changes: dict[str, list[tuple[str, str, int, int]]]
    version: str = __version__

    def to_text(self) -> str:
        """As JSON."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> About:
        """From `to_text`. Raises ValueError or TypeError on anything else."""
        return cls(**json.loads(text))
