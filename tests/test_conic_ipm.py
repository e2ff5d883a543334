"""The interior-point step against a dense Newton system, and its limit against Clarabel."""

from __future__ import annotations

import numpy as np
import pytest
from conic_oracles import ByClarabel, DenseNewton, Sizes, copy_of, iterate, rows_on_thrust
from kernel_calls import from_python

from landing_cli.optimize.conic_ipm import (
    FRACTION_TO_BOUNDARY,
    advance,
    fill_row_pull as fill_row_pull_part,
    residuals,
)
from landing_cli.optimize.conic_records import Model, Point, Step, new_model, new_point, new_step

fill_row_pull = from_python(fill_row_pull_part)

BASIS = 11  # functionals that rows are mixed of: enough for rows that are independent of each other

SIZES = {
    "energy": Sizes(6, 4, 6, 6, False),
    "margin": Sizes(6, 4, 6, 6, True),
    "energy with inequalities": Sizes(7, 3, 6, 10, False),
    "margin with inequalities": Sizes(7, 3, 6, 10, True),
    "row in y alone": Sizes(6, 4, 7, 9, True),
}


def cone_point(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    tail = rng.normal(size=(*shape, 3))
    head = np.linalg.norm(tail, axis=-1, keepdims=True) * rng.uniform(1.1, 3.0, (*shape, 1))
    return np.concatenate([head, tail], axis=-1)


def random_problem(sizes: Sizes, seed: int = 0) -> tuple[Point, Model]:
    """A convex problem at an interior point, nothing of it in balance, with rows of every reach."""
    rng = np.random.default_rng(seed)
    n, j, r = sizes.nodes, sizes.cones, sizes.rows
    point, model = new_point(n, j, r), new_model(n, j, r, BASIS)
    point.thrust[:] = rng.normal(size=(n, 3)) * 0.3
    point.node_dual[:] = cone_point(rng, (n,)) / n
    point.y[:] = rng.normal(size=7)
    point.y[0] = 1.2 * np.linalg.norm(point.thrust, axis=1).max()
    point.cone_slack[:], point.cone_dual[:] = cone_point(rng, (j,)), cone_point(rng, (j,))
    point.multiplier[:] = rng.normal(size=r)
    point.multiplier[sizes.equal :] = -rng.uniform(0.1, 2.0, r - sizes.equal)
    point.slack[sizes.equal :] = rng.uniform(0.1, 2.0, r - sizes.equal)
    model.row_value[:] = rng.normal(size=r)
    model.row_y[:] = rng.normal(size=(r, 7))
    model.row_end[:] = n
    model.row_end[sizes.equal :] = rng.integers(1, n + 1, r - sizes.equal)
    if sizes.equal == 7:
        model.row_end[6] = 0
    model.row_live[:] = 1.0
    model.row_mix[:], model.basis[:] = rng.normal(size=(r, BASIS)), rng.normal(size=(n, BASIS, 3))
    model.row_mix[:] = 0.2 * model.row_mix + np.eye(r, BASIS)
    model.row_mix[:6] = np.eye(6, BASIS)
    model.cone_map[:], model.cone_offset[:] = rng.normal(size=(j, 4, 7)), rng.normal(size=(j, 4))
    model.thrust_gradient[:] = rng.normal(size=(n, 3)) / n
    model.thrust_curvature[:] = rng.uniform(0.5, 2.0, n) / n
    model.y_gradient[:] = rng.normal(size=7)
    half = rng.normal(size=(7, 7))
    model.y_hessian[:] = 0.1 * half @ half.T
    fill_row_pull(point, model, r)
    return point, model


def stepped(point: Point, model: Model, sizes: Sizes, least_target: float = 0.0) -> tuple[Step, float, float]:
    """Take one step in place; return the scratch space, the step's length and the gap before it."""
    step = new_step(sizes.nodes, sizes.cones, sizes.rows, BASIS)
    counts = sizes.equal, sizes.rows, sizes.cones
    _, _, gap = residuals(point, model, step, *counts, sizes.tau_free)
    return step, advance(point, model, step, *counts, gap, least_target, sizes.tau_free), gap


@pytest.mark.parametrize("name", SIZES)
def test_residuals_are_those_of_the_optimality_conditions(name: str) -> None:
    sizes = SIZES[name]
    point, model = random_problem(sizes)
    dense, step = DenseNewton(point, model, sizes), new_step(sizes.nodes, sizes.cones, sizes.rows, BASIS)
    primal, dual, gap = residuals(point, model, step, sizes.equal, sizes.rows, sizes.cones, sizes.tau_free)
    expected = dense.residuals()
    np.testing.assert_allclose(step.node_residual.ravel(), expected["F"], rtol=0, atol=1e-14)
    np.testing.assert_allclose(step.y_residual, expected["y"], rtol=0, atol=1e-13)
    np.testing.assert_allclose(step.row_residual, expected["rows"], rtol=0, atol=1e-14)
    np.testing.assert_allclose(step.cone_residual.ravel(), expected["cones"], rtol=0, atol=1e-13)
    assert gap == pytest.approx(dense.gap(), rel=1e-13)
    assert primal == pytest.approx(np.abs(np.r_[expected["rows"], expected["cones"]]).max(), rel=1e-13)
    on_thrust = sizes.nodes * np.abs(expected["F"]).max()
    assert dual == pytest.approx(max(on_thrust, np.abs(expected["y"]).max()), rel=1e-13)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", SIZES)
def test_a_step_is_the_newton_step_of_the_whole_dense_system(name: str, seed: int) -> None:
    """Predictor, its step length, the centring target and the corrector, each done again densely."""
    sizes = SIZES[name]
    # eliminating a row in y alone divides by its tiny regularisation
    tolerance = 1e-7 if sizes.equal == 7 else 1e-10
    point, model = random_problem(sizes, seed)
    before = copy_of(point)
    dense = DenseNewton(before, model, sizes)
    step, length, gap = stepped(point, model, sizes)
    degree = sizes.nodes + sizes.cones + sizes.rows - sizes.equal
    predictor = dense.direction(0.0, None)
    affine = min(1.0, dense.longest(predictor))
    corrector = dense.direction((1.0 - affine) ** 3 * gap / degree, predictor)
    assert length == pytest.approx(min(1.0, FRACTION_TO_BOUNDARY * dense.longest(corrector)), rel=tolerance)
    found = {
        "F": step.d_thrust, "zn": step.d_node_dual, "y": step.d_y, "s": step.d_cone_slack,
        "z": step.d_cone_dual, "l": step.d_multiplier, "t": step.d_slack[sizes.equal :],
    }  # fmt: skip
    atol = tolerance * max(np.abs(corrector[key]).max(initial=0.0) for key in found)
    for key, value in found.items():
        np.testing.assert_allclose(value.ravel(), corrector[key], rtol=0, atol=atol, err_msg=key)
    moved = {
        "thrust": "F", "node_dual": "zn", "y": "y", "cone_slack": "s", "cone_dual": "z", "multiplier": "l",
    }  # fmt: skip
    for field, key in moved.items():
        expected = getattr(before, field).ravel() + length * corrector[key]
        np.testing.assert_allclose(getattr(point, field).ravel(), expected, rtol=0, atol=atol, err_msg=field)
    slack = before.slack[sizes.equal :] + length * corrector["t"]
    np.testing.assert_allclose(point.slack[sizes.equal :], slack, rtol=0, atol=atol)


def test_the_centring_target_has_a_floor() -> None:
    sizes = SIZES["energy with inequalities"]
    point, model = random_problem(sizes)
    dense = DenseNewton(copy_of(point), model, sizes)
    predictor = dense.direction(0.0, None)
    step, _, _ = stepped(point, model, sizes, least_target=3.0)
    corrector = dense.direction(3.0, predictor)
    scale = np.abs(corrector["F"]).max()
    np.testing.assert_allclose(step.d_thrust.ravel(), corrector["F"], rtol=0, atol=1e-9 * scale)


# A convex problem, frozen: the model is moved with the point, and the iterations must reach its optimum.


def frozen_problem(sizes: Sizes, seed: int) -> tuple[Point, Model]:
    """A feasible bounded problem: rows and cones hold, with room, at a known point."""
    rng = np.random.default_rng(seed)
    point, model = random_problem(sizes, seed)
    model.cone_map[:, 0, :] = 0.0
    model.cone_map[:, 0, 0] = rng.uniform(0.8, 1.2, sizes.cones)
    known_thrust, known_y = rng.normal(size=(sizes.nodes, 3)), 0.3 * rng.normal(size=7)
    known_thrust *= 0.6 / np.linalg.norm(known_thrust, axis=1, keepdims=True)
    known_y[0] = 1.0
    point.thrust[:], point.y[:] = 0.0, 0.0
    point.y[0] = 1.2 if sizes.tau_free else 1.0
    inside = cone_point(rng, (sizes.cones,)) * 0.3
    model.cone_offset[:] = inside - model.cone_map @ known_y
    rows = rows_on_thrust(model)
    model.row_value[:] = -rows @ known_thrust.ravel() - model.row_y @ (known_y - point.y)
    model.row_value[sizes.equal :] += rng.uniform(0.0, 0.2, sizes.rows - sizes.equal)
    model.y_gradient[0] = 1.0 if sizes.tau_free else 0.0
    model.y_hessian[0, :] = model.y_hessian[:, 0] = 0.0
    model.y_hessian[1:, 1:] += 0.1 * np.eye(6)
    scale = np.linalg.norm(model.cone_map @ point.y + model.cone_offset, axis=1)
    point.cone_slack[:, 0], point.cone_slack[:, 1:] = scale + 0.1, 0.0
    point.cone_dual[:, 0], point.cone_dual[:, 1:] = 0.1, 0.0
    point.node_dual[:, 0], point.node_dual[:, 1:] = 0.5 / sizes.nodes, 0.0
    point.multiplier[: sizes.equal], point.multiplier[sizes.equal :] = 0.0, -0.1
    point.slack[sizes.equal :] = 0.1
    fill_row_pull(point, model, sizes.rows)
    return point, model


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("name", SIZES)
def test_iterations_on_frozen_data_end_at_clarabels_optimum(name: str, seed: int) -> None:
    sizes = SIZES[name]
    point, model = frozen_problem(sizes, seed)
    truth = ByClarabel(point, model, sizes)
    objective, iterations = iterate(point, model, sizes)
    assert iterations < 20
    assert objective == pytest.approx(truth.objective, abs=2e-7)
    for field in ("thrust", "y", "multiplier", "node_dual", "cone_dual"):
        np.testing.assert_allclose(
            getattr(point, field), getattr(truth, field), rtol=0, atol=2e-4, err_msg=field
        )
