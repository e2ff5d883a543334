"""The observation section: a landing, the landmarks it navigates by, and the sensor that sees them."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from landing_cli.scenario.schema_base import Number3, Seconds, Section, as_tuple, word_or_value, wrong
from landing_cli.scenario.schema_plan import SiteSection

Angle = Annotated[float, Field(gt=0, le=180)]
Metres = Annotated[float, Field(ge=0, le=1e6)]
Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
WaypointCount = Annotated[int, Field(ge=0, le=199)]
Weight = Annotated[float, Field(ge=0, le=1e3)]


WaypointCounts = Annotated[
    tuple[WaypointCount, ...],
    Field(min_length=1, max_length=100),
    BeforeValidator(as_tuple, json_schema_input_type=WaypointCount | list[WaypointCount]),
]
Weights = Annotated[
    tuple[Weight, ...],
    Field(min_length=1, max_length=100),
    BeforeValidator(as_tuple, json_schema_input_type=Weight | list[Weight]),
]


class ObserveStart(Section):
    """Where the landing begins, at rest or moving relative to the rotating body."""

    site_position_m: Number3 | None = Field(
        None, description="position in the site frame (x east, y north, z up), m"
    )
    position_m: Number3 | None = Field(
        None, description="position in the body frame, m, instead of site_position_m"
    )
    velocity_m_s: Number3 = Field(
        (0.0, 0.0, 0.0),
        description="velocity relative to the rotating body, m/s, in the frame that the position is given in",
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two positions, none, one beyond any mission, or a speed of light."""
        given = [name for name in ("site_position_m", "position_m") if getattr(self, name) is not None]
        if not given:
            raise wrong("site_position_m", "is missing", "give site_position_m or position_m")
        if len(given) > 1:
            raise wrong("position_m", "stands beside site_position_m", "give one of them")
        if max(map(abs, getattr(self, given[0]))) > 1e9:
            raise wrong(given[0], "is more than a million km from the body", "check the unit")
        if max(map(abs, self.velocity_m_s)) > 1e4:
            raise wrong("velocity_m_s", "is faster than 10 km/s", "check the unit: m/s")


class SyntheticLandmarks(Section):
    """A seeded Thomas cluster process in the site's tangent plane, cast onto the mesh."""

    seed: int = Field(ge=0, le=2**63 - 1, description="the same seed draws the same landmarks")
    clusters: int = Field(default=3, ge=1, le=1000, description="clusters")
    mean_per_cluster: float = Field(
        default=12.0, gt=0, le=10_000, description="mean number of landmarks in a cluster"
    )
    spread_m: float = Field(
        default=10.0, gt=0, le=1e6, description="standard deviation of a cluster in each axis, m"
    )
    extent_m: float = Field(
        default=100.0,
        gt=0,
        le=1e6,
        description="half-width of the square about the site that holds the clusters' centres, m",
    )


class LandmarksSection(Section):
    """The features whose places are known: from a file, or drawn."""

    file: str | None = Field(
        None,
        min_length=1,
        max_length=1000,
        description="CSV or YAML list of landmarks, beside this file: x_m, y_m, z_m or lon_deg, lat_deg; "
        "diameter_m and name where known",
    )
    sha256: str | None = Field(
        None, pattern="^[0-9a-f]{64}$", description="hash that the file must have; what it had unless given"
    )
    synthetic: SyntheticLandmarks | None = Field(None, description="a drawn field, instead of file")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse two sources, none, or the hash of no file."""
        if self.file is None and self.synthetic is None:
            raise wrong("file", "is missing", "give file or synthetic")
        if self.file is not None and self.synthetic is not None:
            raise wrong("synthetic", "stands beside file", "give one of them")
        if self.file is None and self.sha256 is not None:
            raise wrong("sha256", "belongs to a file", "leave it out")


class SensorSection(Section):
    """The instrument that the spacecraft navigates by."""

    kind: Literal["lidar", "camera"] = Field(
        description="lidar (range and direction, its own light) | camera (direction; needs the sun)"
    )
    half_field_of_view_deg: float = Field(
        gt=0, lt=90, description="half-angle of the field of view about the boresight, deg"
    )
    boresight: Literal["nadir", "site"] = Field(
        "nadir", description="where it looks: nadir (along the site frame's -z) | site (at the landing site)"
    )
    range_min_m: Metres = Field(0.0, description="least range, m")
    range_max_m: float = Field(1e6, gt=0, le=1e9, description="largest range, m")
    emission_max_deg: Angle = Field(
        90.0, description="largest angle between a landmark's normal and the line of sight, deg"
    )
    incidence_max_deg: Angle = Field(
        90.0, description="largest angle between a landmark's normal and the sun, deg; of a camera"
    )
    range_sigma_m: float | None = Field(None, gt=0, le=1e6, description="range noise, 1 sigma, m; of a lidar")
    angle_sigma_deg: float = Field(gt=0, le=90, description="noise of each of the two angles, 1 sigma, deg")
    rate_hz: float = Field(gt=0, le=1000, description="images or sweeps over all landmarks a second, Hz")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse an empty range, a lidar that measures no range, a camera that does."""
        if self.range_max_m <= self.range_min_m:
            raise wrong("range_max_m", f"{self.range_max_m:g} is not more than range_min_m", "raise it")
        if self.kind == "lidar" and self.range_sigma_m is None:
            raise wrong("range_sigma_m", "is missing", "a lidar measures range: give its noise, m")
        if self.kind == "camera" and self.range_sigma_m is not None:
            raise wrong("range_sigma_m", "belongs to a lidar", "a camera measures no range: leave it out")


class PriorSection(Section):
    """What is known of the state without landmarks."""

    position_sigma_m: float = Field(
        gt=0, le=1e6, description="position of each axis at the initial state, 1 sigma, m"
    )
    velocity_sigma_m_s: float = Field(
        gt=0, le=1e3, description="velocity of each axis at the initial state, 1 sigma, m/s"
    )
    acceleration_noise_m2_s3: float = Field(
        default=0.0,
        ge=0,
        le=1e3,
        description="power spectral density of the unmodelled acceleration, each axis, m2/s3",
    )


class SteeringSection(Section):
    """The paper's method: waypoints on a Bezier curve towards the clusters of landmarks."""

    waypoints: WaypointCounts = Field(default=(3,), description="waypoints m: a number, or a list of them")
    timing: Literal["paper", "velocity_matched"] = Field(
        default="paper",
        description="when the curve is passed: paper (eq 10) | velocity_matched (as the end velocities ask)",
    )
    clusters: int | None = Field(
        default=None, ge=1, le=100, description="clusters k; the elbow of the error's curve unless given"
    )
    clusters_max: int = Field(default=9, ge=3, le=100, description="largest k of the elbow's curve")
    side: Literal["left", "right"] | None = Field(
        default=None,
        description="side of the unsteered path, along its flight; the one with more centres unless given",
    )
    control_points_m: tuple[tuple[Coordinate, Coordinate], ...] | None = Field(
        default=None,
        min_length=1,
        max_length=30,
        description="inner control points in the order of flight, m, site frame [x, y]; in place of clusters",
    )
    nodes: int = Field(
        default=400, ge=10, le=5000, description="intervals on which the thrust acceleration is linear"
    )

    def model_post_init(self, context: Any, /) -> None:
        """Refuse the same number twice, and choices that given control points leave nothing to."""
        for index, count in enumerate(self.waypoints):
            if count in self.waypoints[:index]:
                raise wrong(f"waypoints.{index}", f"{count} is in the list twice", "remove one")
            if count + 1 > self.nodes // 2:
                raise wrong(
                    f"waypoints.{index}",
                    f"{count} waypoints are too many for {self.nodes} intervals",
                    "raise nodes",
                )
        for name in ("clusters", "side"):
            if self.control_points_m is not None and getattr(self, name) is not None:
                raise wrong(name, "stands beside control_points_m, which replaces it", "give one of them")


class InformationSection(Section):
    """The path that sees best: J/J0 + weight log(mean position sigma) is least."""

    weight: Weights = Field(
        default=(0.01, 0.03, 0.1, 0.3, 1.0), description="lambda: a number, or a list of them for a front"
    )
    knots: int = Field(default=5, ge=1, le=100, description="inner spline knots, free in space")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse the same weight twice."""
        for index, weight in enumerate(self.weight):
            if any(f"{weight:.6g}" == f"{earlier:.6g}" for earlier in self.weight[:index]):
                raise wrong(f"weight.{index}", f"{weight:g} is in the list twice", "remove one")


class ObserveSection(Section):
    """The landing that sees its landmarks."""

    initial_state: ObserveStart = Field(description="state from which the landing begins")
    site: SiteSection = Field(description="where it lands, at rest")
    frame: Literal["radial", "normal"] = Field(
        "normal",
        description="up at the site: radial (from the body's origin, the paper's) | normal (the facet's)",
    )
    tof_s: Annotated[
        Annotated[Literal["t_go", "search"], Tag("word")] | Annotated[Seconds, Tag("value")],
        Discriminator(word_or_value),
    ] = Field(description="time of flight, s: a number | t_go (root of the paper's eq 3) | search (least J)")
    tof_search_s: tuple[Seconds, Seconds] = Field(
        (60.0, 3600.0), description="where search looks, s: [shortest, longest]"
    )
    gravity: Literal["body", "polyhedron", "interpolated"] = Field(
        "body",
        description="field: body (body.gravity) | polyhedron (the mesh's) | interpolated (fitted to that)",
    )
    clearance_m: Metres | None = Field(
        None, description="distance to the terrain kept outside the ball about the site, m; none unless given"
    )
    clearance_free_m: Metres = Field(
        10.0, description="radius of the ball about the site in which the clearance is not asked for, m"
    )
    glide_slope_half_angle_deg: float | None = Field(
        None,
        gt=0,
        lt=90,
        description="half-angle of the cone about the site frame's z that holds the path, deg; or none",
    )
    landmarks: LandmarksSection = Field(description="the features whose places are known")
    sensor: SensorSection = Field(description="the instrument")
    prior: PriorSection = Field(description="what is known without landmarks")
    objective: Literal["energy", "information"] = Field(
        "energy",
        description="what is least: energy (through waypoints) | information (J and the navigation error)",
    )
    steering: SteeringSection = Field(SteeringSection(), description="the paper's waypoints")
    information: InformationSection = Field(InformationSection(), description="the path that sees best")

    def model_post_init(self, context: Any, /) -> None:
        """Refuse a search over nothing."""
        if self.tof_search_s[1] <= self.tof_search_s[0]:
            raise wrong("tof_search_s", "ends before it begins", "give [shortest, longest]")
