from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import asteroid, landing_case

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.flight.spacecraft import Spacecraft
from landing_cli.optimize.conic_records import Model, new_model
from landing_cli.reach.certificate import (
    certified_thrust_level as certified_thrust_level_part,
    gravity_bounds,
    gravity_tube,
)
from landing_cli.reach.descent_model import (
    fill_arc_cones as fill_arc_cones_part,
    fill_glide_cones as fill_glide_cones_part,
    fill_handover_rows as fill_handover_rows_part,
)
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.free_flights import Question, best_flights
from landing_cli.reach.free_solve import CONVERGED
from landing_cli.reach.planes import new_cuts
from landing_cli.reach.records import Verdict
from landing_cli.reach.scaled_case import scale_case
from landing_cli.reach.shooting import fly_accurately as fly_accurately_part

certified_thrust_level = from_python(certified_thrust_level_part)
fill_arc_cones = from_python(fill_arc_cones_part)
fill_glide_cones = from_python(fill_glide_cones_part)
fill_handover_rows = from_python(fill_handover_rows_part)
fly_accurately = from_python(fly_accurately_part)


@lru_cache
def prepared(**changes: Any) -> PreparedCase:
    case = landing_case(asteroid(gravity=2.0, spin=2.0), **changes)
    return prepare(case, survey(case))


@lru_cache
def least_levels() -> tuple[np.ndarray, np.ndarray]:
    """Facets around the boundary that the ellipsoid leaves alone, and their thrust levels on a fine grid."""
    p = prepared()
    rows = solve_prepared(p, np.arange(len(p.shared.normals))).rows
    height = p.shared.normals @ p.case.position_m / np.linalg.norm(p.case.position_m)
    facets = np.flatnonzero((height > -0.75) & (height < 0.2))[::3]
    question = Question(
        p.fine,
        p.shared.centroids_m[facets] / p.fine.length_m,
        p.shared.normals[facets],
        True,
        p.fine_tube,
        p.shared.bounds.on_arcs_m_s2 / p.fine.acceleration_m_s2,
    )
    flights, around = best_flights(question)
    kept = (flights.status == CONVERGED) & ~around & (np.abs(flights.level - 1.0) < 0.4)
    assert rows["verdict"].min() > 0
    return facets[kept], flights.level[kept]


class Bound:
    """The certified bound of one facet as a function of its multipliers."""

    def __init__(self, p: PreparedCase, facet: int, **changes: Any) -> None:
        self.scaled = p.fine._replace(**changes)
        self.tube, self.arc = p.fine_tube, p.shared.bounds.on_arcs_m_s2 / p.fine.acceleration_m_s2
        self.target = p.shared.centroids_m[facet] / self.scaled.length_m
        self.cones = len(self.scaled.arc_fractions) + 2
        self.model: Model = new_model(len(self.scaled.mid_cos), self.cones, 6)
        fill_handover_rows(self.scaled, self.model)
        fill_arc_cones(self.scaled, self.model)
        fill_glide_cones(self.scaled, p.shared.normals[facet], self.model)

    def __call__(self, x: np.ndarray, tube: float = 1.0, arc: float = 1.0) -> float:
        """Of six multipliers and the cones' duals, flat, with the gravity bounds multiplied."""
        duals = np.zeros((self.cones, 4))
        return certified_thrust_level(
            self.scaled,
            self.target,
            tube * self.tube,
            arc * self.arc,
            self.model,
            x[:6].copy(),
            x[6:].reshape(-1, 4).copy(),
            duals,
            new_cuts(1),
            0,
            1.0,
        )

    @property
    def size(self) -> int:
        return 6 + 4 * self.cones

    def climbed(self, seed: int, steps: int = 500) -> tuple[np.ndarray, float]:
        """Multipliers with as large a bound as a random search finds, and that bound."""
        rng = np.random.default_rng(seed)
        x = 0.3 * rng.normal(size=self.size)
        miss = self.target - self.scaled.position - self.scaled.velocity
        x[:3] = -miss / np.linalg.norm(miss)
        best, width = self(x), 0.3
        for _ in range(steps):
            y = x + width * rng.normal(size=x.size) * (rng.random(x.size) < 0.4)
            value = self(y)
            if value > best:
                x, best, width = y, value, 1.3 * width
            else:
                width = max(0.96 * width, 1e-3)
        return x, best


def test_no_multipliers_prove_more_than_the_least_thrust_level() -> None:
    """A search for the largest bound does not get past tau where tau is at most 1."""
    facets, levels = least_levels()
    reachable = np.flatnonzero(levels < 1.0)
    tried = reachable[np.argsort(-levels[reachable])][:8]
    assert len(tried) == 8
    for k in tried:
        bound = Bound(prepared(), facets[k])
        _, best = bound.climbed(seed=int(k))
        # the fine grid's own level lies a few 1e-4 above the continuous one
        assert best <= levels[k]
        assert best > 0.6 * levels[k]


def test_random_multipliers_prove_no_reachable_facet_unreachable() -> None:
    facets, levels = least_levels()
    rng = np.random.default_rng(0)
    for k in np.flatnonzero(levels < 1.0)[:12]:
        bound = Bound(prepared(), facets[k])
        for _ in range(150):
            x = rng.normal(size=bound.size) * 10.0 ** rng.uniform(-3, 3, bound.size)
            assert bound(x) <= levels[k]


def test_a_bound_does_not_depend_on_the_size_of_its_multipliers() -> None:
    facets, _ = least_levels()
    bound = Bound(prepared(), facets[0])
    x = np.random.default_rng(1).normal(size=bound.size)
    for factor in (1e-6, 1e6):
        assert bound(factor * x) == pytest.approx(bound(x), rel=1e-12)


def test_any_duals_are_made_feasible() -> None:
    """They balance the rows exactly, sum_j A_j' z_j = A_y' lambda, and lie in their cones."""
    facets, _ = least_levels()
    bound = Bound(prepared(), facets[0], spin=1.3)
    fill_handover_rows(bound.scaled, bound.model)
    fill_arc_cones(bound.scaled, bound.model)
    rng = np.random.default_rng(6)
    for _ in range(10):
        x, duals = rng.normal(size=bound.size), np.zeros((bound.cones, 4))
        certified_thrust_level(
            bound.scaled,
            bound.target,
            bound.tube,
            bound.arc,
            bound.model,
            x[:6],
            x[6:].reshape(-1, 4),
            duals,
            new_cuts(1),
            0,
            1.0,
        )
        balance = np.einsum("jia,ji->a", bound.model.cone_map, duals) - bound.model.row_y[:6].T @ x[:6]
        np.testing.assert_allclose(balance[1:], 0.0, rtol=0, atol=1e-12)
        used = duals * np.abs(bound.model.cone_map).max(axis=2).astype(bool)  # a glide cone has three rows
        assert (duals[:, 0] >= np.linalg.norm(used[:, 1:], axis=1) - 1e-12).all()


def test_stronger_gravity_bounds_prove_less() -> None:
    facets, levels = least_levels()
    bound = Bound(prepared(), facets[int(np.argmax(levels))])
    x, value = bound.climbed(seed=3, steps=200)
    assert bound(x, tube=1.5) < value < bound(x, tube=0.5)
    assert bound(x, arc=1.5) <= value <= bound(x, arc=0.5)
    # the bound is the ratio of the work that is left to the thrust's: it falls linearly
    fall = np.diff([bound(x, tube=f) for f in (0.0, 1.0, 2.0)])
    assert fall[0] == pytest.approx(fall[1], rel=1e-9)


def test_a_lighter_spacecraft_at_the_end_proves_less() -> None:
    facets, levels = least_levels()
    facet = facets[int(np.argmax(levels))]
    x, value = Bound(prepared(), facet).climbed(seed=4, steps=200)
    thirsty = Bound(prepared(), facet, mass_flow=0.2)(x)
    assert thirsty < value
    # a bound on the propellant bounds the mass from below, and so gives some of it back
    assert thirsty < Bound(prepared(), facet, mass_flow=0.2, propellant=0.02)(x) < value


def test_facets_beyond_reach_of_the_thrust_are_proved() -> None:
    p = prepared()
    facets, levels = least_levels()
    rows = solve_prepared(p, facets).rows
    beyond = levels > 1.02
    assert beyond.sum() >= 8
    assert (rows["proved"][beyond] == 1).mean() > 0.95
    assert (rows["proved"][levels < 1.0] == 0).all()
    assert (rows["verdict"][levels < 0.9995] == Verdict.REACHABLE).all()


@pytest.mark.parametrize(
    ("position", "velocity"),
    [((500.0, 200.0, 600.0), (0.05, -0.03, 0.02)), ((450.0, -100.0, 100.0), (-0.3, 0.2, 0.1))],
)
def test_no_admissible_flight_meets_more_gravity_than_the_tube(
    position: tuple[float, ...], velocity: tuple[float, ...]
) -> None:
    """Full thrust in random and in inward directions, as long as the flight stays out of the ellipsoid."""
    body = asteroid(gravity=8.0, spin=3.0)
    case = landing_case(
        body,
        position_m=np.array(position),
        velocity_m_s=np.array(velocity),
        spacecraft=Spacecraft(2000.0, 20.0, 60.0),
    )
    n, substeps = 20, 8
    scaled = scale_case(case, n)
    tube = gravity_tube(scaled, gravity_bounds(body, case.ellipsoid_m))
    rng = np.random.default_rng(7)
    closest = np.zeros(n)
    for trial in range(60):
        directions = rng.normal(size=(n, 3)).cumsum(axis=0) if trial % 2 else rng.normal(size=(n, 3))
        inwards = -scaled.position + 0.3 * rng.normal(size=3)
        directions[: rng.integers(0, n + 1)] = inwards
        thrust = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        samples = np.zeros((n * substeps + 1, 7))
        fly_accurately(scaled, thrust, samples)
        angle = -scaled.spin * (np.arange(len(samples)) / (n * substeps) - 1.0)
        c, s = np.cos(angle), np.sin(angle)
        x, y, z = samples[:, :3].T * scaled.length_m
        points = np.stack([c * x - s * y, s * x + c * y, z], axis=1)
        inside = np.linalg.norm(points / case.ellipsoid_m, axis=1) < 1.0
        until = int(np.argmax(inside)) if inside.any() else len(samples)
        met = np.linalg.norm(accelerations(body.gravity, points), axis=1) / scaled.acceleration_m_s2
        for k in range(n):
            here = met[k * substeps : min((k + 1) * substeps + 1, until)]
            assert here.max(initial=0.0) <= tube[k]
            closest[k] = max(closest[k], here.max(initial=0.0) / tube[k])
    assert closest[:3].min() > 0.6  # and the tube is no empty promise
    assert closest.max() > 0.9


def test_bounds_of_gravity_hold_beyond_their_radii() -> None:
    body = asteroid(gravity=3.0)
    case = landing_case(body)
    bounds = gravity_bounds(body, case.ellipsoid_m)
    rng = np.random.default_rng(2)
    directions = rng.normal(size=(4000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = directions * rng.uniform(230.0, 1700.0, (4000, 1))
    points = points[np.linalg.norm(points / case.ellipsoid_m, axis=1) >= 1.0]
    size = np.linalg.norm(accelerations(body.gravity, points), axis=1)
    for radius, bound in zip(bounds.radius_m, bounds.outside_m_s2, strict=True):
        far = np.linalg.norm(points, axis=1) >= radius
        assert size[far].max(initial=0.0) <= bound
        assert size[far].max(initial=0.0) > 0.7 * bound or far.sum() < 300


def test_the_bound_on_arcs_holds_all_over_the_facets() -> None:
    body = asteroid(gravity=3.0)
    bounds = gravity_bounds(body, landing_case(body).ellipsoid_m)
    weights = np.random.default_rng(2).dirichlet(np.ones(3), size=50)
    points = np.einsum("wi,fic->wfc", weights, body.mesh.corners).reshape(-1, 3)
    assert np.linalg.norm(accelerations(body.gravity, points), axis=1).max() <= bounds.on_arcs_m_s2
