"""Which features each part of an expert uses.

How a vehicle is driven is the driver's choice, not the ground's: a run in which the driver turned more than in any other on that
ground should not be classified as another ground. So of the motion the machine sees pace and turning alone; what all the other sensors
show is also judged *given* the motion (`motion_law`). Features of single wheels are left to the forest.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from terragrip.ground.classification.features import SPEED, families_needed, of_one_wheel, of_sides

Columns = npt.NDArray[np.intp]

MOTION = tuple(f"{SPEED}: {name}" for name in ("pace", "straightness", "turn", "turn size"))


@dataclass(frozen=True)
class Roles:
    """Columns of the features: of the `machine`; `motion` and its `effects` (both empty: no law); whether there is a `forest`."""

    machine: Columns
    motion: Columns
    effects: Columns
    forest: bool

    @property
    def law(self) -> bool:
        """Whether there are effects to be judged given a motion."""
        return bool(len(self.effects))


@lru_cache(maxsize=64)
def roles_of(features: tuple[str, ...]) -> Roles:
    """The parts' columns among these features."""
    names = list(features)
    shared = [k for k, name in enumerate(names) if not of_one_wheel(name)]
    effects = [k for k in shared if families_needed(names[k]) != {SPEED}]
    motion = [names.index(name) for name in MOTION if name in names]
    judged = bool(effects) and len(motion) == len(MOTION)
    machine = [*motion, *effects] if judged else shared
    return Roles(
        np.array([k for k in machine if not of_sides(names[k])], dtype=np.intp),
        np.array(motion if judged else [], dtype=np.intp),
        np.array(effects if judged else [], dtype=np.intp),
        len(shared) < len(names),
    )
