"""Which soil a drive is on: a forward filter over known soils and an unknown one, and its smoothing backwards.

A sticky Markov chain: the soil changes with the distance driven, not with time, so that standing still changes nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from terragrip.arrays import Floats
from terragrip.ground.emissions import Emissions
from terragrip.soil.blocks import Blocks

LENGTH = 8.0
"""Mean length of one soil [m], beforehand,"""
UNKNOWN_SHARE = 0.15
"""and the share of unknown soils among the new ones."""


def prior(states: NDArray[np.int64]) -> Floats:
    """Prior probabilities (states,): known soils equally likely, states of one soil equally likely. `states`: of `Emissions`."""
    soils = int(states[-1])
    unknown = UNKNOWN_SHARE if soils else 1.0
    each = np.append(np.full(soils, (1 - unknown) / max(soils, 1)), unknown)
    return np.asarray((each / np.bincount(states))[states])


class ForwardFilter:
    """Probabilities of the states of `emissions` up to now; one block at a time."""

    def __init__(self, emissions: Emissions) -> None:
        self.emissions = emissions
        self.start = prior(emissions.states)
        self.probabilities = self.start
        self.travelled: float | None = None

    def update(self, blocks: Blocks) -> Forward:
        """Take blocks in order, one or many: the results are the same."""
        before = blocks.travelled[:1] if self.travelled is None else np.array([self.travelled])
        driven = np.diff(np.concatenate((before, blocks.travelled))).clip(0)
        logs = self.emissions.log_likelihood(blocks, driven)
        weight = np.exp(logs - logs.max(axis=1, keepdims=True)) if len(logs) else logs
        filtered, anew = np.empty_like(logs), -np.expm1(-driven / LENGTH)
        for k, travelled in enumerate(blocks.travelled):
            moved = ((1 - anew[k]) * self.probabilities + anew[k] * self.start) * weight[k]
            self.probabilities = moved / moved.sum()
            self.travelled = float(travelled)
            filtered[k] = self.probabilities
        return Forward(filtered, weight, anew, self.start)


@dataclass(frozen=True)
class Forward:
    """A forward pass: filtered probabilities and relative likelihoods (blocks, states), the chance of a new soil before each block
    (blocks,), and the law (states,) that it is drawn from."""

    filtered: Floats
    weight: Floats
    anew: Floats
    start: Floats

    def smoothed(self) -> Floats:
        """Probabilities given the whole drive, (blocks, states): the backward pass of Rabiner 1989, scaled."""
        out, after = self.filtered.copy(), np.ones(self.filtered.shape[1])
        for k in range(len(out) - 2, -1, -1):
            seen = self.weight[k + 1] * after
            after = (1 - self.anew[k + 1]) * seen + self.anew[k + 1] * (self.start * seen).sum()
            after /= after.max()
            both = out[k] * after
            out[k] = both / both.sum()
        return out


def by_soil(probabilities: Floats, states: NDArray[np.int64]) -> Floats:
    """The states of each soil put together: (blocks, soils + 1), the unknown soil last."""
    return np.asarray(np.add.reduceat(probabilities, np.flatnonzero(np.diff(states, prepend=-1)), axis=1))
