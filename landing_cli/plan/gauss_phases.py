"""Flight over phases of Legendre-Gauss collocation, and its slopes with respect to the control.

In each phase the Gauss pseudospectral equations (Benson 2005) say, at the nodes,

    D r = (h/2) v,    D v = (h/2) (g(r) - 2 w x v - w x (w x r) + u),

with the end of the phase by quadrature. The control u at the nodes determines the states, so they are not
unknowns of the optimisation: Newton's method solves the equations for the total acceleration at the nodes,
and the same matrix gives the slopes. A plan keeps the equations of motion at every iterate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations, gradients
from landing_cli.optimize.collocation import GaussSpan

FloatArray = NDArray[np.float64]

_ROUNDS = 30
_SETTLED = 1e-13  # relative change of the accelerations in the last Newton round


@dataclass(frozen=True, eq=False)
class Phase:
    """A span of the flight with its own polynomials.

    Attributes
    ----------
    span : GaussSpan
        Its nodes and matrices.
    start_s, end_s : float, s
        Since the initial state.
    """

    span: GaussSpan
    start_s: float
    end_s: float

    @property
    def half_s(self) -> float:
        """Half its length, s: time per unit of the span [-1, 1]."""
        return 0.5 * (self.end_s - self.start_s)

    def times_of(self, points: FloatArray) -> FloatArray:
        """Return the times, s, of points of [-1, 1]."""
        return self.start_s + self.half_s * (points + 1.0)

    def points_of(self, t_s: FloatArray) -> FloatArray:
        """Return the points of [-1, 1] of times, s."""
        return (t_s - self.start_s) / self.half_s - 1.0


@dataclass(frozen=True, eq=False)
class PhaseFlight:
    """States of a phase on its support (start and nodes), and their slopes.

    Attributes
    ----------
    position_m, velocity_m_s : (n + 1, 3) float, m, m/s, rotating body frame
    acceleration_m_s2 : (n, 3) float, m/s2
        Total acceleration at the nodes.
    position_slope : (n + 1, 3, q) float
        Derivative of the positions with respect to the control of all phases.
    end : (6,) float, m, m/s
        State at the end, by quadrature.
    end_slope : (6, q) float
        Its derivative.
    """

    position_m: FloatArray
    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    position_slope: FloatArray
    end: FloatArray
    end_slope: FloatArray


def fly_phases(
    field: GravityField,
    rotation_rate_rad_s: float,
    start: FloatArray,
    phases: Sequence[Phase],
    controls: Sequence[FloatArray],
) -> list[PhaseFlight]:
    """Solve the collocation equations of every phase, one after the other.

    Parameters
    ----------
    field : GravityField
        Gravity.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    start : (6,) float, m, m/s, rotating body frame
        Initial position and velocity.
    phases : sequence of Phase
        In order, each starting where the last one ends.
    controls : sequence of (n, 3) float, m/s2, rotating body frame
        Thrust acceleration at the nodes of each phase; together the q unknowns of the slopes, in this order.

    Returns
    -------
    list of PhaseFlight
        With values that are not finite where Newton's method finds no states.
    """
    total = sum(control.size for control in controls)
    state, slope, first = start, np.zeros((6, total)), 0
    flights = []
    for phase, control in zip(phases, controls, strict=True):
        own = np.zeros((control.size, total))
        own[:, first : first + control.size] = np.eye(control.size)
        flight = _fly_phase(field, rotation_rate_rad_s, phase, state, slope, control, own)
        flights.append(flight)
        state, slope, first = flight.end, flight.end_slope, first + control.size
    return flights


def _fly_phase(
    field: GravityField,
    w: float,
    phase: Phase,
    start: FloatArray,
    start_slope: FloatArray,
    control: FloatArray,
    control_slope: FloatArray,
) -> PhaseFlight:
    span, h, n = phase.span, phase.half_s, len(control)
    once, twice = h * span.integral, h * h * span.integral @ span.integral
    coast = h * (1.0 + span.nodes)
    coriolis = np.array([[0.0, 2.0 * w, 0.0], [-2.0 * w, 0.0, 0.0], [0.0, 0.0, 0.0]])
    centrifugal = np.diag([w * w, w * w, 0.0])

    def states(a: FloatArray) -> tuple[FloatArray, FloatArray]:
        return start[:3] + coast[:, None] * start[3:] + twice @ a, start[3:] + once @ a

    def matrix(pull: FloatArray) -> FloatArray:
        """I minus the slope of the right-hand side with respect to the accelerations, (3n, 3n)."""
        blocks = pull[:, None] * twice[:, :, None, None] + coriolis * once[:, :, None, None]
        return np.eye(3 * n) - blocks.transpose(0, 2, 1, 3).reshape(3 * n, 3 * n)

    a = control + accelerations(field, np.tile(start[:3], (n, 1)))
    scale = np.abs(a).max() + 1e-300
    for _ in range(_ROUNDS):
        r, v = states(a)
        pull = gradients(field, r) + centrifugal
        rest = accelerations(field, r) + v @ coriolis.T + r @ centrifugal + control - a
        step = np.linalg.solve(matrix(pull), rest.ravel()).reshape(n, 3)
        a = a + step
        if not np.abs(step).max() > _SETTLED * scale:
            break
    r, v = states(a)
    pull = gradients(field, r) + centrifugal
    r_coast = start_slope[:3] + coast[:, None, None] * start_slope[3:]  # (n, 3, q)
    forced = pull @ r_coast + coriolis @ start_slope[3:]
    a_slope = np.linalg.solve(matrix(pull), forced.reshape(3 * n, -1) + control_slope).reshape(n, 3, -1)
    r_slope = r_coast + np.tensordot(twice, a_slope, axes=1)
    end_r, end_v = h * span.weights @ once, h * span.weights
    end = np.concatenate([start[:3] + 2.0 * h * start[3:] + end_r @ a, start[3:] + end_v @ a])
    end_slope = np.concatenate(
        [
            start_slope[:3] + 2.0 * h * start_slope[3:] + np.tensordot(end_r, a_slope, axes=1),
            start_slope[3:] + np.tensordot(end_v, a_slope, axes=1),
        ]
    )
    return PhaseFlight(
        np.concatenate([start[None, :3], r]),
        np.concatenate([start[None, 3:], v]),
        a,
        np.concatenate([start_slope[None, :3], r_slope]),
        end,
        end_slope,
    )
