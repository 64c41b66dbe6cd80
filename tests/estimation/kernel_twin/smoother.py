"""The fixed-interval smoother of Rauch, Tung and Striebel, for every filter that keeps its predictions."""

from __future__ import annotations

from collections.abc import Sequence

from kernel_twin.filters import Matrix, Prediction, Vector
from kernel_twin.linear_algebra import solve_positive, symmetric


def smooth(
    filtered: Sequence[tuple[Vector, Matrix]], predictions: Sequence[Prediction]
) -> list[tuple[Vector, Matrix]]:
    """Means and covariances given the whole recording.

    Parameters
    ----------
    filtered: (x, P) after each of the k updates. predictions: predictions[i] led from filtered[i] to the
        prior of update i + 1, so there are k - 1; after a restart nothing flows back, so smooth each
        stretch alone. Of an unscented filter they make this Särkkä's unscented smoother.

    Returns
    -------
    k pairs (x, P); the last is the filtered one.

    Raises
    ------
    ValueError: the counts do not fit.
    """
    if len(predictions) != len(filtered) - 1:
        raise ValueError(
            f"{len(filtered)} filtered states need {len(filtered) - 1} predictions, got {len(predictions)}"
        )
    smoothed = [filtered[-1]]
    for (x, P), prediction in zip(reversed(filtered[:-1]), reversed(predictions), strict=True):
        later_x, later_P = smoothed[-1]
        gain = solve_positive(prediction.covariance, prediction.cross.T).T
        smoothed.append(
            (
                x + gain @ (later_x - prediction.mean),
                symmetric(P + gain @ (later_P - prediction.covariance) @ gain.T),
            )
        )
    return smoothed[::-1]
