"""A catalogue of asteroids as it was read: elements, magnitudes, and the rows that were no use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.elements import OrbitElements

FloatArray = NDArray[np.float64]

UNKNOWN_CONDITION = -1
"""Condition code of an orbit whose source gives none."""


@dataclass(frozen=True)
class BadRow:
    """A row that was left out.

    Attributes
    ----------
    line : int
        1-based line of the file; of a JSON list, the 1-based entry.
    reason : str
        What is wrong with it.
    """

    line: int
    reason: str


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Asteroids and their orbits, in the order of their source.

    Attributes
    ----------
    designations : tuple of str
        Unpacked: ``12923``, ``2018 QE``.
    elements : OrbitElements
        Osculating heliocentric elements, ecliptic and equinox J2000, each at its own epoch; (n,) arrays.
    absolute_magnitude : (n,) float
        H; NaN where the source gives none.
    condition_code : (n,) int
        The MPC's U (0 best to 9), `UNKNOWN_CONDITION` where the source gives none.
    numbered : (n,) bool
        Whether the orbit has a permanent number.
    source : str
        Name of the file that was read, for people.
    sha256 : str
        Of the bytes that were read.
    bad_rows : tuple of BadRow
        Rows that were left out, and why.
    """

    designations: tuple[str, ...]
    elements: OrbitElements
    absolute_magnitude: FloatArray
    condition_code: NDArray[np.int64]
    numbered: NDArray[np.bool_]
    source: str
    sha256: str
    bad_rows: tuple[BadRow, ...] = ()

    def __len__(self) -> int:
        return len(self.designations)
