"""The curves that a grid of guide points makes: their price, and which of them are clear of the body."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.flight.legs import BezierLeg
from landing_cli.kernel import kernel
from landing_cli.plan.curve_family import (
    CurveFamily,
    control_point_family,
    curve_family,
    fill_costs,
    fill_path,
    position_family,
)
from landing_cli.plan.field_departure import (
    SHARE_NODES,
    chebyshev_nodes,
    lagrange_weights,
    pricing_field,
    sampled_departure,
)
from landing_cli.plan.guide_points import (
    Bounds,
    GuidePlane,
    above_guide_point,
    alpha_bounds,
    beta_bounds,
    guide_plane,
)
from landing_cli.plan.path_check import KEPT, check_path, cone_entry, least_distance
from landing_cli.plan.records import CHECK_SAMPLES, BezierOptions, PlanCase

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class GuideSearch:
    """What a search for guide points works on.

    Attributes
    ----------
    case : PlanCase
    options : BezierOptions
    plane : GuidePlane
    points : (3, 8, 3) float, m, 1, 1
        Control points as functions of the heights.
    curves : CurveFamily
        The curves at the search's times.
    dense : (2001, 3, 3) float, m, m/m, m/m
        Their positions at the times of the check that every plan has to pass.
    alpha : Bounds
    """

    case: PlanCase
    options: BezierOptions
    plane: GuidePlane
    points: FloatArray
    curves: CurveFamily
    dense: FloatArray
    alpha: Bounds

    @property
    def exhaust_velocity_m_s(self) -> float:
        """By which the mass falls, m/s; infinity where it stays constant."""
        return math.inf if self.case.mass_model == "constant" else self.case.spacecraft.exhaust_velocity_m_s


@dataclass(frozen=True, eq=False)
class Candidates:
    """Guide points of a grid with their price.

    Attributes
    ----------
    alpha_m, beta_m : (m,) float, m
    delta_v_m_s : (m,) float, m/s
        Infinity outside the bounds.
    peak_m_s2 : (m,) float, m/s2
        Largest thrust over the initial mass, among the search's times.
    """

    alpha_m: FloatArray
    beta_m: FloatArray
    delta_v_m_s: FloatArray
    peak_m_s2: FloatArray


def prepare_search(case: PlanCase, options: BezierOptions, plane: GuidePlane | None = None) -> GuideSearch:
    """Set up a search.

    Parameters
    ----------
    case : PlanCase
        What is asked.
    options : BezierOptions
        Grid and samples.
    plane : GuidePlane, optional
        The case's guide plane, where it is known: it does not depend on the time of flight.

    Returns
    -------
    GuideSearch
    """
    plane = guide_plane(case) if plane is None else plane
    points = control_point_family(case, plane)
    return GuideSearch(
        case=case,
        options=options,
        plane=plane,
        points=points,
        curves=curve_family(case, points, options.samples),
        dense=position_family(points, CHECK_SAMPLES),
        alpha=alpha_bounds(case, plane, points[0, -3]),
    )


def curve_of(search: GuideSearch, alpha_m: float, beta_m: float) -> BezierLeg:
    """Make the control that two guide points stand for.

    Parameters
    ----------
    search : GuideSearch
        The search.
    alpha_m, beta_m : float, m
        Heights of the guide points.

    Returns
    -------
    BezierLeg
    """
    constant, by_alpha, by_beta = search.points
    points = constant + alpha_m * by_alpha + beta_m * by_beta
    return BezierLeg(search.case.tof_s, points, search.case.asteroid.gravity)


def heights(
    search: GuideSearch, alpha_shares: FloatArray, beta_shares: FloatArray
) -> tuple[FloatArray, FloatArray, NDArray[np.bool_]]:
    """Spread a grid over the bounds of the guide points.

    Parameters
    ----------
    search : GuideSearch
        The search.
    alpha_shares : (p,) float
        Shares of the way from the least to the greatest alpha.
    beta_shares : (q,) float
        The same for beta, whose least value depends on alpha.

    Returns
    -------
    alpha, beta : (p q,) float, m
        Alpha varies slowest.
    empty : (p q,) bool
        Where the bounds leave nothing.
    """
    bounds = search.alpha
    alphas = bounds.least + alpha_shares * (bounds.greatest - bounds.least)
    low, high = np.zeros((2, alphas.size))
    if search.plane.blocked:
        limits = beta_bounds(search.case, search.plane)
        low = np.maximum(limits.least, above_guide_point(search.case, search.plane, alphas))
        high = np.full(alphas.size, limits.greatest)
    beta = (low[:, None] + beta_shares * (high - low)[:, None]).ravel()
    empty = (high < low) | (bounds.greatest < bounds.least)
    count = beta_shares.size
    return np.repeat(alphas, count), beta, np.repeat(empty, count)


def price(
    search: GuideSearch, alpha_shares: FloatArray, beta_shares: FloatArray, departs: bool = True
) -> Candidates:
    """Price a grid of guide points.

    Parameters
    ----------
    search : GuideSearch
        The search.
    alpha_shares, beta_shares : (p,), (q,) float
        As `heights` takes them; where the line to the start is free, beta does not count and q is 1.
    departs : bool
        Whether the departure of a costly field from a point mass is priced too.

    Returns
    -------
    Candidates
        p q of them, alpha varying slowest.
    """
    alpha, beta, empty = heights(search, alpha_shares, beta_shares)
    delta_v, peak = np.zeros(alpha.size), np.zeros(alpha.size)
    field = pricing_field(search.case)
    if departs and field is not search.case.asteroid.gravity:
        more = _departure(search, alpha_shares, beta_shares)
    else:
        more = np.zeros((0, 3, alpha.size))
    fill_costs(
        field.kind,
        field.params,
        search.curves,
        more,
        alpha,
        beta,
        search.exhaust_velocity_m_s,
        delta_v,
        peak,
    )
    delta_v[empty | ~np.isfinite(delta_v)] = np.inf
    return Candidates(alpha, beta, delta_v, peak)


def _departure(search: GuideSearch, alpha_shares: FloatArray, beta_shares: FloatArray) -> FloatArray:
    """What the case's field pulls more than the pricing field, for every candidate of a grid."""
    nodes = [chebyshev_nodes(x.min(), x.max(), SHARE_NODES) for x in (alpha_shares, beta_shares)]
    alpha, beta, _ = heights(search, nodes[0], nodes[1])
    constant, by_alpha, by_beta = search.points
    curves = constant + alpha[:, None, None] * by_alpha + beta[:, None, None] * by_beta
    sampled = sampled_departure(search.case, curves, search.options.samples)
    weights = np.kron(lagrange_weights(nodes[0], alpha_shares), lagrange_weights(nodes[1], beta_shares))
    return np.ascontiguousarray(np.moveaxis(np.tensordot(weights, sampled, axes=1), 0, 2))


def first_kept(search: GuideSearch, candidates: Candidates, order: IntArray, start: int) -> tuple[int, int]:
    """Find the first of ordered candidates whose path is clear of the body.

    Parameters
    ----------
    search : GuideSearch
        The search.
    candidates : Candidates
        The candidates.
    order : (k,) int
        In which order to look at them.
    start : int
        Where in that order to begin.

    Returns
    -------
    (int, int)
        Its place in the order, k where there is none; and how many distances were computed.
    """
    case = search.case
    return _first_kept(
        case.surface,
        case.clearance_metric == "vertices",
        search.curves.position,
        search.dense,
        candidates.alpha_m,
        candidates.beta_m,
        order,
        start,
        case.site.position_m,
        case.site.normal,
        case.cone_half_angle_rad,
        case.clearance_m,
    )


@kernel
def _first_kept(
    surface: SurfaceIndex,
    by_vertices: bool,
    sampled: FloatArray,
    dense: FloatArray,
    alpha: FloatArray,
    beta: FloatArray,
    order: IntArray,
    start: int,
    apex: FloatArray,
    axis: FloatArray,
    half_angle: float,
    clearance: float,
) -> tuple[int, int]:
    """Check candidates at the search's times, and those that pass at the dense ones too."""
    path, dense_path = np.zeros((sampled.shape[0], 3)), np.zeros((dense.shape[0], 3))
    measured = 0
    for at in range(start, order.size):
        a, b = alpha[order[at]], beta[order[at]]
        fill_path(sampled, a, b, path)
        entry = cone_entry(path, apex, axis, half_angle)
        verdict, _, count = check_path(surface, by_vertices, path, entry, clearance)
        measured += count
        if verdict != KEPT:
            continue
        fill_path(dense, a, b, dense_path)
        entry = cone_entry(dense_path, apex, axis, half_angle)
        verdict, _, count = check_path(surface, by_vertices, dense_path, entry, clearance)
        measured += count
        if verdict == KEPT:
            return at, measured
    return order.size, measured


def clearances(search: GuideSearch, candidates: Candidates) -> FloatArray:
    """Least distance of every candidate before its cone entry, in the case's metric.

    Parameters
    ----------
    search : GuideSearch
        The search.
    candidates : Candidates
        The candidates.

    Returns
    -------
    (m,) float, m
        Minus infinity where the path cuts the body inside the cone, or the price is infinite.
    """
    case = search.case
    out = np.full(candidates.alpha_m.size, -np.inf)
    _fill_clearances(
        case.surface,
        case.clearance_metric == "vertices",
        search.curves.position,
        candidates.alpha_m,
        candidates.beta_m,
        case.site.position_m,
        case.site.normal,
        case.cone_half_angle_rad,
        out,
    )
    return np.where(np.isfinite(candidates.delta_v_m_s), out, -np.inf)


@kernel
def _fill_clearances(
    surface: SurfaceIndex,
    by_vertices: bool,
    sampled: FloatArray,
    alpha: FloatArray,
    beta: FloatArray,
    apex: FloatArray,
    axis: FloatArray,
    half_angle: float,
    out: FloatArray,
) -> None:
    path = np.zeros((sampled.shape[0], 3))
    for j in range(alpha.size):
        fill_path(sampled, alpha[j], beta[j], path)
        entry = cone_entry(path, apex, axis, half_angle)
        if check_path(surface, by_vertices, path[entry:], 0, 0.0)[0] == KEPT:
            out[j] = least_distance(surface, by_vertices, path, 0, entry)[0]
