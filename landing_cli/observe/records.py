"""What an observation-driven landing is asked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import SurfaceIndex
from landing_cli.flight.spacecraft import Spacecraft

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]

FrameKind = Literal["radial", "normal"]
SensorKind = Literal["lidar", "camera"]
Boresight = Literal["nadir", "site"]
TimeOfFlight = Literal["fixed", "t_go", "search"]
WaypointTiming = Literal["paper", "velocity_matched"]
Side = Literal["left", "right"]
Objective = Literal["energy", "information"]
PathStatus = Literal["planned", "infeasible", "unresolved"]
Parameter = float | int | str | bool | None | list[float] | list[list[float]] | list[str]

REJECTIONS = ("range", "field_of_view", "emission", "incidence", "occlusion", "shadow")
"""The tests that a landmark passes to be seen, in the order in which they are made."""


@dataclass(frozen=True, eq=False)
class SiteFrame:
    """The frame fixed to the body at the landing site.

    Attributes
    ----------
    origin_m : (3,) float, m, body frame
        The landing site.
    axes : (3, 3) float
        Rows: the unit vectors x, y, z in the body frame; z is up, x east, y north.
    kind : {"radial", "normal"}
        Whether z points away from the body's origin, as in the paper, or along the facet's outward normal.
    facet : int
        The site's facet, 0-based; -1 where position and normal were given freely.
    normal : (3,) float, body frame
        The facet's outward unit normal, whatever z is.
    """

    origin_m: FloatArray
    axes: FloatArray
    kind: FrameKind
    facet: int
    normal: FloatArray

    def to_site(self, position_m: FloatArray) -> FloatArray:
        """Return positions of the body frame in the site frame, (..., 3) float, m."""
        return (np.asarray(position_m, dtype=np.float64) - self.origin_m) @ self.axes.T

    def to_body(self, position_m: FloatArray) -> FloatArray:
        """Return positions of the site frame in the body frame, (..., 3) float, m."""
        return np.asarray(position_m, dtype=np.float64) @ self.axes + self.origin_m


@dataclass(frozen=True, eq=False)
class Landmarks:
    """The known features that the spacecraft navigates by.

    Attributes
    ----------
    position_m : (n, 3) float, m, body frame
        On the surface.
    normal : (n, 3) float, body frame
        Outward unit normals of the facets that they lie on.
    diameter_m : (n,) float, m
        NaN where unknown.
    name : tuple of str
    facet : (n,) int
        The facet below each, 0-based.
    """

    position_m: FloatArray
    normal: FloatArray
    diameter_m: FloatArray
    name: tuple[str, ...]
    facet: IntArray


@dataclass(frozen=True)
class Sensor:
    """The lidar or camera, and what it can see.

    Attributes
    ----------
    kind : {"lidar", "camera"}
        A lidar measures range and direction (eq 4), a camera the direction alone.
    half_field_of_view_rad : float, rad
        Half-angle of the cone about the boresight.
    boresight : {"nadir", "site"}
        Along the site's -z, or at the landing site.
    range_min_m, range_max_m : float, m
    emission_max_rad : float, rad
        Largest angle between the landmark's normal and the line of sight.
    incidence_max_rad : float, rad
        Largest angle between the landmark's normal and the sun; a lidar brings its own light.
    range_sigma_m : float, m
        Range noise, one sigma; a camera has none.
    angle_sigma_rad : float, rad
        Noise of each of the two angles, one sigma.
    rate_hz : float, Hz
        Images, or sweeps over all landmarks, a second.
    """

    kind: SensorKind
    half_field_of_view_rad: float
    boresight: Boresight
    range_min_m: float
    range_max_m: float
    emission_max_rad: float
    incidence_max_rad: float
    range_sigma_m: float
    angle_sigma_rad: float
    rate_hz: float


@dataclass(frozen=True)
class Prior:
    """What is known without the landmarks.

    Attributes
    ----------
    position_sigma_m : float, m
        Of each axis at the initial state.
    velocity_sigma_m_s : float, m/s
    acceleration_noise_m2_s3 : float, m2/s3
        Power spectral density of the unmodelled acceleration, each axis; 0 leaves the dynamics exact.
    """

    position_sigma_m: float
    velocity_sigma_m_s: float
    acceleration_noise_m2_s3: float = 0.0


@dataclass(frozen=True, eq=False)
class ObserveCase:
    """One landing and the landmarks it navigates by.

    Attributes
    ----------
    name : str
    asteroid : Asteroid
        Its gravity is the field that the path flies in.
    spacecraft : Spacecraft
        Its thrust on the flown mass is a bound.
    position_m, velocity_m_s : (3,) float, m, m/s, body frame
        The initial state relative to the rotating frame; the landing is at rest on the site (eq 15).
    frame : SiteFrame
    time_of_flight : {"fixed", "t_go", "search"}
        Whether t_f is `tof_s`, the root of eq 3, or the time of least J between `tof_range_s`.
    tof_s : float, s
        NaN unless fixed.
    tof_range_s : tuple of float, s
        Where `search` looks.
    landmarks : Landmarks
    sensor : Sensor
    prior : Prior
    sun_direction : (3,) float or None
        Unit vector to the sun in the body frame at the initial time; it turns backwards with the spin. None
        leaves illumination out.
    clearance_m : float or None, m
        Distance to the terrain kept while the spacecraft is more than `clearance_free_m` from the site; None
        imposes none.
    clearance_free_m : float, m
        Radius of the ball about the site inside which the clearance is not asked for.
    glide_slope_half_angle_rad : float or None, rad
        Half-angle of the cone about the site frame's z in which the whole path stays; None imposes none.
    surface : SurfaceIndex
        The mesh, arranged for distance queries.
    """

    name: str
    asteroid: Asteroid
    spacecraft: Spacecraft
    position_m: FloatArray
    velocity_m_s: FloatArray
    frame: SiteFrame
    time_of_flight: TimeOfFlight
    tof_s: float
    tof_range_s: tuple[float, float]
    landmarks: Landmarks
    sensor: Sensor
    prior: Prior
    sun_direction: FloatArray | None
    clearance_m: float | None
    clearance_free_m: float
    glide_slope_half_angle_rad: float | None
    surface: SurfaceIndex


@dataclass(frozen=True)
class SteeringOptions:
    """Choices of the paper's method (sections 2.1 and 2.2).

    Attributes
    ----------
    waypoints : int
        m; 0 is the energy-optimal path without waypoints.
    timing : {"paper", "velocity_matched"}
        Whether the Bezier curve has the control points of eq 10, or also repeats its ends by the velocities
        there, so that its timing agrees with them.
    clusters : int or None
        k; None takes the elbow.
    clusters_max : int
        Largest k of the elbow's curve.
    side : {"left", "right"} or None
        Side of the projected nominal, seen along its flight; None takes the one with more centres.
    control_points_m : tuple of (float, float), or None, m, site frame x, y
        Inner control points in the order of flight; they replace clusters and side.
    nodes : int
        Intervals of the transcription, on which the thrust acceleration is linear.
    """

    waypoints: int = 3
    timing: WaypointTiming = "paper"
    clusters: int | None = None
    clusters_max: int = 9
    side: Side | None = None
    control_points_m: tuple[tuple[float, float], ...] | None = None
    nodes: int = 400


@dataclass(frozen=True)
class InformationOptions:
    """Choices of the path that sees best: J/J0 + weight log(mean position sigma) is least.

    Attributes
    ----------
    weight : float
        lambda; 0 is the energy-optimal path.
    knots : int
        Inner spline knots that are free in space.
    """

    weight: float = 0.1
    knots: int = 5
