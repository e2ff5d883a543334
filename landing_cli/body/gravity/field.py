"""One record for every gravity model: a kind and a flat parameter array.

The compiled kernels take ``(kind, params)``, so that a solver compiles once for all models (see `models`).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class GravityKind(IntEnum):
    """The gravity models; the values are part of the compiled kernels."""

    POINT_MASS = 0
    HARMONICS = 1
    DIPOLE = 2
    POLYHEDRON = 3
    BOXED = 4
    INTERPOLATED = 5


@dataclass(frozen=True, eq=False)
class GravityField:
    """A gravity field, fixed in the body frame about the centre of mass.

    Attributes
    ----------
    kind : GravityKind
        Which model the parameters belong to.
    params : (p,) float, SI
        The model's parameters, packed by its ``make_*`` function; read-only.
    """

    kind: GravityKind
    params: NDArray[np.float64]

    def __post_init__(self) -> None:
        """Freeze the parameter array."""
        params = np.array(self.params, dtype=np.float64).ravel()
        params.setflags(write=False)
        object.__setattr__(self, "params", params)
