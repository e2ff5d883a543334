"""The cube about the site in which a costly field is interpolated."""

from __future__ import annotations

import numpy as np

from landing_cli.body.gravity.interpolated import Cube
from landing_cli.observe.records import ObserveCase

MARGIN = 0.5
"""Room on every side of start and site, in their distance: for the bends that landmarks ask for."""
REACH, MOST_NEAR = 6.0, 40
"""Near the ground the field shall be as good as the flight's other figures: 1e-8 of itself."""


def cube_of(case: ObserveCase) -> Cube:
    """Place the cube: the start and the site well inside.

    Parameters
    ----------
    case : ObserveCase
        Its start and its site.

    Returns
    -------
    Cube
        A path that leaves it meets the polyhedron itself.
    """
    middle = 0.5 * (case.position_m + case.frame.origin_m)
    between = case.position_m - case.frame.origin_m
    room = MARGIN * float(np.linalg.norm(between))
    return Cube(middle, 0.5 * float(np.abs(between).max()) + room)
