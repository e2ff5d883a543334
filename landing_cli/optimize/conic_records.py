"""Records of the interior-point kernel: the iterate, the linearised problem, work space of an iteration."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.kernel_record import by_reference

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

Y_SIZE = 7


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
    """The problem linearised at a point."""

    row_value: Floats  # (R,) c(F, y); for inequality rows before the slack is taken off
    row_thrust: Floats  # (R, N, 3) derivative with respect to the thrust nodes
    row_y: Floats  # (R, 7) derivative with respect to y
    row_end: Ints  # (R,) the row depends on the first row_end intervals only
    cone_map: Floats  # (J, 4, 7)
    cone_offset: Floats  # (J, 4)
    row_pull: Floats  # (N, 3) row_thrust' lambda
    thrust_gradient: Floats  # (N, 3) of the Lagrangian's smooth part without row_pull
    thrust_curvature: Floats  # (N,) isotropic Hessian
    y_gradient: Floats  # (7,)
    y_hessian: Floats  # (7, 7)


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
    schur: Floats  # (R, R) row_thrust H^-1 row_thrust' and its factor
    coupling: Floats  # (R, 7)
    solved_coupling: Floats  # (R, 7) schur^-1 coupling
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


def new_point(n_nodes: int, n_cones: int, n_rows: int) -> Point:
    """Return a zeroed iterate."""
    return Point(
        np.zeros((n_nodes, 3)),
        np.zeros((n_nodes, 4)),
        np.zeros(Y_SIZE),
        np.zeros((n_cones, 4)),
        np.zeros((n_cones, 4)),
        np.zeros(n_rows),
        np.zeros(n_rows),
    )


def new_model(n_nodes: int, n_cones: int, n_rows: int) -> Model:
    """Return a zeroed model."""
    return Model(
        np.zeros(n_rows),
        np.zeros((n_rows, n_nodes, 3)),
        np.zeros((n_rows, Y_SIZE)),
        np.zeros(n_rows, dtype=np.int64),
        np.zeros((n_cones, 4, Y_SIZE)),
        np.zeros((n_cones, 4)),
        np.zeros((n_nodes, 3)),
        np.zeros((n_nodes, 3)),
        np.zeros(n_nodes),
        np.zeros(Y_SIZE),
        np.zeros((Y_SIZE, Y_SIZE)),
    )


def new_step(n_nodes: int, n_cones: int, n_rows: int) -> Step:
    """Return zeroed scratch space for an iteration."""
    return Step(
        np.zeros((n_nodes, 3)),
        np.zeros(Y_SIZE),
        np.zeros(n_rows),
        np.zeros((n_nodes, 5)),
        np.zeros((n_nodes, 3)),
        np.zeros((n_nodes, 4)),
        np.zeros((n_cones, 4)),
        np.zeros((n_cones, 5)),
        np.zeros((n_cones, 4)),
        np.zeros((n_rows, n_rows)),
        np.zeros((n_rows, Y_SIZE)),
        np.zeros((n_rows, Y_SIZE)),
        np.zeros((Y_SIZE, Y_SIZE)),
        np.zeros(n_rows),
        np.zeros(n_rows),
        np.zeros(Y_SIZE),
        np.zeros((n_nodes, 3)),
        np.zeros(4),
        np.zeros((n_nodes, 4)),
        np.zeros(Y_SIZE),
        np.zeros((n_cones, 4)),
        np.zeros((n_cones, 4)),
        np.zeros(n_rows),
        np.zeros(n_rows),
    )
