"""Extremals of the descent stage by fixed-step RK4, and their exact tangents.

State and costates follow Zhao 2022, eqs 1 and 8-11, in the scaled units of ``flight.extremal``, together
with the energy ``integral of u^2 / 2``. Within a step the thrust keeps to one branch (free, or at its
bound), so that each step is smooth; a step across the switch is split where u reaches 1. The tangents are
those of this discrete map: the lengths of split steps answer to the initial costates too. Steps are halved
where the saturated thrust would turn far within one: strong costates reverse it within seconds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.body.gravity.kernels import acceleration_and_gradient, curvature
from landing_cli.flight.extremal import ExtremalScale, rates_in_gravity, thrust_ratio
from landing_cli.kernel import inlined, inner, part
from landing_cli.kernel_record import by_reference

Floats = NDArray[np.float64]

STATE = 15  # position, velocity, mass, their costates, energy
COLUMNS = 8  # seven initial costates, and the length of the step
MAX_SPLITS = 50
LARGEST_TURN = math.cos(0.5)  # of the saturated thrust within a step
SMALLEST_PART = 1.0 / 32.0  # of the step between two nodes
# Inside this fraction of the ellipsoid an iterate's gravity is taken at its radial projection: no path that
# is accepted goes there, and the iterates must not meet the field's singularities.
CORE = 0.4


@by_reference
class Extremal(NamedTuple):
    """An extremal, step by step (scaled units, body frame)."""

    step: Floats  # (K,) step lengths
    saturated: NDArray[np.bool_]  # (K,) whether the thrust is at its bound
    part: Floats  # (K,) the step's share of what was left to the next node; 0: it ends at a switch
    state: Floats  # (K + 1, 15)
    rate: Floats  # (15,) scratch space
    stage: Floats  # (15,) scratch space


@by_reference
class Tangents(NamedTuple):
    """Derivatives of an extremal with respect to its initial costates."""

    end: Floats  # (15, 8) of the last state; the eighth column is scratch
    nodes: Floats  # (K + 1, 6, 8) of position and velocity at every node
    rate: Floats  # (15,), and what follows: scratch space
    stage: Floats  # (15,)
    slope: Floats  # (15, 8)
    of_stage: Floats  # (15, 8)
    base: Floats  # (15, 8)
    left: Floats  # (8,) of what is left to the next node
    at_switch: Floats  # (8,)


@by_reference
class Field(NamedTuple):
    """Gravity and scales of a descent."""

    kind: GravityKind
    params: Floats
    scale: ExtremalScale
    inverse_axes: Floats  # (3,) of the keep-out ellipsoid, scaled


def new_extremal(n_steps: int) -> Extremal:
    """Room for an extremal of ``n_steps`` steps before splitting."""
    size = n_steps + MAX_SPLITS
    return Extremal(
        np.zeros(size),
        np.zeros(size, dtype=np.bool_),
        np.zeros(size),
        np.zeros((size + 1, STATE)),
        np.zeros(STATE),
        np.zeros(STATE),
    )


def new_tangents(n_steps: int) -> Tangents:
    """Room for the tangents of such an extremal."""
    shape = STATE, COLUMNS
    return Tangents(
        np.zeros(shape),
        np.zeros((n_steps + MAX_SPLITS + 1, 6, COLUMNS)),
        np.zeros(STATE),
        np.zeros(STATE),
        np.zeros(shape),
        np.zeros(shape),
        np.zeros(shape),
        np.zeros(COLUMNS),
        np.zeros(COLUMNS),
    )


@part
def gravity_point(field: Field, y: Floats) -> tuple[float, float, float]:
    """Where gravity is evaluated, m: the position, or its projection out of the ellipsoid's core."""
    w = field.inverse_axes
    level2 = (w[0] * y[0]) ** 2 + (w[1] * y[1]) ** 2 + (w[2] * y[2]) ** 2
    scale = field.scale.length_m
    if level2 < CORE * CORE:
        scale *= CORE / math.sqrt(level2 + 1e-30)
    return scale * y[0], scale * y[1], scale * y[2]


@part
def _rates(field: Field, saturated: bool, y: Floats, out: Floats) -> None:
    """Rates of state, costates and energy."""
    x, yy, z = gravity_point(field, y)
    g = acceleration_and_gradient(field.kind, field.params, x, yy, z)
    rates_in_gravity(field.scale, saturated, y, g, out)
    u, _ = thrust_ratio(field.scale.flow, saturated, y)
    out[14] = 0.5 * u * u


@part
def _step(
    field: Field, saturated: bool, h: float, y: Floats, rate: Floats, stage: Floats, out: Floats
) -> float:
    """One RK4 step into ``out``; returns the switching function's distance from 1 in the middle."""
    middle = 0.0
    for i in range(STATE):
        stage[i], out[i] = y[i], y[i]
    for s in range(4):
        _rates(field, saturated, stage, rate)
        weight = h / 6.0 if s == 0 or s == 3 else h / 3.0
        ahead = h if s == 2 else 0.5 * h
        for i in range(STATE):
            out[i] += weight * rate[i]
            stage[i] = y[i] + ahead * rate[i]
        if s == 1:
            middle = thrust_ratio(field.scale.flow, False, stage)[0] - 1.0
    return middle


@inlined
def _step_to_switch(
    field: Field, saturated: bool, upper: float, y: Floats, rate: Floats, stage: Floats, out: Floats
) -> float:
    """Step to where u reaches 1 within (0, upper], ``out`` holding the end of the full step."""
    flow = field.scale.flow
    lo, hi, h = 0.0, upper, upper
    f_lo = thrust_ratio(flow, False, y)[0] - 1.0
    f_lo = max(f_lo, 1e-15) if saturated else min(f_lo, -1e-15)  # a step may begin at a switch
    f_hi = thrust_ratio(flow, False, out)[0] - 1.0
    f = f_hi
    for _ in range(50):
        if abs(f) < 1e-13 or hi - lo < 1e-14:
            break
        h = hi - f_hi * (hi - lo) / (f_hi - f_lo)
        if not lo < h < hi:
            h = 0.5 * (lo + hi)
        _step(field, saturated, h, y, rate, stage, out)
        before, f = f, thrust_ratio(flow, False, out)[0] - 1.0
        sticks = (f > 0.0) == (before > 0.0)
        if (f > 0.0) == (f_hi > 0.0):
            hi, f_hi = h, f
            f_lo *= 0.5 if sticks else 1.0  # Illinois
        else:
            lo, f_lo = h, f
            f_hi *= 0.5 if sticks else 1.0
    return h


@inner
def fly_extremal(field: Field, extremal: Extremal) -> int:
    """Integrate from ``extremal.state[0]`` over unit time.

    Parameters
    ----------
    field : Field
        Gravity and scales.
    extremal : Extremal
        The first state is given, energy 0; the rest is filled. Its size sets the number of equal steps before
        splitting.

    Returns
    -------
    int
        Number of steps taken, K.
    """
    rate, stage = extremal.rate, extremal.stage
    n_steps, flow = extremal.step.shape[0] - MAX_SPLITS, field.scale.flow
    saturated = thrust_ratio(flow, False, extremal.state[0])[0] > 1.0
    k = 0
    for n in range(n_steps):
        left = 1.0 / n_steps
        while left > 0.0:
            y, out = extremal.state[k], extremal.state[k + 1]
            room = k < extremal.step.shape[0] - (n_steps - n)
            part = 1.0
            if room and saturated:
                part = _share_to_turn(field.scale.spin, y, left, SMALLEST_PART / n_steps)
            h = part * left
            middle = _step(field, saturated, h, y, rate, stage, out)
            crossed = (thrust_ratio(flow, False, out)[0] > 1.0) != saturated
            if room and not crossed and (middle > 0.0) != saturated:
                # the thrust touches its bound within the step, or leaves it: look at the first half
                part *= 0.5
                h = part * left
                _step(field, saturated, h, y, rate, stage, out)
                crossed = (thrust_ratio(flow, False, out)[0] > 1.0) != saturated
            if room and crossed:
                h, part = _step_to_switch(field, saturated, h, y, rate, stage, out), 0.0
            extremal.step[k], extremal.saturated[k], extremal.part[k] = h, saturated, part
            if crossed:
                saturated = not saturated
            left = 0.0 if h == left else left - h
            k += 1
    return k


@inlined
def _share_to_turn(w: float, y: Floats, left: float, smallest: float) -> float:
    """Halve what is left to the next node until lambda_v turns little within it."""
    dx, dy, dz = -y[7] + 2.0 * w * y[11], -y[8] - 2.0 * w * y[10], -y[9]
    norm2 = y[10] * y[10] + y[11] * y[11] + y[12] * y[12]
    part = 1.0
    while part * left > smallest:
        h = part * left
        ax, ay, az = y[10] + h * dx, y[11] + h * dy, y[12] + h * dz
        along = ax * y[10] + ay * y[11] + az * y[12]
        if along > LARGEST_TURN * math.sqrt(norm2 * (ax * ax + ay * ay + az * az)):
            break
        part *= 0.5
    return part


@inlined
def _tangent_rates(field: Field, saturated: bool, y: Floats, X: Floats, rate: Floats, D: Floats) -> None:
    """Rates of state and energy (as ``_rates``) and of all tangent columns, (15, 8) each."""
    scale = field.scale
    flow, w, grow = scale.flow, scale.spin, scale.time_s * scale.time_s
    x, yy, z = gravity_point(field, y)
    g = acceleration_and_gradient(field.kind, field.params, x, yy, z)
    rates_in_gravity(scale, saturated, y, g, rate)
    lx, ly, lz, m = y[10], y[11], y[12], y[6]
    u, norm = thrust_ratio(flow, saturated, y)
    rate[14] = 0.5 * u * u
    a = -u / (m * norm)
    q = curvature(field.kind, field.params, x, yy, z, lx, ly, lz)
    gxx, gyy, gzz = grow * g[3] + w * w, grow * g[4] + w * w, grow * g[5]
    gxy, gxz, gyz = grow * g[6], grow * g[7], grow * g[8]
    bend = grow * scale.length_m
    qxx, qyy, qzz = bend * q[0], bend * q[1], bend * q[2]
    qxy, qxz, qyz = bend * q[3], bend * q[4], bend * q[5]
    free = 0.0 if saturated else 1.0
    ux, uy, uz = lx / norm, ly / norm, lz / norm
    u_norm, u_m, u_l = free / m, -free * norm / (m * m), free * flow
    a_u, a_m, a_norm = -1.0 / (m * norm), u / (m * m * norm), u / (m * norm * norm)
    i2 = 1.0 / (m * m)
    for j in range(COLUMNS):
        rx, ry, rz = X[0, j], X[1, j], X[2, j]
        px, py, pz = X[10, j], X[11, j], X[12, j]
        dm = X[6, j]
        d_norm = ux * px + uy * py + uz * pz
        du = u_norm * d_norm + u_m * dm + u_l * X[13, j]
        da = a_u * du + a_m * dm + a_norm * d_norm
        D[0, j], D[1, j], D[2, j] = X[3, j], X[4, j], X[5, j]
        D[3, j] = gxx * rx + gxy * ry + gxz * rz + 2.0 * w * X[4, j] + a * px + da * lx
        D[4, j] = gxy * rx + gyy * ry + gyz * rz - 2.0 * w * X[3, j] + a * py + da * ly
        D[5, j] = gxz * rx + gyz * ry + gzz * rz + a * pz + da * lz
        D[6, j] = -flow * du
        D[7, j] = -gxx * px - gxy * py - gxz * pz - qxx * rx - qxy * ry - qxz * rz
        D[8, j] = -gxy * px - gyy * py - gyz * pz - qxy * rx - qyy * ry - qyz * rz
        D[9, j] = -gxz * px - gyz * py - gzz * pz - qxz * rx - qyz * ry - qzz * rz
        D[10, j] = -X[7, j] + 2.0 * w * py
        D[11, j] = -X[8, j] - 2.0 * w * px
        D[12, j] = -X[9, j]
        D[13, j] = -i2 * (du * norm + u * d_norm) + 2.0 * u * norm * i2 / m * dm
        D[14, j] = u * du


@part
def tangents(field: Field, extremal: Extremal, n: int, out: Tangents) -> None:
    """Derivatives of a flown extremal with respect to its initial costates.

    Parameters
    ----------
    field : Field
        Gravity and scales.
    extremal : Extremal
        As filled by ``fly_extremal``.
    n : int
        Its number of steps.
    out : Tangents
        Filled.
    """
    X, d_left = out.end, out.left
    for j in range(COLUMNS):
        d_left[j] = 0.0
        for i in range(STATE):
            X[i, j] = 1.0 if i == 7 + j and j < 7 else 0.0
    _keep_node(X, out.nodes[0])
    for k in range(n):
        _tangent_step(field, extremal.saturated[k], extremal.step[k], extremal.state[k], out)
        if extremal.part[k] == 0.0:
            _answer_of_switch(field.scale.flow, extremal.state[k + 1], X, d_left, out.at_switch)
        else:
            for j in range(7):
                dh = extremal.part[k] * d_left[j]
                d_left[j] -= dh
                for i in range(STATE):
                    X[i, j] += X[i, 7] * dh
        _keep_node(X, out.nodes[k + 1])


@part
def _keep_node(X: Floats, node: Floats) -> None:
    """Copy the derivatives of position and velocity."""
    for i in range(6):
        for j in range(COLUMNS):
            node[i, j] = X[i, j]


@inlined
def _tangent_step(field: Field, saturated: bool, h: float, y: Floats, out: Tangents) -> None:
    """Carry the tangents through one RK4 step; the eighth column answers to the step's length."""
    X, rate, stage, D, S, base = out.end, out.rate, out.stage, out.slope, out.of_stage, out.base
    for i in range(STATE):
        stage[i] = y[i]
        X[i, 7] = 0.0
        for j in range(COLUMNS):
            base[i, j] = S[i, j] = X[i, j]
    for s in range(4):
        _tangent_rates(field, saturated, stage, S, rate, D)
        weight = 1.0 / 6.0 if s == 0 or s == 3 else 1.0 / 3.0
        part = 1.0 if s == 2 else 0.5
        for i in range(STATE):
            stage[i] = y[i] + part * h * rate[i]
            for j in range(COLUMNS):
                X[i, j] += weight * h * D[i, j]
                S[i, j] = base[i, j] + part * h * D[i, j]
            X[i, 7] += weight * rate[i]
            S[i, 7] += part * rate[i]


@inlined
def _answer_of_switch(flow: float, y: Floats, X: Floats, d_left: Floats, slope: Floats) -> None:
    """Let the step's length answer, so that u stays 1 at its end."""
    _, norm = thrust_ratio(flow, False, y)
    for j in range(COLUMNS):
        d_norm = (y[10] * X[10, j] + y[11] * X[11, j] + y[12] * X[12, j]) / norm
        slope[j] = d_norm / y[6] - norm / (y[6] * y[6]) * X[6, j] + flow * X[13, j]
    for j in range(7):
        dh = -slope[j] / slope[7] if slope[7] != 0.0 else 0.0
        d_left[j] -= dh
        for i in range(STATE):
            X[i, j] += X[i, 7] * dh
