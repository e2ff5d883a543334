"""What a flyby tour asks and what its search and its re-flight answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SearchMethod = Literal["beam", "layered"]
ChainStatus = Literal["hint", "flown", "broken"]


@dataclass(frozen=True, eq=False)
class Departure:
    """The state from which the spacecraft sets out.

    Attributes
    ----------
    t_s : float, s
        TDB seconds past J2000.
    position_m, velocity_m_s : (3,) float, m and m/s
        Heliocentric, ecliptic and equinox J2000.
    geocentric_distance_m : float, m
    angle_rad : float, rad
        Of the geocentric position in the ecliptic, counter-clockwise from the Earth towards the Sun.
    radial_speed_m_s : float, m/s
        Outward geocentric speed.
    """

    t_s: float
    position_m: FloatArray
    velocity_m_s: FloatArray
    geocentric_distance_m: float
    angle_rad: float
    radial_speed_m_s: float


@dataclass(frozen=True)
class TargetLimits:
    """Which asteroids of a catalogue are targets.

    Attributes
    ----------
    perihelion_max_m : float, m
    absolute_magnitude_max : float
        Faintest H; ``inf`` takes also the ones without H.
    condition_code_max : int or None
        Worst U; None takes also the ones without U.
    numbered_only : bool
    excluded : tuple of str
        Designations that are left out.
    albedo : float
        Geometric albedo that turns H into a diameter (eq 3).
    """

    perihelion_max_m: float
    absolute_magnitude_max: float
    condition_code_max: int | None
    numbered_only: bool
    excluded: tuple[str, ...]
    albedo: float


@dataclass(frozen=True)
class SearchLimits:
    """What every chain must keep to.

    Attributes
    ----------
    delta_v_m_s : float, m/s
        Largest sum over the chain.
    end_t_s : float, s
        TDB seconds past J2000: the last flyby is no later.
    geocentric_distance_m : float, m
        R_m of eq 4: how far from the Earth a flyby may be; ``inf`` where nothing binds.
    asteroids_max : int
        Longest chain that is looked for.
    revolutions_max : int
        Whole revolutions that a leg may make.
    first_burn_wait_s : float, s
        dt of eq 4: the first burn is no later than this after the departure.
    """

    delta_v_m_s: float
    end_t_s: float
    geocentric_distance_m: float
    asteroids_max: int
    revolutions_max: int
    first_burn_wait_s: float


@dataclass(frozen=True)
class BeamOptions:
    """Choices of the beam search.

    Attributes
    ----------
    beam : int
        Partial chains kept at each depth.
    time_step_s : float, s
        Grid of arrival times.
    waits_s : tuple of float, s
        Waiting times between a flyby and the next burn that are tried.
    branches : int
        Next targets that are tried from each partial chain.
    kept_chains : int
        Chains handed on to the re-flight.
    """

    beam: int
    time_step_s: float
    waits_s: tuple[float, ...]
    branches: int
    kept_chains: int


@dataclass(frozen=True)
class LayeredOptions:
    """Choices of the multi-layer preferential selection (Liu 2023, section 2.3).

    Attributes
    ----------
    distance_m : float, m
        d: coast distance beyond which a target is dropped in the first selection.
    k1, k2, k3 : int
        Targets kept by each criterion of the first, second and third selection.
    time_step_s : float, s
        Grid of arrival times of the transfer design.
    kept_chains : int
        Chains handed on to the re-flight.
    """

    distance_m: float
    k1: int
    k2: int
    k3: int
    time_step_s: float
    kept_chains: int


@dataclass(frozen=True, eq=False)
class Leg:
    """One burn and the arc from it to the next flyby.

    Attributes
    ----------
    target : int
        Row of the catalogue.
    designation : str
    burn_t_s, arrival_t_s : float, s
        TDB seconds past J2000.
    delta_v_m_s : (3,) float, m/s
        The burn, impulsive; heliocentric ecliptic axes.
    revolutions : int
        Whole revolutions about the Sun between burn and arrival.
    """

    target: int
    designation: str
    burn_t_s: float
    arrival_t_s: float
    delta_v_m_s: FloatArray
    revolutions: int

    @property
    def size_m_s(self) -> float:
        """Magnitude of the burn, m/s."""
        return float(np.linalg.norm(self.delta_v_m_s))


@dataclass(frozen=True, eq=False)
class Flyby:
    """The encounter at the end of a leg, of the flight that the chain's status names.

    Attributes
    ----------
    designation : str
    t_s : float, s
        TDB seconds past J2000.
    position_m : (3,) float, m
        The asteroid, heliocentric ecliptic J2000.
    relative_velocity_m_s : (3,) float, m/s
        Of the spacecraft relative to the asteroid.
    phase_angle_rad : float, rad
        Sun - asteroid - spacecraft on approach.
    geocentric_distance_m : float, m
    absolute_magnitude : float
        H.
    diameter_m : float, m
        From H and the assumed albedo (eq 3 with 1329 km).
    apparent_magnitude : float
        From the Earth, IAU H-G with G = 0.15.
    miss_m : float, m
        Distance between spacecraft and asteroid that the flight leaves.
    """

    designation: str
    t_s: float
    position_m: FloatArray
    relative_velocity_m_s: FloatArray
    phase_angle_rad: float
    geocentric_distance_m: float
    absolute_magnitude: float
    diameter_m: float
    apparent_magnitude: float
    miss_m: float

    @property
    def speed_m_s(self) -> float:
        """Relative speed, m/s."""
        return float(np.linalg.norm(self.relative_velocity_m_s))


@dataclass(frozen=True, eq=False)
class FlybyChain:
    """A sequence of flybys.

    Attributes
    ----------
    departure_t_s : float, s
        TDB seconds past J2000.
    legs : tuple of Leg
        As the search found them, heliocentric two-body: a hint.
    nbody_legs : tuple of Leg or None
        The same legs corrected in N-body; None before that and where the correction failed.
    flybys : tuple of Flyby
        Of the N-body flight where the status is ``flown``, else of the two-body legs.
    status : {"hint", "flown", "broken"}
        ``hint`` was not re-flown yet; ``flown`` passes every asteroid in N-body within the search limits;
        ``broken`` does not.
    message : str
        Why it broke, in the analyst's words; empty otherwise.
    """

    departure_t_s: float
    legs: tuple[Leg, ...]
    nbody_legs: tuple[Leg, ...] | None
    flybys: tuple[Flyby, ...]
    status: ChainStatus
    message: str = ""

    @property
    def targets(self) -> tuple[str, ...]:
        """Designations in order of flyby."""
        return tuple(leg.designation for leg in self.legs)

    @property
    def best_legs(self) -> tuple[Leg, ...]:
        """N-body legs where there are any, else the two-body ones."""
        return self.legs if self.nbody_legs is None else self.nbody_legs

    @property
    def delta_v_m_s(self) -> float:
        """Sum of the two-body burns, m/s."""
        return sum((leg.size_m_s for leg in self.legs), 0.0)

    @property
    def nbody_delta_v_m_s(self) -> float:
        """Sum of the N-body burns, m/s; NaN where there are none."""
        return np.nan if self.nbody_legs is None else sum((leg.size_m_s for leg in self.nbody_legs), 0.0)

    @property
    def duration_s(self) -> float:
        """From the departure to the last flyby, s."""
        return self.best_legs[-1].arrival_t_s - self.departure_t_s


@dataclass(frozen=True)
class DepthReport:
    """How far the search looked at one length of chain.

    Attributes
    ----------
    asteroids : int
        Length of the chains.
    tried : int
        Transfers that were computed.
    within_limits : int
        Of them, those that keep to every limit.
    kept : int
        Chains from which the search went on.
    least_delta_v_m_s : float, m/s
        Least two-body sum of a chain of this length, beyond the limit too; NaN where none was computed.
    """

    asteroids: int
    tried: int
    within_limits: int
    kept: int
    least_delta_v_m_s: float


@dataclass(frozen=True, eq=False)
class SearchOutcome:
    """What a search found.

    Attributes
    ----------
    chains : tuple of FlybyChain
        Hints, longest first, then by their two-body delta-v; no sequence of targets twice.
    depths : tuple of DepthReport
    nearest : FlybyChain or None
        Where no chain keeps to the limits: the one that came nearest.
    """

    chains: tuple[FlybyChain, ...]
    depths: tuple[DepthReport, ...]
    nearest: FlybyChain | None
