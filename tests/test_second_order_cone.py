from __future__ import annotations

import numpy as np
import pytest
from kernel_calls import from_python

from landing_cli.optimize.second_order_cone import (
    UNBOUNDED,
    apply_inverse_scaling as apply_inverse_scaling_part,
    apply_inverse_scaling_squared as apply_inverse_scaling_squared_part,
    apply_scaling as apply_scaling_part,
    complementarity_shift as complementarity_shift_part,
    longest_step as longest_step_part,
    scaling_point as scaling_point_part,
)

apply_inverse_scaling = from_python(apply_inverse_scaling_part)
apply_inverse_scaling_squared = from_python(apply_inverse_scaling_squared_part)
apply_scaling = from_python(apply_scaling_part)
complementarity_shift = from_python(complementarity_shift_part)
longest_step = from_python(longest_step_part)
scaling_point = from_python(scaling_point_part)

J = np.diag([1.0, -1.0, -1.0, -1.0])
E = np.array([1.0, 0.0, 0.0, 0.0])


def interior(rng: np.random.Generator, gap: float) -> np.ndarray:
    """A point of the cone with s0 = (1 + gap) |s1|, of any size."""
    tail = rng.normal(size=3)
    return 10.0 ** rng.uniform(-3, 3) * np.array([(1.0 + gap) * np.linalg.norm(tail), *tail])


def pairs(gap_s: float, gap_z: float, count: int = 40) -> list[tuple[np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(11)
    return [(interior(rng, gap_s), interior(rng, gap_z)) for _ in range(count)]


def jordan(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.array([a @ b, *(a[0] * b[1:] + b[0] * a[1:])])


def scaled(s: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, float, tuple[float, ...]]:
    """The scaling point w, beta, and v of W = beta (2 v v' - J)."""
    *w, inverse_beta2 = scaling_point(*s, *z)
    w = np.array(w)
    return w, inverse_beta2**-0.5, tuple((w + E) / np.sqrt(2 * (w[0] + 1)))


def as_matrix(function, *leading) -> np.ndarray:
    return np.column_stack([function(*leading, *column) for column in np.eye(4)])


def blow_up(*gaps: float) -> float:
    """How round-off grows towards the boundary."""
    return 1.0 + 1.0 / min(gaps)


# How far from the boundary, relative.
GAPS = [(3.0, 3.0), (1e-2, 3.0), (3.0, 1e-2), (1e-4, 1e-4), (1e-7, 1.0)]


@pytest.mark.parametrize(("gap_s", "gap_z"), GAPS)
def test_one_scaling_takes_the_dual_and_the_slack_to_the_same_point(gap_s: float, gap_z: float) -> None:
    for s, z in pairs(gap_s, gap_z):
        w, beta, v = scaled(s, z)
        by_dual = np.array(apply_scaling(*v, beta, *z))
        by_slack = np.array(apply_inverse_scaling(*v, 1.0 / beta, *s))
        np.testing.assert_allclose(by_dual, by_slack, rtol=0, atol=1e-14 * blow_up(gap_s, gap_z) * by_dual[0])
        assert by_dual @ by_dual == pytest.approx(s @ z, rel=1e-14 * blow_up(gap_s, gap_z))
        assert abs(w @ J @ w - 1.0) < 1e-14 * blow_up(gap_s, gap_z) * (w @ w)


def test_the_scaling_is_symmetric_and_is_the_matrix_of_its_definition() -> None:
    for s, z in pairs(0.5, 0.2, 10):
        w, beta, v = scaled(s, z)
        W = as_matrix(apply_scaling, *v, beta)
        np.testing.assert_allclose(W, beta * (2 * np.outer(v, v) - J), rtol=1e-13, atol=1e-13 * beta)
        np.testing.assert_allclose(W @ z, np.linalg.solve(W, s), rtol=1e-11)
        inverse = as_matrix(apply_inverse_scaling, *v, 1.0 / beta)
        np.testing.assert_allclose(inverse @ W, np.eye(4), rtol=0, atol=1e-12 * (w @ w))


@pytest.mark.parametrize("gap", [3.0, 1e-2, 1e-4])
def test_the_inverse_squared_scaling_takes_the_slack_to_the_dual(gap: float) -> None:
    for s, z in pairs(gap, gap):
        w, beta, v = scaled(s, z)
        inverse = as_matrix(apply_inverse_scaling, *v, 1.0 / beta)
        squared = as_matrix(apply_inverse_scaling_squared, *w, beta**-2)
        np.testing.assert_allclose(
            squared, inverse @ inverse, rtol=0, atol=1e-14 * blow_up(gap) * np.abs(squared).max()
        )
        np.testing.assert_allclose(squared @ s, z, rtol=0, atol=1e-14 * blow_up(gap) ** 2 * z[0])


@pytest.mark.parametrize("gap", [2.0, 1e-2])
def test_the_shift_solves_the_corrector_equation(gap: float) -> None:
    rng = np.random.default_rng(5)
    for s, z in pairs(gap, gap):
        w, beta, v = scaled(s, z)
        W = beta * (2 * np.outer(v, v) - J)
        inverse = np.linalg.inv(W)
        affine_ds, affine_dz, ds = s[0] * rng.normal(size=4), z[0] * rng.normal(size=4), rng.normal(size=4)
        target = rng.uniform(0, 1) * (s @ z)
        shift = complementarity_shift(tuple(w), beta**-2, z, tuple(affine_ds), tuple(affine_dz), target)
        dz = shift - inverse @ inverse @ ds
        point = W @ z
        left = jordan(point, W @ dz + inverse @ ds)
        second_order = jordan(inverse @ affine_ds, W @ affine_dz)
        right = target * E - jordan(point, point) - second_order
        size = np.abs(second_order).max() + point @ point
        np.testing.assert_allclose(left, right, rtol=0, atol=1e-13 * blow_up(gap) ** 2 * size)


def test_without_target_and_correction_the_shift_is_the_dual_reversed() -> None:
    for s, z in pairs(0.3, 0.3, 10):
        *w, inverse_beta2 = scaling_point(*s, *z)
        zero = (0.0, 0.0, 0.0, 0.0)
        shift = complementarity_shift(tuple(w), inverse_beta2, z, zero, zero, 0.0)
        np.testing.assert_allclose(shift, -z, rtol=0, atol=1e-12 * z[0])


def test_on_the_central_path_the_centring_step_does_not_move() -> None:
    """With s = mu z^-1 the corrector with target mu asks for no change: ds = 0 goes with dz = 0."""
    for _, z in pairs(0.3, 0.3, 10):
        mu = 0.37 * z[0] ** 2
        s = mu * (J @ z) / (z @ J @ z)
        *w, inverse_beta2 = scaling_point(*s, *z)
        zero = (0.0, 0.0, 0.0, 0.0)
        shift = complementarity_shift(tuple(w), inverse_beta2, z, zero, zero, mu)
        np.testing.assert_allclose(shift, np.zeros(4), rtol=0, atol=1e-11 * z[0])


def in_cone(x: np.ndarray) -> bool:
    return bool(x[0] >= np.linalg.norm(x[1:]))


def step_by_bisection(s: np.ndarray, d: np.ndarray, most: float) -> float:
    low, high = 0.0, most
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if in_cone(s + middle * d) else (low, middle)
    return low


@pytest.mark.parametrize("gap", [2.0, 1e-2, 1e-5])
def test_the_longest_step_is_where_the_ray_leaves_the_cone(gap: float) -> None:
    rng = np.random.default_rng(3)
    stayed = left = 0
    for _ in range(400):
        s = interior(rng, gap)
        d = s[0] * rng.normal(size=4) * 10.0 ** rng.uniform(-2, 2)
        d[0] += abs(d[0]) * rng.choice([0.0, 1.0, 3.0])
        step = longest_step(*s, *d)
        if in_cone(d):
            assert step == UNBOUNDED
            stayed += 1
            continue
        left += 1
        assert step == pytest.approx(step_by_bisection(s, d, 1e6 * s[0]), rel=1e-11 * blow_up(gap), abs=0)
    assert stayed > 30
    assert left > 200


def test_a_ray_into_the_apex_stops_there() -> None:
    """Its two roots coincide, so that round-off may leave no root at all."""
    rng = np.random.default_rng(9)
    for _ in range(300):
        s, speed = interior(rng, rng.uniform(0.1, 3.0)), 10.0 ** rng.uniform(-2, 2)
        assert longest_step(*s, *(-speed * s)) == pytest.approx(1.0 / speed, rel=1e-6)


def test_the_longest_step_in_special_directions() -> None:
    inside = (2.0, 1.0, 0.0, 0.0)
    assert longest_step(*inside, 0.0, 0.0, 0.0, 0.0) == UNBOUNDED
    assert longest_step(*inside, 1.0, 1.0, 0.0, 0.0) == UNBOUNDED  # along the boundary, outwards
    assert longest_step(*inside, -1.0, -0.5, 0.0, 0.0) == pytest.approx(2.0, rel=1e-15)  # through the apex
    assert longest_step(*inside, -1.0, -1.0, 0.0, 0.0) == pytest.approx(1.5, rel=1e-15)  # light-like, inwards
    assert longest_step(*inside, 1.0, -1.0, 0.0, 0.0) == UNBOUNDED
    assert longest_step(*inside, 0.0, 1.0, 0.0, 0.0) == pytest.approx(1.0, rel=1e-15)
