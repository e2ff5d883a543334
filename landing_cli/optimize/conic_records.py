"""Records of the interior-point kernel: the iterate, the linearised problem, work space of an iteration.

Their arrays hold numbers, for one problem, or lanes (`kernel_lanes`), for several.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel_record import by_reference

Floats = NDArray[np.float64]
New = Callable[..., Any]

Y_SIZE = 7
STATE = 6  # basis functionals that a state has: position and velocity


@by_reference
class Point(NamedTuple):
    """The primal-dual iterate (N intervals, J cones, R rows; scaled units)."""

    thrust: Floats  # (N, 3)
    node_dual: Floats  # (N, 4)
    y: Floats  # (7,) thrust level, acceleration at touchdown, acceleration at handover
    cone_slack: Floats  # (J, 4)
    cone_dual: Floats  # (J, 4)
    multiplier: Floats  # (R,)
    slack: Floats  # (R,) of the inequality rows


@by_reference
class Model(NamedTuple):
    """The problem linearised at a point.

    A row's derivative by the thrust of interval k is a mix of the B basis functionals' up to the row's end,
    and zero beyond: sum_b row_mix[r, b] basis[k, b] for k < row_end[r]. The first STATE rows are the first
    STATE functionals, up to the last interval; their mixes are not read.
    """

    row_value: Floats  # (R,) c(F, y); for inequality rows before the slack is taken off
    row_mix: Floats  # (R, B)
    row_end: Floats  # (R,) whole numbers
    row_live: Floats  # (R,) 1, or 0: the row is not there
    row_y: Floats  # (R, 7) derivative with respect to y
    basis: Floats  # (N, B, 3)
    cone_map: Floats  # (J, 4, 7)
    cone_offset: Floats  # (J, 4)
    row_pull: Floats  # (N, 3) the rows' derivatives by the thrust nodes, weighted by their multipliers
    thrust_gradient: Floats  # (N, 3) of the Lagrangian's smooth part without row_pull
    thrust_curvature: Floats  # (N,) isotropic Hessian
    y_gradient: Floats  # (7,)
    y_hessian: Floats  # (7, 7)
    sums: Floats  # (N + 1, B) scratch space


@by_reference
class Step(NamedTuple):
    """Residuals, scalings, factors and the direction of one iteration."""

    node_residual: Floats  # (N, 3)
    y_residual: Floats  # (7,)
    row_residual: Floats  # (R,)
    node_scaling: Floats  # (N, 5) w, 1/beta^2
    node_inverse: Floats  # (N, 3) 1/a, Sherman-Morrison factor f, coupling to tau
    node_shift: Floats  # (N, 4)
    cone_residual: Floats  # (J, 4)
    cone_scaling: Floats  # (J, 5)
    cone_shift: Floats  # (J, 4)
    products: Floats  # (N + 1, B (B + 3) / 2) sums over the intervals before each node: basis H^-1 basis'
    #   as a packed lower triangle, then the basis' coupling to tau
    mixed: Floats  # (R, B) the triangle at each row's end times its mix
    schur: Floats  # (R, R) rows' H^-1 rows' and its factor
    coupling: Floats  # (R, 7)
    solved_coupling: Floats  # (R, 7) L^-1 coupling, schur = L L'
    reduced: Floats  # (7, 7)
    row_shift: Floats  # (R,) constant part of an inequality row's slack step
    rhs_rows: Floats  # (R,)
    rhs_y: Floats  # (7,)
    d_thrust: Floats  # (N, 3)
    d_ball: Floats  # (4,) of tau and one node's thrust
    d_node_dual: Floats  # (N, 4)
    d_y: Floats  # (7,)
    d_cone_slack: Floats  # (J, 4)
    d_cone_dual: Floats  # (J, 4)
    d_multiplier: Floats  # (R,)
    d_slack: Floats  # (R,)


def new_point(n_nodes: int, n_cones: int, n_rows: int, new: New = np.zeros) -> Point:
    """Return a zeroed iterate, of arrays that ``new`` makes."""
    return Point(
        new((n_nodes, 3)),
        new((n_nodes, 4)),
        new(Y_SIZE),
        new((n_cones, 4)),
        new((n_cones, 4)),
        new(n_rows),
        new(n_rows),
    )


def new_model(n_nodes: int, n_cones: int, n_rows: int, n_basis: int = STATE, new: New = np.zeros) -> Model:
    """Return a zeroed model, of arrays that ``new`` makes."""
    return Model(
        new(n_rows),
        new((n_rows, n_basis)),
        new(n_rows),
        new(n_rows),
        new((n_rows, Y_SIZE)),
        new((n_nodes, n_basis, 3)),
        new((n_cones, 4, Y_SIZE)),
        new((n_cones, 4)),
        new((n_nodes, 3)),
        new((n_nodes, 3)),
        new(n_nodes),
        new(Y_SIZE),
        new((Y_SIZE, Y_SIZE)),
        new((n_nodes + 1, n_basis)),
    )


def new_step(n_nodes: int, n_cones: int, n_rows: int, n_basis: int = STATE, new: New = np.zeros) -> Step:
    """Return zeroed scratch space for an iteration, of arrays that ``new`` makes."""
    return Step(
        new((n_nodes, 3)),
        new(Y_SIZE),
        new(n_rows),
        new((n_nodes, 5)),
        new((n_nodes, 3)),
        new((n_nodes, 4)),
        new((n_cones, 4)),
        new((n_cones, 5)),
        new((n_cones, 4)),
        new((n_nodes + 1, n_basis * (n_basis + 3) // 2)),
        new((n_rows, n_basis)),
        new((n_rows, n_rows)),
        new((n_rows, Y_SIZE)),
        new((n_rows, Y_SIZE)),
        new((Y_SIZE, Y_SIZE)),
        new(n_rows),
        new(n_rows),
        new(Y_SIZE),
        new((n_nodes, 3)),
        new(4),
        new((n_nodes, 4)),
        new(Y_SIZE),
        new((n_cones, 4)),
        new((n_cones, 4)),
        new(n_rows),
        new(n_rows),
    )
