"""Motion of a thrusting point mass in the frame that rotates with the asteroid about +z."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.kernels import acceleration, potential
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]


@kernel
def natural_acceleration(
    kind: GravityKind,
    params: FloatArray,
    w: float,
    x: float,
    y: float,
    z: float,
    vx: float,
    vy: float,
    vz: float,
) -> tuple[float, float, float]:
    """Acceleration without thrust: gravity, Coriolis and centrifugal (Zhao 2022, eq 1).

    Parameters
    ----------
    kind : GravityKind
        Gravity model to fly in.
    params : (p,) float, SI
        Parameters of the gravity model.
    w : float, rad/s
        Spin rate about +z.
    x, y, z : float, m, body frame
        Position.
    vx, vy, vz : float, m/s, relative to the rotating frame
        Velocity.

    Returns
    -------
    tuple of 3 float, m/s2, body frame
    """
    gx, gy, gz = acceleration(kind, params, x, y, z)
    return gx + w * (2.0 * vy + w * x), gy + w * (-2.0 * vx + w * y), gz


@part
def rk4_step(
    kind: GravityKind,
    params: FloatArray,
    w: float,
    ve: float,
    h: float,
    state: FloatArray,
    start: FloatArray,
    middle: FloatArray,
    end: FloatArray,
    out: FloatArray,
) -> None:
    """Advance (r, v, m) by one classical Runge-Kutta step under a thrust of constant magnitude.

    Parameters
    ----------
    kind : GravityKind
        Gravity model to fly in.
    params : (p,) float, SI
        Parameters of the gravity model.
    w : float, rad/s
        Spin rate about +z.
    ve : float, m/s
        Effective exhaust velocity.
    h : float, s
        Step.
    state : (7,) float, m, m/s, kg
        Position, velocity and mass at the start of the step.
    start, middle, end : (3,) float, N, body frame
        Thrust at the start, in the middle and at the end of the step.
    out : (7,) float
        Receives the state after the step; may be ``state`` itself.
    """
    x, y, z, vx, vy, vz, m = state[0], state[1], state[2], state[3], state[4], state[5], state[6]
    dm = -math.sqrt(start[0] * start[0] + start[1] * start[1] + start[2] * start[2]) / ve
    sx = sy = sz = sa = sb = sc = 0.0  # weighted sums of the stage rates
    px = py = pz = pa = pb = pc = 0.0  # rates of the previous stage
    for stage in range(4):
        c = 0.0 if stage == 0 else (1.0 if stage == 3 else 0.5)
        weight = 2.0 if stage == 1 or stage == 2 else 1.0
        force = start if stage == 0 else (end if stage == 3 else middle)
        ux, uy, uz = vx + c * h * pa, vy + c * h * pb, vz + c * h * pc
        ax, ay, az = natural_acceleration(
            kind, params, w, x + c * h * px, y + c * h * py, z + c * h * pz, ux, uy, uz
        )
        mass = m + c * h * dm
        px, py, pz = ux, uy, uz
        pa, pb, pc = ax + force[0] / mass, ay + force[1] / mass, az + force[2] / mass
        sx, sy, sz = sx + weight * px, sy + weight * py, sz + weight * pz
        sa, sb, sc = sa + weight * pa, sb + weight * pb, sc + weight * pc
    sixth = h / 6.0
    out[0], out[1], out[2] = x + sixth * sx, y + sixth * sy, z + sixth * sz
    out[3], out[4], out[5] = vx + sixth * sa, vy + sixth * sb, vz + sixth * sc
    out[6] = m + h * dm


@part
def turn(angle: float, vector: FloatArray, out: FloatArray) -> None:
    """Write a vector turned about +z by an angle (rad) into ``out``."""
    c, s = math.cos(angle), math.sin(angle)
    out[0], out[1], out[2] = c * vector[0] - s * vector[1], s * vector[0] + c * vector[1], vector[2]


@part
def fly_nodes(
    kind: GravityKind,
    params: FloatArray,
    w: float,
    ve: float,
    duration: float,
    nodes: FloatArray,
    steps_per_node: int,
    states: FloatArray,
) -> None:
    """Fly piecewise constant inertial thrust with fixed-step RK4.

    Parameters
    ----------
    kind : GravityKind
        Gravity model to fly in.
    params : (p,) float, SI
        Parameters of the gravity model.
    w : float, rad/s
        Spin rate about +z.
    ve : float, m/s
        Effective exhaust velocity.
    duration : float, s
        Length of the leg.
    nodes : (n, 3) float, N
        Thrust over n equal intervals, in the inertial axes that coincide with the body axes at the
        end of the leg.
    steps_per_node : int
        Steps in each interval.
    states : (n * steps_per_node + 1, 7) float, m, m/s, kg
        The first row holds the initial state; the other rows are filled.
    """
    n = nodes.shape[0]
    h = duration / (n * steps_per_node)
    start, middle, end = np.zeros(3), np.zeros(3), np.zeros(3)
    for k in range(n * steps_per_node):
        force = nodes[k // steps_per_node]
        to_go = duration - k * h
        turn(w * to_go, force, start)
        turn(w * (to_go - 0.5 * h), force, middle)
        turn(w * (to_go - h), force, end)
        rk4_step(kind, params, w, ve, h, states[k], start, middle, end, states[k + 1])


@kernel
def _jacobi_constants(
    kind: GravityKind,
    params: FloatArray,
    w: float,
    position: FloatArray,
    velocity: FloatArray,
    out: FloatArray,
) -> None:
    for i in range(out.shape[0]):
        x, y, z = position[i, 0], position[i, 1], position[i, 2]
        v2 = velocity[i, 0] ** 2 + velocity[i, 1] ** 2 + velocity[i, 2] ** 2
        out[i] = 0.5 * v2 - 0.5 * w * w * (x * x + y * y) - potential(kind, params, x, y, z)


def jacobi_constant(
    field: GravityField, rotation_rate_rad_s: float, position_m: ArrayLike, velocity_m_s: ArrayLike
) -> FloatArray:
    """Energy in the rotating frame, which free flight conserves.

    Parameters
    ----------
    field : GravityField
        The field to evaluate.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    position_m : (n, 3) or (3,) float, m, body frame
        Positions.
    velocity_m_s : (n, 3) or (3,) float, m/s, relative to the rotating frame
        Velocities.

    Returns
    -------
    (n,) float, m2/s2
        ``v^2/2 - w^2 (x^2 + y^2)/2 - U``.
    """
    position = np.ascontiguousarray(np.atleast_2d(position_m), dtype=np.float64)
    velocity = np.ascontiguousarray(np.atleast_2d(velocity_m_s), dtype=np.float64)
    out = np.zeros(len(position))
    _jacobi_constants(field.kind, field.params, rotation_rate_rad_s, position, velocity, out)
    return out


def about_z(angle_rad: ArrayLike, vectors: ArrayLike) -> FloatArray:
    """Turn vectors about +z.

    Parameters
    ----------
    angle_rad : float or (n,) float, rad
        Angles, counter-clockwise.
    vectors : (n, 3) or (3,) float
        The vectors to turn.

    Returns
    -------
    (n, 3) float, or (3,) float for one angle and one vector
    """
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    x, y, z = np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0)
    return np.stack(np.broadcast_arrays(c * x - s * y, s * x + c * y, z), axis=-1)


def to_inertial(
    t_s: ArrayLike,
    position_m: ArrayLike,
    velocity_m_s: ArrayLike,
    rotation_rate_rad_s: float,
    epoch_s: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Express body-frame states in inertial axes.

    Parameters
    ----------
    t_s : float or (n,) float, s
        Times of the states.
    position_m : (n, 3) or (3,) float, m, body frame
        Positions.
    velocity_m_s : (n, 3) or (3,) float, m/s, relative to the rotating frame
        Velocities.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    epoch_s : float, s
        When the inertial axes coincide with the body axes.

    Returns
    -------
    position_m, velocity_m_s : (n, 3) or (3,) float, inertial axes
    """
    angle = rotation_rate_rad_s * (np.asarray(t_s, dtype=np.float64) - epoch_s)
    position = np.asarray(position_m, dtype=np.float64)
    spin = np.array([0.0, 0.0, rotation_rate_rad_s])
    return about_z(angle, position), about_z(angle, velocity_m_s + np.cross(spin, position))


def to_rotating(
    t_s: ArrayLike,
    position_m: ArrayLike,
    velocity_m_s: ArrayLike,
    rotation_rate_rad_s: float,
    epoch_s: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Express inertial states in the rotating body frame: the inverse of ``to_inertial``.

    Parameters
    ----------
    t_s : float or (n,) float, s
        Times of the states.
    position_m : (n, 3) or (3,) float, m, inertial axes
        Positions.
    velocity_m_s : (n, 3) or (3,) float, m/s, inertial axes
        Velocities.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    epoch_s : float, s
        When the inertial axes coincide with the body axes.

    Returns
    -------
    position_m, velocity_m_s : (n, 3) or (3,) float, body frame
    """
    angle = -rotation_rate_rad_s * (np.asarray(t_s, dtype=np.float64) - epoch_s)
    position = about_z(angle, position_m)
    spin = np.array([0.0, 0.0, rotation_rate_rad_s])
    return position, about_z(angle, velocity_m_s) - np.cross(spin, position)
