"""The score of a landing site: four measures, each from 0 for the worst candidate to 1 for the best.

    score = sum_k w_k g_k / sum_k w_k,    g_k = (worst_k - x_k) / (worst_k - best_k)

over the candidates: facets that are reachable in every case asked, by paths that do not cut the mesh. What is
worst and best is over the candidates of the run at hand, so that a score says how a site stands among them,
and nothing about another run. Where all candidates are equal in a measure, each has 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.adjacency import mean_edge_m
from landing_cli.body.gravity.polyhedron import polyhedron_field
from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.errors import InputRefused, NothingFeasible
from landing_cli.reach.records import Verdict
from landing_cli.reach.stored import CaseResult
from landing_cli.studies.rank.measures import roughness_m, slopes_deg

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Mask = NDArray[np.bool_]

# measure -> column in tables, and whether more of it is better
MEASURES: Mapping[str, tuple[str, bool]] = {
    "margin": ("margin", True),
    "delta_v": ("delta_v_m_s", False),
    "slope": ("slope_deg", False),
    "roughness": ("roughness_m", False),
}
# radius of the neighbourhood, in mean edges, unless it is given
RADIUS_EDGES = 3.0


@dataclass(frozen=True)
class Wishes:
    """How sites are to be ranked.

    Attributes
    ----------
    weights : mapping of str to float
        Of every measure; not negative, one of them positive.
    radius_m : float or None, m
        Of the neighbourhood whose roughness counts; None: ``RADIUS_EDGES`` mean edges.
    spacing_m : float or None, m
        Least distance between listed sites; None: the radius.
    top : int
        How many sites are listed at most.
    gravity : {"run", "polyhedron"}
        Field of the slope: that of the run, or the uniform polyhedron of the mesh.
    """

    weights: Mapping[str, float]
    radius_m: float | None = None
    spacing_m: float | None = None
    top: int = 10
    gravity: str = "run"


@dataclass(frozen=True, eq=False)
class Ranking:
    """Every facet's measures and score, and the sites in order.

    Attributes
    ----------
    cases : tuple of CaseResult
        Those that were asked; the worst over them counts.
    measures : mapping of str to (m,) float
        Margin, delta-v (m/s), slope (degree), roughness (m); NaN where a facet is no candidate.
    parts : mapping of str to (m,) float
        Each measure from 0, the worst candidate, to 1, the best.
    score : (m,) float
        From 0 to 1; NaN where a facet is no candidate.
    candidates : (m,) bool
    through_rock : int
        Facets left out because a path to them cuts the mesh.
    sites : (k,) int
        Facets, best first, no two nearer than the spacing.
    margin : str
        What the margin is: ``thrust_margin``, or ``1 - peak_thrust_ratio``.
    gravity : str
        The field of the slope, by name.
    weights : mapping of str to float
        Of every measure, their sum 1.
    radius_m, spacing_m : float, m
    """

    cases: tuple[CaseResult, ...]
    measures: Mapping[str, FloatArray]
    parts: Mapping[str, FloatArray]
    score: FloatArray
    candidates: Mask
    through_rock: int
    sites: IntArray
    margin: str
    gravity: str
    weights: Mapping[str, float]
    radius_m: float
    spacing_m: float


def rank_sites(cases: Sequence[CaseResult], wishes: Wishes) -> Ranking:
    """Rank the landing sites of some cases of one reach run.

    Parameters
    ----------
    cases : sequence of CaseResult
        At least one.
    wishes : Wishes
        Weights, radius, spacing, number.

    Returns
    -------
    Ranking

    Raises
    ------
    InputRefused
        The radius does not suit the mesh.
    NothingFeasible
        No facet is a candidate.
    """
    asteroid = cases[0].case.asteroid
    mesh, centroids = asteroid.mesh, facet_centroids(asteroid.mesh)
    reachable, rock = _candidates(cases)
    candidates = reachable & ~rock
    if not candidates.any():
        raise _nothing(cases, int(reachable.sum()))
    radius_m = RADIUS_EDGES * mean_edge_m(mesh) if wishes.radius_m is None else wishes.radius_m
    spacing_m = radius_m if wishes.spacing_m is None else wishes.spacing_m
    field = asteroid.gravity
    if wishes.gravity == "polyhedron":
        field = polyhedron_field(mesh.vertices, mesh.faces, asteroid.gm_m3_s2)
    column, margin = _margin(cases, candidates)
    slope = slopes_deg(centroids, facet_normals(mesh), field, asteroid.rotation_rate_rad_s)
    found = {
        "margin": margin,
        "delta_v": _worst(cases, "delta_v_m_s", np.maximum),
        "slope": slope,
        "roughness": roughness_m(mesh, radius_m),
    }
    measures = {name: np.where(candidates, values, np.nan) for name, values in found.items()}
    parts = {name: goodness(values, MEASURES[name][1]) for name, values in measures.items()}
    total = sum(wishes.weights.values())
    weights = {name: wishes.weights[name] / total for name in MEASURES}
    score = np.sum([weights[name] * parts[name] for name in MEASURES], axis=0)
    return Ranking(
        cases=tuple(cases),
        measures=measures,
        parts=parts,
        score=score,
        candidates=candidates,
        through_rock=int((reachable & rock).sum()),
        sites=distinct_sites(score, centroids, spacing_m, wishes.top),
        margin=column,
        gravity=field.kind.name.lower(),
        weights=weights,
        radius_m=radius_m,
        spacing_m=spacing_m,
    )


def goodness(values: FloatArray, more_is_better: bool) -> FloatArray:
    """Bring a measure to 0 for the worst of the candidates and 1 for the best.

    Parameters
    ----------
    values : (m,) float
        NaN where a facet is no candidate.
    more_is_better : bool
        Which end is best.

    Returns
    -------
    (m,) float
        1 for all where they are equal.
    """
    low, high = np.nanmin(values), np.nanmax(values)
    if high == low:
        return np.where(np.isnan(values), np.nan, 1.0)
    best, worst = (high, low) if more_is_better else (low, high)
    return np.asarray((worst - values) / (worst - best))


def distinct_sites(score: FloatArray, points_m: FloatArray, spacing_m: float, top: int) -> IntArray:
    """List facets by score, leaving out those near a better one.

    Parameters
    ----------
    score : (m,) float
        NaN where a facet is no candidate.
    points_m : (m, 3) float, m
        The facets' places.
    spacing_m : float, m
        Nearer than this to a listed site is the same site.
    top : int
        How many to list at most.

    Returns
    -------
    (k,) int
        Of equal scores the lower facet number first.
    """
    order = np.argsort(-score, kind="stable")
    left = order[np.isfinite(score[order])]
    listed: list[int] = []
    while len(left) and len(listed) < top:
        listed.append(int(left[0]))
        far = np.linalg.norm(points_m[left] - points_m[left[0]], axis=1) >= spacing_m
        far[0] = False
        left = left[far]
    return np.array(listed, dtype=np.int64)


def _candidates(cases: Sequence[CaseResult]) -> tuple[Mask, Mask]:
    """Facets that every case reaches, and those to which a path cuts the mesh, (m,) bool."""
    count = len(cases[0].case.asteroid.mesh.faces)
    reachable, rock = np.ones(count, dtype=bool), np.zeros(count, dtype=bool)
    for result in cases:
        rows, own = result.solutions.rows, np.zeros(count, dtype=bool)
        own[rows["facet"][rows["verdict"] == Verdict.REACHABLE]] = True
        reachable &= own
        rock[rows["facet"][rows["terrain_clearance_min_m"] < 0.0]] = True
    return reachable, rock


def _margin(cases: Sequence[CaseResult], candidates: Mask) -> tuple[str, FloatArray]:
    """The thrust margin where the run has it for every candidate, else what the flights leave unused."""
    margin = _worst(cases, "thrust_margin", np.minimum)
    if np.isfinite(margin[candidates]).all():
        return "thrust_margin", margin
    return "1 - peak_thrust_ratio", 1.0 - _worst(cases, "peak_thrust_ratio", np.maximum)


def _worst(cases: Sequence[CaseResult], column: str, worse: np.ufunc) -> FloatArray:
    """The worst of a column over the cases, (m,); NaN where a case has none."""
    count = len(cases[0].case.asteroid.mesh.faces)
    spread = np.full((len(cases), count), np.nan)
    for place, result in enumerate(cases):
        spread[place, result.solutions.rows["facet"]] = result.solutions.rows[column]
    return np.asarray(worse.reduce(spread, axis=0))


def _nothing(cases: Sequence[CaseResult], reachable: int) -> NothingFeasible:
    if reachable:
        what = f"every path to the {reachable} reachable facets cuts the mesh"
        return NothingFeasible(what, fix="solve with --set reach.terrain=require")
    if len(cases) > 1:
        what = f"no facet is reachable in all {len(cases)} cases"
        return NothingFeasible(what, fix="choose one with --case")
    return NothingFeasible("no facet is reachable", where=cases[0].case.name)


def check_weights(given: Mapping[str, float]) -> dict[str, float]:
    """Complete weights by 1 for every measure that is not named.

    Parameters
    ----------
    given : mapping of str to float
        By measure.

    Returns
    -------
    dict of str to float

    Raises
    ------
    InputRefused
        A weight is negative or no number, or all are 0.
    """
    weights = {name: float(given.get(name, 1.0)) for name in MEASURES}
    wrong = [name for name, weight in weights.items() if not 0.0 <= weight < np.inf]
    if wrong:
        told = f"{wrong[0]} has the weight {weights[wrong[0]]:g}"
        raise InputRefused(told, where="--weight", fix="give 0 or more")
    if not any(weights.values()):
        raise InputRefused("every weight is 0", where="--weight", fix="give one measure a weight")
    return weights
