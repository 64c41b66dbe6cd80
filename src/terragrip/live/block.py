"""Rows that were estimated and published before core and record took them, in good order: they take them together."""

from __future__ import annotations

from array import array
from dataclasses import dataclass

from terragrip.estimation.estimator import Estimate


@dataclass(frozen=True, slots=True)
class Block:
    """Rows of one source that hold the same channels; see `terragrip.live.express`.

    ``numbers``: of each row arrival and stamp [s], then SI values by ``channels``. ``told`` [s]: when each estimate was
    published, on the arrivals' clock.
    """

    source: int
    channels: tuple[str, ...]
    numbers: array[float]
    estimates: list[Estimate]
    told: list[float]

    def __len__(self) -> int:
        return len(self.estimates)

    @property
    def width(self) -> int:
        """Numbers of a row."""
        return 2 + len(self.channels)

    @property
    def arrivals(self) -> array[float]:
        """When each row's sample came in [s]."""
        return self.numbers[:: self.width]

    @property
    def stamps(self) -> array[float]:
        """Each sample's stamp on its source's clock [s]."""
        return self.numbers[1 :: self.width]
