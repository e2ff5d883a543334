"""The two-stage landing of one facet, written for the truth alone.

Nothing here is shared with the package: the dynamics, the gravity and the final stage are written
afresh, in the rotating frame, in CasADi symbols, so that an error of the package cannot hide in its oracle.

Scales: length |r0|, time t_p (the descent stage), thrust T_max, mass m0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np

STANDARD_GRAVITY = 9.80665
THRUST_SAMPLES = 33
CORRECTION = 15  # numbers of a correction of gravity: at a place, its slopes there, the place; see uniform.py

# Parameters of the scaled problem, in the order of the parameter vector.
PARAMETERS = {
    "r0": 3, "v0": 3, "r_c": 3, "normal": 3, "semi_axes": 3, "omega": 1, "t_final": 1, "a_max": 1,
    "v_exhaust": 1, "cos_theta": 1, "compensate": 1, "flown_mass": 1, "gravity": 5,
    "weight_tau": 1, "weight_j": 1,
}  # fmt: skip


@dataclass(frozen=True)
class Problem:
    """Every physical input of one facet's problem, SI, rotating body frame.

    ``gravity`` is ``("harmonics", gm, reference_radius, c20, c22, s22)`` (unnormalised, about the centre
    of mass), ``("dipole", gm, mass_fraction, separation)`` (the fraction lies on +x), ``("point", gm)``, or
    ``("polyhedron", gm, mass_fraction, separation, shape, sha256)``: a dipole that is corrected.
    """

    r0: tuple[float, float, float]
    v0: tuple[float, float, float]
    omega: float
    gravity: tuple[Any, ...]
    mass: float
    thrust: float
    isp: float
    tof: float
    t_final: float
    semi_axes: tuple[float, float, float]
    theta: float
    r_c: tuple[float, float, float] = (0.0, 0.0, 0.0)
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)
    handover: str = "outside"
    final_thrust: str = "compensated"
    final_mass: str = "handover"  # mass of the final stage: that of the handover all along, or as "flown"
    boulder: tuple[float, float, float, float] | None = None  # a sphere in the way: centre and radius, m

    def at(self, r_c: np.ndarray, normal: np.ndarray) -> Problem:
        """The same problem for another facet."""
        return replace(self, r_c=tuple(map(float, r_c)), normal=tuple(map(float, normal)))

    @property
    def length(self) -> float:
        return float(np.linalg.norm(self.r0))

    @property
    def scaled_boulder(self) -> tuple[float, ...] | None:
        return None if self.boulder is None else tuple(b / self.length for b in self.boulder)

    @property
    def time(self) -> float:
        return self.tof - self.t_final

    @property
    def j_scale(self) -> float:
        """J in units of (T_max/m0)^2 times the time of flight."""
        return (self.thrust / self.mass) ** 2 * self.tof

    def parameters(self, weight_tau: float, weight_j: float) -> np.ndarray:
        """The scaled parameter vector, in the order of PARAMETERS."""
        L, T = self.length, self.time
        gm = self.gravity[1] * T**2 / L**3
        kind, rest = self.gravity[0], self.gravity[2:]
        if kind == "harmonics":
            gravity = [gm, rest[0] / L, *rest[1:]]
        elif kind in ("dipole", "polyhedron"):
            gravity = [gm, rest[0], rest[1] / L, 0.0, 0.0]
        else:
            gravity = [gm, 0.0, 0.0, 0.0, 0.0]
        values = {
            "r0": np.array(self.r0) / L,
            "v0": np.array(self.v0) * T / L,
            "r_c": np.array(self.r_c) / L,
            "normal": np.array(self.normal),
            "semi_axes": np.array(self.semi_axes) / L,
            "omega": self.omega * T,
            "t_final": self.t_final / T,
            "a_max": self.thrust / self.mass * T**2 / L,
            "v_exhaust": self.isp * STANDARD_GRAVITY * T / L,
            "cos_theta": np.cos(self.theta),
            "compensate": float(self.final_thrust == "compensated"),
            "flown_mass": float(self.final_mass == "flown"),
            "gravity": gravity,
            "weight_tau": weight_tau,
            "weight_j": weight_j,
        }
        return np.concatenate([np.atleast_1d(values[name]).astype(float) for name in PARAMETERS])


def symbols() -> tuple[Any, dict[str, Any]]:
    """The parameter vector as a symbol, and its named parts."""
    vector = ca.SX.sym("p", sum(PARAMETERS.values()))
    parts, start = {}, 0
    for name, size in PARAMETERS.items():
        parts[name] = vector[start : start + size]
        start += size
    return vector, parts


def gravity_function(kind: str, gravity: Any) -> Any:
    """Acceleration of gravity as a CasADi function of position: the gradient of the potential."""
    r = ca.SX.sym("r", 3)
    x, y, z = r[0], r[1], r[2]
    d = ca.sqrt(ca.dot(r, r))
    gm = gravity[0]
    if kind == "harmonics":
        radius, c20, c22, s22 = gravity[1], gravity[2], gravity[3], gravity[4]
        degree2 = c20 * (3 * z**2 - d**2) / 2 + 3 * c22 * (x**2 - y**2) + 6 * s22 * x * y
        potential = gm / d + gm * radius**2 / d**5 * degree2
    elif kind in ("dipole", "polyhedron"):
        fraction, separation = gravity[1], gravity[2]
        plus = ca.sqrt((x - (1 - fraction) * separation) ** 2 + y**2 + z**2)
        minus = ca.sqrt((x + fraction * separation) ** 2 + y**2 + z**2)
        potential = gm * (fraction / plus + (1 - fraction) / minus)
    else:
        potential = gm / d
    c = ca.SX.sym("c", CORRECTION)
    correction = c[:3] + ca.reshape(c[3:12], 3, 3).T @ (r - c[12:])
    return ca.Function("g", [r, gravity, c], [ca.gradient(potential, r) + correction])


def frame_acceleration(omega: Any, r: Any, v: Any) -> Any:
    """Coriolis and centrifugal terms 2 w x v + w x (w x r), spin about +z."""
    return ca.vertcat(-2 * omega * v[1] - omega**2 * r[0], 2 * omega * v[0] - omega**2 * r[1], 0.0)


def arc_positions(x: Any, part: dict[str, Any], samples: int) -> list[Any]:
    """Positions along the final arc from the handover state x, evenly spaced in time, scaled."""
    T = part["t_final"]
    d, v = x[:3] - part["r_c"], x[3:6]
    A, B = 3 * d / T**2 + v / T, -2 * d / T**3 - v / T**2
    return [part["r_c"] + s**2 * (A + B * s) for s in (T * i / samples for i in range(1, samples + 1))]


def descent_function(kind: str) -> Any:
    """State rate f(x, u, p, c) of the descent; x = (r, v, m), u = thrust / T_max, c corrects gravity."""
    p, part = symbols()
    x, u, c = ca.SX.sym("x", 7), ca.SX.sym("u", 3), ca.SX.sym("c", CORRECTION)
    g = gravity_function(kind, part["gravity"])(x[:3], part["gravity"], c)
    acceleration = g - frame_acceleration(part["omega"], x[:3], x[3:6]) + part["a_max"] * u / x[6]
    flow = part["a_max"] / part["v_exhaust"] * ca.sqrt(ca.dot(u, u) + 1e-16)
    return ca.Function("f", [x, u, p, c], [ca.vertcat(x[3:6], acceleration, -flow)])


def final_stage_function(kind: str, samples: int = THRUST_SAMPLES) -> Any:
    """Final stage from the handover state: thrust ratios along the arc, cone margins, J2.

    With time-to-go s, r - r_c = s^2 (A + B s): total acceleration 2A + 6Bs, velocity -(2A + 3Bs) s.
    The mass is that of the handover all along, or falls as the thrust (at the handover's mass, which
    errs by the square of the fall) is spent. The cone margin is taken at both ends of the arc.
    """
    p, part = symbols()
    x, c = ca.SX.sym("x", 7), ca.SX.sym("c", CORRECTION, samples)
    T = part["t_final"]
    d, v = x[:3] - part["r_c"], x[3:6]
    A, B = 3 * d / T**2 + v / T, -2 * d / T**3 - v / T**2
    gravity = gravity_function(kind, part["gravity"])
    ratios = []
    for i, s in enumerate(np.linspace(0.0, 1.0, samples)):
        s = s * T
        position, velocity = part["r_c"] + s**2 * (A + B * s), -s * (2 * A + 3 * B * s)
        natural = gravity(position, part["gravity"], c[:, i]) - frame_acceleration(
            part["omega"], position, velocity
        )
        ratios.append(x[6] / part["a_max"] * (2 * A + 6 * B * s - part["compensate"] * natural))
    sizes = [ca.sqrt(ca.dot(f, f) + 1e-12) for f in ratios]
    used, per_step = 0.0, T / (samples - 1) * part["a_max"] / part["v_exhaust"] / x[6]
    for i in range(samples - 2, -1, -1):  # from handover to touchdown
        used += per_step * (sizes[i] + sizes[i + 1]) / 2
        ratios[i] = ratios[i] * (1 - part["flown_mass"] * used)
    cone = []
    for direction in (2 * A, 2 * (A + B * T)):
        along = direction / part["a_max"]
        size = ca.sqrt(ca.dot(along, along) + 1e-10)
        cone.append(ca.dot(part["normal"], along) - part["cos_theta"] * size)
    j2 = 0.5 * (4 * ca.dot(A, A) * T + 12 * ca.dot(A, B) * T**2 + 12 * ca.dot(B, B) * T**3)
    j2 = j2 / (part["a_max"] ** 2 * (1 + T))
    return ca.Function("final", [x, p, c], [ca.horzcat(*ratios), ca.vertcat(*cone), j2])
