"""A polyhedron's field, interpolated over a box outside the body: far faster there, exact elsewhere.

The potential is a polynomial on every piece of the box that lies outside the body and could be fitted to
within the tolerance (`fitted_pieces`); acceleration and gradient are its derivatives, so that the field stays
conservative. Anywhere else, near edges of facets above all, the polyhedron itself is evaluated: the field is
nowhere worse than what is measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from landing_cli.body.gravity.boxed_kernels import HEADER
from landing_cli.body.gravity.checks import checked_number
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import accelerations_and_gradients
from landing_cli.body.gravity.fitted_pieces import Pieces, TurnedPolyhedron, fit_pieces, probe_points
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.polyhedron_records import recorded_corners
from landing_cli.errors import InputRefused

TOLERANCE = 1e-9
MOST_HALVINGS = 9
_PROBE_POINTS = 40


@dataclass(frozen=True, eq=False)
class Box:
    """A box in axes of its own.

    Attributes
    ----------
    origin_m : (3,) float, m, body frame
    axes : (3, 3) float
        Rows: its unit vectors in the body frame.
    lower_m, upper_m : (3,) float, m
        Its extent along its axes, from the origin.
    """

    origin_m: FloatArray
    axes: FloatArray
    lower_m: FloatArray
    upper_m: FloatArray


@dataclass(frozen=True, eq=False)
class BoxedField:
    """An interpolated field, and how good it is.

    Attributes
    ----------
    field : GravityField
        Of the kind ``BOXED``.
    error : float
        Largest error of the acceleration over the acceleration, at points that the fit did not see.
    gradient_error : float
        The same of the gradient, by Frobenius norms.
    checked_points : int
    pieces : int
    covered : float
        Share of the box's volume that the pieces cover; the body and its edges have the rest.
    """

    field: GravityField
    error: float
    gradient_error: float
    checked_points: int
    pieces: int
    covered: float


def boxed_field(
    polyhedron: GravityField, box: Box, tolerance: float = TOLERANCE, most_halvings: int = MOST_HALVINGS
) -> BoxedField:
    """Interpolate a polyhedron's field over a box.

    Parameters
    ----------
    polyhedron : GravityField
        From ``polyhedron_field``.
    box : Box
        Where it is wanted. A box whose floor lies in a facet's plane can be fitted down to that facet.
    tolerance : float
        Largest error of the acceleration in a piece, over the acceleration.
    most_halvings : int
        How often the box may be halved; what would need more is left to the polyhedron.

    Returns
    -------
    BoxedField

    Raises
    ------
    InputRefused
        The field is no polyhedron's, the box is empty, or the tolerance is not positive.
    """
    if polyhedron.kind != GravityKind.POLYHEDRON:
        name = polyhedron.kind.name.lower()
        raise InputRefused(
            f"a {name} field is not worth interpolating",
            where="gravity",
            fix="fly in it directly, or take a polyhedron",
        )
    checked_number("tolerance", tolerance, above=0.0)
    lower, upper = np.asarray(box.lower_m, dtype=np.float64), np.asarray(box.upper_m, dtype=np.float64)
    if not (lower < upper).all():
        raise InputRefused("the box is empty", where="gravity", fix="give it an extent along every axis")
    body = TurnedPolyhedron(polyhedron, box.origin_m, box.axes)
    center, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
    triangles = (recorded_corners(polyhedron.params) - box.origin_m) @ box.axes.T
    pieces = fit_pieces(body, triangles.reshape(-1, 3, 3), center, half, tolerance, most_halvings)
    field = GravityField(GravityKind.BOXED, _packed(polyhedron, box, center, half, pieces))
    error, gradient_error, points = _measured(field, body, pieces)
    covered = float((pieces.half.prod(axis=1) / half.prod()).sum())
    return BoxedField(field, error, gradient_error, points, len(pieces.center), covered)


def _packed(
    polyhedron: GravityField, box: Box, center: FloatArray, half: FloatArray, pieces: Pieces
) -> FloatArray:
    """Parameters as `boxed_kernels` reads them."""
    tree, coefficients = pieces.tree.astype(np.float64), pieces.coefficients.ravel()
    first = HEADER + len(tree)
    head = [[first + len(coefficients), first], box.origin_m, box.axes.ravel(), center, half]
    return np.concatenate([*head, tree, coefficients, polyhedron.params])


def _measured(field: GravityField, body: TurnedPolyhedron, pieces: Pieces) -> tuple[float, float, int]:
    """Largest relative errors of g and its gradient over all pieces, at points that the fit did not see."""
    if not len(pieces.center):
        return 0.0, 0.0, 0
    local = probe_points(_PROBE_POINTS, 0.75)
    points = body.to_body((pieces.center[:, None] + pieces.half[:, None] * local).reshape(-1, 3))
    g, G = accelerations_and_gradients(field, points)
    exact_g, exact_G = accelerations_and_gradients(body.field, points)
    return _largest_share(g - exact_g, exact_g), _largest_share(G - exact_G, exact_G), len(points)


def _largest_share(wrong: FloatArray, exact: FloatArray) -> float:
    sizes = (np.linalg.norm(a.reshape(len(a), -1), axis=1) for a in (wrong, exact))
    return float(np.divide(*sizes).max())
