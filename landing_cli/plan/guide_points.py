"""The guide plane, the tangent point, and how far the two guide points may go (Lyu 2026, section 2.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.plane_section import clip_outline, crossings, grazing_angles, plane_section
from landing_cli.plan.records import PlanCase

FloatArray = NDArray[np.float64]

DEGREE = 7
"""n: six control points from the boundary conditions and two guide points."""

_ANGLE_OFF_PLANE = 1e-9  # below it, normal and line to the start span no plane
_SITE_MARGIN = 1e-9  # share of the way to the start within which the outline is the site itself

LowerBound = Literal["clearance", "last_control_point", "tangent", "guide_point"]
UpperBound = Literal["velocity", "start_radius", "start_distance"]


@dataclass(frozen=True, eq=False)
class GuidePlane:
    """The plane through site and start that holds the landing normal, and what of the body it cuts.

    Attributes
    ----------
    origin_m : (3,) float, m, body frame
        r_f.
    e_x, e_y, e_z : (3,) float
        e_x from the site to the start, e_y = n_f x e_x normalised, e_z = e_x x e_y. The paper's order
        (e_x x n_f) would point e_z into the body.
    distance_m : float, m
        ||r_0 - r_f||.
    blocked : bool
        Whether the body stands between site and start.
    tangent_point_m : (3,) float, m, body frame
        r_t: where a line along e_x, from the site's side of the outline to the start's, grazes the body.
    tangent_angle_rad : float, rad
        gamma_s: between the line from the start to the site and the one that grazes the body on the side
        of e_z; negative where the body stays below the line.
    velocity_angle_rad : float, rad
        gamma: between v_p and r_f - r_0; NaN without a velocity in the plane.
    velocity_m_s : (2,) float, m/s
        v_p: components of v_0 along e_x and e_z.
    """

    origin_m: FloatArray
    e_x: FloatArray
    e_y: FloatArray
    e_z: FloatArray
    distance_m: float
    blocked: bool
    tangent_point_m: FloatArray
    tangent_angle_rad: float
    velocity_angle_rad: float
    velocity_m_s: FloatArray


@dataclass(frozen=True)
class Bounds:
    """Least and greatest value of a guide point's height, and the conditions that set them.

    Attributes
    ----------
    least, greatest : float, m
        Empty where the least exceeds the greatest.
    least_by, greatest_by : str
    """

    least: float
    greatest: float
    least_by: LowerBound
    greatest_by: UpperBound


def guide_plane(case: PlanCase) -> GuidePlane:
    """Set up the landing-site frame and look at the body's outline in its xz plane.

    Parameters
    ----------
    case : PlanCase
        Start, site and mesh.

    Returns
    -------
    GuidePlane
    """
    r_f, n_f = case.site.position_m, case.site.normal
    offset = case.position_m - r_f
    distance = float(np.linalg.norm(offset))
    e_x = offset / distance
    e_y = _plane_normal(n_f, e_x, case.velocity_m_s)
    e_z = np.cross(e_x, e_y)
    outline = (plane_section(case.asteroid.mesh, r_f, e_y) - r_f) @ np.stack([e_x, e_z], axis=1)
    between = clip_outline(outline, 0.0, distance)
    # where nothing stands ahead, nothing is grazed: the site itself is the key point
    points = np.concatenate([np.zeros((1, 2)), between.reshape(-1, 2)])
    x, z = points[np.argmax(points[:, 1])]
    v_p = np.array([case.velocity_m_s @ e_x, case.velocity_m_s @ e_z])
    return GuidePlane(
        origin_m=r_f,
        e_x=e_x,
        e_y=e_y,
        e_z=e_z,
        distance_m=distance,
        blocked=bool(n_f @ e_x <= 0.0) or _hidden(outline, distance),
        tangent_point_m=r_f + x * e_x + z * e_z,
        tangent_angle_rad=grazing_angles((between - [distance, 0.0]) * [-1.0, 1.0], np.zeros(2))[1],
        velocity_angle_rad=math.atan2(abs(v_p[1]), -v_p[0]) if v_p.any() else math.nan,
        velocity_m_s=v_p,
    )


def _plane_normal(n_f: FloatArray, e_x: FloatArray, velocity: FloatArray) -> FloatArray:
    """e_y; straight above the site the velocity picks the plane, and at rest any plane will do."""
    for other in (e_x, velocity, *np.eye(3)):
        e_y = np.cross(n_f, other)
        size = float(np.linalg.norm(e_y))
        if size > _ANGLE_OFF_PLANE * float(np.linalg.norm(other)):
            e_y = e_y / size
            across = e_y - (e_y @ e_x) * e_x
            return np.asarray(across / np.linalg.norm(across))
    raise AssertionError("a normal is parallel to every axis")


def _hidden(outline: FloatArray, distance: float) -> bool:
    return crossings(outline, _SITE_MARGIN * distance, distance) > 0


def alpha_bounds(case: PlanCase, plane: GuidePlane, last_point_m: FloatArray) -> Bounds:
    """Limits of alpha in r_ao = r_f + alpha n_f (Lyu 2026, eqs 14-19).

    Parameters
    ----------
    case : PlanCase
        What is asked.
    plane : GuidePlane
        Its guide plane.
    last_point_m : (3,) float, m, body frame
        P_5, which the guide point has to stay above (eq 15).

    Returns
    -------
    Bounds
        The ray along v_0 limits alpha only where it meets the normal ahead and above the site: eq 16 alone
        gives -68 km for the paper's own case.
    """
    n_f = case.site.normal
    floors: list[tuple[float, LowerBound]] = [
        (case.clearance_m, "clearance"),
        (float((last_point_m - plane.origin_m) @ n_f), "last_control_point"),
    ]
    return _bounds(case, plane, plane.origin_m, n_f, floors)


def beta_bounds(case: PlanCase, plane: GuidePlane) -> Bounds:
    """Limits of beta in r_ac = r_t + beta e_z (Lyu 2026, eqs 21, 23-26), whatever alpha is.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    plane : GuidePlane
        Its guide plane.

    Returns
    -------
    Bounds
        Eqs 23 and 24 are printed as copies of 17 and 16; meant are r_t for r_f and e_z for n_f. The limit of
        eq 22 depends on alpha: `above_guide_point`.
    """
    floors: list[tuple[float, LowerBound]] = [(case.clearance_m, "clearance")]
    return _bounds(case, plane, plane.tangent_point_m, plane.e_z, floors)


def above_guide_point(case: PlanCase, plane: GuidePlane, alpha_m: FloatArray) -> FloatArray:
    """Least beta that puts r_ac above r_ao along e_z: (r_ao - r_t) . e_z, where eq 22 prints r_ao . e_z.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    plane : GuidePlane
        Its guide plane.
    alpha_m : (k,) float, m
        Heights of r_ao.

    Returns
    -------
    (k,) float, m
    """
    foot = float((plane.origin_m - plane.tangent_point_m) @ plane.e_z)
    return np.asarray(foot + alpha_m * float(case.site.normal @ plane.e_z))


def _bounds(
    case: PlanCase,
    plane: GuidePlane,
    foot: FloatArray,
    axis: FloatArray,
    floors: list[tuple[float, LowerBound]],
) -> Bounds:
    """Eqs 18-19 and 25-26: floors and ceilings of a height along an axis through a foot."""
    ceilings: list[tuple[float, UpperBound]] = []
    radius = height_at_radius(foot, axis, float(np.linalg.norm(case.position_m)))
    if radius > 0.0:
        ceilings.append((radius, "start_radius"))
    else:  # the site reaches beyond the start's radius: eq 17 has no solution
        ceilings.append((plane.distance_m, "start_distance"))
    if plane.velocity_angle_rad < plane.tangent_angle_rad:
        grazing = np.array([-math.cos(plane.tangent_angle_rad), math.sin(plane.tangent_angle_rad)])
        floors.append((height_on_ray(plane, grazing, foot, axis), "tangent"))
    else:
        ceilings.append((height_on_ray(plane, plane.velocity_m_s, foot, axis), "velocity"))
    floor = max((f for f in floors if not math.isnan(f[0])), key=lambda f: f[0])
    ceiling = min((c for c in ceilings if not math.isnan(c[0])), key=lambda c: c[0])
    return Bounds(floor[0], ceiling[0], floor[1], ceiling[1])


def height_at_radius(foot: FloatArray, axis: FloatArray, radius_m: float) -> float:
    """How far above its foot a line leaves the sphere of a given radius (Lyu 2026, eqs 17, 23).

    Parameters
    ----------
    foot : (3,) float, m, body frame
        A point of the line.
    axis : (3,) float
        Unit direction of the line.
    radius_m : float, m
        Of a sphere about the origin.

    Returns
    -------
    float, m
        NaN where the line misses the sphere.
    """
    along = float(foot @ axis)
    square = along**2 - (float(foot @ foot) - radius_m**2)
    return -along + math.sqrt(square) if square >= 0.0 else math.nan


def height_on_ray(plane: GuidePlane, direction: FloatArray, foot: FloatArray, axis: FloatArray) -> float:
    """How far above its foot a line in the guide plane meets a ray from the start (Lyu 2026, eqs 16, 24).

    One formula serves both branches of the paper: for the ray along the velocity it is the first, for the
    grazing ray the law of sines of the second.

    Parameters
    ----------
    plane : GuidePlane
        The guide plane.
    direction : (2,) float
        Of the ray, along e_x and e_z.
    foot, axis : (3,) float, m
        A point and the unit direction of the line, both in the plane.

    Returns
    -------
    float, m
        NaN where they meet behind the start or not above the foot.
    """
    x, z = (foot - plane.origin_m) @ np.stack([plane.e_x, plane.e_z], axis=1)
    a, c = axis @ np.stack([plane.e_x, plane.e_z], axis=1)
    # (D, 0) + s d = (x, z) + h (a, c)
    det = direction[1] * a - direction[0] * c
    if det == 0.0:
        return math.nan
    gap_x, gap_z = x - plane.distance_m, z
    ahead = (gap_z * a - gap_x * c) / det
    height = (direction[0] * gap_z - direction[1] * gap_x) / det
    return float(height) if ahead > 0.0 and height > 0.0 else math.nan
