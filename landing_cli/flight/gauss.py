"""Gauss-Legendre collocation of order 8: the fast integrator that checks what others planned.

The stages are implicit and solved by fixed-point iteration, which converges in a few rounds because the
natural acceleration changes little within a step. Every control is first sampled at the stages.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.extremal import ExtremalScale, extremal_rates, scaled_thrust, thrust_ratio
from landing_cli.kernel import kernel, part

FloatArray = NDArray[np.float64]

STAGES = 4
_ROUNDS = 40


def _gauss_tableau() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return nodes c, matrix A and weights b of the collocation method on [0, 1]."""
    c = 0.5 * (np.polynomial.legendre.leggauss(STAGES)[0] + 1.0)
    powers = np.arange(1, STAGES + 1)
    vandermonde = c[:, None] ** (powers - 1)
    A = (c[:, None] ** powers / powers) @ np.linalg.inv(vandermonde)
    return c, A, (1.0 / powers) @ np.linalg.inv(vandermonde)


GAUSS_C, GAUSS_A, GAUSS_B = _gauss_tableau()
_GAUSS_AA = GAUSS_A @ GAUSS_A
_GAUSS_BA = GAUSS_B @ GAUSS_A


@kernel
def fly_sampled(
    kind: GravityKind,
    params: FloatArray,
    w: float,
    ve: float,
    steps: FloatArray,
    control: FloatArray,
    per_mass: bool,
    states: FloatArray,
) -> float:
    """Fly a control that was sampled at the stages of every step.

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
    steps : (k,) float, s
        Step lengths.
    control : (k, 4, 3) float, N or m/s2, body frame
        Thrust at the stages, or thrust over mass where ``per_mass``.
    per_mass : bool
        Whether the control is thrust over mass.
    states : (k + 1, 7) float, m, m/s, kg
        The first row holds the initial state; the other rows are filled.

    Returns
    -------
    float, m/s2
        Largest change in the last round of any step: the iteration's own error.
    """
    # an explicit loop over flat scratch arrays keeps compilation short
    s = STAGES
    K, new, pull, mass = np.zeros((s, 3)), np.zeros(3), np.zeros((s, 3)), np.zeros(s)
    worst = 0.0
    for k in range(steps.shape[0]):
        h = steps[k]
        y, out = states[k], states[k + 1]
        out[6] = _stage_masses(h, ve, y[6], control[k], per_mass, mass)
        for i in range(s):
            for a in range(3):
                pull[i, a] = control[k, i, a] if per_mass else control[k, i, a] / mass[i]
        ax, ay, az = natural_acceleration(kind, params, w, y[0], y[1], y[2], y[3], y[4], y[5])
        for i in range(s):
            K[i, 0], K[i, 1], K[i, 2] = ax + pull[i, 0], ay + pull[i, 1], az + pull[i, 2]
        change, before = 0.0, math.inf
        for _ in range(_ROUNDS):
            change = 0.0
            for i in range(s):
                p, v = np.zeros(3), np.zeros(3)
                for a in range(3):
                    p[a], v[a] = y[a] + h * GAUSS_C[i] * y[3 + a], y[3 + a]
                    for j in range(s):
                        p[a] += h * h * _GAUSS_AA[i, j] * K[j, a]
                        v[a] += h * GAUSS_A[i, j] * K[j, a]
                new[0], new[1], new[2] = natural_acceleration(
                    kind, params, w, p[0], p[1], p[2], v[0], v[1], v[2]
                )
                for a in range(3):
                    new[a] += pull[i, a]
                    change = max(change, abs(new[a] - K[i, a]))
                    K[i, a] = new[a]
            if change == 0.0 or change >= 0.5 * before:  # converged, or down to rounding
                break
            before = change
        worst = max(worst, change)
        for a in range(3):
            out[a], out[3 + a] = y[a] + h * y[3 + a], y[3 + a]
            for j in range(s):
                out[a] += h * h * _GAUSS_BA[j] * K[j, a]
                out[3 + a] += h * GAUSS_B[j] * K[j, a]
    return worst


@part
def _stage_masses(
    h: float, ve: float, m: float, control: FloatArray, per_mass: bool, mass: FloatArray
) -> float:
    """Fill the masses at the stages and return the mass after the step: both are quadratures."""
    flow = np.zeros(STAGES)
    total = 0.0
    for i in range(STAGES):
        flow[i] = h / ve * math.sqrt(control[i, 0] ** 2 + control[i, 1] ** 2 + control[i, 2] ** 2)
        total += GAUSS_B[i] * flow[i]
    for i in range(STAGES):
        used = 0.0
        for j in range(STAGES):
            used += GAUSS_A[i, j] * flow[j]
        mass[i] = m * math.exp(-used) if per_mass else m - used
    return m * math.exp(-total) if per_mass else m - total


@part
def _extremal_step(
    kind: GravityKind,
    params: FloatArray,
    scale: ExtremalScale,
    saturated: bool,
    h: float,
    y: FloatArray,
    stages: FloatArray,
    out: FloatArray,
) -> None:
    """Advance state and costates (14,) by one step, stages (4, 14) included."""
    n = y.shape[0]
    K, rate = np.zeros((STAGES, n)), np.zeros(n)
    extremal_rates(kind, params, scale, saturated, y, rate)
    for i in range(STAGES):
        K[i] = rate
    before = math.inf
    for _ in range(_ROUNDS):
        change = 0.0
        for i in range(STAGES):
            for a in range(n):
                stages[i, a] = y[a]
                for j in range(STAGES):
                    stages[i, a] += h * GAUSS_A[i, j] * K[j, a]
            extremal_rates(kind, params, scale, saturated, stages[i], rate)
            for a in range(n):
                change = max(change, abs(rate[a] - K[i, a]))
                K[i, a] = rate[a]
        if change == 0.0 or change >= 0.5 * before:
            break
        before = change
    for a in range(n):
        out[a] = y[a]
        for j in range(STAGES):
            out[a] += h * GAUSS_B[j] * K[j, a]


@part
def _first_crossing(scale: ExtremalScale, saturated: bool, stages: FloatArray, out: FloatArray) -> float:
    """Return the fraction of the step by which the switching function has crossed 1; 2 if it has not."""
    for i in range(STAGES):
        if (thrust_ratio(scale.flow, False, stages[i])[0] > 1.0) != saturated:
            return float(GAUSS_C[i])
    if (thrust_ratio(scale.flow, False, out)[0] > 1.0) != saturated:
        return 1.0
    return 2.0


@kernel
def sample_extremal(
    kind: GravityKind,
    params: FloatArray,
    scale: ExtremalScale,
    y: FloatArray,
    n_steps: int,
    steps: FloatArray,
    control: FloatArray,
    knots: FloatArray,
) -> int:
    """Integrate state and costates and sample the thrust, splitting steps where it saturates.

    Parameters
    ----------
    kind : GravityKind
        Gravity model to fly in.
    params : (p,) float, SI
        Parameters of the gravity model.
    scale : ExtremalScale
        Constants of the scaled equations.
    y : (14,) float, scaled
        State and costates at the start; advanced to the end.
    n_steps : int
        Number of equal steps before splitting.
    steps : (k,) float, scaled
        Receives the step lengths; k bounds the number of steps.
    control : (k, 4, 3) float, scaled, body frame
        Receives the thrust at the stages.
    knots : (k + 1, 3) float, scaled, body frame
        Receives the thrust at the ends of the steps.

    Returns
    -------
    int
        Number of steps taken.
    """
    stages, out = np.zeros((STAGES, y.shape[0])), np.zeros(y.shape[0])
    saturated = thrust_ratio(scale.flow, False, y)[0] > 1.0
    t, k, h = 0.0, 0, 1.0 / n_steps
    scaled_thrust(scale, saturated, y, knots[0])
    for n in range(1, n_steps + 1):
        while t < n * h and k < steps.shape[0]:
            left = n * h - t
            step = left
            _extremal_step(kind, params, scale, saturated, step, y, stages, out)
            fraction = _first_crossing(scale, saturated, stages, out)
            last = k == steps.shape[0] - 1
            if fraction <= 1.0 and not last:
                step = _to_the_kink(kind, params, scale, saturated, fraction * left, y, stages, out)
            for i in range(STAGES):
                scaled_thrust(scale, saturated, stages[i], control[k, i])
            if fraction <= 1.0:
                saturated = not saturated
            scaled_thrust(scale, saturated, out, knots[k + 1])
            steps[k] = step
            y[:] = out
            k += 1
            t = n * h if step == left else t + step
    return k


@part
def _to_the_kink(
    kind: GravityKind,
    params: FloatArray,
    scale: ExtremalScale,
    saturated: bool,
    upper: float,
    y: FloatArray,
    stages: FloatArray,
    out: FloatArray,
) -> float:
    """Step to where the switching function reaches 1, within (0, upper], and return the step."""
    lo, hi, step = 0.0, upper, upper
    f_lo = thrust_ratio(scale.flow, False, y)[0] - 1.0
    f_lo = max(f_lo, 1e-15) if saturated else min(f_lo, -1e-15)  # a step may begin on a kink
    _extremal_step(kind, params, scale, saturated, hi, y, stages, out)
    f_hi = thrust_ratio(scale.flow, False, out)[0] - 1.0
    f = f_hi
    for _ in range(60):
        if abs(f) < 1e-14 or hi - lo < 1e-15 or (f_lo > 0.0) == (f_hi > 0.0):
            break
        step = hi - f_hi * (hi - lo) / (f_hi - f_lo)
        if not lo < step < hi:
            step = 0.5 * (lo + hi)
        _extremal_step(kind, params, scale, saturated, step, y, stages, out)
        f_before, f = f, thrust_ratio(scale.flow, False, out)[0] - 1.0
        sticks = (f > 0.0) == (f_before > 0.0)
        if (f > 0.0) == (f_hi > 0.0):
            hi, f_hi = step, f
            f_lo *= 0.5 if sticks else 1.0  # Illinois
        else:
            lo, f_lo = step, f
            f_hi *= 0.5 if sticks else 1.0
    return step
