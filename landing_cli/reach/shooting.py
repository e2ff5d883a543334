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

from landing_cli.kernel import part
from landing_cli.kernel_lanes import WIDTH, any_lane, choose, new_lanes, with_lane
from landing_cli.kernel_record import by_reference
from landing_cli.optimize.conic_records import New
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
    lever: Floats  # (N + 1, 18) derivative of the last position and velocity by the velocity at each node
    to_start: Floats  # (6, 6) and by position and velocity at the start


def new_path(n_intervals: int, new: New = np.zeros) -> Path:
    """A zeroed path, of arrays that ``new`` makes."""
    return Path(
        new((n_intervals + 1, 3)),
        new((n_intervals + 1, 3)),
        new(n_intervals + 1),
        new((n_intervals, 6)),
        new(6),
        new((n_intervals + 1, 7)),
        new((n_intervals + 1, 18)),
        new((6, 6)),
    )


@part
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
def pull_back(path: Path, basis: Floats) -> None:
    """Derivatives of the last position and velocity with respect to every thrust interval.

    The adjoint of :func:`fly` run backwards; mass is held. With weights p of the position and q of the
    velocity at a node, an interval drifts (q += h p / 2), kicks (p += G h q) and drifts again: a symplectic
    map, since gravity's gradient G is symmetric.

    Parameters
    ----------
    path : Path
        A flown path; its levers are filled.
    basis : (N, B, 3) float
        The first six of B are filled: position, then velocity.
    """
    n = path.gradient.shape[0]
    h = 1.0 / n
    half = 0.5 * h
    lever, mass, gradient = path.lever, path.mass, path.gradient
    for i in range(6):
        p0, q0 = 1.0 if i == 0 else 0.0, 1.0 if i == 3 else 0.0
        p1, q1 = 1.0 if i == 1 else 0.0, 1.0 if i == 4 else 0.0
        p2, q2 = 1.0 if i == 2 else 0.0, 1.0 if i == 5 else 0.0
        lever[n, 3 * i], lever[n, 3 * i + 1], lever[n, 3 * i + 2] = q0, q1, q2
        for k in range(n - 1, -1, -1):
            G = gradient[k]
            d0, d1, d2 = h * (half * p0 + q0), h * (half * p1 + q1), h * (half * p2 + q2)
            inverse = 2.0 / (mass[k] + mass[k + 1])
            basis[k, i, 0], basis[k, i, 1], basis[k, i, 2] = d0 * inverse, d1 * inverse, d2 * inverse
            g0 = G[0] * d0 + G[3] * d1 + G[4] * d2
            g1 = G[3] * d0 + G[1] * d1 + G[5] * d2
            g2 = G[4] * d0 + G[5] * d1 + G[2] * d2
            q0 += h * p0 + half * g0
            q1 += h * p1 + half * g1
            q2 += h * p2 + half * g2
            p0 += g0
            p1 += g1
            p2 += g2
            lever[k, 3 * i], lever[k, 3 * i + 1], lever[k, 3 * i + 2] = q0, q1, q2
        to_start = path.to_start[i]
        to_start[0], to_start[1], to_start[2], to_start[3], to_start[4], to_start[5] = p0, p1, p2, q0, q1, q2


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
    none = choose(thrust[0, 0] > 0.0, 0.0, 0.0)  # numbers that begin as lanes are compiled for lanes alone
    x, y, z = none + case.position[0], none + case.position[1], none + case.position[2]
    vx, vy, vz = none + case.velocity[0], none + case.velocity[1], none + case.velocity[2]
    mass = none + 1.0
    _keep_sample(samples[0], x, y, z, vx, vy, vz, mass)
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
            i0, i1 = 1.0 / mass, 1.0 / (mass - 0.5 * h * flow)
            mass -= h * flow
            i2 = 1.0 / mass
            g0, g1, g2 = gravity_in_space(case, old_c, old_s, x, y, z)
            a0, a1, a2 = g0 + Fx * i0, g1 + Fy * i0, g2 + Fz * i0
            x0, x1, x2 = x + 0.5 * h * vx, y + 0.5 * h * vy, z + 0.5 * h * vz
            g0, g1, g2 = gravity_in_space(case, mid_c, mid_s, x0, x1, x2)
            b0, b1, b2 = g0 + Fx * i1, g1 + Fy * i1, g2 + Fz * i1
            q = 0.25 * h * h
            g0, g1, g2 = gravity_in_space(case, mid_c, mid_s, x0 + q * a0, x1 + q * a1, x2 + q * a2)
            c0, c1, c2 = g0 + Fx * i1, g1 + Fy * i1, g2 + Fz * i1
            q = 0.5 * h * h
            x0, x1, x2 = x + h * vx + q * b0, y + h * vy + q * b1, z + h * vz + q * b2
            g0, g1, g2 = gravity_in_space(case, end_c, end_s, x0, x1, x2)
            d0, d1, d2 = g0 + Fx * i2, g1 + Fy * i2, g2 + Fz * i2
            q = h * h / 6.0
            x += h * vx + q * (a0 + b0 + c0)
            y += h * vy + q * (a1 + b1 + c1)
            z += h * vz + q * (a2 + b2 + c2)
            q = h / 6.0
            vx += q * (a0 + 2.0 * (b0 + c0) + d0)
            vy += q * (a1 + 2.0 * (b1 + c1) + d1)
            vz += q * (a2 + 2.0 * (b2 + c2) + d2)
            old_c, old_s = end_c, end_s
            row += 1
            _keep_sample(samples[row], x, y, z, vx, vy, vz, mass)


@part
def _keep_sample(
    sample: Floats, x: float, y: float, z: float, vx: float, vy: float, vz: float, mass: float
) -> None:
    """Fill one row of samples."""
    sample[0], sample[1], sample[2] = x, y, z
    sample[3], sample[4], sample[5], sample[6] = vx, vy, vz, mass


@by_reference
class Flights(NamedTuple):
    """Accurate flights of as many facets as there are lanes."""

    thrust: Floats  # (N, 3) scaled, solver axes
    samples: Floats  # (steps + 1, 7)
    cosine: NDArray[np.float64]  # (steps + 1,) of the body's angle at the samples, relative to the handover
    sine: NDArray[np.float64]


def new_flights(case: ScaledCase, substeps: int) -> Flights:
    """Room for flights with so many Runge-Kutta steps in each interval of a case."""
    n = len(case.mid_cos)
    angle = case.spin * (np.arange(n * substeps + 1) / (n * substeps) - 1.0)
    return Flights(new_lanes((n, 3)), new_lanes((n * substeps + 1, 7)), np.cos(angle), np.sin(angle))


@part
def fly_some(case: ScaledCase, thrusts: Floats, first: int, flights: Flights) -> None:
    """Fly (n, N, 3) thrusts from the first on accurately, one a lane; the last one fills what is left."""
    for place in range(WIDTH):
        i = min(first + place, thrusts.shape[0] - 1)
        for k in range(thrusts.shape[1]):
            for a in range(3):
                flights.thrust[k, a] = with_lane(flights.thrust[k, a], place, thrusts[i, k, a])
    fly_accurately(case, flights.thrust, flights.samples)


@part
def measure_defect(case: ScaledCase, thrust: Floats, path: Path, asked: bool) -> None:
    """Set ``path.defect`` to what an accurate flight of ``thrust`` adds to :func:`fly`'s end state.

    Lanes that are not asked keep theirs.
    """
    if not any_lane(asked):
        return
    n, defect = thrust.shape[0], path.defect
    for i in range(6):
        defect[i] = choose(asked, 0.0, defect[i])
    fly(case, thrust, path)
    fly_accurately(case, thrust, path.samples)
    for i in range(3):
        end, speed = path.samples[n, i], path.samples[n, 3 + i]
        defect[i] = choose(asked, end - path.position[n, i], defect[i])
        defect[3 + i] = choose(asked, speed - path.velocity[n, i], defect[3 + i])
