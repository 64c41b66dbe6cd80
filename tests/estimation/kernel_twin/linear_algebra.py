"""Cholesky and triangular solves in the precision of their arguments: LAPACK has no long double."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def cholesky(matrix: NDArray[Any]) -> NDArray[Any]:
    """Lower L with L Lᵀ = matrix, (n, n) symmetric positive definite.

    Raises
    ------
    numpy.linalg.LinAlgError: the matrix is not positive definite (or holds NaN).
    """
    factor = np.zeros_like(matrix)
    for j in range(len(matrix)):
        column = matrix[j:, j] - factor[j:, :j] @ factor[j, :j]
        if not column[0] > 0:
            raise np.linalg.LinAlgError(f"not positive definite: pivot {j} is {column[0]}")
        factor[j:, j] = column / np.sqrt(column[0])
    return factor


def solve_lower(factor: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """X with L X = right, L (n, n) lower triangular, right (n,) or (n, k)."""
    solution = np.zeros(right.shape, np.result_type(factor, right))
    for i in range(len(factor)):
        solution[i] = (right[i] - factor[i, :i] @ solution[:i]) / factor[i, i]
    return solution


def solve_positive(matrix: NDArray[Any], right: NDArray[Any]) -> NDArray[Any]:
    """X with A X = right, A (n, n) symmetric positive definite, right (n,) or (n, k)."""
    factor = cholesky(matrix)
    half = solve_lower(factor, right)
    return solve_lower(factor.T[::-1, ::-1], half[::-1])[::-1]


def symmetric(matrix: NDArray[Any]) -> NDArray[Any]:
    """The matrix without the asymmetry that rounding leaves, (..., n, n)."""
    return (matrix + np.swapaxes(matrix, -1, -2)) / 2
