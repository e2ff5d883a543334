"""What a stored run of `tour` holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.sources.catalogue_records import Catalogue
from landing_cli.tour.records import Departure, DepthReport, FlybyChain, SearchLimits, SearchMethod

FloatArray = NDArray[np.float64]

RunKind = Literal["search", "compare"]


@dataclass(frozen=True, eq=False)
class ChainPath:
    """The N-body flight of a chain, sampled; a burn stands between two arcs, and its time in both.

    Attributes
    ----------
    t_s : (n,) float, s
        TDB seconds past J2000.
    position_m, velocity_m_s : (n, 3) float, m and m/s
        Heliocentric, ecliptic and equinox J2000.
    earth_m : (n, 3) float, m
        The Earth, in the same axes.
    arc : (n,) int
        Which coast a sample belongs to: 0 before the first burn, i after burn i.
    """

    t_s: FloatArray
    position_m: FloatArray
    velocity_m_s: FloatArray
    earth_m: FloatArray
    arc: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class TourFacts:
    """What all chains of a run share.

    Attributes
    ----------
    name : str
        Of the scenario.
    kind : {"search", "compare"}
    method : {"beam", "layered"}
        How chains were searched.
    departure : Departure
    limits : SearchLimits
    albedo : float
        Assumed for sizes.
    ephemeris : str
        Kernel that the planets' positions come from.
    targets : Catalogue
        The asteroids that the chains pass; legs count its rows.
    catalogue_rows, catalogue_bad_rows, searched_targets : int
        Rows read, rows left out as bad, and asteroids that were searched.
    """

    name: str
    kind: RunKind
    method: SearchMethod
    departure: Departure
    limits: SearchLimits
    albedo: float
    ephemeris: str
    targets: Catalogue
    catalogue_rows: int
    catalogue_bad_rows: int
    searched_targets: int


@dataclass(frozen=True, eq=False)
class SchemeModel:
    """A printed scheme past asteroids where the paper seems to have had them: two-body orbits of late 2020.

    Attributes
    ----------
    delta_v_m_s : (k,) float, m/s
        Burns at instants of the printed days at which the asteroids stand at the printed distances from the
        Earth (or nearest to them), chosen within the rounding to come nearest to the printed burns.
    least_m_s : (k,) float, m/s
        Burns at the instants of the printed days for which their sum is least.
    """

    delta_v_m_s: FloatArray
    least_m_s: FloatArray


@dataclass(frozen=True)
class PrintedDay:
    """An asteroid on the day that the paper prints for its flyby, on its two-body orbit of late 2020.

    Attributes
    ----------
    scheme : int
        Of Table 2.
    designation : str
    least_m, greatest_m : float, m
        Distance from the Earth in the course of the day.
    """

    scheme: int
    designation: str
    least_m: float
    greatest_m: float


@dataclass(frozen=True, eq=False)
class ChainEntry:
    """One chain of a run.

    Attributes
    ----------
    name : str
        ``chain_01``, best first; in a comparison ``scheme_02``.
    chain : FlybyChain
    path : ChainPath or None
        None where no flight was found.
    facts : TourFacts
    model : SchemeModel or None
        In a comparison: the same scheme in the paper's own terms.
    """

    name: str
    chain: FlybyChain
    path: ChainPath | None
    facts: TourFacts
    model: SchemeModel | None = None


@dataclass(frozen=True, eq=False)
class TourRun:
    """Chains of flybys, best first.

    Attributes
    ----------
    cases : tuple of ChainEntry
        Of a search, those that hold in N-body; of a comparison, all schemes.
    facts : TourFacts
    depths : tuple of DepthReport
        How far the search looked.
    nearest : FlybyChain or None
        Where no chain keeps to the limits: the one that came nearest.
    broken : tuple of FlybyChain
        Chains of a search that do not hold in N-body.
    days : tuple of PrintedDay
        In a comparison: every flyby of Table 2 whose asteroid is among the targets.
    """

    cases: tuple[ChainEntry, ...]
    facts: TourFacts
    depths: tuple[DepthReport, ...]
    nearest: FlybyChain | None
    broken: tuple[FlybyChain, ...] = ()
    days: tuple[PrintedDay, ...] = ()
