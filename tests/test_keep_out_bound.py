"""The bound on flights on all sides of the ellipsoid: its form, what it supposes, and that it holds."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import asteroid, landing_case
from truth.tables import landing_case as true_case, read_table

from landing_cli.body.gravity.field_values import accelerations
from landing_cli.optimize.conic_records import new_model
from landing_cli.reach import keep_out_ascent, keep_out_bound
from landing_cli.reach.descent_model import fill_glide_cones as fill_glide_cones_part
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.keep_out_ascent import climb, first_weights
from landing_cli.reach.keep_out_bound import (
    HIGHEST,
    INTERVALS,
    LEVEL,
    NODES,
    PER_NODE,
    Descent,
    Facets,
    Weights,
    descent_of,
    facets_of,
    least_value,
    thrust_level,
)
from landing_cli.reach.keep_out_derivatives import derivatives
from landing_cli.reach.margin import least_thrust_flights, thrust_levels
from landing_cli.reach.proofs import bounds_outside
from landing_cli.reach.records import FacetSolutions, Verdict
from landing_cli.reach.shooting import fly_accurately as fly_accurately_part

fill_glide_cones = from_python(fill_glide_cones_part)
fly_accurately = from_python(fly_accurately_part)

CASES: dict[str, dict[str, Any]] = {
    "outside": {"position_m": np.array([300.0, 100.0, 650.0]), "tof_s": 780.0},
    "on the ellipsoid": {
        "position_m": np.array([300.0, 100.0, 650.0]),
        "tof_s": 780.0,
        "handover": "on_ellipsoid",
    },
    "as in the paper": {
        "position_m": np.array([300.0, 100.0, 650.0]),
        "tof_s": 780.0,
        "final_stage_thrust": "paper",
    },
}


@lru_cache
def solved(name: str) -> tuple[PreparedCase, FacetSolutions]:
    case = landing_case(asteroid(gravity=4.0, spin=2.0), **CASES[name])
    p = prepare(case, survey(case))
    return p, solve_prepared(p, np.arange(len(p.shared.normals)))


def problem(p: PreparedCase, facets: np.ndarray) -> tuple[Descent, Facets]:
    descent = descent_of(p.case, p.shared.bounds)
    targets = p.shared.centroids_m[facets] / descent.case.length_m
    return descent, facets_of(descent, targets, p.shared.normals[facets])


def of_verdict(name: str, verdict: Verdict, every: int = 1) -> np.ndarray:
    rows = solved(name)[1].rows
    return np.asarray(rows["facet"][rows["verdict"] == verdict][::every], dtype=np.int64)


def some_weights(descent: Descent, kept: Facets, seed: int, spread: float = 1.0) -> Weights:
    rng, first = np.random.default_rng(seed), first_weights(descent, kept)
    thrust, ellipsoid, arc = (x * 10.0 ** rng.uniform(-spread, 0.0, x.shape) for x in first[:3])
    slope = rng.normal(size=first.slope.shape)
    slope[:, :, 0] = np.linalg.norm(slope[:, :, 1:], axis=2) + rng.exponential(size=slope.shape[:2])
    return Weights(thrust, ellipsoid, arc, 0.02 * slope * 10.0 ** rng.uniform(-2.0, 1.0))


class Lagrangian:
    """L of the first facet on a path, by its definition: nothing of it is eliminated."""

    fine = 100  # samples an interval of the path

    def __init__(self, descent: Descent, kept: Facets, weights: Weights) -> None:
        self.descent, self.kept, self.weights = descent, kept, weights
        self.t = (np.arange(INTERVALS * self.fine) + 0.5) / (INTERVALS * self.fine)

    def __call__(self, acceleration: np.ndarray) -> float:
        """Of accelerations (INTERVALS fine, 3), each constant for its short while."""
        d, w, h = self.descent, Weights(*(x[0] for x in self.weights)), 1.0 / len(self.t)
        v = d.case.velocity + np.concatenate([np.zeros((1, 3)), acceleration.cumsum(axis=0)]) * h
        r = d.case.position + np.concatenate(
            [np.zeros((1, 3)), (h * v[:-1] + 0.5 * h * h * acceleration).cumsum(axis=0)]
        )
        at = slice(PER_NODE * self.fine, None, PER_NODE * self.fine)
        total = h * (np.repeat(w.thrust, self.fine) * (acceleration**2).sum(axis=1)).sum()
        total -= (w.thrust * self.kept.accelerations[0] ** 2).sum() / INTERVALS
        for k, x in enumerate(r[at]):
            node = (k + 1) * PER_NODE
            c, s = d.case.node_cos[node], d.case.node_sin[node]
            body = np.array([c * x[0] + s * x[1], c * x[1] - s * x[0], x[2]])
            depth = ((body * d.case.inverse_axes) ** 2).sum()
            total -= w.ellipsoid[k] * (depth - LEVEL**2)
            if k == NODES - 1:
                total += w.ellipsoid[NODES:].sum() * (depth - HIGHEST**2)
        state = np.concatenate([r[-1], v[-1]])
        for j in range(2):
            thrust = d.arc_maps[j] @ state + self.kept.arc_offsets[0, j]
            total += w.arc[j] * (thrust @ thrust - self.kept.arc_limits[0, j] ** 2)
            total -= w.slope[j] @ (self.kept.slopes[0, j] @ state + self.kept.slope_offsets[0, j])
        return float(total)

    def best(self, outputs: np.ndarray, inverse_gramian: np.ndarray) -> np.ndarray:
        """Accelerations of the path that is said to attain the least value."""
        nodes = np.arange(1, NODES + 1) / NODES
        kernels = np.concatenate(
            [np.maximum(nodes - self.t[:, None], 0.0), np.ones((len(self.t), 1))], axis=1
        )
        pull = inverse_gramian @ (outputs - self.kept.centre[0])
        return np.asarray(kernels @ pull / np.repeat(self.weights.thrust[0], self.fine)[:, None])


@pytest.mark.parametrize("name", ["outside", "on the ellipsoid"])
def test_the_least_value_is_that_over_all_paths(name: str) -> None:
    p, _ = solved(name)
    descent, kept = problem(p, np.array([40]))
    rng = np.random.default_rng(0)
    for seed in range(4):
        weights = some_weights(descent, kept, seed)
        least = least_value(descent, kept, weights)
        L = Lagrangian(descent, kept, weights)
        path = L.best(least.outputs[0], least.inverse_gramian[0])
        assert L(path) == pytest.approx(least.value[0], rel=1e-5)
        for _ in range(30):
            bump = rng.normal(size=(1, 3)) * np.cos(rng.uniform(0, 9) * L.t + rng.uniform(0, 6))[:, None]
            assert L(path + 10.0 ** rng.uniform(-1.0, 1.0) * bump) > least.value[0]


def test_a_form_that_is_not_definite_bounds_nothing() -> None:
    p, _ = solved("outside")
    descent, kept = problem(p, np.array([40, 41, 42]))
    weights = first_weights(descent, kept)
    weights.ellipsoid[1] *= 1e6
    value = least_value(descent, kept, weights).value
    assert np.isfinite(value[[0, 2]]).all()
    assert value[1] == -np.inf


def _flights(name: str) -> tuple[PreparedCase, np.ndarray, np.ndarray]:
    """Facets near the boundary, and the accurate flights of least thrust level to them, 100 intervals."""
    p, _ = solved(name)
    facets = of_verdict(name, Verdict.REACHABLE, 6)
    at = p.shared.centroids_m[facets], p.shared.normals[facets]
    flights = least_thrust_flights(p, p.fine, p.fine_tube, *at)
    kept = (flights.level < 1.0) & (flights.status == 1)
    samples = np.zeros((kept.sum(), 2001, 7))
    for out, thrust in zip(samples, flights.thrust[kept], strict=True):
        fly_accurately(p.fine._replace(propellant=2.0), thrust, out)
    return p, facets[kept], samples


@pytest.mark.parametrize("name", CASES)
def test_flights_keep_what_is_supposed_of_them(name: str) -> None:
    """Accelerations, ellipsoid, thrust at both ends of the arc, glide slope: each from its own definition."""
    p, facets, samples = _flights(name)
    descent, kept = problem(p, facets)
    case, spin, tight = descent.case, descent.case.spin, 0.0
    assert len(facets) > 20
    for f, facet in enumerate(facets):
        states = samples[f]
        a = np.diff(states[:, 3:6], axis=0) * (len(states) - 1)
        bound = np.repeat(kept.accelerations[f], (len(states) - 1) // INTERVALS)
        assert (np.linalg.norm(a, axis=1) <= bound * (1 + 1e-9)).all()
        tight = max(tight, (np.linalg.norm(a, axis=1) / bound).max())
        r = states[:: (len(states) - 1) // NODES, :3][1:]
        level = np.einsum("ia,iab,ib->i", r, descent.keep_out[:NODES], r)
        assert (level >= LEVEL**2).all()
        if p.case.handover == "on_ellipsoid":
            assert level[-1] <= HIGHEST**2
        state = states[-1, :6]
        thrusts = descent.arc_maps @ state + kept.arc_offsets[f]
        # a* is linear, and the arc ends at rest on the landing point
        target, T = p.shared.centroids_m[facet] / case.length_m, case.final_time
        W = np.array([0.0, 0.0, spin])
        d, v = state[:3] - target, state[3:] - np.cross(W, state[:3])
        touch, hand = np.linalg.solve([[T * T / 3, T * T / 6], [-T / 2, -T / 2]], [d, v])
        wanted = np.array([touch, hand])
        if case.compensated:
            points = np.array([target, state[:3]])
            g = accelerations(p.case.asteroid.gravity, points * case.length_m) / case.acceleration_m_s2
            wanted = wanted + 2 * np.cross(W, [0 * v, v]) + np.cross(W, np.cross(W, points))
            wanted[0] -= g[0]
            real = wanted - [0 * g[0], g[1]]
        else:
            real = wanted
        np.testing.assert_allclose(thrusts, wanted, rtol=0, atol=1e-9)
        assert (np.linalg.norm(real, axis=1) <= 1.0 / descent.ends_mass * (1 + 1e-4)).all()
        assert (np.linalg.norm(thrusts, axis=1) <= kept.arc_limits[f] * (1 + 1e-4)).all()
        slope = kept.slopes[f] @ state + kept.slope_offsets[f]
        normal = p.shared.normals[facet]
        for row, way in zip(slope, (2 * touch + hand, touch), strict=True):
            assert row[0] == pytest.approx(case.tan_half_angle * (way @ normal), abs=1e-9)
            across = np.linalg.norm(way - (way @ normal) * normal)
            assert np.linalg.norm(row[1:]) == pytest.approx(across, abs=1e-9)
    assert tight > 0.8


def test_slope_cones_are_those_of_the_solver() -> None:
    """The kernels' rows are ours, turned about the normal."""
    p, _ = solved("outside")
    normals = p.shared.normals[::7]
    rows = keep_out_bound._slope_cones(p.coarse, normals)
    arcs = len(p.coarse.arc_fractions)
    for mine, normal in zip(rows, normals, strict=True):
        model = new_model(4, arcs + 2, 7)
        fill_glide_cones(p.coarse, normal, model)
        theirs = model.cone_map[arcs:, :3, 1:7]
        np.testing.assert_allclose(mine[:, 0], theirs[:, 0], rtol=0, atol=1e-14)
        ours, solvers = (np.einsum("cra,crb->cab", x[:, 1:], x[:, 1:]) for x in (mine, theirs))
        np.testing.assert_allclose(ours, solvers, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", CASES)
def test_no_weights_prove_more_than_the_least_thrust_level(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Random ones, and the best that a climb finds when it does not stop at a proof."""
    p, _ = solved(name)
    facets = of_verdict(name, Verdict.REACHABLE, 3)
    levels = thrust_levels(p, facets).level
    descent, kept = problem(p, facets)
    for seed in range(20):
        weights = some_weights(descent, kept, seed, 3.0)
        value = least_value(descent, kept, weights).value
        value = np.where(np.isfinite(value), value, -1e300)
        assert (thrust_level(descent, kept, weights, value) <= levels).all()
    monkeypatch.setattr(keep_out_ascent, "GAP", np.inf)  # no climb is given up
    climbed = climb(descent, kept, first_weights(descent, kept))
    bound = thrust_level(descent, kept, climbed.weights, climbed.value)
    assert (climbed.value < 0.0).all()
    assert (bound <= levels).all()
    assert np.median(bound / levels) > 0.8  # and it is no empty promise


def test_planes_above_the_ellipsoid_would_be_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The test above has teeth."""
    p, _ = solved("outside")
    facets = of_verdict("outside", Verdict.REACHABLE)
    assert np.isnan(bounds_outside(p, facets)[0]).all()
    monkeypatch.setattr(keep_out_bound, "LEVEL", 1.5)
    assert (bounds_outside(p, facets)[0] > 1.0).sum() >= 3


def test_most_unreachable_facets_are_proved() -> None:
    p, solutions = solved("outside")
    rows = solutions.rows
    stopped = rows[(rows["verdict"] == Verdict.UNREACHABLE) & (rows["violation"] > 0.03)]
    bounds, steps = bounds_outside(p, stopped["facet"].astype(np.int64))
    assert len(bounds) >= 20
    assert (bounds > 1.0).mean() > 0.8
    assert (bounds[bounds > 1.0] < 1.0 + stopped["violation"][bounds > 1.0]).mean() > 0.9
    assert steps.max() <= keep_out_ascent.MOST_STEPS


@pytest.mark.parametrize("name", ["outside", "on the ellipsoid"])
def test_a_climb_has_the_derivatives_of_what_it_climbs(name: str) -> None:
    p, _ = solved(name)
    descent, kept = problem(p, np.array([3, 50, 200]))
    weights = some_weights(descent, kept, 1, 0.3)
    weights.slope[:, :, 0] += 0.1
    barrier = np.array([0.1, 0.03, 0.01])

    def climbed(step: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        moved = keep_out_ascent._moved(weights, step, np.ones(3))
        least = least_value(descent, kept, moved)
        slope = derivatives(descent, kept, moved, least, barrier)[0]
        return least.value + barrier * least.volume, slope

    least = least_value(descent, kept, weights)
    gradient, hessian, _ = derivatives(descent, kept, weights, least, barrier)
    relative = gradient.shape[1] - 6
    for i in range(gradient.shape[1]):
        step = np.zeros_like(gradient)
        step[:, i] = 1e-5 if i < relative else 1e-6
        (up, high), (down, low) = climbed(step), climbed(-step)
        if i < relative:  # derivatives there are relative to the weights there
            high[:, i] /= 1.0 + step[:, i]
            low[:, i] /= 1.0 - step[:, i]
        width = 2.0 * step[:, i]
        scale = np.abs(gradient).max()
        np.testing.assert_allclose((up - down) / width, gradient[:, i], rtol=0, atol=1e-6 * scale)
        scale = np.abs(hessian).max()
        np.testing.assert_allclose((high - low) / width[:, None], hessian[:, i], rtol=0, atol=1e-6 * scale)


def test_a_facet_is_bounded_alone_as_in_company() -> None:
    p, solutions = solved("outside")
    facets = solutions.rows["facet"][::17].astype(np.int64)
    together = bounds_outside(p, facets)
    alone = [bounds_outside(p, facets[k : k + 1]) for k in range(len(facets))]
    for whole, parts in zip(together, zip(*alone, strict=True), strict=True):
        np.testing.assert_array_equal(whole, np.concatenate(parts))


@pytest.mark.parametrize(
    "table", ["bennu_700s", "bennu_800s", "bennu_900s", "bennu_on_ellipsoid", "bacchus", "eros"]
)
def test_no_proof_contradicts_direct_collocation(table: str) -> None:
    for truth in read_table(table):
        case, facets = true_case(truth)
        p = prepare(case, survey(case))
        bounds, _ = bounds_outside(p, facets)
        proved = bounds > 1.0
        assert (truth.tau[proved] > 1.0).all()
        assert (bounds[proved] < truth.tau[proved]).all()
