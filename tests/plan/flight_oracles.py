"""The landing without terrain in a point-mass field as a nonlinear program for IPOPT, in two transcriptions.

Multiple shooting (RK4, constant thrust) shares nothing with the package; Gauss collocation shares the nodes,
but states the equations in differential form and leaves them to IPOPT.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from landing_cli.plan.records import PlanCase

IPOPT = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-9,
    "ipopt.bound_relax_factor": 0.0,
}


@dataclass(frozen=True)
class Scaled:
    """Rates of the landing in units of the chord, the time of flight and the greatest acceleration."""

    rates: ca.Function  # (r, v, u) -> (r', v')
    start: np.ndarray  # (6,)
    delta_v_m_s: float  # of full thrust throughout


def scaled(case: PlanCase) -> Scaled:
    w, gm, tof = case.asteroid.rotation_rate_rad_s, case.asteroid.gm_m3_s2, case.tof_s
    site = case.site.position_m
    length = float(np.linalg.norm(case.position_m - site))
    speed, bound = length / tof, case.spacecraft.thrust_max_n / case.spacecraft.mass_kg
    r, v, u = ca.SX.sym("r", 3), ca.SX.sym("v", 3), ca.SX.sym("u", 3)
    at, along = r * length + ca.DM(site), v * speed
    turning = ca.vertcat(w * (2 * along[1] + w * at[0]), w * (-2 * along[0] + w * at[1]), 0)
    acceleration = -gm * at / ca.norm_2(at) ** 3 + turning + bound * u
    rates = ca.Function("rates", [r, v, u], [v, acceleration * tof / speed])
    start = np.concatenate([(case.position_m - site) / length, case.velocity_m_s / speed])
    return Scaled(rates, start, bound * tof)


def solve(x: Any, cost: Any, equal: list[Any], nonnegative: Any, guess: np.ndarray, bounds: int) -> float:
    """Least cost; the last ``bounds`` unknowns lie between 0 and 1."""
    equality = ca.vertcat(*equal)
    problem = {"x": x, "f": cost, "g": ca.vertcat(equality, nonnegative)}
    solver = ca.nlpsol("landing", "ipopt", problem, IPOPT)
    low, high = np.full(x.shape[0], -np.inf), np.full(x.shape[0], np.inf)
    low[-bounds:], high[-bounds:] = 0.0, 1.0
    top = np.concatenate([np.zeros(equality.shape[0]), np.full(nonnegative.shape[0], np.inf)])
    answer = solver(x0=guess, lbx=low, ubx=high, lbg=np.zeros(len(top)), ubg=top)
    assert solver.stats()["return_status"] == "Solve_Succeeded"
    return float(answer["f"])


def shooting_delta_v(case: PlanCase, n: int) -> float:
    """Least velocity increment, m/s, of n arcs of constant thrust."""
    model = scaled(case)
    r, v, u = ca.SX.sym("r", 3), ca.SX.sym("v", 3), ca.SX.sym("u", 3)
    h, stages = 1.0 / n, []
    for share in (0.0, 0.5, 0.5, 1.0):
        back = stages[-1] if stages else (0, 0)
        stages.append(model.rates(r + share * h * back[0], v + share * h * back[1], u))
    after = [
        state + h / 6 * (stages[0][k] + 2 * stages[1][k] + 2 * stages[2][k] + stages[3][k])
        for k, state in enumerate((r, v))
    ]
    step = ca.Function("step", [r, v, u], after).map(n)
    R, V, U, s = (
        ca.SX.sym(name, *size)
        for name, size in (("R", (3, n + 1)), ("V", (3, n + 1)), ("U", (3, n)), ("s", (n,)))
    )
    r_next, v_next = step(R[:, :-1], V[:, :-1], U)
    equal = [ca.vec(r_next - R[:, 1:]), ca.vec(v_next - V[:, 1:]), R[:, -1], V[:, -1]]
    equal += [ca.vertcat(R[:, 0], V[:, 0]) - ca.DM(model.start)]
    x = ca.vertcat(ca.vec(R), ca.vec(V), ca.vec(U), s)
    left = 1.0 - np.linspace(0.0, 1.0, n + 1)
    guess = np.concatenate([np.outer(left, model.start[:3]).ravel(), np.zeros(6 * n + 3), np.full(n, 0.5)])
    return solve(x, h * ca.sum1(s), equal, s**2 - ca.sum1(U**2).T, guess, n) * model.delta_v_m_s


def collocated_delta_v(case: PlanCase, n: int, bound_points: int) -> float:
    """Least velocity increment, m/s, of Benson's transcription with n Legendre-Gauss nodes.

    The bound on the control polynomial holds at both ends and at a Gauss rule of ``bound_points`` points a
    node, which also gives the integral.
    """
    from scipy.interpolate import BarycentricInterpolator

    model = scaled(case)
    nodes, weights = np.polynomial.legendre.leggauss(n)
    support = np.concatenate([[-1.0], nodes])
    basis = BarycentricInterpolator(support, np.eye(n + 1))
    D = basis.derivative(nodes)
    fine, fine_weights = np.polynomial.legendre.leggauss(bound_points * n)
    points = np.concatenate([[-1.0], fine, [1.0]])
    C = BarycentricInterpolator(nodes, np.eye(n))(points)
    cost = 0.5 * np.concatenate([[0.0], fine_weights, [0.0]])
    R, V, U, s = (
        ca.SX.sym(name, *size)
        for name, size in (("R", (n + 1, 3)), ("V", (n + 1, 3)), ("U", (n, 3)), ("s", (len(points),)))
    )
    f = [model.rates(R[k + 1, :].T, V[k + 1, :].T, U[k, :].T) for k in range(n)]
    r_rate, v_rate = (ca.horzcat(*(one[k] for one in f)).T for k in (0, 1))
    equal = [ca.vec(D @ R - 0.5 * r_rate), ca.vec(D @ V - 0.5 * v_rate)]
    equal += [ca.vertcat(R[0, :].T, V[0, :].T) - ca.DM(model.start)]
    for state, rate in ((R, r_rate), (V, v_rate)):
        equal.append(state[0, :].T + 0.5 * (rate.T @ weights))
    x = ca.vertcat(ca.vec(R), ca.vec(V), ca.vec(U), s)
    left = 0.5 * (1.0 - support)
    guess = np.concatenate(
        [np.outer(model.start[:3], left).ravel(), np.zeros(6 * n + 3), np.full(len(points), 0.5)]
    )
    thrust = s**2 - ca.sum2((C @ U) ** 2)
    return solve(x, ca.dot(ca.DM(cost), s), equal, thrust, guess, len(points)) * model.delta_v_m_s
