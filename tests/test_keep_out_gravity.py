"""Gravity where flights must be: the balls hold every flight, the bounds all that gravity does in them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
from kernel_calls import from_python
from landing_samples import SPIN_RAD_S, asteroid, landing_case, rock
from truth.tables import landing_case as true_case, read_table

from landing_cli.body.asteroid import Asteroid
from landing_cli.body.gravity.dipole import dipole_field
from landing_cli.body.gravity.field import GravityField
from landing_cli.body.gravity.field_values import accelerations
from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.body.gravity.point_mass import point_mass_field
from landing_cli.reach import keep_out_ascent, keep_out_gravity, proofs
from landing_cli.reach.free_descent import PreparedCase, prepare, solve_prepared, survey
from landing_cli.reach.keep_out_ascent import climb, first_weights
from landing_cli.reach.keep_out_bound import (
    INTERVALS,
    NODES,
    Descent,
    Facets,
    Least,
    descent_of,
    facets_of,
    least_value,
)
from landing_cli.reach.keep_out_gravity import BALLS, with_known_gravity
from landing_cli.reach.margin import least_thrust_flights
from landing_cli.reach.records import Verdict
from landing_cli.reach.scaled_case import gravity_in_space as gravity_in_space_part
from landing_cli.reach.shooting import fly_accurately as fly_accurately_part

fly_accurately = from_python(fly_accurately_part)
gravity_in_space = from_python(gravity_in_space_part)

ROCKS = {"rock": {"tof_s": 720.0}, "short stage": {"tof_s": 700.0, "final_stage_s": 90.0}}
BODIES = (*ROCKS, "eros")
STEPS = INTERVALS * BALLS * 25


@lru_cache
def flown(name: str) -> tuple[PreparedCase, np.ndarray, np.ndarray]:
    """Reachable facets, and flights of least thrust level and of least energy there (2, n, STEPS + 1, 7)."""
    if name == "eros":
        case, _ = true_case(read_table("eros")[0])
    else:
        case = landing_case(
            asteroid(gravity=10.0, spin=4.0), position_m=np.array([300.0, 100.0, 650.0]), **ROCKS[name]
        )
    p = prepare(case, survey(case))
    solutions = solve_prepared(p, np.arange(len(p.shared.normals)))
    rows, offsets = solutions.rows, solutions.node_offsets
    found = np.flatnonzero((rows["verdict"] == Verdict.REACHABLE) & (rows["thrust_nodes"] == 40))
    found = found[:: max(1, len(found) // 40)]
    energy = np.stack([solutions.thrust_nodes_n[offsets[f] : offsets[f + 1]] for f in found])
    facets = rows["facet"][found].astype(np.int64)
    at = p.shared.centroids_m[facets], p.shared.normals[facets]
    least = least_thrust_flights(p, p.coarse, p.coarse_tube, *at)
    thrust = np.stack([least.thrust, energy / p.frame.thrust_max_n])
    kept = (least.status == 1) & (least.level < 0.999)
    samples = np.zeros((2, kept.sum(), STEPS + 1, 7))
    for kind in range(2):
        for out, nodes in zip(samples[kind], thrust[kind][kept], strict=True):
            fly_accurately(p.coarse._replace(propellant=2.0), nodes, out)
    return p, facets[kept], samples


@lru_cache
def climbed(name: str) -> tuple[Descent, Facets, Least]:
    p, facets, _ = flown(name)
    descent = descent_of(p.case, p.shared.bounds)
    targets = p.shared.centroids_m[facets] / descent.case.length_m
    kept = facets_of(descent, targets, p.shared.normals[facets])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(keep_out_ascent, "GAP", np.inf)  # no climb is given up
        weights = climb(descent, kept, first_weights(descent, kept)).weights
    return descent, kept, least_value(descent, kept, weights)


@pytest.mark.parametrize("name", BODIES)
def test_every_flight_is_where_it_must_be(name: str) -> None:
    _, facets, samples = flown(name)
    descent, _, least = climbed(name)
    along, handover = keep_out_gravity._balls(descent, least)
    width = STEPS // (INTERVALS * BALLS)
    centre = along.centre.reshape(len(facets), -1, 1, 3)
    radius = along.radius.reshape(len(facets), -1, 1)
    place = np.arange(INTERVALS * BALLS)[:, None] * width + np.arange(width + 1)
    for flights in samples:
        assert (np.linalg.norm(flights[:, place, :3] - centre, axis=3) <= radius).all()
        last = np.linalg.norm(flights[:, -1, :3] - handover.centre, axis=1)
        assert (last <= handover.radius).all()
    middle = np.arange(INTERVALS * BALLS).reshape(INTERVALS, BALLS) + 0.5
    np.testing.assert_allclose(along.time[0], middle / (INTERVALS * BALLS), rtol=1e-12)


@pytest.mark.parametrize("name", BODIES)
def test_a_flight_raises_the_lagrangian_by_no_more_than_is_missing(name: str) -> None:
    """Which is what puts it into the balls; some flight takes a good part of it."""
    _, facets, samples = flown(name)
    _, _, least = climbed(name)
    taken = 0.0
    for flights in samples:
        nodes = flights[:, STEPS // NODES :: STEPS // NODES, :3].reshape(len(facets), -1)
        outputs = np.concatenate([nodes, flights[:, -1, 3:6]], axis=1)
        e = outputs - least.outputs.reshape(len(facets), -1)
        raised = np.einsum("ni,nij,nj->n", e, least.form, e)
        assert (raised <= -least.value).all()
        taken = max(taken, float((raised / -least.value).max()))
    assert taken > 0.15


@pytest.mark.parametrize("name", BODIES)
def test_balls_at_nodes_are_as_small_as_the_lagrangian_allows(name: str) -> None:
    descent, _, least = climbed(name)
    along, handover = keep_out_gravity._balls(descent, least)
    for f in range(0, len(least.value), 4):
        inverse = np.linalg.inv(least.form[f])
        block = inverse[3 * NODES - 3 : 3 * NODES, 3 * NODES - 3 : 3 * NODES]
        widest = np.linalg.eigh(block)[1][:, 2]
        farthest = inverse[:, 3 * NODES - 3 : 3 * NODES] @ widest
        farthest *= np.sqrt(-least.value[f] / (farthest @ least.form[f] @ farthest))
        away = np.linalg.norm(farthest[3 * NODES - 3 : 3 * NODES])
        assert away == pytest.approx(handover.radius[f], rel=1e-6)
        assert handover.radius[f] <= along.radius[f, -1, -1]


@pytest.mark.parametrize("name", BODIES)
def test_flights_meet_no_more_gravity_than_is_known(name: str) -> None:
    """Along the way and at the handover, in the turning body's own field."""
    p, facets, samples = flown(name)
    descent, kept, least = climbed(name)
    known = with_known_gravity(descent, p.shared.surface, kept, least)
    tighter = known.accelerations < kept.accelerations
    assert tighter.mean() > 0.2
    assert (known.accelerations <= kept.accelerations).all()
    slack = kept.arc_limits - known.arc_limits
    assert (slack[:, 0] == 0.0).all()
    width, case = STEPS // INTERVALS, descent.case
    time = np.arange(STEPS + 1) / STEPS
    c, s = np.cos(case.spin * (time - 1.0)), np.sin(case.spin * (time - 1.0))
    room = known.accelerations - 1.0 / descent.least_mass
    closest = 0.0
    for flights in samples:
        for f in range(len(facets)):
            x, y, z = flights[f, :, :3].T * case.length_m
            body = np.stack([c * x + s * y, c * y - s * x, z], axis=1)
            g = accelerations(p.case.asteroid.gravity, body) / case.acceleration_m_s2
            g = np.stack([c * g[:, 0] - s * g[:, 1], s * g[:, 0] + c * g[:, 1], g[:, 2]], axis=1)
            for k in np.flatnonzero(tighter[f]):
                here = g[k * width : (k + 1) * width + 1] - known.reference[f, k]
                share = np.linalg.norm(here, axis=1).max() / room[f, k]
                assert share <= 1.0
                closest = max(closest, share)
            if slack[f, 1] > 0.0:
                off = np.linalg.norm(g[-1] - known.handover_gravity[f])
                assert off <= known.arc_limits[f, 1] - 1.0 / descent.ends_mass[1]
            # what the arc's end is supposed to fly at is its thrust, but for that
            change = known.arc_offsets[f, 1] - kept.arc_offsets[f, 1]
            np.testing.assert_allclose(change, -known.handover_gravity[f], rtol=0, atol=1e-15)
    assert closest > 0.05
    np.testing.assert_allclose(
        known.centre - kept.centre, np.einsum("ki,nka->nia", descent.kernels, known.reference), atol=1e-14
    )


def test_thrust_at_the_handover_counts_the_gravity_that_is_known() -> None:
    """From wide balls, then from narrow ones; balls that bound it no better change nothing."""
    p, facets, _ = flown("rock")
    descent, kept, _ = climbed("rock")
    case, n, rng = descent.case, len(facets), np.random.default_rng(5)
    centre = np.array([[0.0, 100.0, 500.0]]) / case.length_m + np.zeros((n, 1))
    for radius_m in (120.0, 20.0, 60.0):
        radius = np.full(n, radius_m / case.length_m)
        radius[::2] = 400.0 / case.length_m  # these reach into the body
        balls = keep_out_gravity.Balls(centre, radius, np.ones(n), 0.0)
        known = keep_out_gravity._with_known_handover(descent, p.shared.surface, kept, balls)
        better = known.arc_limits[:, 1] < kept.arc_limits[:, 1]
        assert better[1::2].all() == (radius_m != 60.0)
        assert not better[::2].any()
        u = rng.normal(size=(500, 3))
        u *= 20.0 * rng.random((500, 1)) / np.linalg.norm(u, axis=1, keepdims=True)
        g = accelerations(p.case.asteroid.gravity, centre[0] * case.length_m + u) / case.acceleration_m_s2
        off = np.linalg.norm(g[:, None] - known.handover_gravity, axis=2).max(axis=0)
        assert (off <= known.arc_limits[:, 1] - 1.0 / descent.ends_mass[1]).all()
        kept = known
    start = climbed("rock")[1]
    np.testing.assert_allclose(
        kept.arc_offsets[:, 1], start.arc_offsets[:, 1] - kept.handover_gravity, rtol=0, atol=1e-14
    )
    np.testing.assert_array_equal(kept.arc_offsets[:, 0], start.arc_offsets[:, 0])
    np.testing.assert_array_equal(kept.arc_limits[:, 0], start.arc_limits[:, 0])


def test_a_body_that_turns_fast_pulls_no_more_than_is_known() -> None:
    """Two masses that turn by a fifth of a radian to either end of a while; the path is as good as known."""
    spin = 60.0 * SPIN_RAD_S
    body = Asteroid("two masses", rock(), spin, dipole_field(49.0, 0.5, 440.0), 49.0)
    case = landing_case(body, position_m=np.array([300.0, 100.0, 650.0]), tof_s=720.0)
    shared = survey(case)
    descent = descent_of(case, shared.bounds)
    facets = np.arange(0, 320, 40)
    kept = facets_of(descent, shared.centroids_m[facets] / descent.case.length_m, shared.normals[facets])
    least = least_value(descent, kept, first_weights(descent, kept))
    least = least._replace(value=np.full(len(facets), -1e-12))
    known = with_known_gravity(descent, shared.surface, kept, least)
    tighter = known.accelerations < kept.accelerations
    assert tighter.mean() > 0.2
    t = np.arange(STEPS + 1) / STEPS
    nodes = np.concatenate(
        [np.tile(descent.case.position, (len(facets), 1, 1)), least.outputs[:, :-1]], axis=1
    )
    c, s = np.cos(descent.case.spin * (t - 1.0)), np.sin(descent.case.spin * (t - 1.0))
    closest = 0.0
    for f in range(len(facets)):
        x, y, z = (np.interp(t, np.arange(NODES + 1) / NODES, nodes[f, :, i]) for i in range(3))
        turned = np.stack([c * x + s * y, c * y - s * x, z], axis=1) * descent.case.length_m
        g = accelerations(body.gravity, turned) / descent.case.acceleration_m_s2
        g = np.stack([c * g[:, 0] - s * g[:, 1], s * g[:, 0] + c * g[:, 1], g[:, 2]], axis=1)
        for k in np.flatnonzero(tighter[f]):
            here = g[k * STEPS // INTERVALS : (k + 1) * STEPS // INTERVALS + 1] - known.reference[f, k]
            share = np.linalg.norm(here, axis=1).max()
            share /= known.accelerations[f, k] - 1.0 / descent.least_mass[k]
            assert share <= 1.0
            closest = max(closest, share)
    assert closest > 0.05


def test_gravity_is_taken_where_the_body_is_turned_to() -> None:
    p, _, _ = flown("rock")
    descent, _, _ = climbed("rock")
    case, rng = descent.case, np.random.default_rng(8)
    points = rng.normal(size=(INTERVALS + 1, 3))
    points *= 700.0 / case.length_m / np.linalg.norm(points, axis=1, keepdims=True)
    time = np.arange(INTERVALS + 1) / INTERVALS
    balls = keep_out_gravity.Balls(points, np.full(len(time), 1e-9), time, 0.0)
    gravity, spread = keep_out_gravity._gravity_in(descent, p.shared.surface, balls)
    for k, x in enumerate(points):
        expected = gravity_in_space(case, case.node_cos[k], case.node_sin[k], *x)
        np.testing.assert_allclose(gravity[k], expected, rtol=1e-10, atol=0)
    assert spread.max() < 1e-6 * np.linalg.norm(gravity, axis=1).min()


def test_paths_that_bend_as_much_as_they_can_stay_in_the_balls() -> None:
    """Between nodes that are known exactly, with all thrust and gravity across the chord."""
    descent, _, least = climbed("rock")
    still = descent._replace(case=descent.case._replace(spin=0.0))
    along, _ = keep_out_gravity._balls(still, least._replace(value=np.full(len(least.value), -1e-300)))
    strongest = (1.0 / descent.least_mass + descent.gravity).max()
    nodes = np.concatenate(
        [np.tile(descent.case.position, (len(least.value), 1, 1)), least.outputs[:, :NODES]], axis=1
    )
    chord = np.diff(nodes, axis=1)
    across = np.cross(chord, [0.3, -0.5, 0.8])
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    width = BALLS * INTERVALS // NODES
    centre = along.centre.reshape(len(nodes), NODES, width, 3)
    radius = along.radius.reshape(len(nodes), NODES, width)
    tight = 0.0
    for ball in range(width):
        for share in np.linspace(ball / width, (ball + 1) / width, 7):
            bend = 0.5 * strongest * share * (1.0 - share) / NODES**2
            away = np.linalg.norm(nodes[:, :-1] + share * chord + bend * across - centre[:, :, ball], axis=2)
            assert (away <= radius[:, :, ball] * (1 + 1e-12)).all()
            tight = max(tight, float((away / radius[:, :, ball]).max()))
    assert tight > 0.8


FIELDS = {
    "point mass": point_mass_field(4.9),
    "dipole": dipole_field(4.9, 0.4, 250.0, 0.3),
    "harmonics": harmonics_field(4.9, 246.0, c20=-0.04, c22=0.01, s22=-0.006, c21=0.003, s21=-0.004),
}


@pytest.mark.parametrize("name", FIELDS)
def test_the_change_within_a_ball_is_bounded(name: str) -> None:
    field: GravityField = FIELDS[name]
    rng = np.random.default_rng(3)
    u = rng.normal(size=(60, 3))
    centre = u / np.linalg.norm(u, axis=1, keepdims=True) * rng.uniform(350.0, 900.0, (60, 1))
    radius = (np.linalg.norm(centre, axis=1) - 250.0) * rng.uniform(0.02, 0.9, 60)
    gravity = accelerations(field, centre)
    bound = keep_out_gravity._largest_change(field, centre, radius, gravity)
    v = rng.normal(size=(4000, 3))
    v *= (rng.random((4000, 1)) ** 0.2) / np.linalg.norm(v, axis=1, keepdims=True)
    changes = [accelerations(field, c + r * v) - g for c, r, g in zip(centre, radius, gravity, strict=True)]
    met = np.linalg.norm(changes, axis=2).max(axis=1)
    assert (met <= bound).all()
    assert np.median(bound / met) < 2.5


def test_the_change_around_a_point_mass_is_largest_towards_it() -> None:
    centre, radius = np.array([[0.0, 600.0, 0.0]]), np.array([100.0])
    field = point_mass_field(5.0)
    bound = keep_out_gravity._largest_change(field, centre, radius, accelerations(field, centre))[0]
    exact = 5.0 / 500.0**2 - 5.0 / 600.0**2
    assert exact <= bound < 2.0 * exact


def test_a_ball_that_touches_the_body_bounds_nothing() -> None:
    p, _, _ = flown("rock")
    descent, length = climbed("rock")[0], climbed("rock")[0].case.length_m
    centre = np.array([[0.0, 0.0, 400.0], [0.0, 0.0, 400.0], [0.0, 0.0, 100.0]]) / length
    radius = np.array([150.0, 170.0, 1.0]) / length  # the pole is at 240 m
    balls = keep_out_gravity.Balls(centre, radius, np.ones(3), 0.0)
    spread = keep_out_gravity._gravity_in(descent, p.shared.surface, balls)[1]
    np.testing.assert_array_equal(np.isinf(spread), [False, True, True])


@pytest.mark.parametrize("name", BODIES)
def test_known_gravity_proves_no_reachable_facet_unreachable(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However often it is looked at, and wherever the climb ended."""
    p, facets, _ = flown(name)
    monkeypatch.setattr(keep_out_ascent, "GAP", np.inf)
    monkeypatch.setattr(proofs, "NEAR", -np.inf)
    monkeypatch.setattr(proofs, "ROUNDS", 4)
    bounds, steps = proofs.bounds_outside(p, facets)
    assert np.isnan(bounds).all()
    assert steps.min() > 5
