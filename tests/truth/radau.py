"""The same problem by another transcription: Radau collocation of degree 3, to check Hermite-Simpson."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
from collocation import IPOPT, RHO, Local
from problem import Problem, descent_function, final_stage_function, symbols

DEGREE = 3


def nodes_and_matrices() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radau points in (0, 1], the differentiation matrix with 0 in front, and the quadrature weights."""
    points = np.array(ca.collocation_points(DEGREE, "radau"))
    tau = np.concatenate([[0.0], points])
    D = np.zeros((DEGREE + 1, DEGREE))
    for j in range(DEGREE + 1):
        basis = np.poly1d([1.0])
        for i in range(DEGREE + 1):
            if i != j:
                basis *= np.poly1d([1.0, -tau[i]]) / (tau[j] - tau[i])
        D[j] = np.polyder(basis)(points)
    weights = np.linalg.solve(np.vander(points, increasing=True).T, 1 / np.arange(1, DEGREE + 1))
    return points, D, weights


@lru_cache(maxsize=4)
def program(kind: str, n: int) -> tuple[ca.Function, dict[str, object]]:
    """The nonlinear program: n intervals, controls at the collocation points only."""
    p, part = symbols()
    f, final = descent_function(kind), final_stage_function(kind)
    _, D, weights = nodes_and_matrices()
    k, h = DEGREE * n + 1, 1.0 / n
    X, U, tau = ca.SX.sym("X", 7, k), ca.SX.sym("U", 3, k - 1), ca.SX.sym("tau")
    dynamics, j1 = [X[:, 0] - ca.vertcat(part["r0"], part["v0"], 1.0)], 0
    for i in range(n):
        block = X[:, DEGREE * i : DEGREE * (i + 1) + 1]
        slopes = block @ ca.DM(D)
        for c in range(DEGREE):
            u = U[:, DEGREE * i + c]
            dynamics.append(slopes[:, c] - h * f(block[:, c + 1], u, p, 0))
            j1 += h * weights[c] * ca.dot(u, u) / 2
    ratios, cone, j2 = final(X[:, -1], p, 0)
    thrust = [ca.sumsqr(U[:, i]) - tau**2 for i in range(k - 1)]
    thrust += [ca.sumsqr(ratios[:, i]) - tau**2 for i in range(ratios.shape[1])]
    ellipsoid = [ca.sumsqr(X[:3, i] / part["semi_axes"]) - 1 for i in range(1, k)]
    j = j1 / (1 + part["t_final"]) + j2
    arrival = -ca.dot(X[:3, -1] / part["semi_axes"] ** 2, X[3:6, -1])
    blocks = [ca.vertcat(*dynamics), ca.vertcat(*thrust), ca.vertcat(*ellipsoid), ca.vertcat(cone, arrival)]
    edges = np.cumsum([b.shape[0] for b in blocks])
    z = ca.vertcat(ca.vec(X), ca.vec(U), tau)
    nlp = {"x": z, "p": p, "f": part["weight_tau"] * tau + part["weight_j"] * j, "g": ca.vertcat(*blocks)}
    solver = ca.nlpsol("radau", "ipopt", nlp, IPOPT)
    return solver, {"edges": edges, "j": ca.Function("measure", [z, p], [j])}


def solve(problem: Problem, n: int, mode: str, start: Local) -> tuple[str, float, float]:
    """Solve from a Hermite-Simpson path; returns status, tau, J (m2/s3)."""
    solver, info = program(problem.gravity[0], n)
    points, _, _ = nodes_and_matrices()
    times = (np.arange(n)[:, None] + points).ravel() / n
    old = np.linspace(0, 1, len(start.x))
    x = np.column_stack([np.interp(np.concatenate([[0.0], times]), old, c) for c in start.x.T])
    u = np.column_stack([np.interp(times, old, c) for c in start.u.T])
    k, (dynamics, thrust, ellipsoid, count) = DEGREE * n + 1, info["edges"]
    lower, upper = np.zeros(count), np.zeros(count)
    lower[dynamics:thrust] = -np.inf
    upper[thrust:] = np.inf
    if problem.handover == "on_ellipsoid":
        upper[ellipsoid - 1] = 0.0
    else:
        lower[-1] = -np.inf
    size = 7 * k + 3 * (k - 1) + 1
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    low[-1], high[-1] = (0.0, np.inf) if mode == "tau" else (1.0, 1.0)
    p = problem.parameters(*((1.0, RHO) if mode == "tau" else (0.0, 1.0)))
    guess = np.concatenate([x.ravel(), u.ravel(), [start.tau if mode == "tau" else 1.0]])
    out = solver(x0=guess, p=p, lbx=low, ubx=high, lbg=lower, ubg=upper)
    z = np.array(out["x"]).ravel()
    return solver.stats()["return_status"], float(z[-1]), float(info["j"](z, p)) * problem.j_scale
