"""Hermite-Simpson collocation of one facet's landing (CasADi + IPOPT), from several starts.

Two questions, one program: the least thrust level tau (|T| <= tau T_max in both stages), and the least
J at tau = 1. The control is free, so arcs along the ellipsoid are found where they pay.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
from problem import (
    CORRECTION,
    THRUST_SAMPLES,
    Problem,
    arc_positions,
    descent_function,
    final_stage_function,
    symbols,
)

CONVERGED = 2e-4  # relative change of tau or J by doubling the intervals
DOUBLINGS = 3
ARC_SAMPLES = 64  # of the final arc, kept out of a boulder
RHO = 1e-5  # weight of J beside tau: picks one of many controls, and moves tau by less than RHO
IPOPT = {
    "print_time": False,
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-8,
    "ipopt.acceptable_tol": 1e-6,
    "ipopt.acceptable_iter": 10,
    "ipopt.max_iter": 400,
    "ipopt.mu_strategy": "adaptive",
    "ipopt.fixed_variable_treatment": "make_parameter",
}


@dataclass(frozen=True)
class Local:
    """One local solution. Nodes and midpoints alternate: x (2N+1, 7), u (2N+1, 3), scaled."""

    status: str
    tau: float
    j: float  # m2/s3
    x: np.ndarray
    u: np.ndarray
    margin: float  # least r'Re r - 1 over nodes and midpoints
    ellipsoid_force: float  # sum of the ellipsoid's multipliers
    residual: float  # largest scaled constraint violation

    @property
    def solved(self) -> bool:
        return self.status in ("Solve_Succeeded", "Solved_To_Acceptable_Level") and self.residual < 1e-6


@lru_cache(maxsize=8)
def program(
    kind: str, n: int, boulder: tuple[float, ...] | None = None
) -> tuple[ca.Function, dict[str, slice]]:
    """The nonlinear program over n Hermite-Simpson intervals, and the rows of its constraints."""
    p, part = symbols()
    f, final = descent_function(kind), final_stage_function(kind)
    k, h = 2 * n + 1, 1.0 / n
    X, U, tau = ca.SX.sym("X", 7, k), ca.SX.sym("U", 3, k), ca.SX.sym("tau")
    free, places = kind != "polyhedron", k + THRUST_SAMPLES
    C = ca.SX.zeros(CORRECTION, places) if free else ca.SX.sym("C", CORRECTION, places)
    rates = [f(X[:, i], U[:, i], p, C[:, i]) for i in range(k)]
    defects, j1 = [], 0
    for i in range(0, k - 1, 2):
        a, m, b = rates[i], rates[i + 1], rates[i + 2]
        defects.append(X[:, i + 2] - X[:, i] - h / 6 * (a + 4 * m + b))
        defects.append(X[:, i + 1] - (X[:, i] + X[:, i + 2]) / 2 - h / 8 * (a - b))
        squares = [ca.dot(U[:, i + c], U[:, i + c]) for c in range(3)]
        j1 += h / 12 * (squares[0] + 4 * squares[1] + squares[2])
    ratios, cone, j2 = final(X[:, -1], p, C[:, k:])
    thrust = [ca.dot(U[:, i], U[:, i]) - tau**2 for i in range(k)]
    thrust += [ca.dot(ratios[:, i], ratios[:, i]) - tau**2 for i in range(ratios.shape[1])]
    ellipsoid = [ca.sumsqr(X[:3, i] / part["semi_axes"]) - 1 for i in range(1, k)]
    j = j1 / (1 + part["t_final"]) + j2
    arc = arc_positions(X[:, -1], part, ARC_SAMPLES)
    start = X[:, 0] - ca.vertcat(part["r0"], part["v0"], 1.0)
    blocks = {
        "dynamics": ca.vertcat(start, *defects),
        "thrust": ca.vertcat(*thrust),
        "ellipsoid": ca.vertcat(*ellipsoid),
        "cone": cone,
        "boulder": _outside(boulder, [*(X[:3, i] for i in range(1, k)), *arc]),
        "arrival": -ca.dot(X[:3, -1] / part["semi_axes"] ** 2, X[3:6, -1]),
    }
    rows, at = {}, 0
    for name, block in blocks.items():
        rows[name] = slice(at, at + block.shape[0])
        at += block.shape[0]
    nlp = {
        "x": ca.vertcat(ca.vec(X), ca.vec(U), tau),
        "p": p if free else ca.vertcat(p, ca.vec(C)),
        "f": part["weight_tau"] * tau + part["weight_j"] * j,
        "g": ca.vertcat(*blocks.values()),
    }
    measure = ca.Function("measure", [nlp["x"], nlp["p"]], [j])
    return ca.nlpsol("hs", "ipopt", nlp, IPOPT), {"rows": rows, "count": at, "j": measure}


def _outside(boulder: tuple[float, ...] | None, points: list[ca.SX]) -> ca.SX:
    """Values that are not negative where points lie outside a sphere; none without one."""
    if boulder is None:
        return ca.SX(0, 1)
    return ca.vertcat(*[ca.sumsqr(p - ca.DM(boulder[:3])) - boulder[3] ** 2 for p in points])


def solve(
    problem: Problem,
    n: int,
    mode: str,
    x: np.ndarray,
    u: np.ndarray,
    tau: float,
    correction: np.ndarray | None = None,
) -> Local:
    """One local solve in mode ``tau`` or ``j`` from the given start; the correction is that of `uniform`."""
    solver, info = program(problem.gravity[0], n, problem.scaled_boulder)
    k, rows = 2 * n + 1, info["rows"]
    lower, upper = np.zeros(info["count"]), np.zeros(info["count"])
    lower[rows["thrust"]] = -np.inf
    upper[rows["ellipsoid"]] = upper[rows["cone"]] = upper[rows["arrival"]] = np.inf
    upper[rows["boulder"]] = np.inf
    if problem.handover == "on_ellipsoid":  # reached from outside: between nodes the path could cheat
        upper[rows["ellipsoid"].stop - 1] = 0.0
    else:
        lower[rows["arrival"]] = -np.inf
    size = 10 * k + 1
    low, high = np.full(size, -np.inf), np.full(size, np.inf)
    low[6 : 7 * k : 7], high[6 : 7 * k : 7] = 0.2, 1.0 + 1e-9
    low[-1], high[-1] = (0.0, np.inf) if mode == "tau" else (1.0, 1.0)
    p = problem.parameters(*((1.0, RHO) if mode == "tau" else (0.0, 1.0)))
    if problem.gravity[0] == "polyhedron":
        none = np.zeros((k + THRUST_SAMPLES, CORRECTION))
        p = np.concatenate([p, (none if correction is None else correction).ravel()])
    guess = np.concatenate([x.ravel(), u.ravel(), [tau if mode == "tau" else 1.0]])
    out = solver(x0=guess, p=p, lbx=low, ubx=high, lbg=lower, ubg=upper)
    z, g = np.array(out["x"]).ravel(), np.array(out["g"]).ravel()
    x, u = z[: 7 * k].reshape(k, 7), z[7 * k : 10 * k].reshape(k, 3)
    residual = float(np.max(np.maximum(lower - g, g - upper), initial=0.0))
    force = -np.array(out["lam_g"]).ravel()[rows["ellipsoid"]]
    return Local(
        status=solver.stats()["return_status"],
        tau=float(z[-1]),
        j=float(info["j"](z, p)) * problem.j_scale,
        x=x,
        u=u,
        margin=float(np.min(g[rows["ellipsoid"]])),
        ellipsoid_force=float(np.sum(np.maximum(force, 0.0))),
        residual=residual,
    )


def start_through(problem: Problem, n: int, waypoint: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """States and thrust along a smooth path to above the facet, by way of a point (m) if one is given."""
    r0, r_c, normal = (np.array(a) for a in (problem.r0, problem.r_c, problem.normal))
    semi = np.array(problem.semi_axes)
    reach = 0.25 * problem.thrust / problem.mass * problem.t_final**2
    steps = np.linspace(0.05, 4.0, 80) * min(reach, float(semi.min()))
    above = r_c + steps[:, None] * normal
    outside = np.sum((above / semi) ** 2, axis=1) > 1.01
    end = above[np.argmax(outside)] if outside.any() else r_c * 1.1 / np.linalg.norm(r_c / semi)
    t = np.linspace(0.0, 1.0, 2 * n + 1)
    sigma = (t**2 * (3 - 2 * t))[:, None]
    if waypoint is None:
        path = (1 - sigma) * r0 + sigma * end
    else:
        middle = 2 * waypoint - 0.5 * (r0 + end)
        path = (1 - sigma) ** 2 * r0 + 2 * sigma * (1 - sigma) * middle + sigma**2 * end
    depth = np.linalg.norm(path / semi, axis=1)
    path = path * np.maximum(1.0, 1.02 / depth)[:, None]
    x = np.ones((2 * n + 1, 7))
    x[:, :3] = path / problem.length
    x[:, 3:6] = np.gradient(x[:, :3], t, axis=0)
    force = np.gradient(x[:, 3:6], t, axis=0)
    a_max = problem.thrust / problem.mass * problem.time**2 / problem.length
    u = force / a_max
    u /= np.maximum(1.0, np.linalg.norm(u, axis=1))[:, None]
    return x, u


def starts(problem: Problem, n: int, rng: np.random.Generator) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Starts: straight, over four sides of the ellipsoid, and through random points."""
    r0, r_c, semi = np.array(problem.r0), np.array(problem.r_c), np.array(problem.semi_axes)
    a, b = r0 / np.linalg.norm(r0), r_c / np.linalg.norm(r_c)
    across = b - np.dot(a, b) * a
    if np.linalg.norm(across) < 1e-3:
        across = np.cross(a, [0.3, 0.5, 0.8])
    across /= np.linalg.norm(across)
    beside = np.cross(a, across)
    found = {"straight": start_through(problem, n, None)}
    directions = {
        "near": a + b if np.linalg.norm(a + b) > 0.2 else across,
        "far": -across + 0.3 * (a + b),
        "left": beside + 0.5 * (a + b),
        "right": -beside + 0.5 * (a + b),
        **{f"random {i}": rng.normal(size=3) for i in range(3)},
    }
    for name, direction in directions.items():
        direction = direction / np.linalg.norm(direction)
        surface = direction / np.linalg.norm(direction / semi)
        found[name] = start_through(problem, n, 1.25 * surface)
    return found


def refine(path: Local, n: int) -> tuple[np.ndarray, np.ndarray]:
    """The path on twice as many intervals, by linear interpolation, as a start."""
    old, new = np.linspace(0, 1, len(path.x)), np.linspace(0, 1, 2 * n + 1)
    x = np.column_stack([np.interp(new, old, c) for c in path.x.T])
    u = np.column_stack([np.interp(new, old, c) for c in path.u.T])
    return x, u


@dataclass(frozen=True)
class Answer:
    """The best over the starts: on the last number of intervals and on half as many."""

    half: Local | None
    best: Local | None
    statuses: str  # one letter a start: value reached (=best b, worse w), or failed f
    gravity_error: float = 0.0  # left along the best path, of T_max / m0


def _value(path: Local, mode: str) -> float:
    return path.tau if mode == "tau" else path.j


def _as_it_is(_intervals: int, path: Local) -> tuple[Local, float]:
    return path, 0.0


def _worth_correcting(paths: dict[str, Local], mode: str) -> list[str]:
    """Starts whose paths are among the best three that differ, under the gravity that is corrected."""
    chosen: list[str] = []
    for name in sorted((n for n, p in paths.items() if p.solved), key=lambda n: _value(paths[n], mode)):
        if all(_value(paths[name], mode) > _value(paths[c], mode) * (1 + 1e-4) for c in chosen):
            chosen.append(name)
    return chosen[:3]


def best_over_starts(
    problem: Problem,
    n: int,
    mode: str,
    rng: np.random.Generator,
    extra: dict[str, tuple[np.ndarray, np.ndarray]] | None = None,
    names: tuple[str, ...] | None = None,
) -> Answer:
    """Solve from every start on n intervals, and the best again on 2n, 4n, 8n until it has converged."""
    guesses = starts(problem, n, rng) | (extra or {})
    if names is not None:
        guesses = {k: v for k, v in guesses.items() if k in names or k in (extra or {})}
    paths = {name: solve(problem, n, mode, x, u, 1.2) for name, (x, u) in guesses.items()}
    finish: Callable[[int, Local], tuple[Local, float]] = _as_it_is
    if problem.gravity[0] == "polyhedron":
        from uniform import corrected

        def finish(intervals: int, path: Local) -> tuple[Local, float]:
            return corrected(problem, intervals, mode, path)

        before = dict(paths)
        paths |= {name: finish(n, paths[name])[0] for name in _worth_correcting(paths, mode)}
        good = [paths[name] for name in _worth_correcting(before, mode) if paths[name].solved]
    else:
        good = [p for p in paths.values() if p.solved]
    if not good:
        return Answer(None, None, "f" * len(paths))
    coarse = min(good, key=lambda p: _value(p, mode))
    limit = _value(coarse, mode) * (1 + 1e-4)
    letters = ["f" if not p.solved else "b" if _value(p, mode) <= limit else "w" for p in paths.values()]
    levels, left = [coarse], np.nan
    for k in range(1, DOUBLINGS + 1):
        finer = solve(problem, n * 2**k, mode, *refine(levels[-1], n * 2**k), levels[-1].tau)
        finer, error = finish(n * 2**k, finer)
        if not finer.solved:
            break
        levels.append(finer)
        left = error
        if abs(_value(levels[-2], mode) / _value(finer, mode) - 1) < CONVERGED:
            break
    return Answer(levels[-2] if len(levels) > 1 else coarse, levels[-1], "".join(letters), left)
