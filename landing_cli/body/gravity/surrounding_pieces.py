"""Cubes around a body: near facets as they are, all the rest of the field as a polynomial.

Space is divided in eight and again, until a cube is far from every facet or not much larger than those near
it. In the first case U - GM/r, in the second U without its near facets (`facet_potential`) is smooth over the
cube: its gradient and Hessian are fitted, by least squares, by a polynomial in the coordinates of the cube,
-1 to 1. The exact field is asked for where cubes are large, as few are. The small ones inherit their parents'
polynomials, which they hold exactly, and add that of the facets that were near the parent and are far from
the child: the downward pass of the fast multipole method (Greengard & Rokhlin 1987), with least-squares fits
in place of multipoles.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.gravity.facet_potential import facet_table, fill_gradients, potential_of
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations_and_gradients, potentials
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.body.gravity.polyhedron import inside_share
from landing_cli.body.gravity.polyhedron_records import recorded_corners
from landing_cli.body.gravity.surrounding_fit import bits, outer_polynomial, polynomial, to_children
from landing_cli.body.gravity.surrounding_kernels import FAR_DEGREE, NEAR_DEGREE, OUTER_DEGREE

IntArray = NDArray[np.int64]
Mapped: TypeAlias = Callable[..., Any]

FINE = 1.2
"""Half the side of small cubes, in roots of the mean area of the facets near them."""
_ROOM = 1.5  # small cubes where facets are smaller than elsewhere
_LARGE = 5.0  # in small cubes: what asks for the exact field is up to so large
_MOST_NEAR = 110  # facets near a piece
_FAR, _WIDE, _NEAR, _LEAST = 2.3, 3.0, 2.75, 2.0
"""How far facets are near a cube, in halves of its side: a large one, where none may be near and where some
are; a smaller one; and a small one, if it would else be near too many."""
_MOST_DIVISIONS = 40


@dataclass(frozen=True, eq=False)
class Body:
    """A polyhedron, as the fit reads it.

    Attributes
    ----------
    field : GravityField
    gm_m3_s2 : float, m3/s2
    table : (m, FACET) float
        See ``facet_table``.
    lower, upper : (m, 3) float, m
        Corners of the box around each facet.
    """

    field: GravityField
    gm_m3_s2: float
    table: FloatArray
    lower: FloatArray
    upper: FloatArray

    @classmethod
    def of(cls, field: GravityField) -> Body:
        """Prepare the field of a polyhedron."""
        corners = recorded_corners(field.params).reshape(-1, 3, 3)
        volume = np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6.0
        gm = float(field.params[2] * volume)
        return cls(field, gm, facet_table(corners), corners.min(axis=1), corners.max(axis=1))

    @property
    def radius_m(self) -> float:
        """Largest distance of a corner from the origin."""
        return float(np.linalg.norm(self.table[:, :9].reshape(-1, 3), axis=1).max())

    @property
    def every(self) -> IntArray:
        """All facets."""
        return np.arange(len(self.table))

    def near(self, chosen: IntArray, cube: Cube, reach: float) -> NDArray[np.bool_]:
        """Tell which of chosen facets' own boxes come within ``reach`` halves of a cube, along every axis."""
        distance = (1.0 + reach) * cube.half
        apart = self.lower[chosen] > cube.center + distance
        apart |= self.upper[chosen] < cube.center - distance
        return np.asarray(~apart.any(axis=1))

    def holds(self, point: FloatArray) -> bool:
        """Tell whether a point (3,) lies inside."""
        return bool(inside_share(self.field.params.copy(), point[0], point[1], point[2]) > 0.5)

    def size(self, chosen: IntArray) -> float:
        """Return the root of the mean area of chosen facets, m."""
        return float(np.sqrt(0.5 * self.table[chosen, 12].mean()))


@dataclass(frozen=True, eq=False)
class Cube:
    """A cube along the body's axes.

    Attributes
    ----------
    node : int
        Its place in the tree.
    center : (3,) float, m
    half : float, m
        Half its side.
    depth : int
        How often space was divided.
    """

    node: int
    center: FloatArray
    half: float
    depth: int

    @property
    def distance(self) -> float:
        """Least distance from the origin, m."""
        return float(np.linalg.norm(np.maximum(np.abs(self.center) - self.half, 0.0)))

    def children(self, node: int) -> list[Cube]:
        """Return its eight parts, whose nodes begin at ``node``."""
        h = 0.5 * self.half
        centers = [self.center + h * (2.0 * bits(octant) - 1.0) for octant in range(8)]
        return [Cube(node + octant, at, h, self.depth + 1) for octant, at in enumerate(centers)]


@dataclass(frozen=True, eq=False)
class Piece:
    """A cube and its field.

    Attributes
    ----------
    node : int
        Its place in the tree.
    cube : Cube
    far : bool
        Whether GM/r is part of it.
    coefficients : (c,) float, m2/s2
        In the order of Horner's scheme: powers of x, then y, then z, falling.
    near : (k,) int
        Facets.
    """

    node: int
    cube: Cube
    far: bool
    coefficients: FloatArray
    near: IntArray


def divide(body: Body, half: float, outer: float, mapped: Mapped) -> tuple[IntArray, list[Piece]]:
    """Divide a cube around a body into pieces and fit them.

    Parameters
    ----------
    body : Body
        The polyhedron.
    half : float, m
        Half the side of the cube, whose middle is the origin.
    outer : float, m
        Cubes that lie beyond this distance get no piece.
    mapped : callable
        ``map``, or one that works at several cubes at once and keeps their order.

    Returns
    -------
    tree : (t,) int
        At every node the first of its eight children, which follow each other, that of x below the middle
        first, then y, then z; 0 elsewhere.
    pieces : list of Piece
    """
    tree, cubes = _large_cubes(body, half, outer)
    pieces: list[Piece] = []
    for (cube, _near), (branch, of_branch) in zip(cubes, mapped(partial(_grown, body), cubes), strict=True):
        # the branch's first node is the cube's own
        shift = len(tree) - 1
        moved = np.where(branch > 0, branch + shift, branch).tolist()
        tree[cube.node] = moved[0]
        tree += moved[1:]
        pieces += [replace(p, node=p.node + shift if p.node else cube.node) for p in of_branch]
    return np.array(tree, dtype=np.int64), pieces


def _large_cubes(body: Body, half: float, outer: float) -> tuple[list[int], list[tuple[Cube, IntArray]]]:
    """Divide down to the cubes that are fitted to the exact field: the tree, and them with their facets."""
    tree, found = [0], []
    waiting = [(Cube(0, np.zeros(3), half, 0), body.every)]
    while waiting:
        cube, near = waiting.pop()
        wide = near[body.near(near, cube, _WIDE)]
        if cube.distance > outer:
            continue
        if not _is_too_large(body, cube, wide):
            found.append((cube, wide))
            continue
        waiting += [(child, wide) for child in cube.children(len(tree))]
        tree[cube.node] = len(tree)
        tree += [0] * 8
    return tree, found


def _is_too_large(body: Body, cube: Cube, wide: IntArray) -> bool:
    if not body.near(wide, cube, _FAR).any() or cube.depth >= _MOST_DIVISIONS:
        return False
    return cube.half > _LARGE * FINE * body.size(wide)


def _grown(body: Body, given: tuple[Cube, IntArray]) -> tuple[IntArray, list[Piece]]:
    """Fit a large cube, and divide it into pieces near few facets: a tree and pieces of its own."""
    cube, wide = given
    top = replace(cube, node=0)
    far = not body.near(wide, top, _FAR).any() and not body.holds(top.center)
    waiting = [_far_piece(body, top) if far else _near_piece(body, top, wide)]
    tree, pieces = [0], []
    while waiting:
        piece = waiting.pop()
        if len(piece.near) <= _MOST_NEAR or piece.cube.depth >= _MOST_DIVISIONS:
            pieces.append(piece)
            continue
        waiting += [_inherited(body, child, piece) for child in piece.cube.children(len(tree))]
        tree[piece.node] = len(tree)
        tree += [0] * 8
    return np.array(tree, dtype=np.int64), pieces


def outer_coefficients(body: Body, distance: float) -> FloatArray:
    """Fit (r/D) U as a harmonic polynomial of y = D x/r^2 on the sphere of radius D, where y = x/D.

    Of V = (r/D) U the derivative along y is -(D g.n + U) there, that across it is D times U's; V(0) = GM/D.

    Parameters
    ----------
    body : Body
        The polyhedron.
    distance : float, m
        D, from the origin.

    Returns
    -------
    (c,) float, m2/s2
    """
    family = outer_polynomial(OUTER_DEGREE)
    n, at = family.points, distance * family.points
    u, g = potentials(body.field, at), distance * accelerations_and_gradients(body.field, at)[0]
    along = np.einsum("ki,ki->k", g, n)
    slopes = g - (2.0 * along + u)[:, None] * n
    return family.fit(1.0, body.gm_m3_s2 / distance, slopes, None)


def _near_piece(body: Body, cube: Cube, wide: IntArray) -> Piece:
    """Fit what is left of U beside some facets."""
    general = polynomial(NEAR_DEGREE, False)
    middle, points = general.places(cube.center, cube.half)
    u, (g, G) = potentials(body.field, middle), accelerations_and_gradients(body.field, points)
    near_u, near_g, near_G = _pulls(body, wide, middle, points)
    fit = general.fit(cube.half, u[0] - near_u, g - near_g, G - near_G)
    return Piece(cube.node, cube, False, fit, wide)


def _far_piece(body: Body, cube: Cube) -> Piece:
    """Fit what is left of U, which is harmonic there, beside GM/r."""
    harmonic, mass = polynomial(FAR_DEGREE, True), point_mass_field(body.gm_m3_s2)
    middle, points = harmonic.places(cube.center, cube.half)
    (g, G), (g0, G0) = (accelerations_and_gradients(field, points) for field in (body.field, mass))
    u = potentials(body.field, middle) - potentials(mass, middle)
    fit = harmonic.fit(cube.half, u[0], g - g0, G - G0)
    return Piece(cube.node, cube, True, fit, body.every[:0])


def _inherited(body: Body, cube: Cube, parent: Piece) -> Piece:
    """Take over the parent's polynomial, and add the facets that are no longer near."""
    coefficients = np.einsum("ck,k->c", to_children()[(cube.node - 1) % 8], parent.coefficients)
    kept = body.near(parent.near, cube, _NEAR)
    if kept.sum() > _MOST_NEAR and cube.half <= _ROOM * FINE * body.size(parent.near[kept]):
        least = body.near(parent.near, cube, _LEAST)
        kept = least if least.sum() <= _MOST_NEAR else kept
    far, general = parent.near[~kept], polynomial(NEAR_DEGREE, False)
    if len(far):
        middle, points = general.places(cube.center, cube.half)
        coefficients = coefficients + general.fit(cube.half, *_pulls(body, far, middle, points))
    return Piece(cube.node, cube, False, coefficients, parent.near[kept])


def _pulls(
    body: Body, chosen: IntArray, middle: FloatArray, points: FloatArray
) -> tuple[float, FloatArray, FloatArray]:
    """U at the middle, its gradient (k, 3) and Hessian (k, 3, 3) at points, of chosen facets."""
    table, m = body.table.ravel(), 0.5 * float(body.field.params[2])
    g, G = np.empty((len(points), 3)), np.empty((len(points), 3, 3))
    fill_gradients(table, chosen, points, g, G)
    return m * potential_of(table, chosen, middle), m * g, m * G
