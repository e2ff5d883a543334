"""One round of successive convexification: the linearised program, solved by Clarabel."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.optimize.cone_records import ConeBlock, ConeProgram, FloatArray, Rows, SmoothRows, largest

SOLVED = ("Solved", "AlmostSolved")
NO_POINT = ("PrimalInfeasible", "AlmostPrimalInfeasible")


@dataclass(frozen=True, eq=False)
class Cuts:
    """Inequality rows ``offset + slope x >= 0`` that steps refused from the same point have added.

    A distance is the least of the distances to many facets; near a valley the facet that is closest now does
    not tell of the other wall. A refused step does.

    Attributes
    ----------
    row : (k,) int
        The smooth row that each belongs to.
    offset : (k,) float
    slope : (k, n) sparse
    """

    row: NDArray[np.int64]
    offset: FloatArray
    slope: Rows


@dataclass(frozen=True, eq=False)
class ConvexStep:
    """Answer of one convex program; ``x`` is None where there is none, ``length`` is in units of reach."""

    outcome: str
    x: FloatArray | None
    expected: float
    length: float
    equality_multipliers: FloatArray
    inequality_multipliers: FloatArray


def convex_step(
    program: ConeProgram, x: FloatArray, rows: SmoothRows, cuts: Cuts, trust: float, price: float
) -> ConvexStep:
    """Solve the program linearised at a point, within a trust region, with elastic smooth rows.

    Parameters
    ----------
    program : ConeProgram
        The scaled program.
    x : (n,) float
        Point of linearisation.
    rows : SmoothRows
        The smooth rows there.
    cuts : Cuts
        What refused steps have learnt about the rows.
    trust : float
        Radius, in units of ``program.reach``.
    price : float
        Price of a unit of violation.

    Returns
    -------
    ConvexStep
        With the merit that the linearised program expects.
    """
    import clarabel

    n, near = len(x), _within_fall(rows, trust)
    broken = _violation_signs(program, len(rows.equality), len(near))
    blocks = [
        *program.blocks,
        *_linear_blocks(x, rows, near, cuts, broken),
        *_trust_blocks(program.reach, x, trust),
    ]
    width = n + broken.shape[1]
    wide = [_widened(block, width) for block in blocks]
    matrix = sparse.csc_array(-sparse.vstack([block.matrix for block in wide]))
    offset = np.concatenate([block.offset for block in wide])
    cost = np.concatenate([program.cost, np.full(width - n, price)])
    curved = sparse.csc_array((width, width))
    if program.quadratic is not None:
        curved = sparse.csc_array(sparse.triu(_padded(program.quadratic, width)))
    cones = [cone for block in wide for cone in _cones(clarabel, block)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False
    solution = clarabel.DefaultSolver(curved, cost, matrix, offset, cones, settings).solve()
    p, first = len(rows.equality), sum(len(block.offset) for block in program.blocks)
    z = np.array(solution.z)
    multipliers = -z[first : first + p], np.zeros(len(rows.inequality))
    multipliers[1][near] = z[first + p : first + p + len(near)]
    outcome = str(solution.status)
    if outcome not in SOLVED:
        return ConvexStep(outcome, None, np.inf, 0.0, *multipliers)
    found = np.array(solution.x)[:n]
    f = rows.equality + rows.equality_slope @ (found - x)
    g = rows.inequality + rows.inequality_slope @ (found - x)
    np.minimum.at(g, cuts.row, cuts.offset + cuts.slope @ found)
    linear = replace(rows, equality=f, inequality=g)
    length = largest(np.abs(found - x) / program.reach)
    return ConvexStep(outcome, found, program.value(found) + price * linear.total, length, *multipliers)


def _within_fall(rows: SmoothRows, trust: float) -> NDArray[np.int64]:
    """Inequality rows that can be broken within the trust region."""
    if rows.fall is None:
        return np.arange(len(rows.inequality))
    return np.flatnonzero(rows.inequality <= trust * rows.fall)


def _violation_signs(program: ConeProgram, p: int, q: int) -> Rows:
    """How the nonnegative violations enter the rows f (both signs, where elastic) and g."""
    one = sparse.eye_array(p)
    f = sparse.hstack([-one, one]) if program.elastic_equalities else sparse.csr_array((p, 0))
    return sparse.csr_array(sparse.block_diag([f, sparse.eye_array(q)]))


def no_cuts(n: int) -> Cuts:
    """No cuts for a point of n unknowns."""
    return Cuts(np.zeros(0, dtype=np.int64), np.zeros(0), sparse.csr_array((0, n)))


def with_cuts(cuts: Cuts, x: FloatArray, rows: SmoothRows) -> Cuts:
    """Add the rows of a refused point x that it breaks, linearised there."""
    broken = np.flatnonzero(rows.inequality < 0.0)
    slope = rows.inequality_slope[broken]
    return Cuts(
        np.concatenate([cuts.row, broken]),
        np.concatenate([cuts.offset, rows.inequality[broken] - slope @ x]),
        sparse.csr_array(sparse.vstack([cuts.slope, slope])),
    )


def _linear_blocks(
    x: FloatArray, rows: SmoothRows, near: NDArray[np.int64], cuts: Cuts, broken: Rows
) -> list[ConeBlock]:
    """Linearised rows in x and the violations: f, g, and the cuts, which share their rows' violations."""
    p, n, extra = len(rows.equality), len(x), broken.shape[1]
    place = np.full(len(rows.inequality), -1)
    place[near] = np.arange(len(near))
    kept = np.flatnonzero(place[cuts.row] >= 0)
    f, g = rows.equality_slope, rows.inequality_slope[near]
    shared = broken[p + place[cuts.row[kept]]]
    return [
        ConeBlock("zero", sparse.hstack([f, broken[:p]]), rows.equality - f @ x),
        ConeBlock("nonnegative", sparse.hstack([g, broken[p:]]), rows.inequality[near] - g @ x),
        ConeBlock("nonnegative", sparse.hstack([cuts.slope[kept], shared]), cuts.offset[kept]),
        ConeBlock("nonnegative", sparse.eye_array(extra, n + extra, k=n), np.zeros(extra)),
    ]


def _trust_blocks(reach: FloatArray, x: FloatArray, trust: float) -> list[ConeBlock]:
    limited = np.flatnonzero(np.isfinite(reach))
    chosen = sparse.eye_array(len(x), format="csr")[limited]
    radius = trust * reach[limited]
    scale = sparse.diags_array(1.0 / radius)
    return [
        ConeBlock("nonnegative", scale @ chosen, 1.0 - x[limited] / radius),
        ConeBlock("nonnegative", -scale @ chosen, 1.0 + x[limited] / radius),
    ]


def _widened(block: ConeBlock, width: int) -> ConeBlock:
    m, n = block.matrix.shape
    if n == width:
        return block
    return replace(block, matrix=sparse.hstack([block.matrix, sparse.csr_array((m, width - n))]))


def _padded(matrix: Rows, width: int) -> Rows:
    rest = width - matrix.shape[0]
    return sparse.block_diag([matrix, sparse.csr_array((rest, rest))])


def _cones(clarabel: Any, block: ConeBlock) -> list[Any]:
    m = len(block.offset)
    if block.kind == "zero":
        return [clarabel.ZeroConeT(m)]
    if block.kind == "nonnegative":
        return [clarabel.NonnegativeConeT(m)]
    return [clarabel.SecondOrderConeT(block.size)] * (m // block.size)
