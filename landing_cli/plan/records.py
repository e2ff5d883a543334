"""What a planning case asks and what every planning method answers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.bvh import SurfaceIndex
from landing_cli.body.landing_site import Site
from landing_cli.flight.legs import AccelerationLeg
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.flight.trajectory import Trajectory

FloatArray = NDArray[np.float64]

ClearanceMetric = Literal["surface", "vertices"]
MassModel = Literal["variable", "constant"]
Objective = Literal["fuel", "energy"]
TerminalConditions = Literal["rest", "paper"]
PlanStatus = Literal["planned", "infeasible", "unresolved"]
Parameter = float | int | str | bool | None | list[float] | list[list[float]] | list[str]

CHECK_SAMPLES = 2001
"""Samples, even in time, at which a plan is checked again before it is called planned."""


@dataclass(frozen=True, eq=False)
class PlanCase:
    """One initial state, one site and one time of flight.

    The path is bound as in Lyu 2026, eqs 2-5. With t_s the time from which the path stays in the safety cone
    (apex r_f, axis n_f, half-angle theta_max, unbounded in height), the distance h to the terrain exceeds
    h_min up to t_s, and the path does not cut the surface after it. The paper takes t_s as the first entry;
    a path that crosses the far part of the cone and leaves it again is here bound by h_min throughout
    instead of being refused.

    Attributes
    ----------
    name : str
    asteroid : Asteroid
        Its gravity is the field that the plan flies in.
    spacecraft : Spacecraft
    position_m, velocity_m_s, acceleration_m_s2 : (3,) float, body frame
        r_0, v_0, a_0: the initial state relative to the rotating frame. The acceleration binds only methods
        whose curve has it as a boundary condition (Bezier, eq 10).
    site : Site
    landing_velocity_m_s, landing_acceleration_m_s2 : (3,) float, body frame
        v_f, a_f (eq 4).
    tof_s : float, s
        t_f.
    clearance_m : float, m
        h_min.
    clearance_metric : {"surface", "vertices"}
        Whether h is the exact distance to the surface or the paper's distance to the nearest vertex.
    cone_half_angle_rad : float, rad
        theta_max.
    mass_model : {"variable", "constant"}
        Whether thrust acts on the flown mass or, as in the paper, on the initial mass throughout.
    surface : SurfaceIndex
        The mesh, arranged for distance queries.
    """

    name: str
    asteroid: Asteroid
    spacecraft: Spacecraft
    position_m: FloatArray
    velocity_m_s: FloatArray
    acceleration_m_s2: FloatArray
    site: Site
    landing_velocity_m_s: FloatArray
    landing_acceleration_m_s2: FloatArray
    tof_s: float
    clearance_m: float
    clearance_metric: ClearanceMetric
    cone_half_angle_rad: float
    mass_model: MassModel
    surface: SurfaceIndex


@dataclass(frozen=True)
class BezierOptions:
    """Choices of the guide-point search (Lyu 2026, section 2.3).

    Attributes
    ----------
    coarse_points, fine_points : int
        Values of alpha and of beta in the coarse and in the fine grid.
    samples : int
        Times, even over the flight, at which a candidate is checked during the search.
    """

    coarse_points: int = 25
    fine_points: int = 21
    samples: int = 201


@dataclass(frozen=True)
class FreeGuidesOptions:
    """Choices of the Bezier curve whose inner control points are free in space.

    Attributes
    ----------
    degree : int
        n; six control points are given by the boundary conditions, n - 5 are free.
    objective : {"fuel", "energy"}
    samples : int
        Times at which the constraints are imposed.
    """

    degree: int = 7
    objective: Objective = "fuel"
    samples: int = 201


@dataclass(frozen=True)
class ConvexOptions:
    """Choices of the free-control optimum.

    Attributes
    ----------
    objective : {"fuel", "energy"}
    terminal : {"rest", "paper"}
        Land with position and velocity alone, or with eq 4's acceleration and angle too.
    nodes : int
        Control nodes.
    """

    objective: Objective = "fuel"
    terminal: TerminalConditions = "rest"
    nodes: int = 81


@dataclass(frozen=True)
class PseudospectralOptions:
    """Choices of the Gauss pseudospectral transcription.

    Attributes
    ----------
    objective : {"fuel", "energy"}
    terminal : {"rest", "paper"}
        Land with position and velocity alone, or with eq 4's acceleration and angle too.
    nodes : int
        Legendre-Gauss nodes: a quarter of them inside the cone, but no fewer than six; one or more before.
    """

    objective: Objective = "fuel"
    terminal: TerminalConditions = "rest"
    nodes: int = 40


@dataclass(frozen=True, eq=False)
class Plan:
    """A method's answer.

    Attributes
    ----------
    method : str
        ``bezier``, ``bezier_free_guides``, ``convex`` or ``pseudospectral``.
    status : {"planned", "infeasible", "unresolved"}
        ``planned`` was checked at `CHECK_SAMPLES` samples; ``infeasible`` says that no path of the method's
        family meets the constraints; ``unresolved`` that none was found.
    message : str
        In the analyst's words: what binds, and by how much.
    trajectory : Trajectory or None
        `CHECK_SAMPLES` samples of the best path found, also of one that breaks a constraint.
    control : tuple of BezierLeg, LinearAccelerationLeg, GaussAccelerationLeg
        What suffices to fly the path again, leg after leg; empty without a path.
    tof_s : float, s
    fuel_kg, delta_v_m_s, peak_thrust_n : float
        NaN without a path.
    clearance_surface_m, clearance_vertices_m : float, m
        Least distance up to the cone entry to the surface and to the nearest vertex.
    landing_angle_deg : float, deg
        Angle between the line from the site to the spacecraft and n_f, 1 s before touchdown.
    cone_entry_s : float, s
        t_s: from then on the path stays in the cone.
    iterations : int
    clearance_metric : {"surface", "vertices"}
        The one that was bound.
    parameters : mapping
        The method's own choices, JSON-ready; keys with units.
    """

    method: str
    status: PlanStatus
    message: str
    trajectory: Trajectory | None
    control: tuple[AccelerationLeg, ...]
    tof_s: float
    fuel_kg: float
    delta_v_m_s: float
    peak_thrust_n: float
    clearance_surface_m: float
    clearance_vertices_m: float
    landing_angle_deg: float
    cone_entry_s: float
    iterations: int
    clearance_metric: ClearanceMetric
    parameters: Mapping[str, Parameter] = field(default_factory=dict)

    @property
    def clearance_min_m(self) -> float:
        """Least distance up to the cone entry in the metric that was bound, m."""
        return self.clearance_surface_m if self.clearance_metric == "surface" else self.clearance_vertices_m
