"""What is delivered for a facet by extremals: the flight at fine steps, and every limit measured on it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from landing_cli.body.bvh import SurfaceIndex
from landing_cli.flight.extremal import thrust_ratio
from landing_cli.kernel import inlined, kernel
from landing_cli.kernel_address import Callee, call
from landing_cli.reach.costate_dynamics import MAX_SPLITS
from landing_cli.reach.delivery import Deliveries, Descent, Frame, measure_of
from landing_cli.reach.ellipsoid_dips import LEVEL, find_dips
from landing_cli.reach.extremal_facet import Flight, new_flight, start_extremal
from landing_cli.reach.extremal_terms import ExtremalProblem
from landing_cli.reach.final_stage import ARC_SAMPLES

Floats = NDArray[np.float64]

# Finer than any search: two switches of the thrust within one step go unseen.
DELIVERY_STEPS = 240


@inlined
def _measure_descent(
    problem: ExtremalProblem, flight: Flight, steps: int, path_m: Floats
) -> tuple[float, float]:
    """Fill positions, m; return the least r' Re r - 1 and the largest thrust ratio."""
    field, extremal = problem.field, flight.extremal
    level2, peak = 1e9, 0.0
    for d in range(find_dips(field.inverse_axes, extremal, steps, flight.dips)):
        level2 = min(level2, flight.dips.places[d, LEVEL] ** 2)
    for k in range(steps + 1):
        y = extremal.state[k]
        square = 0.0
        for i in range(3):
            path_m[k, i] = y[i] * field.scale.length_m
            square += (y[i] * field.inverse_axes[i]) ** 2
        level2 = min(level2, square)
        peak = max(peak, min(thrust_ratio(field.scale.flow, False, y)[0], 1.0))
    return level2 - 1.0, peak


@inlined
def _deliver(
    problem: ExtremalProblem,
    frame: Frame,
    surface: SurfaceIndex,
    costates: Floats,
    target_m: Floats,
    normal: Floats,
    flight: Flight,
    path_m: Floats,
    measure: Callee,
    values: Floats,
    handover: Floats,
) -> None:
    """Fly one facet's extremal at fine steps and measure it; see ``delivery.Deliveries``."""
    scale = problem.field.scale
    start_extremal(problem, costates, flight.extremal)
    steps = call(flight.fly, (problem.field, flight.extremal))
    margin, peak = _measure_descent(problem, flight, steps, path_m)
    end = flight.extremal.state[steps]
    off_ellipsoid = 0.0
    for i in range(3):
        handover[i] = end[i] * scale.length_m
        handover[3 + i] = end[3 + i] * scale.length_m / scale.time_s
        off_ellipsoid += (end[i] * problem.field.inverse_axes[i]) ** 2
    off_ellipsoid = abs(off_ellipsoid - 1.0) if problem.on_ellipsoid else 0.0
    handover[6] = end[6] * frame.mass_kg
    descent = Descent(
        steps,
        end[14] * scale.acceleration_m_s2**2 * scale.time_s,
        peak,
        margin,
        off_ellipsoid,
        problem.compensated,
    )
    field = problem.field
    call(
        measure,
        (frame, surface, field.kind, field.params, descent, handover, target_m, normal, path_m, values),
    )


def deliver_extremals(
    problem: ExtremalProblem,
    frame: Frame,
    surface: SurfaceIndex,
    costates: Floats,
    targets_m: Floats,
    normals: Floats,
    out: Deliveries,
) -> None:
    """Deliver a batch of facets.

    Parameters
    ----------
    problem : ExtremalProblem
        The case.
    frame : Frame
        Its physical facts.
    surface : SurfaceIndex
        The asteroid's surface.
    costates : (n, 7) float, scaled
        Initial costates.
    targets_m : (n, 3) float, m, body frame
        Touchdown points.
    normals : (n, 3) float
        Outward unit normals.
    out : Deliveries
        Filled.
    """
    flight = new_flight(problem.field, DELIVERY_STEPS)
    path_m = np.empty((DELIVERY_STEPS + MAX_SPLITS + 1 + ARC_SAMPLES, 3))
    measure = measure_of(frame, surface, problem.field.kind, problem.field.params)
    fill_deliveries(problem, frame, surface, costates, targets_m, normals, flight, path_m, measure, out)


@kernel
def fill_deliveries(
    problem: ExtremalProblem,
    frame: Frame,
    surface: SurfaceIndex,
    costates: Floats,
    targets_m: Floats,
    normals: Floats,
    flight: Flight,
    path_m: Floats,
    measure: Callee,
    out: Deliveries,
) -> None:
    """Deliver a batch of facets, with room for a flight and its path; see :func:`deliver_extremals`."""
    for i in range(costates.shape[0]):
        _deliver(
            problem,
            frame,
            surface,
            costates[i],
            targets_m[i],
            normals[i],
            flight,
            path_m,
            measure,
            out.values[i],
            out.handover[i],
        )
