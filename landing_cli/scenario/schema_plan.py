"""The planning section: one site, one start, and what the path must keep clear of."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from landing_cli.scenario.schema_base import Auto, Number3, Section, Times, exactly_one, word_or_value, wrong

OBJECTIVES = "what is least: fuel | energy (the integral of the squared thrust acceleration)"
TERMINALS = "how the path ends: rest (at the landing velocity) | paper (eq 4: acceleration and angle too)"
LonLat = tuple[Annotated[float, Field(ge=-360, le=360)], Annotated[float, Field(ge=-90, le=90)]]


class SiteSection(Section):
    """Where it lands: a facet, a longitude and latitude, or a position and a normal."""

    facet: int | None = Field(
        None,
        ge=0,
        le=10_000_000,
        description="facet, 0-based, in the shape file's order; lands on its centroid",
    )
    lon_lat_deg: LonLat | None = Field(
        None, description="longitude and latitude in the body frame, deg, instead of facet: [lon, lat]"
    )
    position_m: Number3 | None = Field(
        None, description="position in the body frame, m, instead of facet; on or above the surface"
    )
    normal: Number3 | None = Field(
        None, description="outward normal of the landing plane at position_m; of any length"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two sites, none, or a position without a normal of its own."""
        given = [name for name in ("facet", "lon_lat_deg", "position_m") if getattr(self, name) is not None]
        if not given:
            raise wrong("facet", "is missing", "give facet, lon_lat_deg, or position_m and normal")
        if len(given) > 1:
            raise wrong(given[1], f"stands beside {given[0]}", "give one of them")
        if (self.position_m is None) != (self.normal is None):
            key, other = ("normal", "position_m") if self.normal is None else ("position_m", "normal")
            if self.position_m is None:
                raise wrong("normal", f"stands beside {given[0]}, whose facet has its own", "leave it out")
            raise wrong(key, "is missing", f"{other} needs it: the outward normal of the landing plane")
        if self.position_m is not None and max(map(abs, self.position_m)) > 1e9:
            raise wrong("position_m", "is more than a million km from the body", "check the unit")
        if self.normal is not None and not any(self.normal):
            raise wrong("normal", "is zero", "give the outward direction of the landing plane")


class PlanStart(Section):
    """Where the flight begins, in the rotating body frame."""

    position_km: Number3 | None = Field(None, description="position in the body frame, km")
    position_m: Number3 | None = Field(
        None, description="position in the body frame, m, instead of position_km"
    )
    velocity_m_s: Number3 = Field(
        (0.0, 0.0, 0.0), description="velocity relative to the rotating body frame, m/s"
    )
    acceleration_m_s2: Number3 | None = Field(
        None,
        description="acceleration in the rotating frame with which a Bezier curve begins, m/s2; "
        "that of coasting unless given",
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two positions, none, one beyond any mission, or a speed of light."""
        exactly_one(self, "position_km", "position_m")
        key = "position_m" if self.position_km is None else "position_km"
        if max(map(abs, self.start_m)) > 1e9:
            raise wrong(key, "is more than a million km from the body", "check the unit")
        if max(map(abs, self.velocity_m_s)) > 1e4:
            raise wrong("velocity_m_s", "is faster than 10 km/s", "check the unit: m/s")
        if self.acceleration_m_s2 is not None and max(map(abs, self.acceleration_m_s2)) > 1e3:
            raise wrong("acceleration_m_s2", "is more than 1 km/s2", "check the unit: m/s2")

    @property
    def start_m(self) -> Number3:
        """Position in the body frame, m."""
        if self.position_m is not None:
            return self.position_m
        assert self.position_km is not None
        x, y, z = self.position_km
        return 1000 * x, 1000 * y, 1000 * z


class BezierSection(Section):
    """The search for the two guide points of `plan bezier`."""

    coarse_points: int = Field(
        default=25, ge=2, le=1000, description="values of alpha and beta in the coarse grid"
    )
    fine_points: int = Field(
        default=21, ge=2, le=1000, description="values of alpha and beta in the fine grid"
    )
    samples: int = Field(default=201, ge=11, le=20_001, description="times at which a candidate is checked")


class FreeGuidesSection(Section):
    """The Bezier curve whose inner control points are free: `plan convex --bezier-degree`."""

    degree: int = Field(default=7, ge=6, le=14, description="degree n: n - 5 control points are free")
    objective: Literal["fuel", "energy"] = Field(default="fuel", description=OBJECTIVES)
    samples: int = Field(
        default=201, ge=11, le=20_001, description="times at which the constraints are imposed"
    )


class ConvexSection(Section):
    """The free-control optimum of `plan convex`."""

    objective: Literal["fuel", "energy"] = Field(default="fuel", description=OBJECTIVES)
    terminal: Literal["rest", "paper"] = Field(default="rest", description=TERMINALS)
    nodes: int = Field(
        default=81, ge=5, le=2001, description="nodes between which the thrust acceleration is linear"
    )


class PseudospectralSection(Section):
    """The Gauss pseudospectral transcription of `plan pseudospectral`."""

    objective: Literal["fuel", "energy"] = Field(default="fuel", description=OBJECTIVES)
    terminal: Literal["rest", "paper"] = Field(default="rest", description=TERMINALS)
    nodes: int = Field(default=40, ge=4, le=400, description="Legendre-Gauss nodes")


class SweepSection(Section):
    """Initial positions of `plan sweep`: the initial state turned about the spin axis."""

    longitudes: int = Field(
        default=360, ge=1, le=100_000, description="how many longitudes, even over the circle"
    )
    longitudes_deg: tuple[Annotated[float, Field(ge=-360, le=360)], ...] | None = Field(
        default=None,
        min_length=1,
        max_length=100_000,
        description="longitudes, deg, instead of a number of them",
    )


class PlanSection(Section):
    """The flight to one site, clear of the terrain."""

    initial_state: PlanStart = Field(description="state from which the flight begins")
    site: SiteSection = Field(description="where it lands")
    tof_s: Times = Field(description="time of flight, s: a number, or a list of them")
    landing_velocity_m_s: Number3 = Field(
        (0.0, 0.0, 0.0), description="velocity at touchdown in the rotating frame, m/s"
    )
    landing_acceleration_m_s2: Number3 = Field(
        (0.0, 0.0, 0.0), description="acceleration with which a Bezier curve touches down, m/s2"
    )
    clearance_m: Auto | Annotated[Annotated[float, Field(ge=0, le=1e6)], Tag("value")] = Field(
        default="auto",
        discriminator=Discriminator(word_or_value),
        description="distance to the terrain kept before the safety cone, m, or auto: 1 % of the length",
    )
    clearance: Literal["surface", "vertices"] = Field(
        "surface",
        description="it is measured to: surface (exact) | vertices (the paper's, which overstates it)",
    )
    cone_half_angle_deg: float = Field(
        30.0,
        gt=0,
        lt=90,
        description="half-angle of the safety cone about the site's normal, deg; the descent ends inside it",
    )
    mass_model: Literal["variable", "constant"] = Field(
        "variable", description="mass that the thrust acts on: variable (as flown) | constant (the paper's)"
    )
    bezier: BezierSection = Field(BezierSection(), description="`plan bezier`")
    free_guides: FreeGuidesSection = Field(FreeGuidesSection(), description="`plan convex --bezier-degree`")
    convex: ConvexSection = Field(ConvexSection(), description="`plan convex`")
    pseudospectral: PseudospectralSection = Field(
        PseudospectralSection(), description="`plan pseudospectral`"
    )
    sweep: SweepSection = Field(SweepSection(), description="`plan sweep`")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse the same time twice."""
        for index, tof_s in enumerate(self.tof_s):
            if any(f"{tof_s:.12g}" == f"{earlier:.12g}" for earlier in self.tof_s[:index]):
                raise wrong(f"tof_s.{index}", f"{tof_s:g} is in the list twice", "remove one")
