"""The descent stage flown under piecewise-constant thrust, and how its end answers to each interval.

Within an interval of length h the acceleration is taken constant, with mass and gravity at the midpoint:
exact for constant acceleration, second order in h for gravity (whose change within an interval is tiny).
What this leaves out is measured by an accurate integration and handed back as ``defect``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel import kernel, part
from landing_cli.kernel_record import by_reference
from landing_cli.reach.scaled_case import ScaledCase, gravity_and_gradient, gravity_in_space

Floats = NDArray[np.float64]

# Steps in each interval of an accurate flight: its middle is a sample.
SUBSTEPS = 2


@by_reference
class Path(NamedTuple):
    """A descent flown through N intervals (scaled units, solver axes)."""

    position: Floats  # (N + 1, 3) at the interval ends
    velocity: Floats  # (N + 1, 3)
    mass: Floats  # (N + 1,)
    gradient: Floats  # (N, 6) of gravity at the midpoints
    defect: Floats  # (6,) added to the last position and velocity
    samples: Floats  # (N + 1, 7) scratch space of the accurate flight


def new_path(n_intervals: int) -> Path:
    """A zeroed path."""
    return Path(
        np.zeros((n_intervals + 1, 3)),
        np.zeros((n_intervals + 1, 3)),
        np.ones(n_intervals + 1),
        np.zeros((n_intervals, 6)),
        np.zeros(6),
        np.zeros((n_intervals + 1, 7)),
    )


@kernel
def fly(case: ScaledCase, thrust: Floats, path: Path) -> None:
    """Fly the descent stage from the initial state under ``thrust`` (N, 3), filling ``path``."""
    n = thrust.shape[0]
    h = 1.0 / n
    x, y, z = case.position[0], case.position[1], case.position[2]
    vx, vy, vz = case.velocity[0], case.velocity[1], case.velocity[2]
    gx = gy = gz = 0.0
    mass = 1.0
    path.position[0, 0], path.position[0, 1], path.position[0, 2] = x, y, z
    path.velocity[0, 0], path.velocity[0, 1], path.velocity[0, 2] = vx, vy, vz
    path.mass[0] = mass
    for k in range(n):
        Fx, Fy, Fz = thrust[k, 0], thrust[k, 1], thrust[k, 2]
        used = case.mass_flow * h * math.sqrt(Fx * Fx + Fy * Fy + Fz * Fz)
        inverse = 1.0 / (mass - 0.5 * used)
        half, eighth = 0.5 * h, 0.125 * h * h
        gx, gy, gz, xx, yy, zz, xy, xz, yz = gravity_and_gradient(
            case,
            case.mid_cos[k],
            case.mid_sin[k],
            x + half * vx + eighth * (Fx * inverse + gx),
            y + half * vy + eighth * (Fy * inverse + gy),
            z + half * vz + eighth * (Fz * inverse + gz),
        )
        G = path.gradient[k]
        G[0], G[1], G[2], G[3], G[4], G[5] = xx, yy, zz, xy, xz, yz
        ax, ay, az = Fx * inverse + gx, Fy * inverse + gy, Fz * inverse + gz
        x += h * (vx + half * ax)
        y += h * (vy + half * ay)
        z += h * (vz + half * az)
        vx += h * ax
        vy += h * ay
        vz += h * az
        mass -= used
        path.position[k + 1, 0], path.position[k + 1, 1], path.position[k + 1, 2] = x, y, z
        path.velocity[k + 1, 0], path.velocity[k + 1, 1], path.velocity[k + 1, 2] = vx, vy, vz
        path.mass[k + 1] = mass
    for i in range(3):
        path.position[n, i] += path.defect[i]
        path.velocity[n, i] += path.defect[3 + i]


@part
def pull_back(
    path: Path, end: int, p0: float, p1: float, p2: float, q0: float, q1: float, q2: float, row: Floats
) -> tuple[float, float, float, float, float, float]:
    """Derivative of p . r(t_end) + q . v(t_end) with respect to every thrust interval.

    The adjoint of :func:`fly` run backwards from node ``end``; mass is held.

    Parameters
    ----------
    path : Path
        A flown path.
    end : int
        Node at which p and q apply.
    p0, p1, p2, q0, q1, q2 : float
        Weights of position and velocity.
    row : (N, 3) float
        Filled for the intervals before ``end``.

    Returns
    -------
    p0, p1, p2, q0, q1, q2 : float
        The weights carried back to the start: derivatives with respect to the initial state.
    """
    h = 1.0 / row.shape[0]
    half = 0.5 * h
    for k in range(end - 1, -1, -1):
        G = path.gradient[k]
        d0, d1, d2 = h * (half * p0 + q0), h * (half * p1 + q1), h * (half * p2 + q2)
        inverse = 2.0 / (path.mass[k] + path.mass[k + 1])
        row[k, 0], row[k, 1], row[k, 2] = d0 * inverse, d1 * inverse, d2 * inverse
        g0 = G[0] * d0 + G[3] * d1 + G[4] * d2
        g1 = G[3] * d0 + G[1] * d1 + G[5] * d2
        g2 = G[4] * d0 + G[5] * d1 + G[2] * d2
        q0 += h * p0 + half * g0
        q1 += h * p1 + half * g1
        q2 += h * p2 + half * g2
        p0 += g0
        p1 += g1
        p2 += g2
    return p0, p1, p2, q0, q1, q2


@part
def fly_accurately(case: ScaledCase, thrust: Floats, samples: Floats) -> None:
    """Fly the descent stage by Runge-Kutta 4, with exact mass, in the same number of steps an interval.

    Parameters
    ----------
    case : ScaledCase
        The case.
    thrust : (N, 3) float
        Constant within each interval, solver axes.
    samples : (N steps + 1, 7) float
        Filled with position, velocity (solver axes) and mass at the step ends.
    """
    n = thrust.shape[0]
    substeps = (samples.shape[0] - 1) // n
    h = 1.0 / (n * substeps)
    s = np.empty(7)
    for i in range(3):
        s[i], s[3 + i] = case.position[i], case.velocity[i]
    s[6] = 1.0
    for i in range(7):
        samples[0, i] = s[i]
    # the body's angle at the start and at the middle and end of each step, turned on by half a step
    old_c, old_s = math.cos(case.spin), -math.sin(case.spin)
    turn_c, turn_s = math.cos(0.5 * h * case.spin), math.sin(0.5 * h * case.spin)
    row = 0
    for k in range(n):
        Fx, Fy, Fz = thrust[k, 0], thrust[k, 1], thrust[k, 2]
        flow = case.mass_flow * math.sqrt(Fx * Fx + Fy * Fy + Fz * Fz)
        for _ in range(substeps):
            mid_c, mid_s = old_c * turn_c - old_s * turn_s, old_s * turn_c + old_c * turn_s
            end_c, end_s = mid_c * turn_c - mid_s * turn_s, mid_s * turn_c + mid_c * turn_s
            mid, end = s[6] - 0.5 * h * flow, s[6] - h * flow
            g0, g1, g2 = gravity_in_space(case, old_c, old_s, s[0], s[1], s[2])
            a0, a1, a2 = g0 + Fx / s[6], g1 + Fy / s[6], g2 + Fz / s[6]
            x0, x1, x2 = s[0] + 0.5 * h * s[3], s[1] + 0.5 * h * s[4], s[2] + 0.5 * h * s[5]
            g0, g1, g2 = gravity_in_space(case, mid_c, mid_s, x0, x1, x2)
            b0, b1, b2 = g0 + Fx / mid, g1 + Fy / mid, g2 + Fz / mid
            q = 0.25 * h * h
            g0, g1, g2 = gravity_in_space(case, mid_c, mid_s, x0 + q * a0, x1 + q * a1, x2 + q * a2)
            c0, c1, c2 = g0 + Fx / mid, g1 + Fy / mid, g2 + Fz / mid
            q = 0.5 * h * h
            x0, x1, x2 = s[0] + h * s[3] + q * b0, s[1] + h * s[4] + q * b1, s[2] + h * s[5] + q * b2
            g0, g1, g2 = gravity_in_space(case, end_c, end_s, x0, x1, x2)
            d0, d1, d2 = g0 + Fx / end, g1 + Fy / end, g2 + Fz / end
            q = h * h / 6.0
            s[0] += h * s[3] + q * (a0 + b0 + c0)
            s[1] += h * s[4] + q * (a1 + b1 + c1)
            s[2] += h * s[5] + q * (a2 + b2 + c2)
            q = h / 6.0
            s[3] += q * (a0 + 2.0 * (b0 + c0) + d0)
            s[4] += q * (a1 + 2.0 * (b1 + c1) + d1)
            s[5] += q * (a2 + 2.0 * (b2 + c2) + d2)
            s[6] = end
            old_c, old_s = end_c, end_s
            row += 1
            for i in range(7):
                samples[row, i] = s[i]


@part
def measure_defect(case: ScaledCase, thrust: Floats, path: Path) -> None:
    """Set ``path.defect`` to what an accurate flight of ``thrust`` adds to :func:`fly`'s end state."""
    n = thrust.shape[0]
    path.defect[:] = 0.0
    fly(case, thrust, path)
    fly_accurately(case, thrust, path.samples)
    for i in range(3):
        path.defect[i] = path.samples[n, i] - path.position[n, i]
        path.defect[3 + i] = path.samples[n, 3 + i] - path.velocity[n, i]
