"""The descent's own problem, frozen at a point, solved by the interior-point kernel and by Clarabel."""

from __future__ import annotations

import numpy as np
import pytest
from conic_oracles import ByClarabel, Sizes, iterate
from kernel_calls import from_python
from landing_samples import landing_case

from landing_cli.body.mesh import facet_centroids, facet_normals
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.optimize.conic_records import Model, Point
from landing_cli.reach.descent_model import Layout, layout as layout_part, refresh
from landing_cli.reach.free_solve import Solver, basis_of, cold_start, fill_constants, new_solver_of
from landing_cli.reach.records import LandingCase
from landing_cli.reach.scaled_case import ScaledCase, ellipsoid_normal as ellipsoid_normal_part, scale_case
from landing_cli.reach.shooting import fly as fly_part

ellipsoid_normal = from_python(ellipsoid_normal_part)
fly = from_python(fly_part)
layout = from_python(layout_part)

INTERVALS = 12
WALL_AHEAD = 0.01


def solver_of(scaled: ScaledCase, plan: Layout, target: np.ndarray, normal: np.ndarray) -> Solver:
    """A solver with room for exactly this problem, not yet with its planes."""
    solver = new_solver_of(INTERVALS, plan.n_cones, plan.n_rows, INTERVALS + 1, basis_of(scaled))
    solver.target[:], solver.normal[:], solver.model.row_live[:] = target, normal, 1.0
    fly(scaled, solver.point.thrust, solver.path)
    solver.drift[:3], solver.drift[3:] = solver.path.position[-1], solver.path.velocity[-1]
    fill_constants(scaled, solver)
    return solver


def frozen(
    case: LandingCase,
    tau_free: bool,
    cut_nodes: tuple[int, ...] = (),
    level: float = 1.0,
    walls: tuple[tuple[int, float], ...] = (),
) -> tuple[Point, Model, Sizes]:
    """The problem of a facet half-way round, linearised at the cold start."""
    mesh = case.asteroid.mesh
    scaled = scale_case(case, INTERVALS)
    centroids, normals = facet_centroids(mesh), facet_normals(mesh)
    facet = int(np.argmin(np.abs(normals @ case.position_m / np.linalg.norm(case.position_m) + 0.3)))
    plan = layout(scaled, len(cut_nodes) + len(walls), 1e-3 if tau_free else 1.0, tau_free)
    target = centroids[facet] / scaled.length_m
    solver = solver_of(scaled, plan, target, normals[facet])
    if cut_nodes:
        # planes under a straight way to the handover, so that some of them are in the way
        cold_start(scaled, plan, True, solver)
        fly(scaled, solver.point.thrust, solver.path)
        for c, k in enumerate(cut_nodes):
            x = solver.path.position[k]
            solver.cuts.node[c], solver.cuts.offset[c], solver.cuts.tangent[c] = k, level, 1.0
            solver.cuts.normal[c] = ellipsoid_normal(scaled, scaled.node_cos[k], scaled.node_sin[k], *x)
    cold_start(scaled, plan, True, solver)
    fly(scaled, solver.point.thrust, solver.path)
    for c, (node, fraction) in enumerate(walls, len(cut_nodes)):
        # a little to one side of where it would fly
        x = solver.path.position[node] if node else target
        aside = np.cross(normals[facet], x)
        aside /= np.linalg.norm(aside)
        solver.cuts.node[c], solver.cuts.fraction[c] = node, fraction
        solver.cuts.normal[c], solver.cuts.offset[c] = aside, aside @ x + WALL_AHEAD
    refresh(scaled, target, plan, solver.cuts, False, solver.point, solver.path, solver.model)
    return (
        solver.point,
        solver.model,
        Sizes(INTERVALS, plan.n_cones, plan.n_equal, plan.n_rows, tau_free),
    )


PROBLEMS = {
    "free": {},
    "cuts": {"cut_nodes": (4, 5, 6, 7, 8, 9, 10), "level": 1.8},
    "paper's thrust": {"case": {"final_stage_thrust": "paper"}},
    "on the ellipsoid": {"case": {"handover": "on_ellipsoid"}},
    "walls": {"walls": ((8, 0.0), (0, 1.0), (0, 0.7))},
    "cuts and walls": {"cut_nodes": (6, 7, 8), "level": 1.8, "walls": ((0, 0.9), (10, 0.0))},
    "propellant": {"case": {"spacecraft": Spacecraft(2000.0, 20.0, 400.0, 1.9)}},
}


@pytest.mark.parametrize("tau_free", [False, True], ids=["energy", "margin"])
@pytest.mark.parametrize("name", PROBLEMS)
def test_the_frozen_descent_is_solved_as_clarabel_solves_it(name: str, tau_free: bool) -> None:
    given = dict(PROBLEMS[name])
    point, model, sizes = frozen(landing_case(tof_s=850.0, **given.pop("case", {})), tau_free, **given)
    truth = ByClarabel(point, model, sizes)
    objective, iterations = iterate(point, model, sizes)
    assert iterations < 20
    assert objective == pytest.approx(truth.objective, abs=1e-7)
    for field in ("thrust", "y", "multiplier"):
        found, expected = getattr(point, field), getattr(truth, field)
        atol = 2e-4 * (1.0 + np.abs(expected).max())
        np.testing.assert_allclose(found, expected, rtol=0, atol=atol, err_msg=field)
    inequalities = point.multiplier[sizes.equal :]
    if inequalities.size:  # the constraint that the problem is named for is at work in it
        assert inequalities.min() < -1e-3
