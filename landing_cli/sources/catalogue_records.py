"""A list of minor planets as it was read: arrays, the file it came from, and the rows it could not use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from landing_cli.flight.elements import OrbitElements

FloatArray = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]
BoolArray = npt.NDArray[np.bool_]

UNKNOWN_CONDITION = -1


@dataclass(frozen=True)
class BadRow:
    """A row that was skipped.

    Attributes
    ----------
    line : int
        Line of the (unpacked) file, from 1; of a JSON file the entry of its list, from 1.
    reason : str
        What is wrong with it.
    """

    line: int
    reason: str


@dataclass(frozen=True, eq=False)
class Catalogue:
    """Minor planets with their osculating orbits.

    Attributes
    ----------
    designations : tuple of str
        Unpacked: the number where there is one (``154276``), else the provisional one (``2014 FR37``).
    elements : OrbitElements
        n rows, heliocentric, ecliptic and equinox J2000, each at its own epoch.
    absolute_magnitude : (n,) float
        H; NaN where the catalogue gives none.
    condition_code : (n,) int
        Uncertainty U, 0 (best) to 9; -1 where the catalogue gives none.
    numbered : (n,) bool
    source : str
        Name of the file.
    sha256 : str
        Of the file as it lies on the disk.
    bad_rows : tuple of BadRow
        What was skipped and why, in the order of the file.
    """

    designations: tuple[str, ...]
    elements: OrbitElements
    absolute_magnitude: FloatArray
    condition_code: IntArray
    numbered: BoolArray
    source: str
    sha256: str
    bad_rows: tuple[BadRow, ...] = ()

    def __len__(self) -> int:
        """Objects in the catalogue."""
        return len(self.designations)

    def take(self, indices: IntArray) -> Catalogue:
        """Choose objects.

        Parameters
        ----------
        indices : (m,) int
            Rows to keep, in the order wanted.

        Returns
        -------
        Catalogue
            m objects of the same source.
        """
        return Catalogue(
            tuple(self.designations[i] for i in indices),
            self.elements.rows(indices),
            self.absolute_magnitude[indices],
            self.condition_code[indices],
            self.numbered[indices],
            self.source,
            self.sha256,
            self.bad_rows,
        )
