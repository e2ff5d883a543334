"""What a dispersion asks and what it answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.reach.records import LandingCase
from landing_cli.results.columns import Column

FloatArray = NDArray[np.float64]
Verdicts = NDArray[np.uint8]
Axes = Literal["body", "radial_along_cross"]

# Position, velocity (three each), mass, thrust and GM: what a sample draws, in this order.
DRAWN = 9


class Driver(IntEnum):
    """A dispersed quantity, by the axes that the state is dispersed along."""

    NONE = 0
    POSITION_X = 1
    POSITION_Y = 2
    POSITION_Z = 3
    VELOCITY_X = 4
    VELOCITY_Y = 5
    VELOCITY_Z = 6
    POSITION_RADIAL = 7
    POSITION_ALONG = 8
    POSITION_CROSS = 9
    VELOCITY_RADIAL = 10
    VELOCITY_ALONG = 11
    VELOCITY_CROSS = 12
    MASS = 13
    THRUST = 14
    GM = 15

    @property
    def words(self) -> str:
        """As a sentence names it."""
        if self is Driver.NONE:
            return "nothing"
        if self >= Driver.MASS:
            return {Driver.MASS: "the mass", Driver.THRUST: "the thrust"}.get(self, "GM")
        what, axis = self.name.lower().split("_")
        if axis in "xyz":
            return f"the {what} along {axis}"
        return f"the {axis if axis == 'radial' else f'{axis}-track'} {what}"


def drivers_of(axes: Axes) -> tuple[Driver, ...]:
    """Return the nine drawn quantities in the order of the draws."""
    first = Driver.POSITION_X if axes == "body" else Driver.POSITION_RADIAL
    state = (Driver(first + k) for k in range(6))
    return (*state, Driver.MASS, Driver.THRUST, Driver.GM)


@dataclass(frozen=True, eq=False)
class Spread:
    """How the start is dispersed: independent normals, but for the state's covariance.

    Attributes
    ----------
    axes : {"body", "radial_along_cross"}
        Along which the state's deviations are given; see `axes.state_axes`.
    state_factor : (6, 6) float, m and m/s
        Lower triangular L; the covariance of position and velocity is L L'.
    mass_sigma_kg, thrust_sigma_n, gm_sigma_m3_s2 : float
        One sigma of mass, largest thrust and GM.
    """

    axes: Axes
    state_factor: FloatArray
    mass_sigma_kg: float
    thrust_sigma_n: float
    gm_sigma_m3_s2: float

    @property
    def factor(self) -> FloatArray:
        """Factor of all nine quantities' covariance, (9, 9)."""
        whole = np.diag([0.0] * 6 + [self.mass_sigma_kg, self.thrust_sigma_n, self.gm_sigma_m3_s2])
        whole[:6, :6] = self.state_factor
        return whole

    @property
    def sigmas(self) -> FloatArray:
        """One sigma of each of the nine quantities, (9,), SI."""
        return np.asarray(np.sqrt((self.factor**2).sum(axis=1)))


@dataclass(frozen=True, eq=False)
class Drawing:
    """What all cases of a dispersion share.

    Attributes
    ----------
    seed, samples : int
        Sample k of any number of samples depends on the seed and k alone.
    confidence : float
        Level of the intervals.
    spread : Spread
    """

    seed: int
    samples: int
    confidence: float
    spread: Spread


SAMPLE_COLUMNS: tuple[Column, ...] = (
    Column("sample", "i4", "1", "sample, 0-based"),
    Column("position_m", "f8", "m", "drawn initial position, body frame", (3,)),
    Column("velocity_m_s", "f8", "m s-1", "drawn initial velocity, rotating frame", (3,)),
    Column("mass_kg", "f8", "kg", "drawn initial mass"),
    Column("thrust_max_n", "f8", "N", "drawn largest thrust"),
    Column("gm_m3_s2", "f8", "m3 s-2", "drawn gravitational parameter"),
    Column("reachable", "i4", "1", "facets that are reachable in this sample"),
    Column("unreachable", "i4", "1", "facets that are not"),
    Column("unresolved", "i4", "1", "facets of which neither was found"),
    Column("reachable_area_m2", "f8", "m2", "area of the reachable facets"),
)

FACET_COLUMNS: tuple[Column, ...] = (
    Column("facet", "i4", "1", "facet, 0-based, in the shape file's order"),
    Column("reachable", "i4", "1", "samples in which the facet is reachable"),
    Column("unreachable", "i4", "1", "samples in which it is not"),
    Column("unresolved", "i4", "1", "samples in which neither was found"),
    Column("probability", "f8", "1", "share of all samples in which the facet is reachable"),
    Column(
        "probability_low",
        "f8",
        "1",
        "lower end of the interval (Clopper-Pearson), every unresolved sample taken as unreachable",
    ),
    Column(
        "probability_high", "f8", "1", "upper end of the interval, every unresolved sample taken as reachable"
    ),
    Column("driver", "u1", "1", "drawn quantity that the verdict follows most", flags=Driver),
    Column("driver_correlation", "f8", "1", "Spearman's rank correlation of the verdict with it"),
)


def dtype_of(columns: tuple[Column, ...]) -> np.dtype[Any]:
    """Return the type of a table's rows."""
    return np.dtype([(c.name, c.dtype, c.shape) for c in columns])


@dataclass(frozen=True, eq=False)
class CaseDispersion:
    """What a dispersion found for one case.

    Attributes
    ----------
    case : LandingCase
        As the scenario has it, without any deviation.
    initial_state : str
        Name of the initial state.
    drawing : Drawing
    verdicts : (samples, facets) uint8
        Values of `landing_cli.reach.records.Verdict`.
    samples : (samples,) structured array of SAMPLE_COLUMNS
    facets : (facets,) structured array of FACET_COLUMNS
    summary : mapping
        Numbers, text and mappings of them, as printed.
    lost : mapping of (int, int) to str
        Why a facet of a sample could not be solved, by sample and facet; unresolved in ``verdicts``.
    """

    case: LandingCase
    initial_state: str
    drawing: Drawing
    verdicts: Verdicts
    samples: NDArray[np.void]
    facets: NDArray[np.void]
    summary: Mapping[str, Any] = field(default_factory=dict)
    lost: Mapping[tuple[int, int], str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DispersionRun:
    """A dispersion: every case of one spacecraft over one asteroid, in the same draws.

    Attributes
    ----------
    cases : tuple of CaseDispersion
        At least one, in the scenario's order.
    """

    cases: tuple[CaseDispersion, ...]

    @property
    def asteroid(self) -> Asteroid:
        """The asteroid, as the scenario has it."""
        return self.cases[0].case.asteroid

    @property
    def spacecraft(self) -> Spacecraft:
        """The spacecraft, as the scenario has it."""
        return self.cases[0].case.spacecraft

    @property
    def drawing(self) -> Drawing:
        """What all cases share."""
        return self.cases[0].drawing

    @property
    def lost_solves(self) -> int:
        """How many facets of all samples could not be solved."""
        return sum(len(case.lost) for case in self.cases)
