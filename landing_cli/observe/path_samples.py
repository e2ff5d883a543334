"""Positions of a flown path between its nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.observe.observed import Path

FloatArray = NDArray[np.float64]


def positions_at(path: Path, t_s: FloatArray) -> FloatArray:
    """Interpolate a path by the cubics through its positions and velocities.

    Parameters
    ----------
    path : Path
        The flown path.
    t_s : (T,) float, s
        Times between 0 and t_f.

    Returns
    -------
    (T, 3) float, m, body frame
        Off by h^4/384 of the fourth derivative, which a thrust linear over h leaves to the natural
        acceleration: far below a micrometre at seconds between nodes.
    """
    i = np.clip(np.searchsorted(path.t_s, t_s, side="right") - 1, 0, len(path.t_s) - 2)
    h = (path.t_s[i + 1] - path.t_s[i])[:, None]
    s = (np.asarray(t_s) - path.t_s[i])[:, None] / h
    r0, r1 = path.position_m[i], path.position_m[i + 1]
    d0, d1 = h * path.velocity_m_s[i], h * path.velocity_m_s[i + 1]
    return r0 + s * (d0 + s * (3.0 * (r1 - r0) - 2.0 * d0 - d1 + s * (2.0 * (r0 - r1) + d0 + d1)))
