"""The scenario of a flyby tour: departure, targets, limits, search."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

from landing_cli.scenario.schema_base import Number3, Section, wrong

EARTH_RADIUS_KM = 6378.137
AU_KM = 149_597_870.7
LONGEST_D = 30 * 366
Days = Annotated[float, Field(ge=0, le=3653)]
Designation = Annotated[
    str, Field(pattern=r"^([0-9]{1,7}|[12][0-9]{3} [A-Z]{2}[0-9]{0,3}|[0-9]{4} (P-L|T-[123]))$")
]
AltitudeRange = tuple[
    Annotated[float, Field(gt=0, le=1e9)],
    Annotated[float, Field(gt=0, le=1e9)],
]
Kilometres = Annotated[float, Field(gt=0, le=1e9)]


def _date(text: str) -> str:
    """Refuse what is no UTC date, or one with another offset, of 1972 (leap seconds) to 2199."""
    try:
        moment = datetime.fromisoformat(text)
    except ValueError:
        moment = None
    if moment is None or moment.utcoffset() not in (None, UTC.utcoffset(None)):
        raise PydanticCustomError(
            "contradiction",
            "{what}",
            {"key": "", "what": f"{text[:40]!r} is no UTC date", "fix": "as in 2021-04-08T15:36:00"},
        )
    if not 1972 <= moment.year < 2200:
        raise PydanticCustomError(
            "contradiction",
            "{what}",
            {"key": "", "what": f"{text[:40]!r} is not between 1972 and 2199", "fix": "check the year"},
        )
    return text


UtcDate = Annotated[str, Field(max_length=40), AfterValidator(_date)]


class DepartureSection(Section):
    """Where the spacecraft sets out: a state about the Earth, ecliptic and equinox J2000."""

    epoch_utc: UtcDate = Field(description="date of this state, UTC: 2021-04-08T15:36:00")
    distance_km: Kilometres | None = Field(default=None, description="distance from the Earth's centre, km")
    sun_angle_deg: float | None = Field(
        default=None,
        ge=-360,
        le=360,
        description="direction from the Earth in the ecliptic, counter-clockwise from the Sun's, deg",
    )
    radial_speed_m_s: float | None = Field(
        default=None,
        ge=-2e4,
        le=2e4,
        description="geocentric speed away from the Earth, m/s; there is no other",
    )
    position_km: Number3 | None = Field(
        default=None, description="geocentric position, km, instead of distance, angle and radial speed"
    )
    velocity_m_s: Number3 | None = Field(
        default=None, description="geocentric velocity, m/s; with position_km"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two states, half a state, and one inside the Earth or beyond its surroundings."""
        polar = ("distance_km", "sun_angle_deg", "radial_speed_m_s")
        vectors = ("position_km", "velocity_m_s")
        given = [name for name in (*polar, *vectors) if getattr(self, name) is not None]
        wanted = vectors if given and given[0] in vectors else polar
        for name in given:
            if name not in wanted:
                raise wrong(
                    name, f"stands beside {given[0]}", f"give {', '.join(polar)}; or position and velocity"
                )
        for name in wanted:
            if name not in given:
                raise wrong(name, "is missing", "a state needs " + ", ".join(wanted))
        key = wanted[0]
        distance = self.start_distance_km
        if distance <= EARTH_RADIUS_KM:
            raise wrong(
                key,
                f"is inside the Earth: {distance:g} km from its centre",
                f"its radius is {EARTH_RADIUS_KM:g} km",
            )
        if distance > AU_KM:
            raise wrong(key, "is more than 1 au from the Earth", "check the unit: km")

    @property
    def start_distance_km(self) -> float:
        """Distance from the Earth's centre, km."""
        if self.position_km is None:
            assert self.distance_km is not None
            return self.distance_km
        return float(sum(x * x for x in self.position_km) ** 0.5)


class TargetsSection(Section):
    """Which asteroids of the catalogue are targets."""

    perihelion_max_au: float = Field(default=1.2, gt=0, le=10, description="largest perihelion distance, au")
    absolute_magnitude_max: float | None = Field(
        default=None,
        ge=-5,
        le=40,
        description="faintest absolute magnitude H; also the ones without H unless given",
    )
    condition_code_max: int | None = Field(
        default=None, ge=0, le=9, description="worst condition code U; also the ones without U unless given"
    )
    numbered_only: bool = Field(default=False, description="whether only numbered asteroids are targets")
    exclude: tuple[Designation, ...] = Field(
        default=(), max_length=1000, description="designations left out, as 12923 or 2014 NQ64"
    )
    albedo: float = Field(
        default=0.15,
        gt=0,
        le=1,
        description="geometric albedo that makes a diameter of an absolute magnitude",
    )


class LimitsSection(Section):
    """What every chain of flybys keeps to."""

    delta_v_m_s: float = Field(gt=0, le=1e5, description="largest sum of the burns, m/s")
    end_utc: UtcDate = Field(description="date of the last flyby, at the latest, UTC")
    geocentric_distance_max_km: Kilometres | None = Field(
        default=None, description="communication range: how far from the Earth a flyby may be, km"
    )
    asteroids_max: int = Field(default=8, ge=1, le=30, description="longest chain that is looked for")
    revolutions_max: int = Field(
        default=1, ge=0, le=5, description="whole revolutions about the Sun that one leg may make"
    )
    first_burn_wait_d: Days = Field(
        default=30.0, description="the first burn comes at most so long after the departure, d (dt of eq 4)"
    )


class BeamSection(Section):
    """The beam search: the best partial chains are extended, flyby by flyby."""

    beam: int = Field(default=200, ge=1, le=100_000, description="partial chains kept at each length")
    time_step_d: float = Field(default=4.0, gt=0, le=100, description="grid of arrival times, d")
    waits_d: tuple[Days, ...] = Field(
        default=(0.0, 30.0),
        min_length=1,
        max_length=100,
        description="waiting times between a flyby and the next burn that are tried, d",
    )
    branches: int = Field(
        default=60,
        ge=1,
        le=10_000,
        description="next targets that are solved exactly from each partial chain",
    )
    kept_chains: int = Field(
        default=40, ge=1, le=10_000, description="chains, best first, that are flown again in N-body"
    )


class LayeredSection(Section):
    """The multi-layer preferential selection of Liu et al. (2023), section 2.3."""

    coast_distance_max_km: Kilometres = Field(
        default=3e7, description="d: first selection drops targets that the coast passes farther away, km"
    )
    k1: int = Field(default=20, ge=1, le=100_000, description="kept by each criterion of the first selection")
    k2: int = Field(default=5, ge=1, le=100_000, description="kept by each criterion of the second selection")
    k3: int = Field(default=20, ge=1, le=100_000, description="kept by each criterion of the third selection")
    time_step_d: float = Field(default=2.0, gt=0, le=100, description="grid of arrival times, d")
    kept_chains: int = Field(
        default=40, ge=1, le=10_000, description="chains, best first, that are flown again in N-body"
    )


def _check_ranges(orbits: Section) -> None:
    for name in ("periapsis_altitude_km", "apoapsis_altitude_km"):
        low, high = getattr(orbits, name)
        if low >= high:
            raise wrong(f"{name}.1", f"{high:g} is not above {low:g}", "the lower altitude comes first")


class MoonOrbits(Section):
    """Orbits about the Moon that `tour escape` leaves; by default those of Liu et al. (2023)."""

    periapsis_altitude_km: AltitudeRange = Field(
        default=(100.0, 5000.0), description="lowest and highest perilune altitude, km"
    )
    apoapsis_altitude_km: AltitudeRange = Field(
        default=(100.0, 66_000.0), description="lowest and highest apolune altitude, km"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a range that runs backwards."""
        _check_ranges(self)


class EarthOrbits(Section):
    """Orbits about the Earth that `tour escape` leaves; by default those of Liu et al. (2023)."""

    periapsis_altitude_km: AltitudeRange = Field(
        default=(100.0, 36_000.0), description="lowest and highest perigee altitude, km"
    )
    apoapsis_altitude_km: AltitudeRange = Field(
        default=(380_000.0, 1_500_000.0), description="lowest and highest apogee altitude, km"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a range that runs backwards."""
        _check_ranges(self)


class EscapeSection(Section):
    """Velocity increments that leave the Moon and the Earth: `tour escape`."""

    moon: MoonOrbits = Field(default=MoonOrbits(), description="orbits about the Moon")
    earth: EarthOrbits = Field(default=EarthOrbits(), description="orbits about the Earth")
    points: int = Field(default=81, ge=2, le=1001, description="altitudes along each axis of the maps")


class TourSection(Section):
    """The asteroids that a spare spacecraft can fly by."""

    catalogue: str = Field(
        default="liu2023",
        min_length=1,
        max_length=1000,
        description="liu2023 (the paper's ten asteroids, shipped), or a file: MPCORB, MPC JSON, SBDB CSV",
    )
    ephemeris: str = Field(
        default="DE440",
        min_length=1,
        max_length=1000,
        description="planets, Earth and Moon: DE440 (of the extra tour), or a planetary SPK file (.bsp)",
    )
    departure: DepartureSection = Field(description="state from which the spacecraft sets out")
    targets: TargetsSection = Field(default=TargetsSection(), description="which asteroids are targets")
    limits: LimitsSection = Field(description="what every chain of flybys keeps to")
    method: Literal["beam", "layered"] = Field(
        default="beam", description="how chains are searched: beam | layered (the paper's selection)"
    )
    beam: BeamSection = Field(default=BeamSection(), description="the beam search")
    layered: LayeredSection = Field(default=LayeredSection(), description="the paper's selection")
    escape: EscapeSection = Field(default=EscapeSection(), description="`tour escape`")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a tour that ends before it begins."""
        start, end = (_moment(text) for text in (self.departure.epoch_utc, self.limits.end_utc))
        if end <= start:
            raise wrong("limits.end_utc", "is not after departure.epoch_utc", "the tour lies between them")
        if end - start > timedelta(days=LONGEST_D):
            raise wrong("limits.end_utc", "is more than 30 years after departure.epoch_utc", "check the year")


class TourScenario(Section):
    """A tour of asteroids: a spacecraft near the Earth, a catalogue, and what is asked."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,63}$",
        description="name of the scenario and of its results: letters, digits, _ . -",
    )
    tour: TourSection = Field(description="the tour: `tour search` and others")


def _moment(text: str) -> datetime:
    moment = datetime.fromisoformat(text)
    return moment if moment.tzinfo else moment.replace(tzinfo=UTC)
