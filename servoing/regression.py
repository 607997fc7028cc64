"""Derivatives of the predicted success by regression over sampled steps (section IV-B)."""

from __future__ import annotations

import torch
from torch import Tensor

_UPPER = torch.triu_indices(3, 3)
"""The six entries of a symmetric 3 x 3 matrix that are on or above its diagonal. Shape (2, 6)."""

_SMALLEST_SHARE = 1e-6
"""Directions in which steps differ by less than this share of the widest say nothing: single precision made it up."""


def regress_gradient(steps: Tensor, scores: Tensor) -> Tensor:
    """Slope of the least-squares plane through the scores: arg min_g sum_i (S_0 + g^T p_i - S_i)^2, shape (3,).

    The paper's formula has no intercept, which is right only for scores relative to S_0; fitting S_0 along costs
    nothing and does not trust a single prediction.
    """
    return _least_squares(torch.cat([steps, steps.new_ones(len(steps), 1)], dim=1), scores)[:3].to(steps.dtype)


def regress_quadratic(steps: Tensor, scores: Tensor, *, score_here: float | None = None) -> tuple[Tensor, Tensor]:
    """Gradient and Hessian of the least-squares paraboloid through the scores (eq. 4).

    Args:
        steps: Where the scores were taken. Shape (N, 3), N >= 10.
        scores: Predicted success there. Shape (N,).
        score_here: S_0, held fixed as the paper has it; None fits it along.

    Returns:
        g, shape (3,), and H with S(p) = S_0 + g^T p + 1/2 p^T H p, symmetric, shape (3, 3). The matrix that the paper's
        eq. 4 calls H has no factor 1/2 before it and is half of this one.
    """
    row, column = _UPPER
    # p^T H p / 2 = sum of H_ij p_i p_j over i < j, and H_ii p_i^2 / 2.
    products = steps[:, row] * steps[:, column] * torch.where(row == column, 0.5, 1.0).to(steps)  # (N, 6)
    columns = [steps, products]
    if score_here is None:
        columns.append(steps.new_ones(len(steps), 1))
    solution = _least_squares(torch.cat(columns, dim=1), scores - (score_here or 0.0)).to(steps.dtype)
    hessian = steps.new_zeros(3, 3)
    hessian[row, column] = solution[3:9]
    hessian[column, row] = solution[3:9]
    return solution[:3], hessian


def _least_squares(design: Tensor, values: Tensor) -> Tensor:
    """The coefficients of least norm that fit best, in float64. (N, K), (N,) -> (K,)."""
    # Double precision: the last bit of a single-precision solution depends on where LAPACK's workspace happens to lie.
    # Singular values, so that steps that all lie on a line give a slope along it and none across.
    driver = "gelsd" if design.device.type == "cpu" else None
    answer = torch.linalg.lstsq(design.double(), values[:, None].double(), rcond=_SMALLEST_SHARE, driver=driver)
    solution: Tensor = answer.solution
    return solution[:, 0]
