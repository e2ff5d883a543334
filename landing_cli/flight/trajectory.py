"""A flown trajectory, sampled in time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Trajectory:
    """States and thrust along a path, in the rotating body frame.

    Attributes
    ----------
    t_s : (n,) float, s
        Time since the initial state.
    position_m : (n, 3) float, m
    velocity_m_s : (n, 3) float, m/s, relative to the rotating frame
    mass_kg : (n,) float, kg
    thrust_n : (n, 3) float, N
    """

    t_s: FloatArray
    position_m: FloatArray
    velocity_m_s: FloatArray
    mass_kg: FloatArray
    thrust_n: FloatArray
