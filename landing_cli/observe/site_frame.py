"""The frame fixed to the body at the landing site: x east, y north, z up."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from landing_cli.errors import InputRefused
from landing_cli.observe.records import FrameKind, SiteFrame

_LEAST_EAST = 1e-9  # sine of the angle between z and the spin axis below which east is rounding


def site_frame(origin_m: ArrayLike, normal: ArrayLike, kind: FrameKind, facet: int = -1) -> SiteFrame:
    """Put a frame on a landing site.

    Parameters
    ----------
    origin_m : (3,) float, m, body frame
        The landing site.
    normal : (3,) float, body frame
        The outward normal there, of any length.
    kind : {"radial", "normal"}
        Whether z points away from the body's origin (Shen 2026, section 1) or along the normal. On Eros the
        two differ by tens of degrees, and the radial z is then no "up" that terrain knows.
    facet : int, optional
        The site's facet, 0-based; -1 for a site that was given freely.

    Returns
    -------
    SiteFrame

    Raises
    ------
    InputRefused
        The site is the body's origin, or z is the spin axis, which leaves no east.
    """
    origin = np.array(origin_m, dtype=np.float64)
    outward = np.array(normal, dtype=np.float64)
    outward /= np.linalg.norm(outward)
    distance = float(np.linalg.norm(origin))
    if kind == "radial" and distance == 0.0:
        raise InputRefused("the site is the body's origin, which has no radial direction", where="site")
    z = origin / distance if kind == "radial" else outward
    east = np.cross([0.0, 0.0, 1.0], z)
    length = float(np.linalg.norm(east))
    if length < _LEAST_EAST:
        raise InputRefused(
            f"the {kind} frame's z is the spin axis: there is no east",
            where="site",
            fix=f"take the {'normal' if kind == 'radial' else 'radial'} frame, or another site",
        )
    x = east / length
    return SiteFrame(origin, np.stack([x, np.cross(z, x), z]), kind, facet, outward)
