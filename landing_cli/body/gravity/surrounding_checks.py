"""Whether the parameters of a field around a body lead nowhere that the kernels must not read."""

from __future__ import annotations

import numpy as np

from landing_cli.body.gravity.facet_potential import FACET
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.surrounding_fit import count_of
from landing_cli.body.gravity.surrounding_kernels import FAR_DEGREE, HEADER, NEAR_DEGREE, OUTER_DEGREE


def is_sound(params: FloatArray) -> bool:
    """Tell whether every place that the parameters name lies among them.

    Parameters
    ----------
    params : (p,) float
        Finite. What follows the first place that they name is not looked at: it is a polyhedron's.

    Returns
    -------
    bool
    """
    if len(params) <= HEADER or not _whole(params[:2], HEADER + 1, len(params)) or not params[3] > 0.0:
        return False
    end, coefficients = int(params[0]), int(params[1])
    if coefficients + count_of(OUTER_DEGREE) > end:
        return False
    nodes, seen = np.zeros(1, dtype=np.int64), 0
    while len(nodes):
        seen += len(nodes)
        if seen > len(params) or HEADER + nodes.max() >= coefficients:
            return False
        values = params[HEADER + nodes]
        parents, pieces = values > 0.0, -values[values < 0.0]
        # children come after their parents: no way down leads back
        if not (values[parents] > nodes[parents]).all() or not _whole(values[parents], 1, coefficients):
            return False
        if not _are_pieces(params, pieces, coefficients, end):
            return False
        nodes = (values[parents].astype(np.int64)[:, None] + np.arange(8)).ravel()
    return True


def _are_pieces(params: FloatArray, places: FloatArray, coefficients: int, end: int) -> bool:
    """Whether the pieces that begin at these places have their coefficients and their facets."""
    if not _whole(places, HEADER + 1, coefficients - 2):
        return False
    own = places.astype(np.int64)
    far, counts = params[own + 1] > 0.0, params[own + 2]
    needed = np.where(far, count_of(FAR_DEGREE), count_of(NEAR_DEGREE))
    if not _whole(params[own], coefficients, end) or not (params[own] + needed <= end).all():
        return False
    if not _whole(counts, 0, coefficients) or not (own + 3 + counts <= coefficients).all():
        return False
    of_piece = np.repeat(np.arange(len(own)), counts.astype(np.int64))
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64) if len(own) else own
    near = params[own[of_piece] + 3 + np.arange(len(of_piece)) - first[of_piece]]
    return _whole(near, HEADER + 1, coefficients - FACET + 1)


def _whole(values: FloatArray, least: int, end: int) -> bool:
    """Whether all are whole numbers from ``least`` on, below ``end``."""
    return bool(((values == np.floor(values)) & (values >= least) & (values < end)).all())
