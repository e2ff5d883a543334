"""Flight over a phase of Legendre-Gauss collocation, and its slopes by the control.

In a phase the Gauss pseudospectral equations (Benson 2005) say, at the nodes,

    D r = (h/2) v,    D v = (h/2) (g(r) - 2 w x v - w x (w x r) + u),

with the other end of the phase by quadrature. The control u at the nodes determines the states: Newton's
method solves the equations for the total acceleration at the nodes, and the same matrix gives the slopes.
"""

from __future__ import annotations

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
    """States at the nodes of a phase, and their slopes by its own control.

    Attributes
    ----------
    position_m : (n, 3) float, m, rotating body frame
    position_slope : (n, 3, q) float, m per m/s2
        By the q = 3 n components of the control.
    far : (6,) float, m, m/s
        State at the end of the phase that is not its anchor, by quadrature.
    far_slope : (6, q) float
    """

    position_m: FloatArray
    position_slope: FloatArray
    far: FloatArray
    far_slope: FloatArray


def fly_phase(
    field: GravityField,
    rotation_rate_rad_s: float,
    phase: Phase,
    anchor: FloatArray,
    control_m_s2: FloatArray,
    *,
    backwards: bool = False,
) -> PhaseFlight:
    """Solve the collocation equations of a phase.

    Parameters
    ----------
    field : GravityField
        Gravity.
    rotation_rate_rad_s : float, rad/s
        Spin rate about +z.
    phase : Phase
        The phase.
    anchor : (6,) float, m, m/s, rotating body frame
        Position and velocity at its start, or at its end.
    control_m_s2 : (n, 3) float, m/s2, rotating body frame
        Thrust acceleration at the nodes.
    backwards : bool
        Whether the anchor is the end. The polynomials are the same either way: what Gauss quadrature carries
        from one end to the other is the polynomial's own value there.

    Returns
    -------
    PhaseFlight
        With values that are not finite where Newton's method finds no states.
    """
    span, h, w = phase.span, phase.half_s, rotation_rate_rad_s
    coast, once, far_coast, far_once = h * (1.0 + span.nodes), h * span.integral, 2.0 * h, h * span.weights
    if backwards:
        coast, once = coast - far_coast, once - far_once
        far_coast, far_once = -far_coast, -far_once
    twice = once @ once
    coriolis = np.array([[0.0, 2.0 * w, 0.0], [-2.0 * w, 0.0, 0.0], [0.0, 0.0, 0.0]])
    centrifugal = np.diag([w * w, w * w, 0.0])
    n, r0, v0 = len(control_m_s2), anchor[:3], anchor[3:]

    def matrix(r: FloatArray) -> FloatArray:
        """I minus the slope of the right-hand side by the accelerations, (3n, 3n)."""
        pull = gradients(field, r) + centrifugal
        blocks = pull[:, None] * twice[:, :, None, None] + coriolis * once[:, :, None, None]
        return np.eye(3 * n) - blocks.transpose(0, 2, 1, 3).reshape(3 * n, 3 * n)

    a = control_m_s2 + accelerations(field, np.tile(r0, (n, 1)))
    for _ in range(_ROUNDS):
        r, v = r0 + coast[:, None] * v0 + twice @ a, v0 + once @ a
        rest = accelerations(field, r) + v @ coriolis.T + r @ centrifugal + control_m_s2 - a
        step = np.linalg.solve(matrix(r), rest.ravel()).reshape(n, 3)
        a = a + step
        if not np.abs(step).max() > _SETTLED * np.abs(a).max():
            break
    r = r0 + coast[:, None] * v0 + twice @ a
    a_slope = np.linalg.inv(matrix(r)).reshape(n, 3, 3 * n)
    far = np.concatenate([r0 + far_coast * v0 + far_once @ once @ a, v0 + far_once @ a])
    far_slope = np.concatenate(
        [np.tensordot(far_once @ once, a_slope, axes=1), np.tensordot(far_once, a_slope, axes=1)]
    )
    return PhaseFlight(r, np.tensordot(twice, a_slope, axes=1), far, far_slope)
