"""Names for what the gravity kernels take and return."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.float64]
Params: TypeAlias = NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Symmetric: TypeAlias = tuple[float, float, float, float, float, float]
"""A symmetric tensor: xx, yy, zz, xy, xz, yz."""
VectorAndSymmetric: TypeAlias = tuple[float, float, float, float, float, float, float, float, float]
