"""The axes that a state is dispersed along."""

from __future__ import annotations

import numpy as np

from landing_cli.errors import InputRefused
from landing_cli.reach.records import LandingCase
from landing_cli.studies.disperse.records import Axes, FloatArray

# Slower than this, over the speed of the surface below, a start has no direction of motion.
_AT_REST = 1e-9


def state_axes(case: LandingCase, axes: Axes) -> FloatArray:
    """Return the axes that a case's state is dispersed along.

    Parameters
    ----------
    case : LandingCase
        Without deviation.
    axes : {"body", "radial_along_cross"}
        Body axes; or radial (away from the origin), along (the inertial velocity's part across the radius)
        and cross (radial times along).

    Returns
    -------
    (3, 3) float
        Rows: unit vectors in the body frame.

    Raises
    ------
    InputRefused
        The initial state has no direction of motion across the radius.
    """
    if axes == "body":
        return np.eye(3)
    r, spin = case.position_m, case.asteroid.rotation_rate_rad_s
    radial = r / np.linalg.norm(r)
    inertial = case.velocity_m_s + np.cross([0.0, 0.0, spin], r)
    across = inertial - (inertial @ radial) * radial
    speed = float(np.linalg.norm(across))
    if not speed > _AT_REST * (np.linalg.norm(case.velocity_m_s) + spin * np.linalg.norm(r)):
        raise InputRefused(
            f"{case.name} does not move across the radius in inertial space: it has no along and no cross",
            where="disperse.axes",
            fix="take body axes",
        )
    along = across / speed
    return np.stack([radial, along, np.cross(radial, along)])
