"""What a path costs and which limits it breaks: closed forms, quadrature, and paths with a known fault."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad
from seeing_samples import landmarks_at, observe_case
from shape_helpers import box

from landing_cli.observe.observed import Seen
from landing_cli.observe.path_samples import positions_at
from landing_cli.observe.path_values import (
    control_energy,
    limits_along,
    path_of,
    samples_between,
    velocity_increments,
)
from landing_cli.observe.records import ObserveCase

TIMES = np.array([0.0, 1.5, 4.0, 4.5, 9.0])


def by_quadrature(values: np.ndarray, power: int) -> float:
    def size(t: float) -> float:
        u = [np.interp(t, TIMES, column) for column in values.T]
        return float(np.linalg.norm(u)) ** power

    pieces = [edge for a, b in pairwise(TIMES) for edge in (a, 0.5 * (a + b))] + [TIMES[-1]]
    return sum(quad(size, a, b, epsabs=0, epsrel=1e-13, limit=200)[0] for a, b in pairwise(pieces))


@pytest.mark.parametrize("seed", range(4))
def test_energy_and_increment_are_the_integrals_of_a_linear_thrust(seed: int) -> None:
    u = np.random.default_rng(seed).normal(size=(5, 3))
    assert control_energy(TIMES, u) == pytest.approx(by_quadrature(u, 2), rel=1e-12)
    assert velocity_increments(TIMES, u)[-1] == pytest.approx(by_quadrature(u, 1), rel=1e-11)


@pytest.mark.parametrize(
    "u",
    [
        np.tile([3.0, 4.0, 0.0], (5, 1)),  # constant
        np.outer([-2.0, -1.0, 1.0, 1.0, 3.0], [1.0, 0.0, 0.0]),  # through zero, along a line
        np.zeros((5, 3)),
        np.tile([3.0, 4.0, 0.0], (5, 1)) + 1e-9 * np.arange(15).reshape(5, 3),  # hardly any change
        np.tile([3.0, 4.0, 0.0], (5, 1)) + 0.02 * np.arange(15).reshape(5, 3),  # about the threshold
    ],
)
def test_the_increment_is_exact_where_a_closed_form_could_cancel(u: np.ndarray) -> None:
    expected = by_quadrature(u, 1)
    assert velocity_increments(TIMES, u)[-1] == pytest.approx(expected, rel=1e-12, abs=1e-300)


def test_samples_are_those_of_the_cubics_through_the_nodes() -> None:
    def states(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        r = np.stack([t**3, 2 * t**2 - t, 1 + t], axis=1)
        v = np.stack([3 * t**2, 4 * t - 1, np.ones_like(t)], axis=1)
        return r, v

    r, v = states(TIMES)
    points = samples_between(TIMES, r, v)
    fine = np.concatenate([np.linspace(a, b, 6)[:-1] for a, b in pairwise(TIMES)] + [TIMES[-1:]])
    np.testing.assert_allclose(points, states(fine)[0], rtol=1e-13, atol=1e-13)


def landing(**changes: Any) -> ObserveCase:
    """Onto a side of a cube of 100 m."""
    mesh = box((100.0, 100.0, 100.0))
    side = np.array([100.0, 50.0, 40.0])
    return observe_case(mesh, landmarks_at(mesh, side), side, **changes)


def straight(case: ObserveCase, start_site_m: Any, thrust_n: float = 1.0, status: Any = "planned") -> Any:
    """A straight way to the site with a constant thrust; it obeys no dynamics, which nothing here asks."""
    t = np.linspace(0.0, 100.0, 41)
    start = case.frame.to_body(np.array(start_site_m, dtype=np.float64))
    r = start + np.outer(t / 100.0, case.frame.origin_m - start)
    v = np.tile((case.frame.origin_m - start) / 100.0, (41, 1))
    u = np.tile([thrust_n / case.spacecraft.mass_kg, 0.0, 0.0], (41, 1))
    return path_of(case, t, r, v, u, status, "found", 3)


def test_a_path_that_keeps_everything_stays_planned() -> None:
    path = straight(landing(), [0.0, 0.0, 80.0])
    assert (path.status, path.message, path.iterations) == ("planned", "found", 3)
    assert path.clearance_min_m == pytest.approx(10.0, abs=0.5)  # at the edge of the ball about the site
    assert path.glide_slope_max_rad == pytest.approx(0.0, abs=1e-7)
    assert path.peak_thrust_n == pytest.approx(1.0, rel=1e-12)  # at the start, on the initial mass
    assert path.delta_v_m_s == pytest.approx(100.0 / 500.0, rel=1e-12)
    burnt = 1.0 - np.exp(-path.delta_v_m_s / (200.0 * 9.80665))
    assert path.propellant_mass_fraction == pytest.approx(burnt, rel=1e-12)


@pytest.mark.parametrize(
    ("start", "changes", "thrust_n", "words"),
    [
        ([0.0, 0.0, -40.0], {}, 1.0, "the path cuts the terrain, 4"),
        ([30.0, 0.0, 12.0], {"clearance_m": 15.0}, 1.0, "m of the terrain, 15 m is asked"),
        (
            [30.0, 0.0, 30.0],
            {"glide_slope_half_angle_rad": np.radians(40.0)},
            1.0,
            "leaves the glide slope: 45.00 deg from the site's z, 40 are allowed",
        ),
        ([0.0, 0.0, 80.0], {}, 21.0, "the path needs 21 N, the thruster gives 20 N"),
    ],
)
def test_a_broken_limit_makes_a_path_infeasible_and_is_named(
    start: Any, changes: Any, thrust_n: float, words: str
) -> None:
    path = straight(landing(**changes), start, thrust_n)
    assert path.status == "infeasible" and words in path.message


def test_a_solver_that_found_nothing_keeps_its_own_words() -> None:
    path = straight(landing(), [0.0, 0.0, -40.0], status="unresolved")
    assert (path.status, path.message) == ("unresolved", "found")


def test_inside_the_ball_about_the_site_only_the_terrain_counts() -> None:
    case = landing(clearance_m=50.0, clearance_free_m=200.0)
    assert straight(case, [0.0, 0.0, 80.0]).clearance_min_m == np.inf
    clearance, _ = limits_along(case, straight(case, [0.0, 0.0, -3.0]).position_m)
    assert clearance == pytest.approx(-3.0, abs=0.01)


@pytest.mark.parametrize(
    ("seen", "gap_s"),
    [
        ([1, 1, 1], 0.0),
        ([0, 1, 1], 1.0),
        ([1, 0, 0, 1], 3.0),
        ([1, 0, 0], 2.0),
        ([0, 0, 0], 2.0),
        ([1, 0, 1, 1], 2.0),
    ],
)
def test_the_longest_gap_counts_stretches_without_a_landmark(seen: list[int], gap_s: float) -> None:
    visible = np.array(seen, dtype=bool)[:, None]
    assert Seen(np.arange(len(seen)) * 1.0, visible, {}, False).longest_gap_s == gap_s


def test_positions_between_nodes_agree_with_the_samples() -> None:
    path = straight(landing(), [40.0, 0.0, 80.0])
    fine = np.linspace(0.0, 100.0, 201)
    np.testing.assert_allclose(
        positions_at(path, fine), samples_between(path.t_s, path.position_m, path.velocity_m_s), atol=1e-9
    )
