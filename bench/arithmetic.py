"""Floating-point operations of one interior-point iteration, counted from the kernel's loops.

Additions, multiplications, divisions and square roots count one each. Counted are the flight with gravity
of degree 2, its adjoint, and the elimination, right-hand sides and directions of nodes and cones; tangent
planes of the ellipsoid and the certificate come on top and are left out, so that the rate is a lower bound.
"""

from __future__ import annotations

ROWS = 6  # matching rows
CONES = 7  # thrust at five points of the final arc, glide slope at its two ends
Y = 7  # thrust level and the final stage's two accelerations

FLIGHT = 230  # a node: gravity and gradient in the body's axes, there and back, and the step
ADJOINT = 42  # a node and row
PULL = 6  # a node and row
NODE_RESIDUAL = 20
SCALING = 55  # the scaling point of one cone
ELIMINATION = 20  # a node, and 20 a row and 6 a pair of rows
SHIFT = 150  # complementarity shift and right-hand side of one cone
DIRECTION = 100  # direction of one cone, with the two longest steps


def flops_of_iteration(intervals: int) -> float:
    """Operations of one iteration without tangent planes.

    Parameters
    ----------
    intervals : int
        Thrust intervals N.
    """
    pairs = ROWS * (ROWS + 1) / 2
    node = FLIGHT + ROWS * (ADJOINT + PULL) + NODE_RESIDUAL
    node += SCALING + ELIMINATION + 20 * ROWS + 6 * pairs
    node += 2 * (SHIFT + DIRECTION + 4 * 6 * ROWS / 2)
    cone = 4 * Y * 4 + SCALING + Y * 20 + 8 * Y * (Y + 1) / 2
    cone += 2 * (SHIFT + DIRECTION + 3 * 2 * 4 * Y)
    dense = ROWS**3 / 3 + Y * ROWS**2 + Y * Y * ROWS + Y**3 / 3 + 2 * 2 * (ROWS**2 + Y**2 + 2 * ROWS * Y)
    return intervals * node + CONES * cone + dense
