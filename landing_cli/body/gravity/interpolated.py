"""A polyhedron's field, interpolated: near facets exactly, far ones as polynomials: fast, nearly exact.

Space is divided into cubes (`fitted_pieces`); from one to the next the field jumps by no more than its error,
and the gradient is that of the field. Outside the first cube the polyhedron itself is evaluated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_cli.body.gravity.checks import checked_number
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import accelerations_and_gradients
from landing_cli.body.gravity.fitted_pieces import Facets, Piece, fit_pieces, spread_points
from landing_cli.body.gravity.interpolated_kernels import FACET, HEADER, POWERS
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.polyhedron_records import recorded_corners
from landing_cli.errors import InputRefused

FARTHEST = 8.0
"""Half the side of the cube that is divided around a body, in the body's largest radii."""
REACH, MOST_NEAR = 1.5, 160
_PROBED_PIECES = 400
_PROBES = 3


@dataclass(frozen=True, eq=False)
class Cube:
    """A cube along the body's axes.

    Attributes
    ----------
    center_m : (3,) float, m
    half_m : float, m
        Half its side.
    """

    center_m: FloatArray
    half_m: float


@dataclass(frozen=True, eq=False)
class InterpolatedField:
    """An interpolated field, and how good it is.

    Attributes
    ----------
    field : GravityField
        Of the kind ``INTERPOLATED``.
    error : float
        Largest error of the acceleration at points that the fit did not see, over the acceleration there, or
        over GM/R^2 with the body's largest radius R where that is more and the point nearer than R.
    gradient_error : float
        The same of the gradient, by Frobenius norms, over GM/R^3.
    checked_points : int
    pieces : int
    near : float
        Facets that are evaluated in a piece, on average.
    """

    field: GravityField
    error: float
    gradient_error: float
    checked_points: int
    pieces: int
    near: float


def interpolated_field(
    polyhedron: GravityField, cube: Cube | None = None, reach: float = REACH, most_near: int = MOST_NEAR
) -> InterpolatedField:
    """Interpolate a polyhedron's field.

    Parameters
    ----------
    polyhedron : GravityField
        From ``polyhedron_field``.
    cube : Cube, optional
        Where it is wanted; by default around the body, FARTHEST times its largest radius far.
    reach : float
        Facets are evaluated as they are up to this far from a piece, in halves of its side; more is better.
    most_near : int
        Pieces near more facets are divided.

    Returns
    -------
    InterpolatedField

    Raises
    ------
    InputRefused
        The field is no polyhedron's, the cube is empty, or the reach not positive.
    """
    if polyhedron.kind != GravityKind.POLYHEDRON:
        name = polyhedron.kind.name.lower()
        raise InputRefused(
            f"a {name} field is not worth interpolating",
            where="gravity",
            fix="fly in it directly, or take a polyhedron",
        )
    corners = recorded_corners(polyhedron.params)
    radius = float(np.linalg.norm(corners, axis=1).max())
    if cube is None:
        cube = Cube(np.zeros(3), FARTHEST * radius)
    for name, value in (("half side of the cube", cube.half_m), ("reach", reach)):
        checked_number(name, value, above=0.0)
    center = np.asarray(cube.center_m, dtype=np.float64)
    facets = Facets.of(corners.reshape(-1, 3, 3), float(polyhedron.params[2]))
    tree, pieces = fit_pieces(facets, center, cube.half_m, reach, most_near)
    params = _packed(polyhedron, facets, np.append(center, cube.half_m), tree, pieces)
    field = GravityField(GravityKind.INTERPOLATED, params)
    error, gradient_error, points = _measured(field, polyhedron, pieces, radius)
    near = float(np.mean([len(piece.near) for piece in pieces]))
    return InterpolatedField(field, error, gradient_error, points, len(pieces), near)


def polyhedron_of(interpolated: GravityField) -> GravityField:
    """Return the polyhedron's field that an interpolated one stands for."""
    return GravityField(GravityKind.POLYHEDRON, interpolated.params[int(interpolated.params[0]) :])


def is_sound(params: FloatArray) -> bool:
    """Tell whether an interpolated field's parameters lead nowhere that the kernels must not read.

    Parameters
    ----------
    params : (p,) float
        Finite; what follows the first place that they name is not looked at: it is a polyhedron's.
    """
    if len(params) <= HEADER or not _whole(params[:2], HEADER + 1, len(params)):
        return False
    end, coefficients = int(params[0]), int(params[1])
    nodes, seen = np.zeros(1, dtype=np.int64), 0
    while len(nodes):
        seen += len(nodes)
        if seen > len(params) or HEADER + nodes.max() >= coefficients:
            return False
        values = params[HEADER + nodes]
        parents, pieces = values > 0.0, -values[values <= 0.0]
        # children come after their parents: no way down leads back
        if not (values[parents] > nodes[parents]).all() or not _whole(values[parents], 1, coefficients):
            return False
        if not all(_is_sound_piece(params, piece, coefficients, end) for piece in pieces):
            return False
        nodes = (values[parents].astype(np.int64)[:, None] + np.arange(8)).ravel()
    return True


def _is_sound_piece(params: FloatArray, place: float, coefficients: int, end: int) -> bool:
    if not _whole(place, HEADER + 1, coefficients - 1):
        return False
    own = int(place)
    if not _whole(params[own + 1], 0, coefficients - own - 1):
        return False
    near = params[own + 2 : own + 2 + int(params[own + 1])]
    return _whole(params[own], coefficients, end - 3 * POWERS + 1) and _whole(
        near, 0, coefficients - FACET + 1
    )


def _whole(values: FloatArray | float, least: int, end: int) -> bool:
    """Whether all are whole numbers from ``least`` on, below ``end``."""
    given = np.asarray(values)
    return bool(((given == np.floor(given)) & (given >= least) & (given < end)).all())


def _packed(
    polyhedron: GravityField, facets: Facets, cube: FloatArray, tree: FloatArray, pieces: list[Piece]
) -> FloatArray:
    """Parameters as `interpolated_kernels` reads them."""
    table = HEADER + len(tree)
    lists = table + facets.table.size
    coefficients = lists + sum(2 + len(piece.near) for piece in pieces)
    nodes, parts, at = tree.astype(np.float64), [], lists
    for i, piece in enumerate(pieces):
        nodes[piece.node] = -at
        parts.append([coefficients + 3 * POWERS * i, len(piece.near), *(table + FACET * piece.near)])
        at += len(parts[-1])
    fits = np.concatenate([piece.coefficients.ravel() for piece in pieces])
    head = [[coefficients + len(fits), coefficients], cube, nodes, facets.table.ravel()]
    return np.concatenate([*head, *parts, fits, polyhedron.params])


def _measured(
    field: GravityField, polyhedron: GravityField, pieces: list[Piece], radius: float
) -> tuple[float, float, int]:
    """Largest relative errors of g and its gradient, at points that the fit did not see, of many pieces."""
    chosen = pieces[:: max(1, len(pieces) // _PROBED_PIECES)]
    # half of the points lie on the boxes' faces, where fits err most
    local = np.clip(1.3 * spread_points(_PROBES * len(chosen), 0.75), -1.0, 1.0).reshape(len(chosen), -1, 3)
    center = np.array([piece.center for piece in chosen])[:, None]
    half = np.array([piece.half for piece in chosen])[:, None, None]
    points = (center + half * local).reshape(-1, 3)
    g, G = accelerations_and_gradients(field, points)
    exact_g, exact_G = accelerations_and_gradients(polyhedron, points)
    far = np.maximum(np.linalg.norm(points, axis=1) / radius, 1.0)
    # the field of all mass in a sphere of the largest radius
    typical = _mass(polyhedron, radius) / (radius * far) ** 2
    size = np.maximum(np.linalg.norm(exact_g, axis=1), np.where(far > 1.0, 0.0, typical))
    steep = np.maximum(np.linalg.norm(exact_G, axis=(1, 2)), typical / (radius * far))
    wrong, wrong_G = np.linalg.norm(g - exact_g, axis=1), np.linalg.norm(G - exact_G, axis=(1, 2))
    return float((wrong / size).max()), float((wrong_G / steep).max()), len(points)


def _mass(polyhedron: GravityField, radius: float) -> float:
    """GM, from the pull far away."""
    far = np.array([[1e3 * radius, 0.0, 0.0]])
    return float(np.linalg.norm(accelerations_and_gradients(polyhedron, far)[0])) * (1e3 * radius) ** 2
