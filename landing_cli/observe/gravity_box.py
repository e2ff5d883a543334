"""The box above the site in which a costly field is interpolated."""

from __future__ import annotations

import numpy as np

from landing_cli.body.gravity.boxed import Box
from landing_cli.observe.records import ObserveCase

MARGIN = 0.5
"""Room on every side of start and site, in their distance: for the bends that landmarks ask for."""


def box_of(case: ObserveCase) -> Box:
    """Place the box: its floor in the plane of the site's facet, the start and the site well inside.

    Parameters
    ----------
    case : ObserveCase
        Its start and its site.

    Returns
    -------
    Box
        A path that leaves it meets the polyhedron itself.
    """
    up = case.frame.normal
    # the axis least along the normal gives the first horizontal direction
    across = np.cross(np.eye(3)[int(np.argmin(np.abs(up)))], up)
    across /= np.linalg.norm(across)
    axes = np.stack([across, np.cross(up, across), up])
    start = axes @ (case.position_m - case.frame.origin_m)
    room = MARGIN * float(np.linalg.norm(start))
    lower, upper = np.minimum(start, 0.0) - room, np.maximum(start, 0.0) + room
    lower[2] = 0.0
    return Box(case.frame.origin_m, axes, lower, upper)
