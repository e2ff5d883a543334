"""Re-fly a collocated path with scipy's DOP853 in SI units, with gravity written once more by hand."""

from __future__ import annotations

import numpy as np
from collocation import Local
from problem import STANDARD_GRAVITY, Problem
from scipy.integrate import solve_ivp


def gravity(problem: Problem, r: np.ndarray) -> np.ndarray:
    """Acceleration of gravity, closed form (not a derivative of the potential)."""
    kind, gm, *rest = problem.gravity
    if kind == "polyhedron":
        from uniform import pull

        return pull(problem, r)[0][0]
    d = np.linalg.norm(r)
    if kind == "dipole":
        fraction, separation = rest
        plus = r - np.array([(1 - fraction) * separation, 0, 0])
        minus = r + np.array([fraction * separation, 0, 0])
        pull = (
            fraction * plus / np.linalg.norm(plus) ** 3 + (1 - fraction) * minus / np.linalg.norm(minus) ** 3
        )
        return -gm * pull
    total = -gm * r / d**3
    if kind == "harmonics":
        radius, c20, c22, s22 = rest
        x, y, z = r
        q = c20 * (3 * z**2 - d**2) / 2 + 3 * c22 * (x**2 - y**2) + 6 * s22 * x * y
        dq = np.array(
            [-c20 * x + 6 * c22 * x + 6 * s22 * y, -c20 * y - 6 * c22 * y + 6 * s22 * x, 2 * c20 * z]
        )
        total = total + gm * radius**2 * (dq / d**5 - 5 * q * r / d**7)
    return total


def refly(problem: Problem, path: Local) -> dict[str, float]:
    """Defects at handover, and the limits between the nodes (thrust over tau, ellipsoid margin)."""
    n, T = (len(path.x) - 1) // 2, problem.time
    h, w = T / n, np.array([0.0, 0.0, problem.omega])
    # a polyhedron takes milliseconds a point: its flights are checked to millimetres only
    precision = (
        {"rtol": 1e-8, "atol": 1e-6} if problem.gravity[0] == "polyhedron" else {"rtol": 1e-11, "atol": 1e-9}
    )
    y = np.concatenate([problem.r0, problem.v0, [problem.mass]])
    semi, peak, margin = np.array(problem.semi_axes), 0.0, np.inf

    def thrust(i: int, s: float) -> np.ndarray:
        a, m, b = path.u[2 * i : 2 * i + 3]
        return problem.thrust * (a * (1 - s) * (1 - 2 * s) + 4 * m * s * (1 - s) + b * s * (2 * s - 1))

    for i in range(n):

        def rate(t: float, y: np.ndarray, i: int = i) -> np.ndarray:
            force = thrust(i, t / h)
            r, v = y[:3], y[3:6]
            natural = gravity(problem, r) - 2 * np.cross(w, v) - np.cross(w, np.cross(w, r))
            flow = np.linalg.norm(force) / (problem.isp * STANDARD_GRAVITY)
            return np.concatenate([v, natural + force / y[6], [-flow]])

        leg = solve_ivp(rate, (0, h), y, method="DOP853", **precision, dense_output=True)
        y = leg.y[:, -1]
        for s in np.linspace(0.1, 1, 10):
            peak = max(peak, float(np.linalg.norm(thrust(i, s))) / problem.thrust)
            margin = min(margin, float(np.sum((leg.sol(s * h)[:3] / semi) ** 2)) - 1)
    end = path.x[-1] * np.array([problem.length] * 3 + [problem.length / T] * 3 + [problem.mass])
    return {
        "position_m": float(np.linalg.norm(y[:3] - end[:3])),
        "velocity_m_s": float(np.linalg.norm(y[3:6] - end[3:6])),
        "peak_over_tau": peak / path.tau,
        "margin": margin,
    }
