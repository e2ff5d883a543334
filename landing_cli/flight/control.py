"""Stored controls as thrust: at any time for one integrator, at fixed stages for the other."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, singledispatch

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.flight.dynamics import about_z, natural_acceleration
from landing_cli.flight.extremal import (
    ExtremalScale,
    extremal_rates,
    extremal_scale,
    scaled_start,
    scaled_thrust,
    thrust_ratio,
)
from landing_cli.flight.gauss import GAUSS_C, STAGES, sample_extremal
from landing_cli.flight.legs import CostateLeg, FinalArcLeg, Leg, ThrustNodesLeg
from landing_cli.kernel import kernel

FloatArray = NDArray[np.float64]

# steps of the order-8 integrator: halving them moves a landing by less than 1e-8 m (tested)
_EXTREMAL_STEPS = 256
_ARC_STEPS = 16
_KINKS = 32


@dataclass(frozen=True, eq=False)
class ThrustPiece:
    """Smooth thrust over a span of a leg.

    Attributes
    ----------
    start_s, end_s : float, s
        Since the start of the leg.
    thrust : callable
        ``thrust(t_s, mass_kg)`` gives (3,) float, N, body frame.
    """

    start_s: float
    end_s: float
    thrust: Callable[[float, float], FloatArray]


@dataclass(frozen=True, eq=False)
class SampledControl:
    """Thrust at the Gauss stages and at the ends of the steps of a leg.

    Attributes
    ----------
    steps_s : (k,) float, s
    stages : (k, 4, 3) float, N or m/s2, body frame
    knots : (k + 1, 3) float, N or m/s2, body frame
        At a jump, the value after it.
    per_mass : bool
        Whether the values are thrust over mass.
    """

    steps_s: FloatArray
    stages: FloatArray
    knots: FloatArray
    per_mass: bool


@singledispatch
def thrust_pieces(leg: Leg, w: float, ve: float) -> list[ThrustPiece]:
    """Return a leg's thrust as smooth pieces.

    Parameters
    ----------
    leg : Leg
        The stored control.
    w : float, rad/s
        Spin rate.
    ve : float, m/s
        Effective exhaust velocity.

    Returns
    -------
    list of ThrustPiece
    """
    raise TypeError(f"not a leg: {leg!r}")


@singledispatch
def sampled_control(leg: Leg, w: float, ve: float, step_max_s: float = math.inf) -> SampledControl:
    """Return a leg's thrust at the stages of the order-8 integrator.

    Parameters
    ----------
    leg : Leg
        The stored control.
    w : float, rad/s
        Spin rate.
    ve : float, m/s
        Effective exhaust velocity.

    step_max_s : float, s
        Longest step along thrust nodes, which are a step each otherwise; other legs have short ones.

    Returns
    -------
    SampledControl
    """
    raise TypeError(f"not a leg: {leg!r}")


def _stage_times(steps_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the times of the stages, (k, 4), and of the ends of the steps, (k + 1,)."""
    knots = np.concatenate([[0.0], np.cumsum(steps_s)])
    return knots[:-1, None] + steps_s[:, None] * GAUSS_C, knots


@thrust_pieces.register
def _nodes_pieces(leg: ThrustNodesLeg, w: float, ve: float) -> list[ThrustPiece]:
    edges = np.linspace(0.0, leg.duration_s, len(leg.thrust_n) + 1)

    def piece(start: float, end: float, force: FloatArray) -> ThrustPiece:
        return ThrustPiece(start, end, lambda t, mass: about_z(w * (leg.duration_s - t), force))

    return [piece(*span) for span in zip(edges[:-1], edges[1:], leg.thrust_n, strict=True)]


@sampled_control.register
def _nodes_sampled(leg: ThrustNodesLeg, w: float, ve: float, step_max_s: float = math.inf) -> SampledControl:
    count = max(1, math.ceil(leg.duration_s / len(leg.thrust_n) / step_max_s))
    forces = np.repeat(leg.thrust_n, count, axis=0)
    steps = np.full(len(forces), leg.duration_s / len(forces))
    times, knots = _stage_times(steps)
    after = np.concatenate([forces, forces[-1:]])
    return SampledControl(
        steps,
        about_z(w * (leg.duration_s - times), forces[:, None, :]),
        about_z(w * (leg.duration_s - knots), after),
        per_mass=False,
    )


def _scaled(leg: CostateLeg, w: float, ve: float) -> tuple[ExtremalScale, FloatArray]:
    scale = extremal_scale(leg.thrust_max_n, leg.mass_kg, ve, leg.duration_s, w)
    return scale, scaled_start(scale, leg.position_m, leg.velocity_m_s, leg.costates)


@thrust_pieces.register
def _costate_pieces(leg: CostateLeg, w: float, ve: float) -> list[ThrustPiece]:
    """Integrate state and costates by DOP853 from kink to kink; the dense output gives the thrust."""
    scale, y = _scaled(leg, w, ve)
    saturated = thrust_ratio(scale.flow, False, y)[0] > 1.0
    pieces: list[ThrustPiece] = []
    t = 0.0
    while t < 1.0:
        flown = solve_ivp(
            partial(_rates, leg.gravity, scale, saturated),
            (t, 1.0),
            y,
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
            max_step=1.0 / _EXTREMAL_STEPS,
            events=_kink(scale, saturated),
            dense_output=True,
        )
        span = (t * leg.duration_s, flown.t[-1] * leg.duration_s)
        pieces.append(ThrustPiece(*span, partial(_extremal_thrust, leg, scale, saturated, flown.sol)))
        t, y = flown.t[-1], flown.y[:, -1]
        saturated = not saturated
    return pieces


def _rates(
    field: GravityField, scale: ExtremalScale, saturated: bool, _t: float, y: FloatArray
) -> FloatArray:
    out = np.zeros(14)
    extremal_rates(field.kind, field.params, scale, saturated, y, out)
    return out


def _kink(scale: ExtremalScale, saturated: bool) -> Callable[[float, FloatArray], float]:
    """Event: the thrust reaches its bound, or leaves it."""

    def event(_t: float, y: FloatArray) -> float:
        return thrust_ratio(scale.flow, False, y)[0] - 1.0

    event.terminal = True  # type: ignore[attr-defined]
    event.direction = -1.0 if saturated else 1.0  # type: ignore[attr-defined]
    return event


def _extremal_thrust(
    leg: CostateLeg,
    scale: ExtremalScale,
    saturated: bool,
    solution: Callable[[float], FloatArray],
    t: float,
    _mass: float,
) -> FloatArray:
    out = np.zeros(3)
    scaled_thrust(scale, saturated, solution(t / leg.duration_s), out)
    return leg.thrust_max_n * out


@sampled_control.register
def _costate_sampled(leg: CostateLeg, w: float, ve: float, _step_max_s: float = math.inf) -> SampledControl:
    scale, y = _scaled(leg, w, ve)
    size = _EXTREMAL_STEPS + _KINKS
    steps, stages, knots = np.zeros(size), np.zeros((size, STAGES, 3)), np.zeros((size + 1, 3))
    kind, params = leg.gravity.kind, leg.gravity.params
    k = sample_extremal(kind, params, scale, y, _EXTREMAL_STEPS, steps, stages, knots)
    bound = leg.thrust_max_n
    return SampledControl(
        steps[:k] * leg.duration_s, bound * stages[:k], bound * knots[: k + 1], per_mass=False
    )


@kernel
def _arc_thrust(
    kind: GravityKind,
    params: FloatArray,
    w: float,
    to_go: FloatArray,
    target: FloatArray,
    A: FloatArray,
    B: FloatArray,
    out: FloatArray,
) -> None:
    """Write the thrust acceleration that flies the planned final arc, at each time-to-go."""
    for i in range(to_go.shape[0]):
        s = to_go[i]
        r = target + s * s * (A + s * B)
        v = -s * (2.0 * A + 3.0 * s * B)
        nx, ny, nz = natural_acceleration(kind, params, w, r[0], r[1], r[2], v[0], v[1], v[2])
        for a in range(3):
            natural = nx if a == 0 else (ny if a == 1 else nz)
            out[i, a] = 2.0 * A[a] + 6.0 * s * B[a] - natural


def _arc_thrusts(leg: FinalArcLeg, w: float, t: FloatArray) -> FloatArray:
    A, B = leg.coefficients
    out = np.zeros((t.size, 3))
    to_go = leg.duration_s - t.ravel()
    target = np.array(leg.target_m, dtype=np.float64)
    _arc_thrust(leg.gravity.kind, leg.gravity.params, w, to_go, target, A, B, out)
    return out.reshape(*t.shape, 3)


@thrust_pieces.register
def _arc_pieces(leg: FinalArcLeg, w: float, ve: float) -> list[ThrustPiece]:
    def thrust(t: float, mass: float) -> FloatArray:
        return mass * _arc_thrusts(leg, w, np.array([t]))[0]

    return [ThrustPiece(0.0, leg.duration_s, thrust)]


@sampled_control.register
def _arc_sampled(leg: FinalArcLeg, w: float, ve: float, _step_max_s: float = math.inf) -> SampledControl:
    steps = np.full(_ARC_STEPS, leg.duration_s / _ARC_STEPS)
    times, knots = _stage_times(steps)
    return SampledControl(steps, _arc_thrusts(leg, w, times), _arc_thrusts(leg, w, knots), per_mass=True)
