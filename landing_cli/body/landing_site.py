"""Where on the surface a flight ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Site:
    """Where a plan lands.

    Attributes
    ----------
    position_m : (3,) float, m, body frame
        r_f (Lyu 2026, Table 1).
    normal : (3,) float, body frame
        n_f: outward unit normal of the landing plane.
    facet : int
        Facet of the mesh, 0-based; -1 where position and normal were given freely.
    """

    position_m: FloatArray
    normal: FloatArray
    facet: int = -1
