"""What a user would write instead: scipy's SLSQP with finite differences over a compiled RK4."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from bench.shooting_kernel import CHECKS, SIZE, differences, fly
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.reach.records import LandingCase

TOLERANCE = 1e-4  # scaled; a facet is reachable when every constraint holds to this
NODES = 20


@dataclass(frozen=True)
class BaselineAnswer:
    """One facet by the baseline."""

    reachable: bool
    j_m2_s3: float
    flights: int


def scaled_problem(case: LandingCase, facet: int, harmonics: tuple[float, ...]) -> np.ndarray:
    """The kernel's parameter vector; ``harmonics`` is GM, reference radius, C20, C22, S22 (SI)."""
    craft, T = case.spacecraft, case.descent_s
    a0 = craft.thrust_max_n / craft.mass_kg
    L = a0 * T**2
    gm, radius, c20, c22, s22 = harmonics
    scalars = [
        case.asteroid.rotation_rate_rad_s * T,
        craft.exhaust_velocity_m_s * T / L,
        case.final_stage_s / T,
        np.cos(case.glide_slope_half_angle_rad),
        float(case.final_stage_thrust == "compensated"),
        gm * T**2 / L**3,
        radius / L,
        c20,
        c22,
        s22,
    ]
    return np.concatenate(
        [
            case.position_m / L,
            case.velocity_m_s * T / L,
            facet_centroids(case.asteroid.mesh)[facet] / L,
            facet_normals(case.asteroid.mesh)[facet],
            (L / case.ellipsoid_m) ** 2,
            scalars,
        ]
    )


def approximate_costates(p: np.ndarray) -> np.ndarray:
    """Zhao 2022, eq 13, over the whole time of flight from the initial state."""
    t, v, d = 1 + p[17], p[3:6], p[0:3] - p[6:9]
    lr, lv = 6 * (t * v + 2 * d) / t**3, 2 * (2 * t * v + 3 * d) / t**2
    lm = lr @ lr * t**3 / 3 - lr @ lv * t**2 + lv @ lv * t
    return np.concatenate([lr, lv, [lm]])


def approximate_nodes(p: np.ndarray) -> np.ndarray:
    """Thrust of the gravity-free transfer of eq 13 at the middle of every interval."""
    costates = approximate_costates(p)
    times = (np.arange(NODES) + 0.5) / NODES
    thrust = -costates[3:6] + times[:, None] * costates[:3]
    return (thrust / np.maximum(1.0, np.linalg.norm(thrust, axis=1))[:, None]).ravel()


class Flights:
    """Objective, constraints and their differences for SLSQP; the last flights are remembered."""

    def __init__(self, p: np.ndarray, by_nodes: bool, on_ellipsoid: bool) -> None:
        self.p, self.by_nodes, self.on_ellipsoid = p, by_nodes, on_ellipsoid
        self.values: dict[bytes, np.ndarray] = {}
        self.slopes: dict[bytes, np.ndarray] = {}
        self.count = 0

    def value(self, z: np.ndarray) -> np.ndarray:
        """What one guess gives: objective and constraints."""
        key = z.tobytes()
        if key not in self.values:
            if len(self.values) > 200:
                self.values.clear()
            out = np.zeros(SIZE)
            fly(self.p, z, self.by_nodes, out)
            self.values[key] = np.nan_to_num(out, nan=1e3, posinf=1e3, neginf=-1e3)
            self.count += 1
        return self.values[key]

    def slope(self, z: np.ndarray) -> np.ndarray:
        """Finite differences of ``value``, (SIZE, n)."""
        key = z.tobytes()
        if key not in self.slopes:
            self.slopes.clear()
            out = np.zeros((len(z), SIZE))
            differences(self.p, z.copy(), self.by_nodes, self.value(z), out)
            self.slopes[key] = np.ascontiguousarray(np.nan_to_num(out, posinf=0.0, neginf=0.0).T)
            self.count += len(z)
        return self.slopes[key]

    def equalities(self, z: np.ndarray) -> np.ndarray:
        """Constraints that must vanish."""
        rows = [] if self.by_nodes else [1]
        return self.value(z)[rows + [1 + CHECKS] * self.on_ellipsoid]

    def equality_slopes(self, z: np.ndarray) -> np.ndarray:
        """Their differences."""
        rows = [] if self.by_nodes else [1]
        return self.slope(z)[rows + [1 + CHECKS] * self.on_ellipsoid]

    def inequalities(self, z: np.ndarray) -> np.ndarray:
        """Constraints that must not be negative."""
        if not self.by_nodes:
            return self.value(z)[2:].copy()
        return np.concatenate([self.value(z)[2:], 1 - (z.reshape(-1, 3) ** 2).sum(axis=1)])

    def inequality_slopes(self, z: np.ndarray) -> np.ndarray:
        """Their differences."""
        if not self.by_nodes:
            return self.slope(z)[2:].copy()
        thrust = np.zeros((NODES, len(z)))
        for i in range(NODES):
            thrust[i, 3 * i : 3 * i + 3] = -2 * z[3 * i : 3 * i + 3]
        return np.vstack([self.slope(z)[2:], thrust])


def solve(
    case: LandingCase, facet: int, harmonics: tuple[float, ...], unknowns: str, differencing: str
) -> BaselineAnswer:
    """One facet by SLSQP.

    Parameters
    ----------
    case : LandingCase
        The case; its gravity is replaced by ``harmonics``.
    facet : int
        Which facet, 0-based.
    harmonics : tuple of float
        GM, reference radius, C20, C22, S22 (SI).
    unknowns : {"costates", "nodes"}
        The paper's 7 initial costates, or NODES thrust vectors.
    differencing : {"scipy", "compiled"}
        Who takes the finite differences: scipy, one flight a call, or one compiled loop for all.
    """
    p = scaled_problem(case, facet, harmonics)
    by_nodes = unknowns == "nodes"
    flights = Flights(p, by_nodes, case.handover == "on_ellipsoid")
    ours = differencing == "compiled"
    constraints = [
        {"type": "ineq", "fun": flights.inequalities} | ({"jac": flights.inequality_slopes} if ours else {})
    ]
    if not by_nodes or flights.on_ellipsoid:
        constraints.append(
            {"type": "eq", "fun": flights.equalities} | ({"jac": flights.equality_slopes} if ours else {})
        )
    start = approximate_nodes(p) if by_nodes else approximate_costates(p)
    found = minimize(
        lambda z: flights.value(z)[0],
        start,
        jac=(lambda z: flights.slope(z)[0].copy()) if ours else None,
        constraints=constraints,
        method="SLSQP",
        options={"maxiter": 200, "ftol": 1e-8},
    )
    worst = max(-flights.inequalities(found.x).min(), np.abs(flights.equalities(found.x)).max(initial=0.0))
    a0 = case.spacecraft.thrust_max_n / case.spacecraft.mass_kg
    reachable = bool(worst < TOLERANCE and np.isfinite(found.fun))
    return BaselineAnswer(
        reachable, found.fun * a0**2 * case.descent_s if reachable else np.nan, flights.count
    )
