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

from dataclasses import dataclass
from typing import Literal

import numpy as np

from landing_cli.optimize.cone_records import ConeBlock, ConeProgram, FloatArray, SmoothRows, largest
from landing_cli.optimize.cone_step import NO_POINT, ConvexStep, convex_step, no_cuts, stacked, with_cuts

__all__ = ["ConeBlock", "ConeOptions", "ConeProgram", "ConeSolution", "SmoothRows", "solve_cone_program"]

SolveStatus = Literal["converged", "infeasible", "unresolved"]


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
        Settled when the merit is expected to fall by less than this share.
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
    held = blocks_violation(program.blocks, x) <= 1e-6
    fixed = stacked(program.blocks)
    trust, price, rounds, cuts = options.trust, options.price, 0, no_cuts(len(x))
    step = ConvexStep("", None, 0.0, 0.0, np.zeros(len(rows.equality)), np.zeros(len(rows.inequality)))
    tiny = 1e-9 * options.trust

    def ended(status: SolveStatus, message: str) -> ConeSolution:
        multipliers = step.equality_multipliers, step.inequality_multipliers
        return ConeSolution(x, status, message, program.value(x), rows, *multipliers, rounds)

    while rounds < options.max_rounds:
        step = convex_step(program, fixed, x, rows, cuts, trust, price)
        rounds += 1
        if step.x is None:
            if step.outcome in NO_POINT:
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
        settled = held and expected <= options.progress_tol * (abs(merit) + 1e-3)
        accepted = not held or achieved > 0.05 * expected or (settled and candidate.total < rows.total)
        if accepted:
            x, rows, held, cuts = step.x, candidate, True, no_cuts(len(x))
        else:
            cuts = with_cuts(cuts, step.x, candidate)
        if settled:
            if rows.violation <= options.violation_tol:
                return ended("converged", f"converged in {rounds} rounds")
            if accepted and achieved > 0.25 * expected:
                continue
            if price >= options.price_max or trust <= tiny:
                return ended("infeasible", f"a violation of {rows.violation:.3g} remains at its local least")
            price *= 10.0
        elif achieved < 0.25 * expected:
            trust = 0.5 * min(trust, step.length)
            if trust <= tiny:
                return ended("unresolved", "the trust region shrank to nothing")
        elif achieved > 0.7 * expected:
            trust = max(trust, 2.0 * step.length)
    return ended("unresolved", f"not converged after {rounds} rounds")


def blocks_violation(blocks: tuple[ConeBlock, ...], x: FloatArray) -> float:
    """Largest violation of fixed blocks at a point x (n,)."""
    worst = 0.0
    for block in blocks:
        values = block.offset + block.matrix @ x
        if block.kind == "zero":
            worst = max(worst, largest(np.abs(values)))
        elif block.kind == "nonnegative":
            worst = max(worst, largest(-values))
        else:
            cones = values.reshape(-1, block.size)
            worst = max(worst, largest(np.linalg.norm(cones[:, 1:], axis=1) - cones[:, 0]))
    return worst
