"""Proofs that no flight passes around the keep-out ellipsoid, on any side.

In xi = sqrt(Re) r the ellipsoid is the unit sphere, and at every time of the descent a flight is outside it.
Triangles of directions cover the sphere; a flight whose direction at a time t_k lies in a triangle is beyond
the plane through the triangle's corners there, since |xi| >= 1 and the corners' chord plane cuts the sphere's
cap off. One plane at one time makes a convex relaxation, and multipliers of it a lower bound on the thrust
level of the flights beyond it (`certificate`). Where the bound exceeds 1 for every triangle of a cover, no
flight exists at all. Where it does not for one, the flight that was relaxed so is looked at: the time at
which it is deepest inside is covered in turn, or the triangle that it has there is cut into four. So nothing
is assumed about the sides on which flights may pass, nor about what they do between the times.

Choosing times and triangles needs no care, only luck: any choice gives a valid proof or none.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.reach.certificate import gravity_tube
from landing_cli.reach.free_batch import Batch, CutBatch, new_batch, no_walls, solve_many
from landing_cli.reach.free_solve import CERTIFIED, new_solver
from landing_cli.reach.scaled_case import ScaledCase, scale_case

if TYPE_CHECKING:
    from landing_cli.reach.free_descent import PreparedCase

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

# Intervals of the relaxations: a proof on a coarse grid is as good as on a fine one.
INTERVALS = 20
# |xi| that flights keep: delivered ones may be this much below 1.
LEVEL = 1.0 - 1e-5
# A relaxed flight that is nowhere deeper inside than this leaves nothing to branch on.
CLEAR = 1.0 - 1e-3
# A triangle is cut while a flight has less |xi| at its node; new nodes are so far from the old ones, unless
# the flight is deeper inside near them by more than this.
INSIDE, APART, SHALLOWER = 0.99, 2, 0.03
# Covers and cuts that are tried for a facet, planes that a relaxation may have, iterations it may take.
MOST_FAMILIES, MOST_PLANES, LIMIT = 40, 6, 30
NEVER, MARGIN_WEIGHT = 1 << 30, 1e-3

_SIGNS = np.array([[x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)], dtype=np.float64)
OCTAHEDRON = _SIGNS[:, :, None] * np.eye(3)  # (8, 3, 3) corners of its triangles


class Branch(NamedTuple):
    """Flights of one facet that pass some triangles of directions at some nodes."""

    place: int  # of the facet in its batch
    nodes: tuple[int, ...]
    triangles: tuple[Floats, ...]  # (3, 3) each: corners, unit vectors in xi


class Open(NamedTuple):
    """A branch that is not proved, and where its relaxed flight is deepest inside."""

    branch: Branch
    node: int
    direction: Floats  # (3,) unit vector in xi


@dataclass(frozen=True, eq=False)
class Relaxations:
    """What all branches of a batch of facets share."""

    case: ScaledCase
    tube: Floats
    arc_bound: float
    targets: Floats  # (n, 3) scaled
    normals: Floats  # (n, 3)


def bounds_around(prepared: PreparedCase, facets: Ints, levels: Floats) -> tuple[Floats, Ints]:
    """Bound the thrust levels of facets from below, the keep-out ellipsoid included.

    A relaxation's bound lies below its least thrust level, as gravity can pull either way in it, and no
    relaxation's level lies above the facet's: where that is not far enough above 1, nothing is tried.

    Parameters
    ----------
    prepared : PreparedCase
        The case.
    facets : (n,) int
        0-based.
    levels : (n,) float
        Least thrust levels that were found for them; infinite where none was.

    Returns
    -------
    bounds : (n,) float
        Above 1 where no flight with the thrust bound exists; NaN where that was not proved.
    iterations : (n,) int
        Solver iterations.
    """
    shared = prepared.shared
    # a handover on the ellipsoid is one outside it: its own row has no part in the bound
    scaled = scale_case(prepared.case, INTERVALS)._replace(propellant=2.0, on_ellipsoid=False)
    relaxed = Relaxations(
        scaled,
        gravity_tube(scaled, shared.bounds),
        shared.bounds.on_arcs_m_s2 / scaled.acceleration_m_s2,
        shared.centroids_m[facets] / scaled.length_m,
        shared.normals[facets],
    )
    bounds, iterations = np.full(len(facets), np.inf), np.zeros(len(facets), dtype=np.int64)
    open_: dict[int, list[Open]] = {place: [] for place in range(len(facets))}
    family = [Branch(place, (), ()) for place in open_]
    for _ in range(MOST_FAMILIES):
        solved = _solve(relaxed, family)
        node, direction, depth = _deepest(scaled, solved.position, family)
        stuck = (depth > CLEAR) | _hopeless(family, solved, levels)
        for k in np.argsort(-solved.level, kind="stable"):  # the likeliest to fail is looked at first
            place = family[k].place
            iterations[place] += solved.iterations[k]
            if solved.status[k] == CERTIFIED:
                bounds[place] = min(bounds[place], solved.bound[k])
            elif stuck[k]:
                bounds[place] = np.nan
            elif place in open_:
                open_[place].append(Open(family[k], int(node[k]), direction[k]))
        open_ = {place: left for place, left in open_.items() if left and not np.isnan(bounds[place])}
        family = [branch for left in open_.values() for branch in _children(left.pop())]
        if not family:
            break
    bounds[list(open_)] = np.nan  # what is open after the last family
    return bounds, iterations


def _hopeless(family: list[Branch], solved: Batch, levels: Floats) -> Flags:
    """Whether branches have no more room for planes, or facets levels that no bound can tell from 1.

    A bound lies below its relaxation's level by what gravity may do along the multipliers, which is about as
    much in all of a facet's relaxations.
    """
    planes = np.array([len(branch.nodes) for branch in family])
    blur = solved.level - solved.bound
    blurred = levels[[branch.place for branch in family]] - blur <= 1.0
    return np.asarray((planes == MOST_PLANES) | (planes == 0) & blurred)


def _children(opened: Open) -> list[Branch]:
    """Cover the flights of a branch: by eight triangles at a new node, or by four in place of an old one."""
    place, nodes, triangles = opened.branch
    if opened.node not in nodes:
        cover = OCTAHEDRON @ _frame_about(opened.direction)
        return [Branch(place, (*nodes, opened.node), (*triangles, triangle)) for triangle in cover]
    at = nodes.index(opened.node)
    return [
        Branch(place, nodes, (*triangles[:at], part, *triangles[at + 1 :]))
        for part in quarters(triangles[at])
    ]


def _frame_about(direction: Floats) -> Floats:
    """Three unit vectors at right angles, as rows, the last one in a direction."""
    helper = np.eye(3)[np.argmin(np.abs(direction))]
    across = np.cross(direction, helper)
    across /= np.linalg.norm(across)
    return np.stack([across, np.cross(direction, across), direction])


def quarters(triangle: Floats) -> list[Floats]:
    """Cut a spherical triangle in four at the middles of its sides."""
    a, b, c = triangle
    middles = np.stack([a + b, b + c, c + a])
    ab, bc, ca = middles / np.linalg.norm(middles, axis=1, keepdims=True)
    return [np.stack(corners) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]


def planes_through(triangles: Floats) -> Floats:
    """Normals n of the planes n . xi = 1 through the corners of triangles on the unit sphere.

    Every point outside the sphere in the cone over a triangle has n . xi >= 1: it is a sum of the corners
    with weights that are not negative and, the corners being unit vectors, add up to |xi| at least.

    Parameters
    ----------
    triangles : (k, 3, 3) float
        Corners, unit vectors; no triangle holds a great circle.

    Returns
    -------
    (k, 3) float
    """
    return np.asarray(np.linalg.solve(triangles, np.ones((len(triangles), 3, 1)))[:, :, 0])


def _cuts(case: ScaledCase, family: list[Branch]) -> CutBatch:
    """Lay the planes of branches out for the solver, normals in its axes."""
    planes = np.array([len(branch.nodes) for branch in family], dtype=np.int64)
    node = np.zeros((len(family), MOST_PLANES), dtype=np.int64)
    normal = np.zeros((len(family), MOST_PLANES, 3))
    used = np.arange(MOST_PLANES) < planes[:, None]
    if used.any():
        node[used] = [k for branch in family for k in branch.nodes]
        triangles = np.stack([triangle for branch in family for triangle in branch.triangles])
        x, y, z = (planes_through(triangles) * case.inverse_axes).T
        c, s = case.node_cos[node[used]], case.node_sin[node[used]]
        normal[used] = np.stack([c * x - s * y, s * x + c * y, z], axis=1)
    return CutBatch(planes, node, normal)


def _solve(relaxed: Relaxations, family: list[Branch]) -> Batch:
    """Find the flights of least thrust level of all branches, or bounds above 1."""
    case, places = relaxed.case, np.array([branch.place for branch in family])
    out = new_batch(len(family), INTERVALS)
    solve_many(
        case,
        relaxed.targets[places],
        relaxed.normals[places],
        _cuts(case, family),
        np.full(len(family), LEVEL),
        no_walls(len(family)),
        MARGIN_WEIGHT,
        True,
        NEVER,
        LIMIT,
        relaxed.tube,
        relaxed.arc_bound,
        True,
        new_solver(case),
        out,
    )
    return out


def _deepest(case: ScaledCase, position: Floats, family: list[Branch]) -> tuple[Ints, Floats, Floats]:
    """Node at which to branch for each path, its direction in xi there, and the least |xi| of the path.

    A triangle that holds a flight well inside is cut first; a new node keeps its distance from the old ones,
    where a flight cannot be far from where it was bound to pass.
    """
    c, s = case.node_cos, case.node_sin
    x, y, z = np.moveaxis(position, 2, 0)
    xi = np.stack([c * x + s * y, c * y - s * x, z], axis=2) * case.inverse_axes
    level = np.linalg.norm(xi, axis=2)
    level[:, 0] = np.inf
    level[np.isnan(level)] = np.inf
    node = np.array([_branching_node(*pair) for pair in zip(level, family, strict=True)], dtype=np.int64)
    every = np.arange(len(node))
    return node, xi[every, node] / level[every, node, None], level.min(axis=1)


def _branching_node(level: Floats, branch: Branch) -> int:
    old = np.array(branch.nodes, dtype=np.int64)
    if len(old) == 0:
        return int(np.argmin(level))
    if level[old].min() < INSIDE:
        return int(old[np.argmin(level[old])])
    every = np.arange(len(level))
    apart = np.where(np.abs(every[:, None] - old).min(axis=1) >= APART, level, np.inf)
    if apart.min() < min(level.min() + SHALLOWER, CLEAR):
        return int(np.argmin(apart))
    return int(np.argmin(level))
