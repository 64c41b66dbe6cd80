"""Probabilities of classes: from scores, and back to logarithms that rule no class out."""

from __future__ import annotations

import numpy as np

from terragrip.arrays import Floats

_DOUBT = 0.01  # added to a probability before its logarithm: no part of an expert is ever sure


def softmax(logits: Floats) -> Floats:
    """Probabilities (n, classes) in proportion to the exponentials of ``logits`` (n, classes)."""
    odds = np.exp(logits - logits.max(axis=1, keepdims=True))
    return np.asarray(odds / odds.sum(axis=1, keepdims=True))


def doubting_log(chances: Floats) -> Floats:
    """Logarithms of probabilities of any shape, none below that of the doubt that is left."""
    return np.asarray(np.log(chances + _DOUBT))
