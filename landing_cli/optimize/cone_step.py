"""One round of successive convexification: the linearised program, solved by Clarabel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from landing_cli.optimize.cone_records import (
    ConeBlock,
    ConeKind,
    ConeProgram,
    FloatArray,
    Rows,
    SmoothRows,
    largest,
)

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


@dataclass(frozen=True, eq=False)
class Stack:
    """Blocks stacked for Clarabel: entries of their rows, offsets, and cones as (kind, rows, how many)."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    value: FloatArray
    offset: FloatArray
    cones: tuple[tuple[ConeKind, int, int], ...]


def stacked(blocks: Sequence[ConeBlock]) -> Stack:
    """Stack blocks, first on top; done once for the blocks that stay from round to round."""
    none = np.zeros(0, dtype=np.int64)
    rows, columns, values, offsets = [none], [none], [np.zeros(0)], [np.zeros(0)]
    cones, first = [], 0
    for block in blocks:
        entries, count = block.matrix.tocoo(), len(block.offset)
        rows.append(entries.coords[0] + first)
        columns.append(entries.coords[1])
        values.append(entries.data)
        offsets.append(block.offset)
        size = block.size if block.kind == "second_order" else max(count, 1)
        cones.append((block.kind, size, count // size))
        first += count
    return Stack(
        np.concatenate(rows),
        np.concatenate(columns),
        np.concatenate(values),
        np.concatenate(offsets),
        tuple(cones),
    )


def convex_step(
    program: ConeProgram,
    fixed: Stack,
    x: FloatArray,
    rows: SmoothRows,
    cuts: Cuts,
    trust: float,
    price: float,
) -> ConvexStep:
    """Solve the program linearised at a point, within a trust region, with elastic smooth rows.

    Parameters
    ----------
    program : ConeProgram
        The scaled program.
    fixed : Stack
        Its blocks, stacked.
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
    p, near = len(rows.equality), _within_fall(rows, trust)
    violations = (2 * p if program.elastic_equalities else 0) + len(near)
    linear = stacked([*_linear_blocks(program, x, rows, near, cuts), *_trust_blocks(program.reach, x, trust)])
    outcome, found, z = _clarabel(program, fixed, linear, np.full(violations, price))
    multipliers = -z[:p], np.zeros(len(rows.inequality))
    multipliers[1][near] = z[p : p + len(near)]
    if outcome not in SOLVED:
        return ConvexStep(outcome, None, np.inf, 0.0, *multipliers)
    found = found[: len(x)]
    f = rows.equality + rows.equality_slope @ (found - x)
    g = rows.inequality + rows.inequality_slope @ (found - x)
    np.minimum.at(g, cuts.row, cuts.offset + cuts.slope @ found)
    expected = program.value(found) + price * replace(rows, equality=f, inequality=g).total
    return ConvexStep(outcome, found, expected, largest(np.abs(found - x) / program.reach), *multipliers)


def _clarabel(
    program: ConeProgram, fixed: Stack, linear: Stack, prices: FloatArray
) -> tuple[str, FloatArray, FloatArray]:
    """Solve in (x, violations): how it ended, the unknowns, and the multipliers of the linear rows."""
    import clarabel

    m, width = len(fixed.offset), len(program.cost) + len(prices)
    place = np.append(fixed.row, linear.row + m), np.append(fixed.column, linear.column)
    offset = np.append(fixed.offset, linear.offset)
    matrix = sparse.csc_array((-np.append(fixed.value, linear.value), place), shape=(len(offset), width))
    curved = sparse.csc_array((width, width))
    if program.quadratic is not None:
        entries = sparse.triu(program.quadratic).tocoo()
        curved = sparse.csc_array((entries.data, entries.coords), shape=(width, width))
    make = {
        "zero": clarabel.ZeroConeT,
        "nonnegative": clarabel.NonnegativeConeT,
        "second_order": clarabel.SecondOrderConeT,
    }
    cones = [make[kind](size) for kind, size, count in (*fixed.cones, *linear.cones) for _ in range(count)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False
    cost = np.append(program.cost, prices)
    solution = clarabel.DefaultSolver(curved, cost, matrix, offset, cones, settings).solve()
    return str(solution.status), np.array(solution.x), np.array(solution.z)[m:]


def _within_fall(rows: SmoothRows, trust: float) -> NDArray[np.int64]:
    """Inequality rows that can be broken within the trust region."""
    if rows.fall is None:
        return np.arange(len(rows.inequality))
    return np.flatnonzero(rows.inequality <= trust * rows.fall)


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
    program: ConeProgram, x: FloatArray, rows: SmoothRows, near: NDArray[np.int64], cuts: Cuts
) -> list[ConeBlock]:
    """Linearised rows in x and the violations (f+, f-, g-): f = f+ - f-, g + g- >= 0.

    Hard equalities have no f+ and f-. The cuts share the violations of their rows.
    """
    p, q, n = len(rows.equality), len(near), len(x)
    elastic = 2 * p if program.elastic_equalities else 0
    place = np.full(len(rows.inequality), -1)
    place[near] = np.arange(q)
    kept = np.flatnonzero(place[cuts.row] >= 0)
    f, g = rows.equality_slope, rows.inequality_slope[near]
    wide_f = _plus(_plus(f, np.arange(n, n + p), -1.0), np.arange(n + p, n + 2 * p)) if elastic else f
    own, shared = n + elastic + np.arange(q), n + elastic + place[cuts.row[kept]]
    return [
        ConeBlock("zero", wide_f, rows.equality - f @ x),
        ConeBlock("nonnegative", _plus(g, own), rows.inequality[near] - g @ x),
        ConeBlock("nonnegative", _plus(cuts.slope[kept], shared), cuts.offset[kept]),
        ConeBlock("nonnegative", sparse.eye_array(elastic + q, n + elastic + q, k=n), np.zeros(elastic + q)),
    ]


def _plus(matrix: Rows, column: NDArray[np.int64], value: float = 1.0) -> Rows:
    """Rows with one more entry each, in a column beyond."""
    entries, count = matrix.tocoo(), len(column)
    place = np.append(entries.coords[0], np.arange(count)), np.append(entries.coords[1], column)
    shape = count, max(matrix.shape[1], int(column.max(initial=0)) + 1)
    return sparse.coo_array((np.append(entries.data, np.full(count, value)), place), shape=shape)


def _trust_blocks(reach: FloatArray, x: FloatArray, trust: float) -> list[ConeBlock]:
    limited = np.flatnonzero(np.isfinite(reach))
    radius, count = trust * reach[limited], len(limited)
    inward = sparse.coo_array((1.0 / radius, (np.arange(count), limited)), shape=(count, len(x)))
    return [
        ConeBlock("nonnegative", inward, 1.0 - x[limited] / radius),
        ConeBlock("nonnegative", -inward, 1.0 + x[limited] / radius),
    ]
