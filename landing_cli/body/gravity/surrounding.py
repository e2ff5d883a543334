"""A polyhedron's field around the whole body: near facets exactly, far ones as polynomials.

Space is divided into cubes (`surrounding_pieces`), inside the body too: the field is as good at the surface
as far off. Within a piece acceleration and gradient are derivatives of one potential; from one piece to the
next it jumps by no more than its error. Far off one expansion holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from landing_cli.body.gravity.facet_potential import FACET
from landing_cli.body.gravity.field import GravityField, GravityKind
from landing_cli.body.gravity.field_values import accelerations_and_gradients
from landing_cli.body.gravity.fitted_pieces import probe_points
from landing_cli.body.gravity.kernel_types import FloatArray
from landing_cli.body.gravity.polyhedron_records import recorded_corners
from landing_cli.body.gravity.surrounding_kernels import ERROR, HEADER
from landing_cli.body.gravity.surrounding_pieces import (
    FINE,
    Body,
    IntArray,
    Mapped,
    Piece,
    divide,
    outer_coefficients,
)
from landing_cli.errors import InputRefused

OUTER = 2.0
"""Where one expansion begins that holds for all that is farther, in the body's largest radii."""
MOST_FACETS = 20_000
"""Fitting takes as the square of the facets: two minutes of CPU for 8000."""
_PROBED_PIECES = 400
_PROBES = 3


@dataclass(frozen=True, eq=False)
class SurroundingField:
    """An interpolated field around a body, and how good it is.

    Attributes
    ----------
    field : GravityField
        Of the kind ``INTERPOLATED``.
    error : float
        Largest error of the acceleration at points that the fit did not see, over the acceleration there;
        inside the largest radius R over GM/R^2 where that is more: there it may vanish.
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


def refuse_misfits(polyhedron: GravityField) -> None:
    """Refuse what no field is fitted to.

    Parameters
    ----------
    polyhedron : GravityField
        From ``polyhedron_field``.

    Raises
    ------
    InputRefused
        The field is no polyhedron's, or it has more than MOST_FACETS.
    """
    if polyhedron.kind is not GravityKind.POLYHEDRON:
        name = polyhedron.kind.name.lower()
        raise InputRefused(
            f"a {name} field is not worth interpolating",
            where="gravity",
            fix="fly in it directly, or take a polyhedron",
        )
    facets = len(recorded_corners(polyhedron.params)) // 3
    if facets > MOST_FACETS:
        raise InputRefused(
            f"{facets} facets are too many to fit a field to: at most {MOST_FACETS}",
            where="gravity",
            fix="resample the shape (landing shapes resample), or take another model",
        )


def surrounding_field(polyhedron: GravityField, mapped: Mapped = map) -> SurroundingField:
    """Interpolate a polyhedron's field around the body.

    Parameters
    ----------
    polyhedron : GravityField
        From ``polyhedron_field``.
    mapped : callable
        ``map``, or one that works at several cubes at once and keeps their order: the numbers are the same.

    Returns
    -------
    SurroundingField

    Raises
    ------
    InputRefused
        The field is no polyhedron's, or it has more than MOST_FACETS.
    """
    refuse_misfits(polyhedron)
    body = Body.of(polyhedron)
    least = FINE * body.size(body.every)
    outer = OUTER * body.radius_m
    half = least * 2.0 ** math.ceil(math.log2(outer / least))
    tree, pieces = divide(body, half, outer, mapped)
    params = _packed(body, half, outer, tree, pieces)
    error, gradient_error, points = _measured(GravityField(GravityKind.INTERPOLATED, params), body, pieces)
    params[ERROR] = error
    field = GravityField(GravityKind.INTERPOLATED, params)
    near = float(np.mean([len(piece.near) for piece in pieces]))
    return SurroundingField(field, error, gradient_error, points, len(pieces), near)


def _packed(body: Body, half: float, outer: float, tree: IntArray, pieces: list[Piece]) -> FloatArray:
    """Parameters as `surrounding_kernels` reads them; the error is not yet known."""
    table = HEADER + len(tree)
    lists = table + body.table.size
    coefficients = lists + sum(3 + len(piece.near) for piece in pieces)
    nodes, parts, at = tree.astype(np.float64), [], lists
    fits = [outer_coefficients(body, outer)]
    place = coefficients + len(fits[0])
    for piece in pieces:
        nodes[piece.node] = -at
        own = [place, float(piece.far), len(piece.near)]
        parts.append(np.concatenate([own, table + FACET * piece.near]))
        at += len(parts[-1])
        fits.append(piece.coefficients)
        place += len(piece.coefficients)
    head = [place, coefficients, half, outer, 0.0, body.gm_m3_s2]
    return np.concatenate([head, nodes, body.table.ravel(), *parts, *fits, body.field.params])


def _measured(field: GravityField, body: Body, pieces: list[Piece]) -> tuple[float, float, int]:
    """Largest relative errors of g and its gradient, at points that the fit did not see, of many pieces."""
    chosen = pieces[:: max(1, len(pieces) // _PROBED_PIECES)]
    local = probe_points(_PROBES * len(chosen), 0.75).reshape(len(chosen), _PROBES, 3)
    center = np.array([piece.cube.center for piece in chosen])[:, None]
    half = np.array([piece.cube.half for piece in chosen])[:, None, None]
    points = (center + half * local).reshape(-1, 3)
    g, G = accelerations_and_gradients(field, points)
    exact_g, exact_G = accelerations_and_gradients(body.field, points)
    r, radius = np.linalg.norm(points, axis=1), body.radius_m
    typical = body.gm_m3_s2 / np.maximum(r, radius) ** 2
    size = np.maximum(np.linalg.norm(exact_g, axis=1), np.where(r > radius, 0.0, typical))
    steep = np.maximum(np.linalg.norm(exact_G, axis=(1, 2)), typical / np.maximum(r, radius))
    wrong, wrong_G = np.linalg.norm(g - exact_g, axis=1), np.linalg.norm(G - exact_G, axis=(1, 2))
    return float((wrong / size).max()), float((wrong_G / steep).max()), len(points)
