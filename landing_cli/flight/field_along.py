"""Gravity and its gradient along a path, from few evaluations of a costly field.

Along a smooth path the field is a smooth function of time. It is evaluated at the Chebyshev nodes of panels
of time, which are halved until the last coefficients of every panel vanish.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations_and_gradients

FloatArray = NDArray[np.float64]

TOLERANCE = 1e-11
"""Last coefficients of a panel over its largest acceleration. Over a flight the error adds up to less than
this share of the fall in free flight: 1e-8 m where that is a kilometre."""
_NODES = 14
_HALVINGS = 8

_ANGLES = np.pi * (np.arange(_NODES) + 0.5) / _NODES
_AT = np.cos(_ANGLES)
_TO_COEFFICIENTS = np.cos(np.arange(_NODES)[:, None] * _ANGLES) * 2.0 / _NODES
_TO_COEFFICIENTS[0] /= 2.0


def field_along(
    field: GravityField,
    positions: Callable[[FloatArray], FloatArray],
    edges_s: FloatArray,
    t_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return gravity and its gradient along a path.

    Parameters
    ----------
    field : GravityField
        The field.
    positions : callable
        ``positions(t)`` gives the path at times (k,) as (k, 3), m, body frame; smooth between the edges.
    edges_s : (p + 1,) float, s
        Increasing; the first panels lie between them.
    t_s : (k,) float, s
        Where the field is asked for, between the first edge and the last.

    Returns
    -------
    g : (k, 3) float, m/s2, body frame
    G : (k, 3, 3) float, 1/s2
        The gradient of g.
    """
    starts, ends, coefficients = _resolved_panels(field, positions, np.asarray(edges_s, dtype=np.float64))
    panel = np.clip(np.searchsorted(starts, t_s, side="right") - 1, 0, len(starts) - 1)
    share = (2.0 * t_s - starts[panel] - ends[panel]) / (ends[panel] - starts[panel])
    angle = np.arccos(np.clip(share, -1.0, 1.0))
    terms = np.cos(angle[:, None] * np.arange(_NODES))
    values = np.einsum("tk,tkc->tc", terms, coefficients[panel])
    return values[:, :3], values[:, 3:].reshape(-1, 3, 3)


def _resolved_panels(
    field: GravityField, positions: Callable[[FloatArray], FloatArray], edges: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Starts and ends of the panels (p,), in order, and the coefficients of (g, G) on each, (p, k, 12)."""
    starts, ends = edges[:-1], edges[1:]
    done: list[tuple[FloatArray, FloatArray, FloatArray]] = []
    for level in range(_HALVINGS + 1):
        times = 0.5 * (starts + ends)[:, None] + 0.5 * (ends - starts)[:, None] * _AT
        g, G = accelerations_and_gradients(field, positions(times.ravel()))
        values = np.concatenate([g, G.reshape(-1, 9)], axis=1).reshape(len(starts), _NODES, 12)
        coefficients = _TO_COEFFICIENTS @ values
        tail = np.abs(coefficients[:, -2:, :3]).max(axis=(1, 2))
        fine = (tail <= TOLERANCE * np.linalg.norm(g, axis=1).max()) | (level == _HALVINGS)
        done.append((starts[fine], ends[fine], coefficients[fine]))
        middle = 0.5 * (starts + ends)[~fine]
        starts, ends = np.append(starts[~fine], middle), np.append(middle, ends[~fine])
        if not len(starts):
            break
    first, last, found = (np.concatenate(parts) for parts in zip(*done, strict=True))
    order = np.argsort(first)
    return first[order], last[order], found[order]
