"""What an observation-driven landing answers: the paths, what they see, and what is known after."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.legs import LinearAccelerationLeg
from landing_cli.observe.records import Objective, Parameter, PathStatus, Side, WaypointTiming

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Path:
    """A flown path; its thrust acceleration is linear between nodes, so that it can be flown again.

    Attributes
    ----------
    t_s : (k,) float, s
        Increasing from 0 to t_f.
    position_m, velocity_m_s : (k, 3) float, m, m/s, body frame
        Relative to the rotating frame.
    acceleration_m_s2 : (k, 3) float, m/s2, body frame
        Thrust over mass u at the nodes.
    performance_index_m2_s3 : float, m2/s3
        J: the integral of u'u (eq 13).
    delta_v_m_s : float, m/s
        The integral of the magnitude of u.
    propellant_mass_fraction : float
        PMF: 1 - exp(-delta_v / (Isp g_e)) (eq 16).
    peak_thrust_n : float, N
        Largest thrust on the flown mass.
    clearance_min_m : float, m
        Least distance to the surface outside the ball about the site, negative where the path cuts the body
        anywhere; infinite where the whole path lies inside the ball.
    glide_slope_max_rad : float, rad
        Largest angle between the site frame's z and the line from the site to the spacecraft.
    status : {"planned", "infeasible", "unresolved"}
    message : str
        In the analyst's words: what binds, and by how much.
    iterations : int
    """

    t_s: FloatArray
    position_m: FloatArray
    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    performance_index_m2_s3: float
    delta_v_m_s: float
    propellant_mass_fraction: float
    peak_thrust_n: float
    clearance_min_m: float
    glide_slope_max_rad: float
    status: PathStatus
    message: str
    iterations: int

    @property
    def tof_s(self) -> float:
        """Time of flight t_f, s."""
        return float(self.t_s[-1])

    @property
    def leg(self) -> LinearAccelerationLeg:
        """What suffices to fly the path again."""
        return LinearAccelerationLeg(self.t_s, self.acceleration_m_s2)


@dataclass(frozen=True, eq=False)
class Seen:
    """Which landmarks are in view along a path.

    Attributes
    ----------
    t_s : (T,) float, s
        The sensor's times.
    visible : (T, n) bool
    rejected : mapping
        How many pairs of time and landmark failed first at each of `REJECTIONS`; 0 where one was not made.
    lit : bool
        Whether illumination was tested.
    """

    t_s: FloatArray
    visible: BoolArray
    rejected: Mapping[str, int]
    lit: bool

    @property
    def count(self) -> IntArray:
        """Landmarks in view at each time, (T,) int."""
        return np.count_nonzero(self.visible, axis=1).astype(np.int64)

    @property
    def distinct(self) -> int:
        """Landmarks seen at least once."""
        return int(np.count_nonzero(self.visible.any(axis=0)))

    @property
    def mean_in_view(self) -> float:
        """Mean over the times of the landmarks in view."""
        return float(self.count.mean())

    @property
    def longest_gap_s(self) -> float:
        """Longest stretch of the flight without a landmark in view, s; 0 where one always is.

        From the last time with one in view to the next, or to the ends of the flight.
        """
        seen = np.flatnonzero(self.count > 0)
        if not len(seen):
            return float(self.t_s[-1] - self.t_s[0])
        ends = np.concatenate([[0], seen, [len(self.t_s) - 1]])
        blind = np.diff(ends) > 1
        blind[0], blind[-1] = seen[0] > 0, seen[-1] < len(self.t_s) - 1
        return float(np.max(np.diff(self.t_s[ends])[blind], initial=0.0))


@dataclass(frozen=True, eq=False)
class Sigma:
    """How well the position is known along a path.

    Attributes
    ----------
    t_s : (T,) float, s
        The sensor's times.
    position_sigma_m : (T,) float, m
        Root of the trace of the position covariance, after the measurements of that time.
    """

    t_s: FloatArray
    position_sigma_m: FloatArray

    @property
    def mean_m(self) -> float:
        """Mean over the times, m."""
        return float(self.position_sigma_m.mean())

    @property
    def final_m(self) -> float:
        """At touchdown, m."""
        return float(self.position_sigma_m[-1])


@dataclass(frozen=True, eq=False)
class ObservedPath:
    """A path, what it sees, and how well it knows where it is."""

    path: Path
    seen: Seen
    sigma: Sigma


@dataclass(frozen=True, eq=False)
class Clustering:
    """The landmarks' clusters, and the side of the nominal on which the control points lie.

    Attributes
    ----------
    label : (n,) int
        Cluster of each landmark.
    center_m : (k, 2) float, m, site frame x, y
        mu_j (eq 6), sorted along x.
    sse_m2 : (q,) float, m2
        I_SSE (eq 5) of 1 to q clusters: the elbow's curve.
    chosen_by : {"elbow", "given"}
        How k was chosen.
    side : (k,) int
        +1 left, -1 right of the projected nominal.
    steered_to : {"left", "right"}
    side_chosen_by : {"more_centers", "given", "more_landmarks"}
        ``more_landmarks`` breaks a tie of centres.
    control_points_m : (c, 2) float, m, site frame x, y
        The centres on that side, in the order of flight: inner control points of eq 10.
    """

    label: IntArray
    center_m: FloatArray
    sse_m2: FloatArray
    chosen_by: Literal["elbow", "given"]
    side: IntArray
    steered_to: Side
    side_chosen_by: Literal["more_centers", "given", "more_landmarks"]
    control_points_m: FloatArray


@dataclass(frozen=True, eq=False)
class Waypoints:
    """Where the path is asked to pass (eqs 11, 12, 14).

    Attributes
    ----------
    t_s : (m,) float, s
        i t_f / (m + 1).
    position_m : (m, 2) float, m, site frame x, y
    curve_m : (c, 2) float, m, site frame x, y
        Control points of the whole Bezier curve, the ends included.
    timing : {"paper", "velocity_matched"}
    """

    t_s: FloatArray
    position_m: FloatArray
    curve_m: FloatArray
    timing: WaypointTiming


@dataclass(frozen=True, eq=False)
class Observation:
    """The answer to one case.

    Attributes
    ----------
    objective : {"energy", "information"}
    nominal : ObservedPath
        The energy-optimal law flown closed loop.
    clustering : Clustering
        Of the landmarks; control points that were given take the place of its own.
    waypoints : Waypoints or None
        None under the information objective.
    steered : ObservedPath
    parameters : mapping
        The method's own choices and findings, JSON-ready; keys with units.
    """

    objective: Objective
    nominal: ObservedPath
    clustering: Clustering
    waypoints: Waypoints | None
    steered: ObservedPath
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
