"""Re-flight of stored controls, open loop, by integrators that did not plan them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.integrate import solve_ivp

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.flight import acceleration_control  # noqa: F401  registers its legs
from landing_cli.flight.control import ThrustPiece, sampled_control, thrust_pieces
from landing_cli.flight.dynamics import natural_acceleration
from landing_cli.flight.gauss import fly_sampled
from landing_cli.flight.legs import Leg
from landing_cli.flight.trajectory import Trajectory

FloatArray = NDArray[np.float64]

RTOL = 1e-11
ATOL = np.array([1e-8] * 3 + [1e-10] * 3 + [1e-8])  # m, m/s, kg
_SAMPLE_S = 5.0

# A shape's pull changes within metres of its facets: steps of 15 s, 15 m over Eros, led 0.8 mm astray.
FACETS_STEP_MAX_S = 6.0
_OF_FACETS = (GravityKind.POLYHEDRON, GravityKind.BOXED, GravityKind.INTERPOLATED)


def replay(
    position_m: ArrayLike,
    velocity_m_s: ArrayLike,
    mass_kg: float,
    legs: Sequence[Leg],
    *,
    rotation_rate_rad_s: float,
    field: GravityField,
    exhaust_velocity_m_s: float,
    integrator: Literal["dop853", "gauss"] = "dop853",
) -> Trajectory:
    """Fly stored controls again, open loop.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) float, m, m/s, body frame
        Initial state; the velocity is relative to the rotating frame.
    mass_kg : float, kg
        Initial mass.
    legs : sequence of Leg
        Flown one after the other.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    field : GravityField
        The field to fly in, which need not be the one that the control was planned in.
    exhaust_velocity_m_s : float, m/s
        Effective exhaust velocity.
    integrator : {"dop853", "gauss"}
        Scipy's adaptive DOP853 at tight tolerance, or compiled Gauss collocation of order 8 at fixed
        steps: about a hundred times faster, equal to 1e-7 m.

    Returns
    -------
    Trajectory
        Samples at every jump of the control and in between; at a jump, the thrust after it.
    """
    start = np.concatenate([np.ravel(position_m), np.ravel(velocity_m_s), [mass_kg]]).astype(np.float64)
    fly = _fly_dop853 if integrator == "dop853" else _fly_gauss
    t_s, states, thrust = [np.zeros(1)], [start[None]], []
    for leg in legs:
        t, y, f = fly(states[-1][-1], leg, rotation_rate_rad_s, field, exhaust_velocity_m_s)
        t_s.append(t_s[-1][-1] + t[1:])
        states.append(y[1:])
        thrust.append(f[:-1])
    y = np.concatenate(states)
    forces = np.concatenate([*thrust, f[-1:]])
    return Trajectory(np.concatenate(t_s), y[:, :3], y[:, 3:6], y[:, 6], forces)


def replay_many(
    position_m: ArrayLike,
    velocity_m_s: ArrayLike,
    mass_kg: float,
    flights: Iterable[Sequence[Leg]],
    *,
    rotation_rate_rad_s: float,
    field: GravityField,
    exhaust_velocity_m_s: float,
) -> list[Trajectory]:
    """Fly many stored controls from one initial state, by the fast integrator.

    Parameters
    ----------
    position_m, velocity_m_s : (3,) float, m, m/s, body frame
        Initial state; the velocity is relative to the rotating frame.
    mass_kg : float, kg
        Initial mass.
    flights : iterable of sequences of Leg
        The legs of each flight.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    field : GravityField
        The field to fly in.
    exhaust_velocity_m_s : float, m/s
        Effective exhaust velocity.

    Returns
    -------
    list of Trajectory
        One for each flight.
    """
    return [
        replay(
            position_m,
            velocity_m_s,
            mass_kg,
            legs,
            rotation_rate_rad_s=rotation_rate_rad_s,
            field=field,
            exhaust_velocity_m_s=exhaust_velocity_m_s,
            integrator="gauss",
        )
        for legs in flights
    ]


_Flown = tuple[FloatArray, FloatArray, FloatArray]  # t (k,), states (k, 7), thrust (k, 3)


def _fly_gauss(start: FloatArray, leg: Leg, w: float, field: GravityField, ve: float) -> _Flown:
    step_max_s = FACETS_STEP_MAX_S if field.kind in _OF_FACETS else math.inf
    control = sampled_control(leg, w, ve, step_max_s)
    states = np.zeros((len(control.knots), 7))
    states[0] = start
    kind, params = field.kind, field.params
    fly_sampled(kind, params, w, ve, control.steps_s, control.stages, control.per_mass, states)
    force = control.knots * states[:, 6:] if control.per_mass else control.knots
    return np.concatenate([[0.0], np.cumsum(control.steps_s)]), states, force


def _fly_dop853(start: FloatArray, leg: Leg, w: float, field: GravityField, ve: float) -> _Flown:
    t_s, states, thrust = [np.zeros(1)], [start[None]], []
    for piece in thrust_pieces(leg, w, ve):
        n = max(1, int(np.ceil((piece.end_s - piece.start_s) / _SAMPLE_S)))
        times = np.linspace(piece.start_s, piece.end_s, n + 1)
        flown = solve_ivp(
            _rates,
            (piece.start_s, piece.end_s),
            states[-1][-1],
            method="DOP853",
            t_eval=times[1:],
            rtol=RTOL,
            atol=ATOL,
            args=(piece, w, field, ve),
        )
        before = np.concatenate([states[-1][-1:], flown.y.T[:-1]])
        thrust.append(np.array([piece.thrust(t, y[6]) for t, y in zip(times[:-1], before, strict=True)]))
        t_s.append(times[1:])
        states.append(flown.y.T)
    y = np.concatenate(states)
    thrust.append(piece.thrust(piece.end_s, y[-1, 6])[None])
    return np.concatenate(t_s), y, np.concatenate(thrust)


def _rates(
    t: float, y: FloatArray, piece: ThrustPiece, w: float, field: GravityField, ve: float
) -> FloatArray:
    force = piece.thrust(t, y[6])
    natural = natural_acceleration(field.kind, field.params, w, *y[:6])
    return np.concatenate([y[3:6], natural + force / y[6], [-np.linalg.norm(force) / ve]])
