"""A nonlinear program around fixed cones: affine rows in cones, and smooth rows with their slopes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Rows = Any  # scipy.sparse array, CSR; scipy has no types

ConeKind = Literal["zero", "nonnegative", "second_order"]


@dataclass(frozen=True, eq=False)
class ConeBlock:
    """Affine rows ``offset + matrix x`` that lie in a cone.

    Attributes
    ----------
    kind : {"zero", "nonnegative", "second_order"}
    matrix : (m, n) sparse
    offset : (m,) float
    size : int
        Rows of one second-order cone, bound first: ``row 0 >= |rows 1..size-1|``; m is a multiple of it.
    """

    kind: ConeKind
    matrix: Rows
    offset: FloatArray
    size: int = 0


@dataclass(frozen=True, eq=False)
class SmoothRows:
    """Nonlinear rows at a point and their slopes.

    Attributes
    ----------
    equality : (p,) float
        f, wanted zero.
    equality_slope : (p, n) sparse
    inequality : (q,) float
        g, wanted nonnegative. p and q do not change from point to point.
    inequality_slope : (q, n) sparse
    fall : (q,) float or None
        How far each inequality row can fall in a round at trust 1, where the caller knows it: rows that
        cannot reach zero are left out of the cone program.
    """

    equality: FloatArray
    equality_slope: Rows
    inequality: FloatArray
    inequality_slope: Rows
    fall: FloatArray | None = None

    @property
    def violation(self) -> float:
        """Largest violation of any row."""
        return max(largest(np.abs(self.equality)), largest(-self.inequality), 0.0)

    @property
    def total(self) -> float:
        """Sum of the violations of all rows."""
        return float(np.abs(self.equality).sum() + np.maximum(0.0, -self.inequality).sum())


@dataclass(frozen=True, eq=False)
class ConeProgram:
    """A nonlinear program around fixed cones, scaled to order one.

    Attributes
    ----------
    cost : (n,) float
        c.
    blocks : tuple of ConeBlock
        Hold at every iterate.
    smooth : callable
        ``smooth(x)`` gives the nonlinear rows at x.
    reach : (n,) float
        How far each unknown may move in one round at trust 1; infinity where steps need no limit.
    quadratic : (n, n) sparse or None
        P, positive semidefinite.
    elastic_equalities : bool
        Whether the linearised f = 0 may be broken at a price, too. Where it has solutions in every trust
        region, as dynamics under unbounded thrust have, hard rows are faster.
    """

    cost: FloatArray
    blocks: tuple[ConeBlock, ...]
    smooth: Callable[[FloatArray], SmoothRows]
    reach: FloatArray
    quadratic: Rows | None = None
    elastic_equalities: bool = True

    def value(self, x: FloatArray) -> float:
        """Return the objective at x."""
        curved = 0.0 if self.quadratic is None else 0.5 * float(x @ (self.quadratic @ x))
        return float(self.cost @ x) + curved


def largest(values: FloatArray) -> float:
    """Return the largest of the values; 0 where there are none."""
    return float(values.max()) if values.size else 0.0
