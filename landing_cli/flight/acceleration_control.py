"""Controls stored as thrust over mass: the thrust acceleration at any time, and as thrust for the replay."""

from __future__ import annotations

import math
from functools import lru_cache, singledispatch
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityKind
from landing_cli.flight.bezier_curve import curve_states
from landing_cli.flight.control import SampledControl, ThrustPiece, sampled_control, thrust_pieces
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.gauss import GAUSS_C
from landing_cli.flight.legs import AccelerationLeg, BezierLeg, GaussAccelerationLeg, LinearAccelerationLeg
from landing_cli.kernel import kernel

FloatArray = NDArray[np.float64]

# steps of the order-8 integrator (tested: halving them moves a landing by less than 1e-7 m)
_BEZIER_STEPS = 128
_STEPS_PER_INTERVAL = 4
_STEPS_PER_GAUSS_NODE = 8  # thrust that falls to nothing leaves kinks in the flow


@singledispatch
def thrust_accelerations(leg: AccelerationLeg, t_s: FloatArray, w: float) -> FloatArray:
    """Return thrust over mass at any times of a leg.

    Parameters
    ----------
    leg : BezierLeg, LinearAccelerationLeg or GaussAccelerationLeg
        The stored control.
    t_s : (k,) float, s
        Since the start of the leg.
    w : float, rad/s
        Spin rate.

    Returns
    -------
    (k, 3) float, m/s2, rotating body frame
    """
    raise TypeError(f"not an acceleration leg: {leg!r}")


@singledispatch
def smooth_edges(leg: AccelerationLeg) -> FloatArray:
    """Return the times between which a leg's thrust acceleration is smooth, (k + 1,) float, s."""
    raise TypeError(f"not an acceleration leg: {leg!r}")


@singledispatch
def _steps_per_interval(leg: AccelerationLeg) -> int:
    raise TypeError(f"not an acceleration leg: {leg!r}")


@thrust_accelerations.register
def _bezier_accelerations(leg: BezierLeg, t_s: FloatArray, w: float) -> FloatArray:
    t_s = np.asarray(t_s, dtype=np.float64)
    r, v, a = curve_states(leg.points_m, leg.duration_s, t_s / leg.duration_s)
    natural = np.zeros_like(r)
    natural_accelerations(leg.gravity.kind, leg.gravity.params, w, r, v, natural)
    return np.asarray(a - natural)


@thrust_accelerations.register
def _linear_accelerations(leg: LinearAccelerationLeg, t_s: FloatArray, w: float) -> FloatArray:
    return np.stack([np.interp(t_s, leg.times_s, column) for column in leg.acceleration_m_s2.T], axis=-1)


@thrust_accelerations.register
def _gauss_accelerations(leg: GaussAccelerationLeg, t_s: FloatArray, w: float) -> FloatArray:
    t_s = np.asarray(t_s, dtype=np.float64)
    edges = leg.edges_s
    interval = np.clip(np.searchsorted(edges, t_s, side="right") - 1, 0, len(edges) - 2)
    start, length = edges[interval], np.diff(edges)[interval]
    return _through_nodes(2.0 * (t_s - start) / length - 1.0, leg.acceleration_m_s2[interval])


def _through_nodes(x: FloatArray, values: FloatArray) -> FloatArray:
    """Evaluate polynomials through Legendre-Gauss nodes: x (k,) in [-1, 1], values (k, n, 3)."""
    nodes, weights = _barycentric(values.shape[1])
    gap = x[:, None] - nodes
    on_node = gap == 0.0
    shares = weights / np.where(on_node, 1.0, gap)
    shares = np.where(on_node.any(axis=1, keepdims=True), on_node.astype(np.float64), shares)
    return np.asarray(np.einsum("kn,kna->ka", shares, values) / shares.sum(axis=1, keepdims=True))


@lru_cache(maxsize=32)
def _barycentric(n: int) -> tuple[FloatArray, FloatArray]:
    """Legendre-Gauss nodes and their barycentric weights (Wang and Xiang, Math. Comp. 81, 2012, eq 3.7)."""
    nodes, quadrature = np.polynomial.legendre.leggauss(n)
    return np.asarray(nodes), np.asarray((-1.0) ** np.arange(n) * np.sqrt((1.0 - nodes**2) * quadrature))


@smooth_edges.register
def _bezier_edges(leg: BezierLeg) -> FloatArray:
    return np.array([0.0, leg.duration_s])


@smooth_edges.register
def _linear_edges(leg: LinearAccelerationLeg) -> FloatArray:
    return np.asarray(leg.times_s, dtype=np.float64)


@smooth_edges.register
def _gauss_edges(leg: GaussAccelerationLeg) -> FloatArray:
    return np.asarray(leg.edges_s, dtype=np.float64)


@_steps_per_interval.register
def _bezier_steps(leg: BezierLeg) -> int:
    return _BEZIER_STEPS


@_steps_per_interval.register
def _linear_steps(leg: LinearAccelerationLeg) -> int:
    return _STEPS_PER_INTERVAL


@_steps_per_interval.register
def _gauss_steps(leg: GaussAccelerationLeg) -> int:
    return _STEPS_PER_GAUSS_NODE * leg.acceleration_m_s2.shape[1]


def _pieces(leg: AccelerationLeg, w: float, ve: float) -> list[ThrustPiece]:
    def thrust(t: float, mass: float) -> FloatArray:
        return np.asarray(mass * thrust_accelerations(leg, np.array([t]), w)[0])

    return [ThrustPiece(float(a), float(b), thrust) for a, b in pairwise(smooth_edges(leg))]


def _sampled(leg: AccelerationLeg, w: float, ve: float, _step_max_s: float = math.inf) -> SampledControl:
    parts = _steps_per_interval(leg)
    steps = np.repeat(np.diff(smooth_edges(leg)) / parts, parts)
    knots = np.concatenate([[0.0], np.cumsum(steps)])
    stages = knots[:-1, None] + steps[:, None] * GAUSS_C
    at_stages = thrust_accelerations(leg, stages.ravel(), w).reshape(*stages.shape, 3)
    return SampledControl(steps, at_stages, thrust_accelerations(leg, knots, w), per_mass=True)


for _kind in (BezierLeg, LinearAccelerationLeg, GaussAccelerationLeg):
    thrust_pieces.register(_kind, _pieces)
    sampled_control.register(_kind, _sampled)


@kernel
def natural_accelerations(
    kind: GravityKind, params: FloatArray, w: float, r: FloatArray, v: FloatArray, out: FloatArray
) -> None:
    """Write the acceleration without thrust at each state: gravity, Coriolis and centrifugal.

    Parameters
    ----------
    kind : GravityKind
        Gravity model to fly in.
    params : (p,) float, SI
        Parameters of the gravity model.
    w : float, rad/s
        Spin rate about +z.
    r, v : (k, 3) float, m, m/s, rotating body frame
        States.
    out : (k, 3) float, m/s2
        Receives the accelerations.
    """
    for i in range(r.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = natural_acceleration(
            kind, params, w, r[i, 0], r[i, 1], r[i, 2], v[i, 0], v[i, 1], v[i, 2]
        )
