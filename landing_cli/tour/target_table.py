"""Where the targets are during the flight: N-body states at nodes, conics between them, and a grid."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from landing_cli.flight.astronomy import DAY_S, GM_SUN_M3_S2
from landing_cli.flight.elements import OrbitElements
from landing_cli.flight.kepler import State, kepler_state
from landing_cli.kernel import kernel
from landing_cli.kernel_record import by_reference
from landing_cli.tour.ephemeris import Ephemeris
from landing_cli.tour.nbody import fly_elements

FloatArray = NDArray[np.float64]

SEARCH_TOLERANCE = 1e-6
"""Of the N-body flights of a search: metres to some kilometres, where a hint is good to hundreds."""
NODE_SPACING_S = 40.0 * DAY_S
"""Half of it lies between a time and the nearest node: the planets pull less than 1000 km, unless close."""


@by_reference
class TargetTable(NamedTuple):
    """Motion of n targets through the flight, heliocentric, ecliptic and equinox J2000.

    ``node_t_s`` (k,), evenly spaced, and ``node_states`` (n, k, 6): N-body, m and m/s. ``grid_t_s`` (m,),
    evenly spaced, and ``grid_m`` (n, 3, m) float32: positions, for the screening alone.
    """

    node_t_s: FloatArray
    node_states: FloatArray
    grid_t_s: FloatArray
    grid_m: NDArray[np.float32]


def target_table(
    elements: OrbitElements, start_t_s: float, end_t_s: float, step_s: float, ephemeris: Ephemeris
) -> TargetTable:
    """Tabulate the motion of targets.

    Parameters
    ----------
    elements : OrbitElements
        Of n targets, each at its own epoch.
    start_t_s, end_t_s : float, s
        The flight.
    step_s : float, s
        Longest step of the grid.
    ephemeris : Ephemeris
        From the epochs to the end.

    Returns
    -------
    TargetTable
        A target that hits a body has NaN from there on, and is then never chosen.
    """
    span = end_t_s - start_t_s
    nodes = start_t_s + span * np.linspace(0.0, 1.0, 1 + max(1, int(np.ceil(span / NODE_SPACING_S))))
    grid = start_t_s + span * np.linspace(0.0, 1.0, 1 + max(2, int(np.ceil(span / step_s))))
    node_states = fly_elements(elements, nodes, ephemeris, SEARCH_TOLERANCE)
    grid_m = np.full((len(elements), 3, len(grid)), np.nan, dtype=np.float32)
    fill_grid(nodes, node_states, grid, grid_m)
    return TargetTable(nodes, node_states, grid, grid_m)


@kernel
def fill_grid(
    node_t_s: FloatArray, node_states: FloatArray, grid_t_s: FloatArray, grid_m: NDArray[np.float32]
) -> None:
    """Fill the grid of positions from the nodes.

    Parameters
    ----------
    node_t_s : (k,) float, s
        Times of the nodes.
    node_states : (n, k, 6) float, m and m/s
        States there.
    grid_t_s : (m,) float, s
        Times of the grid.
    grid_m : (n, 3, m) float32, m
        Receives the positions.
    """
    for i in range(node_states.shape[0]):
        for j in range(grid_t_s.shape[0]):
            x, y, z, _, _, _ = state_from_nodes(node_t_s, node_states[i], grid_t_s[j])
            grid_m[i, 0, j], grid_m[i, 1, j], grid_m[i, 2, j] = x, y, z


@kernel
def state_from_nodes(node_t_s: FloatArray, states: FloatArray, t_s: float) -> State:
    """State of one target.

    Parameters
    ----------
    node_t_s : (k,) float, s
        Times of the nodes, evenly spaced.
    states : (k, 6) float, m and m/s
        Its states there.
    t_s : float, s
        Any time.

    Returns
    -------
    tuple of 6 float, m and m/s
        On the conic of the nearest node.
    """
    last = node_t_s.shape[0] - 1
    k = int((t_s - node_t_s[0]) / (node_t_s[last] - node_t_s[0]) * last + 0.5)
    k = max(0, min(last, k))
    s = states[k]
    return kepler_state(GM_SUN_M3_S2, s[0], s[1], s[2], s[3], s[4], s[5], t_s - node_t_s[k])


def positions_at(table: TargetTable, targets: NDArray[np.int64], t_s: FloatArray) -> FloatArray:
    """Positions of some targets.

    Parameters
    ----------
    table : TargetTable
        Their motion.
    targets : (c,) int
        Rows of the table.
    t_s : (c,) float, s
        When, each.

    Returns
    -------
    (c, 3) float, m
    """
    return np.array(
        [
            state_from_nodes(table.node_t_s, table.node_states[i], t)[:3]
            for i, t in zip(targets, t_s, strict=True)
        ]
    ).reshape(-1, 3)
