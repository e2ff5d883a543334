"""Extremals by RK4: tangents of the discrete map, order, and agreement with an independent integrator."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python, used
from numpy.testing import assert_allclose

from landing_cli.body.gravity.harmonics import harmonics_field
from landing_cli.flight.control import sampled_control
from landing_cli.flight.extremal import extremal_scale, scaled_start
from landing_cli.flight.gauss import fly_sampled
from landing_cli.flight.legs import CostateLeg
from landing_cli.reach.costate_dynamics import (
    CORE,
    Extremal,
    Field,
    fly_extremal as fly_extremal_part,
    new_extremal,
    new_tangents,
    tangents as tangents_part,
)

fly_extremal = from_python(fly_extremal_part)
tangents = from_python(tangents_part)

SPIN = 2.0 * np.pi / (4.288 * 3600.0)
EXHAUST = 400.0 * 9.80665
GRAVITY = harmonics_field(4.892, 246.0, -0.03922, 0.003742)
SCALE = extremal_scale(20.0, 2000.0, EXHAUST, 500.0, SPIN)
FIELD = Field(GRAVITY.kind, GRAVITY.params, SCALE, SCALE.length_m / np.array([290.0, 280.0, 266.0]))
START, REST = np.array([100.0, -50.0, 780.0]), np.array([0.02, -0.01, 0.0])

THROTTLED = np.array([0.2, -0.1, 0.9, 0.1, -0.05, 0.6, 0.1])
SATURATES = np.array([0.3, -0.4, 1.9, 0.2, -0.1, 1.1, 0.5])
REVERSES = np.array([4.4, -10.1, 28.3, 2.2, -5.1, 14.1, 6.5])  # full thrust but for seconds
TURNS = np.array([6.3, -12.4, 27.9, 2.2, -5.1, 14.1, 6.5])  # at full thrust
COSTATES = {"throttled": THROTTLED, "saturates": SATURATES, "reverses": REVERSES, "turns": TURNS}


def fly(costates: np.ndarray, n_steps: int = 30) -> tuple[Extremal, int]:
    extremal = used(new_extremal(n_steps))
    extremal.state[0, 14] = 0.0
    extremal.state[0, :14] = scaled_start(SCALE, START, REST, costates)
    return extremal, fly_extremal(FIELD, extremal)


def end(costates: np.ndarray, n_steps: int = 30) -> np.ndarray:
    extremal, k = fly(costates, n_steps)
    return extremal.state[k].copy()


@pytest.mark.parametrize("name", COSTATES)
def test_tangents_are_those_of_the_discrete_map(name: str) -> None:
    costates = COSTATES[name]
    extremal, k = fly(costates)
    of = used(new_tangents(30))
    tangents(FIELD, extremal, k, of)
    X, nodes = of.end, of.nodes
    h = 2e-5 * np.abs(costates).max()
    differences = np.zeros((len(X), 7))
    for j, unit in enumerate(np.eye(7) * h):
        near = end(costates + unit) - end(costates - unit)
        far = end(costates + 2.0 * unit) - end(costates - 2.0 * unit)
        differences[:, j] = (8.0 * near - far) / (12.0 * h)
    if name in ("saturates", "reverses"):
        assert np.any(extremal.part[:k] == 0.0)  # a step ends at a switch
    assert_allclose(X[:, :7], differences, rtol=0, atol=1e-8)
    assert_allclose(nodes[k], X[:6], rtol=1e-15)


def test_steps_are_halved_where_full_thrust_turns_fast() -> None:
    extremal, k = fly(TURNS)
    assert np.any((extremal.part[:k] > 0.0) & (extremal.part[:k] < 1.0))
    assert_allclose(extremal.step[:k].sum(), 1.0, rtol=1e-13)


def test_the_scheme_is_of_order_four_across_a_switch() -> None:
    truth = end(SATURATES, 960)
    errors = [np.abs(end(SATURATES, n) - truth)[:14].max() for n in (30, 60, 120)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all(orders > 3.8)


@pytest.mark.parametrize(
    ("name", "limit_m"), [("throttled", 1e-4), ("saturates", 1e-3), ("reverses", 0.05), ("turns", 0.05)]
)
def test_thirty_steps_arrive_where_the_independent_integrator_does(name: str, limit_m: float) -> None:
    leg = CostateLeg(500.0, COSTATES[name], START, REST, 2000.0, 20.0, GRAVITY)
    control = sampled_control(leg, SPIN, EXHAUST)
    states = np.zeros((len(control.knots), 7))
    states[0] = [*START, *REST, 2000.0]
    fly_sampled(FIELD.kind, FIELD.params, SPIN, EXHAUST, control.steps_s, control.stages, False, states)
    arrived = end(COSTATES[name])
    assert_allclose(arrived[:3] * SCALE.length_m, states[-1, :3], rtol=0, atol=limit_m)
    assert_allclose(arrived[6] * 2000.0, states[-1, 6], rtol=0, atol=limit_m)


@pytest.mark.parametrize("name", COSTATES)
def test_the_costates_are_the_gradient_of_the_energy(name: str) -> None:
    """dJ = -lambda . dx at the end, and dx x dlambda vanishes: the flow is symplectic."""
    extremal, k = fly(COSTATES[name], 120)
    of = used(new_tangents(120))
    tangents(FIELD, extremal, k, of)
    X = of.end
    S, P, costates = X[:7, :7], X[7:14, :7], extremal.state[k, 7:14]
    assert_allclose(X[14, :7], -costates @ S, rtol=0, atol=2e-5 * np.abs(costates @ S).max() + 1e-9)
    bracket = S.T @ P
    assert_allclose(bracket, bracket.T, rtol=0, atol=1e-5 * np.abs(bracket).max())


def test_within_the_core_gravity_is_that_of_its_surface() -> None:
    inside = new_extremal(30)
    inside.state[0, :14] = scaled_start(SCALE, [1.0, 0.0, 2.0], [0.0, 0.0, 0.0], 1e-9 * THROTTLED)
    fly_extremal(FIELD, inside)
    step = inside.step[0]
    pull = inside.state[1, 3:6] / step * SCALE.acceleration_m_s2
    at_the_core = 4.892 / (CORE * 266.0) ** 2
    assert 0.1 * at_the_core < np.linalg.norm(pull) < 2.0 * at_the_core
