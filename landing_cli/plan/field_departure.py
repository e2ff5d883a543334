"""What a costly field pulls more than a point mass, along all curves of a family at once.

A polyhedron takes 0.1 to 0.3 ms a point, a search over a thousand curves of two hundred points too many of
them. The departure is smooth along every curve and from curve to curve, so it is computed at Chebyshev nodes
of time and of both grid coordinates and interpolated. Only the search's ranking rests on it: what a plan
reports is computed in the field itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.flight.bezier_curve import bezier_basis
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]

SHARE_NODES = 4
_TIME_NODES = 33


def pricing_field(case: PlanCase) -> GravityField:
    """Return the field that prices curves: the case's own, or a point mass in place of a polyhedron."""
    field = case.asteroid.gravity
    return point_mass_field(case.asteroid.gm_m3_s2) if field.kind == GravityKind.POLYHEDRON else field


def chebyshev_nodes(least: float, greatest: float, count: int) -> FloatArray:
    """Return Chebyshev points of the second kind over an interval, (count,) float, rising."""
    if least == greatest:
        return np.array([least])
    x = -np.cos(np.pi * np.arange(count) / (count - 1))
    return np.asarray(least + 0.5 * (x + 1.0) * (greatest - least))


def lagrange_weights(nodes: FloatArray, at: FloatArray) -> FloatArray:
    """Weights of values at nodes in the polynomial through them.

    Parameters
    ----------
    nodes : (p,) float
        Distinct.
    at : (m,) float
        Where to interpolate.

    Returns
    -------
    (m, p) float
    """
    gap = nodes[:, None] - nodes + np.eye(len(nodes))
    away = at[:, None, None] - nodes  # (m, 1, p): for polynomial j the factor of node k, without k = j
    factors = np.where(np.eye(len(nodes), dtype=bool), 1.0, away / gap)
    return np.asarray(factors.prod(axis=2))


def sampled_departure(case: PlanCase, curves: FloatArray, samples: int) -> FloatArray:
    """Sample the case's field less the pricing field along curves.

    Parameters
    ----------
    case : PlanCase
        Whose field.
    curves : (p, n + 1, 3) float, m
        Control points of the curves.
    samples : int
        Even times; the values there are interpolated from fewer.

    Returns
    -------
    (p, samples, 3) float, m/s2
    """
    times = chebyshev_nodes(0.0, 1.0, _TIME_NODES)
    path = bezier_basis(curves.shape[1] - 1, times) @ curves
    pull = accelerations(case.asteroid.gravity, path) - accelerations(pricing_field(case), path)
    weights = lagrange_weights(times, np.linspace(0.0, 1.0, samples))
    return np.asarray(weights @ pull.reshape(path.shape))
