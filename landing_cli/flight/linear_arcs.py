"""Flight under a thrust acceleration that is linear between nodes, and its slopes.

Every arc between two nodes is one step of Gauss-Legendre collocation of order 8, solved by Newton's method
for all arcs at once: a solution by multiple shooting is a flight of this integrator to rounding. The slopes
are those of the collocation equations, with the field's gradient taken at the first guess of the path.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.flight.gauss import GAUSS_A, GAUSS_B, GAUSS_C, STAGES

FloatArray = NDArray[np.float64]

_AA, _BA = GAUSS_A @ GAUSS_A, GAUSS_B @ GAUSS_A
_ROUNDS = 8
_SOLVED = 1e-14  # residual of the collocation equations, relative


@dataclass(frozen=True, eq=False)
class Arcs:
    """Arcs flown from the states at their first nodes.

    Attributes
    ----------
    times_s : (n + 1,) float, s
        Nodes.
    state : (n, 6) float, m, m/s, rotating body frame
        Where each arc starts.
    stages : (n, 4, 3) float, m/s2
        Acceleration at the collocation points.
    end : (n, 6) float, m, m/s
        Where each arc ends.
    end_slope : (n, 6, 12) float, SI
        By the arc's start (r, v) and the thrust accelerations at its two nodes.
    stages_slope : (n, 4, 3, 12) float, SI
        The same of the stage accelerations.
    """

    times_s: FloatArray
    state: FloatArray
    stages: FloatArray
    end: FloatArray
    end_slope: FloatArray
    stages_slope: FloatArray


def fly_linear_arcs(
    field: GravityField,
    rotation_rate_rad_s: float,
    times_s: FloatArray,
    states: FloatArray,
    thrust_acceleration_m_s2: FloatArray,
) -> Arcs:
    """Fly every arc from its own start.

    Parameters
    ----------
    field : GravityField
        The field to fly in.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    times_s : (n + 1,) float, s
        Nodes, increasing.
    states : (n, 6) float, m, m/s, rotating body frame
        Where each arc starts.
    thrust_acceleration_m_s2 : (n + 1, 3) float, m/s2, rotating body frame
        Thrust over mass at the nodes.

    Returns
    -------
    Arcs
    """
    n, s = len(states), STAGES
    h = np.diff(times_s)[:, None, None]
    u = thrust_acceleration_m_s2
    pull = (1.0 - GAUSS_C[:, None]) * u[:-1, None, :] + GAUSS_C[:, None] * u[1:, None, :]
    r0, v0 = states[:, None, :3], states[:, None, 3:]
    by_v, by_r = frame_slopes(rotation_rate_rad_s)

    def residual(K: FloatArray) -> tuple[FloatArray, FloatArray]:
        r = r0 + h * GAUSS_C[:, None] * v0 + h * h * (_AA @ K)
        v = v0 + h * (GAUSS_A @ K)
        g = accelerations(field, r).reshape(n, s, 3)
        return K - (g + r @ by_r.T + v @ by_v.T + pull), r

    K = (
        pull
        + (accelerations(field, states[:, :3]) + states[:, :3] @ by_r.T + states[:, 3:] @ by_v.T)[:, None]
    )
    error, r = residual(K)
    # the field's slopes at the first guess serve throughout: they change by less than a part in a thousand
    slope, G = _stage_matrix(field, r, h, by_r, by_v)
    for _ in range(_ROUNDS):
        K = K - np.linalg.solve(slope, error.reshape(n, 3 * s, 1)).reshape(n, s, 3)
        error, r = residual(K)
        if np.abs(error).max() <= _SOLVED * np.abs(K).max():
            break
    solved = np.linalg.solve(slope, _right_sides(G, h, by_v).reshape(n, 3 * s, 12))
    K_slope = np.asarray(solved, dtype=np.float64).reshape(n, s, 3, 12)
    hs = h[:, :, 0]
    end = np.concatenate(
        [
            states[:, :3] + hs * states[:, 3:] + hs * hs * np.einsum("j,nja->na", _BA, K),
            states[:, 3:] + hs * np.einsum("j,nja->na", GAUSS_B, K),
        ],
        axis=1,
    )
    start = np.eye(6, 12)
    start[:3, 3:6] = 0.0
    end_slope = np.zeros((n, 6, 12))
    end_slope[:, :3] = h * h * np.einsum("j,njac->nac", _BA, K_slope) + np.eye(3, 12) + h * np.eye(3, 12, k=3)
    end_slope[:, 3:] = h * np.einsum("j,njac->nac", GAUSS_B, K_slope) + np.eye(3, 12, k=3)
    return Arcs(times_s, states, K, end, end_slope, K_slope)


def positions_between(arcs: Arcs, arc: NDArray[np.int64], share: FloatArray) -> FloatArray:
    """Positions on the collocation polynomials.

    Parameters
    ----------
    arcs : Arcs
        The flown arcs.
    arc : (k,) int
        Which arc each position is on.
    share : (k,) float
        Share of the arc's duration, 0 to 1.

    Returns
    -------
    (k, 3) float, m
    """
    h = np.diff(arcs.times_s)[arc, None]
    bend = np.einsum("kj,kja->ka", _double_integrals(share), arcs.stages[arc])
    start = arcs.state[arc]
    return np.asarray(start[:, :3] + share[:, None] * h * start[:, 3:] + h * h * bend)


def slopes_between(arcs: Arcs, arc: NDArray[np.int64], share: FloatArray, along: FloatArray) -> FloatArray:
    """Slopes of positions on the collocation polynomials along given directions.

    Parameters
    ----------
    arcs : Arcs
        The flown arcs.
    arc : (k,) int
        Which arc each position is on.
    share : (k,) float
        Share of the arc's duration, 0 to 1.
    along : (k, 3) float
        Directions.

    Returns
    -------
    (k, 12) float, SI
        Slope of ``along . position`` by the arc's start (r, v) and the thrust accelerations at its nodes.
    """
    h = np.diff(arcs.times_s)[arc, None]
    slope = h * h * np.einsum("kj,kjac,ka->kc", _double_integrals(share), arcs.stages_slope[arc], along)
    slope[:, :3] += along
    slope[:, 3:6] += share[:, None] * h * along
    return np.asarray(slope)


def frame_slopes(w: float) -> tuple[FloatArray, FloatArray]:
    """Return the slopes of the Coriolis acceleration by velocity and of the centrifugal one by position.

    Parameters
    ----------
    w : float, rad/s
        Spin rate about +z.

    Returns
    -------
    by_v : (3, 3) float, 1/s
    by_r : (3, 3) float, 1/s2
    """
    return np.array([[0.0, 2.0 * w, 0.0], [-2.0 * w, 0.0, 0.0], [0.0] * 3]), np.diag([w * w, w * w, 0.0])


def _stage_matrix(
    field: GravityField, r: FloatArray, h: FloatArray, by_r: FloatArray, by_v: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slope of the collocation equations by the stages (n, 12, 12), and of the natural field (n, 4, 3, 3)."""
    n, s = r.shape[:2]
    G = gradients(field, r).reshape(n, s, 3, 3) + by_r
    coupled = (h * h)[..., None, None] * _AA[None, :, :, None, None] * G[:, :, None]
    coupled = coupled + h[..., None, None] * GAUSS_A[None, :, :, None, None] * by_v
    matrix = -coupled.transpose(0, 1, 3, 2, 4).reshape(n, 3 * s, 3 * s)
    return matrix + np.eye(3 * s), G


def _right_sides(G: FloatArray, h: FloatArray, by_v: FloatArray) -> FloatArray:
    """Slope of the collocation equations by (r, v, u at both nodes): (n, 4, 3, 12)."""
    n, s = G.shape[:2]
    out = np.zeros((n, s, 3, 12))
    out[..., 0:3] = G
    out[..., 3:6] = h[..., None] * GAUSS_C[:, None, None] * G + by_v
    out[..., 6:9] = (1.0 - GAUSS_C)[:, None, None] * np.eye(3)
    out[..., 9:12] = GAUSS_C[:, None, None] * np.eye(3)
    return out


def _double_integrals(share: FloatArray) -> FloatArray:
    """Twice-integrated Lagrange polynomials of the collocation points at shares (k,): (k, 4)."""
    powers = np.arange(1, STAGES + 1)
    inverse = np.linalg.inv(GAUSS_C[:, None] ** (powers - 1))
    return np.asarray((share[:, None] ** (powers + 1) / (powers * (powers + 1))) @ inverse)
