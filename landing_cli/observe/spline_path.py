"""A clamped cubic spline through knots in space: a path whose thrust follows by inverse dynamics.

The spline is the path of least integral of the squared acceleration through its knots (Holladay), so in a
field that changes little it is close to the least control energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SplineSamples:
    """Position, velocity and acceleration at given times as affine functions of the knots.

    Attributes
    ----------
    t_s : (k,) float, s
    offset : (3, k, 3) float, m, m/s, m/s2
        With every knot at the origin; the ends are held.
    basis : (3, k, m) float, 1, 1/s, 1/s2
        By the m inner knots: ``offset[d] + basis[d] @ knots`` is the derivative of order d.
    """

    t_s: FloatArray
    offset: FloatArray
    basis: FloatArray

    def at(self, knots_m: FloatArray) -> FloatArray:
        """Return the position and its two derivatives, (3, k, 3), for inner knots (m, 3)."""
        return self.offset + self.basis @ knots_m


def knot_times(duration_s: float, knots: int) -> FloatArray:
    """Even times of the inner knots of a spline, (knots,) float, s."""
    return duration_s * np.arange(1, knots + 1) / (knots + 1)


def spline_samples(
    t_s: FloatArray,
    knot_s: FloatArray,
    duration_s: float,
    start_m: FloatArray,
    velocity_m_s: FloatArray,
    end_m: FloatArray,
) -> SplineSamples:
    """Sample the clamped spline that ends at rest.

    Parameters
    ----------
    t_s : (k,) float, s
        Times of the samples.
    knot_s : (m,) float, s
        Times of the inner knots, increasing between 0 and the duration.
    duration_s : float, s
        Time of the last point.
    start_m, velocity_m_s : (3,) float, m, m/s
        The first position, and the velocity there.
    end_m : (3,) float, m
        The last position.

    Returns
    -------
    SplineSamples
    """
    from scipy.interpolate import CubicSpline

    times = np.concatenate([[0.0], knot_s, [duration_s]])
    # unit values at the points, with level ends; then a unit slope at the start
    units = np.concatenate([np.eye(len(times)), np.zeros((len(times), 1))], axis=1)
    level = np.zeros(len(times) + 1)
    spline = CubicSpline(times, units, bc_type=((1, np.append(level[1:], 1.0)), (1, level)))
    columns = np.stack([spline(t_s, order) for order in range(3)])
    held = np.stack([start_m, end_m, velocity_m_s])
    return SplineSamples(np.asarray(t_s), columns[:, :, [0, -2, -1]] @ held, columns[:, :, 1:-2])
