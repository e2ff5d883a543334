"""Successive convexification: nonlinear rows linearised again and again around a cone program.

    minimise    c . x + x' P x / 2
    subject to  h + M x in K         (fixed blocks: zero, nonnegative or second-order cones)
                f(x) = 0,  g(x) >= 0  (smooth rows, linearised at the iterate)

Each round solves the linearised program with Clarabel inside a trust region, with the smooth rows elastic at
a price, so that it always has a solution; the step is judged by the merit

    c . x + x' P x / 2 + price * (sum |f| + sum max(0, -g)),

the exact L1 penalty (Mao, Szmuk and Acikmese, "Successive convexification of non-convex optimal control
problems and its convergence properties", CDC 2016). The price rises while violations remain. Convergence
means that the linearised program expects nothing more and every row holds; nothing more at the highest price
with a row still broken is a local least of the violation, reported as infeasible with the rows that remain.
Whatever else stops the loop is unresolved and says nothing about feasibility.

The unknowns and the rows have to be scaled to order one by the caller.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

FloatArray = NDArray[np.float64]
Rows = Any  # scipy.sparse array, CSR; scipy has no types

ConeKind = Literal["zero", "nonnegative", "second_order"]
SolveStatus = Literal["converged", "infeasible", "unresolved"]

_SOLVED = ("Solved", "AlmostSolved")
_NO_POINT = ("PrimalInfeasible", "AlmostPrimalInfeasible")


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
    """

    equality: FloatArray
    equality_slope: Rows
    inequality: FloatArray
    inequality_slope: Rows

    @property
    def violation(self) -> float:
        """Largest violation of any row."""
        return max(_largest(np.abs(self.equality)), _largest(-self.inequality), 0.0)

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
    """

    cost: FloatArray
    blocks: tuple[ConeBlock, ...]
    smooth: Callable[[FloatArray], SmoothRows]
    reach: FloatArray
    quadratic: Rows | None = None

    def value(self, x: FloatArray) -> float:
        """Return the objective at x."""
        curved = 0.0 if self.quadratic is None else 0.5 * float(x @ (self.quadratic @ x))
        return float(self.cost @ x) + curved


@dataclass(frozen=True)
class ConeOptions:
    """How to drive the rounds.

    Attributes
    ----------
    trust : float
        First trust radius, in units of ``reach``.
    price : float
        First price of a unit of violation; of the order of the multipliers, or above.
    price_max : float
        Price at which a remaining violation counts as infeasible.
    violation_tol : float
        Largest violation of a smooth row at convergence.
    progress_tol : float
        Converged when the merit is expected to fall by less than this share of the objective.
    max_rounds : int
    """

    trust: float = 1.0
    price: float = 10.0
    price_max: float = 1e6
    violation_tol: float = 1e-8
    progress_tol: float = 1e-6
    max_rounds: int = 60


@dataclass(frozen=True, eq=False)
class ConeSolution:
    """What the rounds came to.

    Attributes
    ----------
    x : (n,) float
        The best iterate.
    status : {"converged", "infeasible", "unresolved"}
    message : str
        Why the rounds ended.
    value : float
        Objective at x.
    rows : SmoothRows
        The nonlinear rows at x: what remains violated, and by how much.
    equality_multipliers, inequality_multipliers : (p,) and (q,) float
        Multipliers of the smooth rows in the last round: how fast the objective falls per unit of slack.
    rounds : int
        Convex programs solved.
    """

    x: FloatArray
    status: SolveStatus
    message: str
    value: float
    rows: SmoothRows
    equality_multipliers: FloatArray
    inequality_multipliers: FloatArray
    rounds: int


@dataclass(frozen=True, eq=False)
class ConvexStep:
    """Answer of one convex program; ``x`` is None where there is none."""

    outcome: str
    x: FloatArray | None
    expected: float
    equality_multipliers: FloatArray
    inequality_multipliers: FloatArray


def solve_cone_program(
    program: ConeProgram, start: FloatArray, options: ConeOptions | None = None
) -> ConeSolution:
    """Find a local optimum from a starting point, which need not satisfy anything.

    Parameters
    ----------
    program : ConeProgram
        The scaled program.
    start : (n,) float
        First point of linearisation.
    options : ConeOptions, optional
        How to drive the rounds.

    Returns
    -------
    ConeSolution
    """
    options = options or ConeOptions()
    x, rows = np.array(start, dtype=np.float64), program.smooth(start)
    held = _blocks_violation(program, x) <= 1e-6
    trust, price, rounds = options.trust, options.price, 0
    nothing = ConvexStep("", None, 0.0, np.zeros(len(rows.equality)), np.zeros(len(rows.inequality)))
    step, tiny = nothing, 1e-9 * options.trust

    def ended(status: SolveStatus, message: str) -> ConeSolution:
        multipliers = step.equality_multipliers, step.inequality_multipliers
        return ConeSolution(x, status, message, program.value(x), rows, *multipliers, rounds)

    while rounds < options.max_rounds:
        step = convex_step(program, x, rows, trust, price)
        rounds += 1
        if step.x is None:
            if step.outcome in _NO_POINT:
                if trust >= 1e6 * options.trust:
                    return ended("infeasible", "the fixed cones have no point in common")
                trust *= 10.0
            elif trust > tiny:
                trust *= 0.25
            else:
                return ended("unresolved", f"the cone solver stopped: {step.outcome}")
            continue
        candidate = program.smooth(step.x)
        merit = program.value(x) + price * rows.total
        expected = merit - step.expected
        achieved = merit - program.value(step.x) - price * candidate.total
        settled = held and expected <= options.progress_tol * (abs(program.value(x)) + 1e-3)
        if not held or achieved > 0.05 * expected or (settled and candidate.total < rows.total):
            x, rows, held = step.x, candidate, True
        if settled and rows.violation <= options.violation_tol:
            return ended("converged", f"converged in {rounds} rounds")
        if settled and (price >= options.price_max or trust <= tiny):
            return ended("infeasible", f"a violation of {rows.violation:.3g} remains at its local least")
        if settled and rows.violation > options.violation_tol and achieved <= 0.25 * expected:
            price *= 10.0
        if achieved < 0.25 * expected and not settled:
            trust *= 0.4
            if trust <= tiny:
                return ended("unresolved", "the trust region shrank to nothing")
        elif achieved > 0.7 * expected:
            trust = min(2.0 * trust, 1e3 * options.trust)
    return ended("unresolved", f"not converged after {rounds} rounds")


def convex_step(program: ConeProgram, x: FloatArray, rows: SmoothRows, trust: float, price: float) -> ConvexStep:
    """Solve the program linearised at a point, within a trust region, with elastic smooth rows.

    Parameters
    ----------
    program : ConeProgram
        The scaled program.
    x : (n,) float
        Point of linearisation.
    rows : SmoothRows
        The smooth rows there.
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

    n, p, q = len(x), len(rows.equality), len(rows.inequality)
    blocks = [*program.blocks, *_elastic_blocks(x, rows), *_trust_blocks(program.reach, x, trust)]
    wide = [_widened(block, n + 2 * p + q) for block in blocks]
    matrix = sparse.csc_array(-sparse.vstack([block.matrix for block in wide]))
    offset = np.concatenate([block.offset for block in wide])
    cost = np.concatenate([program.cost, np.full(2 * p + q, price)])
    curved = sparse.csc_array((len(cost), len(cost)))
    if program.quadratic is not None:
        curved = sparse.csc_array(sparse.triu(_padded(program.quadratic, len(cost))))
    cones = [cone for block in wide for cone in _cones(clarabel, block)]
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False
    solution = clarabel.DefaultSolver(curved, cost, matrix, offset, cones, settings).solve()
    outcome, first = str(solution.status), sum(len(block.offset) for block in program.blocks)
    z = np.array(solution.z)
    multipliers = -z[first : first + p], z[first + p : first + p + q]
    if outcome not in _SOLVED:
        return ConvexStep(outcome, None, np.inf, *multipliers)
    found = np.array(solution.x)
    f = rows.equality + rows.equality_slope @ (found[:n] - x)
    g = rows.inequality + rows.inequality_slope @ (found[:n] - x)
    linear = replace(rows, equality=f, inequality=g)
    return ConvexStep(outcome, found[:n], program.value(found[:n]) + price * linear.total, *multipliers)


def _elastic_blocks(x: FloatArray, rows: SmoothRows) -> list[ConeBlock]:
    """Linearised rows in (x, f+, f-, g-): f = f+ - f-, g + g- >= 0, and nonnegative violations."""
    n, p, q = len(x), len(rows.equality), len(rows.inequality)
    one_p, one_q = sparse.eye_array(p), sparse.eye_array(q)
    f = sparse.hstack([rows.equality_slope, -one_p, one_p, sparse.csr_array((p, q))])
    g = sparse.hstack([rows.inequality_slope, sparse.csr_array((q, 2 * p)), one_q])
    violations = sparse.eye_array(2 * p + q, n + 2 * p + q, k=n)
    return [
        ConeBlock("zero", f, rows.equality - rows.equality_slope @ x),
        ConeBlock("nonnegative", g, rows.inequality - rows.inequality_slope @ x),
        ConeBlock("nonnegative", violations, np.zeros(2 * p + q)),
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


def _blocks_violation(program: ConeProgram, x: FloatArray) -> float:
    """Largest violation of the fixed blocks."""
    worst = 0.0
    for block in program.blocks:
        values = block.offset + block.matrix @ x
        if block.kind == "zero":
            worst = max(worst, _largest(np.abs(values)))
        elif block.kind == "nonnegative":
            worst = max(worst, _largest(-values))
        else:
            cones = values.reshape(-1, block.size)
            worst = max(worst, _largest(np.linalg.norm(cones[:, 1:], axis=1) - cones[:, 0]))
    return worst


def _largest(values: FloatArray) -> float:
    return float(values.max()) if values.size else 0.0
